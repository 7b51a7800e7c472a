"""Benchmark ``ticks``: distribution of the time of a live session's tick while a hand draws, part by part."""

from __future__ import annotations

import argparse
import gc
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from digiclay.commands.progress import table
from digiclay.compat import bpy, scratch
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import accuracy, live_session, snapshot
from digiclay.device import view
from digiclay.live import bed_state, tick
from digiclay.operators.add_bed import add, select_only
from digiclay.plots.figure import empty
from digiclay.sessions import running, sculpting
from digiclay.sessions.stroke_queue import change_stroke, queue_stroke
from digiclay.strokes.stroke import draw
from numpy.typing import NDArray

from .report import BLUE, INK, RED, STYLE, Report, Steps
from .viewport_cost import settings

#: Rows and columns of the beds, their pitch and the bore of their pins, m, and the time that 99 of 100 ticks
#: are to keep to, s.
BEDS = ((25, 25, 3e-3, 2e-3, 8e-3), (100, 100, 3e-3, 2e-3, 16e-3), (100, 100, 1.5e-3, 1e-3, 16e-3))
#: Ticks that are timed, with --quick and without.
QUICK, FULL = 120, 3000
#: Shares of the ticks whose times are given; the last one is the largest time.
SHARES = (0.5, 0.9, 0.99, 0.999, 1.0)
NAMES = ("median", "90 %", "99 %", "99.9 %", "largest")
#: Ticks a second.
RATE = 60
#: What a tick does. The rest of it is in none of these; garbage is collected within any of them.
PARTS = ("read", "simulate", "monitor", "pack", "finger", "store", "show", "evaluate", "garbage")
#: Ticks that are not counted: the fingertip comes down, and everything is used for the first time.
WARM_UP = 90
#: The hand draws circles of this radius, m, each in so many ticks, and presses so deep, m.
RADIUS, ROUND, DEPTH = 12e-3, 120, 4e-3
#: Share of the time between ticks that their control periods may take: no limit.
EVERY_PERIOD = 1e9


@dataclass(frozen=True, eq=False)
class Ticks:
    """Times of some ticks of one bed.

    Attributes
    ----------
    rows, columns : int
        Of the bed.
    pitch : float
        m.
    elapsed : ndarray (t,)
        Of each tick, its evaluation included, by the wall, s.
    spent : ndarray (t,)
        The same by the processor's time of this process, s: what others use of the machine is not in it.
    parts : dict of ndarray (t,)
        Processor's time of each of `PARTS`, s.
    """

    rows: int
    columns: int
    pitch: float
    elapsed: NDArray[np.float64]
    spent: NDArray[np.float64]
    parts: dict[str, NDArray[np.float64]]

    @property
    def name(self) -> str:
        """The bed, in words."""
        return f"{self.rows} x {self.columns} at {1e3 * self.pitch:g} mm"


def time_ticks(rows: int, columns: int, pitch: float, bore: float, ticks: int) -> Ticks:
    """Add a bed, draw on it as a hand does, and time `ticks` ticks; `pitch`, `bore`, m."""
    spent_in: dict[str, list[float]] = {name: [] for name in PARTS}
    elapsed, spent = [], []
    with settings(), scratch():
        scene = resolve(
            {"layout": {"rows": rows, "columns": columns, "pitch": pitch}, "actuator": {"bore": bore}}
        )
        bed = add(bpy.context, scene)
        select_only(bpy.context, bed)
        tick.start(bpy.context, bed)
        try:
            with _time_parts() as clock:
                number = _begin_stroke(bed)
                for count in range(WARM_UP + ticks):
                    _draw_on(bed, number, count)
                    clock.clear()
                    began = time.perf_counter(), time.process_time()
                    tick.tick(bpy.context, count / RATE)
                    evaluating = time.process_time()
                    bpy.context.evaluated_depsgraph_get()
                    ended = time.perf_counter(), time.process_time()
                    if count >= WARM_UP:
                        clock["evaluate"] += ended[1] - evaluating
                        clock["simulate"] -= clock["monitor"] + clock["pack"]
                        elapsed.append(ended[0] - began[0])
                        spent.append(ended[1] - began[1])
                        for name in PARTS:
                            spent_in[name].append(clock[name])
        finally:
            tick.stop(bed.session_uid)
    parts = {name: np.array(values) for name, values in spent_in.items()}
    return Ticks(rows, columns, pitch, np.array(elapsed), np.array(spent), parts)


def _place(count: int) -> tuple[float, float]:
    """Return where the hand is at a tick, m."""
    turn = 2.0 * np.pi * count / ROUND
    return float(RADIUS * np.cos(turn)), float(RADIUS * np.sin(turn))


def _begin_stroke(bed: Any) -> int:
    """Put the mouse down; return the number of the stroke."""
    session = running.find(bed)
    assert session is not None
    session, number = queue_stroke(session, *_place(0), DEPTH)
    running.put(session)
    return number


def _draw_on(bed: Any, number: int, count: int) -> None:
    """Move the mouse on to where it is at a tick."""
    session, (x, y) = running.find(bed), _place(count)
    assert session is not None
    drawn = partial(draw, time=(count + 1) / RATE, x=x, y=y, depth=DEPTH)
    running.put(change_stroke(session, number, drawn))


class _Clock(dict[str, float]):
    """Processor's time by part, s; nothing counts as 0.

    Attributes
    ----------
    running : set of str
        Parts that are in progress.
    """

    def __init__(self) -> None:
        super().__init__()
        self.running: set[str] = set()

    def __missing__(self, name: str) -> float:
        return 0.0


@contextmanager
def _time_parts() -> Iterator[_Clock]:
    """Time the parts of ticks, on the session's own functions, until the context is left."""
    clock = _Clock()
    places = [
        (tick, "_read_changes", "read"), (sculpting, "advance", "simulate"), (accuracy, "note", "monitor"),
        (accuracy, "catch_up", "monitor"), (accuracy, "begin_stretch", "monitor"),
        (snapshot, "dump", "pack"), (tick, "_move_finger", "finger"),
        (tick, "_evaluate", "evaluate"), (bed_state, "write", "store"), (view, "show_state", "show"),
    ]  # fmt: skip
    former: list[tuple[Any, str, Any]] = [(module, name, getattr(module, name)) for module, name, _ in places]
    for module, name, part in places:
        setattr(module, name, _timed(clock, part, getattr(module, name)))
    # Every control period that is due is simulated, however little of the machine others leave: a tick that
    # leaves some out takes less time than it is to be measured with.
    former.append((live_session, "SHARE", live_session.SHARE))
    live_session.SHARE = EVERY_PERIOD
    watch = _watch_garbage(clock)
    gc.callbacks.append(watch)
    try:
        yield clock
    finally:
        gc.callbacks.remove(watch)
        for module, name, function in former:
            setattr(module, name, function)


def _timed(clock: _Clock, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that adds its time to a part; the outermost call of the part counts."""

    def timed(*arguments: Any, **named: Any) -> Any:
        if part in clock.running:
            return function(*arguments, **named)
        clock.running.add(part)
        began = time.process_time()
        try:
            return function(*arguments, **named)
        finally:
            clock.running.discard(part)
            clock[part] += time.process_time() - began

    return timed


def _watch_garbage(clock: _Clock) -> Callable[[str, dict[str, int]], None]:
    """Return what adds the time of each collection of garbage."""
    began = 0.0

    def watch(phase: str, _told: dict[str, int]) -> None:
        nonlocal began
        if phase == "start":
            began = time.process_time()
        else:
            clock["garbage"] += time.process_time() - began

    return watch


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure every bed on one core."""
    keep_to_one_core()
    count, beds = QUICK if arguments.quick else FULL, []
    for rows, columns, pitch, bore, _ in steps.through(BEDS, lambda bed: f"{bed[0]} x {bed[1]}"):
        beds.append(time_ticks(rows, columns, pitch, bore, count))
    head = ("rows", "columns", "pitch_m", "ticks", "part", *(f"share_{share:g}_s" for share in SHARES))
    figures = [
        [bed.rows, bed.columns, bed.pitch, count, name, *np.quantile(times, SHARES)]
        for bed in beds
        for name, times in list_parts(bed).items()
    ]
    return Report(
        _list_lines(beds), head, figures, lambda: _draw(beds), program=f"Blender {bpy.app.version_string}"
    )


def keep_to_one_core() -> None:
    """Limit all threads of the process to one core, where the system lets it; Blender has begun some."""
    if hasattr(os, "sched_setaffinity"):
        core = {min(os.sched_getaffinity(0))}
        for thread in os.listdir("/proc/self/task"):
            os.sched_setaffinity(int(thread), core)


def _list_lines(beds: Sequence[Ticks]) -> Iterator[str]:
    """Give the lines of the report."""
    yield f"\nTicks of a live session at {RATE} a second while a hand draws with the Press tool; one core,"
    yield "without drawing. Processor time, ms. evaluate: Blender's geometry nodes; pack and store: the state"
    yield "for undo and files; monitor: estimate of the error; other: what is in no part."
    for bed, (_, _, _, _, goal) in zip(beds, BEDS, strict=True):
        kept_to = 100.0 * np.mean(bed.spent < goal)
        yield f"\n{bed.name}, {len(bed.spent)} ticks; {kept_to:.2f} % under {1e3 * goal:g} ms\n"
        rows = [
            [name, *(f"{1e3 * time:.2f}" for time in np.quantile(times, SHARES))]
            for name, times in list_parts(bed).items()
        ]
        yield from table(("", *NAMES), rows)


def list_parts(bed: Ticks) -> dict[str, Any]:
    """Return the times of a bed's ticks, s, by the lines of the report."""
    rest = bed.spent - sum(times for name, times in bed.parts.items() if name != "garbage")
    return {"whole tick": bed.spent, **bed.parts, "other": rest, "whole, elapsed time": bed.elapsed}


def _draw(beds: Sequence[Ticks]) -> Any:
    """Draw how the times of the ticks are distributed, one panel a bed."""
    goals = [bed[-1] for bed in BEDS]
    with empty(7.2, 2.1 * len(beds), STYLE, layout="constrained") as figure:
        panels = figure.subplots(len(beds), 1, sharex=True, squeeze=False).ravel()
        highest = 1e3 * max(*(float(bed.spent.max()) for bed in beds), *goals)
        bins = np.arange(0.0, highest + 0.5, 0.25)
        for panel, bed, goal in zip(panels, beds, goals, strict=True):
            panel.hist(1e3 * bed.spent, bins, color=BLUE, log=True)
            panel.axvline(1e3 * goal, color=RED, linestyle="--", label=f"goal: {1e3 * goal:g} ms")
            share = 1e3 * float(np.quantile(bed.spent, 0.99))
            panel.axvline(share, color=INK, linestyle=":", label=f"99 %: {share:.1f} ms")
            panel.set(title=f"{bed.name}, {len(bed.spent)} ticks", ylabel="ticks in 0.25 ms")
            panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.0)
        panels[-1].set_xlabel("processor time of a tick, ms")
        return figure
