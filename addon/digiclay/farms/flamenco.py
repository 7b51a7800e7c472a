"""Flamenco 3: a job of the type that ``digiclay_series.js`` compiles on the Manager."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from .series_plan import Task, split_frames

#: The job type's script; its name without ending, with - for _, is the type's.
SCRIPT = Path(__file__).with_name("digiclay_series.js")
#: Flamenco's names of systems.
PLATFORMS = {"win32": "windows", "darwin": "darwin"}


def format_job(name: str, tasks: Sequence[Task], program: Sequence[str], series: str) -> str:
    """Return a job as the Manager takes it.

    `tasks`: each after those it needs; `program`: path of the program, and its arguments before those of
    digiclay; `series`: folder of the series.
    """
    parts = split_frames(tuple(tasks))
    places = {part.name: number for number, part in enumerate(parts)}
    plan = [
        {
            "name": part.name, "type": "blender" if part.blender else "misc", "command": part.command,
            "folder": part.folder, "options": part.options, "needs": [places[need] for need in part.needs],
        }
        for part in parts
    ]  # fmt: skip
    settings = {
        "program": program[0],
        "program_args": json.dumps(program[1:], ensure_ascii=False),
        "series": series,
        "tasks": json.dumps(plan, ensure_ascii=False),
    }
    job = {
        "name": name,
        "type": SCRIPT.stem.replace("_", "-"),
        "priority": 50,
        "submitter_platform": PLATFORMS.get(sys.platform, "linux"),
        "metadata": {"project": "digiclay"},
        "settings": settings,
    }
    return json.dumps(job, indent=1, ensure_ascii=False) + "\n"
