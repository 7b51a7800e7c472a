"""Forms the letter A of the gallery with the Press tool as a hand does: X events from outside."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.window.hand_strokes import act, brush, note, on_the_screen, prepare, to

#: The strokes of the letter.
FILE = Path(__file__).parents[2] / "benchmarks" / "strokes" / "letter_a.toml"


def draw(blender: Any, stroke: Any) -> str:
    """Return what moves the hand as the pointer moved, with the button held down."""
    start, *moves = stroke.moves
    words, before = [to(on_the_screen(blender, 1e3 * start[1], 1e3 * start[2])), "mousedown 1"], 0.0
    for time, x, y in moves:
        words.append(to(on_the_screen(blender, 1e3 * x, 1e3 * y), time - before))
        before = time
    return " ".join([*words, "mouseup 1"])


def script(blender: Any) -> Iterator[float | None]:
    """Draw stroke by stroke, with the brush of each."""
    recorded = blender.part("recorded.pointer_strokes").read_strokes(FILE)
    yield from prepare(blender, "TOP", bed=recorded.bed)
    settings = brush(blender)
    for number, stroke in enumerate(recorded.strokes, 1):
        settings.brush, settings.depth = stroke.kind.value, 1e3 * stroke.depth
        yield from act(blender, draw(blender, stroke))
        blender.shot(f"letter_{number}")
    note(blender, "formed")
