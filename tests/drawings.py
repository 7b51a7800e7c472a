"""Drawings of several strokes, the hand that draws them, and their judge, who knows no product code.

All lengths are in mm, on the bed "design".
"""

import tomllib
from itertools import pairwise
from pathlib import Path

import numpy as np

DRAWINGS = Path(__file__).with_suffix(".toml")
#: Points that a curve has between two of its own.
FINE = 12
#: Moves of a hand per second, its speed, mm/s, and how much it trembles, mm.
RATE, SPEED, JITTER = 100.0, 150.0, 0.15
#: Distance between pins, and the section of a stroke: how far from the path it is even, and how
#: far it reaches. Both are half of the paper's 6 and 15 mm, as the fingertip is.
PITCH, FLAT, REACH = 1.5, 3.0, 7.5
#: Pins as near to a path as this lie on it: well within the even part, however the hand trembles.
ON_PATH = 1.5
#: How a drawing is put on the bed: its turn, degrees, and its shift.
AS_DRAWN, TURNED = (0.0, (0.0, 0.0)), (30.0, (3.1, -2.3))


def read_drawings():
    """Return the strokes (k, 2) of each drawing by its name."""
    table = tomllib.loads(DRAWINGS.read_text(encoding="utf-8"))
    return {
        name: [lay(**stroke) for stroke in drawing["strokes"]] for name, drawing in table.items()
    }


def lay(points, curve=False, closed=False):
    """Return the polyline (k, 2) of a stroke: straight between its points, or a Catmull-Rom curve."""
    points = np.array(points, np.float64)
    if closed:
        points = np.vstack([points, points[:1]])
    if not curve:
        return points
    before = points[-2] if closed else 2 * points[0] - points[1]
    after = points[1] if closed else 2 * points[-1] - points[-2]
    knots = np.vstack([before, points, after])
    t = np.linspace(0.0, 1.0, FINE, endpoint=False)[:, None]
    rows = []
    for a, b, c, d in zip(knots, knots[1:], knots[2:], knots[3:], strict=False):
        square, cube = 2 * a - 5 * b + 4 * c - d, 3 * (b - c) + d - a
        rows.append(b + 0.5 * t * (c - a + t * (square + t * cube)))
    return np.vstack([*rows, points[-1:]])


def put(strokes, turn, shift):
    """Return strokes turned, degrees, and shifted."""
    cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return [path @ np.array([[cos, sin], [-sin, cos]]) + shift for path in strokes]


def draw_by_hand(path, rng):
    """Return the places (m, 2) of a trembling hand, RATE per second, along a polyline (k, 2)."""
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    at = np.linspace(0.0, gone[-1], 1 + round(gone[-1] / SPEED * RATE))
    places = np.column_stack([np.interp(at, gone, axis) for axis in path.T])
    return places + rng.normal(0.0, JITTER, places.shape)


def find_distance(strokes, x, y):
    """Return how far places (n,) are from the nearest of some polylines."""
    near = np.full(np.shape(x), np.inf)
    for start, end in (pair for stroke in strokes for pair in pairwise(stroke)):
        along = end - start
        share = ((x - start[0]) * along[0] + (y - start[1]) * along[1]) / max(along @ along, 1e-12)
        share = share.clip(0.0, 1.0)
        off = np.hypot(x - start[0] - share * along[0], y - start[1] - share * along[1])
        near = np.minimum(near, off)
    return near


def find_wanted(strokes, amount, x, y):
    """Return the height that strokes leave at places (n,): even near their paths, then straight to 0."""
    return amount * ((REACH - find_distance(strokes, x, y)) / (REACH - FLAT)).clip(0.0, 1.0)


def measure_slope(relief):
    """Return the steepest slope of rows by columns between pins beside each other, also over a corner."""
    sides = (relief[1:] - relief[:-1], relief[:, 1:] - relief[:, :-1])
    corners = (relief[1:, 1:] - relief[:-1, :-1], relief[1:, :-1] - relief[:-1, 1:])
    diagonal = 2**0.5 * PITCH
    return max(
        *(float(np.abs(step).max()) / PITCH for step in sides),
        *(float(np.abs(step).max()) / diagonal for step in corners),
    )


def judge(strokes, amount, relief, x, y):
    """Return what is wrong with heights (rows, columns) that strokes of an amount have left; "" if nothing.

    `amount` is below 0 where they lower; `x`, `y` (n,): the pins.
    """
    faults = []
    for number, stroke in enumerate(strokes, 1):
        heights = relief.ravel()[find_distance([stroke], x, y) < ON_PATH]
        low, high, rms = heights.min(), heights.max(), heights.std()
        if max(abs(low - amount), abs(high - amount)) > 0.1:
            faults.append(f"stroke {number} has {low:.2f} to {high:.2f} mm")
        if rms > 0.15:
            faults.append(f"stroke {number} varies by {rms:.2f} mm rms")
    slope, most = measure_slope(relief), 1.1 * abs(amount) / (REACH - FLAT)
    if slope > most:
        faults.append(f"a slope is {slope:.2f}, above {most:.2f}")
    return "; ".join(faults)
