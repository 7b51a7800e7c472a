"""The page on the architecture lists what a control period executes, in its order."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import FrameType

from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble

from tests.assemble import sample

ROOT = Path(__file__).parents[2]
STEPPER = ROOT / "addon" / "digiclay" / "core" / "steppers" / "bernoulli.py"


def listed() -> list[str]:
    """Return the names in the list of the page, from top to bottom."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    part = page.partition("### A control period")[2].partition("\n###")[0]
    return re.findall(r"^ {4} *([\w.]+) {2,}\S", part, re.MULTILINE)


def called() -> list[str]:
    """Return the functions of one period with a pressed fingertip, in the order of their first calls."""
    scene = sample("tap", "sensors.force_noise=0.001")
    found: dict[str, None] = {}

    def noted(frame: FrameType, event: str, argument: object) -> None:
        if event == "call":
            name = frame.f_code.co_qualname
            found.setdefault(f"{frame.f_globals['__name__'].rpartition('.')[2]}.{name}")
            found.setdefault(name)

    run = periods(assemble(scene), scene.trajectories(), begin(assemble(scene)), scene.periods)
    next(state for state in run if state.active.touched.force.any())
    sys.setprofile(noted)
    try:
        next(run)
    finally:
        sys.setprofile(None)
    return list(found)


def test_the_functions_listed_are_called_in_this_order() -> None:
    found = called()
    names = [name for name in listed() if "." in name and not name.startswith(("np.", "sensors."))]
    assert len(names) > 8
    assert [name for name in names if name not in found] == []
    assert sorted(names, key=found.index) == names


def test_sensors_are_brought_up_to_date_after_the_step() -> None:
    found = called()
    names = ["StepWorkspace.__call__", "Noisy.update"]
    assert sorted(names, key=found.index) == names


def test_the_steps_listed_are_taken_in_this_order() -> None:
    code = STEPPER.read_text(encoding="utf-8")
    names = [
        name
        for name in listed()
        if name in ("open_valves", "rise_freely", "meet_finger", "lose", "propagate")
    ]
    assert len(names) == 5
    places = [re.search(rf"(?<!def )\b(self\.)?{name}\(\)", code) for name in names]
    assert None not in places
    order = [place.start() for place in places if place]
    assert order == sorted(order)
