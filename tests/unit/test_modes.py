"""The table of control modes: stored codes, meanings, colors."""

from __future__ import annotations

import itertools

import numpy as np
from digiclay.core.base.modes import COLORS, MEANINGS, Mode


def test_the_stored_codes_never_change() -> None:
    # Histories on disk hold them.
    assert {mode.name: int(mode) for mode in Mode} == {
        "REST": 0, "HOLD": 1, "EDGE": 2, "BLISTER": 3,
        "SPRING": 4, "FORCE_FOLLOW": 5, "CRITICAL": 6, "FROZEN": 7,
    }  # fmt: skip


def test_every_mode_has_a_meaning_and_a_color_unlike_all_others() -> None:
    assert MEANINGS.keys() == COLORS.keys() == set(Mode)
    colors = np.array(list(COLORS.values()))
    assert 0.0 <= colors.min() <= colors.max() <= 1.0
    # 0.15 apart in the unit cube: the two nearest, the blues, are 0.4 apart.
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(colors, 2)) > 0.15
