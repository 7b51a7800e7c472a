"""Write the sample shapes: `python tools/sample_shapes.py`; with `--picture` also the page that shows them.

Each is made from a formula here; no data of others are in them. Maps are formulas over a square: values from
0 to 1, x and y from -1 to 1, y upwards. Solids are closed meshes in mm, z up.
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parents[1]
SHAPES = ROOT / "addon" / "digiclay" / "sample_shapes" / "shapes"
PICTURE = ROOT / "docs" / "pictures" / "shapes.jpg"
sys.path.insert(0, str(ROOT / "addon"))

from digiclay.core.base.arrays import Floats  # noqa: E402

Point = tuple[float, float]


def between_0_and_1(values: Floats) -> Floats:
    """Stretch values to 0..1."""
    return (values - values.min()) / np.ptp(values)


def bump(x: Floats, y: Floats, at: Point, size: Point) -> Floats:
    """Return a Gaussian of height 1."""
    return np.exp(-(((x - at[0]) / size[0]) ** 2) - ((y - at[1]) / size[1]) ** 2)


def crater(x: Floats, y: Floats) -> Floats:
    """Return a bowl with a raised rim, a central peak, and ejecta that thin out like r⁻³."""
    r = np.hypot(x, y)
    rim = 0.6
    bowl = -1.0 + 1.6 * (r / rim) ** 2
    ejecta = 0.6 * (rim / np.maximum(r, rim)) ** 3
    peak = 0.75 * np.exp(-((r / 0.11) ** 2))
    return np.where(r < rim, bowl, ejecta) + peak


def spiral(x: Floats, y: Floats) -> Floats:
    """Return a ridge along an Archimedean spiral of three turns that rises outwards."""
    r, angle = np.hypot(x, y), np.arctan2(y, x)
    turn = 0.3
    off = (r - turn * angle / (2.0 * math.pi) + turn / 2) % turn - turn / 2
    ridge = np.exp(-((off / 0.085) ** 2))
    return ridge * (0.35 + 0.65 * r) * (r < 0.93)


def terrain(x: Floats, y: Floats) -> Floats:
    """Return hills: waves of random direction and phase, each octave 0.42 as high, valleys worn flat."""
    chance = np.random.default_rng(1983)
    height = np.zeros_like(x)
    for octave in range(6):
        for _ in range(7):
            angle, phase = chance.uniform(0.0, 2.0 * math.pi, 2)
            along = math.cos(angle) * x + math.sin(angle) * y
            height += 0.42**octave * np.sin(1.9 * 2.0**octave * along + phase)
    return between_0_and_1(height) ** 1.7


def heart(x: Floats, y: Floats) -> Floats:
    """Return a pillow inside the heart curve x² + (y - 0.7 √|x|)² = 1."""
    x, y = 1.15 * x, 1.2 * y + 0.15
    inside = 1.0 - x * x - (y - 0.7 * np.sqrt(np.abs(x))) ** 2
    return np.sqrt(np.maximum(inside, 0.0))


def segment(x: Floats, y: Floats, start: Point, end: Point) -> Floats:
    """Return distances to a straight stroke."""
    dx, dy = end[0] - start[0], end[1] - start[1]
    part = np.clip(((x - start[0]) * dx + (y - start[1]) * dy) / (dx * dx + dy * dy), 0.0, 1.0)
    return np.hypot(x - start[0] - part * dx, y - start[1] - part * dy)


def arc(x: Floats, y: Floats, middle: Point, radius: float, gap: float) -> Floats:
    """Return distances to a circle that is open to the right over an angle of +- gap."""
    dx, dy = x - middle[0], y - middle[1]
    on = np.abs(np.hypot(dx, dy) - radius)
    tip = radius * math.cos(gap), radius * math.sin(gap)
    ends = np.hypot(dx - tip[0], np.abs(dy) - tip[1])
    return np.where(np.abs(np.arctan2(dy, dx)) < gap, ends, on)


def letters(x: Floats, y: Floats) -> Floats:
    """Return CLAY in round strokes, two letters above two."""
    strokes = (
        ((0.22, 0.8), (0.22, 0.18)), ((0.22, 0.18), (0.68, 0.18)),
        ((-0.78, -0.8), (-0.47, -0.17)), ((-0.47, -0.17), (-0.16, -0.8)), ((-0.66, -0.57), (-0.28, -0.57)),
        ((0.18, -0.17), (0.46, -0.46)), ((0.74, -0.17), (0.46, -0.46)), ((0.46, -0.46), (0.46, -0.8)),
    )  # fmt: skip
    lines = [segment(x, y, *stroke) for stroke in strokes]
    distance = np.min([arc(x, y, (-0.48, 0.49), 0.31, 0.8), *lines], axis=0)
    return np.sqrt(np.maximum(1.0 - (distance / 0.11) ** 2, 0.0))


#: Dots of braille letters: columns 0 and 1, rows 0 to 2 from the top.
BRAILLE = {
    "c": ((0, 0), (1, 0)), "l": ((0, 0), (0, 1), (0, 2)), "a": ((0, 0),),
    "y": ((0, 0), (1, 0), (1, 1), (0, 2), (1, 2)),
}  # fmt: skip


def braille(x: Floats, y: Floats) -> Floats:
    """Return the line "clay" in braille: domes, dots 1 apart, letters 2.5 apart, as in print."""
    pitch = 0.19
    height = np.zeros_like(x)
    for number, letter in enumerate("clay"):
        for column, row in BRAILLE[letter]:
            at = ((number * 2.5 + column) - 4.25) * pitch, (1.0 - row) * pitch
            square = ((x - at[0]) ** 2 + (y - at[1]) ** 2) / (0.42 * pitch) ** 2
            height = np.maximum(height, np.sqrt(np.maximum(1.0 - square, 0.0)))
    return height


def face(x: Floats, y: Floats) -> Floats:
    """Return a face-like relief: half an egg, with brow, nose, eyes, cheeks, lips and chin laid on."""
    egg = np.sqrt(np.maximum(1.0 - (x / 0.72) ** 2 - ((y - 0.02) / 0.95) ** 2, 0.0))
    nose = bump(x, y, (0.0, -0.13), (0.11, 0.13)) + 0.6 * bump(x, y, (0.0, 0.1), (0.075, 0.22))
    sides = np.abs(x)
    eyes = bump(sides, y, (0.27, 0.2), (0.15, 0.09)) - 0.6 * bump(sides, y, (0.27, 0.19), (0.085, 0.05))
    brow = bump(sides, y, (0.25, 0.36), (0.2, 0.055))
    cheek = bump(sides, y, (0.36, -0.12), (0.16, 0.16))
    lips = bump(x, y, (0.0, -0.42), (0.19, 0.045)) + bump(x, y, (0.0, -0.53), (0.15, 0.05))
    mouth = bump(x, y, (0.0, -0.475), (0.2, 0.022))
    chin = bump(x, y, (0.0, -0.76), (0.17, 0.1))
    laid_on = 0.3 * nose - 0.22 * eyes + 0.09 * brow + 0.07 * cheek + 0.1 * lips - 0.08 * mouth + 0.1 * chin
    return egg * 0.62 + np.where(egg > 0.0, laid_on, 0.0) * np.minimum(egg * 3.0, 1.0)


Solid = tuple[Floats, NDArray[np.int64]]


def woven(rings: Floats, *, closed: bool) -> Solid:
    """Join rings of points (r, s, 3), each to the next; the last to the first, or both ends capped."""
    count, around, _ = rings.shape
    index = np.arange(count * around).reshape(count, around)
    here, there = (index, np.roll(index, -1, axis=0)) if closed else (index[:-1], index[1:])
    a, b, c, d = here, np.roll(here, -1, axis=1), np.roll(there, -1, axis=1), there
    faces = [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    vertices = rings.reshape(-1, 3)
    if not closed:
        ends = np.array([rings[0].mean(axis=0), rings[-1].mean(axis=0)])
        first, last, size = index[0], index[-1], len(vertices)
        faces.append(np.stack([np.roll(first, -1), first, np.full(around, size)], -1))
        faces.append(np.stack([last, np.roll(last, -1), np.full(around, size + 1)], -1))
        vertices = np.concatenate([vertices, ends])
    return vertices, np.concatenate(faces).astype(np.int64)


def turned(profile: list[tuple[float, float]], around: int, offset: float = 0.0) -> Solid:
    """Turn a profile of radii and heights about the z axis, from its underside up."""
    angle = 2.0 * math.pi * (np.arange(around) + offset) / around
    rings = [[(r * math.cos(t), r * math.sin(t), z) for t in angle] for r, z in profile]
    return woven(np.array(rings), closed=False)


def dome() -> Solid:
    """Return a flat dome of a sphere, 70 mm across and 18 mm high."""
    half, high = 35.0, 18.0
    radius = (half * half + high * high) / (2.0 * high)
    last = math.asin(half / radius)
    angles = last * (1.0 - np.arange(20) / 20.0)
    points = [(radius * math.sin(t), radius * math.cos(t) - radius + high) for t in angles]
    return turned([*points, (1e-3, high)], 48)


def pyramid() -> Solid:
    """Return a stepped pyramid of five steps, 70 mm wide and 20 mm high."""
    profile = []
    for step in range(5):
        radius = (35.0 - 6.5 * step) * math.sqrt(2.0)
        profile += [(radius, 4.0 * step), (radius, 4.0 * step + 4.0)]
    return turned(profile, 4, 0.5)


def gear() -> Solid:
    """Return a gear wheel of 12 teeth with a bore, 72 mm across and 10 mm thick."""
    teeth, steps = 12, 12
    part = np.arange(teeth * steps) / steps
    angle = 2.0 * math.pi * part / teeth
    # Flanks a quarter of a tooth wide, tip and root with as much as is left.
    tooth = np.clip(1.5 - 6.0 * np.abs(part % 1.0 - 0.5), 0.0, 1.0)
    outer = 28.0 + 8.0 * tooth
    out = np.stack([outer * np.cos(angle), outer * np.sin(angle)], -1)
    bore = np.stack([8.0 * np.cos(angle), 8.0 * np.sin(angle)], -1)

    def ring(plan: Floats, z: float) -> Floats:
        return np.column_stack([plan, np.full(len(plan), z)])

    rings = np.array([ring(bore, 0.0), ring(out, 0.0), ring(out, 10.0), ring(bore, 10.0)])
    return woven(rings, closed=True)


def grip() -> Solid:
    """Return a grip of a hand's size, lying: 110 x 34 mm, with dents for four fingers on top."""
    along, around = np.linspace(-55.0, 55.0, 64), 2.0 * math.pi * np.arange(28) / 28
    rings = []
    for x in along:
        end = math.sqrt(max(1.0 - (x / 55.2) ** 8, 0.0))
        half = (17.0 - 0.0012 * x * x) * end
        dents = 2.6 * math.cos(2.0 * math.pi * x / 23.0 + math.pi) * (abs(x) < 46.0)
        y = half * np.cos(around)
        top = (15.0 - dents) * end * np.sin(around)
        z = np.where(np.sin(around) > 0.0, top, -9.0 * end * np.abs(np.sin(around)))
        rings.append(np.column_stack([np.full(28, x), y, z]))
    return woven(np.array(rings), closed=False)


def knot() -> Solid:
    """Return a trefoil knot, lying: where one strand passes over another, a bed can show only the upper."""
    count, around = 104, 12
    t = 2.0 * math.pi * np.arange(count) / count
    middle = np.stack(
        [np.sin(t) + 2.0 * np.sin(2.0 * t), np.cos(t) - 2.0 * np.cos(2.0 * t), -0.9 * np.sin(3.0 * t)], -1
    )
    middle *= 10.5
    tangent = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    side = np.cross(tangent, (0.0, 0.0, 1.0))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    over = np.cross(side, tangent)
    angle = 2.0 * math.pi * np.arange(around) / around
    ring = np.cos(angle)[:, None, None] * side + np.sin(angle)[:, None, None] * over
    vertices, faces = woven(np.swapaxes(middle + 5.2 * ring, 0, 1), closed=True)
    return vertices, faces[:, ::-1]


#: Pictures: formula, the highest gray level, pixels a side.
PICTURES = (
    (braille, 255, 160), (crater, 255, 96), (face, 65535, 128), (heart, 255, 96), (letters, 255, 128),
    (spiral, 255, 128), (terrain, 65535, 96),
)  # fmt: skip
#: Arrays of heights: formula, heights a side, height, m. A ripple: waves around a drop, sin(k r) / (k r).
ARRAYS = {
    "ripple": (lambda x, y: np.sinc(3.2 * np.hypot(x, y)), 49, 12e-3),
    "saddle": (lambda x, y: x * x - y * y, 33, 16e-3),
    "wave": (lambda x, y: np.sin(2.0 * math.pi * x) * np.cos(0.5 * math.pi * y), 33, 10e-3),
}
#: Meshes: formula, format.
MESHES = ((dome, "stl"), (gear, "stl"), (grip, "obj"), (knot, "ply"), (pyramid, "obj"))


def sample(formula: Callable[[Floats, Floats], Floats], side: int) -> Floats:
    """Return a formula's values from 0 to 1 in the middles of side x side pixels, the lowest row first."""
    middles = (np.arange(side) + 0.5) * 2.0 / side - 1.0
    x, y = np.meshgrid(middles, middles)
    return between_0_and_1(formula(x, y))


def write(folder: Path) -> list[Path]:
    """Write every sample shape into a folder; return the files."""
    import trimesh
    from PIL import Image

    written = []
    for formula, white, side in PICTURES:
        # The highest row first, as in every picture.
        levels = np.rint(np.flipud(sample(formula, side)) * white).astype(np.min_scalar_type(white))
        written.append(folder / f"{formula.__name__}.png")
        Image.fromarray(levels).save(written[-1], optimize=True)
    for name, (formula, side, height) in ARRAYS.items():
        written.append(folder / f"{name}.npy")
        np.save(written[-1], (sample(formula, side) * height).astype(np.float32))
    for solid_of, kind in MESHES:
        vertices, faces = solid_of()
        written.append(folder / f"{solid_of.__name__}.{kind}")
        solid = trimesh.Trimesh(vertices, faces, process=False)
        options = {"include_normals": False, "header": "z up", "digits": 3} if kind == "obj" else {}
        solid.export(written[-1], **options)
    return written


def picture(path: Path) -> None:
    """Draw every sample shape as a bed of 49 x 49 pins shows it."""
    import matplotlib.pyplot as plt
    from digiclay.core.model.actuator import Actuator
    from digiclay.core.model.layout import Layout, make_grid
    from digiclay.core.shapes.fitting import fit_shape, list_shapes
    from digiclay.core.shapes.request import Shape
    from digiclay.plots.bed import draw_relief

    bed, names = make_grid(Layout(rows=49, columns=49, pitch=2e-3)), list_shapes()
    figure = plt.figure(figsize=(15, 9.4))
    for number, name in enumerate(names):
        left, below = number % 5 / 5, (2 - number // 5) / 3
        axes = figure.add_axes((left, below, 0.2, 0.33), projection="3d", computed_zorder=False)
        heights = fit_shape(Shape(file=name, rise=16e-3), bed, Actuator()).heights
        draw_relief(axes, {"position": bed.positions, "height": heights[None]},
                    (left + 0.004, below + 0.01, left + 0.196, below + 0.29))  # fmt: skip
        figure.text(left + 0.1, below + 0.28, name, ha="center", fontsize=15)
    figure.savefig(path, dpi=80, pil_kwargs={"quality": 85})


if __name__ == "__main__":
    SHAPES.mkdir(parents=True, exist_ok=True)
    for file in write(SHAPES):
        print(f"{file.relative_to(ROOT)}: {file.stat().st_size / 1000:.1f} kB")
    if "--picture" in sys.argv[1:]:
        picture(PICTURE)
