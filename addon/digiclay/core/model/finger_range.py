"""Range of force and depth of the contact law, what is beyond it, and the message then."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.arrays import Floats
from .fingertip import Fingertip, compute_forms, compute_underside

#: Total force up to which the law and its relaxation were measured, N: Pawluk and Howe, Dynamic contact of
#: the human fingerpad against a flat surface, J Biomech Eng 121(6), 605-611 (1999): 0 to 2 N.
MOST_FORCE = 2.0
#: Indentation up to which fingerpads were pressed in measurements, m: Gulati and Srinivasan, Human fingerpad
#: under indentation I: static and dynamic force response (1995), 0.5 to 3 mm. Below lies the bone.
MOST_INDENTATION = 3e-3
#: Rows whose undersides are worked out at a time.
ROWS = 64


def is_beyond(force: Any, indentation: Any) -> Any:
    """Return whether the contact law does not hold at total forces, N, and indentations, m, of any shape."""
    return (force > MOST_FORCE) | (indentation > MOST_INDENTATION)


def find_indentations(fingertip: Fingertip, history: Mapping[str, Floats]) -> Floats:
    """Return the largest indentation of a pin in contact in each row of a history, (t,), m.

    Rows that are neither the deepest nor deeper than `MOST_INDENTATION` may have 0 instead of theirs.
    """
    felt, height = history["force"] > 0.0, history["height"]
    # No pin stands deeper than it is above the lowest point: few rows are left to look at.
    most = np.max(height, axis=1, where=felt, initial=-np.inf) - history["fingertip"][:, 2]
    deepest_first, found = np.argsort(-most, kind="stable"), np.zeros(len(most))
    cells = np.flatnonzero(felt.any(axis=0))  # the only ones that are worked out: of a large bed they are few
    x, y = np.asarray(history["position"], dtype=np.float64)[cells].T
    basis = np.array([np.ones_like(x), x, y, x * x, x * y, y * y])
    for start in range(0, len(most), ROWS):
        rows = deepest_first[start : start + ROWS]
        if most[rows[0]] <= min(found.max(), MOST_INDENTATION):
            break
        under = compute_underside(
            *compute_forms(fingertip.outline(np.asarray(history["fingertip"])[rows])), basis
        )
        part = np.ix_(rows, cells)
        found[rows] = np.max(height[part] - under, axis=1, where=felt[part], initial=0.0)
    return found


def describe_excess(force: float | None, indentation: float | None) -> str:
    """Return the message on a total force, N, and indentation, m, beyond the law; None: not known; or ""."""
    said = []
    if force is not None and force > MOST_FORCE:
        said.append(f"{force:.3g} N (fingers were measured up to {MOST_FORCE:g} N)")
    if indentation is not None and indentation > MOST_INDENTATION:
        said.append(f"{indentation * 1e3:.3g} mm deep (up to {MOST_INDENTATION * 1e3:g} mm)")
    return f"the contact law does not hold: {', '.join(said)}" if said else ""
