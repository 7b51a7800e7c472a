"""Sweeps: a scene at many points of its parameters, one session each; no processes in here.

Who runs the sessions is a place: anything with the interface of ``concurrent.futures.Executor``.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from .accuracy import estimate_errors, has_every_command
from .errors import DigiclayError, OutputError, ParameterError, SceneError, one_line
from .metrics import METRICS
from .quantity import nearest
from .scene import Scene
from .scene_file import Setting, load
from .session import Result, run
from .sweep_axis import MOST, Axis

__all__ = ["ERRORS", "FIGURES", "Point", "Record", "evaluate", "figure", "finish", "points", "recorded"]

Record = dict[str, Any]

#: How exact a session is: unit and meaning. It is integrated once more for them, where they are asked for.
ERRORS: dict[str, tuple[str, str]] = {
    "height_error": ("m", "largest error of a pin's height, estimated"),
    "force_error": ("N", "largest error of the force on a cell, estimated"),
    "total_force_error": ("N", "largest error of the total force, estimated"),
}
#: What a session can be judged by: unit and meaning.
FIGURES: dict[str, tuple[str, str]] = {
    **{name: (known[0], known[1]) for name, known in METRICS.items()},
    "simulated": ("s", "simulated time"),
    "run_time": ("s", "time the simulation took"),
    "real_time_factor": ("1", "simulated time over the time it took"),
    **ERRORS,
}
#: Short names of figures.
SHORT = {"lag": "lag_mean"}
#: Seconds between two looks at whether somebody asked to stop.
PAUSE = 0.1


@dataclass(frozen=True)
class Point:
    """One session of a sweep.

    Attributes
    ----------
    index : int
        The last axis varies fastest.
    words : tuple of str
        A value on each axis.
    scene : Scene or None
        None where the values do not go together; `error` says why.
    """

    index: int
    words: tuple[str, ...]
    scene: Scene | None
    error: str = ""


def points(path: Path, settings: Sequence[Setting], axes: Sequence[Axis]) -> list[Point]:
    """Make the scenes of all points of a sweep.

    A value that no point can have is refused; values that only do not go together with some
    of the other axes' make a point with an error.

    Raises
    ------
    ParameterError, SceneError
        In one line.
    """
    keys = [one.key for one in axes]
    for key in keys:
        if keys.count(key) > 1:
            raise ParameterError(f"--vary {key}", "", "must be given once", f"{keys.count(key)} times")
        if key in [setting.key for setting in settings]:
            raise ParameterError(f"--vary {key}", "", "must not be given to --set as well", key)
    count = math.prod(len(one.words) for one in axes)
    if count > MOST:
        raise ParameterError("--vary", "", f"must come to {MOST} points at most", f"{count} points")
    load(path, settings)  # what is wrong without the axes is told of first
    found = []
    for index, words in enumerate(itertools.product(*(one.words for one in axes))):
        varied = [Setting(key, word, "--vary") for key, word in zip(keys, words, strict=True)]
        try:
            found.append(Point(index, words, load(path, [*settings, *varied])))
        except SceneError as error:
            found.append(Point(index, words, None, str(error)))
    for number, one in enumerate(axes):
        for word in one.words:
            mine = [point for point in found if point.words[number] == word]
            if not any(point.scene for point in mine):
                raise SceneError(mine[0].error)
    return found


def figure(word: str) -> str:
    """Return the name of a figure asked for, such as ``lag``.

    Raises
    ------
    ParameterError
        When there is none; the nearest is suggested.
    """
    name = SHORT.get(word, word)
    if name in FIGURES:
        return name
    close = nearest(word, [*FIGURES, *SHORT])
    hint = f"Did you mean {close}?" if close else f"Known: {', '.join(FIGURES)}."
    raise ParameterError("--metric", "", "must be a known metric", repr(word), hint)


def evaluate(
    scene: Scene, stopped: Callable[[], bool] | None = None, *, errors: bool = False
) -> Record | None:
    """Run one point; return its ``figures``, or the ``error`` it ended in; None when it was stopped.

    Parameters
    ----------
    scene : Scene
    stopped : callable, optional
        Asked after each control period.
    errors : bool, optional
        Estimate `ERRORS` too.
    """
    try:
        result = run(scene, stopped=stopped)
        if errors and result.history is not None and not result.incomplete and has_every_command(scene):
            found = estimate_errors(scene, result.history, stopped=stopped)
            if found is None:
                return None
            result = result.with_errors(found)
    except DigiclayError as error:
        return {"error": one_line(error)}
    except MemoryError:
        return {"error": "There is not enough memory."}
    except Exception as error:  # whatever is wrong with one point, the others are worth having
        return {"error": f"{type(error).__name__}: {one_line(error)}"}
    return None if result.incomplete else recorded(result, errors=errors)


def recorded(result: Result, *, errors: bool = False) -> Record:
    """Return what is kept of a session that came to its end; `ERRORS` only where they were asked for."""
    names = [name for name in FIGURES if errors or name not in ERRORS]
    return {"figures": {name: result.metrics.get(name) for name in names}}


def finish(
    executor: Executor,
    task: Callable[[list[Scene]], list[Record | None]],
    todo: Iterable[Sequence[Point]],
    keep: Callable[[Point, Record], None],
    *,
    stopped: Callable[[], bool],
) -> None:
    """Have an executor run the points that are to be done; keep each as soon as its bundle is.

    Parameters
    ----------
    executor : Executor
        Any.
    task : callable
        What it runs, on a bundle: `sweep_bundles.evaluate_all`, in a form it can hand on.
    todo : iterable of sequences of Point
        In bundles that are run at a time.
    keep : callable
        Told of each point that came to an end.
    stopped : callable
        Asked all the time; then nothing more is begun, and what runs is waited for.

    Raises
    ------
    OutputError
        When the executor itself breaks down.
    """
    arrived: SimpleQueue[Future[list[Record | None]]] = SimpleQueue()
    waiting: dict[Future[list[Record | None]], list[Point]] = {}
    try:
        for bundle in todo:
            for point in bundle:
                if point.scene is None:
                    keep(point, {"error": point.error})
            able = [point for point in bundle if point.scene]
            if able:
                future = executor.submit(task, [point.scene for point in able if point.scene])
                waiting[future] = able
                future.add_done_callback(arrived.put)
        while waiting:
            if stopped():
                for future in waiting:
                    future.cancel()
            try:
                future = arrived.get(timeout=PAUSE)
            except Empty:
                continue
            records = [] if future.cancelled() else future.result()
            # Of a bundle that was cancelled there are no records.
            for point, record in zip(waiting.pop(future), records, strict=False):
                if record is not None:
                    keep(point, record)
    except BrokenExecutor:
        rule = "A worker died, perhaps for lack of memory; what was done is kept."
        raise OutputError(f"{rule} Run the same again with fewer --workers.") from None
