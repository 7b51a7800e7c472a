"""States of Method II and their transitions: Fig. 5 of the paper as a table.

The paper's *virtual spring* state is a cell at rest, one that holds a formed height, one
pressed a little, or one at the edge: all four obey the same spring.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Flags
from ..base.modes import Mode

Modes = NDArray[np.int8]
VIRTUAL_SPRING = (Mode.REST, Mode.HOLD, Mode.SPRING, Mode.EDGE)


class Arrow(NamedTuple):
    """From some modes to another, when a condition holds; `follow_arrows` has them by name."""

    source: tuple[Mode, ...]
    goal: Mode
    condition: str


#: What a cell's own force decides.
BY_FORCE = (
    Arrow(VIRTUAL_SPRING, Mode.FORCE_FOLLOW, "above_spring_trigger"),
    Arrow((Mode.BLISTER, Mode.FROZEN), Mode.FORCE_FOLLOW, "above_blister_trigger"),
    Arrow((Mode.FORCE_FOLLOW,), Mode.CRITICAL, "below_critical_trigger"),
    Arrow((Mode.CRITICAL,), Mode.FORCE_FOLLOW, "above_critical_trigger"),
    Arrow((Mode.CRITICAL,), Mode.BLISTER, "timed_out"),
)

#: What the distance to the nearest cell under the finger decides.
BY_PLACE = (
    Arrow(VIRTUAL_SPRING, Mode.BLISTER, "in_blister"),
    Arrow((Mode.BLISTER,), Mode.FROZEN, "left_behind"),
    Arrow((*VIRTUAL_SPRING, Mode.BLISTER, Mode.FROZEN), Mode.EDGE, "at_edge"),
    Arrow((Mode.EDGE, Mode.BLISTER, Mode.FROZEN), Mode.HOLD, "outside"),
)


def follow_arrows(mode: Modes, arrows: tuple[Arrow, ...], conditions: dict[str, Flags]) -> Modes:
    """Return the modes after all arrows were followed at once; of two from one mode the later wins.

    `mode` int (m,); `conditions` bool (m,), every condition the arrows name.
    """
    after = mode.copy()
    for source, goal, condition in arrows:
        starts = _MEMBERS[source].take(mode)
        np.putmask(after, starts & conditions[condition], np.int8(goal))
    return after


#: For each set of source modes, whether a mode is among them, by its code.
_MEMBERS = {arrow.source: np.isin(np.arange(len(Mode)), arrow.source) for arrow in (*BY_FORCE, *BY_PLACE)}
