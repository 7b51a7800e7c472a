"""Meshes of the sample scenes with bodies, made of formulas: ``python -m tests.make_bodies``.

It writes hand, face and ball beside their scenes, mm, z up. A surface is where a field is 0: it is
below 0 inside. A field is about the distance, mm.
"""

import itertools

import numpy as np
import trimesh
from digiclay.core.scene.scene_source import BODY_SAMPLES

#: Forearm, palm with both balls of the thumb and of the little finger, thumb, and fingers of a right
#: hand, palm down: two ends x, y, z, mm, with the radius there.
HAND = (
    ((2, -72, 6, 20), (4, -112, 20, 24)),
    ((-2, -62, 2, 18), (2, -75, 8, 20)),
    ((-4, -58, 1, 16), (-27, 10, 2, 11)),
    ((-2, -58, 1, 16), (-8, 16, 3, 11.5)),
    ((2, -58, 1, 16), (11, 12, 3, 11)),
    ((5, -58, 1, 15), (28, 1, 2, 10)),
    ((-14, -46, -1, 16), (-30, -28, -1, 14)),
    ((18, -46, -1, 15), (24, -20, 0, 12)),
    ((-30, -28, -1, 14), (-51, -4, -1, 10)),
    ((-51, -4, -1, 10), (-66, 24, -4, 8)),
    ((-27, 10, 2, 10.5), (-33, 46, 1, 9)),
    ((-33, 46, 1, 9), (-37, 80, -4, 7.5)),
    ((-8, 16, 3, 11), (-10, 56, 2, 9.2)),
    ((-10, 56, 2, 9.2), (-11, 92, -4, 7.7)),
    ((11, 12, 3, 10.5), (14, 50, 1, 8.8)),
    ((14, 50, 1, 8.8), (17, 83, -4, 7.3)),
    ((28, 1, 2, 9.5), (37, 31, 0, 7.8)),
    ((37, 31, 0, 7.8), (44, 58, -4, 6.5)),
)
#: How far parts of the hand flow into each other, mm.
FLOW = 5.0
#: Half axes of the head, x, y, z, mm; how far it is cut behind.
HEAD, BEHIND = (76.0, 108.0, 62.0), 6.0
#: Parts of the face, which looks down: place x, y, half width in x and in y, height, mm. They are
#: mirrored in x.
FACE = (
    (0, 2, 8, 20, 15),  # nose: its bridge,
    (0, -14, 9, 9, 12),  # tip
    (9, -15, 6, 6, 6),  # and wings
    (30, 22, 15, 9, -11),  # eye sockets,
    (30, 21, 9, 7, 6),  # eyes
    (28, 40, 22, 7, 5),  # and brows
    (42, -8, 17, 15, 4),  # cheeks
    (34, -34, 14, 18, -4),
    (0, -38, 18, 4, 6),  # lips
    (0, -43.5, 20, 3.0, -4),
    (0, -49, 15, 4.5, 6),
    (0, -61, 16, 6, -5),
    (0, -78, 16, 12, 8),  # chin
)
#: Radius of the ball, mm; height of its knobs, mm, and their half width, rad.
BALL, KNOB, WIDE = 30.0, 3.5, 0.22


def limb(points, start, end):
    """Return the distance of points from a cone with round ends."""
    start, end = np.array(start, float), np.array(end, float)
    axis = end[:3] - start[:3]
    part = np.clip((points - start[:3]) @ axis / (axis @ axis), 0.0, 1.0)
    away = np.linalg.norm(points - start[:3] - part[..., None] * axis, axis=-1)
    return away - start[3] - part * (end[3] - start[3])


def hand(points):
    """Return the field of a hand: limbs that flow into each other."""
    whole = np.inf
    for start, end in HAND:
        each = limb(points, start, end)
        blend = np.maximum(FLOW - np.abs(whole - each), 0.0)
        whole = np.minimum(whole, each) - blend**2 / (4.0 * FLOW)
    return whole


def face(points):
    """Return the field of a face: the front of an ellipsoid, with bumps and hollows."""
    x, y, z = np.moveaxis(points, -1, 0)
    front = -z
    for at, up, wide, high, rise in FACE:
        sides = (at, -at) if at else (0,)
        front = front - sum(
            rise * np.exp(-(((x - side) / wide) ** 2) - ((y - up) / high) ** 2) for side in sides
        )
    narrow = 1.0 - 0.18 * np.clip(-y / HEAD[1], 0.0, 1.0)  # towards the chin
    deep = np.where(front > 0.0, front, 0.3 * front)
    rows = np.stack([x / narrow / HEAD[0], y / HEAD[1], deep / HEAD[2]], axis=-1)
    return np.maximum((np.linalg.norm(rows, axis=-1) - 1.0) * HEAD[2], z - BEHIND)


def ball(points):
    """Return the field of a ball with twelve knobs, about its center."""
    away = np.linalg.norm(points, axis=-1)
    toward = points / np.maximum(away, 1e-9)[..., None]
    knobs = trimesh.creation.icosahedron().vertices
    knobs = knobs / np.linalg.norm(knobs, axis=1)[:, None]
    angle = np.arccos(np.clip((toward @ knobs.T).max(axis=-1), -1.0, 1.0))
    return away - BALL - KNOB * np.exp(-((angle / WIDE) ** 4))


def lay(field, low, high, step):
    """Return the surface of a field in a box: a vertex per cube that it cuts, a square per edge."""
    axes = [np.arange(a, b + step, step) for a, b in zip(low, high, strict=True)]
    values = field(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    inside = values < 0.0
    corners = [
        tuple(slice(c, c - 1 or None) for c in at) for at in itertools.product((0, 1), repeat=3)
    ]
    count = sum(inside[at].astype(int) for at in corners)
    cut = np.argwhere((count > 0) & (count < 8))
    number = np.full(count.shape, -1)
    number[tuple(cut.T)] = np.arange(len(cut))
    vertices = np.array(low) + step * (cut + 0.5)
    for _ in range(8):  # Newton's method, each step at most a fifth of a cube
        slope = np.stack(
            [(field(vertices + d) - field(vertices - d)) / 0.02 for d in 0.01 * np.eye(3)],
            axis=-1,
        )
        size = np.maximum((slope**2).sum(axis=1), 1e-9)
        move = -field(vertices)[:, None] * slope / size[:, None]
        far = np.linalg.norm(move, axis=1)[:, None]
        vertices = vertices + move * np.minimum(1.0, 0.2 * step / np.maximum(far, 1e-9))
    squares = []
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        ahead = np.moveaxis(inside, axis, 0)
        crossed = np.moveaxis(ahead[1:] != ahead[:-1], 0, axis)
        edges = np.argwhere(crossed)
        out = inside[tuple(edges.T)]
        around = []
        for one, two in ((0, 0), (1, 0), (1, 1), (0, 1)):
            cube = edges.copy()
            cube[:, first] -= one
            cube[:, second] -= two
            around.append(number[tuple(cube.T)])
        square = np.stack(around, axis=1)
        squares.append(np.where(out[:, None], square, square[:, ::-1]))
    square = np.concatenate(squares)
    return vertices, np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])


#: Way of the ball: half its length and half its width, mm, radius on which it rolls, mm, and speed,
#: mm/s; height of its center over the rest height, deep in the pins and above them, mm.
LONG, BROAD, ROLLS, SPEED, DEEP, ABOVE = 62.0, 26.0, 25.0, 60.0, 19.0, 40.0
#: Head of the scene of the ball.
TRACK = """\
name = "ball_track"
description = "A ball with knobs rolls through 90 × 90 plastic pins and leaves its track."

# Written for this project by `python -m tests.make_bodies`, with the ball, `ball.ply`, in mm. It rolls
# without slip along one period of a sine.
[layout]
rows = 90
columns = 90
pitch = "2 mm"

[control]
method = "plastic"

[[body]]
file = "ball.ply"

[body.trajectory]
interpolation = "linear"
waypoints = [
"""


def multiply(first, second):
    """Return the product of two quaternions."""
    a, u, b, v = first[0], first[1:], second[0], second[1:]
    return np.array([a * b - u @ v, *(a * v + b * u + np.cross(u, v))])


def roll():
    """Return times, places, m, and orientations of the ball, at most 0.13 s apart."""
    x = np.linspace(-LONG, LONG, 2001)
    y = BROAD * np.sin(np.pi * x / LONG)
    length = np.append(0.0, np.cumsum(np.hypot(np.diff(x), np.diff(y))))
    along = np.linspace(0.0, length[-1], int(length[-1] / SPEED / 0.13) + 2)
    at = np.stack([np.interp(along, length, x), np.interp(along, length, y)], axis=1)
    turns = [np.array([1.0, 0.0, 0.0, 0.0])]
    for step in np.diff(at, axis=0):
        half = np.hypot(*step) / ROLLS / 2.0
        axis = np.array([-step[1], step[0], 0.0]) / np.hypot(*step)
        turns.append(multiply(np.array([np.cos(half), *(np.sin(half) * axis)]), turns[-1]))
    rest = 40.0
    places = [
        [*at[0], rest + ABOVE],
        *([*each, rest + DEEP] for each in at),
        [*at[-1], rest + 2 * ABOVE],
    ]
    times = np.concatenate([[0.0], 0.6 + along / SPEED, [1.8 + along[-1] / SPEED]])
    return times, np.array(places) * 1e-3, [turns[0], *turns, turns[-1]]


def write_track():
    """Return the scene of the ball."""
    lines = [
        f"  {{ time = {time:.3f}, position = {(place.round(5) + 0.0).tolist()},"
        f" orientation = {(turn.round(4) + 0.0).tolist()} }},\n"
        for time, place, turn in zip(*roll(), strict=True)
    ]
    return "".join((TRACK, *lines, "]\n"))


def make_bodies():
    """Return vertices, mm, to 1 µm, and triangles of bodies; hand and face lie on their origin."""
    bodies = {
        "hand": lay(hand, (-84, -170, -30), (62, 110, 70), 3.2),
        "face": lay(face, (-92, -120, -100), (92, 120, 12), 3.6),
        "ball": lay(ball, (-36, -36, -36), (36, 36, 36), 2.0),
    }
    for name in ("hand", "face"):
        bodies[name][0][:, 2] -= bodies[name][0][:, 2].min()
    return {name: (vertices.round(3) + 0.0, faces) for name, (vertices, faces) in bodies.items()}


def write():
    """Write the meshes, and the scene of the ball."""
    for name, (vertices, triangles) in make_bodies().items():
        mesh = trimesh.Trimesh(vertices, triangles, process=False)
        mesh.export(BODY_SAMPLES / f"{name}.ply", vertex_normal=False)
    (BODY_SAMPLES / "ball_track.toml").write_text(write_track(), encoding="utf-8")


if __name__ == "__main__":
    write()
