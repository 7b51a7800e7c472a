"""Versions and machine of a measurement, as one line."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from pathlib import Path

import numpy as np

from .. import __version__


def describe_machine(*packages: str) -> str:
    """Return one line: versions, those of more packages too, and the kind of machine."""
    versions = [f"digiclay {__version__}", f"Python {platform.python_version()}", f"numpy {np.__version__}"]
    versions += [f"{name} {importlib.metadata.version(name)}" for name in packages]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return ", ".join(versions) + f"; {platform.system()}, {platform.machine()}, {_processor()}, {cores} cores"


def _processor() -> str:
    """Return the processor's name where the system tells it."""
    told = Path("/proc/cpuinfo")
    lines = told.read_text(encoding="utf-8").splitlines() if told.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown processor"
