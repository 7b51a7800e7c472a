"""Which points of a sweep run in one stack, and which one at a time, and why."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from .errors import DigiclayError, ParameterError, one_line
from .scene import Scene
from .stack.assembly import structure, why_not
from .stack.session import judge_of, judge_together
from .sweep import Point, Record, evaluate, recorded

__all__ = ["RUNS", "Bundles", "StackWarning", "bundles", "evaluate_all", "fallen_apart"]

#: Fewer points than this are as quick one at a time.
LEAST = 4
#: From twice as many points on there are two stacks: a larger one gains little, and busies one core only.
RUNS = 32
#: Bytes a stack may take for what the metrics need of its runs, and bytes that is a row: a run's history goes
#: by unseen.
BUDGET, BYTES_A_ROW = 2**30, 41
#: Where a record says why its point was run by itself although it stood in a stack.
ALONE = "alone"


@dataclass(frozen=True)
class Bundles:
    """The points of a sweep, in bundles that run at a time.

    Attributes
    ----------
    stacks : tuple of tuple of Point
        Of `LEAST` points or more.
    alone : tuple of tuple of Point
        Of one point each.
    why : tuple of str
        Why some run alone, one line a reason.
    """

    stacks: tuple[tuple[Point, ...], ...]
    alone: tuple[tuple[Point, ...], ...]
    why: tuple[str, ...]

    def told(self) -> list[str]:
        """Return how the points run, as lines for a person."""
        lines = []
        if self.stacks:
            count = sum(len(stack) for stack in self.stacks)
            lines.append(f"{count} points run in {_some(len(self.stacks), 'stack')}")
        return [*lines, *self.why]


def bundles(points: Sequence[Point], *, errors: bool = False) -> Bundles:
    """Put points of one structure together, as many as make a stack; in the order of the points.

    Which stand together depends on the points alone, not on what is done already or how many
    workers there are: the same sweep comes to the same results to the last bit. Where their errors
    are to be estimated, those that judge them must be of one structure too.
    """
    alike: dict[object, list[Point]] = {}
    alone: list[Point] = []
    why: dict[str, int] = {}
    for point in points:
        reason = why_not(point.scene) if point.scene else ""
        if point.scene is None or reason:
            alone.append(point)
            if reason:
                why[reason] = why.get(reason, 0) + 1
        else:
            try:
                judge = structure(judge_of(point.scene)) if errors else None
            except ParameterError:  # it is told when the point is run
                alone.append(point)
                continue
            alike.setdefault((structure(point.scene), judge), []).append(point)
    stacks = []
    for group in alike.values():
        most = _most(group[0].scene)
        if min(len(group), most) < LEAST:
            alone += group
            reason = (
                f"fewer than {LEAST} have the same bed, parts and steps"
                if len(group) < LEAST
                else "they have too many rows to keep for many at once"
            )
            why[reason] = why.get(reason, 0) + len(group)
            continue
        pieces = max(1, len(group) // RUNS, -(-len(group) // most))
        edges = [len(group) * i // pieces for i in range(pieces + 1)]
        stacks += [tuple(group[a:b]) for a, b in pairwise(edges)]
    alone.sort(key=lambda point: point.index)
    lines = tuple(f"{_some(count, 'point')} one at a time: {reason}" for reason, count in why.items())
    return Bundles(tuple(stacks), tuple((point,) for point in alone), lines)


def _most(scene: Scene | None) -> int:
    """Return how many runs like this one may be in a stack."""
    assert scene is not None
    rows = scene.recorder.rows(scene.periods) if scene.recorder else 1
    return BUDGET // (rows * BYTES_A_ROW)


def _some(count: int, what: str) -> str:
    """Say how many."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


class StackWarning(RuntimeWarning):
    """A stack failed as a whole for a reason that is no user's to mend."""


def evaluate_all(
    scenes: Sequence[Scene], stopped: Callable[[], bool] | None = None, *, errors: bool = False
) -> list[Record | None]:
    """Run a bundle; return the record of each of its points, None for one that was stopped.

    When a stack fails as a whole, its points are run one by one, and each record says why under
    ``alone``. See `sweep.evaluate`.

    Warns
    -----
    StackWarning
        When that was neither a lack of memory nor an error a user can cause.
    """
    records: list[Record | None] = [None] * len(scenes)
    why = ""
    if len(scenes) > 1:
        try:
            for number, result in judge_together(scenes, errors=errors, stopped=stopped):
                if isinstance(result, DigiclayError):
                    records[number] = {"error": one_line(result)}
                else:
                    records[number] = recorded(result, errors=errors)
        except MemoryError:
            why = "there is not enough memory for a stack"
        except DigiclayError as error:
            why = one_line(error)
        except Exception as error:  # each point meets it again by itself, and says what it is
            why = f"{type(error).__name__}: {one_line(error)}"
            warnings.warn(f"A stack of {len(scenes)} runs failed: {why}", StackWarning, stacklevel=2)
        if why:
            records = [None] * len(scenes)
    for number, scene in enumerate(scenes):
        if records[number] is None and not (stopped and stopped()):
            record = evaluate(scene, stopped, errors=errors)
            records[number] = {**record, ALONE: why} if record and why else record
    return records


def fallen_apart(done: Mapping[int, Record]) -> list[str]:
    """Return a line a reason for points that were run one by one because their stack failed."""
    why = [record[ALONE] for record in done.values() if record.get(ALONE)]
    return [f"{_some(why.count(one), 'point')} one at a time: {one}" for one in dict.fromkeys(why)]
