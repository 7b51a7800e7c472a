"""Command line: ``digiclay``, ``python -m digiclay``, and ``blender --command digiclay``.

What the commands need is imported in `main`, where Ctrl-C is looked after already.
"""

import gc
import os
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from functools import partial
from typing import NoReturn

from .commands.stop import STOPPED, WRONG, defer_interrupt
from .core.base.errors import DigiclayError, one_line

#: What tells the libraries behind numpy's products on how many cores to work.
CORES = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; return its exit code: 0, 2 for what a user can mend, 130 when stopped."""
    return carry_out(partial(_parsed, argv))


def carry_out(parse: Callable[[], Namespace]) -> int:
    """Read arguments and carry out the command they name; return its exit code, as `main` does."""
    os.environ["MPLBACKEND"] = "agg"  # a notebook's is one that matplotlib cannot always import
    try:
        arguments = parse()
        code: int = arguments.carry_out(arguments)
    except SystemExit as done:  # --help, --version, or arguments that make no sense
        return done.code if isinstance(done.code, int) else 0
    except DigiclayError as error:
        return _wrong(error)
    except MemoryError:
        return _wrong("There is not enough memory: use fewer cells, or a higher recorder.every.")
    except BrokenPipeError:
        raise
    except OSError as error:
        return _wrong(f"{error.filename or 'A file'} cannot be used: {error.strerror or error}.")
    except KeyboardInterrupt:
        print("Stopped; no file is half-written.", file=sys.stderr)
        return STOPPED
    return code


def _parsed(argv: Sequence[str] | None = None) -> Namespace:
    """Read the arguments."""
    with defer_interrupt():
        from .commands.parser import parser

        words = sys.argv[1:] if argv is None else argv
        return parser(*words[:1]).parse_args(words)


def _wrong(error: object) -> int:
    """Print an error in one line, and return the exit code."""
    print(one_line(error), file=sys.stderr)
    return WRONG


def console() -> NoReturn:
    """Run `main` as a program."""
    run_as_program(_parsed)


def run_as_program(parse: Callable[[], Namespace]) -> NoReturn:
    """Read arguments, carry out the command they name, and leave with its exit code.

    On one core, unless the environment says otherwise: a session's products are small, and a second
    thread would spend its time waiting for the next, which counts as well. What is imported by then
    is never searched for garbage, which would take a seventh of a short command; Blender's module
    is imported later.
    """

    def parse_and_freeze() -> Namespace:
        gc.disable()
        try:
            return parse()
        finally:
            gc.freeze()
            gc.enable()

    for name in CORES:  # read when numpy is imported, which it has not been yet
        os.environ.setdefault(name, "1")
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed, or of a program without a terminal
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
        getattr(sys, name).reconfigure(errors="replace")  # a terminal may not know µ
    try:
        code = carry_out(parse_and_freeze)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader of the output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    sys.exit(code)
