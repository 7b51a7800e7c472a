"""Order of the clients to the session: the newest pose, and how many resets there were."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

#: Pose, its number, whether there is one, resets.
LAYOUT = struct.Struct("<7dQQQ")
ORDER_SIZE = LAYOUT.size


@dataclass(frozen=True)
class Order:
    """Newest requests of the clients.

    Attributes
    ----------
    pose : tuple of 7 floats or None
        Lowest point, m, and unit quaternion; None: none was asked for since the last reset.
    number : int
        Of that pose.
    resets : int
        Since the start.
    """

    pose: tuple[float, ...] | None = None
    number: int = 0
    resets: int = 0

    @property
    def target(self) -> NDArray[np.float64] | None:
        """The pose as an array (7,)."""
        return None if self.pose is None else np.array(self.pose)


def pack_order(order: Order) -> bytes:
    """Write an order for `LatestSlot`."""
    pose = order.pose or (0.0,) * 7
    return LAYOUT.pack(*pose, order.number, order.pose is not None, order.resets)


def unpack_order(data: bytes) -> Order:
    """Read an order."""
    *pose, number, there, resets = LAYOUT.unpack(data)
    return Order(tuple(pose) if there else None, number, resets)
