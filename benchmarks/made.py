"""``python -m benchmarks made``: things formed by recorded strokes, beside what was intended."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from digiclay.commands.refusals import refuse_unwritable, refuse_without_blender
from digiclay.commands.tables import table
from digiclay.settings.beds import BEDS

from .intended_reliefs import RELIEFS
from .report import add_kind, kept, made_with, progress

if TYPE_CHECKING:  # Blender is imported when it is needed
    from .made_things import Made

EXAMPLES = """\
  python -m benchmarks made
  python -m benchmarks made letter_a --bed paper
  python -m benchmarks made leaf face --pictures made
"""
HEAD = ("thing", "bed", "strokes", "simulated", "correlation", "slope", "rms", "rms of relief", "CPU")


def add(kinds: Any) -> None:
    """Add the benchmark."""
    parser = add_kind(
        kinds, "made", "things formed by recorded strokes, beside the intended relief", EXAMPLES
    )
    parser.add_argument("things", nargs="*", metavar="THING", type=_thing, help=", ".join(RELIEFS))
    parser.add_argument("--bed", choices=BEDS, help="default: the bed of the strokes' file")
    parser.add_argument(
        "--pictures", metavar="FOLDER", type=Path, help="also draw them, formed and intended (needs bpy)"
    )
    parser.set_defaults(carry_out=carry_out)


def _thing(text: str) -> str:
    """Read the name of a thing."""
    if text not in RELIEFS:
        raise argparse.ArgumentTypeError(f"must be one of {', '.join(RELIEFS)} (got {text!r})")
    return text


def carry_out(arguments: argparse.Namespace) -> int:
    """Make the things, print the table, and draw them."""
    from .made_things import make

    if arguments.pictures is not None:
        refuse_without_blender()
        refuse_unwritable(arguments.pictures)
    names = arguments.things or list(RELIEFS)[: 1 if arguments.quick else None]
    found = []
    with progress(arguments, "things", len(names)) as bar:
        for name in names:
            found.append(make(name, arguments.bed))
            if arguments.pictures is not None:
                _draw(found[-1], arguments.pictures)
            bar(name)
    text = "\n".join([made_with(), "", *table(HEAD, [_row(made) for made in found])])
    print(text)
    kept(arguments.out, "made", text, HEAD, [_figures(made) for made in found])
    return 0


def _draw(made: Made, folder: Path) -> None:
    """Draw a thing; on another bed than that of its file it is another picture."""
    from .made_pictures import draw_made

    suffix = "" if made.bed == made.own_bed else f"_{made.bed}"
    draw_made(made, folder / f"made_{made.name}{suffix}.jpg")


def _figures(made: Made) -> Sequence[Any]:
    """Return the values of a row, SI."""
    return (
        made.name, made.bed, made.strokes, made.simulated, made.correlation, made.slope, made.error,
        float(made.intended.std()), made.spent,
    )  # fmt: skip


def _row(made: Made) -> list[str]:
    """Return a row of the table."""
    _, _, strokes, simulated, correlation, slope, error, relief, spent = _figures(made)
    lengths = [f"{1e3 * length:.2f} mm" for length in (error, relief)]
    ratios = [f"{correlation:.3f}", f"{slope:.2f}"]
    return [made.title, made.bed, str(strokes), f"{simulated:.1f} s", *ratios, *lengths, f"{spent:.1f} s"]
