"""Sobol samples and indices by SALib: shares of an output's variance by parameter, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.studies.axes import Record
from digiclay.core.studies.evaluation import FIGURES


def describe_problem(parameters: int) -> dict[str, Any]:
    """Return SALib's description of parameters that are shares of their ranges, from 0 to 1."""
    # As an array: pandas, which SALib groups them with, takes no list.
    names = np.array([f"x{number}" for number in range(parameters)], dtype=object)
    return {"num_vars": parameters, "names": names, "bounds": [[0.0, 1.0]] * parameters}


def count_points(samples: int, parameters: int, *, second: bool) -> int:
    """Return how many points a design has."""
    return samples * (2 * parameters + 2 if second else parameters + 2)


def sample_shares(samples: int, parameters: int, seed: int, *, second: bool) -> Floats:
    """Return the points of Saltelli's design as shares of the ranges.

    Each sample gives a block of points: A, A with one parameter of B each, for the second order B with one
    parameter of A each, and B. A and B are halves of a scrambled Sobol point.
    """
    from SALib.sample import sobol

    problem = describe_problem(parameters)
    shares: Floats = sobol.sample(problem, samples, calc_second_order=second, seed=seed)
    return shares


#: Level of the confidence intervals, and resamples of the bootstrap they come from.
CONFIDENCE, RESAMPLES = 0.95, 1000


@dataclass(frozen=True, eq=False)
class Indices:
    """Sobol indices of one output over d parameters.

    Attributes
    ----------
    first, total : ndarray (d,)
        Share of the variance by the parameter alone, and with all its interactions.
    first_interval, total_interval : ndarray (d,)
        Half widths of their confidence intervals.
    second, second_interval : ndarray (d, d)
        Share by the interaction of two parameters, above the diagonal, NaN elsewhere; all NaN if it was not
        requested.
    """

    first: Floats
    first_interval: Floats
    total: Floats
    total_interval: Floats
    second: Floats
    second_interval: Floats


def compute_indices(values: Floats, parameters: int, seed: int, *, second: bool) -> Indices | None:
    """Return the Sobol indices of an output at the points of `indices.sample_shares`."""
    from SALib.analyze import sobol

    if not np.ptp(values) > 1e-9 * np.max(np.abs(values)):
        return None
    found = sobol.analyze(
        describe_problem(parameters), values, calc_second_order=second, num_resamples=RESAMPLES,
        conf_level=CONFIDENCE, seed=seed,
    )  # fmt: skip
    none = np.full((parameters, parameters), np.nan)
    return Indices(
        found["S1"], found["S1_conf"], found["ST"], found["ST_conf"],
        found["S2"] if second else none, found["S2_conf"] if second else none,
    )  # fmt: skip


#: The metric by which a run loses the fingertip, and how far it may exceed that of the unchanged scene, which
#: may lift the fingertip on purpose.
LOSS, ALLOWED = "contact_loss_share", 0.05
#: Metrics of the contact itself: a loss is a value of theirs.
CONTACT = (LOSS, "contact_share")


@dataclass(frozen=True, eq=False)
class Response:
    """An output at the points of a study.

    Attributes
    ----------
    name : str
        A key of `evaluation.FIGURES`.
    values : ndarray (points,)
        SI; finite.
    absent : int
        How many runs failed, or have no such value.
    lost : int
        How many others lost the fingertip.
    """

    name: str
    values: Floats
    absent: int
    lost: int

    @property
    def unit(self) -> str:
        """SI unit."""
        return FIGURES[self.name].unit


def find_excess_losses(records: Sequence[Record], reference: Record) -> Floats:
    """Return by how much the loss of contact of each run exceeds what is allowed, shape (points,)."""
    usual = reference["figures"].get(LOSS) or 0.0
    shares = np.array([get_figure(record, LOSS) for record in records])
    return shares - usual - ALLOWED


def make_response(name: str, records: Sequence[Record], excess: Floats) -> Response:
    """Return an output of all runs; those without it, or that lost the fingertip, have the others' largest.

    Left out they would leave holes in the design of a study; at their own values runs that touch for a moment
    only would count as good.
    """
    values = np.array([get_figure(record, name) for record in records])
    absent = np.isnan(values)
    lost = (excess > 0.0) & ~absent & (name not in CONTACT)
    replaced = absent | lost
    if replaced.all():
        first = next((record["error"] for record in records if "error" in record), "")
        why = f"; the first error: {first}" if first else "."
        raise OutputError(f"No run that keeps the fingertip has the metric {name}{why}")
    values[replaced] = values[~replaced].max()
    return Response(name, values, int(absent.sum()), int(lost.sum()))


def get_figure(record: Record, name: str) -> float:
    """Return a figure of a record; NaN where there is none."""
    value = record.get("figures", {}).get(name)
    return np.nan if value is None else float(value)
