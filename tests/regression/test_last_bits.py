"""No decision hangs on the last bit: what is shaken by a part in 1e15 comes out the same.

Another processor or version of numpy adds in another order, which moves numbers by as much. Here
all that a controller reads, the paths and the heights are moved so, at random, in every control
period. Equal distances, symmetric forces and touches on the stroke of the clock are equal no
longer: what they decide must not change. Each scene ends after the moment at which something once
changed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.control.blister import Blister
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.fingertip import LEVEL, Fingertip, make_matrices
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.shapes.fitting import fit_relief
from digiclay.core.shapes.heightmap import make_height_map
from digiclay.core.shapes.request import Placement, Shape
from digiclay.core.surface.features import find
from digiclay.core.surface.formed import Formed
from digiclay.core.surface.skins import fit_skin
from digiclay.strokes.motion import begin as begin_stroke
from digiclay.strokes.motion import follow, follow_images
from digiclay.strokes.nominal import Device, find_nominal
from digiclay.strokes.stroke import Brush, Image, Sample, Stroke, make_images
from digiclay.strokes.tracking import Tracking

from tests.assemble import assert_near, sample
from tests.scenes.test_hands import FINGER as PAPER_FINGER
from tests.scenes.test_hands import PERIOD, REST, press, scene
from tests.scenes.test_hands import follow as simulate
from tests.scenes.test_pressed_together import at_times, play, pose_at, replaying, rock

#: Largest relative change of a number.
SHAKEN = 1e-15
#: m and N: what a part in 1e15 may grow to, below what can be felt; what was decided came to 4 µm
#: or more.
HEIGHT, FORCE = 1e-6, 1e-3


def shake(values, random):
    """Return values moved by a part in 1e15 at most."""
    return values * (1.0 + SHAKEN * random.uniform(-1.0, 1.0, values.shape))


@dataclass(frozen=True)
class Shaken:
    """A controller that reads shaken measurements, or a path of shaken poses."""

    inner: Any
    random: np.random.Generator

    def __getattr__(self, name):
        return getattr(self.inner, name)

    def _read(self, seen):
        ones, *others = seen.quadratic_basis
        basis = np.array([ones, *(shake(row, self.random) for row in others)])
        force, height = shake(seen.force, self.random), shake(seen.height, self.random)
        return seen._replace(quadratic_basis=basis, force=force, height=height)

    def locate(self, memory, touched):
        """Locate the fingertip by shaken measurements."""
        return self.inner.locate(memory, self._read(touched))

    def command(self, memory, seen):
        """Command cells by shaken measurements."""
        return self.inner.command(memory, self._read(seen))

    def poses(self, times):
        """Return poses (k, 7), each coordinate of the place shaken by one and the same part."""
        poses = self.inner.poses(times).copy()
        poses[:, :3] *= shake(np.ones(3), np.random.default_rng(1))
        return poses


@pytest.mark.parametrize(
    "name, method, lasting, seed",
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
def test_a_run_is_the_same_when_all_it_reads_is_shaken(name, method, lasting, seed):
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
        np.testing.assert_allclose(
            other.row(force), one.row(force), rtol=0.0, atol=FORCE, err_msg=period
        )
        np.testing.assert_array_equal(other.mode(), one.mode(), period)


@pytest.mark.parametrize(
    "method, apart, depth",
    [
        pytest.param("virtual_master", 15e-3, 2e-3, id="it presses later"),
        pytest.param("hybrid", 12e-3, 0.0, id="pins rise into it beside another fingertip"),
    ],
)
def test_a_fingertip_at_the_very_height_of_pins_is_as_one_a_rounding_error_above_or_below(
    method, apart, depth
):
    system = assemble(scene(method, PAPER_FINGER, PAPER_FINGER))
    poses = press(system, [(1.5e-3, 1.5e-3), (1.5e-3 + apart, 1.5e-3)], (0.0, 12e-3), 120)
    poses[..., 3:] = LEVEL
    time = np.arange(120)[:, None] * PERIOD + system.instants
    ends = []
    for error in (0.0, -3e-16, 3e-16):
        poses[:, :, 1, 2] = REST * (1.0 + error) - depth * np.clip(time / 0.2 - 1.0, 0.0, 1.0)
        ends.append(simulate(system, poses))
    for state, forces in ends[1:]:
        assert_near(state.row(0), ends[0][0].row(0), HEIGHT)
        assert_near(forces, ends[0][1], FORCE)


#: Heights off the bed, mm, at places x, y, mm: each with equal heights at places that are none's
#: neighbor.
RELIEFS = {
    "cross": lambda x, y: 6.0 * np.maximum(_ridge(x, y), _ridge(y, x)),
    "frame": lambda x, y: 5.0 * (abs(np.maximum(abs(x), abs(y)) - 16.5) <= 4.6),
    "wave": lambda x, y: 4.0 * np.sin(2.0 * np.pi * x / 36.0),
    "four mounds": lambda x, y: sum(
        6.0 * np.exp(-((x - a) ** 2 + (y - b) ** 2) / 40.0)
        for a in (-15.0, 15.0)
        for b in (-15.0, 15.0)
    ),
}


def _ridge(x, y):
    return np.maximum(1.0 - abs(y) / 9.0, 0.0) * (abs(x) <= 24.0)


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
@pytest.mark.parametrize("relief", RELIEFS)
def test_features_and_triangles_are_the_same_when_heights_are_shaken(relief, arrangement):
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
                assert_near(line, own, 1e-8)


#: A bed of 40 mm, m, its device without and with a blister, and what a stroke keeps to that leads
#: one.
CELLS = make_grid(Layout(21, 21))
FINGER = Device(CELLS, Fingertip(), None, 80e-3)
LED = replace(FINGER, blister=Blister())
TRACKING = Tracking(
    1e-3, 2e-3, 0.05, 0.02, 0.5, 0.05, 0.015, 0.012, 200.0, 9e-3, 80e-3, 0.05, hard=1.0
)
OUT = [(float(x), 0.0, 4.0) for x in range(17)]


@dataclass(frozen=True)
class Drawn:
    """A stroke over a bed: places x, y and depths, mm; force on each fingertip, N."""

    places: list[tuple[float, float, float]]
    symmetry: tuple[Any, ...] = ("NONE",)
    brush: Brush = Brush.LOWER
    device: Device = FINGER
    force: float = 0.0
    rise: Callable[[Floats, Floats], Any] = lambda x, _: 0.0 * x
    """Heights above 40 mm, mm, at places x, y, mm."""
    accumulate: bool = False

    def form(self, random):
        """Return places and turns, (t, 12 m), and nominal heights (n,), m, shaken at random, if at all."""

        def read(values):
            return np.array(values) if random is None else shake(np.array(values), random)

        bed = read(40e-3 + 1e-3 * self.rise(CELLS.x * 1e3, CELLS.y * 1e3))
        images = tuple(
            Image(*(image + read(np.ones(6)) - 1.0)) for image in make_images(*self.symmetry)
        )
        samples = tuple(Sample(*row) for row in (1e-3 * read(self.places)).tolist())
        stamp = make_height_map("ramp", np.arange(16.0).reshape(4, 4) / 15.0)
        drawn = Stroke(1, samples, self.brush, images, self.accumulate, stamp, held=False)
        nominal = find_nominal(drawn, self.device, bed).height
        stroke = begin_stroke(drawn, bed, UP[3:], TRACKING if self.device is LED else None)
        poses, count = [np.array([UP] * len(images))], len(images)
        while len(poses) < 4000:
            if stroke.parts:
                forces = np.full(count, self.force)
                stroke, path = follow_images(stroke, self.device, bed, poses[-1], 7, 5e-3, forces)
            else:
                stroke, one = follow(stroke, self.device, bed, poses[-1][0], 7, 5e-3, self.force)
                path = np.repeat(one[:, None], count, axis=1)
            if len(path) == 1:
                break
            poses += list(path[1:])
        ways = np.array(poses)
        turns = make_matrices(ways[..., 3:].reshape(-1, 4))  # a quaternion and its opposite are one
        return np.hstack(
            [ways[..., :3].reshape(len(ways), -1), turns.reshape(len(ways), -1)]
        ), nominal


UP = np.array([0.0, 0.0, 46e-3, *LEVEL])
STROKES = {
    "crosses the bed in whole steps": Drawn(
        [(25.0, 0.0, 4.0)], rise=lambda x, y: 15.0 * (x * y > 800.0)
    ),
    "comes down to a level bed in whole steps": Drawn([(1.0, 2.0, 4.0)]),
    "samples lie at the steps of a drag": Drawn(
        [(0.5 * i, 1.0, 4.0 - i % 2) for i in range(30)], rise=lambda x, y: 15.0 * (x * y > 800.0)
    ),
    "images above a bed as high as whole steps": Drawn([(20.0, 0.0, 4.0)], ("X",)),
    "images a semi-axis apart": Drawn([(5.0, 3.0, 4.0), (5.0, 20.0, 4.0)], ("X",)),
    "images half a pitch apart": Drawn([(0.75, 3.0, 4.0)], ("X",)),
    "images 0.6 semi-axes apart": Drawn([(3.0, 3.0, 4.0), (3.0, 9.0, 4.0)], ("X",), device=LED),
    "images two radii of the blister apart": Drawn(
        [(9.0, 0.0, 4.0), (9.0, 9.0, 4.0)], ("X",), device=LED, force=2.0
    ),
    "a step of half a millimeter": Drawn(
        [(-9.0, 1.0, 4.0), (9.0, 1.0, 4.0)],
        device=LED,
        force=0.8,
        rise=lambda x, y: 0.5 * (x > 0.0) - 4.0,
    ),
    "a pin half a millimeter above those around": Drawn(
        [(0.0, 0.0, 4.0), (3.0, 0.0, 4.0)],
        device=LED,
        rise=lambda x, y: 0.625 * (np.hypot(x, y) < 1.0),
    ),
    "a path that comes back after 32 mm": Drawn([*OUT, *OUT[-2::-1]], accumulate=True),
    "a pass half a fingertip beside the one before": Drawn(
        [*OUT, (16.0, 8.0, 4.0), *((x, 8.0, z) for x, _, z in OUT[-2::-1])], accumulate=True
    ),
    "samples a pitch apart": Drawn(
        [(-3.0, 1.0, 4.0), (0.0, 1.0, 4.0), (3.0, 1.0, 4.0)],
        device=LED,
        rise=lambda x, y: 0.1 * x * np.sin(y),
    ),
    "a stamp a pitch wide": Drawn([(0.0, 0.0, 4.0), (3.0, 0.0, 4.0)], brush=Brush.STAMP),
    "images that level pins between them up and down": Drawn(
        [(6.0, -9.0, 4.0), (6.0, 9.0, 4.0)], ("X",), Brush.LEVEL, LED, rise=lambda x, y: 0.2 * x
    ),
    "images turned by right angles": Drawn([(20.0, 1.0, 4.0)], ("RADIAL", 4)),
}


@pytest.mark.parametrize("name", STROKES)
def test_a_stroke_goes_the_same_way_when_all_it_reads_is_shaken(name):
    poses, nominal = STROKES[name].form(None)
    assert len(poses) > 3
    for seed in range(2):
        shaken_poses, shaken_nominal = STROKES[name].form(np.random.default_rng(seed))
        assert_near(shaken_nominal, nominal, HEIGHT)
        assert len(shaken_poses) == len(poses)
        assert_near(shaken_poses, poses, HEIGHT)


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
def test_a_disc_holds_the_cells_on_its_edge_in_a_batch_as_alone(arrangement):
    grid, random = make_grid(Layout(25, 25, 3e-3, arrangement)), np.random.default_rng(0)
    middles = grid.positions[grid.disc(0.0, 0.0, 9e-3)]
    for radius in (6e-3, 9e-3, 15e-3):
        x, y = shake(middles, random).T
        together = grid.covered((x, y, shake(np.full(len(x), radius), random)))
        for number, middle in enumerate(middles.tolist()):
            alone = grid.disc(*middle, radius)
            np.testing.assert_array_equal(together[:, number].nonzero()[0], alone)


def test_a_fingertip_that_hovers_exactly_on_a_pin_changes_nothing_of_what_another_presses_there():
    bed = replaying((PAPER_FINGER,) * 2, np.zeros((30, 1)), layout=Layout(1, 1))
    forces = []
    for seed in range(6):
        random = np.random.default_rng(seed)

        def hover(times, random=random):
            return pose_at(0.0, 0.0, shake(np.full(times.shape, REST), random))

        forces.append(play(bed, at_times(bed, [rock(0), hover], 30))[1])
    # Rounding; 0.16 mN where one that presses by the last bit has the pin moved as under both.
    assert_near(forces[1:], forces[:1] * 5, 1e-9)


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
@pytest.mark.parametrize("level", [1 / 3, 0.7])
def test_a_level_picture_forms_a_level_bed_up_to_pins_midway_to_pixels_without_data(
    level, arrangement
):
    grid = make_grid(Layout(24, 24, 3e-3, arrangement))
    random = np.random.default_rng(0)
    covered = []
    without = np.tile(np.arange(24) > 20, (24, 1))
    at_pins = Placement(3e-3, 3e-3, float(grid.x[0]), float(grid.y[0]) - 1.5e-3)
    for _ in range(4):
        shaken = replace(grid, x=shake(grid.x, random), y=shake(grid.y, random))
        picture = make_height_map("level", np.full((103, 101), level))
        assert np.ptp(fit_relief(Shape(), picture, shaken, Actuator()).heights) < HEIGHT
        masked = np.ma.array(np.full(without.shape, level), mask=without)  # type: ignore[no-untyped-call]
        covered.append(make_height_map("half", masked).tops(shaken, at_pins).covered)
    np.testing.assert_array_equal(covered[1:], covered[:1] * 3)
