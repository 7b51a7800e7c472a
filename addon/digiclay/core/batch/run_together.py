"""Sessions of many scenes in one call."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ..base.arrays import Floats
from ..base.errors import DigiclayError
from ..engine.simulation import repeat_period
from ..engine.system import System
from ..scene.assembly import assemble
from ..scene.recorder import Recorder
from ..scene.schema import Scene
from ..session.accuracy import Errors, compare, has_every_command, make_reference
from ..session.memory_limit import check_memory
from ..session.run_result import Result
from .advance import make_divergence_error
from .play import Instant, Play, begin_play, keep_runs, locate_fingers, play_all
from .recording import Histories, Sums

Outcome = Result | DigiclayError


class _Observer(Protocol):
    """Observer of the sessions after each control period, from which their results come."""

    def observe(self, now: Instant) -> None: ...

    def finish(self, now: Instant, index: int) -> Result: ...


@dataclass(frozen=True, eq=False)
class Monitor:
    """References that follow sessions through every control period; see `accuracy.ErrorMonitor`.

    Attributes
    ----------
    play : Play
        The references.
    largest : ndarray (3, b)
        From `accuracy.compare`, so far.
    """

    play: Play
    largest: Floats


def _start(scenes: Mapping[int, Scene]) -> Monitor:
    """Return the monitor of sessions before their first control period."""
    references = {run: make_reference(scene) for run, scene in scenes.items()}
    systems = {run: assemble(scene) for run, scene in references.items()}
    return Monitor(begin_play(references, systems), np.zeros((3, len(scenes))))


def _follow(monitor: Monitor, leader: Play) -> Monitor:
    """Integrate the control period that sessions have just done."""
    play, largest = monitor.play, monitor.largest
    if leader.runs != play.runs:
        largest = largest[:, [play.runs.index(run) for run in leader.runs]]
        play = keep_runs(play, leader.runs)
    play = locate_fingers(play)
    finger = play.coming and play.coming.at(play.state.period)
    play = replace(play, state=repeat_period(play.batch, play.state, finger, leader.state))
    own, other, force = play.state.active, leader.state.active, play.batch.rows.force
    near = slice(own.near)
    found = compare(own.block[0], own.block[force, near], other.block[0], other.block[force, near])
    return Monitor(play, np.maximum(largest, found))


def _run(
    scenes: Sequence[Scene],
    observer: Callable[[Mapping[int, Scene], Recorder | None, Play], _Observer],
    stopped: Callable[[], bool] | None,
    *,
    errors: bool = False,
) -> Iterator[tuple[int, Outcome]]:
    """Yield the numbers of the scenes as they come to their ends, and what an observer makes of them."""
    systems: dict[int, System] = {}
    for number, scene in enumerate(scenes):
        try:
            system = assemble(scene)
            check_memory(scene, system.rows)
            systems[number] = system
        except DigiclayError as error:
            yield number, error
    if not systems:
        return
    running = {run: scenes[run] for run in systems}
    play = begin_play(running, systems)
    watching = observer(running, scenes[0].recorder, play)
    monitor = _start(running) if errors and has_every_command(scenes[0]) else None
    for now in play_all(play, {run: scene.periods for run, scene in running.items()}, stopped):
        watching.observe(now)
        monitor = monitor and _follow(monitor, now.play)
        for index in np.flatnonzero(now.over).tolist():
            run = now.play.runs[index]
            if now.failed[index]:
                yield run, make_divergence_error(now.play.batch, now.play.state, index)
                continue
            result = watching.finish(now, index)
            if monitor:
                result = result.with_errors(Errors.estimate(monitor.largest[:, index]))
            yield run, result


def run_together(
    scenes: Sequence[Scene], *, stopped: Callable[[], bool] | None = None
) -> Iterator[tuple[int, Outcome]]:
    """Run scenes from rest to their ends, all at once.

    `scenes`: of one `packing.describe_structure`; `stopped`: asked after each control period; when it says
    True, the runs that are not done are given up. Yields `number`: which of the scenes has come to its end;
    `result`: as `run_scene.run` would return or raise it. Its history is valid until the next result is asked
    for. Its run time is a share, see `play.Instant`.
    """
    return _run(scenes, Histories, stopped)


def measure_together(
    scenes: Sequence[Scene], *, errors: bool = False, stopped: Callable[[], bool] | None = None
) -> Iterator[tuple[int, Outcome]]:
    """Run scenes as `run_together` does, and measure them without ever having their histories.

    `scenes`: of one `packing.describe_structure`, with a recorder; `errors`: estimate their errors too, where
    `accuracy.has_every_command`; their references, see `accuracy.make_reference`, must be of one structure as
    well; `stopped`: see `run_together`. Yields `number`; `result`: without a history; its metrics are those
    it would have with one.
    """
    return _run(scenes, Sums, stopped, errors=errors)
