"""Take: initial state and fingers' paths of a session, replayed bit for bit.

The path is a pose at the start and one at the end of every control period, between which the
finger goes straight; that and the state at the start decide all that follows. The state at
the end is kept as well, so that a replay can prove that it came to the same.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..base.errors import OutputError, ParameterError
from ..base.npz import BROKEN_ZIP, read_array, read_heads
from ..base.toml_text import parse_tables
from ..engine.simulation import begin
from ..engine.state import State
from ..engine.system import System
from ..model.trajectory import Path, Waypoint
from ..scene.assembly import assemble
from ..scene.schema import Scene
from ..scene.toml_table import format_scene, resolve
from . import snapshot
from .live_periods import simulate_path

__all__ = ["Take", "from_bytes", "refine", "replay", "to_bytes", "to_scene"]

Floats = NDArray[np.float64]

#: Waypoints that lie this near to the straight way between their neighbors are left out, m and 1.
STRAIGHT = 1e-12
#: The arrays of a take.
PARTS = ("scene", "start", "poses", "end")
#: What the number of a format's version stands for: 1, which is not written down, has poses (t + 1, 7) of one
#: finger; 2 has (t + 1, f, 7).
VERSION = 2
#: Most parts a physics step is cut into when a take is simulated once more.
MOST_PARTS = 64


@dataclass(frozen=True, eq=False)
class Take:
    """Stretch of a session.

    Attributes
    ----------
    scene : Scene
        Its trajectory is not used: the finger follows `poses`.
    start, end : bytes
        The states before and after, from `snapshot.dump`.
    poses : ndarray (t + 1, f, 7)
        Fingers at the start, and at the end of each of t control periods: lowest point, m,
        and unit quaternion.

    Raises
    ------
    ParameterError
        When there is no period, a pose is not finite, or the scene has another number of fingers.
    """

    scene: Scene
    start: bytes
    poses: Floats
    end: bytes

    def __post_init__(self) -> None:
        fingers = len(self.scene.fingers)
        if self.poses.shape[1:] != (fingers, 7) or len(self.poses) < 2:
            rule = f"must hold one control period at least, of {fingers} x 7 numbers, a pose a finger"
            raise ParameterError("Take", "poses", rule, f"an array of the shape {self.poses.shape}")
        if not np.isfinite(self.poses).all():
            row = int(np.argwhere(~np.isfinite(self.poses))[0][0])
            raise ParameterError("Take", "poses", "must be finite numbers", f"row {row} is not")

    @property
    def periods(self) -> int:
        """Number of control periods."""
        return len(self.poses) - 1

    @property
    def duration(self) -> float:
        """How long it lasts, s."""
        return self.periods * self.scene.simulation.control_period


def replay(take: Take, scene: Scene | None = None) -> Iterator[State]:
    """Simulate a take once more.

    Parameters
    ----------
    take : Take
    scene : Scene, optional
        Another way to integrate it, such as `refine`; the take's own when left out.

    Yields
    ------
    State
        After each period; valid until the next one is asked for.
    """
    system = assemble(scene or take.scene)
    yield from simulate_path(system, snapshot.load(system, take.start), take.poses)


def refine(scene: Scene, parts: int) -> Scene:
    """Return a scene whose physics steps are cut into `parts`; control is sampled as before.

    Parameters
    ----------
    scene : Scene
    parts : int
        From 1 to 64.

    Raises
    ------
    ParameterError
        When `parts` is not from 1 to 64.
    """
    if not 1 <= parts <= MOST_PARTS:
        raise ParameterError("Take", "parts", f"must be from 1 to {MOST_PARTS}", str(parts))
    return replace(scene, simulation=scene.simulation.refined(parts))


def to_scene(take: Take, name: str) -> Scene:
    """Return a take as a scene that `digiclay run` simulates.

    Parameters
    ----------
    take : Take
    name : str
        Of the scene.

    Raises
    ------
    OutputError
        When the take does not begin at rest: a scene file has no other beginning.
    """
    system = assemble(take.scene)
    if not _is_at_rest(system, take.start):
        raise OutputError(
            f"The take {name!r} begins on a bed that is formed already, and a scene file begins at rest: "
            "reset the session before recording a take for export."
        )
    times = np.arange(len(take.poses)) * take.scene.simulation.control_period
    lasting = replace(take.scene.simulation, duration=float(times[-1]))
    fingers = tuple(
        replace(finger, trajectory=_make_path(times, take.poses[:, number]))
        for number, finger in enumerate(take.scene.fingers)
    )
    return replace(take.scene, name=name, simulation=lasting, fingers=fingers)


def _make_path(times: Floats, poses: Floats) -> Path:
    """Return a finger's poses (t, 7) at times (t,), s, as the path of a scene."""
    waypoints = (
        Waypoint(float(times[row]), tuple(poses[row, :3].tolist()), tuple(poses[row, 3:].tolist()))
        for row in np.flatnonzero(_find_turns(poses))
    )
    return Path("linear", tuple(waypoints))


def _is_at_rest(system: System, start: bytes) -> bool:
    """Return whether a state is that of a bed nothing has happened to, however long it has waited."""
    state, rest = snapshot.load(system, start), begin(system)
    return (
        all(np.array_equal(state.row(index), rest.row(index)) for index in range(len(rest.rows)))
        and np.array_equal(state.mode(), rest.mode())
        and snapshot.dump(system, rest._replace(memory=state.memory)) == snapshot.dump(system, rest)
    )


def _find_turns(poses: Floats) -> NDArray[np.bool_]:
    """Return the poses that are needed to draw the path with straight lines, evenly spaced in time."""
    needed = np.ones(len(poses), bool)
    bend = np.abs(poses[2:] - 2.0 * poses[1:-1] + poses[:-2]).max(axis=1)
    needed[1:-1] = bend > STRAIGHT
    return needed


def to_bytes(take: Take) -> bytes:
    """Write a take as numpy's ``.npz``"""
    written = io.BytesIO()
    np.savez(
        written,
        scene=np.frombuffer(format_scene(take.scene).encode(), np.uint8),
        start=np.frombuffer(take.start, np.uint8),
        poses=take.poses,
        end=np.frombuffer(take.end, np.uint8),
        version=np.array(VERSION),
    )
    return written.getvalue()


def from_bytes(data: bytes) -> Take:
    """Read what `to_bytes` wrote.

    Raises
    ------
    OutputError
        When it is damaged.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = (*PARTS, "version")[: 5 if "version.npy" in archive.namelist() else 4]
            held = read_heads(archive, names)
            # `to_bytes` does not compress: a take unpacks to no more than it is.
            size = sum(head.size for head in held.values())
            if size > len(data):
                raise ValueError(f"it must unpack to at most its own {len(data):,} bytes (got {size:,})")
            scene, start, poses, end, *version = (read_array(archive, name) for name in names)
        if not version:
            poses = poses[:, None]  # the first version held one finger
        elif int(version[0]) != VERSION:
            raise ValueError(f"its version must be at most {VERSION} (got {version[0]})")
        return Take(resolve(parse_tables(scene.tobytes().decode())), start.tobytes(), poses, end.tobytes())
    except (OSError, EOFError, KeyError, ValueError, TypeError, RecursionError, *BROKEN_ZIP) as error:
        raise OutputError(f"The take is damaged and cannot be read: {error}.") from None
