"""Trials of a tuning: two outputs each, and whether the run kept the fingertip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.studies.evaluation import Record
from numpy.typing import NDArray

from .genetic import Outcome
from .pareto import find_front
from .responses import find_excess_losses, get_figure

#: Violation of a run without outputs: more than any loss of contact, which is a share.
WITHOUT = 2.0


@dataclass(frozen=True, eq=False)
class Trials:
    """Outputs of runs.

    Attributes
    ----------
    values : ndarray (points, 2)
        SI; infinite in both where a run has no such outputs.
    violation : ndarray (points,)
        By how much the loss of contact exceeds what is allowed, 0 for a run that keeps the fingertip, and
        `WITHOUT` for one without outputs.
    """

    values: Floats
    violation: Floats

    @property
    def sound(self) -> NDArray[np.bool_]:
        """Which runs keep the fingertip, shape (points,)."""
        kept: NDArray[np.bool_] = self.violation <= 0.0
        return kept

    @property
    def outcomes(self) -> list[Outcome]:
        """What a search is told of them."""
        return [
            Outcome((float(one), float(other)), float(violation))
            for (one, other), violation in zip(self.values, self.violation, strict=True)
        ]

    def find_front(self) -> NDArray[np.intp]:
        """Return the runs on the front, ordered by the first output.

        Raises OutputError when no run keeps the fingertip and has both outputs.
        """
        front = find_front(np.where(self.sound[:, None], self.values, np.nan))
        if not front.size:
            raise OutputError("No run has both metrics without losing the fingertip: there is no front.")
        return front


def judge_trials(names: Sequence[str], records: Sequence[Record], reference: Record) -> Trials:
    """Return the trials that records are of.

    `names`: two keys of `evaluation.FIGURES`; `reference`: of the unchanged scene.
    """
    values = np.array([[get_figure(record, name) for name in names] for record in records])
    excess = find_excess_losses(records, reference)
    without = np.isnan(values).any(axis=1) | np.isnan(excess)
    values[without] = np.inf
    return Trials(values, np.where(without, WITHOUT, np.maximum(excess, 0.0)))
