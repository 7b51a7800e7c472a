"""How exact a live session is: a shadow of it gets the same commands and is integrated more finely.

It comes along for a short stretch now and then, which is cheap, and is then as far from the
session as the integration's errors over that stretch; see `accuracy`, which does the same with
a whole run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .accuracy import SHARE, judging
from .assembly import assemble
from .control.replay import Replay
from .errors import DigiclayError
from .scene import Scene
from .simulation import advance, approaches
from .state import State
from .system import System
from .trajectory import along

__all__ = ["LiveErrors", "Shadow", "cast", "cast_from", "compared", "lifted"]

Floats = NDArray[np.float64]

#: Control periods of a stretch, and from the end of one to the start of the next.
STRETCH, PAUSE = 20, 180


@dataclass(frozen=True)
class LiveErrors:
    """Largest errors over all cells at the end of a stretch.

    Attributes
    ----------
    height : float
        m.
    force : float
        N.
    """

    height: float
    force: float


@dataclass(frozen=True, eq=False)
class Shadow:
    """The shadow of a session.

    Attributes
    ----------
    system : System
        The session's, integrated as `accuracy.judging` says.
    state : State or None
        None between two stretches.
    left : int
        Control periods left of the stretch, or of the time to the next one.
    """

    system: System
    state: State | None = None
    left: int = 0


def cast(scene: Scene) -> Shadow | None:
    """Return the shadow of a session's beginning; None where the step cannot be halved."""
    try:
        return Shadow(assemble(replace(scene, simulation=judging(scene.simulation))))
    except DigiclayError:
        return None


def cast_from(shadow: Shadow, before: State) -> Shadow:
    """Return the shadow ready for one control period from a state, which is copied where a stretch begins."""
    if shadow.state is not None or shadow.left > 0:
        return shadow
    return replace(shadow, state=before.copy(), left=STRETCH)


def lifted(shadow: Shadow) -> Shadow:
    """Return the shadow of a session that has just become another one: it starts anew."""
    return replace(shadow, state=None, left=0)


def compared(shadow: Shadow, after: State, path: Floats) -> tuple[Shadow, LiveErrors | None]:
    """Let the shadow do the period the session has just done; return the errors where a stretch ends.

    Parameters
    ----------
    shadow : Shadow
        From `cast_from`.
    after : State
        The session's, at the end of the period.
    path : ndarray (2, 7)
        The finger at both ends of the period; see `live.lived`.
    """
    if shadow.state is None:
        return replace(shadow, left=shadow.left - 1), None
    system, rows = shadow.system, shadow.system.rows
    told = Replay(system.grid, after.row(rows.command)[None])
    # A period's commands are row 0 of what is played: its own memory does not count on.
    state = shadow.state._replace(memory=0)
    finger = approaches(system, along(path, system.instants / system.period))[0]
    state = advance(replace(system, controller=told), state, finger)
    if shadow.left > 1:
        return replace(shadow, state=state, left=shadow.left - 1), None
    height = float(np.abs(state.row(0) - after.row(0)).max())
    force = float(np.abs(state.row(rows.force) - after.row(rows.force)).max())
    errors = LiveErrors(SHARE * height, SHARE * force)
    return replace(shadow, state=None, left=PAUSE), errors
