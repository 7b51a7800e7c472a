"""Strokes that smooth, and the smoothing that settles other strokes: path of the fingertip and orders.

Pins are smoothed by their valves, not by a finger: it goes along the path above them, never ahead of the hand
and no faster than a drag, and shows where the device is at work. At the end it waits until all pins have come
to their heights. No Blender in here.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..core.base.arrays import Floats
from ..core.control.blister import Blister
from ..core.control.orders import VERBLESS
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Grid, Layout
from .motion import CLEARANCE, DRAG, LIFT, SEARCH, cross, drag, finish_image, run_clock
from .stroke import ABOVE, DONE, DRAGGING, LEAVING, SETTLING, Brush, Stroke

#: Least radius of the disc that is smoothed, in pitches: below one a pin has no neighbor in it.
LEAST = 2.0
#: How long pins are waited for that do not come to their heights, s: noise may hide that they have.
PATIENCE = 2.0


def find_radius(finger: Fingertip, layout: Layout) -> float:
    """Return the radius of the disc that a stroke smooths, m: half the fingertip's width, or a few pins."""
    return max(finger.width, LEAST * layout.pitch)


def sweep(
    stroke: Stroke, height: Floats, radius: float, pose: Floats, count: int, period: float, now: float,
    *, arrived: bool,
) -> tuple[Stroke, Floats, Floats]:  # fmt: skip
    """Advance the fingertip over a press stroke that smooths; return path (k + 1, 7) and orders (k, 4)."""
    if stroke.height is None:
        stroke = replace(stroke, height=height.copy(), phase=ABOVE)
    safe = float(height.max()) + CLEARANCE
    path, orders = [pose], []
    while len(path) <= count and not stroke.done:
        stroke = run_clock(stroke, period, now)
        x, y, z = path[-1][:3].tolist()
        strength = 0.0
        if stroke.phase == ABOVE:
            stroke, (x, y, z) = cross(replace(stroke, clock=0.0, began=now), (x, y, z), safe, period)
            orders.append((0.0, 0.0, 0.0, 0.0))
        else:
            if stroke.phase != LEAVING:
                stroke, x, y = drag(replace(stroke, phase=DRAGGING), x, y, DRAG * period)
                z = max(safe, z - LIFT * period)
                strength = stroke.samples[stroke.reached].share
            orders.append((x, y, radius, strength))
            stroke = _end(stroke, arrived=arrived)
            arrived = False
        path.append(np.array([x, y, z, *pose[3:]]))
    return stroke, np.array(path), np.array(orders).reshape(-1, 4)


def _end(stroke: Stroke, *, arrived: bool) -> Stroke:
    """Return the stroke with its end begun after the path, and ended after the pins have arrived."""
    if stroke.phase == LEAVING:
        late = stroke.clock - stroke.left >= PATIENCE
        return finish_image(stroke) if arrived or late else stroke
    over = not stroke.held and stroke.reached == len(stroke.samples) - 1
    return replace(stroke, phase=LEAVING, left=stroke.clock) if over else stroke


#: How far a pin may be above or below all those around it, in pitches: 0.54 mm on the paper's bed.
LIMIT = 0.18
#: A spike that has grown by less was there before the stroke, m.
TOUCHED = 0.1e-3
#: Radius of the disc in which a spike is settled, in pitches: at first, and after the longest time, for on a
#: corner where all falls off nothing near can take up what is to be lowered.
NARROW, WIDE = 2.0, 4.0
#: How long a spike is settled before the next look, s, and how long a stroke settles at most.
STRETCH, LONGEST = 0.02, 1.0
#: Which way the fingertip of a brush moves the pins below it.
SIGN = {Brush.LOWER: -1.0, Brush.RAISE: 1.0}


def begin_settling(stroke: Stroke) -> Stroke:
    """Return a stroke that is done, with what it has left to be settled if it has a blister."""
    if stroke.tracking is None:
        return stroke
    return replace(stroke, phase=SETTLING, left=stroke.clock + SEARCH)


def settle(
    stroke: Stroke, grid: Grid, target: Floats, finger: Fingertip, blister: Blister, pose: Floats, count: int,
    period: float, *, arrived: bool,
) -> tuple[Stroke, Floats, Floats]:  # fmt: skip
    """Settle the worst spike for a while, or wait until the pins have arrived; returns as `sweep`."""
    gone = stroke.clock - stroke.left
    if gone < 0.0:
        # The device still looks for the fingertip, and takes back what rises meanwhile.
        most = min(count, math.ceil(-gone / period))
        clock = min(stroke.clock + most * period, stroke.left)
        return replace(stroke, clock=clock), np.tile(pose, (most + 1, 1)), np.zeros((most, VERBLESS))
    spike = None if gone >= LONGEST else find_spike(stroke, grid, target, finger, blister)
    if spike is None and (gone == 0.0 or arrived or gone >= LONGEST + PATIENCE):
        return replace(stroke, phase=DONE), np.array([pose, pose]), np.zeros((1, VERBLESS))
    if spike is None:
        (x, y), strength, most = pose[:2], 0.0, count
    else:
        x, y, strength, most = grid.x[spike], grid.y[spike], 1.0, min(count, max(1, round(STRETCH / period)))
    radius = (NARROW + (WIDE - NARROW) * min(gone / LONGEST, 1.0)) * grid.layout.pitch
    stroke = replace(stroke, clock=stroke.clock + most * period)
    return stroke, np.tile(pose, (most + 1, 1)), np.tile((x, y, radius, strength), (most, 1))


def find_spike(stroke: Stroke, grid: Grid, target: Floats, finger: Fingertip, blister: Blister) -> int | None:
    """Return the worst spike that a stroke has left in heights `target` (n,), m; None when there is none."""
    assert stroke.height is not None
    excess, limit = measure_excess_heights(grid, target), LIMIT * grid.layout.pitch
    cells = np.flatnonzero(np.abs(excess) > limit)
    if not cells.size:
        return None
    own, before = excess[cells], measure_excess_heights(grid, stroke.height)[cells]
    # What was there before stays, and so do all pins about which the stroke has moved none.
    there = np.where(np.sign(before) == np.sign(own), np.abs(before) + TOUCHED, 0.0)
    shaped = (np.sign(own) == SIGN.get(stroke.brush, 0.0)) & _lie_under_path(
        stroke, grid, cells, finger.width
    )
    form = _find_form(stroke, grid, finger, blister) if shaped.any() else 0.0
    over = np.abs(own) - np.maximum(np.where(shaped, max(limit, form), limit), there)
    worst = int(over.argmax())
    return int(cells[worst]) if over[worst] > 0.0 else None


def measure_excess_heights(grid: Grid, height: Floats) -> Floats:
    """Return how far each pin is above all neighbors, (n,), m; negative below all of them, else 0."""
    height = np.asarray(height)
    beside = np.append(height, np.nan)[grid.layout.find_neighbors(corners=True)]
    highest, lowest = np.fmax.reduce(beside, axis=1), np.fmin.reduce(beside, axis=1)
    # A bed of a single pin has no neighbors.
    highest, lowest = np.where(np.isnan(highest), height, highest), np.where(np.isnan(lowest), height, lowest)
    excess: Floats = np.maximum(height - highest, 0.0) - np.maximum(lowest - height, 0.0)
    return excess


def _find_form(stroke: Stroke, grid: Grid, finger: Fingertip, blister: Blister) -> float:
    """Return how far the extreme pin of a stroke's own section is off those beside it, m."""
    part = grid.layout.pitch / finger.width
    if stroke.brush is Brush.LOWER:
        return finger.height * (1.0 - math.sqrt(1.0 - part * part)) if part < 1.0 else math.inf
    first, second = blister.evaluate_profile(np.array([0.0, grid.layout.pitch])).clip(0.0)
    return float(first - second) * max(sample.depth for sample in stroke.samples)


def _lie_under_path(stroke: Stroke, grid: Grid, cells: NDArray[np.intp], radius: float) -> NDArray[np.bool_]:
    """Tell which pins lie within a radius, m, of the stroke's path, or of one of its mirror images."""
    drawn = np.array([(sample.x, sample.y) for sample in stroke.samples])
    near = np.zeros(cells.size, np.bool_)
    for mirror in stroke.mirrors:
        path = drawn * mirror
        start, way = path[:-1], np.diff(path, axis=0)
        if not len(start):
            start, way = path, np.zeros_like(path)
        square = np.maximum((way * way).sum(axis=1), np.finfo(float).tiny)
        off = np.column_stack([grid.x[cells], grid.y[cells]])[:, None] - start
        part = np.clip((off * way).sum(axis=2) / square, 0.0, 1.0)
        beside = off - part[..., None] * way
        near |= ((beside * beside).sum(axis=2) <= radius * radius).any(axis=1)
    return near
