"""Sessions of many scenes in one call."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..assembly import assemble
from ..errors import DigiclayError
from ..scene import Scene
from ..session import Result, fits, judged
from ..simulation import CHUNK
from ..system import System
from .assembly import put_together
from .fingers import Fingers, fingers
from .recording import StackRecording
from .simulation import advance, begin, blow_up, broken, kept

__all__ = ["run_together"]


@dataclass(frozen=True)
class _End:
    """What counts of the state a run ended in, see `session.Ended`."""

    period: int
    memory: Any


def run_together(
    scenes: Sequence[Scene],
    *,
    stopped: Callable[[], bool] | None = None,
    versions: Mapping[str, str] | None = None,
) -> Iterator[tuple[int, Result | DigiclayError]]:
    """Run scenes from rest to their ends, all at once.

    Parameters
    ----------
    scenes : sequence of Scene
        Of one `assembly.structure`.
    stopped : callable, optional
        Asked after each control period; when it says True, the runs that are not done are given up.
    versions : mapping, optional
        What else to note as versions the runs were made with.

    Yields
    ------
    number : int
        Which of the scenes has come to its end.
    result : Result or DigiclayError
        As `session.run` would return or raise it. Its history is valid until the next result is
        asked for. Its run time is a share: every period's, divided by the runs that were in the stack.
    """
    systems: dict[int, System] = {}
    for number, scene in enumerate(scenes):
        try:
            system = assemble(scene)
            fits(scene, system)
        except DigiclayError as error:
            yield number, error
        else:
            systems[number] = system
    if not systems:
        return
    stack, runs, share = put_together(list(systems.values())), tuple(systems), 0.0
    ways, recorder = [scene.trajectory.trajectory() for scene in scenes], scenes[0].recorder
    state = begin(stack)
    recording = StackRecording(recorder, stack.rows, state, runs) if recorder else None
    coming: Fingers | None = None
    until = first = 0
    nearest = min(scenes[run].periods for run in runs)
    while runs:
        started = time.perf_counter()
        if state.period == until and stack.touch:
            first, until = until, until + CHUNK
            coming = fingers(stack.systems, [ways[run] for run in runs], first, CHUNK)
        state = advance(stack, state, coming, state.period - first)
        failed = broken(state)
        if recording:
            recording.observe(state, runs)
        share += (time.perf_counter() - started) / len(runs)
        if stopped and stopped():
            return
        if state.period < nearest and not failed.any():
            continue
        over = [failed[place] or state.period == scenes[run].periods for place, run in enumerate(runs)]
        for place, run in enumerate(runs):
            if failed[place]:
                yield run, blow_up(stack, state, place)
            elif over[place]:
                rows = recording.arrays(run, state, place) if recording else None
                memory = stack.controller.of(state.memory, place) if stack.controller else None
                end = _End(state.period, memory)
                yield run, judged(scenes[run], systems[run], ways[run], rows, end, share, versions or {})
        left = [place for place in range(len(runs)) if not over[place]]
        runs = tuple(runs[place] for place in left)
        if runs:
            state = kept(state, stack.controller, left)
            stack = put_together([systems[run] for run in runs])
            until = state.period
            nearest = min(scenes[run].periods for run in runs)
