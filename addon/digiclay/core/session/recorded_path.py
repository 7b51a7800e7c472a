"""Recording of a session under way: initial state, and the fingers' path since.

It becomes a take once the state at its end is known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Floats
from ..control.smoothing import ORDER
from ..scene.schema import Scene
from .take import Take


@dataclass(frozen=True, eq=False)
class Recording:
    """Fingertip path, and what was smoothed, since the start of the recording.

    Attributes
    ----------
    start : bytes
        The state recording began with, kept by `core.session.snapshot`.
    first : int
        Its period.
    rows : ndarray (capacity, 7 f + 4 + 1)
        Poses of the fingers at the end of each period, what was smoothed in it, see `core.control.smoothing`,
        and the moment it was simulated in; row 0: the start.
    count : int
        How many of the rows are in use. Those behind belong to nobody.
    saved : int
        How many of those the file has, as a take.
    """

    start: bytes
    first: int
    rows: Floats
    count: int
    saved: int = 0

    @classmethod
    def begin(cls, snapshot: bytes, period: int, pose: Floats, tick: int, room: int = 256) -> Recording:
        """Return a recording that has nothing but its start.

        `snapshot`: the state at the start; `period`: its period; `pose` (f, 7), of the fingertips then;
        `room`: rows to have at once; more are added as they are needed.
        """
        rows = np.empty((room, pose.size + ORDER + 1))
        rows[0] = *pose.ravel(), *np.zeros(ORDER), tick
        return cls(snapshot, period, rows, 1)

    @property
    def path(self) -> Floats:
        """Poses, shape (t + 1, f, 7): `simulate_path` simulates them again bit for bit."""
        return self.rows[: self.count, : -ORDER - 1].reshape(self.count, -1, 7)

    @property
    def smoothing(self) -> Floats | None:
        """What was smoothed in each period, shape (t, 4); None: nothing in any."""
        orders = self.rows[1 : self.count, -ORDER - 1 : -1]
        return orders if orders.any() else None

    @property
    def unsaved(self) -> bool:
        """Whether something was recorded that the file does not have."""
        return self.count > max(self.saved, 1)

    def extend(self, path: Floats, tick: int, smoothing: Floats | None = None) -> Recording:
        """Return the recording with the poses of some more periods, shape (k, f, 7).

        `path` (k, f, 7), poses at the ends of the periods; `smoothing` (k, 4), what was smoothed in them;
        nothing when left out.
        """
        end = self.count + len(path)
        rows = self.rows
        if end > len(rows):
            rows = np.empty((2 * end, self.rows.shape[1]))
            rows[: self.count] = self.rows[: self.count]
        rows[self.count : end, : -ORDER - 1] = path.reshape(len(path), -1)
        rows[self.count : end, -ORDER - 1 : -1] = 0.0 if smoothing is None else smoothing
        rows[self.count : end, -1] = tick
        return replace(self, rows=rows, count=end)

    def cut_at_tick(self, tick: int, period: int) -> Recording | None:
        """Return the recording as it was at a moment undo came back to; None when it did not lead there.

        `period`: of the state at that tick.
        """
        count = int(np.searchsorted(self.rows[: self.count, -1], tick, side="right"))
        return self._first(count) if count and count - 1 == period - self.first else None

    def cut_at_period(self, period: int) -> Recording | None:
        """Return the recording up to a period of its own; None when that is before its start."""
        count = period - self.first + 1
        return self._first(count) if 0 < count <= self.count else None

    def _first(self, count: int) -> Recording:
        """Return the recording with its first rows alone."""
        return replace(self, count=count, saved=min(self.saved, count))


def make_take(scene: Scene, recording: Recording, end: bytes) -> Take | None:
    """Return what was recorded as a take; None when that is no control period yet.

    `end`: the state after its last row, from `snapshot.dump`.
    """
    if recording.count < 2:
        return None
    smoothing = None if recording.smoothing is None else recording.smoothing.copy()
    return Take(scene, recording.start, recording.path.copy(), end, smoothing)
