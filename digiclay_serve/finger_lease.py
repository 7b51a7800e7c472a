"""Lease of the fingertip: one client at a time moves it."""

from __future__ import annotations

from dataclasses import dataclass

from digiclay.core.base.errors import DigiclayError

#: Time after the last pose of a client when another one may move the fingertip, s.
LEASE = 2.0


class HeldError(DigiclayError):
    """Request of a client while another one moves the fingertip."""

    def __init__(self) -> None:
        super().__init__(f"Another client moves the fingertip: wait until it is silent for {LEASE:g} s.")


@dataclass(frozen=True)
class Lease:
    """Client that moves the fingertip, and the end of its lease, s; nobody before the first pose."""

    holder: object = None
    until: float = 0.0


def claim(lease: Lease, client: object, now: float) -> tuple[bool, Lease]:
    """Return whether a client may move the fingertip now, and the lease after that.

    `client`: anything that is equal for one client only; `now`: by a clock that never goes back, s.
    """
    if lease.holder not in (None, client) and now < lease.until:
        return False, lease
    return True, Lease(client, now + LEASE)


def release(lease: Lease, client: object) -> Lease:
    """Return the lease after a client has gone."""
    return Lease() if lease.holder == client else lease
