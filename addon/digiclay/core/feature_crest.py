"""The crest of a boss, or the lowest line of a crease: traced from pin to pin along the top."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .formed import Formed

__all__ = ["Lattice", "crests"]

Floats = NDArray[np.float64]
Pins = NDArray[np.int64]

#: Steps to the neighbours, (rows, columns), counter-clockwise; a shifted bed has one list for rows
#: that stand back and one for rows that are shifted forward along x.
SQUARE = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
BACK = ((0, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0))
FORWARD = ((0, 1), (1, 1), (1, 0), (0, -1), (-1, 0), (-1, 1))
#: How far along a closed crest its two ends may be apart and be joined all the same, steps.
NEARLY_CLOSED = 3
#: A crest falls less than this share of what its sides fall; on a round top, where all directions are alike,
#: there is none.
SHARE = 0.9


@dataclass(frozen=True, eq=False)
class Lattice:
    """Pins and their neighbours.

    Attributes
    ----------
    neighbour : ndarray of int (n, 8 or 6)
        Counter-clockwise; -1 beyond the edge of the bed.
    """

    neighbour: Pins

    @classmethod
    def of(cls, formed: Formed) -> Lattice:
        """Return the neighbours of all pins of a bed: 8 in an aligned one, else 6."""
        row, column = np.divmod(np.arange(formed.rows * formed.columns), formed.columns)
        lists = (SQUARE, SQUARE) if not formed.shift else (BACK, FORWARD)
        lists = lists[::-1] if formed.shift < 0.0 else lists
        steps = np.array(lists)[row % 2]
        rows, columns = row[:, None] + steps[..., 0], column[:, None] + steps[..., 1]
        on_bed = (rows >= 0) & (rows < formed.rows) & (columns >= 0) & (columns < formed.columns)
        return cls(np.where(on_bed, rows * formed.columns + columns, -1))


def crests(formed: Formed, lattice: Lattice, pins: Pins, off: Floats) -> tuple[Floats, ...]:
    """Trace the crests of a feature.

    The feature is rounded over its own half width, so that a flat top has its crest in the middle. From its
    highest pin the line goes both ways to the highest pin ahead, as long as it falls less along the line
    than to the sides. Where a branch is further from the lines so far than the feature is wide, it is
    traced the same way. Lines shorter than half that width are tops, and no crests.

    Parameters
    ----------
    formed : Formed
    lattice : Lattice
    pins : ndarray of int (k,)
        The feature's, ascending.
    off : ndarray (k,)
        How far each of them is off where it was, m, positive.

    Returns
    -------
    tuple of ndarray (p, 3)
        Points of each line, m, p at least 2; none for a feature without one, such as a dome.
    """
    beside = lattice.neighbour[pins]
    place = np.minimum(np.searchsorted(pins, beside), len(pins) - 1)
    slope = _Slope(np.where(pins[place] == beside, place, -1), beside >= 0, off)
    found = [line for line in slope.lines() if len(line) > slope.half]
    return tuple(_smoothed(formed, pins[line]) for line in found)


class _Slope:
    """One feature: its pins are numbered from 0, and all around it is level ground.

    Parameters
    ----------
    beside : ndarray of int (k, 8 or 6)
        Neighbours within the feature, -1 where there is none.
    on_bed : ndarray of bool (k, 8 or 6)
        Where the bed goes on, within the feature or outside it.
    off : ndarray (k,)
    """

    def __init__(self, beside: Pins, on_bed: NDArray[np.bool_], off: Floats) -> None:
        self.beside, self.on_bed = beside, on_bed
        self.half = self._half_width()
        self.top = off
        for _ in range(self.half):
            self.top = 0.5 * (self.top + self._heights(beside).sum(axis=1) / on_bed.sum(axis=1))

    def lines(self) -> Iterator[Pins]:
        """Give the lines, the one through the highest pin first; single pins too."""
        untried = np.ones(len(self.top), bool)
        traced: set[int] = set()
        while untried.any():
            start = int(np.argmax(np.where(untried, self.top, -np.inf)))
            line = self._both_ways(start, traced)
            traced.update(line.tolist())
            untried[self._ring(line, 2 * self.half)] = False
            yield line

    def _heights(self, pins: Pins) -> Floats:
        """Return the heights of pins, and of the ground for -1."""
        heights: Floats = np.where(pins >= 0, self.top[pins], 0.0)
        return heights

    def _half_width(self) -> int:
        """Return how many rings of pins can be taken off, one at least."""
        inner, count = np.ones(len(self.beside), bool), 0
        while inner.any():
            # Where the bed ends the feature might go on.
            kept = inner & np.all(np.where(self.beside >= 0, inner[self.beside], ~self.on_bed), axis=1)
            if np.array_equal(kept, inner):  # it covers the whole bed
                break
            inner, count = kept, count + 1
        return max(1, count)

    def _ring(self, pins: Pins, steps: int) -> Pins:
        """Return all pins within some steps of others."""
        for _ in range(steps):
            pins = np.unique(np.concatenate([pins, self.beside[pins].ravel()]))
            pins = pins[pins >= 0]
        return pins

    def _both_ways(self, start: int, others: set[int]) -> Pins:
        """Return the pins of a line through `start`; a line that meets another one ends on it."""
        known = {start}
        one = self._way(start, None, known, others)
        if not one:
            return np.array([start])
        if len(one) > 2 * NEARLY_CLOSED and one[-1] in self._ring(np.array([start]), NEARLY_CLOSED):
            return np.array([start, *one, start])
        count = self.beside.shape[1]
        first = int(np.flatnonzero(self.beside[start] == one[0])[0])
        other = self._way(start, (first + count // 2) % count, known, others)
        return np.array([*other[::-1], start, *one])

    def _way(self, pin: int, direction: int | None, known: set[int], others: set[int]) -> list[int]:
        """Follow the crest from a pin, ahead of a direction or, without one, wherever it goes on best."""
        count = self.beside.shape[1]
        way: list[int] = []
        while pin not in others:
            # It bends by one direction a step at most, so that it does not turn back at the end of a ridge.
            ahead = range(count) if direction is None else range(direction - 1, direction + 2)
            steps = [(turn % count, int(self.beside[pin, turn % count])) for turn in ahead]
            steps = [(turn, to) for turn, to in steps if to >= 0 and to not in known]
            steps.sort(key=lambda step: -float(self.top[step[1]]))
            if direction is None:
                steps = [step for step in steps if self._goes_on(pin, *step)]
            if not steps or not self._goes_on(pin, *steps[0]):
                break
            direction, pin = steps[0]
            way.append(pin)
            known.add(pin)
        return way

    def _goes_on(self, here: int, direction: int, there: int) -> bool:
        """Tell whether the crest goes on from a pin to its neighbour: it falls less ahead than aside."""
        count = self.beside.shape[1]
        falls = []
        # Straight to the side, or between the two directions that are nearest to it.
        for turns in ((2,), (-2,)) if count == 8 else ((1, 2), (-1, -2)):
            side = [(direction + turn) % count for turn in turns]
            side = [turn for turn in side if self.on_bed[there, turn]]
            if side:
                falls.append(self.top[there] - self._heights(self.beside[there, side]).mean())
        ahead = float(self.top[here] - self.top[there])
        return bool(falls) and ahead < SHARE * float(np.mean(falls))


def _smoothed(formed: Formed, pins: Pins) -> Floats:
    """Return the points of a line, smoothed so that an oblique one is no staircase and not too long."""
    line = np.column_stack([formed.position[pins], formed.height[pins]])
    for _ in range(2):
        line[1:-1] = 0.25 * (line[:-2] + 2.0 * line[1:-1] + line[2:])
    return line
