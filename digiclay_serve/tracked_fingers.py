"""Tracked fingers: poses with identities, which are off, late and trembling, to aims of fingertips.

A tracked pose goes through a clutch, a filter and a virtual coupling; each is a pure function of arrays with
a row a finger. No clock, no bed: `served_session` has both.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats
from numpy.typing import NDArray

#: Height of a fingertip that is not there, m; whatever is as high is simulated at next to no cost.
PARKED = 1.0
#: Height over the highest pin from which on a fingertip goes anywhere without touching, m.
CLEAR = 5e-3
#: A hand is no farther from where it was a message ago, m: what is has another identity's name, or is new.
JUMP = 25e-3
#: Of the 1-euro filter: cutoff of the speed, Hz, and what a speed adds to the cutoff, Hz per m/s.
SPEED_CUTOFF, HASTE = 1.0, 20.0


@dataclass(frozen=True)
class Tracking:
    """Parameters of the way from tracked to simulated fingertips; 0 leaves a part out."""

    #: Time after which a finger lifts whose identity is not named, s.
    lift: float = 0.1
    #: Clutch: height over the pins around at which it slips, m; a finger that appears begins there.
    clutch: float = 0.0
    #: Least cutoff of the 1-euro filter (Casiez, Roussel, Vogel 2012), Hz.
    cutoff: float = 0.0
    #: Spring between tracked and simulated fingertip, N/m.
    coupling: float = 0.0


TRACKING = Tracking()


class Felt(NamedTuple):
    """What the fingertips feel: a row a finger."""

    #: (f, 7), simulated.
    poses: Floats
    #: (f,), N; with what has relaxed of it; and how much it grows with depth at once, N/m.
    force: Floats
    tension: Floats
    stiffness: Floats
    #: (f,): highest pin around each, m.
    top: Floats
    #: Depth in which the force of a pin grows e times, m.
    growth: float
    #: Highest pin of the bed, m.
    peak: float


@dataclass(frozen=True, eq=False)
class Tracks:
    """Identities of the fingertips, and what was tracked of each."""

    #: (f,): -1 for none.
    identities: NDArray[np.int64]
    #: (f,): time since each was named, s.
    unnamed: Floats
    #: (f, 7): tracked, before that, and filtered; (f, 3): speed, m/s.
    tracked: Floats
    before: Floats
    filtered: Floats
    speed: Floats
    #: (f,): what the clutch has slipped, m.
    slip: Floats
    #: (f,): whether the fingertip has come to where its identity is; else it is on its way up.
    there: NDArray[np.bool_]


def begin_tracks(poses: Floats) -> Tracks:
    """Return the tracks of fingertips (f, 7) that nobody has named."""
    count = len(poses)
    return Tracks(
        np.full(count, -1), np.zeros(count), poses, poses, poses, np.zeros((count, 3)), np.zeros(count),
        np.zeros(count, bool),
    )  # fmt: skip


def name_fingers(tracks: Tracks, named: Sequence[tuple[int, Sequence[float]]]) -> Tracks:
    """Return the tracks after a message: identities, none twice, and their poses (7,).

    A known identity keeps its fingertip, a new one gets the first that is free; without any it waits.
    """
    poses, ids = dict(named), tracks.identities.copy()
    unnamed, tracked, fresh = tracks.unnamed.copy(), tracks.tracked.copy(), np.zeros(len(ids), bool)
    _put_back_exchanged(ids, tracked, poses)
    known = {identity: slot for slot, identity in enumerate(ids.tolist())}
    free = iter(np.flatnonzero(ids < 0).tolist())
    taken = {one: known[one] if one in known else next(free, None) for one in poses}
    found = {one: slot for one, slot in taken.items() if slot is not None}
    slots, now = [*found.values()], np.array([poses[one] for one in found]).reshape(-1, 7)
    fresh[slots] = (ids[slots] < 0) | (np.linalg.norm(tracked[slots, :3] - now[:, :3], axis=1) > JUMP)
    ids[slots], unnamed[slots], tracked[slots] = [*found], 0.0, now
    was = fresh[:, None]
    return replace(
        tracks, identities=ids, unnamed=unnamed, tracked=tracked, there=tracks.there & ~fresh,
        before=np.where(was, tracked, tracks.before), filtered=np.where(was, tracked, tracks.filtered),
        speed=np.where(was, 0.0, tracks.speed), slip=np.where(fresh, math.inf, tracks.slip),
    )  # fmt: skip


def _put_back_exchanged(ids: NDArray[np.int64], tracked: Floats, poses: dict[int, Sequence[float]]) -> None:
    """Put back identities (f,) that have changed places in a message."""
    known = np.array([slot for slot, identity in enumerate(ids.tolist()) if identity in poses], np.intp)
    now = np.array([poses[identity][:3] for identity in ids[known].tolist()]).reshape(-1, 3)
    own = np.linalg.norm(now - tracked[known, :3], axis=1)
    if own.max(initial=0.0) <= 0.2 * JUMP:
        return
    way, stay = np.linalg.norm(now[:, None] - tracked[known, :3], axis=2), own[:, None] + own
    # Fingers go on where they were: what is far nearer to the other's place has its name.
    for i, j in np.argwhere(np.triu(2.0 * (way + way.T) < stay, 1) & (stay > 0.4 * JUMP)).tolist():
        ids[known[[i, j]]] = ids[known[[j, i]]]


def advance(tracks: Tracks, tracking: Tracking, felt: Felt, time: float) -> tuple[Tracks, Floats]:
    """Return the tracks after a time, s, and where the fingertips are to be then (f, 7)."""
    unnamed = tracks.unnamed + time
    ids = np.where(unnamed >= tracking.lift * (1.0 - 1e-9), -1, tracks.identities)
    held, poses = ids >= 0, tracks.tracked
    filtered, speed = poses, tracks.speed
    if tracking.cutoff:
        filtered, speed = smooth(tracks, tracking.cutoff, time)
    goal = filtered.copy()
    slip = np.zeros(len(ids))
    if tracking.clutch:
        slip = np.minimum(tracks.slip, felt.top + tracking.clutch - goal[:, 2])
        goal[:, 2] += slip
    if tracking.coupling:
        goal[:, 2] = give_way(goal[:, 2], felt, tracking.coupling)
    there = held & (tracks.there | (felt.poses[:, 2] >= felt.peak + CLEAR))
    away = felt.poses.copy()
    away[:, 2] = PARKED
    after = replace(
        tracks, identities=ids, unnamed=unnamed, before=poses, filtered=filtered, speed=speed, slip=slip,
        there=there,
    )  # fmt: skip
    return after, np.where(there[:, None], goal, away)


def smooth(tracks: Tracks, cutoff: float, time: float) -> tuple[Floats, Floats]:
    """Return poses (f, 7) and speeds (f, 3), m/s, of the 1-euro filter after a time, s. `cutoff`: Hz."""
    passed = (tracks.tracked[:, :3] - tracks.before[:, :3]) / time
    speed = tracks.speed + _share(SPEED_CUTOFF, time) * (passed - tracks.speed)
    quick = cutoff + HASTE * np.linalg.norm(speed, axis=1, keepdims=True)
    # A quaternion and its negative are one turn.
    sign = np.sign((tracks.tracked[:, 3:] * tracks.filtered[:, 3:]).sum(1, keepdims=True))
    goal = np.hstack([tracks.tracked[:, :3], np.where(sign < 0.0, -1.0, 1.0) * tracks.tracked[:, 3:]])
    filtered = tracks.filtered + _share(quick, time) * (goal - tracks.filtered)
    filtered[:, 3:] /= np.linalg.norm(filtered[:, 3:], axis=1, keepdims=True)
    return filtered, speed


def _share(cutoff: float | Floats, time: float) -> float | Floats:
    """Return the share of the way to its input that a low-pass filter goes in a time, s. `cutoff`: Hz."""
    return 1.0 / (1.0 + 1.0 / (2.0 * math.pi * time * cutoff))


def give_way(height: Floats, felt: Felt, coupling: float) -> Floats:
    """Return the heights (f,), m, of fingertips on springs, N/m, from tracked ones at `height`.

    In balance with the force at the new height, which its stiffness foretells: no step is too long, and no
    force too large. Below the pins around it a fingertip descends by `growth` at most.
    """
    here = felt.poses[:, 2]
    balanced = (coupling * height + felt.force + felt.stiffness * here) / (coupling + felt.stiffness)
    # The spring never pulls: clay does not stick to a fingertip.
    return np.maximum(np.maximum(balanced, height), np.minimum(here, felt.top) - felt.growth)
