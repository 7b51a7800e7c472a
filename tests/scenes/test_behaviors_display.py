"""Shape display over whole sessions: the three refresh ways, and what a finger does to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import Result, run

REST, DEAD_BAND, PERIOD = 40e-3, 10e-6, 5e-3
AWAY = ((0.0, 0, 0, 90), (12.0, 0, 0, 90))


def scene(way: tuple[tuple[float, ...], ...] = AWAY, side: int = 9, **known: Any) -> Scene:
    """Return a scene on a square bed; the way's times in s, its positions in mm."""
    waypoints = [{"time": t, "position": [x * 1e-3, y * 1e-3, z * 1e-3]} for t, x, y, z in way]
    table = {
        "layout": {"rows": side, "columns": side},
        "control": {"method": "shape_display", **known},
        "trajectory": {"waypoints": waypoints},
    }
    return resolve(table)


def heights(result: Result) -> np.ndarray:
    """Return the heights, (t, n)."""
    return result.history["height"]


def displayed(refresh: str, shape: str = "crater", **known: Any) -> Result:
    """Return a display of a shape without a finger."""
    return run(scene(shape=shape, refresh=refresh, surfaces=3, **known))


@pytest.mark.parametrize("refresh", ["one_time", "gradual", "approximate_gradual"])
@pytest.mark.parametrize("shape", ["dome", "saddle", "crater"])
def test_the_display_reaches_its_shape(refresh: str, shape: str) -> None:
    result = displayed(refresh, shape)
    wanted = assemble(result.scene).controller.heights
    assert np.ptp(wanted) > 9e-3
    assert np.abs(heights(result)[-1] - wanted).max() <= DEAD_BAND + 1e-12


def test_the_display_reaches_the_heights_of_a_file(tmp_path: Path) -> None:
    wanted = np.random.default_rng(6).uniform(30e-3, 50e-3, (9, 9))
    np.save(tmp_path / "mine.npy", wanted)
    result = displayed("approximate_gradual", str(tmp_path / "mine.npy"))
    assert np.abs(heights(result)[-1] - wanted.ravel()).max() <= DEAD_BAND + 1e-12


def moving(result: Result) -> np.ndarray:
    """Return where rows of the bed move in a period, (t - 1, rows)."""
    steps = np.abs(np.diff(heights(result), axis=0)).reshape(-1, 9, 9)
    return np.any(steps > 1e-6, axis=2)


def test_a_one_time_refresh_moves_the_rows_one_after_another() -> None:
    result = displayed("one_time", "saddle")
    wanted = assemble(result.scene).controller.heights.reshape(9, 9)
    height = heights(result).reshape(-1, 9, 9)
    settled = np.abs(height - wanted).max(axis=2) <= DEAD_BAND
    for row in range(8):
        starts = int(np.argmax(moving(result)[:, row + 1]))
        assert np.all(settled[starts, : row + 1]), row
    assert np.argmax(settled.all(axis=1)) > 0


def test_a_gradual_refresh_shows_its_intermediate_surfaces() -> None:
    result = displayed("gradual", "pyramid")
    wanted = assemble(result.scene).controller.heights
    for share in (1 / 3, 2 / 3, 1.0):
        surface = REST + share * (wanted - REST)
        nearest = np.abs(heights(result) - surface).max(axis=1).min()
        # The first rows are on their way to the next surface before the last one has come to rest in the
        # dead band: no more than a settling time's end, a dead band more.
        assert nearest <= 2 * DEAD_BAND, share


def test_an_approximate_gradual_refresh_moves_all_rows_at_the_same_time() -> None:
    rows = moving(displayed("approximate_gradual", "saddle"))
    assert rows.sum(axis=1).max() == 9


def test_the_approximate_gradual_refresh_is_the_quickest_and_the_gradual_the_slowest() -> None:
    ways = ("approximate_gradual", "one_time", "gradual")
    ends = [np.flatnonzero(moving(displayed(way, "saddle")).any(axis=1))[-1] for way in ways]
    assert ends == sorted(ends)


def test_a_small_step_settles_as_quickly_as_digital_clay_s_hardware() -> None:
    result = displayed("approximate_gradual", "dome", amplitude=1e-3)
    # Three steps of a third of a millimeter; 50 to 100 ms each.
    end = np.flatnonzero(moving(result).any(axis=1))[-1] * PERIOD
    assert 3 * 0.05 <= end <= 3 * 0.1


def test_a_finished_display_costs_nothing() -> None:
    made = scene(refresh="approximate_gradual")
    system, way = assemble(made), made.section("trajectory").trajectory()
    *_, last = periods(system, [way], begin(system), 2000)
    assert last.active.cells.size == 0


def test_a_displayed_shape_holds_against_a_finger() -> None:
    way = (
        (0.0, 0, 0, 70),
        (2.0, 0, 0, 70),
        (2.5, 0, 0, 48),
        (3.0, 0, 0, 48),
        (3.5, 0, 0, 70),
        (4.5, 0, 0, 70),
    )
    result = run(scene(way, 13, refresh="approximate_gradual"))
    wanted = assemble(result.scene).controller.heights
    assert result.history["total_force"].max() > 0.5
    assert np.abs(heights(result)[-1] - wanted).max() <= DEAD_BAND + 1e-12
