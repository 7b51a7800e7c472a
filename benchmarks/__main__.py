"""Command ``python -m benchmarks``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from digiclay.cli import carry_out, run_as_program


def main(argv: Sequence[str] | None = None) -> int:
    """Run a benchmark; return its exit code, as `digiclay.cli.main` does.

    What the benchmarks need is imported only here: numpy after its number of cores is set.

    `argv`: the arguments; by default those of the process.
    """

    def parse() -> argparse.Namespace:
        from .kinds import parser

        return parser().parse_args(argv)

    return carry_out(parse)


if __name__ == "__main__":
    run_as_program(main)
