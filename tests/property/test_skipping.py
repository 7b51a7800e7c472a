"""Cells that cannot change are not integrated, and nothing is lost by that."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.model.control_interface import Commands, Controller, Measurement
from digiclay.core.model.layout import Layout
from digiclay.core.model.trajectory import make_level
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.assemble import make_system, path, record, scripted

COUNT = 120
BED = make_system(Layout(9, 9), control=VirtualMaster())

#: Millimeters, to the tenth.
xy = st.integers(-120, 120).map(lambda tenths: tenths / 10)
points = st.lists(
    st.tuples(xy, xy, st.integers(330, 550).map(lambda tenths: tenths / 10)), min_size=4, max_size=7
)


@dataclass(frozen=True)
class Everywhere:
    """A controller that asks for the whole bed, so that every cell takes part in every period."""

    inner: Controller

    name = "everywhere"
    rows = 0

    def begin(self) -> Any:
        """Return the inner memory."""
        return self.inner.begin()

    def locate(self, memory: Any, touched: Measurement) -> tuple[Any, tuple[float, float, float]]:
        """Attend as the inner one does, but ask for all cells."""
        return self.inner.locate(memory, touched)[0], (0.0, 0.0, 1.0)

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Command as the inner one does."""
        return self.inner.command(memory, seen)


@settings(max_examples=4)
@given(points)
@example([  # the finger is felt by one cell, and travels along a row: cells lie exactly abeam of it
    (-0.2, -1.5, 34.1), (-3.0, -7.9, 49.0), (2.1, 3.0, 45.1), (-3.3, 9.6, 40.6), (-1.3, -5.4, 37.7),
    (-9.1, 12.0, 54.9), (-10.0, 2.3, 49.7),
])  # fmt: skip
def test_integrating_only_the_cells_that_move_gives_what_integrating_all_does(spots):
    trajectory = make_level(np.linspace(0.0, COUNT * BED.period, len(spots)), np.array(spots) * 1e-3)
    fewer = record(BED, trajectory, COUNT)
    all_cells = record(replace(BED, controller=Everywhere(BED.controller)), trajectory, COUNT)
    assert all_cells.last.active.cells.size == BED.grid.count
    # Rounding: sums in another order. A force grows e-fold in half a millimeter.
    assert np.abs(fewer.height - all_cells.height).max() < 1e-12
    assert np.abs(fewer.force - all_cells.force).max() < 1e-9


@pytest.mark.parametrize(
    ("side", "way", "count", "least", "most"),
    [
        (9, [(0, 0, 0, 200), (1, 5, 5, 200)], 20, 0, 0),  # far above
        # At rest. The servo's flow goes with the error squared, so coming to rest takes some 20 s.
        (9, [(0, 0, 0, 45), (0.3, 0, 0, 36), (0.6, 0, 0, 60)], 6000, 0, 0),
        # Rows and columns that hold the disc to the edge ring, with a pitch to spare on every side: 15 x 15.
        (25, [(0, 0, 0, 45), (0.3, 0, 0, 36)], 60, 21, 15 * 15),
    ],
)
def test_only_cells_around_a_touch_are_integrated_until_the_surface_is_at_rest(side, way, count, least, most):
    run = record(make_system(Layout(side, side), control=VirtualMaster()), path(*way), count)
    assert np.any(run.height[-1] != 40e-3) == (count > 20)
    assert least <= run.last.active.cells.size <= most


def test_pins_that_rise_into_a_still_finger_meet_it_at_once() -> None:
    # The finger waits 1 mm above; which cells it may touch was settled before they rose.
    system = make_system(Layout(9, 9), control=scripted(lambda t, x, y: 1.0))
    run = record(system, path((0, 0, 0, 41)), 40)
    touching = run.height[:, 40] > 41e-3
    assert 5 < touching.sum() < 40
    assert np.array_equal(run.force[:, 40] > 0.0, touching)
