"""The parser of all benchmarks: one file a benchmark; this one only gathers them."""

from __future__ import annotations

import argparse

from digiclay.commands.arguments import Help
from digiclay.commands.parser import Parser

from . import bed_size, mesh_export, precision, runs_together, session_parts, stiff, terms, viewport

__all__ = ["parser"]

EXAMPLES = """\
examples:
  python -m benchmarks session        what a control period costs, part by part
  python -m benchmarks stiff          what the steppers withstand
  python -m benchmarks precision      error against run time, beside SciPy
  python -m benchmarks terms tap      what each part of the model costs, and what leaving it out does
  python -m benchmarks scale          a control period from 625 pins to a million
  python -m benchmarks stack          sessions a second, one at a time and many in one call
  python -m benchmarks export         writing a bed as a mesh, from 625 pins to a million
  python -m benchmarks viewport       a tick of a live session in Blender
"""


def parser() -> argparse.ArgumentParser:
    """Return the parser of all benchmarks."""
    top = Parser(
        prog="python -m benchmarks",
        description="Measure cost, error and stability.",
        epilog=EXAMPLES,
        formatter_class=Help,
        allow_abbrev=False,
    )
    kinds = top.add_subparsers(title="benchmarks", metavar="WHAT", required=True, parser_class=Parser)
    for kind in (session_parts, stiff, precision, terms, bed_size, mesh_export, viewport, runs_together):
        kind.add(kinds)
    return top
