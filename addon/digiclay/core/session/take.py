"""Take: initial state and fingers' paths of a session, replayed bit for bit.

The path is a pose at the start and one at the end of every control period, with straight motion
between them; the path, the orders in each period, and the state at the start determine all
states. The state at the end is stored too, so that a replay can be verified.
"""

import io
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby, islice

import numpy as np

from ..base.arrays import Array, Floats
from ..base.errors import OutputError, ParameterError
from ..control.orders import FARTHEST, STRONGEST, Orders, add_verbs, find_fault
from ..engine.bodies import Knot, give_bodies
from ..engine.simulation import begin
from ..engine.state import State
from ..engine.system import System
from ..files.formats import BROKEN_ZIP, read_array, read_heads
from ..files.tables import parse_tables
from ..model.trajectory import Path, Waypoint
from ..scene.assembly import assemble
from ..scene.schema import Presser, Scene
from ..scene.toml_table import format_scene, resolve
from ..shapes.body import pack_mesh
from . import snapshot
from .given_bodies import BODIES, GIVEN, find_motion, pack_bodies, unpack_bodies
from .live_session import AWAY, Recording, simulate_path

#: Waypoints this close to the straight line between their neighbors are left out, m and 1.
STRAIGHT = 1e-12
#: The arrays of a take.
PARTS = ("scene", "start", "poses", "end")
#: Versions of the format: 1, which is not written down, has poses (t + 1, 7) of one finger; 2 has
#: (t + 1, f, 7); 3 also has the array `SMOOTHING` (t, 4), orders that smooth; 4 has orders (t, 5)
#: and their surfaces (s, n) instead; 5 has more fingers than the scene; 6 has bodies. A take with
#: none of these is written as 2, which older releases read.
PLAIN, ORDERED, SEVERAL, VERSION = 2, 4, 5, 6
SMOOTHING, ORDERS, SURFACES, BASE = "smoothing", "orders", "surfaces", "base"
#: Most parts of a physics step in a replay.
MOST_PARTS = 64


@dataclass(frozen=True, eq=False)
class Take:
    """Stretch of a session.

    Raises ParameterError when there is no period, a pose is not finite, the scene has another
    number of fingers, or orders or base are invalid.
    """

    scene: Scene
    """Its trajectory is not used: the fingertip follows `poses`."""
    start: bytes
    poses: Floats
    """(t + 1, f, 7): Fingers at the start, and at the end of each of t control periods: lowest point, m, and
    unit quaternion. After those of the scene follow the fingers of strokes' images, like the first one: they
    are present in the periods between two poses that are not AWAY."""
    end: bytes
    """The states before and after, from `snapshot.dump`."""
    orders: Orders | None = None
    """Orders of brushes, see `control.orders`; None: none in any period."""
    base: Floats | None = None
    """(n,): Heights that strokes count from at the end, m; None: of a session without strokes."""
    knots: tuple[Knot, ...] = ()
    """The scene's bodies, if it has any."""

    def __post_init__(self) -> None:
        fingers = len(self.scene.fingers)
        kind, shape = self.poses.dtype, self.poses.shape
        sized = len(shape) == 3 and shape[0] > 1 and shape[1] >= fingers and shape[2] == 7
        if not sized or kind != np.float64:
            rule = f"must have at least one control period of {fingers} x 7 numbers, one pose per finger"
            raise ParameterError("Take", "poses", rule, f"an array of the shape {shape} of {kind}")
        sound = (np.abs(self.poses) <= FARTHEST) & (np.abs(self.poses[..., 3:]).max(2) > 0.1)[
            ..., None
        ]
        if not sound.all():
            rule = "must be finite numbers, quaternions not 0"
            raise ParameterError(
                "Take", "poses", rule, f"row {int(np.argwhere(~sound)[0][0])} is not"
            )
        pins, stroke = self.scene.cells, self.scene.actuator.stroke
        base = self.base
        if base is not None and not (base.shape == (pins,) and np.isfinite(base).all()):
            rule = f"must be {pins} finite heights, one per pin of the bed"
            raise ParameterError("Take", BASE, rule, f"an array of the shape {base.shape}")
        if self.orders is None:
            return
        fault = find_fault(self.orders, self.periods, pins, stroke)
        if fault:
            rule = (
                f"must hold x, y or a surface, a radius, a strength up to {STRONGEST:g} and a verb for each "
                f"of {self.periods} periods, and surfaces of {pins} heights within the stroke"
            )
            raise ParameterError("Take", ORDERS, rule, fault)

    @property
    def periods(self) -> int:
        """Number of control periods."""
        return len(self.poses) - 1

    @property
    def fingers(self) -> list[int]:
        """Number of fingers in each period."""
        fingers = len(self.scene.fingers)
        present = (self.poses[:, fingers:] != AWAY).any(axis=2)
        return (fingers + (present[1:] & present[:-1]).sum(axis=1)).tolist()

    @property
    def duration(self) -> float:
        """Duration, s."""
        return self.periods * self.scene.simulation.control_period


def replay(take: Take, scene: Scene | None = None) -> Iterator[State]:
    """Simulate a take again, or as another scene integrates it; a state is valid until the next one."""
    return (state for _, state in islice(play(take, scene), 1, None))


def play(take: Take, scene: Scene | None = None) -> Iterator[tuple[System, State]]:
    """Yield system and state of a take, as `replay`, at its start and after each period."""
    scene = scene or take.scene
    bodies = len(scene.bodies)

    def prepare(count: int) -> System:
        system = assemble(scene.with_fingers(count))
        give_bodies(system, take.knots)
        return system

    def change(system: System, state: State, count: int) -> tuple[System, State]:
        had = system.fingers - bodies
        if count == had:
            return system, state
        other = prepare(count)
        former = snapshot.place_fingers(had, count, bodies)
        return other, snapshot.change_fingers(system, other, state, former)

    system = prepare(snapshot.count_fingers(take.start) - bodies)
    state, first = snapshot.load(system, take.start), 0
    end = take.end and snapshot.count_fingers(take.end) - bodies
    yield system, state
    for count, group in groupby(take.fingers):
        system, state = change(system, state, count)
        last = first + len(list(group))
        orders = take.orders and replace(take.orders, rows=take.orders.rows[first:last])
        path = take.poses[first : last + 1, :count]
        for first, state in enumerate(simulate_path(system, state, path, orders), first + 1):  # noqa: B020
            yield change(system, state, end or count) if first == take.periods else (system, state)


def refine(scene: Scene, parts: int) -> Scene:
    """Return a scene with physics steps of 1 to 64 parts; control is sampled as before."""
    if not 1 <= parts <= MOST_PARTS:
        raise ParameterError("Take", "parts", f"must be from 1 to {MOST_PARTS}", str(parts))
    return replace(scene, simulation=scene.simulation.refined(parts))


def to_scene(take: Take, name: str) -> Scene:
    """Return a take from rest as a scene that `digiclay run` simulates; OutputError for any other take."""
    if take.orders is not None:
        raise OutputError(
            f"The take {name!r} has strokes in which the valves drive pins by themselves, and a scene file "
            "holds the fingertip's path alone: record a take of the fingertip for export."
        )
    whole = take.scene.with_fingers(take.poses.shape[1])
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
        for number, finger in enumerate(whole.fingers)
    )
    bodies = _trace_bodies(take, name, snapshot.load(system, take.start).period)
    return replace(take.scene, name=name, simulation=lasting, fingers=fingers, bodies=bodies)


def _trace_bodies(take: Take, name: str, first: int) -> tuple[Presser, ...]:
    """Return the bodies of a take, from a period on, with meshes and paths; OutputError unless rigid."""
    # A body that has jumped is where it was last.
    knots = {max(0, period - first): bodies for period, bodies in take.knots}
    times = np.array(list(knots)) * take.scene.simulation.control_period
    traced = []
    for each, given in zip(take.scene.bodies, zip(*knots.values(), strict=True), strict=True):
        motion = find_motion(given)
        if motion is None:
            raise OutputError(
                f"The take {name!r} has a presser that deforms or changes its size, and a body of a scene "
                "file is rigid: bake the take, or record rigid pressers for export."
            )
        mesh, poses = motion
        body = replace(each.body, mesh=pack_mesh(*mesh))
        traced.append(Presser(body, _make_path(times, poses)))
    return tuple(traced)


def _make_path(times: Floats, poses: Floats) -> Path:
    """Return poses (t, 7) at times (t,), s, as the path of a scene."""
    needed = np.ones(len(poses), bool)
    part = ((times[1:-1] - times[:-2]) / (times[2:] - times[:-2]))[:, None]
    straight = poses[:-2] + part * (poses[2:] - poses[:-2])
    needed[1:-1] = 2.0 * np.abs(poses[1:-1] - straight).max(axis=1) > STRAIGHT
    waypoints = (
        Waypoint(float(times[row]), tuple(poses[row, :3].tolist()), tuple(poses[row, 3:].tolist()))
        for row in np.flatnonzero(needed)
    )
    return Path("linear", tuple(waypoints))


def _is_at_rest(system: System, start: bytes) -> bool:
    """Return whether a state is that of an untouched bed, however long it has been at rest."""
    state, rest = snapshot.load(system, start), begin(system)
    return (
        all(np.array_equal(state.row(index), rest.row(index)) for index in range(len(rest.rows)))
        and np.array_equal(state.mode(), rest.mode())
        and snapshot.dump(system, rest._replace(memory=state.memory)) == snapshot.dump(system, rest)
    )


def to_bytes(take: Take) -> bytes:
    """Write a take as numpy's ``.npz``"""
    written = io.BytesIO()
    orders = take.orders
    several = take.poses.shape[1] > len(take.scene.fingers)
    ordered = {} if orders is None else {ORDERS: orders.rows, SURFACES: np.array(orders.surfaces)}
    version = SEVERAL if several else ORDERED if ordered else PLAIN
    based = {} if take.base is None else {BASE: take.base}
    np.savez(
        written,
        scene=np.frombuffer(format_scene(replace(take.scene, bodies=())).encode(), np.uint8),
        start=np.frombuffer(take.start, np.uint8),
        poses=take.poses,
        end=np.frombuffer(take.end, np.uint8),
        version=np.array(VERSION if take.scene.bodies else version),
        **ordered,
        **based,
        **pack_bodies(take.scene, take.knots),
    )
    return written.getvalue()


def from_bytes(data: bytes) -> Take:
    """Read what `to_bytes` wrote; OutputError when it is damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            stored = archive.namelist()
            optional = ("version", SMOOTHING, ORDERS, SURFACES, BASE, *GIVEN)
            names = [*PARTS, *(name for name in optional if f"{name}.npy" in stored)]
            heads = read_heads(archive, names)
            # `to_bytes` does not compress: a take unpacks to at most its own size.
            size = sum(head.size for head in heads.values())
            if size > len(data):
                raise ValueError(
                    f"it must unpack to at most its own {len(data):,} bytes (got {size:,})"
                )
            parts = {name: read_array(archive, name) for name in names}
        scene, start, poses, end = (parts[name] for name in PARTS)
        if "version" not in parts:
            poses = poses[:, None]  # the first version had one finger
        elif not PLAIN <= int(parts["version"].reshape(())) <= VERSION:
            raise ValueError(f"its version must be at most {VERSION} (got {parts['version']})")
        resolved = resolve(parse_tables(scene.tobytes().decode()))
        resolved, knots = unpack_bodies(resolved, parts) if BODIES in parts else (resolved, ())
        states = start.tobytes(), poses, end.tobytes()
        return Take(resolved, *states, _read_orders(parts), parts.get(BASE), knots)
    except (
        OSError,
        EOFError,
        LookupError,
        ValueError,
        TypeError,
        ArithmeticError,
        *BROKEN_ZIP,
    ) as error:
        raise OutputError(f"The take is damaged and cannot be read: {error}.") from None


def _read_orders(parts: dict[str, Array]) -> Orders | None:
    """Return the orders in a take's arrays, which some versions lack."""
    if SMOOTHING in parts:
        return Orders(add_verbs(parts[SMOOTHING]))
    return Orders(parts[ORDERS], tuple(parts[SURFACES])) if ORDERS in parts else None


def make_take(
    scene: Scene, recording: Recording, end: bytes, base: Floats | None = None
) -> Take | None:
    """Return a recording as a take, with snapshot and base of its end; None without a control period."""
    if recording.count < 2:
        return None
    orders = recording.orders
    orders = orders and replace(orders, rows=orders.rows.copy())
    return Take(scene, recording.start, recording.path.copy(), end, orders, base, recording.knots)
