"""Sobol samples and indices by SALib: shares of an output's variance by parameter, with intervals."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.files.tables import Record
from digiclay.core.studies.evaluation import FIGURES


def describe_problem(parameters: int) -> Record:
    """Return SALib's description of parameters that are shares of their ranges, from 0 to 1."""
    # As an array: pandas, which SALib groups them with, takes no list.
    names = np.array([f"x{number}" for number in range(parameters)], dtype=object)
    return {"num_vars": parameters, "names": names, "bounds": [[0.0, 1.0]] * parameters}


def count_points(samples: int, parameters: int, *, second: bool) -> int:
    """Return how many points a design has."""
    return samples * (2 * parameters + 2 if second else parameters + 2)


def sample_shares(samples: int, parameters: int, seed: int, *, second: bool) -> Floats:
    """Return the points of Saltelli's design as shares of the ranges.

    Each sample gives a block of points: A, A with one parameter of B each, for the second order B
    with one parameter of A each, and B. A and B are halves of a scrambled Sobol point.
    """
    from SALib.sample import sobol

    problem = describe_problem(parameters)
    return sobol.sample(problem, samples, calc_second_order=second, seed=seed)


#: Level of the confidence intervals, and resamples of the bootstrap they come from.
CONFIDENCE, RESAMPLES = 0.95, 1000


#: Sobol indices of one output over d parameters, each with half the width of its confidence
#: interval: shares of the variance by the parameter alone, with all its interactions, (d,), and by
#: the interaction of two parameters, (d, d), above the diagonal, if they were requested.
Indices = dict[str, tuple[Floats, Floats]]
#: Their names, and those of SALib.
ORDERS = {"first": "S1", "total": "ST", "second": "S2"}


def compute_indices(values: Floats, parameters: int, seed: int, *, second: bool) -> Indices | None:
    """Return the Sobol indices of an output at the points of `sample_shares`; None if it does not vary."""
    from SALib.analyze import sobol

    if not np.ptp(values) > 1e-9 * np.max(np.abs(values)):
        return None
    result = sobol.analyze(
        describe_problem(parameters),
        values,
        calc_second_order=second,
        num_resamples=RESAMPLES,
        conf_level=CONFIDENCE,
        seed=seed,
    )
    return {
        name: (result[key], result[f"{key}_conf"]) for name, key in ORDERS.items() if key in result
    }


#: The metric by which a run loses the fingertip, and how far it may exceed that of the unchanged
#: scene, which may lift the fingertip on purpose.
LOSS, ALLOWED = "contact_loss_share", 0.05
#: Metrics of the contact itself: a loss is a value of theirs.
CONTACT = (LOSS, "contact_share")


class Response(NamedTuple):
    """Output at the points of a study."""

    #: Key of `evaluation.FIGURES`.
    name: str
    #: (points,), SI; finite.
    values: Floats
    #: How many runs failed, or have no such value, and how many others lost the fingertip.
    absent: int
    lost: int


def find_excess_losses(records: Sequence[Record], reference: Record) -> Floats:
    """Return by how much the loss of contact of each run exceeds what is allowed, shape (points,)."""
    usual = reference["figures"].get(LOSS) or 0.0
    shares = np.array([get_figure(record, LOSS) for record in records])
    return shares - usual - ALLOWED


def make_response(name: str, records: Sequence[Record], excess: Floats) -> Response:
    """Return an output of all runs; those without it, or that lost the fingertip, have the others' worst.

    Left out they would leave holes in the design of a study; at their own values runs that touch
    for a moment only would count as good.
    """
    values = np.array([get_figure(record, name) for record in records])
    absent = np.isnan(values)
    lost = (excess > 0.0) & ~absent & (name not in CONTACT)
    replaced = absent | lost
    if replaced.all():
        errors = (
            f"; the first error: {record['error']}" for record in records if "error" in record
        )
        raise OutputError(
            f"No run that keeps the fingertip has the metric {name}{next(errors, '.')}"
        )
    pick = np.min if FIGURES[name].worse == "lower" else np.max
    values[replaced] = pick(values[~replaced])
    return Response(name, values, int(absent.sum()), int(lost.sum()))


def get_figure(record: Record, name: str) -> float:
    """Return a figure of a record; NaN where there is none."""
    value = record.get("figures", {}).get(name)
    return np.nan if value is None else float(value)
