"""Method III finds a fingertip from its undersides, and brings loaded pins to their heights in time."""

import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.finger_estimate import FingerFilter, Spread, invert_six
from digiclay.core.control.flow_servo import make_flow_servo
from digiclay.core.control.servo import Tracking, lock_overloaded
from digiclay.core.model.actuator import Supply
from digiclay.core.model.fingertip import Fingertip, compute_forms, compute_underside
from digiclay.core.model.valve import Valve
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve

from tests.assemble import make_basis, make_system, refused_in_a_line, table
from tests.measured import measure

PERIOD, BAND = 5e-3, 1e-6
#: Elongation of the default fingertip, 10 by 8 mm.
LONG = (100.0 - 64.0) / (100.0 + 64.0)
#: Cells about the origin, 3 mm apart.
X, Y = (grid.ravel() * 3e-3 for grid in np.meshgrid(np.arange(-6.0, 7.0), np.arange(-6.0, 7.0)))


def filter_of(tip):
    """Return a filter of a fingertip, with the spread that Method III has."""
    return FingerFilter(tip, Spread(1.0, 0.5, 0.05, 30e-6), PERIOD)


def underside(tip, x, y, z, turn):
    """Return the underside that the physics has over all cells, m."""
    pose = np.array([[x, y, z, math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)]])
    under = compute_underside(*compute_forms(tip.outline(pose)), make_basis(X, Y))[0]
    return under


def follow(known, tip, speed=0.0, turn=0.0, count=200):
    """Return what a filter makes of a fingertip that moves along x, by the cells less than 2 mm above it."""
    found = known.begin(-9e-3, 0.0, 40.5e-3)
    for number in range(count):
        found = known.predict(found)
        under = underside(tip, speed * number * PERIOD - 10e-3, 1e-3, 40e-3, turn)
        here = under < 42e-3
        at = known.measure([found.mean], make_basis(X, Y)[:, here])
        (found,), _ = known.correct(
            [found], at, under[here], np.full(np.count_nonzero(here), 1e-10)
        )
    return found


@table(
    "size, speed, turn",
    {
        "at rest": (1.0, 0.0, 0.0),
        "dragged": (1.0, 20e-3, 0.0),
        "across": (1.0, 10e-3, 0.5 * math.pi),
        "turned far": (1.0, 10e-3, 2.5),
        "smaller than known, turned": (0.75, 5e-3, 0.6),
        "larger": (1.3, 5e-3, 0.0),
    },
)
def test_a_fingertip_is_found(size, speed, turn):
    tip = Fingertip(10e-3 * size, 8e-3 * size, 8e-3 * size)
    x, y, z, vx, vy, vz, scale, along, askew = follow(filter_of(Fingertip()), tip, speed, turn).mean
    # To a micrometer at rest; the last of 200 periods begins 199 periods after the first.
    place = (-10e-3 + 199 * PERIOD * speed, 1e-3, 40e-3)
    assert (x, y, z) == pytest.approx(place, abs=20e-6 if speed else 1e-6)
    assert (vx, vy, vz) == pytest.approx((speed, 0.0, 0.0), abs=0.2e-3)
    assert scale == pytest.approx(math.log(size), abs=5e-3)
    turned = LONG * math.cos(2.0 * turn), LONG * math.sin(2.0 * turn)
    assert (along, askew) == pytest.approx(turned, abs=5e-3)


def test_a_first_contact_is_uncertain_by_millimeters_and_a_first_underside_is_weighed_with_it():
    known = filter_of(Fingertip())
    first = known.begin(0.0, 0.0, 40e-3)
    spread = np.sqrt(np.diag(first.covariance))
    assert spread == pytest.approx([2e-3, 2e-3, 1e-3, 2e-2, 2e-2, 2e-2, 0.1, 0.2, 0.2])
    # Over the lowest point, and as uncertain as that: half of the error is believed.
    at = known.measure([first.mean], make_basis(np.zeros(1), np.zeros(1)))
    (after,), left = known.correct([first], at, np.array([40.4e-3]), np.array([1e-6]))
    assert (after.mean[2], left[0]) == pytest.approx((40.2e-3, 0.2e-3))


@pytest.mark.parametrize("known", [Fingertip(15e-3), Fingertip(width=4.8e-3), Fingertip(8e-3)])
def test_a_fingertip_known_too_long_too_narrow_or_round_is_found(known):
    *_, size, along, askew = follow(filter_of(known), Fingertip(), speed=5e-3, turn=0.6).mean
    mean = np.exp(-size) * known.height * 0.5 * (known.length**-2 + known.width**-2)
    curvatures = np.linalg.eigvalsh(mean * np.array([[1.0 - along, -askew], [-askew, 1.0 + along]]))
    # Of the lowest point: 8 mm over the squares of 10 and 8 mm. Farther off the known one is
    # another body.
    assert curvatures == pytest.approx([80.0, 125.0], rel=0.1)


@pytest.mark.parametrize(
    "order", [(0, 1, 2, 3, 4, 5), (5, 4, 3, 2, 1, 0), (1, 2, 3, 4, 5, 0), (0, 5, 1, 4, 2, 3)]
)
def test_the_inverse_is_that_of_numpy_also_where_pivots_vanish(order):
    matrix = np.random.default_rng(order[0]).normal(size=(6, 6)) * np.logspace(-3, 3, 6)
    assert invert_six(matrix) == pytest.approx(np.linalg.inv(matrix), rel=1e-9)
    # But for one number a row too small to divide by.
    tiny = matrix * 1e-13 - np.eye(6)[list(order)]
    assert invert_six(tiny) == pytest.approx(np.linalg.inv(tiny), rel=1e-9, abs=1e-15)
    # A singular covariance, as of a crafted snapshot, has none.
    assert np.isnan(invert_six(np.zeros((6, 6)))).any()


def cell_of(**parts):
    return make_system(**parts).cell


def servo_of(cell, dead_time=1e-3):
    return make_flow_servo(cell, PERIOD, dead_time, BAND)


def test_an_overloaded_pin_is_not_opened_upwards_and_commands_on_their_way_are_allowed_for():
    # A lag of 2 ms takes 2 (1 - exp(-5/2)) ms of a period of 5 ms.
    assert servo_of(cell_of()).left == pytest.approx(
        (1e-3 + 2e-3 * (1.0 - np.exp(-2.5)),), rel=1e-3
    )
    servo = servo_of(cell_of(valve_lag=None), 12e-3)
    assert servo.left == pytest.approx((5e-3, 5e-3, 2e-3))
    assert servo.span == pytest.approx(2.0 * PERIOD - 2e-3)
    # Earlier ones are put behind the newest.
    speeds, still = np.array([[1e-3], [2e-3], [3e-3]]), np.zeros(1)
    servo.serve(np.array([2e-3 * servo.span]), servo.find_limits(still), still, speeds)
    assert speeds[:, 0] == pytest.approx([2e-3, 1e-3, 2e-3])
    servo = servo_of(cell_of())
    speeds, load = np.zeros((servo.rows, 3)), np.array([servo.lift * 1.1, 0.0, 0.0])
    errors = np.array([1e-3, 0.9 * BAND, -0.9 * BAND])
    assert servo.serve(errors, servo.find_limits(load), load, speeds).tolist() == [0.0] * 3


@pytest.mark.parametrize("orifice", [0.5e-3, 1.0e-3])
@pytest.mark.parametrize("force", [0.0, 0.05, 0.1])
def test_the_opening_gives_the_speed_asked_for_under_load(orifice, force):
    cell = cell_of(valve=Valve(orifice_diameter=orifice))
    servo = servo_of(cell)
    speeds, load = np.zeros((servo.rows, 4)), np.full(4, force)
    limits = servo.find_limits(load)
    asked = np.array([0.1, 0.4, -0.3, -0.8]) * np.array([limits[1][0]] * 2 + [-limits[0][0]] * 2)
    command = servo.serve(asked * servo.span, limits, load, speeds)
    drop = cell.supply.pressure(command) - cell.actuator.pressure(load)
    # Interpolation in 129 openings; with the wide orifice the flow turns turbulent, and one step
    # refines it.
    assert cell.flow.flow(command, drop) / cell.actuator.area == pytest.approx(asked, rel=0.03)
    assert speeds[0] == pytest.approx(asked)


@pytest.mark.parametrize("name", ["high", "low"])
def test_a_reservoir_that_moves_no_free_pin_is_refused(name):
    with refused_in_a_line(ParameterError, f"supply.{name} must move pins without a load"):
        servo_of(cell_of(supply=Supply(**{name: 0.0})))


@pytest.mark.parametrize("dead_time", [0.0, 1e-3, 7e-3, 20e-3])
def test_a_free_pin_comes_to_its_height_without_swinging(dead_time):
    servo = servo_of(cell_of(valve_lag=None), dead_time)
    speeds, height, still = np.zeros((servo.rows, 1)), np.zeros(1), np.zeros(1)
    queue = [0.0] * (len(servo.left) + 1)
    heights = []
    for _ in range(40):
        servo.serve(1e-3 - servo.coast(height, speeds), servo.find_limits(still), still, speeds)
        queue = [float(speeds[0, 0]), *queue[:-1]]
        whole, part = divmod(dead_time / PERIOD + 1e-9, 1.0)
        # What the valve lets through in this period: the older command first, then the newer one.
        height = height + PERIOD * (
            part * queue[int(whole) + 1 if part > 1e-6 else int(whole)]
            + (1.0 - part) * queue[int(whole)]
        )
        heights.append(float(height[0]))
    assert heights[-1] == pytest.approx(1e-3, abs=2.0 * BAND)
    assert max(heights) <= 1.02e-3


def test_the_command_is_proportional_to_the_height_error_and_an_overloaded_cell_is_locked():
    # Gain times error, limited to a fully open valve; within the dead band and just beyond it.
    error = np.array([1.0, -0.5, 10.0, -10.0, 0.0099, -0.0099, 0.0, 0.0101, -0.0101])
    wanted = [0.5, -0.25, 1.0, -1.0, 0.0, 0.0, 0.0, 0.00505, -0.00505]
    height = np.full(error.size, 50e-3)
    # Rounding of the difference.
    assert Tracking().command(height + error * 1e-3, height) == pytest.approx(wanted, rel=1e-10)
    assert not Tracking(position_gain=0.0).command(height + 1.0, height).any()
    # The high reservoir lifts 0.157 N, 0.5 bar on a bore of 2 mm: not raised, but lowered.
    command, force = np.array([0.5, 0.5, -0.5]), np.array([0.16, 0.15, 1.0])
    assert lock_overloaded(command, force, 0.157).tolist() == [0.0, 0.5, -0.5]
    assert lock_overloaded(command[:0], force[:0], 0.157).tolist() == []


@pytest.mark.parametrize(
    "asked, force, yields", [(0.4, 0.17, False), (0.4, 0.19, True), (0.6, 0.19, False)]
)
def test_a_single_pin_gives_way_that_carries_nearly_half_of_the_set_point(asked, force, yields):
    system = assemble(resolve({"control": {"method": "hybrid", "force_setpoint": asked}}))
    controller, pin = system.controller, 312
    seen = measure(system.grid.x, system.grid.y, rows=controller.rows)
    seen.force[pin] = force
    _, orders = controller.command(controller.begin(), seen)
    assert (orders.target[pin] < 40e-3, orders.command[pin] < 0.0) == (yields, yields)
    np.testing.assert_array_equal(np.delete(orders.target, pin), 40e-3)
