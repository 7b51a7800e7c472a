"""The session of a scene as a take: simulated once, to be replayed and baked. No Blender in here."""

from __future__ import annotations

from collections import deque

import numpy as np

from ..core.assembly import assemble
from ..core.keeping import packed
from ..core.live import lived
from ..core.scene import Scene
from ..core.simulation import begin
from ..core.take import Take

__all__ = ["MOST", "START", "of"]

#: Most cells times control periods that are simulated while somebody waits: some seconds' worth.
MOST = 8_000_000
#: When a path begins, s.
START = np.zeros(1)


def of(scene: Scene) -> Take | None:
    """Return the session of a scene, from rest to its end; None when that would take too long.

    The finger goes straight from control period to control period, as every take's does.
    """
    if scene.cells * scene.periods > MOST:
        return None
    system = assemble(scene)
    times = np.arange(scene.periods + 1) * scene.simulation.control_period
    poses = scene.trajectory.trajectory().poses(times)
    state = begin(system)
    start = packed(system, state)
    # Only the last state is wanted: the others' arrays are used up.
    (state,) = deque(lived(system, state, poses), maxlen=1)
    return Take(scene, start, poses, packed(system, state))
