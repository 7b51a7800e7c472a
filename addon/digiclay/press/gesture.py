"""A gesture of the Press tool: where the finger goes while the mouse is held. No Blender in here.

The finger comes from above and leaves upwards, so that it never drags across the bed on its way
to where the mouse is. How deep it is pressed counts from the surface as it was when the gesture
began: pins that give way do not draw the finger after them. It goes the way the mouse has gone, no
faster than a finger does: where the machine is slow the finger comes later, and draws the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..core.fingertip import Fingertip
from ..core.layout import Grid
from ..core.pointing import ground

__all__ = ["DEEPEST", "DONE", "Gesture", "advanced", "begun", "deeper", "dragged", "lifted"]

Floats = NDArray[np.float64]

#: What the finger is about: to get above the place, to press there, to leave it; and the end.
ABOVE, PRESS, LEAVE, DONE = "above", "press", "leave", "done"
#: How fast the finger comes down to the surface, presses, and drags, m/s. Pressed faster, it runs into
#: pins whose valves have not opened yet: 2 N at 20 mm/s on the paper's device, 24 N at 50 mm/s.
APPROACH, SPEED, DRAG = 0.1, 0.02, 0.1
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
    way : tuple of (float, float)
        Where on the bed the finger is to press, one place after another, m; at least one.
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
    way: tuple[tuple[float, float], ...]
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
    def surface(self) -> float:
        """Height of the surface under the finger as it was, m."""
        return ground(self.grid, self.height, float(self.at[0]), float(self.at[1]), self.finger.width / 2)

    @property
    def lowest(self) -> float:
        """Height to press down to, m; never below the bed's floor."""
        return max(0.0, self.surface - self.depth * self.pressure)


def begun(
    grid: Grid, height: Floats, finger: Fingertip, at: Floats, over: tuple[float, float], depth: float
) -> Gesture:
    """Begin a gesture; see `Gesture`."""
    return deeper(Gesture(grid, height.copy(), finger, at, (over,), depth), 0.0)


def dragged(gesture: Gesture, over: tuple[float, float]) -> Gesture:
    """Drag on to a place; before the finger has come down it comes down there."""
    if gesture.phase == ABOVE:
        return replace(gesture, way=(over,))
    return replace(gesture, way=(*gesture.way, over))


def deeper(gesture: Gesture, by: float) -> Gesture:
    """Press deeper, m, within what can be pressed."""
    return replace(gesture, depth=min(max(gesture.depth + by, SHALLOWEST), DEEPEST))


def advanced(gesture: Gesture, seconds: float, followed: Floats | None) -> Gesture:
    """Let the finger go on.

    Parameters
    ----------
    gesture : Gesture
    seconds : float
        Time gone by, of the session's: a slow one makes a slow finger.
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
        return replace(gesture, at=lifted(gesture))
    return replace(gesture, phase=DONE)


def lifted(gesture: Gesture) -> Floats:
    """Return the finger's pose (7,) straight above where it is, where it touches nothing."""
    return _moved(gesture.at, float(gesture.at[0]), float(gesture.at[1]), gesture.safe)


def _above(gesture: Gesture) -> Gesture:
    """Go up, then over, then begin to press."""
    if gesture.at[2] < gesture.safe:
        return replace(gesture, at=lifted(gesture))
    if (gesture.at[0], gesture.at[1]) != gesture.way[0] or gesture.at[2] > gesture.safe:
        return replace(gesture, at=_moved(gesture.at, *gesture.way[0], gesture.safe))
    return replace(gesture, phase=PRESS)


def _pressed(gesture: Gesture, seconds: float) -> Gesture:
    """Go on along the way, and down; leave at its end and at the depth when let go."""
    x, y, way = _along(gesture, DRAG * seconds)
    gesture = replace(gesture, way=way, at=_moved(gesture.at, x, y, float(gesture.at[2])))
    surface, lowest, height = gesture.surface, gesture.lowest, float(gesture.at[2])
    if height > surface:
        height = max(surface, height - APPROACH * seconds)
    elif height > lowest:
        height = max(lowest, height - SPEED * seconds)
    else:
        height = min(lowest, height + APPROACH * seconds)
    gesture = replace(gesture, at=_moved(gesture.at, x, y, height))
    ended = len(way) == 1 and (x, y) == way[0] and abs(height - lowest) < NEAR
    return replace(gesture, phase=LEAVE) if ended and not gesture.held else gesture


def _along(gesture: Gesture, length: float) -> tuple[float, float, tuple[tuple[float, float], ...]]:
    """Return where the finger is after a length of its way, m, and what is left of the way."""
    x, y = float(gesture.at[0]), float(gesture.at[1])
    way = gesture.way
    while True:
        far = math.hypot(way[0][0] - x, way[0][1] - y)
        if far > length:
            share = length / far
            return x + share * (way[0][0] - x), y + share * (way[0][1] - y), way
        (x, y), length = way[0], length - far
        if len(way) == 1:
            return x, y, way
        way = way[1:]


def _moved(at: Floats, x: float, y: float, z: float) -> Floats:
    """Return a pose at another place."""
    return np.array([x, y, z, *at[3:]])
