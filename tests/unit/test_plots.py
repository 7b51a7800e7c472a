"""The two pictures of a run: what they show is read from the figures, not from pixels."""

from __future__ import annotations

import os
import struct
import subprocess
import sys

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.model.control_interface import SetPoint
from digiclay.core.model.layout import Layout, make_grid
from digiclay.plots import run as plots
from digiclay.plots.relief import hidden

from tests.timeouts import TIMEOUT


def drag(rows: int = 12, columns: int = 14, arrangement: str = "aligned") -> dict[str, np.ndarray]:
    """A finger that touches down at 1 s, draws a ridge along x and lifts at 9 s."""
    time = np.linspace(0.0, 10.0, 201)
    place = make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions
    reach = place[:, 0].max()
    fingertip = np.zeros((201, 7))
    fingertip[:, 0], fingertip[:, 2], fingertip[:, 3] = np.interp(time, [1, 9], [-reach, reach]), 0.05, 1.0
    touching = (time > 1.0) & (time < 9.0)
    near = np.exp(-np.sum((fingertip[:, None, :2] - place) ** 2, axis=2) / 0.004**2)
    force = 0.4 * touching[:, None] * near / near.sum(axis=1, keepdims=True)
    height = 0.04 + 0.01 * np.maximum.accumulate(near * touching[:, None], axis=0)
    return {"time": time, "height": height, "force": force, "command": np.zeros_like(force),
            "mode": np.full(force.shape, Mode.FORCE_FOLLOW, np.int8), "fingertip": fingertip,
            "total_force": force.sum(axis=1), "position": place}  # fmt: skip


def axes(figure, label):
    """The axes of a figure that carry a label."""
    return next(part for part in figure.axes if part.get_label() == label)


def png_size(path) -> tuple[int, int]:
    """Width and height in a PNG's header."""
    content = path.read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", content[16:24])


def test_the_session_has_heights_and_force_over_time_with_units():
    figure = plots.session_figure(drag(), SetPoint(0.4))
    assert axes(figure, "heights").get_ylabel() == "height (mm)"
    assert axes(figure, "force").get_ylabel() == "force (N)"
    assert axes(figure, "force").get_xlabel() == "time (s)"


def test_the_session_shows_the_total_force_and_its_set_point():
    case = drag()
    total, set_point = axes(plots.session_figure(case, SetPoint(0.37)), "force").get_lines()
    np.testing.assert_array_equal(total.get_ydata(), case["total_force"])
    assert set(set_point.get_ydata()) == {0.37}


def test_a_set_point_of_each_cell_is_drawn_as_their_number_changes():
    case = drag()
    case["mode"][:] = Mode.REST
    case["mode"][50:100, :5] = Mode.FORCE_FOLLOW
    case["mode"][100:, :3] = Mode.FORCE_FOLLOW
    force = axes(plots.session_figure(case, SetPoint(0.04, per_cell=True)), "force")
    expected = np.repeat([np.nan, 0.2, 0.12], [50, 50, 101])
    np.testing.assert_allclose(force.get_lines()[1].get_ydata(), expected, rtol=1e-12)  # rounding
    assert "set point 0.04 N a cell" in [text.get_text() for text in force.get_legend().get_texts()]


def test_a_method_without_a_set_point_has_neither_it_nor_a_deviation_in_the_picture():
    figure = plots.session_figure(drag(), None)
    force, told = axes(figure, "force"), axes(figure, "figures")
    assert [line.get_label() for line in force.get_lines()] == ["total force"]
    words = " ".join(text.get_text() for text in (*force.get_legend().get_texts(), *told.texts))
    assert "largest force" in words
    assert "set point" not in words
    assert "RFD" not in words


def test_the_session_shows_the_chosen_cells_in_millimeters():
    case = drag()
    lines = axes(plots.session_figure(case, SetPoint(0.4)), "heights").get_lines()
    cells = plots.session_cells(case)
    assert len(lines) == len(cells) == 6
    for line, cell in zip(lines, cells, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), case["height"][:, cell] * 1e3)


def test_both_panels_of_the_session_share_their_time():
    figure = plots.session_figure(drag(), SetPoint(0.4))
    assert axes(figure, "heights").get_xlim() == axes(figure, "force").get_xlim() == (0.0, 10.0)


def test_every_curve_of_the_session_is_in_a_legend():
    figure = plots.session_figure(drag(), SetPoint(0.4))
    names = [
        text.get_text()
        for label in ("heights", "force")
        for text in axes(figure, label).get_legend().get_texts()
    ]
    assert names == [*"ABCDEF", "total force", "set point 0.4 N", "in contact"]


def test_the_chosen_cells_follow_the_finger_from_first_to_last_contact():
    case = drag()
    x = case["position"][plots.session_cells(case), 0]
    touched = case["fingertip"][case["total_force"] > 0.0, 0]
    pitch = 3e-3
    assert abs(x[0] - touched[0]) <= pitch / 2
    assert abs(x[-1] - touched[-1]) <= pitch / 2
    # Evenly spaced, each to the nearest pin.
    np.testing.assert_allclose(np.diff(x), np.ptp(touched) / 5, rtol=0.0, atol=pitch)


def test_each_of_two_strokes_shows_its_start_middle_and_end():
    # Lifted for half of the way: what is left of it still gets all six cells, and the air none.
    case = drag(columns=28)
    case["total_force"] = np.where((case["time"] > 3.0) & (case["time"] < 7.0), 0.0, case["total_force"])
    x = case["position"][plots.session_cells(case), 0]
    expected = np.interp([1, 2, 3, 7, 8, 9], case["time"], case["fingertip"][:, 0])
    # To the nearest pin, half a pitch, from the nearest row, half a millimeter.
    np.testing.assert_allclose(x, expected, rtol=0.0, atol=2e-3)


def test_without_contact_the_cells_that_moved_most_are_shown():
    case = drag()
    case["total_force"] = np.zeros(201)
    case["height"] = np.full_like(case["height"], 0.04)
    case["height"][100:, 30] = 0.05
    assert 30 in plots.session_cells(case)


def test_the_surface_has_millimeters_on_every_axis_and_a_color_bar():
    figure = plots.surface_figure(drag())
    relief, plan = axes(figure, "relief"), axes(figure, "map")
    assert (relief.get_xlabel(), relief.get_ylabel(), relief.get_zlabel()) == (
        "x (mm)",
        "y (mm)",
        "height (mm)",
    )
    assert (plan.get_xlabel(), plan.get_ylabel()) == ("x (mm)", "y (mm)")
    assert axes(figure, "scale").get_ylabel() == "height (mm)"


def test_the_surface_is_to_scale():
    figure = plots.surface_figure(drag())
    relief = axes(figure, "relief")
    extent = np.array(
        [np.ptp(limits) for limits in (relief.get_xlim(), relief.get_ylim(), relief.get_zlim())]
    )
    ratio = relief._box_aspect / extent
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)  # the same mm on all three axes
    assert axes(figure, "map").get_aspect() == 1.0


@pytest.mark.parametrize(
    ("rows", "columns", "share"), [(5, 5, 0.0), (3, 25, 1.0), (25, 25, 0.02), (12, 14, -1.5)]
)
def test_no_text_on_the_relief_hides_another(rows, columns, share):
    case = drag(rows, columns)
    case["height"] = 0.04 + (case["height"] - 0.04) * share
    relief = axes(plots.surface_figure(case), "relief")
    assert hidden(relief) == []
    # Nor does it leave its own half of the picture.
    width = relief.figure.bbox.width
    texts = [relief.xaxis.label, relief.yaxis.label, relief.zaxis.label]
    assert all(
        0.0 <= text.get_window_extent().x0 < text.get_window_extent().x1 < 0.6 * width for text in texts
    )


def test_the_color_bar_spans_the_final_heights():
    case = drag()
    low, high = axes(plots.surface_figure(case), "scale").get_ylim()
    final = case["height"][-1] * 1e3
    assert (low, high) == pytest.approx((final.min(), final.max()), rel=1e-12)


def test_the_map_shows_the_fingers_path_in_contact_and_lifted():
    lifted, pressed = axes(plots.surface_figure(drag()), "map").get_lines()
    assert (lifted.get_label(), pressed.get_label()) == ("lifted", "in contact")
    seen = ~np.isnan(pressed.get_xdata())
    np.testing.assert_array_equal(seen, drag()["total_force"] > 0.0)


@pytest.mark.parametrize("arrangement", ["aligned", "staggered", "hexagonal"])
def test_both_pictures_are_written_at_their_size(tmp_path, arrangement):
    case = drag(arrangement=arrangement)
    assert png_size(plots.session(case, tmp_path / "session.png", SetPoint(0.4))) == (2000, 1008)
    assert png_size(plots.surface(case, tmp_path / "surface.png")) == (2000, 880)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["session.png", "surface.png"]
    # A picture with something on it: a white one of this size has 10 kB.
    assert min(path.stat().st_size for path in tmp_path.iterdir()) > 40_000


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_a_single_row_or_column_still_has_a_session(tmp_path, shape):
    assert plots.session(drag(*shape), tmp_path / "session.png", SetPoint(0.4)).stat().st_size > 40_000


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_a_single_row_or_column_has_no_surface(tmp_path, shape):
    with pytest.raises(ParameterError, match="2 x 2 pins at least"):
        plots.surface(drag(*shape), tmp_path / "surface.png")
    assert not list(tmp_path.iterdir())


def test_a_session_of_one_row_can_be_drawn(tmp_path):
    case = {name: value if name == "position" else value[:1] for name, value in drag().items()}
    assert plots.session(case, tmp_path / "session.png", SetPoint(0.4)).stat().st_size > 40_000
    assert plots.surface(case, tmp_path / "surface.png").stat().st_size > 40_000


def test_a_folder_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(OutputError, match=r"^Cannot write \S+session\.png: No such file or directory\.$"):
        plots.session(drag(), tmp_path / "missing" / "session.png", SetPoint(0.4))


def python(script: str) -> str:
    """Run a script in a fresh interpreter and return what it prints."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=True,
        env=environment,
    )
    return done.stdout


def test_matplotlib_is_not_imported_before_it_is_needed():
    assert python("import sys, digiclay.plots; print('matplotlib' in sys.modules)") == "False\n"


def test_without_matplotlib_it_says_what_to_install():
    script = (
        "import sys; sys.modules['matplotlib'] = None\n"
        "from digiclay.plots import run\nfrom digiclay.core.base.errors import OutputError\n"
        "case = {'position': [[0, 0]], 'time': [0], 'total_force': [0], 'height': [[0]]}\n"
        "try:\n    run.session(case, 'session.png', None)\n"
        "except OutputError as error:\n    print(error)\n"
    )
    assert python(script) == "Plots need matplotlib: run 'pip install digiclay[plots]'.\n"
