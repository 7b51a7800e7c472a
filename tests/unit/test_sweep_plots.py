"""Pictures of sweeps: lines over one axis, heat maps over two; and the axes in numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.studies.axes import Column
from digiclay.plots.sweep import sweep_figure

pytestmark = pytest.mark.usefixtures("here")


ONE = Column("control.force_gain", "1/N", (1.0, 2.0, 4.0), True)
TWO = Column("layout.pitch", "m", (2.5e-3, 3e-3), False)
WORDS = Column("blister.profile", "", ("cone", "gaussian", "flat"), False)


def test_one_axis_is_a_line_with_markers_labeled_with_units() -> None:
    picture = sweep_figure([ONE], "lag_mean", np.array([1e-3, 2e-3, 3e-3]))
    (axes,) = picture.axes
    (line,) = axes.get_lines()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("control.force_gain (1/N)", "lag_mean (mm)")
    assert (line.get_marker(), axes.get_xscale()) == ("o", "log")
    np.testing.assert_allclose(line.get_xydata(), [[1.0, 1.0], [2.0, 2.0], [4.0, 3.0]], rtol=1e-12)


def test_numbers_in_any_order_make_a_line_from_left_to_right_and_words_make_none() -> None:
    lines = []
    for column in (Column("a.b", "", (3, 1, 2), False), WORDS):
        (axes,) = sweep_figure([column], "rfd", np.array([0.3, 0.1, 0.2])).axes
        lines.append(axes.get_lines()[0])
    assert lines[0].get_xydata().tolist() == [[1.0, 0.1], [2.0, 0.2], [3.0, 0.3]]
    assert [text.get_text() for text in axes.get_xticklabels()] == list(WORDS.values)
    assert lines[1].get_linestyle() == "None"


def test_two_axes_are_a_heat_map_labeled_with_units() -> None:
    values = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, np.nan]])
    axes, scale = sweep_figure([ONE, TWO], "rfd", values).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("control.force_gain (1/N)", "layout.pitch (mm)")
    assert scale.get_ylabel() == "rfd (N)"
    drawn = axes.collections[0].get_array().reshape(2, 3)
    np.testing.assert_array_equal(drawn.filled(np.nan), values.T)
    assert [text.get_text() for text in axes.texts] == ["0.1", "0.3", "0.5", "0.2", "0.4", "×"]


@pytest.mark.parametrize("columns", [[ONE], [ONE, TWO]])
def test_a_metric_nobody_has_is_drawn_as_missing_at_every_point(columns: list[Column]) -> None:
    nothing = np.full([len(one.values) for one in columns], np.nan)
    picture = sweep_figure(columns, "rfd", nothing)
    picture.canvas.draw()
    crosses = sum(len(line.get_xdata()) for line in picture.axes[0].get_lines() if line.get_marker() == "x")
    assert crosses + sum(text.get_text() == "×" for text in picture.axes[0].texts) == nothing.size


def test_a_sweep_over_two_axes_leaves_pictures_and_over_three_a_table_only(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = ["sweep", "slow_press", "--set", "simulation.duration=0.1", "--metric", "rfd,highest"]
    two = ["--vary", "valve_lag.time_constant=1 ms,2 ms", "--vary", "delay.dead_time=0,0.001"]
    assert main([*sweep, *two, "--out", "out", "--quiet"]) == 0
    assert sorted(path.name for path in (here / "out").glob("*.png")) == ["highest.png", "rfd.png"]
    three = ["valve_lag.time_constant=1 ms", "delay.dead_time=0", "layout.rows=11,13"]
    assert main([*sweep, *(f"--vary={axis}" for axis in three), "--out", "three"]) == 0
    assert "3 axes: a table only, no pictures" in capsys.readouterr().out
    assert list((here / "three").glob("*.png")) == []
