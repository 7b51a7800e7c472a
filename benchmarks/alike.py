"""Even and equal strokes: how even they are; one turned, crossing, mirrored, at other rates and depths."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.control.blister import Blister
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Grid, Layout
from digiclay.core.scene.schema import Scene
from digiclay.device.instant import CLEARANCE, find_ellipsoid
from digiclay.recorded.pointer_strokes import PointerStroke, play_strokes
from digiclay.sessions.running import Running
from digiclay.sessions.sculpting import begin_session, change_stroke, find_stroke, follow_finger, queue_stroke
from digiclay.settings.devices import BEDS, FIRST, change_finger, make_scene
from digiclay.strokes.stroke import FINISHING, draw, lay_ring

from .intended import find_distance
from .report import Report, tabulate

#: Parts of the flat top, and of the slope, between which a section is straight.
PARTS = (3, 6)


def measure_distances(stroke: PointerStroke, grid: Grid) -> Floats:
    """Return how far pins are from the path of a stroke, or its nearest mirror image, (n,), m."""
    path = np.array([move[1:] for move in stroke.moves])
    if stroke.path != "free":
        path = lay_ring(path[0], path[-1]) if stroke.path == "ring" else path[[0, -1]]
    paths = [[image.place(x, y) for x, y in path.tolist()] for image in stroke.images]
    return np.asarray(np.min([find_distance(one, grid.x, grid.y) for one in paths], axis=0))


def measure_unevenness(height: Floats, near: Floats, blister: Blister) -> Floats:
    """Return how far pins (k,) differ, (k,), m, from the common section of those so far from a path, m."""
    flat, radius = blister.flat_radius, blister.radius
    knots = np.concatenate([
        np.linspace(0.0, flat, PARTS[0], endpoint=False), np.linspace(flat, radius, PARTS[1]),
        [max(2.0 * radius - flat, near.max() * (1.0 + 1e-9))],
    ])  # fmt: skip
    hats = np.array([np.interp(near, knots, row) for row in np.eye(len(knots))]).T
    return np.asarray(height - hats @ np.linalg.lstsq(hats, height, rcond=None)[0])


def find_unevenness(
    height: Floats, strokes: tuple[PointerStroke, ...], grid: Grid, blisters: tuple[Blister, ...]
) -> Floats:
    """Return `measure_unevenness` of the pins at just one stroke that raises or lowers, (k,), m."""
    near = np.array([measure_distances(stroke, grid) for stroke in strokes])
    reach = np.array([[blister.radius + grid.layout.pitch] for blister in blisters])
    alone, found = (near < reach).sum(axis=0) == 1, [np.zeros(1)]
    for stroke, row, (most,), blister in zip(strokes, near, reach, blisters, strict=True):
        cells = np.flatnonzero(alone & (row < most))
        if stroke.kind.has_amount and cells.size:
            found.append(measure_unevenness(height[cells], row[cells], blister))
    return np.concatenate(found)


def find_spikes(height: Floats, grid: Grid) -> Floats:
    """Return how far pins are above, or below, all their neighbors, (n,), m."""
    beside = np.append(height, np.nan)[grid.layout.find_neighbors(corners=True)]
    above = height - np.fmax.reduce(beside, axis=1)
    return np.asarray(np.maximum(above, np.fmin.reduce(beside, axis=1) - height).clip(0.0))


def move(
    strokes: tuple[PointerStroke, ...], angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0),
    share: float = 1.0,
) -> tuple[PointerStroke, ...]:  # fmt: skip
    """Return strokes turned by an angle, rad, scaled, and shifted, m; depths and heights stay."""
    c, s, (x0, y0) = share * math.cos(angle), share * math.sin(angle), shift
    return tuple(
        replace(one, moves=tuple((t, c * x - s * y + x0, s * x + c * y + y0) for t, x, y in one.moves))
        for one in strokes
    )


#: Rows and columns of the bed of the cases.
SIDE = 60
#: Angles, degrees, and shifts, m, of the cases: beside the grid of the pins.
TURNS = ((0.0, (0.0, 0.0)), (17.0, (0.4e-3, 0.7e-3)))
#: Depths and heights asked for, m; ticks a second, and moves a tick, of hands on slow and quick machines.
AMOUNTS, HANDS = (2e-3, 4e-3, 8e-3, 15e-3), ((60.0, 1), (24.0, 5), (7.0, 1))
#: How far from the path pins are whose heights count as those of the stroke, m.
CORE = 1.5e-3
#: What Raise and Lower do in the cases.
KINDS: dict[str, dict[str, Any]] = {
    "lowered 6 mm": {"brush": "lower", "depth": 6e-3}, "raised 8 mm": {"brush": "raise", "height": 8e-3},
}  # fmt: skip


def _bend(*places: Any) -> dict[str, Any]:
    """Return the moves of a hand through places, mm, within half a second."""
    times = np.linspace(0.0, 0.5, len(places))
    return {"moves": tuple((t, 1e-3 * x, 1e-3 * y) for t, (x, y) in zip(times.tolist(), places, strict=True))}


PATHS: dict[str, dict[str, Any]] = {
    "line": {**_bend((-28.0, 0.0), (28.0, 0.0)), "path": "line"},
    "ring": {**_bend((0.0, 0.0), (26.0, 0.0)), "path": "ring"},
    "free": _bend(*((26.0 * u, 14.0 * math.sin(3.0 * u)) for u in np.linspace(-1.0, 1.0, 24).tolist())),
    "loop": _bend(
        (-28.0, -14.0), (10.0, -14.0),
        *((10.0 + 14.0 * math.sin(a), -14.0 * math.cos(a)) for a in np.linspace(0.3, 4.7, 24).tolist()),
        (-4.0, -28.0),
    ),
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Played:
    """What strokes have left on an even bed."""

    session: Running
    formed: Floats
    """(n,): Heights above rest, m."""
    raw: Floats
    """(n,): Before the valves finished the last stroke, m."""
    force: float
    """Greatest total force on a fingertip, N."""
    time: float
    """Simulated until all is formed, s."""
    strokes: tuple[PointerStroke, ...]

    @property
    def grid(self) -> Grid:
        """Of the pins."""
        return self.session.system.grid

    def find_unevenness(self, height: Floats) -> Floats:
        """Return `find_unevenness` of heights (n,), m, of the bed."""
        usual, scene = find_ellipsoid(self.session.scene), self.session.scene
        scenes = [change_finger(scene, usual, one.size_finger(usual)) for one in self.strokes]
        return find_unevenness(
            height, self.strokes, self.grid, tuple(one.blister or Blister() for one in scenes)
        )


def make_bed(name: str = FIRST, side: int | None = None) -> Scene:
    """Return a bed as Add makes it, or one with so many rows and columns."""
    bed = BEDS[name]
    layout = Layout(rows=side or bed.rows, columns=side or bed.columns, pitch=bed.pitch)
    return make_scene(bed.preset, layout, bed.method, bed.share)


def begin(scene: Scene) -> Running:
    """Return a session of a bed at rest, the fingertip above it."""
    above = np.array([0.0, 0.0, scene.actuator.rest_height + CLEARANCE, *LEVEL])
    return begin_session(1, "Bed", scene, above)[0]


def play(scene: Scene, strokes: tuple[PointerStroke, ...]) -> Played:
    """Play strokes on a bed at rest."""
    session, force, rest = begin(scene), 0.0, scene.actuator.rest_height
    raw = session.state.row(0)
    for after in play_strokes(session, strokes):
        # A trace has the total of the fingertips; what each of several feels is seen at the end of a tick.
        one, since = len(session.poses) == len(after.poses) == 1, after.state.period - session.state.period
        felt = after.trace.force[-since:] if one and since else after.state.finger_forces()
        session, force = after, max(force, float(felt.max(initial=0.0)))
        if session.strokes and session.strokes[0].phase != FINISHING:
            raw = session.state.row(0).copy()
    time = session.state.period * session.system.period
    return Played(session, session.state.row(0) - rest, raw - rest, force, time, strokes)


def draw_by_hand(scene: Scene, stroke: PointerStroke, rate: float, moves: int) -> Floats:
    """Draw a stroke on a bed at rest, some moves a tick, ticks at a rate, 1/s; return heights, (n,), m."""
    session = begin(scene)
    session, number = queue_stroke(session, *stroke.moves[0][1:], stroke.amount, brush=stroke.kind)
    left, count = list(stroke.moves[1:]), round(1.0 / (rate * session.system.period))
    while find_stroke(session, number) is not None:
        for _, x, y in left[:moves]:
            session = change_stroke(session, number, partial(draw, x=x, y=y, depth=stroke.amount))
        left = left[moves:]
        session = change_stroke(session, number, partial(replace, held=bool(left)))
        session = follow_finger(session, session.pose, count)
    return np.asarray(session.state.row(0) - scene.actuator.rest_height)


def list_reliefs() -> Iterator[dict[str, Any]]:
    """Yield how even each kind of stroke is along each path, m, and its spikes, m."""
    for (kind, amount), (name, path) in product(KINDS.items(), PATHS.items()):
        for angle, shift in TURNS:
            made = play(
                make_bed(side=SIDE), move((PointerStroke(**amount, **path),), math.radians(angle), shift)
            )
            formed, raw = made.find_unevenness(made.formed), made.find_unevenness(made.raw)
            yield {
                "case": f"{name}, {kind}, at {angle:g} degrees", "rms": math.sqrt(np.mean(formed**2)),
                "most": np.abs(formed).max(), "raw": math.sqrt(np.mean(raw**2)),
                "raw_most": np.abs(raw).max(),
                "spike": find_spikes(made.formed, made.grid).max(), "force": made.force,
            }  # fmt: skip


def list_differences() -> Iterator[dict[str, Any]]:
    """Yield how far apart strokes are that are to be alike, and what remains of depths and heights, m."""
    for kind, amount in KINDS.items():
        free = PointerStroke(**amount, **PATHS["free"])
        shifted = move((free,), 0.5 * math.pi, (14e-3, 0.0))[0]
        mirrored = replace(shifted, moves=tuple((t, -x, y) for t, x, y in shifted.moves))
        first, other, both = (
            play(make_bed(side=SIDE), (one,)).formed.reshape(SIDE, SIDE)
            for one in (shifted, mirrored, replace(shifted, symmetry="x"))
        )
        yield _differ(f"{kind}: its mirror image in one stroke", both - both[:, ::-1])
        yield _differ(f"{kind}: drawn mirrored", first - other[:, ::-1])
        usual = play(make_bed(side=SIDE), (free,)).formed
        for rate, moves in HANDS:
            drawn = draw_by_hand(make_bed(side=SIDE), free, rate, moves)
            yield _differ(f"{kind}: drawn by {moves} moves a tick, {rate:g} ticks a second", drawn - usual)
    for brush, asked in product(("lower", "raise"), AMOUNTS):
        line = PointerStroke(brush=brush, depth=asked, height=asked, **PATHS["line"])
        made = play(make_bed(side=SIDE), (line,))
        core = np.abs(made.formed[measure_distances(line, made.grid) < CORE])
        yield _differ(f"{brush} {1e3 * asked:g} mm", core - asked, float(core.mean()))


def _differ(case: str, difference: Floats, left: float | None = None) -> dict[str, Any]:
    """Return the row of a case: what is left, m, and the greatest difference, m."""
    return {"case": case, "left": left, "difference": float(np.abs(difference).max())}


#: Columns of the two tables.
RELIEF = {
    "case": "case", "uneven, rms, mm": "rms .3f 1e3", "most, mm": "most .2f 1e3",
    "raw, rms, mm": "raw .3f 1e3", "raw, most, mm": "raw_most .2f 1e3",
    "spike, mm": "spike .2f 1e3", "force, N": "force .2f",
}  # fmt: skip
ALIKE = {"case": "case", "left, mm": "left .2f 1e3", "greatest difference, µm": "difference .1f 1e6"}


def compare() -> list[Report]:
    """Return the reports of both tables."""
    reliefs, differences = list(list_reliefs()), list(list_differences())
    return [
        Report(["", *tabulate(reliefs, RELIEF)], reliefs, name="made_relief"),
        Report(["", *tabulate(differences, ALIKE)], differences, name="made_alike"),
    ]
