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
from digiclay.core.model.touch import MOST, Touch, compute_force, join_paths, trace_finger

from tests.assemble import make_system, path, record

ELASTIC, RELAXING = (Touch(Fingertip(), Contact(), pulp) for pulp in (Unrelaxed(), Relaxation()))


@pytest.mark.parametrize(
    ("touch", "height", "filters", "force"),
    [
        # The share of the tension less what relaxed, 0.62 0.3 + 0.20 0.2 + 0.10 0.1.
        (RELAXING, 49e-3, [0.3, 0.2, 0.1], 0.34 * (0.125 * np.expm1(2.0) - 0.236)),
        (RELAXING, 48.1e-3, [3.0, 2.0, 1.0], 0.0),  # the pulp does not stick
        (ELASTIC, 47e-3, [], 0.0),  # across a gap
    ],
)
def test_force_is_the_share_of_tension_less_what_relaxed(
    touch: Touch, height: float, filters: list[float], force: float
) -> None:
    found = compute_force(touch, np.array([height]), np.array([48e-3]), np.array(filters).reshape(-1, 1))
    assert found == pytest.approx(force, rel=1e-13, abs=0.0)  # rounding


@pytest.mark.parametrize(("x", "z", "most"), [(0, 60, 0), (200, 30, 0), (0, 38, 149)])
def test_a_level_finger_may_touch_the_cells_below_it_alone(x: float, z: float, most: int) -> None:
    # Above the highest pin and beside the bed none; on a pin that one, and not the whole bed.
    pose = np.array([x * 1e-3, 0.0, z * 1e-3, *LEVEL])
    disc = compute_reach(trace_finger(Fingertip(), np.tile(pose, (1, 2, 1))).at(0).window, 40e-3)
    cells = make_grid(Layout()).disc(*disc) if disc else np.empty(0, int)
    assert (312 in cells) == (most > 0)
    assert cells.size <= most


def dragged(periods: int) -> np.ndarray:
    """Return poses (t, 3, 7) of a finger that is dragged and tilted, a period of 5 ms each."""
    moments = np.linspace(0.0, 1.0, 2 * periods + 1)
    turn = 0.2 * moments
    still = np.zeros((2, len(turn)))
    way = (20e-3 * moments, 5e-3 * moments**2, 38e-3 - 1e-3 * moments)
    whole = np.column_stack([*way, np.cos(turn), np.sin(turn), *still])
    return np.stack([whole[2 * i : 2 * i + 3] for i in range(periods)])


def test_undersides_of_several_periods_at_a_time_are_those_of_each_to_the_last_bit() -> None:
    poses, bed = dragged(70), make_grid(Layout())
    whole, places = trace_finger(Fingertip(), poses), bed.compute_basis(np.arange(100, 400))
    alone = [trace_finger(Fingertip(), poses[i : i + 1], i) for i in range(len(poses))]
    for i, one in enumerate(alone):
        assert np.array_equal(whole.at(i).under(places), one.at(i).under(places))
    # Other places in mid way have their own undersides.
    other = bed.compute_basis(np.arange(50))
    assert np.array_equal(whole.at(40).under(other), alone[40].at(40).under(other))


def test_undersides_of_a_batch_are_those_of_its_runs() -> None:
    poses, bed = dragged(8), make_grid(Layout())
    paths = [trace_finger(Fingertip(), poses + shift, 5) for shift in (0.0, 1e-3)]
    places = np.stack([bed.compute_basis(np.arange(first, first + 50)) for first in (100, 300)], axis=-1)
    for several, runs in ((paths, (0, 1)), (paths[:1], (0, 0))):
        found = join_paths(several).at(7).under(places)
        for axis, run in enumerate(runs):
            alone = paths[run].at(7).under(np.ascontiguousarray(places[..., axis]))
            np.testing.assert_allclose(found[..., axis], alone, rtol=0.0, atol=1e-15)  # sums in another order


def test_a_finger_over_a_large_bed_is_computed_for_few_periods_at_a_time() -> None:
    many = np.zeros((6, MOST // 6))  # three instants a period: twice as many cells would be all of `MOST`
    under = trace_finger(Fingertip(), dragged(8)).under(0, many)
    assert under.base.size <= 2 * 2 * MOST  # R and the tangent of two periods


def test_a_finger_presses_the_pins_below_it_and_over_the_rim_what_there_is() -> None:
    system = make_system(Layout(9, 9))

    def pressed(x: float, y: float, depth: float) -> np.ndarray:
        # Locked pins at 40 mm, the finger's lowest point `depth` mm below their tops.
        run = record(system, path((0, x, y, 45), (0.05, x, y, 45), (0.1, x, y, 40 - depth)), 20)
        return run.force[-1].reshape(9, 9)

    assert np.unravel_index(pressed(3.0, -6.0, 2.0).argmax(), (9, 9)) == (2, 5)
    middle, rim, outside = pressed(0, 0, 2.0), pressed(12.0, 0, 2.0), pressed(15.0, 0.0, 3.0)
    assert (pressed(0, 0, 0.5) > 0).sum() < (middle > 0).sum() < (pressed(0, 0, 2.5) > 0).sum()
    # The half on this side of the finger: the same cells, the same path. Rounding of positions of 12 mm.
    assert rim[4, 4:] == pytest.approx(middle[4, :5], abs=1e-12)
    assert outside[4, 8] > 0.0  # a pitch beside the bed
    assert not outside[:, :6].any()


@pytest.mark.parametrize("away", [(30, 30, 38), (0, 0, 300)], ids=["aside", "up"])
def test_a_finger_that_leaps_away_leaves_no_force_behind(away: tuple[float, float, float]) -> None:
    down = (-30, -30, 38)
    waypoints = [(0, -30, -30, 45), (0.05, *down), (0.1, *down), (0.101, *away), (0.3, *away)]
    system = make_system()
    run = record(system, path(*waypoints, interpolation="linear"), 60)
    left = system.grid.disc(-30e-3, -30e-3, 6e-3)
    assert run.force[20, left].any()
    assert not run.force[21:, left].any()


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
