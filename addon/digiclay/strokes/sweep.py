"""Strokes that the valves form, not a finger; and how they finish what a finger has formed. No Blender.

The fingertip goes along the path above the pins, never ahead of the hand and no faster than a drag,
and shows where the device is at work. At the end it waits until all pins have come to their
heights.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..core.base.arrays import Floats
from ..core.control.orders import ORDER, Orders, Verb, place, repeat_order
from .locks import LEAST_CHANGE, find_return, order_at_once
from .motion import DESCEND, DRAG, cross, drag, find_safe
from .nominal import Device, Nominal, find_nominal
from .stroke import (
    ABOVE,
    DONE,
    DRAGGING,
    FINISHING,
    LEAVING,
    LOCKS,
    PRESSING,
    RETURNING,
    Brush,
    Correction,
    Stroke,
)

#: How long pins are waited for that do not come to their heights, s: noise may hide that they have;
#: and how many control periods pass between two looks.
PATIENCE, LOOK = 1.0, 4
#: Brushes whose strokes the valves form, and what they tell them.
SWEEPS = {
    Brush.SMOOTH: Verb.SMOOTH,
    Brush.ERASE: Verb.ERASE,
    Brush.LOCK: Verb.LOCK,
    Brush.UNLOCK: Verb.UNLOCK,
}
#: Time that a stroke takes beside its path, s: to come, press, rise and leave.
BESIDE = 0.4
#: What pins that stand move within a look, m.
STILL = 10e-6
#: Orders of a period that has none.
UNORDERED = Orders(np.zeros((1, ORDER)))


def sweep(
    stroke: Stroke,
    device: Device,
    verb: Verb,
    pose: Floats,
    count: int,
    period: float,
    *,
    arrived: bool,
) -> tuple[Stroke, Floats, Orders]:
    """Advance the fingertip over a stroke of the valves; return path (k + 1, 7), k <= count, and orders."""
    radius = device.ring
    if stroke.phase == FINISHING:
        x, y = pose[:2].tolist()
        rest = Orders(repeat_order(1, verb, x, y, radius))
        return _wait(stroke, pose, count, period, rest, arrived=arrived)
    assert stroke.height is not None
    safe, path, rows = find_safe(stroke, device, stroke.height), [pose], []
    # So long a pin below the path is in the disc before its middle, and after it; at both ends as
    # well.
    dwell = math.ceil(radius / (DRAG * period))
    while len(path) <= count and stroke.phase != FINISHING:
        x, y, z = path[-1][:3].tolist()
        order: tuple[float, ...] = (0.0,) * ORDER
        if stroke.phase == ABOVE:
            stroke, (x, y, z) = cross(replace(stroke, waited=0), (x, y, z), safe, period)
        else:
            if stroke.phase == DRAGGING and not stroke.drawn:
                dragged = drag(stroke, device, x, y, DRAG * period)
                if dragged is None:
                    break
                stroke, x, y = dragged
            else:
                stroke = _dwell(stroke, dwell)
            z = max(safe, z - DESCEND * period)
            order = (x, y, radius, stroke.samples[stroke.reached].share, verb)
        path.append(np.array([x, y, z, *pose[3:]]))
        rows.append(order)
    return stroke, np.array(path), Orders(np.array(rows, np.float64).reshape(-1, ORDER))


def _dwell(stroke: Stroke, periods: int) -> Stroke:
    """Return a stroke of the valves a control period on at an end of its path, where it stays so many."""
    stroke = replace(stroke, waited=stroke.waited + 1)
    if stroke.waited < periods:
        return replace(stroke, phase=LEAVING) if stroke.phase == DRAGGING else stroke
    return replace(stroke, phase=DRAGGING if stroke.phase == PRESSING else FINISHING, waited=0)


def finish(
    stroke: Stroke,
    device: Device,
    now: Floats,
    pose: Floats,
    count: int,
    period: float,
    *,
    arrived: bool,
) -> tuple[Stroke, Floats, Orders]:
    """Drive pins, now at heights (n,), m, to a stroke's nominal surface; returns as `sweep`.

    Those of a stroke that is finished as left are waited for, unless the valves alone form it.
    """
    if stroke.brush in LOCKS:
        return order_at_once(stroke, device, now, pose)
    if stroke.phase == RETURNING:
        back = find_return(stroke, device, now) if stroke.finish is None else stroke.finish
        stroke = replace(stroke, finish=back)
        return _wait(stroke, pose, count, period, place(1, back), arrived=arrived)
    if stroke.as_left and not stroke.placed:
        return _settle(stroke, device, now, pose, count, period)
    surface, before = stroke.finish, stroke.height
    assert before is not None
    if surface is None:
        nominal = find_nominal(stroke, device, before)
        surface = np.where(nominal.near, nominal.height, np.nan)
        if not stroke.placed:
            stroke = replace(stroke, correction=_compare(nominal, now, made=True))
    # What the method has moved beside the path, or still does, comes back to where it was. It is
    # seen at the looks only, however many control periods are simulated at a time.
    astray = np.isnan(surface) & (np.abs(before - now) > LEAST_CHANGE)
    if stroke.waited % LOOK == 0 and (stroke.finish is None or astray.any()):
        stroke = replace(stroke, finish=np.where(astray, before, surface))
    assert stroke.finish is not None
    arrived = arrived and _has_searched(stroke, period) and not astray.any()
    return _wait(stroke, pose, count, period, place(1, stroke.finish), arrived=arrived)


def _has_searched(stroke: Stroke, period: float) -> bool:
    """Tell whether a method no longer looks for the fingertip: it would move pins once more."""
    return stroke.tracking is None or stroke.waited * period > stroke.tracking.search + period


def _settle(
    stroke: Stroke, device: Device, now: Floats, pose: Floats, count: int, period: float
) -> tuple[Stroke, Floats, Orders]:
    """Wait until pins, now at heights (n,), m, stand as the method leaves them; returns as `sweep`."""
    before, stands = stroke.height, False
    assert before is not None
    if stroke.waited % LOOK == 0:
        moved = np.inf if stroke.finish is None else float(np.abs(now - stroke.finish).max())
        stands = moved < STILL and _has_searched(stroke, period)
        stroke = replace(stroke, finish=now.copy())
    stroke, path, orders = _wait(stroke, pose, count, period, UNORDERED, arrived=stands)
    if stroke.done:
        nominal = find_nominal(stroke, device, before)
        left = device.hold_back(before, now)
        stroke = replace(stroke, correction=_compare(nominal, left, made=False), finish=None)
    return stroke, path, orders


def _compare(nominal: Nominal, now: Floats, *, made: bool) -> Correction:
    """Return how far pins at heights (n,), m, are from a nominal surface."""
    error = (nominal.height - now)[nominal.near]
    rms = math.sqrt(float(error @ error) / max(error.size, 1))
    return Correction(rms, float(np.abs(error).max(initial=0.0)), made)


def _wait(
    stroke: Stroke, pose: Floats, count: int, period: float, order: Orders, *, arrived: bool
) -> tuple[Stroke, Floats, Orders]:
    """Repeat an order until the pins have arrived, as far as the next look at them; returns as `sweep`."""
    looks = stroke.waited > 0 and stroke.waited % LOOK == 0
    # At the first look some pins pass their heights.
    if stroke.waited * period >= PATIENCE or (looks and arrived and stroke.arrived):
        last = stroke.image + 1 == len(stroke.images)
        # The valves sweep one image after the other.
        later = replace(
            stroke, phase=ABOVE, image=stroke.image + 1, reached=0, first=0, ground=stroke.height
        )
        stroke = replace(stroke, phase=DONE) if last else later
        return stroke, np.array([pose, pose]), UNORDERED
    most = min(count, LOOK - stroke.waited % LOOK)
    stroke = replace(
        stroke, waited=stroke.waited + most, arrived=arrived if looks else stroke.arrived
    )
    return stroke, np.tile(pose, (most + 1, 1)), replace(order, rows=np.tile(order.rows, (most, 1)))


def estimate_time(strokes: Sequence[Stroke]) -> float:
    """Return about how long the strokes of a queue still take, s of simulated time."""
    tracking, time = strokes[0].tracking if strokes else None, 0.0
    for stroke in strokes:
        speed = DRAG
        if tracking is not None:
            deepest = max(sample.depth for sample in stroke.samples)
            speed = tracking.limit_drag(deepest, pressed=stroke.brush is Brush.LOWER)
        lengths = [
            float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) for path in stroke.ahead
        ]
        lengths = [0.0] if stroke.placed else lengths
        times = [BESIDE + length / speed for length in lengths]
        time += sum(times) if stroke.brush in SWEEPS else max(times)
    return time
