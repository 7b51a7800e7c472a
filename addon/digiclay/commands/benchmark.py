"""``digiclay benchmark``: what a session costs, how exact it is, and what it withstands.

One file a benchmark; this one only gathers them.
"""

from __future__ import annotations

from typing import Any

from . import (
    benchmark_export,
    benchmark_precision,
    benchmark_scale,
    benchmark_session,
    benchmark_stack,
    benchmark_stiff,
    benchmark_terms,
    benchmark_viewport,
)
from .arguments import add_command
from .benchmark_session import PARTS, Clock, measured

__all__ = ["PARTS", "Clock", "add", "measured"]

EXAMPLES = """\
examples:
  digiclay benchmark session        what a control period costs, part by part
  digiclay benchmark stiff          what the steppers withstand
  digiclay benchmark precision      error against run time, beside SciPy
  digiclay benchmark terms tap      what each part of the model costs, and what leaving it out does
  digiclay benchmark scale          a control period from 625 pins to a million
  digiclay benchmark stack          sessions a second, one at a time and many in one call
  digiclay benchmark export         writing a bed as a mesh, from 625 pins to a million
  digiclay benchmark viewport       a tick of a live session in Blender
"""


def add(commands: Any) -> None:
    """Add the command."""
    parser = add_command(commands, "benchmark", "measure cost, error and stability", EXAMPLES)
    kinds = parser.add_subparsers(title="benchmarks", metavar="WHAT", required=True)
    for kind in (
        benchmark_session, benchmark_stiff, benchmark_precision, benchmark_terms, benchmark_scale,
        benchmark_export, benchmark_viewport, benchmark_stack,
    ):  # fmt: skip
        kind.add(kinds)
