"""``digiclay page``: the page of a job series, from what its folder holds."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from .arguments import add_command
from .batch_folder import read_batch

EXAMPLES = """\
examples:
  digiclay batch first --submit openjd      files for a render farm; its last task is this command
  digiclay page first                       write first/index.html from the runs that are done

It needs neither the JOBS file nor Blender. Exit code 0 also while jobs are missing.
"""


def add(commands: Any) -> None:
    """Add the command."""
    said = "write the page of a job series from the runs that are done"
    parser = add_command(commands, "page", said, EXAMPLES)
    parser.add_argument("series", metavar="DIR", type=Path, help="the folder of the series")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Write the page."""
    series = read_batch(arguments.series)
    said = series.write_page()
    if not arguments.quiet:
        print(f"{said}; written to {arguments.series / 'index.html'}")
    return 0
