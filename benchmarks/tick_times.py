"""Benchmarks ``ticks`` and ``viewport``: a live session's tick in Blender, part by part, and its skin."""

import argparse
import gc
import os
import statistics
import time
import tracemalloc
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from digiclay import bridge
from digiclay.compat import bpy, scratch
from digiclay.core.base.arrays import Floats
from digiclay.core.model.layout import Layout
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import accuracy, live_session, snapshot
from digiclay.device import view
from digiclay.device.instant import Instant, find_ellipsoid
from digiclay.device.node_tree import MEMBRANE
from digiclay.live import beds as live_beds
from digiclay.live import tick
from digiclay.operators.add_bed import add, select_only
from digiclay.panels import display
from digiclay.plots.figure import INK
from digiclay.sessions import running, sculpting
from digiclay.sessions.sculpting import change_stroke, queue_stroke
from digiclay.settings import properties
from digiclay.settings.devices import make_scene
from digiclay.strokes.stroke import draw, start

from .report import BLUE, RED, Report, Row, Steps, tabulate

#: What a tick does. The rest of it is in none of these; garbage is collected within any of them.
PARTS = ("read", "simulate", "monitor", "pack", "finger", "store", "show", "evaluate", "garbage")
#: Ticks that are not counted: the fingertip comes down, and everything is used for the first time.
WARM_UP = 90
#: Share of the time between ticks that their control periods may take: no limit.
EVERY_PERIOD = 1e9


@dataclass(frozen=True, eq=False)
class Ticks:
    """Times of some ticks, s, (t,)."""

    elapsed: Floats
    spent: Floats
    """(t,): Of each tick, its evaluation included, by the wall and by the processor."""
    parts: dict[str, Floats]
    """(t,): Of each of `PARTS`."""


@contextmanager
def open_session(scene: Scene) -> Iterator[Any]:
    """Give a bed with a session in the open file, and take both away again."""
    with settings(), scratch():
        bed = add(bpy.context, scene)
        select_only(bpy.context, bed)
        tick.start(bpy.context, bed)
        try:
            yield bed
        finally:
            tick.stop(bed.session_uid)


@contextmanager
def settings() -> Iterator[None]:
    """Register the settings of beds within the block, unless the extension is enabled."""
    if hasattr(bpy.types.Object, "digiclay"):
        yield
        return
    properties.register()
    display.register()
    try:
        yield
    finally:
        display.unregister()
        properties.unregister()


def _find_session(bed: Any) -> running.Running:
    session = running.find(bed)
    assert session is not None
    return session


def time_ticks(move: Callable[[int], None], span: float, ticks: int) -> Ticks:
    """Time ticks of the open sessions, `span` s apart; `move`: moves the fingertip."""
    whole, rows = [], []
    with _time_parts() as spent:
        for count in range(WARM_UP + ticks):
            move(count)
            spent.clear()
            began = time.perf_counter(), time.process_time()
            tick.tick(bpy.context, count * span)
            evaluating = time.process_time()
            bpy.context.evaluated_depsgraph_get()
            spent["evaluate"] += time.process_time() - evaluating
            whole.append((time.perf_counter() - began[0], time.process_time() - began[1]))
            spent["simulate"] -= spent["monitor"] + spent["pack"]
            rows.append([spent[name] for name in PARTS])
    elapsed, processor = np.array(whole[WARM_UP:]).T
    return Ticks(elapsed, processor, dict(zip(PARTS, np.array(rows[WARM_UP:]).T, strict=True)))


@contextmanager
def _time_parts() -> Iterator[defaultdict[str, float]]:
    """Time the parts of ticks, on the session's own functions, until the context is left."""
    spent: defaultdict[str, float] = defaultdict(float)
    active: set[str] = set()

    def add_time(part: str, function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
        # The outermost call of a part counts.
        if part in active:
            return function(*arguments, **named)
        active.add(part)
        began = time.process_time()
        try:
            return function(*arguments, **named)
        finally:
            active.discard(part)
            spent[part] += time.process_time() - began

    def watch(phase: str, _: dict[str, int]) -> None:
        spent["garbage"] += time.process_time() * (-1.0 if phase == "start" else 1.0)

    with ExitStack() as left:
        for module, name, part in (
            (tick, "_read_changes", "read"),
            (sculpting, "advance", "simulate"),
            (accuracy, "note", "monitor"),
            (accuracy, "catch_up", "monitor"),
            (accuracy, "begin_stretch", "monitor"),
            (snapshot, "dump", "pack"),
            (tick, "_move_fingers", "finger"),
            (tick, "_evaluate", "evaluate"),
            (live_beds, "write", "store"),
            (view, "show_state", "show"),
        ):
            timed = partial(add_time, part, getattr(module, name))
            left.enter_context(patch.object(module, name, timed))
        # Every control period that is due is simulated, however little of the machine others leave,
        # and all that the hand has drawn: a tick that leaves some out takes less time than it is to
        # be measured with.
        left.enter_context(patch.object(live_session, "SHARE", EVERY_PERIOD))
        left.enter_context(patch.object(live_session, "find_spare", lambda *_: EVERY_PERIOD))
        gc.callbacks.append(watch)
        left.callback(gc.callbacks.remove, watch)
        yield spent


# Ticks while a hand draws


class Bed(NamedTuple):
    """Bed on which a hand draws."""

    rows: int
    columns: int
    pitch: float
    bore: float
    """Pitch of the pins, and their bore, m."""
    goal: float
    """Time that 99 of 100 ticks are to keep to, s."""


BEDS = (
    Bed(25, 25, 3e-3, 2e-3, 8e-3), Bed(100, 100, 3e-3, 2e-3, 16e-3), Bed(100, 100, 1.5e-3, 1e-3, 16e-3),
    Bed(200, 200, 3e-3, 2e-3, 32e-3),
)  # fmt: skip
#: Ticks that are timed, with --quick and without.
QUICK, FULL = 120, 3000
#: Shares of the ticks whose times are given; the last one is the largest time.
SHARES = (0.5, 0.9, 0.99, 0.999, 1.0)
NAMES = ("median", "90 %", "99 %", "99.9 %", "largest")
#: Ticks a second.
RATE = 60
#: The hand draws circles of this radius, m, each in so many ticks, and presses so deep, m.
RADIUS, ROUND, DEPTH = 12e-3, 120, 4e-3


def draw_circles(rows: int, columns: int, pitch: float, bore: float, ticks: int) -> Ticks:
    """Add a bed, draw circles on it as a hand does, and time `ticks` ticks; `pitch`, `bore`, m."""

    def place(count: int) -> tuple[float, float]:
        turn = 2.0 * np.pi * count / ROUND
        return float(RADIUS * np.cos(turn)), float(RADIUS * np.sin(turn))

    def move(count: int) -> None:
        x, y = place(count)
        drawn = partial(draw, x=x, y=y, depth=DEPTH)
        running.put(change_stroke(_find_session(bed), number, drawn))

    layout = {"rows": rows, "columns": columns, "pitch": pitch}
    with open_session(resolve({"layout": layout, "actuator": {"bore": bore}})) as bed:
        session, number = queue_stroke(_find_session(bed), start(0, *place(0), DEPTH))
        running.put(session)
        return time_ticks(move, 1.0 / RATE, ticks)


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure ticks while a hand draws, on every bed, on one core."""
    keep_to_one_core()
    count = QUICK if arguments.quick else FULL
    keys = [f"share_{share:g}_s" for share in SHARES]
    columns = {
        "": "part",
        **{name: f"{key} .2f 1e3" for name, key in zip(NAMES, keys, strict=True)},
    }
    rows: list[Row] = []
    histograms: dict[str, tuple[Floats, float]] = {}
    lines = [
        f"\nTicks of a live session at {RATE} a second while a hand draws with the Press tool; one core,",
        "without drawing. Processor time, ms. evaluate: Blender's geometry nodes; pack and store: the state",
        "for undo and files; monitor: estimate of the error; other: what is in no part.",
    ]
    for bed in steps.through(BEDS, lambda bed: f"{bed.rows} x {bed.columns}"):
        parts = list_parts(draw_circles(*bed[:4], count))
        of_bed = [
            {
                "rows": bed.rows,
                "columns": bed.columns,
                "pitch_m": bed.pitch,
                "ticks": count,
                "part": name,
                **dict(zip(keys, np.quantile(times, SHARES), strict=True)),
            }
            for name, times in parts.items()
        ]
        spent = parts["whole tick"]
        name = f"{bed.rows} x {bed.columns} at {1e3 * bed.pitch:g} mm, {count} ticks"
        kept_to = 100.0 * np.mean(spent < bed.goal)
        lines += [
            f"\n{name}; {kept_to:.2f} % under {1e3 * bed.goal:g} ms\n",
            *tabulate(of_bed, columns),
        ]
        histograms[name] = spent, bed.goal
        rows += of_bed
    return Report(lines, rows, partial(_draw, beds=histograms), (7.2, 2.1 * len(BEDS)))


def keep_to_one_core() -> None:
    """Limit all threads of the process to one core, where the system lets it; Blender has begun some."""
    if hasattr(os, "sched_setaffinity"):
        core = {min(os.sched_getaffinity(0))}
        for thread in os.listdir("/proc/self/task"):
            os.sched_setaffinity(int(thread), core)


def list_parts(bed: Ticks) -> dict[str, Floats]:
    """Return the times of a bed's ticks, s, by the lines of the report."""
    rest = bed.spent - sum(times for name, times in bed.parts.items() if name != "garbage")
    return {"whole tick": bed.spent, **bed.parts, "other": rest, "whole, elapsed time": bed.elapsed}


def _draw(figure: Any, beds: dict[str, tuple[Floats, float]]) -> None:
    """Draw how the times of the ticks are distributed, one panel a bed; by name: times and their goal, s."""
    panels = figure.subplots(len(beds), 1, sharex=True, squeeze=False).ravel()
    highest = 1e3 * max(max(float(spent.max()), goal) for spent, goal in beds.values())
    for panel, (name, (spent, goal)) in zip(panels, beds.items(), strict=True):
        panel.hist(1e3 * spent, np.arange(0.0, highest + 0.5, 0.25), color=BLUE, log=True)
        panel.axvline(1e3 * goal, color=RED, linestyle="--", label=f"goal: {1e3 * goal:g} ms")
        share = 1e3 * float(np.quantile(spent, 0.99))
        panel.axvline(share, color=INK, linestyle=":", label=f"99 %: {share:.1f} ms")
        panel.set(title=name, ylabel="ticks in 0.25 ms")
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)
    panels[-1].set_xlabel("processor time of a tick, ms")


# Ticks while a fingertip is dragged, the memory they leave, and the skin

#: Rows and columns of the beds, and the time a tick of them may take, s.
VIEWPORT = ((25, 25, 5e-3), (100, 100, 10e-3), (250, 400, 40e-3))
#: Ticks that are timed, with --quick and without, and the time between two, s.
FEW, MANY, SPAN = 40, 200, 33e-3
#: Parts of the report, each of some of `PARTS`.
STAGES = {
    "read": ("read",),
    "simulate": ("simulate", "monitor"),
    "keep": ("pack", "finger", "store"),
    "write": ("show",),
    "evaluate": ("evaluate",),
}
#: Size of the circle the pressed fingertip draws, m, and how deep below the pins at rest, m.
CIRCLE, PRESSED = 8e-3, 5e-3
#: How often memory is read in as many ticks as are timed; each time garbage is collected.
READINGS = 6
#: What is drawn, by turns: form, and kind of skin.
SHOWN = (("pins", "smooth"), ("skin", "smooth"), ("skin", "membrane"), ("both", "smooth"))
#: Evaluations in a row before another form has its turn; the first of them is not counted.
IN_A_ROW = 6


def measure_viewport(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every bed."""
    ticks = FEW if arguments.quick else MANY
    rows = [
        {**measure_bed(*bed[:2], ticks), "goal_s": bed[2], **measure_skin(*bed[:2], ticks)}
        for bed in steps.through(VIEWPORT, lambda bed: f"{bed[0] * bed[1]} pins")
    ]
    first = {
        "pins": "pins d",
        **{name: f"{name}_s .2f 1e3" for name in STAGES},
        "tick": "tick_s .2f 1e3",
        "goal": "goal_s g 1e3",
        "95 % within": "tick_95_s .2f 1e3",
        "memory grown, kB": "growth_bytes .1f 1e-3",
    }
    skins = {
        "pins alone" if shown == "pins" else f"{shown}, {kind}": f"{shown}_{kind}_s .2f 1e3"
        for shown, kind in SHOWN
    }
    lines = [
        "\nA tick of a live session: 33 ms of simulated time while a fingertip presses and drags; medians.",
        "read: the fingertip's place; keep: the state into the bed, for undo and files; write: pins;",
        "evaluate: Blender's geometry nodes, without drawing. Processor time of the parts, elapsed time of",
        "the tick, ms.\n",
        *tabulate(rows, first, left=0),
        "\nAll pins moved, forms by turns: processor time of the geometry nodes, medians, ms.\n",
        *tabulate(rows, {"pins": "pins d", **skins}, left=0),
    ]
    return Report(lines, rows)


def measure_bed(rows: int, columns: int, ticks: int) -> dict[str, float]:
    """Add a bed, press and drag its fingertip, and time `ticks` ticks of its session, s."""

    def move(count: int) -> None:
        scene, turn = _find_session(bed).scene, 2.0 * np.pi * count / ROUND
        down = min(count / (0.8 * WARM_UP), 1.0) * (PRESSED + 2e-3)
        height = scene.actuator.rest_height + 2e-3 - down
        pose = np.array([CIRCLE * np.cos(turn), CIRCLE * np.sin(turn), height, 1.0, 0.0, 0.0, 0.0])
        bridge.place_fingertips(bed, pose[None], [find_ellipsoid(scene)])
        bpy.context.view_layer.update()

    with open_session(
        make_scene("paper", Layout(rows=rows, columns=columns), "virtual_master")
    ) as bed:
        timed = time_ticks(move, SPAN, ticks)
        growth = _measure_growth(move, WARM_UP + ticks, ticks)
    parts = {
        f"{stage}_s": float(np.median(sum(timed.parts[name] for name in names)))
        for stage, names in STAGES.items()
    }
    whole = {
        "tick_s": float(np.median(timed.elapsed)),
        "tick_95_s": float(np.quantile(timed.elapsed, 0.95)),
    }
    return {"pins": rows * columns, **parts, **whole, "growth_bytes": growth}


def _measure_growth(move: Callable[[int], None], first: int, ticks: int) -> int:
    """Return by how much Python's least memory has risen from some ticks to as many later, bytes.

    The least, because a session's arrays and its monitor of the error come and go; a leak never
    goes. The first of three rounds replaces what was allocated before the counting began.
    """
    tracemalloc.start()
    try:
        floors = []
        for part in range(3):
            sizes = []
            for count in range(ticks):
                move(first + part * ticks + count)
                tick.tick(bpy.context, SPAN * (first + part * ticks + count))
                bpy.context.evaluated_depsgraph_get()
                if count % max(ticks // READINGS, 1) == 0:
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
            floors.append(min(sizes))
    finally:
        tracemalloc.stop()
    return floors[2] - floors[1]


def measure_skin(rows: int, columns: int, updates: int) -> dict[str, float]:
    """Move all pins of a bed, and time Blender's evaluation of each form, at least `updates` times, s."""
    instant = Instant.at_rest(Layout(rows=rows, columns=columns))
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, len(instant.height)))
    spent: list[list[float]] = [[] for _ in SHOWN]
    with scratch():
        bed = view.build(instant, bpy.context.scene.collection)
        while len(spent[0]) < updates:
            for times, (shown, kind) in zip(spent, SHOWN, strict=True):
                view.set_form(bed, shown)
                view.write_setting(bed, MEMBRANE, kind == "membrane")
                for count in range(IN_A_ROW):
                    bridge.write_cells(
                        bed.data, instant.position, instant.height + noise[count % 2]
                    )
                    started = time.process_time()
                    bpy.context.evaluated_depsgraph_get()
                    if count:
                        times.append(time.process_time() - started)
    return {
        f"{s}_{kind}_s": statistics.median(t) for (s, kind), t in zip(SHOWN, spent, strict=True)
    }
