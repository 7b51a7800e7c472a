"""Rules that divide pins among fingers; `hands` tells in which order they are applied.

`PinDivision` has those of Method I, whose undersides are balls on top of the blisters, since its
master is at the fingertip; `CellDivision` the differences of Method II, `PredictedDivision` those
of Method III.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, TINY, Cells, Flags, Floats, any_true, find_first_largest
from ..base.modes import HOLD
from ..model.control_interface import Measurement
from ..model.fingertip import continue_ball
from ..model.layout import RELATIVE_TOLERANCE, Disc
from .finger_sections import BEYOND, Columns
from .following import Follower, FollowingControl, PredictingControl
from .travel import measure_square

#: How far from a finger a pin may belong to it, in its largest semi-axes: 12 mm of the default one.
CAPTURE = 1.2
#: Shares of that within which pressed pins begin a new finger, and within which pins are under one.
NEW, UNDER = 0.65, 0.5
#: Largest height of an estimated underside above a pin that its finger presses, m.
REACHED = 6e-3
#: Largest height of a pin above the underside of the fingertip that owns it, m: a higher one is
#: held up by the blister of another finger, and would attract the master.
ASIDE = 1.5e-3
#: Largest distance of an underside above a pressed pin at which its finger may be the one that
#: presses, m.
UNCLEAR = 0.2e-3
#: Share of a finger in a pin that is hidden from it, with its height.
HIDDEN = -1.0
#: No finger.
NOBODY = -1
#: Rank of the command of the finger that presses the pin: above all others.
PRESSING = 2.0
#: Row of Method II with the periods since a pin became critical, and its value for fingers that the
#: pin does not obey.
PERIODS, ANOTHER = 0, -1.0
#: Position of a finger that is not followed: beyond every pin.
NOWHERE = (BEYOND, BEYOND)


class Hands(NamedTuple):
    """Memory of the controllers, and the discs they control, m; a negative radius: none."""

    fingers: tuple[Follower, ...]
    discs: tuple[Disc, ...]
    pressed: tuple[Cells, Cells] | None = None
    """From locating to commanding: the pressed pins, (q,), ascending, and the fingers they belong to."""

    @property
    def losses(self) -> int:
        """Number of losses of all fingers."""
        return sum(follower.losses for follower in self.fingers)


class Blisters(NamedTuple):
    """Blisters of f fingers, (f,) each: middle and radius, below 0: none; heights around and on top, m."""

    x: Floats
    y: Floats
    radius: Floats
    edge: Floats
    top: Floats


@dataclass(frozen=True, eq=False)
class PinDivision:
    """Rules by which f fingers divide the pins."""

    controllers: tuple[FollowingControl, ...]
    """One per finger; equal fingers share one."""
    sizes: tuple[float, ...]
    heights: tuple[float, ...]
    """Largest semi-axis of each fingertip, and that upwards, m."""
    felt: float
    """Least force on a pin that begins a new finger, N."""

    @cached_property
    def fingers(self) -> Cells:
        """Numbers of the fingers, (f, 1)."""
        return np.arange(len(self.controllers))[:, None]

    @cached_property
    def _radii(self) -> Floats:
        """Largest semi-axes of the fingertips, (f, 1), m."""
        return np.array(self.sizes)[:, None]

    @cached_property
    def captures(self) -> Floats:
        """Largest distance of a finger's pins from it, (f, 1), m."""
        return CAPTURE * (1.0 + RELATIVE_TOLERANCE) * self._radii

    # Before the controllers locate their fingertips.

    def assign(self, memory: Hands, touched: Measurement, pressed: Cells) -> tuple[Cells, Floats]:
        """Return the owner of each pressed pin (q,), and the undersides over it, (f, q), m."""
        if not pressed.size:
            return pressed, np.zeros((len(self.controllers), 0))
        height = touched.height[pressed]
        under = self.find_undersides(memory, touched.quadratic_basis.take(pressed, axis=1), height)
        under[under > height + REACHED] = np.inf
        return self._begin_fingers(touched, pressed, find_lowest(under)), under

    def find_positions(self, memory: Hands) -> Floats:
        """Return the positions of the fingers, (2, f), m."""
        return np.array([follower.position or NOWHERE for follower in memory.fingers]).T

    def find_undersides(self, memory: Hands, basis: Floats, height: Floats) -> Floats:
        """Return the undersides of fingers over pins of a `height`, (f, q), m; infinite: too far away."""
        x, y = self.find_positions(memory)
        tops = np.array([follower.top for follower in memory.fingers])[:, None]
        return self._lay_balls(measure_square(x, y, basis), tops)

    def _lay_balls(self, square: Floats, lowest: Any) -> Floats:
        """Return undersides of balls over pins, (f, q), m, by squared distances, m², and lowest points, m."""
        under = self._radii * continue_ball(square / self._radii**2) + (lowest + self._radii)
        return np.where(square > self.captures**2, np.inf, under)

    def _begin_fingers(self, touched: Measurement, pressed: Cells, owner: Cells) -> Cells:
        """Return the owners; pressed pins without one begin new fingers, from the strongest force on."""
        force, seeds = np.where(owner == NOBODY, touched.force[pressed], 0.0), []
        if force.max() < self.felt:
            return owner
        idle = sorted(set(range(len(self.controllers))) - set(owner.tolist()))
        x, y = touched.quadratic_basis[1:3, pressed]
        while idle and force.max() >= self.felt:
            strongest = int(find_first_largest(force))
            # The true finger only names the new one, so that figures of finger and controller
            # agree.
            assert touched.pressing is not None
            presses = int(find_first_largest(touched.pressing[:, pressed[strongest]]))
            finger = presses if presses in idle else idle[0]
            idle.remove(finger)
            distance = np.hypot(x - x[strongest], y - y[strongest])
            distance[distance > NEW * self.captures[finger]] = np.inf
            force[distance < np.inf] = 0.0
            seeds.append((finger, distance))
        if not seeds:
            return owner
        # Fingers that land in the same period get the pins nearest to each.
        fingers, distances = (np.array(part) for part in zip(*seeds, strict=True))
        near = (owner == NOBODY) & (distances < np.inf).any(axis=0)
        return np.where(near, fingers[find_first_largest(-distances)], owner)

    def assign_by_tips(
        self, memory: Hands, touched: Measurement, owner: Cells, under: Floats, pressed: Cells
    ) -> Cells:
        """Return the owners of pressed pins by fingertips that are less tall than wide.

        A pin that stands far above a fingertip is not pressed by it.
        """
        tops = np.array([follower.top for follower in memory.fingers])[:, None]
        tips = tops + (under - tops) * (np.array(self.heights)[:, None] / self._radii)
        nearest = find_lowest(np.where(tips < touched.height[pressed] - ASIDE, np.inf, tips))
        return np.where(nearest == NOBODY, owner, nearest)

    def share_pressed(
        self, owner: Cells, under: Floats, touched: Measurement, pressed: Cells
    ) -> Floats:
        """Return the share of each finger in the force on each pressed pin, (f, q)."""
        return self.share_whole(owner)

    def share_whole(self, owner: Cells) -> Floats:
        """Return the shares of fingers in forces, (f, q): 1 in pins of the finger or of none, else 0."""
        return ((owner == self.fingers) | (owner == NOBODY)).astype(np.float64)

    # Before the controllers command their pins.

    def find_owner(self, memory: Hands, seen: Measurement, shared: Cells) -> Cells:
        """Return the owner of each pin in several discs (g,), from `assign`."""
        if not memory.pressed:
            return np.full(shared.size, NOBODY)
        (pressed, owner), cells = memory.pressed, seen.cells[shared]
        at = np.minimum(pressed.searchsorted(cells), pressed.size - 1)
        return np.where(pressed[at] == cells, owner[at], NOBODY)

    def claim(self, memory: Hands, seen: Measurement, shared: Cells) -> tuple[Cells, Floats]:
        """Return the owner of each pin in several discs, (g,), and each finger's share of it, (f, g)."""
        owner = self.find_owner(memory, seen, shared)
        return owner, self.share_whole(owner)

    def mask(self, seen: Measurement) -> None:
        """Hide from fingers, in place, the modes of pins that obey others."""

    # After the controllers have commanded their pins.

    def choose(
        self, memory: Hands, seen: Measurement, owner: Cells, columns: Columns, target: Floats
    ) -> Cells:
        """Return the entry of the command that each pin in several discs obeys, (g,).

        In this order: that of its owner; of the finger above it; of the blister that moves it
        farthest off the ground; of the nearest finger, of those that move it. `target`: commanded
        heights, m.
        """
        copies = columns.copies
        finger, (x, y) = copies.row, columns.positions
        blisters = self.find_blisters(memory)
        limits = blisters.radius * np.abs(blisters.radius), (UNDER * self.captures[:, 0]) ** 2
        limit, near, edge, at_x, at_y = np.array(
            (*limits, blisters.edge, blisters.x, blisters.y)
        ).take(finger, axis=1)
        square = (x - at_x) ** 2 + (y - at_y) ** 2
        commanded = target[copies.number]
        still = np.abs(commanded - seen.target[columns.cells]) <= TIE
        outside = np.where(still, -1.0, -0.5) - square
        rank = np.where(square <= limit, np.abs(commanded - edge), outside)
        rank = np.where(square <= np.minimum(limit, near), 1.0 - square, rank)
        rank[owner[copies.which] == finger] = PRESSING
        return columns.pick(rank)

    def find_blisters(self, memory: Hands) -> Blisters:
        """Return the blisters of all fingers."""
        rows = []
        for controller, follower in zip(self.controllers, memory.fingers, strict=True):
            middle = follower.position
            radius = controller.blister_radius * (1.0 + RELATIVE_TOLERANCE) if middle else -1.0
            rows.append((*(middle or NOWHERE), radius, follower.edge, follower.top))
        return Blisters(*np.array(rows).T)

    def remember(self, rows: Floats, obeyed: Cells) -> None:
        """Copy the rows of each pin's command from the finger it obeys to all fingers; rows (f, r, m)."""
        pins = np.arange(obeyed.size)
        for row in self.controllers[0].pin_rows:
            rows[:, row] = rows[obeyed, row, pins]


class CellDivision(PinDivision):
    """Rules for Method II, which has neither a master nor an estimate of the fingertip.

    Pins of a high fingertip may be next to those of a low one. So each controller sees the modes of
    the blister only at pins that obeyed it last. A pressed pin belongs to the finger whose
    underside is nearest, since no pin is pressed deeply, and pins obey the nearer finger.
    """

    def find_positions(self, memory: Hands) -> Floats:
        """Return the positions of the fingers, (2, f), m, from the first force on: cells follow later."""
        positions = []
        for follower, (x, y, radius) in zip(memory.fingers, memory.discs, strict=True):
            positions.append(follower.position or ((x, y) if radius >= 0.0 else NOWHERE))
        return np.array(positions).T

    def find_undersides(self, memory: Hands, basis: Floats, height: Floats) -> Floats:
        """Return distances of pins from undersides, (f, q), m, with each fingertip on its nearest pin."""
        x, y = self.find_positions(memory)
        square = measure_square(x, y, basis)
        nearest = find_first_largest(-square.T)
        under: Floats = self._lay_balls(square, 0.0) + height[nearest][:, None] - height
        return np.abs(under)

    def mask(self, seen: Measurement) -> None:
        """Show pins that obey another finger as holding their height."""
        seen.mode[seen.own[PERIODS] == ANOTHER] = HOLD

    def choose(
        self, memory: Hands, seen: Measurement, owner: Cells, columns: Columns, target: Floats
    ) -> Cells:
        """Return the entry of the command that each pin in several discs obeys, (g,): of the nearer finger.

        A finger that would leave the pin unchanged has no say unless it is above it; the pressing
        finger has priority.
        """
        copies = columns.copies
        finger, (x, y) = copies.row, columns.positions
        at_x, at_y = self.find_positions(memory)[:, finger]
        order = (x - at_x) ** 2 + (y - at_y) ** 2
        still = np.abs(target[copies.number] - seen.target[columns.cells]) <= TIE
        order += still & (order > ((UNDER * self.captures) ** 2)[finger, 0])
        order[owner[copies.which] == finger] = -1.0
        return columns.pick(-order)

    def remember(self, rows: Floats, obeyed: Cells) -> None:
        """Note at each pin that it obeys one finger, in the rows of all others."""
        obedience, pins = rows[:, PERIODS], np.arange(obeyed.size)
        remembered = obedience[obeyed, pins]
        obedience[:] = ANOTHER
        obedience[obeyed, pins] = remembered


class PredictedDivision(PinDivision):
    """Rules for Method III, which predicts the underside of each fingertip and its force on a pin."""

    controllers: tuple[PredictingControl, ...]

    @cached_property
    def _alike(self) -> dict[PredictingControl, list[int]]:
        """Fingers of each controller."""
        alike: dict[PredictingControl, list[int]] = {}
        for finger, controller in enumerate(self.controllers):
            alike.setdefault(controller, []).append(finger)
        return alike

    def find_undersides(self, memory: Hands, basis: Floats, height: Floats) -> Floats:
        """Return the predicted undersides over pins, (f, q), m; infinite: too far away."""
        x, y = self.find_positions(memory)
        under = np.full((x.size, basis.shape[1]), np.inf)
        for controller, fingers in self._alike.items():
            followed = [finger for finger in fingers if x[finger] < BEYOND]
            if followed:
                followers = [memory.fingers[finger] for finger in followed]
                under[followed] = controller.predict_under(followers, basis)
        return np.where(measure_square(x, y, basis) > self.captures**2, np.inf, under)

    def share_pressed(
        self, owner: Cells, under: Floats, touched: Measurement, pressed: Cells
    ) -> Floats:
        """Return the share of each finger in the force on each pressed pin, (f, q); `HIDDEN`: not visible.

        A pin of a finger that is not followed yet is shared with no other: it would attract their
        estimates.
        """
        shares, certain = self.divide_force(owner, under, touched, pressed)
        shares[:, owner == NOBODY] = 0.0
        shares[:, ~certain] = HIDDEN
        return shares

    def divide_force(
        self, owner: Cells, under: Floats, measured: Measurement, pins: Cells
    ) -> tuple[Floats, Flags]:
        """Return the shares of fingers in the forces on pins (q,), (f, q), and which pins are certain.

        If several fingers may press a pin, they share its force in the ratio of the predicted
        forces; without a predicted force the pin is uncertain.
        """
        shares, certain = self.share_whole(owner), np.ones(pins.size, np.bool_)
        height = measured.height[pins]
        (several,) = ((under < height + UNCLEAR).sum(axis=0) > 1).nonzero()
        if several.size:
            forces = np.maximum(height[several] - under[:, several], 0.0)
            rows = measured.own[:, pins[several]].reshape(len(forces), -1, several.size)
            for controller, fingers in self._alike.items():
                forces[fingers] = controller.predict_force(forces[fingers], rows[fingers])
            total = forces.sum(axis=0)
            certain[several] = total > 0.0
            shares[:, several] = np.where(
                total > 0.0, forces / np.maximum(total, TINY), shares[:, several]
            )
        return shares, certain

    def claim(self, memory: Hands, seen: Measurement, shared: Cells) -> tuple[Cells, Floats]:
        """Return the owner of each pin in several discs, (g,), and each finger's share of it, (f, g).

        A pin belongs to the fingertip that presses it, or that would press it at the top of a
        blister. If the blister of only one of two fingers would press the pin into the other
        fingertip, the pin is hidden from that finger, which must not raise it.
        """
        if not shared.size:
            return super().claim(memory, seen, shared)
        basis, height = seen.quadratic_basis.take(shared, axis=1), seen.height[shared]
        under = self.find_undersides(memory, basis, height)
        owner = find_lowest(under)
        shares, _ = self.divide_force(owner, under, seen, shared)
        lowest = under.min(axis=0)
        second = np.where(owner == self.fingers, np.inf, under).min(axis=0)
        blisters = self.find_blisters(memory)
        square = measure_square(blisters.x, blisters.y, basis)
        inside = square <= (blisters.radius * np.abs(blisters.radius))[:, None]
        raised = np.where(inside, np.maximum(blisters.top, blisters.edge)[:, None], -np.inf)
        harms = raised > lowest + TIE
        pressed = (seen.force[shared] != 0.0) | harms.any(axis=0)
        harms &= (under > lowest + TIE) | (raised > second + TIE)
        harms &= ~(harms | np.isinf(under)).all(axis=0)
        if any_true(harms):
            shares[harms] = HIDDEN
            owner = find_lowest(np.where(harms, np.inf, under))
        return np.where(pressed, owner, NOBODY), shares


def find_lowest(under: Floats) -> Cells:
    """Return the finger with the lowest of undersides (f, q), (q,); `NOBODY`: all are infinite."""
    return np.where(under.min(axis=0) == np.inf, NOBODY, find_first_largest(-under))
