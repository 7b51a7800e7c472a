"""``python -m benchmarks viewport``: time of a tick of a live session in Blender."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from digiclay.commands.progress import table
from digiclay.commands.stop import refuse_without_blender

from .report import add_kind, kept, made_with, progress

if TYPE_CHECKING:  # Blender is imported when it is needed
    from .viewport_cost import Cost, SkinCost

#: Rows and columns of the beds, and the time a tick of them may take, s.
BEDS = ((25, 25, 5e-3), (100, 100, 10e-3), (250, 400, 40e-3))
#: Ticks that are timed, with --quick and without.
QUICK, FULL = 40, 200


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks viewport\n  python -m benchmarks viewport --quick --out results\n"
    parser = add_kind(
        kinds, "viewport", "a tick of a live session in Blender, part by part (needs bpy)", examples
    )
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Measure every bed, and print the table."""
    refuse_without_blender()
    from digiclay.compat import bpy

    from .viewport_cost import PARTS, SHOWN, measure_skin, measured

    ticks = QUICK if arguments.quick else FULL
    costs, skins = [], []
    with progress(arguments, "viewport", len(BEDS)) as bar:
        for rows, columns, _ in BEDS:
            costs.append(measured(rows, columns, ticks))
            skins.append(measure_skin(rows, columns, ticks))
            bar(f"{rows * columns} pins")
    text = "\n".join([*_text(costs, PARTS, bpy.app.version_string), *_skin_text(skins, SHOWN)])
    print(text)
    head = ("pins", *(f"{name}_s" for name in PARTS), "tick_s", "tick_95_s", "growth_bytes")
    head = (*head, *(f"{shown}_{kind}_s" for shown, kind in SHOWN))
    figures = [
        [one.pins, *(one.parts[name] for name in PARTS), one.whole, one.worst, one.growth, *skin.evaluate]
        for one, skin in zip(costs, skins, strict=True)
    ]
    kept(arguments.out, "viewport", text, head, figures)
    return 0


def _text(costs: list[Cost], parts: tuple[str, ...], version: str) -> Iterator[str]:
    """Give the lines of the report."""
    yield f"{made_with()}, Blender {version}"
    yield "\nA tick of a live session: 33 ms of simulated time while a finger presses and drags; medians."
    yield "read: where the finger is; keep: the state into the bed, for undo and files; write: pins;"
    yield "evaluate: Blender's geometry nodes, without drawing. Times in ms.\n"
    head = ("pins", *parts, "tick", "goal", "95 % within", "memory grown, kB")
    rows = [
        [
            f"{one.pins}", *(f"{1e3 * one.parts[name]:.2f}" for name in parts), f"{1e3 * one.whole:.2f}",
            f"{1e3 * goal:g}", f"{1e3 * one.worst:.2f}", f"{one.growth / 1e3:.1f}",
        ]
        for one, (_, _, goal) in zip(costs, BEDS, strict=True)
    ]  # fmt: skip
    yield from table(head, rows, left=0)


def _skin_text(costs: list[SkinCost], shown: tuple[tuple[str, str], ...]) -> Iterator[str]:
    """Give the lines about the live skin."""
    yield "\nAll pins moved, forms by turns: processor time of the geometry nodes, medians, ms.\n"
    head = ("pins", *("pins alone" if form == "pins" else f"{form}, {kind}" for form, kind in shown))
    rows = [[f"{one.pins}", *(f"{1e3 * spent:.2f}" for spent in one.evaluate)] for one in costs]
    yield from table(head, rows, left=0)
