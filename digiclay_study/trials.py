"""Trials of a tuning: proposed by optuna, two outputs each, and their Pareto front."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.studies.evaluation import Record
from numpy.typing import NDArray

from .responses import find_excess_losses, get_figure


def find_front(values: Floats) -> NDArray[np.intp]:
    """Return the points that no other dominates, ordered by the first output.

    A point dominates another if it is at most as large in both outputs, and less in one. Of equal points the
    first one is returned.

    `values` (points, 2), points with a NaN are on no front.
    """
    known = np.flatnonzero(~np.isnan(values).any(axis=1))
    order = known[np.lexsort((values[known, 1], values[known, 0]))]
    front, least = [], np.inf
    for point in order:
        if values[point, 1] < least:
            least = values[point, 1]
            front.append(point)
    return np.array(front, dtype=np.intp)


def find_knee(front: Floats) -> int:
    """Return the index of the point of a front that is farthest below the line between its ends.

    With both outputs scaled to 0 to 1 over the front, the ends are (0, 1) and (1, 0), and that point has the
    least sum. It is the place where less of one output begins to cost much of the other.

    `front` (k, 2), of at least one point, ordered by the first output.
    """
    extent = np.ptp(front, axis=0)
    scaled = (front - front.min(axis=0)) / np.where(extent > 0.0, extent, 1.0)
    return int(np.argmin(scaled.sum(axis=1)))


@dataclass(frozen=True)
class Outcome:
    """Outcome of a point, which a search takes.

    Attributes
    ----------
    values : tuple of float
        The outputs to be minimized; infinite where there are none.
    violation : float
        Above 0 for a point that is no solution: of two such points the lesser violation is preferred, and any
        solution to both.
    """

    values: tuple[float, float]
    violation: float


def propose_generations(
    parameters: int, population: int, seed: int
) -> Generator[Floats, Sequence[Outcome], None]:
    """Yield generations without end; each is asked for with the outcomes of the one before.

    The same outcomes lead to the same generations: a search that is told kept outcomes from its beginning
    goes on as if it had never stopped.

    `population`: points of a generation, at least 2. Yields (population, parameters), shares, from 0 to 1.
    """
    import optuna
    from optuna.samplers.nsgaii import PolynomialMutation, SBXCrossover

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    space: dict[str, optuna.distributions.BaseDistribution] = {
        f"x{number}": optuna.distributions.FloatDistribution(0.0, 1.0) for number in range(parameters)
    }
    with warnings.catch_warnings():
        # Crossover and mutation of the original NSGA-II; optuna's own are coarser, and no experiment.
        warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
        sampler = optuna.samplers.NSGAIISampler(
            population_size=population, crossover=SBXCrossover(), mutation=PolynomialMutation(), seed=seed
        )
    study = optuna.create_study(directions=["minimize", "minimize"], sampler=sampler)
    while True:
        trials = [study.ask(space) for _ in range(population)]
        outcomes = yield np.array([[trial.params[name] for name in space] for trial in trials])
        for trial, outcome in zip(trials, outcomes, strict=True):
            trial.set_constraint("loss", outcome.violation)
            study.tell(trial, outcome.values)


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
