"""Method I up to its master: locate, control, model; direction of travel and loss."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.virtual_master import Master, Phase, VirtualMaster, VirtualMasterControl
from digiclay.core.model.control_interface import Measurement
from digiclay.core.model.layout import Layout

from tests.assemble import make_basis, make_system, master

PERIOD = 5e-3


def control(**gains: float) -> VirtualMasterControl:
    """Return Method I with some gains changed."""
    return make_system(Layout(15, 15), control=VirtualMaster(**gains)).controller


def touched(*presses: tuple[float, float, float], height: float = 40.0) -> Measurement:
    """Return a measurement of pressed cells: x, y in mm and force in N."""
    x, y, force = np.array(presses).reshape(-1, 3).T
    level, rest = np.full(x.size, height * 1e-3), np.full(x.size, Mode.REST, np.int8)
    return Measurement(
        make_basis(x * 1e-3, y * 1e-3), level, force, level, rest, np.empty((0, x.size)), np.arange(x.size)
    )


# Locate


def test_the_master_is_at_the_centroid_of_the_forces() -> None:
    memory, _ = control().locate(control().begin(), touched((0, 0, 0.1), (3, 0, 0.1), (0, 3, 0.2)))
    assert (memory.x, memory.y) == pytest.approx((0.75e-3, 1.5e-3), abs=1e-15)


def test_at_first_touch_all_cells_count() -> None:
    memory, _ = control().locate(control().begin(), touched((-20, 0, 0.1), (20, 0, 0.3)))
    assert memory.x == pytest.approx(10e-3, abs=1e-15)


def test_later_only_cells_near_the_master_count() -> None:
    memory, _ = control().locate(master(), touched((0, 0, 0.1), (6, 0, 0.1), (9, 0, 5.0)))
    assert memory.x == pytest.approx(3e-3, abs=1e-15)


def test_the_reference_is_the_surface_at_first_touch() -> None:
    memory, _ = control().locate(control().begin(), touched((0, 0, 0.05), height=52.0))
    assert memory.reference == pytest.approx(52e-3)


def test_a_force_too_small_to_be_a_finger_starts_nothing() -> None:
    memory, disc = control().locate(control().begin(), touched((0, 0, 0.9e-3)))
    assert (memory.phase, disc) == (Phase.IDLE, None)


def test_the_cells_asked_for_reach_to_the_edge_ring() -> None:
    _, disc = control().locate(master(), touched((0, 0, 0.4)))
    assert disc == pytest.approx((0.0, 0.0, 18.5e-3))


# Control


def test_first_touch_starts_the_virtual_spring() -> None:
    memory, _ = control().locate(control().begin(), touched((0, 0, 0.1)))
    assert memory.phase is Phase.SPRING


def test_shaping_starts_at_the_set_point() -> None:
    memory = master(phase=Phase.SPRING)
    phases = [control().locate(memory, touched((0, 0, force)))[0].phase for force in (0.399, 0.401)]
    assert phases == [Phase.SPRING, Phase.SHAPING]


def test_the_force_that_is_held_is_that_on_all_touched_cells() -> None:
    # The centroid takes those within r_VM of the master alone; a flank pressed farther off is felt as well.
    memory, _ = control().locate(master(phase=Phase.SPRING), touched((0, 0, 0.3), (9, 0, 0.11)))
    assert (memory.phase, memory.x) == (Phase.SHAPING, 0.0)


def test_shaping_goes_on_below_the_set_point() -> None:
    assert control().locate(master(), touched((0, 0, 0.1)))[0].phase is Phase.SHAPING


def settled(memory: Master, force: float, count: int = 600) -> Master:
    """Return the master after some periods of a steady force."""
    method = control()
    for _ in range(count):
        memory, _ = method.locate(memory, touched((0, 0, force)))
    return memory


def test_the_virtual_spring_gives_way_by_force_over_stiffness() -> None:
    memory = settled(master(phase=Phase.SPRING, height=40e-3), 0.2)
    # 0.2 N / 200 N/m is 1 mm. The flow goes with the error squared: after 3 s some 60 µm are left.
    assert memory.height == pytest.approx(39e-3, abs=0.1e-3)


@pytest.mark.parametrize(("force", "direction"), [(0.3, 1.0), (0.5, -1.0)])
def test_force_control_raises_the_master_below_the_set_point_and_lowers_it_above(
    force: float, direction: float
) -> None:
    assert np.sign(settled(master(), force, 20).height - 45e-3) == direction


def test_the_master_stays_at_the_set_point() -> None:
    assert settled(master(), 0.4).height == 45e-3


# Model


@pytest.mark.parametrize(("force", "speed"), [(0.002, 24e-3), (5.0, -24e-3)])
def test_the_master_is_no_faster_than_a_real_free_pin(force: float, speed: float) -> None:
    fast, later = settled(master(), force, 20), settled(master(), force, 21)
    assert (later.height - fast.height) / PERIOD == pytest.approx(speed, rel=0.01)  # two digits


@pytest.mark.parametrize(("force", "stop"), [(0.002, 100e-3), (5.0, 0.0)])
def test_the_master_stops_where_a_real_pin_does(force: float, stop: float) -> None:
    assert settled(master(), force, 1500).height == stop


def test_the_master_s_valve_lags_as_a_real_one() -> None:
    memory = settled(master(), 5.0, 1)
    # One period of a full command: 1 - exp(-5 ms/2 ms). Rounding.
    assert memory.opening == pytest.approx(-(1.0 - np.exp(-2.5)), rel=1e-12)


# Direction


def moved(memory: Master, *path_x: float) -> Master:
    """Return the master after the finger has been at some x, mm, one period each."""
    method = control()
    for x in path_x:
        memory, _ = method.locate(memory, touched((x, 0, 0.4)))
    return memory


def test_a_slow_finger_gets_its_direction_once_it_has_traveled_far_enough() -> None:
    assert moved(master(), *np.linspace(0, 1.6, 500)).heading[2:] == (1.0, 0.0)


def test_a_finger_that_has_not_traveled_has_no_direction() -> None:
    assert moved(master(), *np.linspace(0, 1.4, 500)).heading[2:] == (0.0, 0.0)


def test_a_resting_finger_keeps_its_direction() -> None:
    assert moved(master(0.0, 1.0), *([0.3, -0.4] * 200)).heading[2:] == (0.0, 1.0)


def test_a_fast_finger_gets_its_direction_in_one_period() -> None:
    assert moved(master(), -5.0).heading[2:] == (-1.0, 0.0)


# Loss


def alone(memory: Master, count: int) -> Master:
    """Return the master after some periods without a finger."""
    for _ in range(count):
        memory, _ = control().locate(memory, touched())
    return memory


def test_a_finger_is_not_lost_within_the_loss_time() -> None:
    assert alone(master(), 10).phase is Phase.SHAPING  # 50 ms


def test_a_finger_is_lost_after_the_loss_time() -> None:
    memory = alone(master(), 11)
    assert (memory.phase, memory.losses) == (Phase.IDLE, 1)


def test_a_finger_lost_before_shaping_is_no_loss() -> None:
    memory = alone(master(phase=Phase.SPRING), 11)
    assert (memory.phase, memory.losses) == (Phase.IDLE, 0)


def test_a_finger_felt_again_in_time_is_not_lost() -> None:
    memory, _ = control().locate(alone(master(), 9), touched((0, 0, 0.4)))
    assert alone(memory, 10).losses == 0


def test_a_finger_that_comes_down_elsewhere_starts_anew_and_is_counted() -> None:
    memory, _ = control().locate(master(), touched((-18, 0, 0.1), height=43.0))
    assert (memory.phase, memory.x, memory.losses) == (Phase.SPRING, pytest.approx(-18e-3), 1)


def test_a_new_touch_after_a_loss_starts_the_virtual_spring() -> None:
    memory, _ = control().locate(alone(master(), 11), touched((3, 3, 0.1)))
    assert (memory.phase, memory.losses) == (Phase.SPRING, 1)


# Noise


def hearing(floor: float) -> VirtualMasterControl:
    """Return Method I with sensors whose noise hides forces below a floor, N."""
    return replace(control(), floor=floor)


def test_a_reading_that_may_be_noise_is_no_finger() -> None:
    phases = [hearing(10e-3).locate(Master(), touched((0, 0, force)))[0].phase for force in (9.9e-3, 10.1e-3)]
    assert phases == [Phase.IDLE, Phase.SPRING]


def test_readings_that_may_be_noise_do_not_add_up_to_a_finger() -> None:
    memory, _ = hearing(10e-3).locate(Master(), touched(*[(3.0 * x, 0, 9e-3) for x in range(5)]))
    assert memory.phase is Phase.IDLE


def test_noise_does_not_draw_the_master_aside() -> None:
    memory, _ = hearing(10e-3).locate(master(), touched((0, 0, 0.1), (6, 0, 9e-3), (-3, 0, 0.1)))
    assert memory.x == pytest.approx(-1.5e-3, abs=1e-15)


def test_what_noise_hides_next_to_the_master_counts_to_the_force_that_is_held() -> None:
    # 0.39 N are felt: what lies below the floor makes it more or less than the set point, 0.4 N.
    start = master(phase=Phase.SPRING)
    near = [touched((0, 0, 0.39), (6, 0, hidden), (-6, 0, 9e-3)) for hidden in (2e-3, -2e-3)]
    phases = [hearing(10e-3).locate(start, seen)[0].phase for seen in near]
    assert phases == [Phase.SHAPING, Phase.SPRING]


def test_what_noise_hides_farther_off_does_not() -> None:
    start = master(phase=Phase.SPRING)
    far = [touched((0, 0, 0.395), (9, 0, force)) for force in (9.9e-3, 10.1e-3)]
    phases = [hearing(10e-3).locate(start, seen)[0].phase for seen in far]
    assert phases == [Phase.SPRING, Phase.SHAPING]


def test_what_noise_hides_counts_around_where_the_master_was() -> None:
    # 6 mm behind where it was and 11 mm from where it is now; the other way round 12 mm and 7 mm.
    start = master(phase=Phase.SPRING)
    moving = [touched((5, 0, 0.39), (x, 0, 20e-3)) for x in (-6, 12)]
    found = [hearing(30e-3).locate(start, seen)[0] for seen in moving]
    assert [(one.x, one.phase) for one in found] == [(5e-3, Phase.SHAPING), (5e-3, Phase.SPRING)]


def test_at_first_touch_what_noise_hides_does_not_count() -> None:
    memory, _ = hearing(10e-3).locate(Master(), touched((0, 0, 0.395), (3, 0, 9e-3)))
    assert memory.phase is Phase.SPRING
