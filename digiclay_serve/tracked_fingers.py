"""Tracked fingers: poses with identities, which are off, late and trembling, to aims of fingertips.

A tracked pose goes through a clutch and a filter; each is a pure function of arrays with one row
per finger. No clock, no bed: `served_session` has both. A finger yields as its hand does.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from digiclay.core.base.arrays import Flags, Floats, Indices

#: Height of a fingertip that is not there, m; whatever is as high is simulated at next to no cost.
PARKED = 1.0
#: Height over the highest pin from which on a fingertip goes anywhere without touching, m.
CLEAR = 5e-3
#: A finger is no farther aside from where it was named last, m, and m per s since, and no finger is
#: nearer to another, m: what is farther has another one's name, or is none. Nothing tracked is
#: farther from the bed, m.
JUMP, PACE, APART, FAR = 6e-3, 0.25, 15e-3, 1e3
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


TRACKING = Tracking()


class Felt(NamedTuple):
    """What the fingertips are near to: one row per finger."""

    #: (f, 7), intended by the simulated hand.
    poses: Floats
    #: Highest pin of the bed, m.
    peak: float
    #: Looks for the highest pins around, (f,), m, which the clutch needs.
    look: Callable[[], Floats]


@dataclass(frozen=True, eq=False)
class Tracks:
    """Identities of the fingertips, and what was tracked of each."""

    #: (f,): -1 for none.
    identities: Indices
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
    there: Flags


def begin_tracks(poses: Floats) -> Tracks:
    """Return the tracks of fingertips (f, 7) that nobody has named."""
    count = len(poses)
    return Tracks(
        np.full(count, -1),
        np.zeros(count),
        poses,
        poses,
        poses,
        np.zeros((count, 3)),
        np.zeros(count),
        np.zeros(count, bool),
    )


def name_fingers(tracks: Tracks, named: Sequence[tuple[int, Sequence[float]]]) -> Tracks:
    """Return the tracks after a message: identities, none twice, and their poses (7,).

    A known identity keeps its fingertip, a new one gets that of one gone from its place, or the
    first that is free; without any it waits. What is elsewhere all at once counts as not named.
    """
    poses = np.array([pose for _, pose in named]).reshape(-1, 7)
    poses[:, :3] = poses[:, :3].clip(-FAR, FAR)
    rows, ids = {identity: row for row, (identity, _) in enumerate(named)}, tracks.identities.copy()
    unnamed, tracked, fresh = tracks.unnamed.copy(), tracks.tracked.copy(), np.zeros(len(ids), bool)
    most = np.minimum(JUMP + PACE * unnamed, APART)
    _put_back_exchanged(ids, tracked, rows, poses)
    _hand_over(ids, tracked, rows, poses, most)
    slots = {identity: slot for slot, identity in enumerate(ids.tolist())}
    free = iter(np.flatnonzero(ids < 0).tolist())
    for identity, row in rows.items():
        slot = slots.get(identity)
        if slot is None:
            slot = next(free, None)
            if slot is None:
                continue
            fresh[slot] = True
        elif math.dist(poses[row, :2], tracked[slot, :2]) > most[slot]:
            continue
        ids[slot], unnamed[slot], tracked[slot] = identity, 0.0, poses[row]
    was = fresh[:, None]
    return replace(
        tracks,
        identities=ids,
        unnamed=unnamed,
        tracked=tracked,
        there=tracks.there & ~fresh,
        before=np.where(was, tracked, tracks.before),
        filtered=np.where(was, tracked, tracks.filtered),
        speed=np.where(was, 0.0, tracks.speed),
        slip=np.where(fresh, math.inf, tracks.slip),
    )


def _put_back_exchanged(
    ids: Indices, tracked: Floats, rows: Mapping[int, int], poses: Floats
) -> None:
    """Put back identities (f,) that have changed places in a message, which has their poses in rows."""
    named = np.array([identity in rows for identity in ids.tolist()]).nonzero()[0]
    now = poses[[rows[identity] for identity in ids[named].tolist()], :3]
    distance = np.linalg.norm(now[:, None] - tracked[named, :3], axis=2)
    moved = distance.diagonal()
    # Fingers go on where they were: what is far nearer to another's place has its name. Those that
    # go around in a ring of such places have exchanged theirs.
    nearest = np.arange(named.size)
    for finger in (moved > JUMP).nonzero()[0]:
        if 2.0 * distance[finger].min() < moved[finger]:
            nearest[finger] = distance[finger].argmin()
    ring = nearest
    for _ in nearest:
        ring = nearest[ring]
    ids[named[nearest[ring]]] = ids[named[ring]]


def _hand_over(
    ids: Indices, tracked: Floats, rows: Mapping[int, int], poses: Floats, most: Floats
) -> None:
    """Give identities (f,) that are not named to new ones that are nearest to them, `most` (f,) m away."""
    held = np.flatnonzero(ids >= 0)
    new = [identity for identity in rows if identity not in set(ids.tolist())]
    if not (new and held.size):
        return
    now = poses[[rows[identity] for identity in new], :3]
    distance = np.linalg.norm(now[:, None] - tracked[held, :3], axis=2)
    for identity, apart in zip(new, distance, strict=True):
        nearest = int(apart.argmin())
        slot = held[nearest]
        near = apart[nearest] <= min(most[slot], distance[:, nearest].min())
        if near and int(ids[slot]) not in rows:
            ids[slot] = identity


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
        # What is not there yet feels other pins than it will.
        most = np.where(tracks.there, felt.look() + tracking.clutch - goal[:, 2], math.inf)
        slip = np.minimum(tracks.slip, most)
        goal[:, 2] += slip
    goal[~tracks.there, 2] = PARKED
    there = held & (tracks.there | (felt.poses[:, 2] >= felt.peak + CLEAR))
    away = felt.poses.copy()
    away[:, 2] = PARKED
    after = replace(
        tracks,
        identities=ids,
        unnamed=unnamed,
        before=poses,
        filtered=filtered,
        speed=speed,
        slip=slip,
        there=there,
    )
    return after, np.where(there[:, None], goal, away)


def smooth(tracks: Tracks, cutoff: float, time: float) -> tuple[Floats, Floats]:
    """Return poses (f, 7) and speeds (f, 3), m/s, of the 1-euro filter after a time, s. `cutoff`: Hz."""
    passed = (tracks.tracked[:, :3] - tracks.before[:, :3]) / time
    speed = tracks.speed + _share(SPEED_CUTOFF, time) * (passed - tracks.speed)
    quick = cutoff + HASTE * np.linalg.norm(speed, axis=1, keepdims=True)
    # A quaternion and its negative are one turn.
    sign = np.sign((tracks.tracked[:, 3:] * tracks.filtered[:, 3:]).sum(1, keepdims=True))
    goal = np.hstack(
        [tracks.tracked[:, :3], np.where(sign < 0.0, -1.0, 1.0) * tracks.tracked[:, 3:]]
    )
    filtered = tracks.filtered + _share(quick, time) * (goal - tracks.filtered)
    filtered[:, 3:] /= np.linalg.norm(filtered[:, 3:], axis=1, keepdims=True)
    return filtered, speed


def _share(cutoff: float | Floats, time: float) -> float | Floats:
    """Return the share of the way to its input that a low-pass filter goes in a time, s. `cutoff`: Hz."""
    return 1.0 / (1.0 + 1.0 / (2.0 * math.pi * time * cutoff))
