"""Sample shapes as closed meshes, in mm, z up."""

from __future__ import annotations

import math

import numpy as np
from digiclay.core.base.arrays import Floats
from numpy.typing import NDArray

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
    teeth, steps = 12, 24
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
    along, around = np.linspace(-55.0, 55.0, 90), 2.0 * math.pi * np.arange(40) / 40
    rings = []
    for x in along:
        end = math.sqrt(max(1.0 - (x / 55.2) ** 8, 0.0))
        half = (17.0 - 0.0012 * x * x) * end
        dents = 2.6 * math.cos(2.0 * math.pi * x / 23.0 + math.pi) * (abs(x) < 46.0)
        y = half * np.cos(around)
        top = (15.0 - dents) * end * np.sin(around)
        rings.append(
            np.column_stack(
                [np.full(40, x), y, np.where(np.sin(around) > 0.0, top, -9.0 * end * np.abs(np.sin(around)))]
            )
        )
    return woven(np.array(rings), closed=False)


def knot() -> Solid:
    """Return a trefoil knot, lying: where one strand passes over another, a bed can show only the upper."""
    count, around = 150, 16
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
