"""From the finger's pose to forces: which cells may be touched, and how hard."""

import numpy as np
import pytest
from digiclay.core.engine.simulation import begin, step
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.model.layout import Layout
from digiclay.core.model.trajectory import interpolate_poses

from tests.assemble import make_system, path, record


@pytest.mark.parametrize(
    "turn", [LEVEL, (0.8, 0.0, 0.6, 0.0), (0.5, -0.5, 0.5, 0.5), (-0.6, 0.1, 0.0, 0.8)]
)
def test_a_finger_that_does_not_turn_is_that_of_the_same_poses_among_turned_ones(turn):
    tip, rng = Fingertip(length=12e-3), np.random.default_rng(3)
    poses = np.concatenate([rng.normal(0.0, 0.02, (6, 3)), np.tile(turn, (6, 1))], axis=1)
    among = np.concatenate([poses, [[0.0, 0.0, 0.0, 0.6, 0.0, 0.0, 0.8]]])
    for other in (tip, Fingertip(), tip):  # each keeps its own
        assert (other.outline(poses) == other.outline(among)[:-1]).all()
    parts = np.linspace(0.0, 1.0, 4)
    together = interpolate_poses(among[:, None], parts)
    alone = interpolate_poses(poses[:, None], parts)
    assert (together[:5] == alone).all()


def test_a_finger_presses_the_pins_below_it_and_over_the_rim_what_there_is():
    system = make_system(Layout(9, 9))

    def pressed(x, y, depth):
        # Locked pins at 40 mm, the finger's lowest point `depth` mm below their tops.
        run = record(system, path((0, x, y, 45), (0.05, x, y, 45), (0.1, x, y, 40 - depth)), 20)
        return run.force[-1].reshape(9, 9)

    assert np.unravel_index(pressed(3.0, -6.0, 2.0).argmax(), (9, 9)) == (2, 5)
    middle, rim, outside = pressed(0, 0, 2.0), pressed(12.0, 0, 2.0), pressed(15.0, 0.0, 3.0)
    assert (pressed(0, 0, 0.5) > 0).sum() < (middle > 0).sum() < (pressed(0, 0, 2.5) > 0).sum()
    # The half on this side of the finger: the same cells, the same path. Rounding of positions of
    # 12 mm.
    assert rim[4, 4:] == pytest.approx(middle[4, :5], abs=1e-12)
    assert outside[4, 8] > 0.0  # a pitch beside the bed
    assert not outside[:, :6].any()


def test_the_pulp_over_a_pin_goes_on_relaxing_after_contact():
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
