"""No decision hangs on the last bit: what is shaken by a part in 1e15 comes out the same.

Another processor or version of numpy adds in another order, which moves numbers by as much. Here all that a
controller reads, the paths and the heights are moved so, at random, in every control period. Equal distances,
symmetric forces and touches on the stroke of the clock are equal no longer: what they decide must not change.
Each scene ends after the moment at which something once changed.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.surface.features import find
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.skins import fit_skin

from tests.assemble import sample

#: Largest relative change of a number.
SHAKEN = 1e-15
#: m and N: what a part in 1e15 may grow to, below what can be felt; what was decided came to 4 µm or more.
HEIGHT, FORCE = 1e-6, 1e-3


def shake(values: Floats, random: np.random.Generator) -> Floats:
    """Return values moved by a part in 1e15 at most."""
    return values * (1.0 + SHAKEN * random.uniform(-1.0, 1.0, values.shape))


@dataclass(frozen=True)
class Shaken:
    """A controller that reads shaken measurements, or a path of shaken poses."""

    inner: Any
    random: np.random.Generator

    def __getattr__(self, name: str) -> Any:
        return getattr(self.inner, name)

    def _read(self, seen: Any) -> Any:
        ones, *others = seen.quadratic_basis
        basis = np.array([ones, *(shake(row, self.random) for row in others)])
        force, height = shake(seen.force, self.random), shake(seen.height, self.random)
        return seen._replace(quadratic_basis=basis, force=force, height=height)

    def locate(self, memory: Any, touched: Any) -> Any:
        """Locate the fingertip by shaken measurements."""
        return self.inner.locate(memory, self._read(touched))

    def command(self, memory: Any, seen: Any) -> Any:
        """Command cells by shaken measurements."""
        return self.inner.command(memory, self._read(seen))

    def poses(self, times: Floats) -> Floats:
        """Return poses (k, 7), each coordinate of the place shaken by one and the same part."""
        poses: Floats = self.inner.poses(times).copy()
        poses[:, :3] *= shake(np.ones(3), np.random.default_rng(1))
        return poses


@pytest.mark.parametrize(
    ("name", "method", "lasting", "seed"),
    [
        pytest.param("plastic_press", "cell_states", 1.3, 0, id="II: cells one pitch behind the fingertip"),
        pytest.param("circle", "cell_states", 2.7, 0, id="II: cells as far as the radius of the flat top"),
        pytest.param("five_fingers_mound", "cell_states", 0.5, 0, id="II: pins touched as a step ends"),
        pytest.param("circle", "virtual_master", 3.1, 0, id="I: a blister rises on a line of symmetry"),
        pytest.param("two_hands_bowl", "virtual_master", 0.8, 0, id="I: pins midway between two fingertips"),
        pytest.param("elastic_press", "hybrid", 0.5, 1, id="III: several cells nearest to the fingertip"),
        pytest.param("crater_breached", "hybrid", 4.0, 0, id="III: cells abeam of the fingertip"),
        pytest.param("two_ridges", "hybrid", 1.0, 1, id="III: a blister as high as the bed"),
        pytest.param("five_fingers_mound", "hybrid", 0.6, 0, id="III: five fingertips, alike"),
        pytest.param("edge_of_bed", "hybrid", 2.2, 0, id="III: a pin at the rim, on a line of symmetry"),
    ],
)  # fmt: skip
def test_a_run_is_the_same_when_all_it_reads_is_shaken(
    name: str, method: str, lasting: float, seed: int
) -> None:
    scene = sample(name, f"control.method={method}", f"simulation.duration={lasting}")
    if scene.shape:
        pytest.importorskip("PIL.Image", reason="the shape is a picture")
    random, system, paths = np.random.default_rng(seed), assemble(scene), scene.trajectories()
    shaken, force = replace(system, controller=Shaken(system.controller, random)), system.rows.force
    start = begin(shaken)
    start.rows[0] = shake(start.rows[0], random)
    known = periods(system, paths, begin(system), scene.periods)
    found = periods(shaken, [Shaken(path, random) for path in paths], start, scene.periods)
    for one, other in zip(known, found, strict=True):
        period = str(one.period)
        np.testing.assert_allclose(other.row(0), one.row(0), rtol=0.0, atol=HEIGHT, err_msg=period)
        np.testing.assert_allclose(other.row(force), one.row(force), rtol=0.0, atol=FORCE, err_msg=period)
        np.testing.assert_array_equal(other.mode(), one.mode(), period)


#: Heights off the bed, mm, at places x, y, mm: each with equal heights at places that are none's neighbor.
RELIEFS = {
    "cross": lambda x, y: 6.0 * np.maximum(_ridge(x, y), _ridge(y, x)),
    "frame": lambda x, y: 5.0 * (abs(np.maximum(abs(x), abs(y)) - 16.5) <= 4.6),
    "wave": lambda x, y: 4.0 * np.sin(2.0 * np.pi * x / 36.0),
    "four mounds": lambda x, y: sum(
        6.0 * np.exp(-((x - a) ** 2 + (y - b) ** 2) / 40.0) for a in (-15.0, 15.0) for b in (-15.0, 15.0)
    ),
}


def _ridge(x: Floats, y: Floats) -> Floats:
    return np.maximum(1.0 - abs(y) / 9.0, 0.0) * (abs(x) <= 24.0)


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
@pytest.mark.parametrize("relief", RELIEFS)
def test_features_and_triangles_are_the_same_when_heights_are_shaken(relief: str, arrangement: str) -> None:
    grid, random = make_grid(Layout(25, 25, 3e-3, arrangement)), np.random.default_rng(2)
    heights = 40e-3 + 1e-3 * RELIEFS[relief](grid.x * 1e3, grid.y * 1e3)
    skins = []
    for tops in (heights, shake(heights, random), shake(heights, random)):
        skins.append(fit_skin(Formed.of(grid.positions, tops, 40e-3, 0.0, 0), "bilinear", 1, 1e-3))
    known, *others = [find(skin) for skin in skins]
    assert known
    for skin, found in zip(skins[1:], others, strict=True):
        np.testing.assert_array_equal(skin.faces, skins[0].faces)
        assert [(one.name, one.form, one.pins.tolist()) for one in found] == [
            (one.name, one.form, one.pins.tolist()) for one in known
        ]
        for one, other in zip(found, known, strict=True):
            for line, own in zip(one.crests, other.crests, strict=True):
                np.testing.assert_allclose(line, own, rtol=0.0, atol=1e-8)
