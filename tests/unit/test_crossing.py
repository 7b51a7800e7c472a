"""Crossing strokes leave no spikes, and a ridge across a ridge cuts nothing off it."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.session import live_periods
from digiclay.live.running import Running
from digiclay.live.stroke import Brush
from numpy.typing import NDArray

from tests.strokes import Places, begin_bed, form, measure_spikes, relief

Floats = NDArray[np.float64]
#: Pins in a row and column of a bed, half the length of a stroke, height of a ridge, depth of a groove, mm.
SIZES = {"paper": (25, 24.0, 10.0, 4.0), "design": (34, 16.0, 6.0, 3.0)}
#: A pin may be off all those around it by so much, mm. Measured: 0.6 mm with ridges at any angle, 0.9 mm with
#: grooves at a right angle, 1.8 mm at 30 degrees, where the finger slides along the ridge's flank.
BOUND = 1.0


@pytest.fixture(autouse=True)
def quick_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out no control period: what a test forms must not depend on who else uses the machine."""
    monkeypatch.setattr(live_periods, "SHARE", 1e9)


def turned(bed: str, degrees: float) -> Places:
    """Return the ends of a stroke through the middle of a bed, mm."""
    half, turn = SIZES[bed][1], np.radians(degrees)
    x, y = float(half * np.cos(turn)), float(half * np.sin(turn))
    return [(-x, -y), (x, y)]


@functools.cache
def ridged(bed: str) -> Running:
    """Return a session with a ridge along x."""
    pins, _, height, _ = SIZES[bed]
    return form(begin_bed(bed, pins, pins), turned(bed, 0.0), Brush.RAISE, height)


def crossed(bed: str, degrees: float, brush: Brush, depth: float) -> tuple[Floats, Floats]:
    """Return the relief of a ridge, and that after another stroke, mm."""
    session = ridged(bed)
    session = replace(session, state=session.state.copy())
    return relief(session), relief(form(session, turned(bed, degrees), brush, depth))


@pytest.mark.parametrize(
    ("bed", "degrees"),
    [("paper", 90.0), ("paper", 30.0), ("paper", 0.0), ("design", 90.0), ("design", 30.0)],
)
def test_a_ridge_across_a_ridge_cuts_nothing_off_and_leaves_no_spikes(bed: str, degrees: float) -> None:
    height = SIZES[bed][2]
    before, after = crossed(bed, degrees, Brush.RAISE, height)
    assert measure_spikes(after) < BOUND
    # Where the finger comes down behind the crossing, its flat top takes some of the old flank down.
    assert (before - after).max() < 0.35 * height
    middle = after[len(after) // 2, len(after) // 2]
    assert middle == pytest.approx(2.0 * height, abs=1.5)


@pytest.mark.parametrize("bed", SIZES)
def test_a_groove_across_a_ridge_leaves_no_spikes(bed: str) -> None:
    _, _, height, depth = SIZES[bed]
    after = crossed(bed, 90.0, Brush.LOWER, depth)[1]
    assert measure_spikes(after) < BOUND
    # Through the ridge, and as deep beyond it as a finger's pulp leaves it: 1 mm less than the finger went.
    column = after[:, len(after) // 2]
    assert column[len(after) // 2] < height - 1.0
    assert column.min() == pytest.approx(1.0 - depth, abs=1.0)
    # Beside the groove the ridge stands.
    assert after[len(after) // 2, len(after) // 4] > height - 1.0
