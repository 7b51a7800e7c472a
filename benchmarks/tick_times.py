"""Time of every single tick of a live session while a hand draws with the Press tool, and of its parts."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from digiclay.compat import bpy, scratch
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import accuracy, live_session, snapshot
from digiclay.device import view
from digiclay.live import bed_state, running, sculpting, tick
from digiclay.live.stroke import draw
from digiclay.live.stroke_queue import change_stroke, queue_stroke
from digiclay.operators.add_bed import add, select_only
from numpy.typing import NDArray

from .viewport_cost import settings

#: Ticks a second.
RATE = 60
#: What a tick does. The rest of it is in none of these; garbage is collected within any of them.
PARTS = ("read", "simulate", "monitor", "pack", "finger", "store", "show", "evaluate", "garbage")
#: Ticks that are not counted: the finger comes down, and everything is used for the first time.
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


def measure(rows: int, columns: int, pitch: float, bore: float, ticks: int) -> Ticks:
    """Add a bed, draw on it as a hand does, and time every tick.

    `rows`, `columns`: of the bed; `pitch`, `bore`, m; `ticks`: how many are timed.
    """
    found: dict[str, list[float]] = {name: [] for name in PARTS}
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
                            found[name].append(clock[name])
        finally:
            tick.stop(bed.session_uid)
    parts = {name: np.array(values) for name, values in found.items()}
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
