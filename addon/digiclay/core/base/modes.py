"""Control modes of a cell: one table of codes, names, meanings and colors.

``history.npz`` stores the codes, and the view maps them to materials. The colors are Okabe
and Ito's palette, which people with any color vision can distinguish.
"""

from enum import IntEnum

import numpy as np


class Mode(IntEnum):
    """Control mode of a cell; stored as ``int8``."""

    REST = 0
    HOLD = 1
    EDGE = 2
    BLISTER = 3
    SPRING = 4
    FORCE_FOLLOW = 5
    CRITICAL = 6
    FROZEN = 7
    LOCKED = 8


#: The same as arrays store them: numpy takes these ten times as fast as members of an enumeration.
REST, HOLD, EDGE, BLISTER, SPRING, FORCE_FOLLOW, CRITICAL, FROZEN, LOCKED = map(np.int8, Mode)

MEANINGS: dict[Mode, str] = {
    Mode.REST: "at rest, not formed yet",
    Mode.HOLD: "stays at the height at which it was left",
    Mode.EDGE: "just outside the blister, sets its boundary height",
    Mode.BLISTER: "part of the blister, follows its profile",
    Mode.SPRING: "under the fingertip, virtual spring",
    Mode.FORCE_FOLLOW: "under the fingertip, follows the force",
    Mode.CRITICAL: "about to lose the fingertip",
    Mode.FROZEN: "left behind by the fingertip, keeps its command",
    Mode.LOCKED: "locked by hand, its valve stays shut",
}

#: sRGB in [0, 1], one per mode.
COLORS: dict[Mode, tuple[float, float, float]] = {
    Mode.REST: (0.78, 0.79, 0.80),
    Mode.HOLD: (0.00, 0.45, 0.70),
    Mode.EDGE: (0.95, 0.90, 0.25),
    Mode.BLISTER: (0.34, 0.71, 0.91),
    Mode.SPRING: (0.90, 0.62, 0.00),
    Mode.FORCE_FOLLOW: (0.84, 0.37, 0.00),
    Mode.CRITICAL: (0.80, 0.47, 0.65),
    Mode.FROZEN: (0.00, 0.62, 0.45),
    Mode.LOCKED: (0.16, 0.14, 0.20),
}
#: sRGB of a cell that waits for its drive, in any mode, and what that means.
WAITING = (0.28, 0.14, 0.00)
WAITS = "its drive serves others"
