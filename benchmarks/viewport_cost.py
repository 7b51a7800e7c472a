"""Benchmark ``viewport``: time of a tick of a live session in Blender, part by part, and of its skin."""

from __future__ import annotations

import argparse
import gc
import statistics
import time
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from digiclay import bridge
from digiclay.commands.progress import table
from digiclay.compat import bpy, scratch
from digiclay.core.model.layout import Layout
from digiclay.device import form, view
from digiclay.device.instant import Instant, find_ellipsoid
from digiclay.live import bed_state, tick
from digiclay.live.beds import blocking_reason
from digiclay.operators.add_bed import add, select_only
from digiclay.panels import display
from digiclay.sessions import running, sculpting
from digiclay.settings import properties
from digiclay.settings.devices import make_scene

from .report import Report, Steps

#: Rows and columns of the beds, and the time a tick of them may take, s.
BEDS = ((25, 25, 5e-3), (100, 100, 10e-3), (250, 400, 40e-3))
#: Ticks that are timed, with --quick and without.
QUICK, FULL = 40, 200
#: What is drawn, by turns: form, and kind of skin.
SHOWN = (("pins", "smooth"), ("skin", "smooth"), ("skin", "membrane"), ("both", "smooth"))
#: Evaluations in a row before another form has its turn; the first of them is not counted.
IN_A_ROW = 6


@dataclass(frozen=True)
class SkinCost:
    """Median processor times for one bed, all threads together, s.

    Attributes
    ----------
    evaluate : tuple of float
        For each of `SHOWN`.
    """

    pins: int
    evaluate: tuple[float, ...]


def measure_skin(rows: int, columns: int, updates: int) -> SkinCost:
    """Move all pins of a bed, and time Blender's evaluation of each form, at least `updates` times."""
    instant = Instant.at_rest(Layout(rows=rows, columns=columns))
    noise = 1e-3 * np.random.default_rng(0).standard_normal((2, len(instant.height)))
    spent: list[list[float]] = [[] for _ in SHOWN]
    with scratch():
        bed = view.build(instant, bpy.context.scene.collection)
        while len(spent[0]) < updates:
            for times, (shown, kind) in zip(spent, SHOWN, strict=True):
                form.set_form(bed, shown)
                form.set_kind(bed, kind)
                for count in range(IN_A_ROW):
                    bridge.write_cells(bed.data, instant.position, instant.height + noise[count % 2])
                    started = time.process_time()
                    bpy.context.evaluated_depsgraph_get()
                    if count:
                        times.append(time.process_time() - started)
    return SkinCost(rows * columns, tuple(statistics.median(times) for times in spent))


#: Time of the wall between two ticks, s.
TICK = 33e-3
#: What a tick does, in this order.
PARTS = ("read", "simulate", "keep", "write", "evaluate")
#: Ticks that are not counted: the fingertip comes down, and everything is used for the first time.
WARM_UP = 30
#: Size of the circle the pressed finger draws, m, and how many ticks it takes to go round.
CIRCLE, ROUND = 8e-3, 120
#: How deep below the pins at rest, m.
DEPTH = 5e-3
#: How often about memory is read in as many ticks as are timed; each time garbage is collected.
READINGS = 6


@dataclass(frozen=True)
class Cost:
    """Cost of the ticks of one bed.

    Attributes
    ----------
    parts : dict
        Median time of each of `PARTS`, s.
    whole : float
        Median time of a whole tick with its evaluation, s.
    worst : float
        Time that 95 % of the ticks keep to, s.
    growth : float
        See `_measure_growth`, bytes.
    """

    pins: int
    parts: dict[str, float]
    whole: float
    worst: float
    growth: int


def measured(rows: int, columns: int, ticks: int) -> Cost:
    """Add a bed, press and drag its fingertip, and time `ticks` ticks of its session."""
    with _session(rows, columns) as bed:
        for count in range(WARM_UP):
            _time_tick(bed, count)
        whole = [_time_tick(bed, count) for count in range(WARM_UP, WARM_UP + ticks)]
        parts = [_time_parts(bed, count) for count in range(WARM_UP + ticks, WARM_UP + 2 * ticks)]
        growth = _measure_growth(bed, WARM_UP + 2 * ticks, ticks)
    spent = {name: statistics.median(part[name] for part in parts) for name in PARTS}
    worst = float(np.quantile(whole, 0.95))
    return Cost(rows * columns, spent, statistics.median(whole), worst, growth)


@contextmanager
def _session(rows: int, columns: int) -> Iterator[Any]:
    """Give a bed with a session in the open file, and take both away again."""
    with settings(), scratch():
        bed = add(bpy.context, make_scene("paper", Layout(rows=rows, columns=columns), "virtual_master"))
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


def _move(bed: Any, count: int) -> None:
    """Put the fingertip where it is at a tick: down, and round and round."""
    tip = view.fingertip_of(bed)
    turn = 2.0 * np.pi * count / ROUND
    session = running.find(bed)
    assert session is not None
    rest = session.scene.actuator.rest_height
    down = min(count / (0.8 * WARM_UP), 1.0) * (DEPTH + 2e-3)
    pose = np.array([CIRCLE * np.cos(turn), CIRCLE * np.sin(turn), rest + 2e-3 - down, 1.0, 0.0, 0.0, 0.0])
    bridge.place_fingertip(tip, pose, find_ellipsoid(session.scene))
    bpy.context.view_layer.update()


def _time_tick(bed: Any, count: int) -> float:
    """Return what a whole tick takes, s."""
    _move(bed, count)
    started = time.perf_counter()
    tick.tick(bpy.context, TICK * count)
    bpy.context.evaluated_depsgraph_get()
    return time.perf_counter() - started


def _time_parts(bed: Any, count: int) -> dict[str, float]:
    """Return what the parts of a tick take, s."""
    _move(bed, count)
    session = running.find(bed)
    assert session is not None
    moments = [time.perf_counter()]
    blocking_reason(bpy.context, bed)
    pose = bridge.pose(view.fingertip_of(bed))
    moments.append(time.perf_counter())
    later = sculpting.advance(session, pose, TICK * count, 1000)
    moments.append(time.perf_counter())
    running.put(later)
    bed_state.write(bed, later, session)
    moments.append(time.perf_counter())
    view.show_state(bed, later.system, later.state)
    moments.append(time.perf_counter())
    bpy.context.evaluated_depsgraph_get()
    moments.append(time.perf_counter())
    return dict(zip(PARTS, np.diff(moments).tolist(), strict=True))


def _measure_growth(bed: Any, first: int, ticks: int) -> int:
    """Return by how much Python's least memory has risen from some ticks to as many later, bytes.

    The least, because a session's arrays and its monitor of the error come and go; a leak never goes.
    The first of three rounds replaces what was allocated before the counting began.
    """
    tracemalloc.start()
    try:
        floors = []
        for part in range(3):
            sizes = []
            for count in range(ticks):
                _time_tick(bed, first + part * ticks + count)
                if count % max(ticks // READINGS, 1) == 0:
                    gc.collect()
                    sizes.append(tracemalloc.get_traced_memory()[0])
            floors.append(min(sizes))
    finally:
        tracemalloc.stop()
    return floors[2] - floors[1]


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every bed."""
    ticks = QUICK if arguments.quick else FULL
    costs, skins = [], []
    for rows, columns, _ in steps.through(BEDS, lambda bed: f"{bed[0] * bed[1]} pins"):
        costs.append(measured(rows, columns, ticks))
        skins.append(measure_skin(rows, columns, ticks))
    head = ("pins", *(f"{name}_s" for name in PARTS), "tick_s", "tick_95_s", "growth_bytes")
    head = (*head, *(f"{shown}_{kind}_s" for shown, kind in SHOWN))
    figures = [
        [one.pins, *(one.parts[name] for name in PARTS), one.whole, one.worst, one.growth, *skin.evaluate]
        for one, skin in zip(costs, skins, strict=True)
    ]
    return Report(
        [*_list_lines(costs), *_list_skins(skins)], head, figures, program=f"Blender {bpy.app.version_string}"
    )


def _list_lines(costs: list[Cost]) -> Iterator[str]:
    """Give the lines of the report."""
    yield "\nA tick of a live session: 33 ms of simulated time while a fingertip presses and drags; medians."
    yield "read: the fingertip's place; keep: the state into the bed, for undo and files; write: pins;"
    yield "evaluate: Blender's geometry nodes, without drawing. Times in ms.\n"
    head = ("pins", *PARTS, "tick", "goal", "95 % within", "memory grown, kB")
    rows = [
        [
            f"{one.pins}", *(f"{1e3 * one.parts[name]:.2f}" for name in PARTS), f"{1e3 * one.whole:.2f}",
            f"{1e3 * goal:g}", f"{1e3 * one.worst:.2f}", f"{one.growth / 1e3:.1f}",
        ]
        for one, (_, _, goal) in zip(costs, BEDS, strict=True)
    ]  # fmt: skip
    yield from table(head, rows, left=0)


def _list_skins(costs: list[SkinCost]) -> Iterator[str]:
    """Give the lines about the live skin."""
    yield "\nAll pins moved, forms by turns: processor time of the geometry nodes, medians, ms.\n"
    head = ("pins", *("pins alone" if form == "pins" else f"{form}, {kind}" for form, kind in SHOWN))
    rows = [[f"{one.pins}", *(f"{1e3 * spent:.2f}" for spent in one.evaluate)] for one in costs]
    yield from table(head, rows, left=0)
