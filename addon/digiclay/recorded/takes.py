"""The takes of a bed, kept in the .blend with it: copies, appends and undo carry them along."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..core.errors import DigiclayError
from ..core.take import Take, from_bytes, to_bytes
from ..live.running import Running

__all__ = ["Entry", "entries", "keep", "keep_recorded", "last", "read", "recorded", "remove"]

#: The bed's property that holds them, by number.
PROPERTY = "digiclay_takes"


class Entry(NamedTuple):
    """What a list of takes shows of one.

    Attributes
    ----------
    number : str
        Its name in the property; never used twice in one bed.
    name : str
        The user's.
    seconds : float
    """

    number: str
    name: str
    seconds: float


def entries(bed: Any) -> list[Entry]:
    """Return the takes of a bed, oldest first."""
    held = bed.get(PROPERTY)
    numbers = sorted(held.keys(), key=int) if held else []
    return [Entry(number, held[number]["name"], held[number]["seconds"]) for number in numbers]


def last(bed: Any) -> str:
    """Return the number of a bed's last take.

    Raises
    ------
    DigiclayError
        When it has none.
    """
    known = entries(bed)
    if not known:
        raise DigiclayError(f"{bed.name} has no take: record one in a session first.")
    return known[-1].number


def recorded(session: Running) -> Take | None:
    """Return what a session has recorded, or None when that is nothing yet."""
    if session.recording is None or len(session.recording.path) < 2:
        return None
    return Take(session.scene, session.recording.start, session.recording.path.copy(), session.kept)


def keep(bed: Any, take: Take, name: str = "") -> Entry:
    """Add a take to a bed; without a name it gets its number."""
    if PROPERTY not in bed:
        bed[PROPERTY] = {}
    held = bed[PROPERTY]
    number = str(max(map(int, held.keys()), default=0) + 1)
    held[number] = {"name": name or f"Take {number}", "seconds": take.duration, "data": to_bytes(take)}
    return Entry(number, held[number]["name"], take.duration)


def keep_recorded(bed: Any, session: Running) -> str:
    """Keep what a session has recorded before its recording ends; return words about it, empty without."""
    take = recorded(session)
    if take is None:
        return ""
    entry = keep(bed, take)
    return f"The recording ended and was kept as {entry.name} ({entry.seconds:.1f} s)"


def read(bed: Any, number: str) -> Take:
    """Return a take of a bed.

    Raises
    ------
    DigiclayError
        When there is none of that number, or it is damaged.
    """
    return from_bytes(bytes(_held(bed, number)["data"]))


def remove(bed: Any, number: str) -> None:
    """Take a take away for good.

    Raises
    ------
    DigiclayError
        When there is none of that number.
    """
    _held(bed, number)
    del bed[PROPERTY][number]


def _held(bed: Any, number: str) -> Any:
    """Return the group of a take, or refuse its number."""
    held = bed.get(PROPERTY)
    if not held or number not in held:
        known = ", ".join(one.number for one in entries(bed)) or "none"
        raise DigiclayError(f"{bed.name} has no take {number!r}: its takes are {known}.")
    return held[number]
