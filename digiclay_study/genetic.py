"""Generations of NSGA-II over shares of ranges, by optuna."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np
from digiclay.core.base.arrays import Floats


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
