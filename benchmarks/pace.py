"""Benchmark ``pace``: how fast a fingertip can lead each method, beside what the method states."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.engine.simulation import begin
from digiclay.core.engine.system import System
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.session.live_session import simulate_path
from digiclay.settings.devices import BEDS, make_scene
from digiclay.strokes.tracking import SUDDEN, Tracking, find_tracking

from .report import Report, Steps, tabulate

#: Heights of the strokes over the bed at rest, m: a ridge, a valley.
RIDGE, VALLEY = 8e-3, -6e-3
#: Corners of a stroke in pitches: there, and back at a sharp angle; and rows and columns of the bed.
CORNERS, SIZE = ((-12.0, -6.0), (12.0, 0.0), (-12.0, 6.0)), (34, 46)
#: Largest force on the fingertip, N; Method II holds one on each pin, together 1.3 N at rest on "paper".
MOST_FORCE, OF_METHOD_II = 1.0, 2.0
#: Largest share of a drag without contact, and rms by which heights along it may vary, m.
MOST_ABSENT, MOST_RMS = 0.02, 0.6e-3
#: How much faster each trial is than the one before, and how many there are.
STEP, TRIALS = 1.2, 8
#: What is stated, by field of `Tracking`, and the height of its stroke.
SPEEDS = {"drag": RIDGE, "push": VALLEY, "sink_speed": VALLEY, "lift": RIDGE}
#: Methods, and beds with the preset of each.
METHODS = ("virtual_master", "cell_states", "hybrid")
DEVICES = (("paper", "paper"), ("paper", "fast"), ("design", "design"), ("fine", "design"))
#: How far above the pins a stroke begins, m, how fast it comes down and leaves, m/s, and its rest, s.
ABOVE, DOWN, AWAY, REST = 2e-3, 0.1, 0.4, 0.3


@dataclass(frozen=True)
class Led:
    """Stroke along which a fingertip led the pins."""

    force: float
    """Largest total force, N."""
    absent: float
    """Share of rise and drag without contact."""
    rms: float
    """By which heights along the stroke vary, m."""

    def is_followed(self, method: str) -> bool:
        """Tell whether pins that a method controls followed it."""
        most = OF_METHOD_II if method == "cell_states" else MOST_FORCE
        return self.force <= most and self.absent <= MOST_ABSENT and self.rms <= MOST_RMS


def make_device(method: str, bed: str, preset: str) -> Scene:
    """Return a scene of a method on pins of a bed of `BEDS`, just enough for a stroke."""
    (rows, columns), kind = SIZE, BEDS[bed]
    return make_scene(preset, Layout(rows=rows, columns=columns, pitch=kind.pitch), method, kind.share)


def find_stated(scene: Scene, system: System) -> Tracking:
    """Return what the method of a scene states for strokes from a bed at rest."""
    tracking = find_tracking(scene, system)
    assert tracking is not None  # the methods here form a blister
    drag, push = tracking.limit_drag(RIDGE, pressed=False), tracking.limit_drag(-VALLEY, pressed=True)
    return replace(tracking, drag=drag, push=push)


def lead(scene: Scene, system: System, tracking: Tracking, height: float) -> Led:
    """Lead the pins along a stroke at a height over the bed at rest, m, and judge it."""
    corners = np.array(CORNERS) * scene.layout.pitch
    rest = scene.actuator.rest_height
    path, (pressed, dragged) = lay_stroke(rest, tracking, height, corners, system.period)
    forces, state = [], begin(system)
    with np.errstate(over="ignore", invalid="ignore"):
        for at in simulate_path(system, state, path[:, None]):
            forces.append(float(at.active.touched.force.sum()))
            state = at
    force, (start, end) = np.array(forces), corners[-2:]
    # Inside the last leg: its ends have the rounding of the fingertip.
    far, line = math.dist(start, end), (end - start) / math.dist(start, end)
    away = system.grid.positions.T[:2] - start[:, None]
    along, aside = line @ away, np.abs(np.array([-line[1], line[0]]) @ away)
    inside = (aside < 0.6 * scene.layout.pitch) & (along > 0.4 * far) & (along < 0.75 * far)
    absent = float(np.mean(force[pressed:dragged] <= 0.0))
    return Led(float(force.max()), absent, float(state.row(0)[inside].std()))


def lay_stroke(
    rest: float, tracking: Tracking, height: float, corners: Floats, period: float
) -> tuple[Floats, tuple[int, int]]:
    """Return poses (t + 1, 7) along a stroke, and in which periods its press and its drag end."""
    raised = height > 0.0
    down = rest - (tracking.press if raised else -height)
    top = rest + height - tracking.sink if raised else down
    z = np.append(np.arange(rest + ABOVE, rest, -DOWN * period), rest).tolist()
    while z[-1] > down:
        speed = min(tracking.sink_speed, math.sqrt(2.0 * SUDDEN * (z[-1] - down)))
        z.append(max(down, z[-1] - speed * period))
    pressed, climb = len(z), 0.0
    while z[-1] < top:
        slow = math.sqrt(2.0 * tracking.gain * (top - z[-1]))
        climb = min(tracking.lift, climb + tracking.gain * period, slow)
        z.append(min(top, z[-1] + climb * period))
    steps = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    speed = (tracking.drag if raised else tracking.push) * period
    way = np.concatenate([np.zeros(len(z)), np.arange(speed, steps.sum(), speed), [steps.sum()]])
    up = np.arange(top, rest + abs(height) + 0.1 * tracking.speed, max(AWAY, 5.0 * tracking.speed) * period)
    pressing, dragging, resting = len(z), len(way) - len(z), np.full(round(REST / period), up[-1])
    height_of = np.concatenate([z, np.full(dragging, top), up, resting])
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    gone = np.pad(way, (0, len(height_of) - len(way)), "edge")
    x, y = (np.interp(gone, knots, corners[:, axis]) for axis in (0, 1))
    path = np.column_stack([x, y, height_of, np.tile(LEVEL, (len(x), 1))])
    return path, (pressed, pressing + dragging)


def find_limit(scene: Scene, system: System, tracking: Tracking, name: str) -> tuple[float, Led]:
    """Return up to which speed, m/s, of a field of `Tracking` pins follow, 0: none; and how as stated."""
    stated, height = getattr(tracking, name), SPEEDS[name]
    led = first = lead(scene, system, tracking, height)
    held, speed = 0.0, stated
    for _ in range(TRIALS):
        if not led.is_followed(scene.method):
            break
        held, speed = speed, speed * STEP
        faster = replace(tracking, **{name: speed})  # whatever the pins ahead can do
        if name == "lift":  # in the same time
            faster = replace(faster, gain=min(tracking.gain * speed / stated, SUDDEN))
        led = lead(scene, system, faster, height)
    return held, first


#: Columns of the table.
COLUMNS = {
    "method": "method", "bed": "bed", "preset": "preset",
    **{f"{name}, mm/s": f"{name}_m_s .0f 1e3" for name in SPEEDS},
    **{f"limit of {name}": f"{name}_limit_m_s .0f 1e3" for name in SPEEDS},
    "force, N": "force_N .2f", "rms, mm": "rms_m .2f 1e3",
}  # fmt: skip


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure what each method states on each device."""
    devices: Sequence[tuple[str, str]] = DEVICES[2:3] if arguments.quick else DEVICES
    rows = []
    for method, (bed, preset) in steps.through(
        [(method, device) for method in METHODS for device in devices]
    ):
        scene = make_device(method, bed, preset)
        system = assemble(scene)
        tracking = find_stated(scene, system)
        row: dict[str, object] = {"method": method, "bed": bed, "preset": preset}
        found = {name: find_limit(scene, system, tracking, name) for name in SPEEDS}
        row |= {f"{name}_m_s": getattr(tracking, name) for name in SPEEDS}
        row |= {f"{name}_limit_m_s": limit for name, (limit, _) in found.items()}
        row |= {"force_N": max(led.force for _, led in found.values())}
        row |= {"rms_m": max(led.rms for _, led in found.values())}
        rows.append(row)
    title = (
        f"\nStated speeds, and the fastest at which pins follow a stroke {RIDGE * 1e3:g} mm high or "
        f"{-VALLEY * 1e3:g} mm deep\nwith a sharp turn: contact in all but {MOST_ABSENT:.0%} of the time, "
        f"at most {MOST_FORCE:g} N ({OF_METHOD_II:g} N with Method II),\nheights along it within "
        f"{MOST_RMS * 1e3:g} mm rms. 0: not as stated. Force and rms are the largest as stated.\n"
    )
    return Report([title, *tabulate(rows, COLUMNS)], rows)
