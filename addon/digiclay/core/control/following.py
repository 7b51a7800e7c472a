"""Interfaces of controllers that follow a fingertip; several fingers have one controller each."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Protocol, runtime_checkable

from ..base.arrays import Floats
from ..model.control_interface import Commands, Controller, Measurement, Memory
from ..model.layout import Disc
from .finger_sections import Whole


class Follower(Protocol):
    """Memory of a controller about its fingertip."""

    @property
    def position(self) -> tuple[float, float] | None:
        """Position of the fingertip, m; None if none is followed."""

    @property
    def top(self) -> float:
        """Height of the blister's top, m."""

    @property
    def edge(self) -> float:
        """Height of the surface around the blister, m."""

    @property
    def losses(self) -> int:
        """Number of losses of the fingertip."""


@runtime_checkable
class FollowingControl(Controller, Protocol):
    """Controller that follows a fingertip, whose memory is a `Follower`."""

    @property
    def division(self) -> str:
        """Class in `pin_division` with the rules for several fingers."""

    @property
    def blister_radius(self) -> float:
        """Largest distance of pins in the blister from the fingertip, m."""

    @property
    def pin_rows(self) -> Sequence[int]:
        """State rows of a pin's command, which all fingers share."""


@runtime_checkable
class GroupedControl(FollowingControl, Protocol):
    """Controller that serves several fingers in one call, with their cells in sections."""

    def sort(self, memory: Memory) -> Hashable:
        """Return a key: one call serves fingers with equal keys; None: the finger is served alone."""

    def locate_all(
        self, memories: list[Memory], touched: Measurement, sections: Whole
    ) -> tuple[list[Memory], list[Disc | None]]:
        """Locate each fingertip by its section of the cells; see `Controller.locate`."""

    def command_all(
        self, memories: list[Memory], seen: Measurement, sections: Whole
    ) -> tuple[list[Memory], Commands]:
        """Command the cells of all sections; see `Controller.command`."""


class PredictingControl(GroupedControl, Protocol):
    """Controller that predicts the fingertip that it follows."""

    def predict_under(self, memories: list[Memory], basis: Floats) -> Floats:
        """Return the undersides of fingertips over cells, (f, m), m."""

    def predict_force(self, depth: Floats, rows: Floats) -> Floats:
        """Return the forces of fingertips on pins, (f, m), N, at depths (f, m), m, by rows (f, r, m)."""
