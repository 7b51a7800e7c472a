"""Recorded instant of a bed, for view and renderer; no Blender."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..core.base.arrays import Array, Flags, Floats, Modes
from ..core.base.errors import OutputError
from ..core.base.modes import Mode
from ..core.model.actuator import Actuator
from ..core.model.fingertip import LEVEL, Fingertip
from ..core.model.layout import Layout, make_grid
from ..core.model.underside import Mesh
from ..core.scene.schema import Scene
from ..core.session import finished_run

Codes = Modes

#: What an instant needs of a history.
ARRAYS = ("position", "height", "mode", "force", "fingertip")
#: How far above the bed a fingertip that has not touched yet is put, m.
CLEARANCE = 6e-3


@dataclass(frozen=True, eq=False)
class Instant:
    """Bed and fingertip at one time, with the sizes for drawing."""

    #: (n, 2), axes of the pins, m, the bed's center at the origin.
    position: Floats
    #: (n,), pin tops above the bed's floor, m.
    height: Floats
    #: (n,), of `core.base.modes.Mode`.
    mode: Codes
    #: (n,), on each pin, N, pressing down is positive.
    force: Floats
    #: (f, 7), of each fingertip, here also (7,) of one: lowest point, m, and orientation, w, x, y, z.
    fingertip: Floats
    #: Distance between neighboring pins, m.
    pitch: float = Layout().pitch
    #: Gives the pins' thickness (bore), stroke and rest height.
    actuator: Actuator = field(default_factory=Actuator)
    #: Gives the semi-axes of each fingertip.
    finger: tuple[Fingertip, ...] = (Fingertip(),)
    #: Meshes that press the pins, and their poses (b, 7).
    bodies: tuple[Mesh, ...] = ()
    body: Floats | None = None
    #: (n,), whether each pin waits for its drive, where there is one.
    waiting: Flags | None = None

    def __post_init__(self) -> None:
        for name in ARRAYS:
            array = np.array(getattr(self, name), np.int8 if name == "mode" else np.float64)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "fingertip", self.fingertip.reshape(-1, 7))

    @classmethod
    def of(cls, history: Mapping[str, Any], index: int = -1, **sizes: Any) -> Instant:
        """Take one row of a history."""
        rows = len(history["height"])
        if not -rows <= index < rows:
            raise OutputError(f"The history has {rows} rows, 0 to {rows - 1} (got {index}).")
        names = [name for name in (*ARRAYS[1:], "body", "waiting") if name in history]
        taken = {name: np.asarray(history[name])[index] for name in names}
        return cls(position=np.asarray(history["position"]), **taken, **sizes)

    @classmethod
    def at_rest(
        cls,
        layout: Layout,
        actuator: Actuator | None = None,
        finger: tuple[Fingertip, ...] = (Fingertip(),),
    ) -> Instant:
        """Return a bed nobody has touched yet, the fingertips above its center."""
        actuator, bed = actuator or Actuator(), make_grid(layout)
        rest = actuator.rest_height
        return cls(
            bed.positions,
            np.full(bed.count, rest),
            np.full(bed.count, Mode.REST, np.int8),
            np.zeros(bed.count),
            np.tile([0.0, 0.0, rest + CLEARANCE, *LEVEL], (len(finger), 1)),
            layout.pitch,
            actuator,
            finger,
        )

    @property
    def looks(self) -> dict[str, Array]:
        """What the colors of the pins show, (n,), by its name."""
        waiting = np.zeros(self.height.shape, np.bool_) if self.waiting is None else self.waiting
        return {"mode": self.mode, "force": self.force, "waiting": waiting}


def find_ellipsoids(scene: Scene) -> tuple[Fingertip, ...]:
    """Return the ellipsoids a bed's fingertips are drawn as, also where a scene leaves the fingertip out."""
    return tuple(finger.fingertip or Fingertip() for finger in scene.fingers)


def find_ellipsoid(scene: Scene) -> Fingertip:
    """Return the ellipsoid of the first fingertip: that of press strokes."""
    return find_ellipsoids(scene)[0]


def make_rest(scene: Scene) -> Instant:
    """Return the bed of a scene that nobody has touched yet."""
    return Instant.at_rest(scene.layout, scene.actuator, find_ellipsoids(scene))


def read(path: Path, index: int = -1) -> Instant:
    """Read an instant of a finished run."""
    if path.name != "history.npz":
        raise OutputError(f"{path} is not the history.npz of a run's folder.")
    run = finished_run.read_run(path.parent, *ARRAYS)
    scene = run.scene
    sizes = {
        "pitch": scene.layout.pitch,
        "actuator": scene.actuator,
        "finger": find_ellipsoids(scene),
    }
    return Instant.of(run.history, index, **sizes)
