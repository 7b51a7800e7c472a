"""Command ``python -m benchmarks``."""

import argparse
from collections.abc import Sequence
from functools import partial

from digiclay.cli import carry_out, run_as_program


def main(argv: Sequence[str] | None = None) -> int:
    """Run a benchmark; return its exit code, as `digiclay.cli.main` does."""
    return carry_out(partial(parse, argv))


def parse(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the arguments."""
    from .kinds import parser  # imports numpy, whose number of cores is set before

    return parser().parse_args(argv)


if __name__ == "__main__":
    run_as_program(parse)
