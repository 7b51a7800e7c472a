"""Takes of a bed in the .blend: properties that copies, appends and undo include."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..core.base.errors import DigiclayError
from ..core.engine.bodies import Knot, give_bodies
from ..core.engine.simulation import begin
from ..core.model.trajectory import sample_poses
from ..core.scene.assembly import assemble
from ..core.scene.schema import Scene
from ..core.session import snapshot
from ..core.session.given_bodies import place_bodies
from ..core.session.live_session import simulate_path
from ..core.session.take import Take, from_bytes, make_take, to_bytes
from ..roles import fingertips_of
from ..sessions.running import Running
from ..sessions.sculpting import pack
from ..ui_text import localize
from .bake import INTERVAL

if TYPE_CHECKING:
    from bpy.types import Object

#: The bed's property that holds them, by number.
PROPERTY = "digiclay_takes"
#: Most cells times control periods that are simulated while somebody waits: some seconds' worth.
MOST = 8_000_000
#: When a path begins, s.
START = np.zeros(1)


class Entry(NamedTuple):
    """Row in the list of takes."""

    #: Its name in the property; never used twice in one bed.
    number: str
    #: The user's.
    name: str
    seconds: float
    #: What its session took, s, and its estimated errors of height, m, and force, N, where they are
    #: known.
    effort: tuple[float, ...]


def list_takes(bed: Object) -> list[Entry]:
    """Return the takes of a bed, oldest first."""
    takes = bed.get(PROPERTY) or {}
    numbers = sorted(takes.keys(), key=int)
    rows = ((number, takes[number]) for number in numbers)
    return [
        Entry(number, row["name"], row["seconds"], tuple(row.get("effort", ())))
        for number, row in rows
    ]


def find(bed: Object, number: str = "") -> Entry:
    """Return the row of one take of a bed, by default the last; raise DigiclayError where there is none."""
    entries = list_takes(bed)
    if not entries and not number:
        raise DigiclayError(f"{bed.name} has no take: record one in a session first.")
    matching = [entry for entry in entries if number in ("", entry.number)]
    if not matching:
        numbers = ", ".join(entry.number for entry in entries) or "none"
        raise DigiclayError(f"{bed.name} has no take {number!r}: its takes are {numbers}.")
    return matching[-1]


def read_recording(session: Running) -> Take | None:
    """Return what a session has recorded, or None when that is nothing yet."""
    recording = session.recording
    if recording is None:
        return None
    return make_take(session.scene, recording, pack(session).snapshot, session.base)


def add(bed: Object, take: Take, name: str = "", session: Running | None = None) -> Entry:
    """Add a take to a bed, with fingertips, time and errors of its session; without a name by its number."""
    if PROPERTY not in bed:
        bed[PROPERTY] = {}
    takes = bed[PROPERTY]
    number = str(max(map(int, takes.keys()), default=0) + 1)
    takes[number] = {
        "name": name or f"Take {number}",
        "seconds": take.duration,
        "data": to_bytes(take),
    }
    if session:
        takes[number]["fingers"] = bytes(session.numbers)
        takes[number]["effort"] = [take.periods * session.clock.cost, *(session.errors or ())[:2]]
    return find(bed, number)


def keep_recording(bed: Object, session: Running) -> str:
    """Keep what a session has recorded before its recording ends; return words about it, empty without."""
    take = read_recording(session)
    if take is None:
        return ""
    entry = add(bed, take, session=session)
    return localize("The recording ended and was kept as {} ({:.1f} s)", entry.name, entry.seconds)


def read(bed: Object, number: str = "") -> Take:
    """Return a take of a bed, by default the last; raise DigiclayError if it is missing or damaged."""
    number = find(bed, number).number  # first: a bed without takes has no such property
    return from_bytes(bytes(bed[PROPERTY][number]["data"]))


def list_fingers(bed: Object, number: str, count: int) -> tuple[int, ...]:
    """Return the numbers of so many fingertips of a take; where it has none, those of the bed, if as many."""
    stored = bed[PROPERTY][find(bed, number).number].get("fingers")
    every = (
        stored if isinstance(stored, bytes) else b"",
        tuple(fingertips_of(bed)),
        range(1, count + 1),
    )
    return next(tuple(numbers) for numbers in every if len(numbers) == count)


def remove(bed: Object, number: str) -> None:
    """Remove a take of a bed; raise DigiclayError where there is none of that number."""
    number = find(bed, number).number
    del bed[PROPERTY][number]


def simulate(scene: Scene) -> Take | None:
    """Return the session of a scene, from rest to its end; None when that would take too long."""
    if scene.cells * scene.periods > MOST:
        return None
    knots: tuple[Knot, ...] = ()
    if scene.bodies:
        every = max(1, int(INTERVAL / scene.simulation.control_period))
        scene, knots = place_bodies(scene, [*range(0, scene.periods, every), scene.periods])
    system = assemble(scene)
    give_bodies(system, knots)
    times = np.arange(scene.periods + 1) * scene.simulation.control_period
    poses = sample_poses(scene.trajectories(), times)
    state = begin(system)
    start = snapshot.dump(system, state)
    # Only the last state is wanted: the others' arrays are used up.
    (state,) = deque(simulate_path(system, state, poses), maxlen=1)
    return Take(scene, start, poses, snapshot.dump(system, state), knots=knots)
