"""Outputs of many runs as arrays without gaps: values, failures, and losses of the fingertip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.studies.evaluation import FIGURES, Record

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
    """Return by how much the loss of contact of each run exceeds what is allowed, shape (points,).

    `reference`: of the unchanged scene. Returns above 0 for a run that loses the fingertip; NaN for one that
    failed or never touches.
    """
    usual = reference["figures"].get(LOSS) or 0.0
    shares = np.array([get_figure(record, LOSS) for record in records])
    return shares - usual - ALLOWED


def make_response(name: str, records: Sequence[Record], excess: Floats) -> Response:
    """Return an output of all runs; those without it, or that lost the fingertip, have the others' largest.

    Left out they would leave holes in the design of a study; at their own values runs that touch for a moment
    only would count as good.

    `name`: a key of `evaluation.FIGURES`; `excess` (points,), from `find_excess_losses`. Raises OutputError
    when no run has such a value.
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
