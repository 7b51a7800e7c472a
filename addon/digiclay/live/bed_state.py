"""Session data on a bed's object: properties that copies, appends, undo and files include."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.base.arrays import Floats
from ..sessions.running import Running

#: The state by `core.session.snapshot`, the fingertip's pose at it, and the tick it is of.
STATE, POSE, TICK = "digiclay_state", "digiclay_pose", "digiclay_moment"


def write(bed: Any, running: Running, before: Running | None = None) -> None:
    """Write a session into its bed's properties, except what has not changed since `before` was written."""
    # The tick counts on even while nothing moves: it identifies the one that undo has returned to.
    bed[TICK] = running.tick
    if before is not None and running.snapshot is before.snapshot:
        return
    for name, data in ((STATE, running.snapshot), (POSE, running.pose.tobytes())):
        # Blender takes bytes that are assigned over others for a text: it stops at the first 0,
        # and corrupts its memory where the lengths differ.
        if name in bed:
            del bed[name]
        bed[name] = data


def clear(bed: Any) -> None:
    """Remove all session data: the bed is at rest."""
    for name in (STATE, POSE, TICK):
        if name in bed:
            del bed[name]


def read_snapshot(bed: Any) -> bytes | None:
    """Return the stored state, or None for a bed at rest; it may be anything a file can hold."""
    value = bed.get(STATE)
    return value if value is None or isinstance(value, bytes) else b""


def read_pose(bed: Any) -> Floats | None:
    """Return the fingertip's pose (7,) at the stored state, or None where there is no usable one."""
    value = bed.get(POSE)
    if not isinstance(value, bytes) or len(value) != 7 * 8:
        return None
    pose = np.frombuffer(value, np.float64).copy()
    length = np.linalg.norm(pose[3:])
    return pose if np.isfinite(pose).all() and abs(length - 1.0) < 1e-6 else None


def read_tick(bed: Any) -> int:
    """Return the tick that the stored state is of; 0 where none is stored."""
    value = bed.get(TICK)
    return value if isinstance(value, int) and value > 0 else 0
