"""Nominal surface of press strokes: the heights that they are to leave, without simulation. No Blender.

A pin's height follows from its distance to the path: below or above it the pin comes to the depth
or height of the stroke, beside it to the section of the device's blister, or of the fingertip where
there is none. Of several places of the path the one counts that takes the pin farthest; so neither
a crossing counts twice, nor the seam of a ring, nor where mirror images meet. It is what the view
shows of a stroke at once, and what the valves drive the pins to after the fingertip has left.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..core.base.arrays import TIE, Cells, Flags, Floats
from ..core.control.blister import Blister
from ..core.model.fingertip import LEVEL, Fingertip, compute_forms, compute_underside
from ..core.model.layout import Grid, Layout
from ..core.shapes.request import Placement
from ..core.surface.pointing import find_ground_height
from .falloff import Falloff, evaluate
from .pose import lean_finger, turn_image
from .smoothing import flatten, slant, smooth
from .stroke import (
    LOCKS,
    SHALLOWEST,
    STAMPS,
    Brush,
    Combine,
    Image,
    Place,
    Sample,
    Stroke,
    needs_blister,
)

#: A path that comes nearer to itself than the fingertip is wide, after so many widths, is a new
#: pass.
RETURN = 2.0
#: How far down and up a brush may take pins, m.
LIMITS = {
    Brush.LOWER: (-math.inf, 0.0),
    Brush.RAISE: (0.0, math.inf),
    Brush.LEVEL: (-math.inf, math.inf),
}
#: Falloffs of brushes in the ring, where the stroke has none.
RING = {
    Brush.CREASE: Falloff.SHARP,
    Brush.CREST: Falloff.SHARP,
    Brush.FLATTEN: Falloff.SMOOTH,
    Brush.SMOOTH: Falloff.SMOOTH,
    Brush.ERASE: Falloff.CONSTANT,
}
#: Least radius of the ring, in pitches: below one a pin has no neighbor in it.
LEAST = 2.0


def find_radius(finger: Fingertip, layout: Layout) -> float:
    """Return the radius of the ring in which valves work, m: half the fingertip's width, or a few pins."""
    return max(finger.width, LEAST * layout.pitch)


@dataclass(frozen=True, eq=False)
class Device:
    """What forms a stroke: pins, fingertip, and the blister that follows it; None: there is none."""

    grid: Grid
    finger: Fingertip
    blister: Blister | None
    #: Highest place of a pin's top, m.
    highest: float
    #: (n,), shares by which pins are locked: nothing moves those of 1, and brushes the others by what
    #: is left; None: none are.
    locks: Floats | None = None
    #: Height of pins at rest, m.
    rest: float = 0.0
    #: (n,), heights that strokes count from, m; None: from the surface.
    base: Floats | None = None

    def suit(self, stroke: Stroke) -> "Device":
        """Return the device with fingertip and blister of a stroke."""
        if stroke.finger is None:
            return self
        blister = self.blister and (stroke.blister or self.blister)
        return replace(self, finger=stroke.finger, blister=blister)

    @cached_property
    def shares(self) -> Floats:
        """Shares by which pins are locked, (n,)."""
        return np.zeros(self.grid.count) if self.locks is None else self.locks

    @cached_property
    def locked(self) -> Flags | None:
        """Which pins nothing moves, (n,); None: none are locked."""
        return None if self.locks is None else self.locks == 1.0

    @property
    def reach(self) -> float:
        """How far from the path pins are formed, m."""
        finger = max(self.finger.length, self.finger.width, self.finger.height)
        return self.blister.radius if self.blister else finger

    @property
    def ring(self) -> float:
        """Radius of the ring in which valves work, m."""
        return find_radius(self.finger, self.grid.layout)

    def find_section(self, falloff: Falloff, distance: Floats) -> Floats:
        """Return the share of the height at distances from the path, m: 1 on the blister's flat top."""
        assert self.blister is not None
        flat, radius = self.blister.flat_radius, self.blister.radius
        if falloff is not Falloff.DEVICE:
            return evaluate(falloff, distance - flat, radius - flat)
        section: Floats = self.blister.evaluate_profile(distance).clip(0.0, 1.0)
        section[distance > radius] = 0.0
        return section

    def find_steepest(self, falloff: Falloff) -> float:
        """Return the slope of a flank from pin to pin where the stroke is 1 m high."""
        assert self.blister is not None
        pitch, flat = self.grid.layout.pitch, self.blister.flat_radius
        distance = np.arange(flat, self.blister.radius + pitch, pitch)
        return float(np.abs(np.diff(self.find_section(falloff, distance))).max()) / pitch

    def find_surface(self, height: Floats, x: float, y: float) -> float:
        """Return the height of a surface (n,), m, under the middle of the fingertip at a place, m."""
        return find_ground_height(self.grid, height, x, y, self.finger.width / 2)

    def find_top(
        self, stroke: Stroke, sample: Sample, at: Place, ground: Floats, level: float | None = None
    ) -> float:
        """Return the height, m, to which a sample of a stroke brings the pins at a place, m.

        It counts from a ground (n,), m; `level`, m: that of a brush that levels, see `find_level`.
        """
        surface = start = self.find_surface(self.find_start(stroke, ground), *at)
        if stroke.brush is Brush.LOWER:
            return max(0.0, start - sample.depth)
        if stroke.brush is Brush.RAISE:
            return min(start + sample.depth, self.highest)
        if stroke.from_base:
            surface = self.find_surface(ground, *at)
        return surface if level is None else surface + sample.share * (level - start)

    def find_start(self, stroke: Stroke, surface: Floats) -> Floats:
        """Return the heights (n,), m, that a stroke counts from where a surface stands (n,), m."""
        return surface if self.base is None or not stroke.from_base else self.base

    def combine(self, stroke: Stroke, before: Floats, formed: Floats) -> Floats:
        """Return what a stroke leaves of heights (m,) before it where it forms some, m."""
        low, high = self.find_limits(stroke)
        return np.clip(formed, np.minimum(before, low), np.maximum(before, high))

    def find_limits(self, stroke: Stroke) -> tuple[float, float]:
        """Return the lowest and the highest place to which a stroke brings pins, m."""
        low, high = (self.rest + limit for limit in stroke.limits)
        low = math.inf if stroke.combine is Combine.HIGHEST else max(low, 0.0)
        high = -math.inf if stroke.combine is Combine.LOWEST else min(high, self.highest)
        return low, high

    def hold_back(self, before: Floats, height: Floats) -> Floats:
        """Return heights (n,), m, of which each pin makes the share of the way that its lock leaves it."""
        if self.locks is None:
            return height
        return np.where(self.locks > 0.0, height + self.locks * (before - height), height)

    def find_level(self, stroke: Stroke, image: Image, before: Floats) -> float | None:
        """Return the height, m, that a stroke levels to: of pins (n,), m, at its first place; else None."""
        first = stroke.samples[0]
        levels = stroke.brush is Brush.LEVEL
        return self.find_surface(before, *image.place(first.x, first.y)) if levels else None


@dataclass(frozen=True, eq=False)
class Nominal:
    """Nominal surface of a stroke, as far as its path is drawn."""

    #: (n,), before the stroke; from which the depth of its present pass counts; to which it brings
    #: pins that are not locked in part; that it leaves, m.
    before: Floats
    ground: Floats
    full: Floats
    height: Floats
    #: (n,), pins about the path.
    near: Flags
    #: (images, n), of a brush in the ring: its effect on each pin by the present pass; None before.
    weight: Floats | None = None
    #: How many samples of the path are in it, and the first one of the present pass.
    count: int = 0
    first: int = 0
    #: The surface with steps in place of flanks; None: there are no such flanks.
    stepped: "Nominal | None" = None


def find_nominal(stroke: Stroke, device: Device, before: Floats) -> Nominal:
    """Return the nominal surface of a stroke on pins at heights (n,), m."""
    near = np.zeros(before.size, np.bool_)
    return extend(Nominal(before, before, before, before, near), stroke, device)


def extend(nominal: Nominal, stroke: Stroke, device: Device) -> Nominal:
    """Return a nominal surface with all samples of its stroke, for all images."""
    if stroke.brush in STAMPS:
        nominal = _stamp(nominal, stroke, device)
    elif stroke.placed:
        nominal = _brush(nominal, stroke, device)
    elif device.blister is not None or not needs_blister(stroke.brush, stroke.falloff):
        nominal = _press(nominal, stroke, device)
    height = device.hold_back(nominal.before, nominal.full)
    return replace(nominal, count=len(stroke.samples), height=height)


def _press(nominal: Nominal, stroke: Stroke, device: Device) -> Nominal:
    """Return what a fingertip, or a blister under it, leaves along all samples of a path."""
    nominal = nominal.stepped or nominal
    full, near = nominal.full.copy(), nominal.near.copy()
    nominal = replace(nominal, full=full, near=near)
    for index in range(nominal.count, len(stroke.samples)):
        if returns(stroke, nominal.first, index, device.finger.width):
            nominal = replace(nominal, ground=full.copy(), first=index)
        for image in stroke.images:
            _mark(nominal, stroke, device, image, index)
    return _slant(nominal, stroke, device)


def _slant(nominal: Nominal, stroke: Stroke, device: Device) -> Nominal:
    """Return the surface with flanks where Lower would leave steps across a ridge, or Raise in a valley.

    They are as steep as those of a stroke from there to its depth or height.
    """
    base, before, formed = device.base, nominal.before, nominal.full
    if base is None or device.blister is None or not stroke.from_base:
        return nominal
    down = -1.0 if stroke.brush is Brush.RAISE else 1.0
    beyond = float((down * (before - base))[nominal.near].max(initial=0.0))
    if beyond < SHALLOWEST:
        return nominal
    whole = beyond + max(sample.depth for sample in stroke.samples)
    most = float(np.abs(formed - before).max(initial=whole))
    slope = most * device.find_steepest(stroke.falloff)
    full = down * slant(device.grid, down * formed, down * before, slope)
    return replace(nominal, full=full, near=nominal.near | (full != formed), stepped=nominal)


def returns(stroke: Stroke, first: int, index: int, width: float) -> bool:
    """Tell whether a path that accumulates comes back at a sample to where its pass, from `first` on, was.

    `width`: of half the fingertip, m.
    """
    if not stroke.accumulate:
        return False
    path = np.array([(sample.x, sample.y) for sample in stroke.samples[first : index + 1]])
    steps = np.hypot(*np.diff(path, axis=0).T)
    gone = np.concatenate([[0.0], np.cumsum(steps)])
    far = gone[-1] - gone > RETURN * 2.0 * width + TIE
    return bool((np.hypot(*(path - path[-1]).T)[far] < width - TIE).any())


class End(NamedTuple):
    """End of a short piece of a path: its sample, its place on an image, m, and the pins' height, m."""

    sample: Sample
    place: Place
    top: float


def _mark(nominal: Nominal, stroke: Stroke, device: Device, image: Image, index: int) -> None:
    """Bring pins about the path from a sample to the next one, `index`, to their heights, in place."""
    level = device.find_level(stroke, image, nominal.before)
    for start, end in pairwise(_divide_path(nominal, stroke, device, image, index, level)):
        cells = _find_beside(device.grid, start.place, end.place, device.reach)
        if device.locked is not None:
            cells = cells[~device.locked[cells]]
        counted = device.find_start(stroke, nominal.ground)[cells]
        ground = counted if level is None else nominal.ground[cells]
        if device.blister is None:
            under = find_undersides(device, stroke, image, end.sample.lean, end.place, cells)
            change = end.top + under - ground
            reached = change < 0.0
        else:
            distance, share = _measure(device.grid, cells, start.place, end.place)
            reached = distance <= device.reach
            if level is None:
                full = start.top + share * (end.top - start.top) - ground
            else:
                first, last = start.sample.share, end.sample.share
                full = (first + share * (last - first)) * (level - counted)
            change = device.find_section(stroke.falloff, distance) * full
        now = nominal.full[cells]
        change, farther = _limit_change(stroke, change, now - ground)
        formed = device.combine(stroke, nominal.before[cells], ground + change)
        nominal.near[cells] = True
        nominal.full[cells] = np.where(farther & reached, formed, now)


def _divide_path(
    nominal: Nominal, stroke: Stroke, device: Device, image: Image, index: int, level: float | None
) -> list[End]:
    """Return the ends of the pieces, at most a pitch long, from a sample to the next one, `index`."""
    last, sample = stroke.samples[max(index - 1, 0)], stroke.samples[index]
    length = math.hypot(sample.x - last.x, sample.y - last.y)
    parts = max(1, math.ceil(length / device.grid.layout.pitch - TIE))
    ends = []
    for part in range(parts + 1):
        point = _between(last, sample, part / parts)
        place = image.place(point.x, point.y)
        top = device.find_top(stroke, point, place, nominal.ground, level)
        ends.append(End(point, place, top))
    return ends


def _find_beside(grid: Grid, start: Place, end: Place, reach: float) -> Cells:
    """Return the pins in a disc about a piece of a path, all within reach of it, m, among them."""
    middle = 0.5 * (start[0] + end[0]), 0.5 * (start[1] + end[1])
    return grid.disc(*middle, reach + 0.5 * math.dist(start, end))


def _limit_change(stroke: Stroke, change: Floats, gone: Floats) -> tuple[Floats, Flags]:
    """Return changes (m,), m, in the directions of a brush, and which are farther than pins have gone."""
    low, high = LIMITS[stroke.brush]
    low = 0.0 if stroke.combine is Combine.HIGHEST else low
    high = 0.0 if stroke.combine is Combine.LOWEST else high
    change = change.clip(low, high)
    if low == 0.0:
        return change, change > gone + TIE
    if high == 0.0:
        return change, change < gone - TIE
    return change, np.abs(change) > np.abs(gone) + TIE


def weigh_path(stroke: Stroke, device: Device) -> Floats:
    """Return the effect of a brush in the ring on each pin, (images, n)."""
    weight = np.zeros((len(stroke.images), device.grid.count))
    for row, image in zip(weight, stroke.images, strict=True):
        for index in range(len(stroke.samples)):
            _weigh(row, stroke, device, image, index)
    return weight


def _brush(nominal: Nominal, stroke: Stroke, device: Device) -> Nominal:
    """Return what the valves leave in the ring along all samples of a path."""
    weight = np.zeros((len(stroke.images), nominal.before.size))
    nominal = replace(nominal, weight=weight if nominal.weight is None else nominal.weight.copy())
    for index in range(nominal.count, len(stroke.samples)):
        if returns(stroke, nominal.first, index, device.finger.width):
            nominal = _shape(nominal, stroke, device)
            nominal = replace(nominal, ground=nominal.full, first=index, weight=weight.copy())
        assert nominal.weight is not None
        for row, image in zip(nominal.weight, stroke.images, strict=True):
            _weigh(row, stroke, device, image, index)
    return _shape(nominal, stroke, device)


def _weigh(weight: Floats, stroke: Stroke, device: Device, image: Image, index: int) -> None:
    """Raise weights (n,) about the path from a sample to the next one, `index`, in place."""
    last, sample = stroke.samples[max(index - 1, 0)], stroke.samples[index]
    start, end = image.place(last.x, last.y), image.place(sample.x, sample.y)
    radius, falloff = device.ring, stroke.falloff
    cells = _find_beside(device.grid, start, end, radius)
    distance, share = _measure(device.grid, cells, start, end)
    named = evaluate(RING[stroke.brush] if falloff is Falloff.DEVICE else falloff, distance, radius)
    first, full = (1.0, 1.0) if stroke.brush in LOCKS else (last.share, sample.share)
    if stroke.brush in (Brush.CREASE, Brush.CREST):
        first, full = last.depth, sample.depth
    weight[cells] = np.maximum(weight[cells], named * (first + share * (full - first)))


def _shape(nominal: Nominal, stroke: Stroke, device: Device) -> Nominal:
    """Return the surface that the weights of a pass leave."""
    assert nominal.weight is not None
    weight, ground, grid = nominal.weight, nominal.ground, device.grid
    if device.locked is not None:
        weight = weight * (1.0 - device.locked)
    most = weight.max(axis=0)
    if stroke.brush is Brush.SMOOTH:
        height = smooth(grid, ground, most, device.ring)
    elif stroke.brush in LOCKS:
        height = ground
    elif stroke.brush is Brush.ERASE:
        height = ground + most * (device.rest - ground)
    elif stroke.brush is Brush.FLATTEN:
        limit = max(sample.depth for sample in stroke.samples)
        moves = np.array([flatten(grid, ground, row, limit) for row in weight])
        height = ground + np.take_along_axis(moves, np.abs(moves).argmax(axis=0)[None], axis=0)[0]
    else:
        height = ground + (most if stroke.brush is Brush.CREST else -most)
    near = nominal.near | (most > 0.0)
    height = device.combine(stroke, nominal.before, height)
    return replace(nominal, full=height, near=near)


def _stamp(nominal: Nominal, stroke: Stroke, device: Device) -> Nominal:
    """Return what a stroke stamps, on the surface before it; where images meet, what goes farther.

    Drawn from its middle it reaches to the place where its right side is; a click gives the ring's
    size.
    """
    if stroke.stamp is None:
        return nominal
    first, last = stroke.samples[0], stroke.samples[-1]
    x, y = last.x - first.x, last.y - first.y
    half, angle = math.hypot(x, y), math.atan2(y, x)
    if half < device.grid.layout.pitch - TIE:
        half, angle = device.ring, 0.0
    cos, sin = math.cos(angle), math.sin(angle)
    scale = 2.0 * half / np.array(stroke.stamp.pixels)
    rise, grid = np.zeros(nominal.before.size), device.grid
    for image in stroke.images:
        pin_x, pin_y = image.trace(grid.x, grid.y)
        pin_x, pin_y = pin_x - first.x, pin_y - first.y
        turned = Grid(grid.layout, cos * pin_x + sin * pin_y, cos * pin_y - sin * pin_x)
        rise = np.maximum(
            rise, stroke.stamp.tops(turned, Placement(scale[1], scale[0], -half, -half)).value
        )
    if device.locked is not None:
        rise[device.locked] = 0.0
    height = device.find_start(stroke, nominal.before)
    height = height + (1.0 if stroke.brush is Brush.STAMP else -1.0) * last.depth * rise
    formed = device.combine(stroke, nominal.before, height)
    height = np.where(rise > 0.0, formed, nominal.before)
    return replace(nominal, full=height, near=rise > 0.0)


def _between(first: Sample, last: Sample, share: float) -> Sample:
    """Return the sample at a share of the straight line between two."""
    start, end = (np.array([at.x, at.y, at.depth, at.share, *at.lean]) for at in (first, last))
    x, y, depth, strength, lean_x, lean_y = (start + share * (end - start)).tolist()
    return Sample(x, y, depth, strength, (lean_x, lean_y))


def _measure(grid: Grid, cells: Cells, start: Place, end: Place) -> tuple[Floats, Floats]:
    """Return the distance of cells (m,) from a straight line, m, and the share of it where it is nearest."""
    x, y = grid.x[cells] - start[0], grid.y[cells] - start[1]
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    square = max(along_x * along_x + along_y * along_y, np.finfo(float).tiny)
    share = np.clip((x * along_x + y * along_y) / square, 0.0, 1.0)
    return np.hypot(x - share * along_x, y - share * along_y), share


def find_undersides(
    device: Device, stroke: Stroke, image: Image, lean: Place, at: Place, cells: Cells
) -> Floats:
    """Return how far above its lowest point the fingertip's underside is over cells, (m,), m, at a place."""
    turn = np.array(LEVEL) if stroke.turn is None else stroke.turn
    pose = np.array([[*at, 0.0, *turn_image(lean_finger(turn, lean), image)]])
    forms = compute_forms(device.finger.outline(pose))
    return compute_underside(*forms, device.grid.compute_basis(cells))[0]
