"""Shares by which pins are locked, from 0 to 1: how brushes change them and are held back. No Blender.

A pin of share 1 is locked: its valves are shut. One locked in part moves as any other while a
stroke is formed; what a brush leaves of it is the share of its way that its lock does not take.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..core.base.arrays import TIE, Flags, Floats
from ..core.control.orders import Orders, Verb, repeat_order, share
from ..core.model.layout import Grid
from .nominal import Device, weigh_path
from .stroke import DONE, LOCKS, RETURNING, SWEPT, Brush, Image, Stroke

#: Brushes that are done at once, wherever the fingertip is.
AT_ONCE = (*(brush for brush in LOCKS if brush not in SWEPT), Brush.SET_BASE)
#: Least change of a pin that the valves are to make, m.
LEAST_CHANGE = 1e-7


def find_locks(stroke: Stroke, device: Device, height: Floats) -> Floats:
    """Return the shares (n,) that a stroke leaves, with pins at heights (n,), m."""
    brush, locks = stroke.brush, device.shares
    if brush is Brush.CLEAR_LOCKS:
        return np.zeros(height.size)
    if brush is Brush.INVERT_LOCKS:
        return 1.0 - locks
    if brush in (Brush.LOCK_PINS, Brush.UNLOCK_PINS):
        return np.where(_choose(stroke, device, height), float(brush is Brush.LOCK_PINS), locks)
    if brush in (Brush.LOCK, Brush.UNLOCK):
        weight = weigh_path(stroke, device).max(axis=0)
        return np.maximum(locks, weight) if brush is Brush.LOCK else np.minimum(locks, 1.0 - weight)
    beside = device.grid.find_beside(corners=False)
    around = locks[np.column_stack([np.arange(height.size), beside])]
    if brush is Brush.GROW_LOCKS:
        return np.asarray(around.max(axis=1))
    return np.asarray(around.min(axis=1) if brush is Brush.SHRINK_LOCKS else around.mean(axis=1))


def _choose(stroke: Stroke, device: Device, height: Floats) -> Flags:
    """Return which pins, (n,), are among those of a stroke, and within its limits."""
    chosen = np.ones(height.size, np.bool_)
    if stroke.pins is not None:
        chosen = np.isin(np.arange(height.size), stroke.pins)
    low, high = (device.rest + limit for limit in stroke.limits)
    inside: Flags = chosen & (height >= low - TIE) & (height <= high + TIE)
    return inside


def find_inside(places: Floats, path: Floats) -> Flags:
    """Return which places (k, 2) are inside a closed path (m, 2); one that crosses itself has holes."""
    x, y = places.T
    inside = np.zeros(len(places), np.bool_)
    for (left, low), (right, high) in pairwise(path.tolist()):
        if low != high:
            beside = x < left + (y - low) / (high - low) * (right - left)
            inside ^= ((low > y) != (high > y)) & beside
    return inside


def place_images(images: Sequence[Image], grid: Grid, height: Floats) -> Iterator[Floats]:
    """Yield for each image the places (n, 3), m, on pins at heights (n,), that it brings to the pins."""
    for image in images:
        x, y = image.place(grid.x, grid.y)
        yield np.column_stack([x, y, height[grid.at(x, y)]])


def order_at_once(
    stroke: Stroke, device: Device, height: Floats, pose: Floats
) -> tuple[Stroke, Floats, Orders]:
    """Lock pins, at heights (n,), m, as a stroke has it, and end it; returns as `sweep.sweep`."""
    # Smoothing of no pin: an order that makes a gesture of what changes no valve.
    order = Orders(repeat_order(1, Verb.SMOOTH))
    if stroke.brush in LOCKS:
        order = share(find_locks(stroke, device, height))
    return replace(stroke, phase=DONE), np.array([pose, pose]), order


def await_locks(stroke: Stroke, device: Device) -> Stroke:
    """Return a stroke that has ended; or that waits for pins locked in part, which have gone too far."""
    partly = (device.shares > 0.0) & (device.shares < 1.0)
    formed = stroke.brush in LOCKS or stroke.height is None or stroke.finish is not None
    if formed or not partly.any():
        return stroke
    return replace(stroke, phase=RETURNING, waited=0, arrived=False)


def find_return(stroke: Stroke, device: Device, now: Floats) -> Floats:
    """Return the heights (n,), m, of pins locked in part, now at heights (n,), that give their shares back.

    NaN: the pin stays.
    """
    assert stroke.height is not None
    assert device.locked is not None
    held = device.hold_back(stroke.height, now)
    return np.where(device.locked | (np.abs(held - now) < LEAST_CHANGE), np.nan, held)
