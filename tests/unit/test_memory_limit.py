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


@pytest.mark.parametrize(
    ("changes", "least", "most"),
    [
        # All of it is arrays whose lengths are known; of what is taken once a little depends on the finger.
        pytest.param({"recorder": "absent"}, 0.95, 1.05, id="I"),
        pytest.param({"recorder": "absent", "control": {"method": "cell_states"}}, 0.95, 1.05, id="Method I"),
        # Temporary arrays are as many as numpy happens to need.
        pytest.param({"recorder": "absent", "shape": {"file": "dome"}}, 0.95, 1.05, id="cells that all take"),
        pytest.param(
            {"shape": {"file": "dome"}, "simulation": {"duration": 0.5}}, 0.5, 1.0, id="rows that wait"
        ),
    ],
)  # fmt: skip
def test_a_cell_takes_as_many_bytes_as_is_said(changes: dict[str, Any], least: float, most: float) -> None:
    taken, told = measured_and_estimated(**changes)
    assert least * told <= taken <= most * told


def test_a_row_of_a_cell_takes_as_many_bytes_as_is_said() -> None:
    history = run(resolve({"simulation": {"duration": 0.05}})).history
    assert history is not None
    rows, cells = history["height"].shape
    kept = sum(array.nbytes for array in history.values() if array.shape == (rows, cells)) / (rows * cells)
    told = [count_bytes_needed(Recorder(), Rows(2, 2), 1000, periods) for periods in (500, 501)]
    # One byte more stands for what the metrics need, which is a truth value.
    assert (told[1] - told[0]) / 1000 == kept + 1
