"""Pictures of runs and sweeps: what they show is read from the figures, not from pixels."""

import io
import struct
from functools import cache

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.model.control_interface import SetPoint
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.studies.axes import Column
from digiclay.plots import run as plots
from digiclay.plots.bed import ROOM
from digiclay.plots.figure import save
from digiclay.plots.sweep import sweep_figure
from mpl_toolkits.mplot3d.proj3d import proj_transform
from numpy.testing import assert_allclose, assert_array_equal

from tests.assemble import assert_near
from tests.other_process import finish, start


@cache
def _drag(rows, columns, arrangement):
    time = np.linspace(0.0, 10.0, 201)
    place = make_grid(Layout(rows=rows, columns=columns, arrangement=arrangement)).positions
    reach = place[:, 0].max()
    fingertip = np.zeros((201, 7))
    fingertip[:, 0], fingertip[:, 2], fingertip[:, 3] = (
        np.interp(time, [1, 9], [-reach, reach]),
        0.05,
        1.0,
    )
    touching = (time > 1.0) & (time < 9.0)
    near = np.exp(-np.sum((fingertip[:, None, :2] - place) ** 2, axis=2) / 0.004**2)
    force = 0.4 * touching[:, None] * near / near.sum(axis=1, keepdims=True)
    height = 0.04 + 0.01 * np.maximum.accumulate(near * touching[:, None], axis=0)
    return {
        "time": time,
        "height": height,
        "force": force,
        "command": np.zeros_like(force),
        "mode": np.full(force.shape, Mode.FORCE_FOLLOW, np.int8),
        "fingertip": fingertip,
        "total_force": force.sum(axis=1),
        "position": place,
    }


def drag(rows=12, columns=14, arrangement="aligned"):
    """A finger that touches down at 1 s, draws a ridge along x and lifts at 9 s."""
    return {name: array.copy() for name, array in _drag(rows, columns, arrangement).items()}


def words(part):
    """Return the texts of a legend."""
    return [text.get_text() for text in part.get_legend().get_texts()]


def axes(figure, label):
    return next(part for part in figure.axes if part.get_label() == label)


def png_size(path):
    content = path.read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    return struct.unpack(">II", content[16:24])


@pytest.fixture(scope="module")
def session():
    return plots.session_figure(drag(), SetPoint(0.37))


@pytest.fixture(scope="module")
def surface():
    return plots.surface_figure(drag())


def test_every_axis_has_its_unit_and_every_curve_its_name(session, surface):
    drawn = [axes(session, label) for label in ("heights", "force")]
    drawn += [axes(surface, label) for label in ("map", "scale")]
    found = {part.get_label(): (part.get_xlabel(), part.get_ylabel()) for part in drawn}
    plan = ("x (mm)", "y (mm)")
    assert found == {
        "heights": ("", "height (mm)"),
        "force": ("time (s)", "force (N)"),
        "map": plan,
        "scale": ("", "height (mm)"),
    }
    names = words(axes(session, "heights")) + words(axes(session, "force"))
    assert names == [*"ABCDEF", "total force", "set point 0.37 N", "in contact"]


def test_the_session_shows_force_set_point_and_the_chosen_cells_over_one_time(session):
    case = drag()
    total, set_point = axes(session, "force").get_lines()
    assert_array_equal(total.get_ydata(), case["total_force"])
    assert set(set_point.get_ydata()) == {0.37}
    lines, cells = axes(session, "heights").get_lines(), plots.session_cells(case)
    assert len(lines) == len(cells) == 6
    for line, cell in zip(lines, cells, strict=True):
        assert_array_equal(line.get_ydata(), case["height"][:, cell] * 1e3)
    assert axes(session, "heights").get_xlim() == axes(session, "force").get_xlim() == (0.0, 10.0)
    # They follow the finger from first to last contact, evenly spaced, each to the nearest pin.
    x = case["position"][cells, 0]
    touched = case["fingertip"][case["total_force"] > 0.0, 0]
    assert np.abs(x[[0, -1]] - touched[[0, -1]]).max() <= 1.5e-3
    assert_near(np.diff(x), np.ptp(touched) / 5, 3e-3)
    # Without contact those that moved are shown, from the one that moved most to the one that did least.
    case["total_force"] = np.zeros(201)
    case["height"] = np.full_like(case["height"], 0.04)
    case["height"][100:, 30:41] += np.linspace(1e-3, 11e-3, 11)
    assert plots.session_cells(case) == [40, 38, 36, 34, 32, 30]
    case["height"][:, 31:] = 0.04
    assert plots.session_cells(case) == [30]


def test_a_set_point_is_drawn_of_each_cell_and_without_one_neither_it_nor_a_deviation():
    case = drag()
    case["mode"][:] = Mode.REST
    case["mode"][50:100, :5] = Mode.FORCE_FOLLOW
    case["mode"][100:, :3] = Mode.FORCE_FOLLOW
    force = axes(plots.session_figure(case, SetPoint(0.04, per_cell=True)), "force")
    expected = np.repeat([np.nan, 0.2, 0.12], [50, 50, 101])
    assert_allclose(force.get_lines()[1].get_ydata(), expected, rtol=1e-12)  # rounding
    assert "set point 0.04 N per cell" in words(force)
    figure = plots.session_figure(drag(), None)
    force, told = axes(figure, "force"), axes(figure, "figures")
    assert [line.get_label() for line in force.get_lines()] == ["total force"]
    said = " ".join([*words(force), *(text.get_text() for text in told.texts)])
    assert [part in said for part in ("largest force", "set point", "RFD")] == [True, False, False]


def test_the_surface_is_to_scale_and_shows_the_final_heights_and_the_path(surface):
    case, relief, plan = drag(), axes(surface, "relief"), axes(surface, "map")
    extent = [
        np.ptp(limits) for limits in (relief.get_xlim(), relief.get_ylim(), relief.get_zlim())
    ]
    ratio = relief._box_aspect / np.array(extent)
    assert_allclose(ratio, ratio[0], rtol=1e-9)  # the same mm on all three axes
    assert plan.get_aspect() == 1.0
    final = case["height"][-1] * 1e3
    assert axes(surface, "scale").get_ylim() == pytest.approx((final.min(), final.max()), rel=1e-12)
    lifted, pressed = plan.get_lines()
    assert (lifted.get_label(), pressed.get_label()) == ("lifted", "in contact")
    assert_array_equal(~np.isnan(pressed.get_xdata()), case["total_force"] > 0.0)


@pytest.mark.parametrize("rows, columns, share", [(3, 25, 1.0), (12, 14, -1.5), (25, 3, 1.0)])
def test_the_relief_is_in_the_middle_of_its_room_and_as_large(rows, columns, share):
    case = drag(rows, columns)
    case["height"] = 0.04 + (case["height"] - 0.04) * share
    relief = axes(plots.surface_figure(case), "relief")
    corners = np.meshgrid(relief.get_xlim(), relief.get_ylim(), relief.get_zlim())
    flat = np.column_stack(proj_transform(*np.reshape(corners, (3, 8)), relief.get_proj())[:2])
    seen = relief.figure.transFigure.inverted().transform(relief.transData.transform(flat))
    below, above = np.reshape(ROOM, (2, 2)) - [seen.min(axis=0), seen.max(axis=0)]
    assert_near(below, -above, 1e-9)
    # A size is that of another zoom, but for rounding.
    assert above.min() == pytest.approx(0.0, abs=1e-3)


def test_both_pictures_are_written_at_their_size(tmp_path, session):
    assert png_size(save(session, tmp_path / "session.png")) == (2000, 1008)
    bent = plots.surface_figure(drag(arrangement="hexagonal"))
    assert png_size(save(bent, tmp_path / "surface.png")) == (2000, 880)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["session.png", "surface.png"]
    # A picture with something on it: a white one of this size has 10 kB.
    assert min(path.stat().st_size for path in tmp_path.iterdir()) > 40_000
    with pytest.raises(
        OutputError, match=r"^Cannot write \S+session\.png: No such file or directory\.$"
    ):
        save(session, tmp_path / "missing" / "session.png")


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1)])
def test_a_single_row_or_column_has_a_session_and_no_surface(tmp_path, shape):
    case = drag(*shape)
    with pytest.raises(ParameterError, match="at least 2 x 2 pins"):
        save(plots.surface_figure(case), tmp_path / "surface.png")
    assert not list(tmp_path.iterdir())
    if shape == (1, 1):  # a session of one row as well
        case = {name: value if name == "position" else value[:1] for name, value in case.items()}
    assert (
        save(plots.session_figure(case, SetPoint(0.4)), tmp_path / "session.png").stat().st_size
        > 40_000
    )


def test_matplotlib_is_not_imported_before_it_is_needed_and_it_is_said_what_to_install():
    script = (
        "import sys, digiclay.plots; assert 'matplotlib' not in sys.modules\n"
        "sys.modules['matplotlib'] = None\n"
        "from digiclay.plots import run\n"
        "case = {'position': [[0, 0]], 'time': [0], 'total_force': [0], 'height': [[0]]}\n"
        "run.session_figure(case, None)\n"
    )
    code, _, err = finish(start(script))
    said = "OutputError: Plots need matplotlib: run 'pip install digiclay[plots]'.\n"
    assert (code, err.endswith(said)) == (1, True), err


ONE = Column("control.force_gain", "1/N", (1.0, 2.0, 4.0), True)
TWO = Column("layout.pitch", "m", (2.5e-3, 3e-3), False)
WORDS = Column("blister.profile", "", ("cone", "gaussian", "flat"), False)


def test_numbers_of_one_axis_are_a_line_from_left_to_right_with_units_and_words_make_none():
    picture = sweep_figure([ONE], "lag_mean", np.array([1e-3, 2e-3, 3e-3]))
    (axes,) = picture.axes
    (line,) = axes.get_lines()
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("control.force_gain (1/N)", "lag_mean (mm)")
    assert (line.get_marker(), axes.get_xscale()) == ("o", "log")
    assert_allclose(line.get_xydata(), [[1.0, 1.0], [2.0, 2.0], [4.0, 3.0]], rtol=1e-12)
    lines = []
    for column in (Column("a.b", "", (3, 1, 2), False), WORDS):
        (axes,) = sweep_figure([column], "rfd", np.array([0.3, 0.1, 0.2])).axes
        lines.append(axes.get_lines()[0])
    assert lines[0].get_xydata().tolist() == [[1.0, 0.1], [2.0, 0.2], [3.0, 0.3]]
    assert [text.get_text() for text in axes.get_xticklabels()] == list(WORDS.values)
    assert lines[1].get_linestyle() == "None"


def test_two_axes_are_a_heat_map_labeled_with_units():
    values = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, np.nan]])
    axes, scale = sweep_figure([ONE, TWO], "rfd", values).axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "control.force_gain (1/N)",
        "layout.pitch (mm)",
    )
    assert scale.get_ylabel() == "rfd (N)"
    drawn = axes.collections[0].get_array().reshape(2, 3)
    assert_array_equal(drawn.filled(np.nan), values.T)
    assert [text.get_text() for text in axes.texts] == ["0.1", "0.3", "0.5", "0.2", "0.4", "×"]


@pytest.mark.parametrize("columns", [[ONE], [ONE, TWO]])
def test_a_metric_nobody_has_is_drawn_as_missing_at_every_point(columns):
    nothing = np.full([len(one.values) for one in columns], np.nan)
    picture = sweep_figure(columns, "rfd", nothing)
    picture.canvas.draw()
    crosses = sum(
        len(line.get_xdata()) for line in picture.axes[0].get_lines() if line.get_marker() == "x"
    )
    assert crosses + sum(text.get_text() == "×" for text in picture.axes[0].texts) == nothing.size


@pytest.mark.usefixtures("here")
def test_a_sweep_over_two_axes_leaves_pictures_and_over_three_a_table_only(here, capsys):
    sweep = ["sweep", "slow_press", "--set", "simulation.duration=0.1", "--metric", "rfd,highest"]
    two = ["--vary", "valve_lag.time_constant=1 ms,2 ms", "--vary", "delay.dead_time=0,0.001"]
    assert main([*sweep, *two, "--out", "out", "--quiet"]) == 0
    assert sorted(path.name for path in (here / "out").glob("*.png")) == ["highest.png", "rfd.png"]
    three = ["valve_lag.time_constant=1 ms", "delay.dead_time=0", "layout.rows=11,13"]
    assert main([*sweep, *(f"--vary={axis}" for axis in three), "--out", "three"]) == 0
    assert "3 axes: a table only, no pictures" in capsys.readouterr().out
    assert list((here / "three").glob("*.png")) == []


def two_fingers(fingers=2):
    case, share = drag(), 1.0 / fingers
    last = 3.0 + np.arange(fingers)
    touching = (case["time"][:, None] > 1.0) & (case["time"][:, None] < last)
    case["finger_force"] = share * 0.4 * touching
    case["fingertip"] = np.repeat(case["fingertip"][:, None], fingers, axis=1)
    case["fingertip"][..., 1] = np.linspace(-9e-3, 9e-3, fingers)
    return case


def test_a_figure_of_several_fingertips_has_force_cell_and_path_of_each():
    case = two_fingers()
    session, surface = plots.session_figure(case, SetPoint(0.2)), plots.surface_figure(case)
    force, heights, plan = axes(session, "force"), axes(session, "heights"), axes(surface, "map")
    lines = force.get_lines()
    for line, own in zip(lines, case["finger_force"].T, strict=False):
        assert_array_equal(line.get_ydata(), own)
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 3
    assert (force.get_xlabel(), force.get_ylabel()) == ("time (s)", "force (N)")
    assert (words(heights), words(force)) == (["1", "2"], ["set point 0.2 N", "in contact"])
    # The color of a cell is that of its fingertip, which is over it in the middle of its contact.
    assert [line.get_color() for line in heights.get_lines()] == [
        line.get_color() for line in lines[:2]
    ]
    reached = case["position"][plots.session_cells(case)]
    halfway = [case["fingertip"][row, finger, :2] for finger, row in enumerate((40, 50))]
    assert_near(reached, halfway, 2.2e-3)  # half a diagonal of a cell
    assert [line.get_label() for line in plan.get_lines()][:4] == [
        "lifted",
        "in contact",
        "_lifted",
        "_in contact",
    ]
    assert np.nanmax(plan.get_lines()[1].get_xdata()) < np.nanmax(plan.get_lines()[3].get_xdata())


def test_no_two_of_32_fingertips_are_drawn_alike_and_what_tells_them_covers_no_title():
    figure = plots.session_figure(two_fingers(32), SetPoint(0.4))
    figure.savefig(io.BytesIO())  # which places all that is drawn
    for part in (axes(figure, "heights"), axes(figure, "force")):
        title, legend = (part.title, part._left_title), part.get_legend()
        ends = [text.get_window_extent().x1 for text in title if text.get_text()]
        assert legend.get_window_extent().x0 > max(ends)
    *lines, _ = axes(figure, "force").get_lines()
    assert len({(line.get_color(), str(line._dash_pattern)) for line in lines}) == 32
