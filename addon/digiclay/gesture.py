"""A gesture of the Press tool: where the finger goes while the mouse is held. No Blender in here.

The finger comes from above and leaves upwards, so that it never drags across the bed on its way
to where the mouse is. How deep it is pressed counts from the surface as it was when the gesture
began: pins that give way do not draw the finger after them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .core.fingertip import Fingertip
from .core.layout import Grid
from .core.pointing import ground

__all__ = ["DEEPEST", "DONE", "Gesture", "advanced", "begun", "deeper"]

Floats = NDArray[np.float64]

#: What the finger is about: to get above the place, to press there, to leave it; and the end.
ABOVE, PRESS, LEAVE, DONE = "above", "press", "leave", "done"
#: How fast the finger comes down or is pressed deeper, m/s: a quick tap, and nothing faster.
SPEED = 0.1
#: How far above the highest pin the finger passes over the bed, m.
CLEARANCE = 4e-3
#: Deepest press, m, and least one.
DEEPEST, SHALLOWEST = 30e-3, 0.1e-3
#: The session has come to a place when it is this near, m; a session that does not within this time, s,
#: is not waited for, say because the fingertip is held by a constraint.
NEAR, PATIENCE = 1e-5, 0.5


@dataclass(frozen=True, eq=False)
class Gesture:
    """Where the finger is, and where it is to go.

    Attributes
    ----------
    grid : Grid
    height : ndarray (n,)
        Heights of the pins when the gesture began, m.
    finger : Fingertip
    at : ndarray (7,)
        Pose of the finger.
    over : tuple of float
        Where on the bed the finger is to press, m.
    depth : float
        How deep, m.
    pressure : float
        Share of the depth that a pen asks for, 0 to 1.
    phase : str
    held : bool
        Whether the mouse button is.
    waited : float
        How long the session has not come to where the finger is, s.
    """

    grid: Grid
    height: Floats
    finger: Fingertip
    at: Floats
    over: tuple[float, float]
    depth: float
    pressure: float = 1.0
    phase: str = ABOVE
    held: bool = True
    waited: float = 0.0

    @property
    def safe(self) -> float:
        """Height at which the finger touches nothing, m."""
        return float(self.height.max()) + CLEARANCE

    @property
    def lowest(self) -> float:
        """Height to press down to, m; never below the bed's floor."""
        level = ground(self.grid, self.height, *self.over, self.finger.width / 2)
        return max(0.0, level - self.depth * self.pressure)


def begun(
    grid: Grid, height: Floats, finger: Fingertip, at: Floats, over: tuple[float, float], depth: float
) -> Gesture:
    """Begin a gesture; see `Gesture`."""
    return deeper(Gesture(grid, height.copy(), finger, at, over, depth), 0.0)


def deeper(gesture: Gesture, by: float) -> Gesture:
    """Press deeper, m, within what can be pressed."""
    return replace(gesture, depth=min(max(gesture.depth + by, SHALLOWEST), DEEPEST))


def advanced(gesture: Gesture, seconds: float, followed: Floats | None) -> Gesture:
    """Let the finger go on.

    Parameters
    ----------
    gesture : Gesture
    seconds : float
        Time gone by.
    followed : ndarray (7,) or None
        Pose up to which the session has followed the finger; None when it follows nothing now.
    """
    near = followed is None or np.linalg.norm(followed[:3] - gesture.at[:3]) < NEAR
    waited = 0.0 if near else gesture.waited + seconds
    arrived = near or waited >= PATIENCE
    gesture = replace(gesture, waited=0.0 if arrived else waited)
    if gesture.phase == PRESS:
        return _pressed(gesture, seconds)
    if not arrived:
        return gesture
    if gesture.phase == ABOVE:
        return _above(gesture)
    if gesture.at[2] < gesture.safe:
        return replace(gesture, at=_moved(gesture.at, gesture.at[0], gesture.at[1], gesture.safe))
    return replace(gesture, phase=DONE)


def _above(gesture: Gesture) -> Gesture:
    """Go up, then over, then begin to press."""
    if gesture.at[2] < gesture.safe:
        return replace(gesture, at=_moved(gesture.at, gesture.at[0], gesture.at[1], gesture.safe))
    if (gesture.at[0], gesture.at[1]) != gesture.over or gesture.at[2] > gesture.safe:
        return replace(gesture, at=_moved(gesture.at, *gesture.over, gesture.safe))
    return replace(gesture, phase=PRESS)


def _pressed(gesture: Gesture, seconds: float) -> Gesture:
    """Go to the place wanted, up and down no faster than a finger does; leave once there when let go."""
    lowest, step = gesture.lowest, SPEED * seconds
    height = min(max(lowest, gesture.at[2] - step), gesture.at[2] + step)
    gesture = replace(gesture, at=_moved(gesture.at, *gesture.over, height))
    if gesture.held or abs(height - lowest) > NEAR:
        return gesture
    return replace(gesture, phase=LEAVE)


def _moved(at: Floats, x: float, y: float, z: float) -> Floats:
    """Return a pose at another place."""
    return np.array([x, y, z, *at[3:]])
