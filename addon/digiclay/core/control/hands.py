"""Control of several fingers on one bed: each has a controller of the method, as if it were alone.

Sensors measure the force on a pin, but not whose it is. What happens in a control period to a pin
that two fingers press, with the rules of `pin_division`:

1. `HandControl.locate` assigns it to the finger whose underside is lowest over it, its owner. A
   pressed pin far from all fingers begins a new one, if there is one left.
2. The controller of the owner locates its finger with the whole force on the pin, the other one as
   if the pin had none. (With Method III both see shares in the ratio of the predicted forces.)
   Each answers with the disc of pins to command; the pin is in both.
3. `HandControl.command` has each controller command its disc. Again the owner sees the force on
   the pin, the other one none, so that its command is that for an unpressed pin of its blister.
4. The pin obeys its owner. (A pin that nobody presses obeys the finger above it, else that whose
   blister moves it farthest, see `PinDivision.choose`.) State rows that belong to the obeyed
   command are copied to both fingers.

Forces, heights and modes are those of the whole bed; only state rows are kept per finger.
`HandTogether` calls Method I once for all fingers, as for the runs of a batch, with a column of
pins per finger; `HandInGroups` calls other methods for groups of fingers, or one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import Cells, Floats
from ..model.control_interface import Commands, Controller, Measurement
from ..model.layout import Disc
from .finger_sections import OUTSIDE, WHOLE, Columns, Sections, Whole
from .following import Follower, GroupedControl
from .pin_division import HIDDEN, NOBODY, Hands, PinDivision

NO_DISC: Disc = (0.0, 0.0, -1.0)
#: A finger and its disc, m; None: it controls no pins.
Located = tuple[Follower, Disc | None]


@dataclass(frozen=True, eq=False)
class HandControl:
    """Controller of several fingers."""

    controllers: tuple[Controller, ...]
    """One per finger; those of unknown code are guarded."""
    division: PinDivision

    @property
    def count(self) -> int:
        """State rows per cell and finger."""
        return self.controllers[0].rows

    @property
    def rows(self) -> int:
        """State rows per cell: those of all controllers in sequence."""
        return self.count * len(self.controllers)

    def begin(self) -> Hands:
        """Return the memory before a session."""
        followers = tuple(controller.begin() for controller in self.controllers)
        return Hands(followers, (NO_DISC,) * len(followers))

    def locate(self, memory: Hands, touched: Measurement) -> tuple[Hands, Any]:
        """Divide the pressed pins among the fingers; each controller locates its finger by its pins."""
        (pins,) = touched.force.nonzero()
        owner, under = self.division.assign(memory, touched, pins)
        followers, discs = zip(*self.locate_each(memory, touched, pins, owner, under), strict=True)
        owners = (touched.cells[pins], owner) if pins.size else None
        return Hands(followers, tuple(disc or NO_DISC for disc in discs), owners), list(discs)

    def command(self, memory: Hands, seen: Measurement) -> tuple[Hands, Commands]:
        """Let each controller command the pins in its disc; a pin in several discs obeys one finger."""
        columns = self.arrange("all", seen)
        followers, commands, owner = self.command_each(memory, seen, columns)
        memory = memory._replace(fingers=tuple(followers), pressed=None)
        obeyed = columns.only.copy()
        if owner.size:
            shared = columns.copies.cells
            obeyed[shared] = self.division.choose(memory, seen, owner, columns, commands.target)
        rows = seen.own.reshape(len(followers), self.count, obeyed.size)
        self.division.remember(rows, columns.finger[obeyed])
        return memory, commands.take(obeyed)

    def locate_each(
        self, memory: Hands, touched: Measurement, pins: Cells, owner: Cells, under: Floats
    ) -> list[Located]:
        """Return the follower of each finger, and its disc.

        `pins` (q,): pressed ones; `owner` (q,): their fingers; `under` (f, q): undersides over
        them, m.
        """
        raise NotImplementedError

    def command_each(
        self, memory: Hands, seen: Measurement, columns: Columns
    ) -> tuple[list[Follower], Commands, Cells]:
        """Return the follower of each finger, and commands for the entries of all columns, (k,).

        The last result is the owner of each pin in several columns, (g,).
        """
        raise NotImplementedError

    def arrange(self, part: str, seen: Measurement) -> Columns:
        """Return the columns of a part of the active cells, made once per active set."""
        basis, columns = self._columns.get(part, (None, None))
        if columns is None or basis is not seen.quadratic_basis:
            assert seen.discs is not None
            # An order may add a disc, which belongs to no finger.
            x, y, radius = (values[: len(self.controllers)] for values in seen.discs)
            columns = Columns(seen.quadratic_basis, (x, y, radius))
            self._columns[part] = seen.quadratic_basis, columns
        return columns

    @cached_property
    def _columns(self) -> dict[str, tuple[Floats, Columns]]:
        """Last columns of each part, with their basis."""
        return {}


@dataclass(frozen=True, eq=False)
class HandTogether(HandControl):
    """Controller of several fingers for Method I, whose formulas hold for many masters at once."""

    together: Controller
    """Controller of all fingers, as of the runs of a batch."""

    def locate_each(
        self, memory: Hands, touched: Measurement, pins: Cells, owner: Cells, under: Floats
    ) -> list[Located]:
        """Show each controller all pressed pins, without the forces on those of other fingers."""
        owner = self.division.assign_by_tips(memory, touched, owner, under, pins)
        columns = touched._replace(
            quadratic_basis=touched.quadratic_basis[:, pins, None],
            height=touched.height[pins, None],
            force=np.where(
                owner[:, None] == self.division.fingers.T, touched.force[pins, None], 0.0
            ),
        )
        located: Any = self.together.locate(list(memory.fingers), columns)
        return list(zip(*located, strict=True))

    def command_each(
        self, memory: Hands, seen: Measurement, columns: Columns
    ) -> tuple[list[Follower], Commands, Cells]:
        """Let each controller command its column, without the forces on pins of other fingers."""
        cells, absent, basis, entries = columns.padded
        fingers, owners = self.division.fingers.T, np.full(seen.force.size, NOBODY)
        shared = columns.copies.cells
        owner = self.division.find_owner(memory, seen, shared)
        owners[shared] = owner
        owners = owners[cells]
        hidden = absent | ((owners != fingers) & (owners != NOBODY))
        rows = np.arange(self.count)[:, None, None] + self.count * fingers
        padded = Measurement(
            basis,
            seen.height[cells],
            np.where(hidden, 0.0, seen.force[cells]),
            seen.target[cells],
            seen.mode[cells],
            seen.own[rows, cells],
            seen.cells[cells],
        )
        after, commands = self.together.command(list(memory.fingers), padded)
        for row, values in enumerate(padded.own):
            seen.own[row + self.count * columns.finger, columns.cell] = values.ravel()[entries]
        return after, commands.take(entries), owner


class Group(NamedTuple):
    """Fingers that one call serves, and their pins, finger by finger."""

    controller: GroupedControl | None
    fingers: list[int]
    entries: Cells
    """Indices of their entries among those of all fingers."""
    seen: Measurement
    sections: Whole


@dataclass(frozen=True, eq=False)
class HandInGroups(HandControl):
    """Controller of several fingers for other methods: one call serves those with the same `sort` key."""

    @cached_property
    def _grouped(self) -> list[GroupedControl | None]:
        """Controllers for several fingers per call; None for other or guarded ones."""
        pairs = zip(self.division.controllers, self.controllers, strict=True)
        return [
            inner if inner is outer and isinstance(inner, GroupedControl) else None
            for inner, outer in pairs
        ]

    def locate_each(
        self, memory: Hands, touched: Measurement, pins: Cells, owner: Cells, under: Floats
    ) -> list[Located]:
        """Show each controller the pins of its disc that no other finger owns, and all that it presses."""
        shares = self.division.share_pressed(owner, under, touched, pins)
        shape = len(memory.fingers), touched.force.size
        visible, parts = np.zeros(shape, np.bool_), np.ones(shape)
        if touched.discs is not None:
            followed = np.array([follower.position is not None for follower in memory.fingers])
            visible = self.arrange("touched", touched).inside & followed[:, None]
            visible[:, pins] &= self.division.share_whole(owner) > 0.0
        parts[:, pins] = shares
        visible[:, pins] |= (owner != NOBODY) & (shares > 0.0)
        visible[:, pins] &= shares != HIDDEN
        finger, cells = visible.nonzero()
        force = touched.force[cells] * parts[finger, cells]
        located: dict[int, Located] = {}
        for group in self._divide(memory.fingers, touched, force, finger, cells):
            followers, seen = [memory.fingers[i] for i in group.fingers], group.seen
            if group.controller:
                after, discs = group.controller.locate_all(followers, seen, group.sections)
                located |= zip(group.fingers, zip(after, discs, strict=True), strict=True)
            else:
                (number,) = group.fingers
                located[number] = self.controllers[number].locate(followers[0], seen)
        return [located[i] for i in range(len(memory.fingers))]

    def command_each(
        self, memory: Hands, seen: Measurement, columns: Columns
    ) -> tuple[list[Follower], Commands, Cells]:
        """Let each controller command its column, with its shares in the forces."""
        cells, copies, parts = columns.cell, columns.copies, np.ones(columns.cell.size)
        owner, shares = self.division.claim(memory, seen, copies.cells)
        parts[copies.number] = shares[copies.row, copies.which]
        force = seen.force[cells] * np.maximum(parts, 0.0)
        after = list(memory.fingers)
        commands = Commands(
            np.empty(cells.size), np.empty(cells.size, np.int8), np.empty(cells.size)
        )
        for group in self._divide(memory.fingers, seen, force, columns.finger, cells):
            group.seen.quadratic_basis[:, parts[group.entries] == HIDDEN] = OUTSIDE
            members = [memory.fingers[i] for i in group.fingers]
            if group.controller:
                members, orders = group.controller.command_all(members, group.seen, group.sections)
                for number, follower in zip(group.fingers, members, strict=True):
                    after[number] = follower
            else:
                (number,) = group.fingers
                after[number], orders = self.controllers[number].command(members[0], group.seen)
            commands.target[group.entries], commands.mode[group.entries] = (
                orders.target,
                orders.mode,
            )
            commands.command[group.entries] = orders.command
        return after, commands, owner

    def _divide(
        self,
        followers: tuple[Follower, ...],
        seen: Measurement,
        force: Floats,
        finger: Cells,
        cells: Cells,
    ) -> Iterator[Group]:
        """Yield groups of fingers; the rows of a group are written back before the next group.

        `finger`, `cells` and visible `force` (k,): entries of all fingers, finger by finger.
        """
        counts = np.bincount(finger, minlength=len(followers)).tolist()
        groups: dict[object, list[int]] = {}
        for i, (controller, follower) in enumerate(zip(self._grouped, followers, strict=True)):
            key = controller.sort(follower) if controller and counts[i] else None
            groups.setdefault(i if key is None else (controller, key), []).append(i)
        flat, width = seen.own.reshape(-1), seen.own.shape[1]
        numbers = finger * (self.count * width) + cells
        for fingers in groups.values():
            served = np.zeros(len(followers), np.bool_)
            served[fingers] = True
            (entries,) = served[finger].nonzero()
            at = cells[entries]
            rows = numbers[entries] + width * np.arange(self.count)[:, None]
            part = Measurement(
                seen.quadratic_basis.take(at, axis=1),
                seen.height[at],
                force[entries],
                seen.target[at],
                seen.mode[at],
                flat.take(rows),
                seen.cells[at],
                seen.command[at],
            )
            self.division.mask(part)
            sections = WHOLE if len(fingers) == 1 else Sections([counts[i] for i in fingers])
            yield Group(self._grouped[fingers[0]], fingers, entries, part, sections)
            flat[rows.ravel()] = part.own.ravel()  # one row of numbers takes half the time
