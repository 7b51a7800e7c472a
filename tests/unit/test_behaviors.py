"""The behaviors: what each commands, remembers and refuses on measurements handed to it; and their parts."""

import re

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.control.displays import SHAPES, evaluate_shape
from digiclay.core.control.exchange import make_exchange
from digiclay.core.model.control_interface import Measurement
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve

from tests.assemble import master, refused_in_a_line, table

BEHAVIORS = ("elastic", "plastic", "viscous", "push_pull", "force_display", "shape_display")
REST = 40e-3
#: Speed of a free pin at full valve without a conduit, m/s, two digits.
FREE = 24e-3


def control(method, **known):
    """Return a behavior, put together for a bed of 5 x 5 cells, without conduits."""
    table = {
        "layout": {"rows": 5, "columns": 5},
        "conduit": "absent",
        "control": {"method": method, **known},
    }
    return assemble(resolve(table)).controller


def seen(behavior, height=0.0, force=0.0, target=0.0, mode=0):
    """Return a measurement of the whole 5 x 5 bed: heights above rest in mm, forces in mN."""
    x, y = np.tile((np.arange(5) - 2.0) * 3e-3, 5), np.repeat((np.arange(5) - 2.0) * 3e-3, 5)
    full = np.zeros(25)
    return Measurement(
        np.array([full + 1.0, x, y, x * x, x * y, y * y]),
        REST + (full + height) * 1e-3,
        (full + force) * 1e-3,
        REST + (full + target) * 1e-3,
        np.full(25, mode, np.int8),
        np.zeros((behavior.rows, 25)),
        np.arange(25),
    )


def middle(value):
    """Return a row of the bed that is 0 but in the middle."""
    return np.where(np.arange(25) == 12, value, 0.0)


def orders(behavior, measurement):
    memory, _ = behavior.locate(behavior.begin(), measurement)
    return behavior.command(memory, measurement)[1]


def test_a_lead_of_the_hybrid_is_taken_back_where_method_one_takes_over():
    hybrid = assemble(resolve({"control": {"method": "hybrid"}})).controller
    memory = hybrid.begin()._replace(master=master(x=30e-3))
    found = []
    for lead in (0.0, 0.5):
        measurement = seen(hybrid, target=1.0 + lead)
        measurement.own[hybrid.observer.at.lead] = lead * 1e-3
        found.append(hybrid.command(memory, measurement)[1].target)
    np.testing.assert_allclose(found[1], found[0], rtol=1e-14)  # rounding


@pytest.mark.parametrize("method", BEHAVIORS)
def test_commands_are_openings_and_an_untouched_bed_at_rest_is_left_alone(method):
    behavior, chance = control(method), np.random.default_rng(1)
    wild = [chance.uniform(low, high, 25) for low, high in ((-40, 60), (0, 500), (-40, 60))]
    assert np.all(np.abs(orders(behavior, seen(behavior, *wild)).command) <= 1.0)
    untouched = seen(behavior)
    nobody = Measurement(*(values[..., :0] for values in untouched[:-3]))  # arrays alone
    memory, disc = behavior.locate(behavior.begin(), nobody)
    given = behavior.command(memory, untouched)[1]
    if method != "shape_display":
        assert disc is None
        assert not given.command.any()
        assert set(given.mode.tolist()) == {int(Mode.REST)}


@pytest.mark.parametrize(
    "method", ["elastic", "plastic", "viscous", "force_display", "shape_display"]
)
def test_a_cell_is_touched_from_the_felt_force_on_and_not_opened_to_more_than_its_reservoir_lifts(
    method,
):
    known = {} if method == "shape_display" else {"felt_force": 5e-3}
    behavior = control(method, **known)
    for force, touched in ((4.9, False), (5.1, True)) if known else ():
        assert (orders(behavior, seen(behavior, force=force)).mode[0] > Mode.HOLD) == touched
    # 0.157 N is what 0.5 bar lifts; opening to it would let the pin sink.
    given = orders(behavior, seen(behavior, height=-10.0, force=160.0, target=0.0))
    assert np.all(given.command <= 0.0)


#: Interpolation between 129 openings takes up to 1/4 of a step squared.
TABLE = 2e-5 * FREE


@pytest.mark.parametrize(
    "method, known, given, speed",
    [
        # Elastic: 20 N/m x 3 mm = 60 mN balance; (20 N/m x 1 mm - 60 mN) / 5 N s/m.
        ("elastic", {"stiffness": 20.0}, {"height": -3.0, "force": 60.0}, 0.0),
        ("elastic", {"stiffness": 20.0, "damping": 5.0}, {"height": -1.0, "force": 60.0}, -8e-3),
        # Plastic: below yield it does not move, above it sinks by the rest of the force over the
        # damping.
        ("plastic", {"yield_force": 0.03}, {"force": 29.0}, 0.0),
        ("plastic", {"yield_force": 0.03, "damping": 5.0}, {"force": 50.0}, -4e-3),
        # It does not push the fingertip back; left alone it goes back to where it yielded, 0.1 mm
        # in 20 ms.
        ("plastic", {}, {"height": -2.0, "force": 10.0, "target": -1.9}, 0.0),
        ("plastic", {}, {"height": -2.0, "target": -1.9}, 5e-3),
        # Force display: at rest under the force of the field, above its limit it sinks, 0.1 mm in
        # 20 ms.
        ("force_display", {"field": "flat", "force": 0.05}, {"height": -2.0, "force": 50.0}, 0.0),
        ("force_display", {"field": "flat", "force": 0.05}, {"height": -2.0, "force": 25.0}, 5e-3),
        ("force_display", {"rise": 1e-3}, {"height": 1.1, "force": 10.0}, -5e-3),
    ],
)
def test_a_cell_moves_by_its_law(method, known, given, speed):
    behavior = control(method, **known)
    command = orders(behavior, seen(behavior, **given)).command
    # Without load a pin's speed is the opening squared times the free speed.
    assert np.sign(command) * command**2 * behavior.motion.up[-1] == pytest.approx(speed, abs=TABLE)


@table(
    "method, known, given, target, mode",
    {
        "yields": ("plastic", {}, {"height": -2.0, "force": 50.0}, -2e-3, None),
        "low": ("plastic", {}, {"height": -1.0, "force": 50.0, "target": -2.0}, -2e-3, None),
        "less than felt": ("elastic", {}, {"force": 2.0, "mode": Mode.REST}, 0.0, Mode.REST),
        "touched": ("elastic", {}, {"force": 2.0, "mode": Mode.SPRING}, 0.0, Mode.SPRING),
        # u' = -F/c - u/τ from -4 mm: equilibrium -F τ/c = -2.5 mm, reached with exp(-T/τ), exactly.
        "relaxes": (
            "viscous",
            {"diffusivity": 0.0, "damping": 10.0, "recovery_time": 0.5},
            {"force": 50.0, "target": -4.0},
            -2.5e-3 - 1.5e-3 * np.exp(-0.01),
            None,
        ),
    },
)
def test_a_cell_remembers_its_height_and_its_touch(method, known, given, target, mode):
    behavior = control(method, **known)
    found = orders(behavior, seen(behavior, **given))
    assert found.target - REST == pytest.approx(target, rel=1e-12, abs=1e-15)
    assert mode is None or found.mode[0] == mode


def test_a_cell_of_the_force_display_is_kept_for_its_release_time_after_the_fingertip_left():
    behavior = control("force_display", release_time=0.0225)
    now, follows = seen(behavior, mode=Mode.FORCE_FOLLOW), []
    for _ in range(6):
        _, given = behavior.command(None, now)
        now = now._replace(mode=given.mode)
        follows.append(bool(given.mode[0] == Mode.FORCE_FOLLOW))
    # 4 periods of 5 ms are within 22.5 ms, 5 are not.
    assert follows == [True] * 4 + [False] * 2


@table("diffusivity, sunk", {"with neighbors": (10e-6, [7, 11, 12, 13, 17]), "alone": (0.0, [12])})
def test_a_dent_draws_its_neighbors_along_and_the_cells_asked_for_hold_them(diffusivity, sunk):
    behavior = control("viscous", diffusivity=diffusivity)
    dent = seen(behavior, target=middle(-5.0), force=middle(20.0))
    memory, _ = behavior.locate(behavior.begin(), dent)
    memory, given = behavior.command(memory, dent)
    assert np.flatnonzero(given.target < REST - 1e-6).tolist() == sunk
    # Those drawn along by a pressed neighbor show it.
    assert np.flatnonzero(given.mode == Mode.BLISTER).tolist() == [
        cell for cell in sunk if cell != 12
    ]
    _, (x, y, radius) = behavior.locate(memory, dent)
    # The four neighbors, 3 mm away, in a box of 6 x 6 mm, and a margin of two pitches.
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert radius == pytest.approx((np.hypot(3e-3, 3e-3) if diffusivity else 0.0) + 6e-3)


def cycle(behavior, measurement):
    """Return the orders at the end of a cycle of listening."""
    memory = behavior.begin()
    for _ in range(2):
        memory, _ = behavior.locate(memory, measurement)
        memory, given = behavior.command(memory, measurement)
    return given


def test_push_pull_never_reads_the_force_and_listens_down_as_fast_as_up():
    behavior = control("push_pull")
    blind = seen(behavior, height=middle(-0.5), force=np.nan)
    given = cycle(behavior, blind)
    for row in (given.target, given.command, blind.own):
        assert np.all(np.isfinite(row))
    assert np.flatnonzero(given.mode == Mode.FORCE_FOLLOW).tolist() == [12]
    behavior = control("push_pull")
    up, down = cycle(behavior, seen(behavior)).command, orders(behavior, seen(behavior)).command
    assert np.all(up > 0.0)
    assert np.array_equal(up, -down)  # the reservoirs are alike
    table = {"supply": {"high": 0.8e5, "low": -0.2e5}, "control": {"method": "push_pull"}}
    up, down = assemble(resolve(table)).controller.motion.open_for(np.array([8e-3, -8e-3]))
    # Flow goes with the square of the opening and the pressure: 4 times the pressure, half the
    # opening. The conduit and the table's interpolation change it by some percent.
    assert -down / up == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(
    "drift, dragged",
    [(-0.09, 0.0), (-0.11, -0.01), (0.09, 0.0), (0.11, 0.01), (-0.5, -0.4), (0.5, 0.4)],
)
def test_a_drift_beyond_the_threshold_is_a_touch_that_takes_the_commanded_height_along(
    drift, dragged
):
    behavior = control("push_pull", threshold=0.1e-3)
    given = cycle(behavior, seen(behavior, height=middle(drift)))
    assert (given.mode[12] == Mode.FORCE_FOLLOW) == bool(dragged)
    assert given.target[12] - REST == pytest.approx(dragged * 1e-3)


# The pyramid's first row is at rest already; 11 periods of 5 ms are the first to be longer than
# 52.5 ms.
@pytest.mark.parametrize("patience, starts", [(0.0525, [0, 11, 22, 33]), (0.05, [0, 10, 20, 30])])
def test_a_move_of_blocked_pins_waits_for_its_patience(patience, starts):
    behavior = control("shape_display", shape="pyramid", refresh="one_time", patience=patience)
    blocked, memory, moves = seen(behavior), behavior.begin(), []
    for _ in range(35):
        memory, _ = behavior.command(memory, blocked)
        moves.append(memory.move)
    assert np.flatnonzero(np.diff([0, *moves])).tolist() == starts


def driven(**table):
    return assemble(resolve({"control": {"method": "elastic"}, **table})).controller.motion


def bed(arrangement, rows=7, columns=7):
    return make_grid(Layout(rows, columns, arrangement=arrangement))


def test_a_drive_is_limited_to_its_valve_and_approaches_a_height_in_its_settling_time():
    # More than a pin can do opens the valve fully, no speed shuts it.
    assert driven().open_for(np.array([-1.0, 0.0, 1.0])).tolist() == [-1.0, 0.0, 1.0]
    # 1 mm in 20 ms; nothing within the dead band.
    assert driven().approach(np.array([-9.9e-6, 9.9e-6, 1e-3])) == pytest.approx([0.0, 0.0, 50e-3])
    # Reservoirs that cannot raise a pin give finite commands.
    motion = driven(supply={"high": -0.1e5, "low": -0.5e5})
    assert np.all(np.abs(motion.open_for(np.array([-0.02, 0.0, 0.02]))) <= 1.0)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_values_spread_alike_along_x_and_y(arrangement):
    plan = bed(arrangement, 31, 31)
    rule, cells = make_exchange(plan, 10e-6, 5e-3), np.arange(plan.count)
    values = np.zeros(plan.count)
    center = plan.count // 2
    values[center] = 1.0
    for _ in range(50):
        values = rule.even_out(cells, values)
    x, y = plan.x - plan.x[center], plan.y - plan.y[center]
    spread = np.array([values @ x**2, values @ y**2])
    # Variance 2 D t = 2 x 10 mm²/s x 0.25 s; the limit on the rates takes 1 - (1 - e^-a)/a of it,
    # with a = 2 x 4 D T / p² = 0.044: 2 %. The bed's edge is 9 standard deviations away.
    assert spread == pytest.approx(5e-6, rel=0.03)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_an_exchange_keeps_the_sum_and_does_not_overshoot_however_long_the_period(arrangement):
    plan = bed(arrangement)
    cells, given = np.arange(plan.count), np.zeros(plan.count)
    checkered = np.where(cells % 2, 1.0, 0.0)
    for period in (5e-3, 1.0, 1e3):
        evened = make_exchange(plan, 10e-6, period).even_out(cells, checkered)
        assert -1e-12 <= evened.min() <= evened.max() <= 1.0 + 1e-12  # rounding
        assert evened.sum() == pytest.approx(checkered.sum(), rel=1e-12)  # rounding
    # In a long one a cell exchanges half of what its neighbors differ by.
    for ones, others, share in make_exchange(plan, 1e-5, 1e9).find_pairs(cells):
        np.add.at(given, np.concatenate((ones, others)), share)
    assert given[plan.count // 2] == pytest.approx(0.5, rel=1e-12)
    lonely = make_exchange(bed("aligned", 1, 1), 1e-5, 5e-3)
    assert lonely.even_out(np.zeros(1, np.intp), np.ones(1)).tolist() == [1.0]


#: At x = 0.5, y = 0.25 of the square from -1 to 1, 0.559 from its middle.
VALUES = {
    "dome": 1.0 - 0.3125, "saddle": 0.1875, "wave": 0.0, "ripple": np.cos(3.0 * np.pi * 0.3125**0.5),
    "crater": 0.930852, "pyramid": 0.5, "ramp": 0.5, "flat": 0.0,
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_a_named_shape_has_the_values_of_its_formula_and_fits_a_bed_of_one_cell(shape):
    assert SHAPES[shape](np.array([0.5]), np.array([0.25]))[0] == pytest.approx(
        VALUES[shape], abs=1e-6
    )
    values = evaluate_shape(shape, bed("aligned", 41, 41))
    assert np.all(np.abs(values) <= 1.0 + 1e-12)
    assert shape == "flat" or np.ptp(values) > 0.9
    assert np.all(np.isfinite(evaluate_shape(shape, bed("aligned", 1, 1))))


WRONG = [
    (
        "plastic",
        {"yield_force": 1e-3},
        "yield_force must be at least felt_force, 0.005 N (got 0.001 N).",
    ),
    (
        "force_display",
        {"field": "ramp", "contrast": 0.95},
        "0.005 N (got 0.0025 N at its smallest).",
    ),
    (
        "force_display",
        {"field": "ramp", "force": 0.12},
        "can press, 0.157 N (got 0.18 N at its largest).",
    ),
    (
        "push_pull",
        {"following_speed": 1e-3},
        "at least listening_speed, 0.008 m/s (got 0.001 m/s).",
    ),
    ("push_pull", {"threshold": 20e-6}, "way in a control period, 4e-05 m (got 2e-05 m)."),
    ("shape_display", {"shape": "hat"}, "must be one of dome, "),
    ("shape_display", {"shape": "nowhere.npy"}, "(got nowhere.npy: No such file or directory)."),
    ("shape_display", {"amplitude": 70e-3}, "stroke, 0.1 m (got heights from 0.04 m to 0.11 m)."),
    (
        "elastic",
        {"settling_time": 5e-3},
        "settling_time must be at least two control periods, 0.01 s (got",
    ),
    ("elastic", {"damping": 1.0}, "damping must be at least 2.1 N s/m at this control period"),
]


@pytest.mark.parametrize("method, given, said", WRONG)
def test_a_bad_parameter_is_refused_in_one_line(method, given, said):
    with refused_in_a_line(ParameterError, rf"^control\..*{re.escape(said)}"):
        assemble(
            resolve({"layout": {"rows": 5, "columns": 5}, "control": {"method": method, **given}})
        )


@pytest.mark.parametrize(
    "array, said",
    [
        (np.zeros((4, 5)), "an array of the bed's 5 x 5 cells (got {}: 4 x 5)."),
        (np.full((5, 5), 0.2), "values from 0 to 0.1 m (got {}: 0.2 m)."),
        (np.full((5, 5), np.nan), "values from 0 to 0.1 m (got {}: nan m)."),
        (np.array([["a"] * 5] * 5), "one array of numbers (got {})."),
    ],
)
def test_a_file_that_does_not_fit_the_bed_is_refused(tmp_path, array, said):
    np.save(tmp_path / "mine.npy", array)
    with pytest.raises(ParameterError, match=re.escape(said.format(tmp_path / "mine.npy"))):
        control("shape_display", shape=str(tmp_path / "mine.npy"))
