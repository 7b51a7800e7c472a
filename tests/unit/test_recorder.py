"""The recorder: which row holds what, how many there are, and what memory a session needs or cannot have."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.engine.state import Rows, State, make_initial_state
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.recorder import Recorder, RunRecording, write
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.memory_limit import (
    count_busy_cells,
    count_bytes_needed,
    measure_available_memory,
    refuse_what_cannot_fit,
)
from digiclay.core.session.run_scene import run

ROWS = Rows(physics=2, queue=2)
CELLS = 3


def after(start: State, period: int) -> State:
    """Return a state in which every number of the gathered cells tells the period it was made in."""
    block = np.zeros_like(start.rows)
    block[0], block[ROWS.force], block[ROWS.command] = 100 + period, 200 + period, 300 + period
    cells, mode = np.arange(CELLS), np.full(CELLS, period, np.int8)
    held = replace(start.active, cells=cells, near=CELLS, block=block, mode=mode)
    return start._replace(period=period, active=held)


def recorded(every: int, periods: int, stop: int | None = None) -> dict[str, list[float]]:
    """Record a session that may be cut short; return the first cell's column of each array."""
    start = make_initial_state(ROWS, CELLS, 0.04, None)
    recording = RunRecording(Recorder(every), ROWS, start, periods)
    last = start
    for period in range(1, (stop or periods) + 1):
        last = after(start, period)
        recording.observe(last)
    arrays = recording.finish(last.period)
    return {name: (array if array.ndim == 1 else array[:, 0]).tolist() for name, array in arrays.items()}


@pytest.mark.parametrize(
    ("session", "name", "wanted"),
    [
        # The first row is the state before the session, any other one that at its time.
        ((1, 3), "height", [0.04, 101.0, 102.0, 103.0]),
        ((1, 3), "force", [0.0, 201.0, 202.0, 203.0]),
        # A command or a mode is in the row its period starts with; after the last row nothing is commanded.
        ((1, 3), "command", [301.0, 302.0, 303.0, 0.0]),
        ((1, 3), "mode", [1, 2, 3, 3]),
        # Every second period makes a row, and so does the end.
        ((2, 5), "period", [0, 2, 4, 5]),
        ((2, 5), "command", [301.0, 303.0, 305.0, 0.0]),
        # A session cut short ends with the state it had reached, and without a command.
        ((3, 9, 4), "period", [0, 3, 4]),
        ((3, 9, 4), "command", [301.0, 304.0, 0.0]),
    ],
)
def test_a_row_is_the_state_at_its_time_and_what_was_commanded_from_then_on(session, name, wanted):
    assert recorded(*session)[name] == wanted


@pytest.mark.parametrize("every", [1, 2, 3, 4, 5, 6])
def test_there_are_as_many_rows_as_were_announced(every: int) -> None:
    assert len(recorded(every, 5)["period"]) == Recorder(every).rows(5)


def test_a_written_history_is_read_back_bit_for_bit_and_smaller_than_its_arrays(tmp_path: Path) -> None:
    rng, path = np.random.default_rng(1), tmp_path / "history.npz"
    history = {"height": rng.normal(size=(5, 7)), "mode": rng.integers(0, 8, (5, 7)).astype(np.int8)}
    write(history, path)
    with np.load(path, allow_pickle=False) as read:
        assert [name for name, array in history.items() if not np.array_equal(read[name], array)] == []
    heights = np.full((500, 400), 0.04)
    write({"height": heights}, path)
    # A bed at rest is the same row over and over: anything but a few per cent is not deflated.
    assert path.stat().st_size < 0.05 * heights.nbytes


def fits(recorder: Recorder, cells: int, periods: int, free: int) -> bool:
    """Tell whether a history is accepted."""
    try:
        refuse_what_cannot_fit(recorder, ROWS, cells, periods, free)
    except ParameterError:
        return False
    return True


def test_a_history_fits_to_the_byte_or_is_refused_with_the_least_thinning_that_fits() -> None:
    needed = count_bytes_needed(Recorder(1), ROWS, 1000, 100)
    assert [fits(Recorder(1), 1000, 100, free) for free in (needed - 1, needed)] == [False, True]
    with pytest.raises(ParameterError) as caught:
        refuse_what_cannot_fit(Recorder(1), ROWS, 1_000_000, 5200, 20_000_000_000)
    assert str(caught.value) == (
        "recorder.every must be at least 7 for the history to fit into 20 GB of free memory "
        "(got 1: 5201 rows of 1000000 cells are 135 GB)."
    )
    assert [fits(Recorder(every), 1_000_000, 5200, 20_000_000_000) for every in (6, 7)] == [False, True]
    with pytest.raises(ParameterError, match=r"^layout.rows \* columns must be few enough for 1 GB"):
        refuse_what_cannot_fit(Recorder(1000), ROWS, 20_000_000, 100, 1_000_000_000)
    # Less than this could not have started the interpreter that runs the test.
    assert measure_available_memory() > 10_000_000


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
