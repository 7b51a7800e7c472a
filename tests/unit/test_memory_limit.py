"""The estimate of memory a session is refused by, beside what sessions take."""

from __future__ import annotations

import tracemalloc
from typing import Any

import pytest
from digiclay.core.engine.state import Rows
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.recorder import Recorder
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.memory_limit import count_busy_cells, count_bytes_needed
from digiclay.core.session.run_scene import run

#: Two beds, of which the larger has so many more cells: what is taken once falls out of the difference.
SIDES, MORE = (100, 150), 150**2 - 100**2


def measured_and_estimated(**changes: Any) -> tuple[float, float]:
    """Return bytes a cell at a session's peak: those numpy asks for, and those the estimate says."""
    taken, told = [], []
    for side in SIDES:
        press = [{"time": 0.0, "position": [0, 0, 0.041]}, {"time": 0.05, "position": [0, 0, 0.038]}]
        bed = {"layout": {"rows": side, "columns": side}, "trajectory": {"waypoints": press}}
        scene = resolve({**bed, "simulation": {"duration": 0.05}, **changes})
        system = assemble(scene)
        told.append(
            count_bytes_needed(
                scene.recorder, system.rows, scene.cells, scene.periods, count_busy_cells(scene)
            )
        )
        tracemalloc.start()
        try:
            run(scene)
            taken.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    return (taken[1] - taken[0]) / MORE, (told[1] - told[0]) / MORE


@pytest.mark.parametrize("method", ["virtual_master", "cell_states"])
def test_a_cell_takes_as_many_bytes_as_is_said(method: str) -> None:
    taken, told = measured_and_estimated(recorder="absent", control={"method": method})
    # All of it is arrays whose lengths are known; of what is taken once a little depends on the finger.
    assert taken == pytest.approx(told, abs=10.0)


def test_a_row_of_a_cell_takes_as_many_bytes_as_is_said() -> None:
    history = run(resolve({"simulation": {"duration": 0.05}})).history
    assert history is not None
    rows, cells = history["height"].shape
    kept = sum(array.nbytes for array in history.values() if array.shape == (rows, cells)) / (rows * cells)
    told = [count_bytes_needed(Recorder(), Rows(2, 2), 1000, periods) for periods in (500, 501)]
    # One byte more stands for what the metrics need, which is a truth value.
    assert (told[1] - told[0]) / 1000 == kept + 1


def test_a_recorded_session_takes_no_more_bytes_than_is_said() -> None:
    taken, told = measured_and_estimated(simulation={"duration": 0.25})
    assert 0.85 * told <= taken <= told


def test_cells_that_all_take_part_take_no_more_bytes_than_is_said() -> None:
    taken, told = measured_and_estimated(recorder="absent", shape={"file": "dome"})
    # Temporary arrays are as many as numpy happens to need.
    assert 0.95 * told <= taken <= 1.05 * told


def test_rows_that_wait_for_cells_that_all_take_part_take_no_more_bytes_than_is_said() -> None:
    taken, told = measured_and_estimated(shape={"file": "dome"}, simulation={"duration": 0.5})
    assert 0.5 * told <= taken <= told
