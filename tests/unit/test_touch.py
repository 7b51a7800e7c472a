"""From the finger's pose to forces: which cells may be touched, and how hard."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.engine.simulation import begin, step
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import LEVEL, Fingertip, compute_reach
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.model.null_parts import Unrelaxed
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.touch import MOST, Touch, compute_force, trace_finger

from tests.assemble import AWAY, make_system, path, record

ELASTIC, RELAXING = (Touch(Fingertip(), Contact(), pulp) for pulp in (Unrelaxed(), Relaxation()))


def test_force_is_the_share_of_tension_less_what_relaxed() -> None:
    under, filters = np.array([48e-3]), np.array([[0.3], [0.2], [0.1]])
    expected = 0.34 * (0.125 * np.expm1(2.0) - (0.62 * 0.3 + 0.20 * 0.2 + 0.10 * 0.1))
    assert compute_force(RELAXING, np.array([49e-3]), under, filters) == pytest.approx(
        expected, rel=1e-13
    )  # rounding


def test_the_pulp_does_not_stick() -> None:
    filters = np.array([[3.0], [2.0], [1.0]])
    assert compute_force(RELAXING, np.array([48.1e-3]), np.array([48e-3]), filters).tolist() == [0.0]


def test_there_is_no_force_across_a_gap() -> None:
    assert compute_force(ELASTIC, np.array([47e-3]), np.array([48e-3]), np.empty((0, 1))).tolist() == [0.0]


def near(*poses: tuple[float, float, float]) -> np.ndarray:
    """Return the cells a level finger may touch while it is at some places, mm; pins stand at 40 mm."""
    bed, table = (
        make_grid(Layout()),
        np.array([[[x * 1e-3, y * 1e-3, z * 1e-3, *LEVEL] for x, y, z in poses]]),
    )
    disc = compute_reach(trace_finger(Fingertip(), table).at(0).window, 40e-3)
    return bed.disc(*disc) if disc else np.empty(0, int)


def test_a_finger_above_the_highest_pin_touches_none() -> None:
    assert near((0, 0, 60), (0, 0, 60)).size == 0


def test_a_finger_beside_the_bed_touches_none() -> None:
    assert near((200, 0, 30), (200, 0, 30)).size == 0


def test_a_finger_on_a_pin_may_touch_it_and_not_the_whole_bed() -> None:
    cells = near((0, 0, 38), (0, 0, 38))
    assert 312 in cells
    assert cells.size < 150


def dragged(periods: int) -> np.ndarray:
    """Return poses (t, 3, 7) of a finger that is dragged and tilted, a period of 5 ms each."""
    moments = np.linspace(0.0, 1.0, 2 * periods + 1)
    turn = 0.2 * moments
    whole = np.column_stack(
        [
            20e-3 * moments,
            5e-3 * moments**2,
            38e-3 - 1e-3 * moments,
            np.cos(turn),
            np.sin(turn),
            *np.zeros((2, len(turn))),
        ]
    )
    return np.stack([whole[2 * i : 2 * i + 3] for i in range(periods)])


def test_undersides_worked_out_several_periods_at_a_time_are_those_of_each_to_the_last_bit() -> None:
    poses, places = dragged(70), make_grid(Layout()).compute_basis(np.arange(100, 400))
    whole = trace_finger(Fingertip(), poses)
    together = [whole.under(i, places) for i in range(len(poses))]
    alone = [trace_finger(Fingertip(), poses[i : i + 1]).under(0, places) for i in range(len(poses))]
    assert np.array_equal(np.array(together), np.array(alone))


def test_other_places_in_mid_way_have_their_own_undersides() -> None:
    bed, coming = make_grid(Layout()), trace_finger(Fingertip(), dragged(8))
    first, second = bed.compute_basis(np.arange(50)), bed.compute_basis(np.arange(300, 350))
    coming.under(0, first)
    fresh = trace_finger(Fingertip(), dragged(8)).under(1, second)
    assert np.array_equal(coming.under(1, second), fresh)


def test_a_finger_over_a_large_bed_is_worked_out_for_few_periods_at_a_time() -> None:
    coming = trace_finger(Fingertip(), dragged(8))
    many = np.zeros((6, MOST // 6))  # three instants a period: twice as many cells would be all of `MOST`
    assert coming.under(0, many).base.size <= 2 * 2 * MOST  # R and the tangent of two periods


def pressed(x: float, y: float, depth: float) -> np.ndarray:
    """Return the forces on locked pins at 40 mm, the finger's lowest point `depth` mm below their tops."""
    system = make_system(Layout(9, 9))
    run = record(system, path((0, x, y, 45), (0.05, x, y, 45), (0.1, x, y, 40 - depth)), 20)
    return run.force[-1].reshape(9, 9)


def test_a_finger_on_a_pin_presses_it_hardest() -> None:
    assert np.unravel_index(pressed(3.0, -6.0, 2.0).argmax(), (9, 9)) == (2, 5)


def test_a_deeper_press_touches_more_pins() -> None:
    assert (pressed(0, 0, 0.5) > 0).sum() < (pressed(0, 0, 1.5) > 0).sum() < (pressed(0, 0, 2.5) > 0).sum()


def test_a_finger_over_the_rim_of_the_bed_presses_what_there_is() -> None:
    middle, rim = pressed(0, 0, 2.0), pressed(12.0, 0, 2.0)
    # The half on this side of the finger: the same cells, the same path. Rounding of positions of 12 mm.
    assert rim[4, 4:] == pytest.approx(middle[4, :5], abs=1e-12)


def test_a_finger_a_pitch_outside_the_bed_still_presses_its_outer_pins() -> None:
    forces = pressed(15.0, 0.0, 3.0)
    assert forces[4, 8] > 0.0
    assert not forces[:, :6].any()


@pytest.mark.parametrize("away", [(30, 30, 38), (0, 0, 300)], ids=["aside", "up"])
def test_a_finger_that_leaps_away_leaves_no_force_behind(away: tuple[float, float, float]) -> None:
    down = (-30, -30, 38)
    waypoints = [(0, -30, -30, 45), (0.05, *down), (0.1, *down), (0.101, *away), (0.3, *away)]
    system = make_system()
    run = record(system, path(*waypoints, interpolation="linear"), 60)
    left = system.grid.disc(-30e-3, -30e-3, 6e-3)
    assert run.force[20, left].any()
    assert not run.force[21:, left].any()


def test_a_finger_that_never_comes_changes_nothing() -> None:
    run = record(make_system(Layout(5, 5)), AWAY, 50)
    assert np.array_equal(run.rows[-1], run.rows[0])


def test_the_pulp_over_a_pin_goes_on_relaxing_after_contact() -> None:
    # Press, leave, come near again without touching: the filters have decayed all the while.
    system = make_system(Layout(1, 1))
    state, filters = begin(system), range(*system.cell.pulp_rows.indices(system.rows.physics))
    heights = [38.0] * 20 + [90.0] * 40 + [40.0 + 1e-6]
    kept = []
    for height in heights:
        pose = np.array([0, 0, height * 1e-3, *LEVEL])
        state = step(system, state, np.tile(pose, (system.instants.size, 1, 1)))
        kept.append([float(state.row(row)[0]) for row in filters])
    after, last = np.array(kept[19]), np.array(kept[-1])
    assert after.min() > 0.0
    decay = np.exp(-41 * 5e-3 / np.array([4e-3, 70e-3, 1.4]))
    # Rounding; the first filter has lost 22 orders of magnitude.
    assert last == pytest.approx(after * decay, rel=1e-10, abs=1e-30)
