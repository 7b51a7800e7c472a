"""Interfaces of the controllers that follow a fingertip, of which several fingers have one each."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Protocol, runtime_checkable

from ..base.arrays import Floats
from ..model.control_interface import Commands, Controller, Measurement, Memory
from ..model.layout import Disc
from .finger_sections import Whole


class Follower(Protocol):
    """What a controller remembers of the fingertip that it follows."""

    @property
    def place(self) -> tuple[float, float] | None:
        """Where the fingertip is, m; None: none is followed."""

    @property
    def top(self) -> float:
        """Height of the blister's top, m."""

    @property
    def ground(self) -> float:
        """Height of the surface around the blister, m."""

    @property
    def losses(self) -> int:
        """How often a fingertip was lost."""


@runtime_checkable
class FollowingControl(Controller, Protocol):
    """Controller that follows a fingertip, whose memory is a `Follower`."""

    @property
    def division(self) -> str:
        """Class in `pin_division` by which several fingers divide the pins."""

    @property
    def blister_radius(self) -> float:
        """How far from the fingertip pins may be in its blister, m."""

    @property
    def pin_rows(self) -> Sequence[int]:
        """State rows of a pin's command, the same for all fingers whichever the pin obeys."""


@runtime_checkable
class GroupedControl(FollowingControl, Protocol):
    """Controller that serves several fingers at once, whose cells follow each other in sections."""

    def sort(self, memory: Memory) -> Hashable:
        """Return what is the same for all fingers that are served together; None: it is served alone."""

    def locate_all(
        self, memories: list[Memory], touched: Measurement, sections: Whole
    ) -> tuple[list[Memory], list[Disc | None]]:
        """Locate each fingertip by the cells of its section; see `Controller.locate`."""

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
