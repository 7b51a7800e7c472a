"""Range of force and depth of the contact law, and the message beyond it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .fingertip import Fingertip, compute_forms, compute_underside

__all__ = ["MOST_FORCE", "MOST_INDENTATION", "describe_excess", "find_largest_indentation"]

Floats = NDArray[np.float64]

#: Total force up to which the law and its relaxation were measured, N: Pawluk and Howe, Dynamic contact of
#: the human fingerpad against a flat surface, J Biomech Eng 121(6), 605-611 (1999): 0 to 2 N.
MOST_FORCE = 2.0
#: Indentation up to which fingerpads were pressed in measurements, m: Gulati and Srinivasan, Human fingerpad
#: under indentation I: static and dynamic force response (1995), 0.5 to 3 mm. Below lies the bone.
MOST_INDENTATION = 3e-3
#: Rows whose undersides are worked out at a time.
ROWS = 64


def find_largest_indentation(fingertip: Fingertip, history: Mapping[str, Floats]) -> float:
    """Return the largest indentation of a pin in contact, over all rows, m.

    Parameters
    ----------
    fingertip : Fingertip
    history : mapping
        The arrays of ``history.npz``: height, force, fingertip and position.
    """
    felt, height = history["force"] > 0.0, history["height"]
    # No pin stands deeper than it is above the lowest point: few rows are left to look at.
    most = np.max(height, axis=1, where=felt, initial=-np.inf) - history["fingertip"][:, 2]
    deepest_first, found = np.argsort(-most, kind="stable"), 0.0
    cells = np.flatnonzero(felt.any(axis=0))  # the only ones that are worked out: of a large bed they are few
    x, y = np.asarray(history["position"], dtype=np.float64)[cells].T
    basis = np.array([np.ones_like(x), x, y, x * x, x * y, y * y])
    for start in range(0, len(most), ROWS):
        rows = deepest_first[start : start + ROWS]
        if most[rows[0]] <= found:
            break
        under = compute_underside(
            *compute_forms(fingertip.outline(np.asarray(history["fingertip"])[rows])), basis
        )
        part = np.ix_(rows, cells)
        depth = np.max(height[part] - under, where=felt[part], initial=0.0)
        found = max(found, float(depth))
    return found


def describe_excess(force: float | None, indentation: float | None) -> str:
    """Return the message on values beyond the contact law; empty without any.

    Parameters
    ----------
    force, indentation : float or None
        The largest total force, N, and indentation, m; None where it is not known.
    """
    said = []
    if force is not None and force > MOST_FORCE:
        said.append(f"{force:.3g} N (fingers were measured up to {MOST_FORCE:g} N)")
    if indentation is not None and indentation > MOST_INDENTATION:
        said.append(f"{indentation * 1e3:.3g} mm deep (up to {MOST_INDENTATION * 1e3:g} mm)")
    return f"the contact law does not hold: {', '.join(said)}" if said else ""
