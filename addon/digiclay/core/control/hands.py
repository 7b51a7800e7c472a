"""Control of several fingers: a method's controller for each of them, on one bed.

What is measured of a pin is its force, not which finger presses it. So each pressed pin belongs to one of
the fingers that are followed, the one whose underside is lowest there; where none is near a new one begins.
Each controller sees the pins around its finger, without the forces on those of the others; of a pin that two
press each sees its share, where the method predicts undersides. Of two that command a pin, that of the
fingertip above it is obeyed, elsewhere the one that moves it farthest off its ground.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, TINY, Cells, Flags, Floats, any_true, find_first_largest
from ..model.control_interface import Commands, Measurement
from ..model.fingertip import continue_ball
from ..model.layout import RELATIVE_TOLERANCE, Disc
from .finger_sections import BEYOND, OUTSIDE, WHOLE, Columns, Sections, Whole
from .travel import measure_square

#: How far from a finger a pressed pin may be its own, in its largest semi-axes: 12 mm of the default one.
CAPTURE = 1.2
#: Shares of that within which pressed pins begin a new finger, and within which pins are under one.
NEW, UNDER = 0.65, 0.5
#: How far above a pressed pin a predicted underside may be that presses it, m.
REACHED = 6e-3
#: How far a pin may stand above a fingertip's underside and tell where it is, m: one that another fingertip's
#: blister holds up beside it would draw its master there.
ASIDE = 1.5e-3
#: How near a pressed pin two undersides must be for both to be able to press it, m.
UNCLEAR = 0.2e-3
#: Share of a pin that a finger does not see.
HIDDEN = -1.0
#: No finger.
NOBODY = -1
NO_DISC: Disc = (0.0, 0.0, -1.0)


class Hands(NamedTuple):
    """Memory of the controllers, and the discs they control, m; a negative radius: none."""

    fingers: tuple[Any, ...]
    discs: tuple[Disc, ...]
    pressed: tuple[Cells, Cells] | None = None
    """From locating to commanding: the pressed pins, (m,), ascending, and the fingers they belong to."""

    @property
    def losses(self) -> int:
        """How often a finger was lost."""
        return sum(getattr(one, "losses", 0) for one in self.fingers)


@dataclass(frozen=True, eq=False)
class HandControl:
    """Controller of several fingers."""

    runs: tuple[Any, ...]
    """The method's, one a finger."""
    sizes: tuple[float, ...]
    heights: tuple[float, ...]
    """Largest semi-axis of each fingertip, and that upwards, m."""
    felt: float
    """Force from which on a pin tells of a new finger, N."""

    @cached_property
    def capture(self) -> Floats:
        """How far from each finger a pressed pin may be its own, (f,), m."""
        return CAPTURE * (1.0 + RELATIVE_TOLERANCE) * np.array(self.sizes)

    @cached_property
    def _sizes(self) -> tuple[Cells, Floats, Floats]:
        """The fingers, their sizes, m, and squares of `capture`, m², (f, 1) each."""
        numbers = np.arange(len(self.runs))
        return numbers[:, None], np.array(self.sizes)[:, None], self.capture[:, None] ** 2

    @property
    def rows(self) -> int:
        """State rows a cell needs: those of each controller, one after the other."""
        return len(self.runs) * int(self.runs[0].rows)

    def begin(self) -> Hands:
        """Return the memory before a session."""
        return Hands(tuple(run.begin() for run in self.runs), (NO_DISC,) * len(self.runs))

    def locate(self, memory: Hands, touched: Measurement) -> tuple[Hands, Any]:
        """Divide the pressed pins among the fingers, and let each controller take in its own."""
        (pressed,) = touched.force.nonzero()
        owner, under, divided = np.full(pressed.size, NOBODY), np.zeros((len(self.runs), 0)), None
        if pressed.size:
            height = touched.height[pressed]
            under = self._predict_under(memory, touched.quadratic_basis.take(pressed, 1), height)
            under[under > height + REACHED] = np.inf
            owner = self._find_new(touched, pressed, find_lowest(under))
            divided = touched.cells[pressed], owner
        located = self.locate_each(memory.fingers, touched, pressed, owner, under)
        discs = [disc for _, disc in located]
        return Hands(
            tuple(own for own, _ in located), tuple(disc or NO_DISC for disc in discs), divided
        ), discs

    def command(self, memory: Hands, seen: Measurement) -> tuple[Hands, Commands]:
        """Let each controller command the pins around its finger; of two for one pin obey one."""
        columns = self.arrange("all", seen)
        # What stands in one column alone is no other finger's; nor is what is free, if no underside is known.
        owner, shares = np.full(columns.double.size, NOBODY), None
        if self._predicts and owner.size:
            owner, shares = self._claim(memory, seen, columns.double)
        elif memory.pressed:
            (pins, of), cells = memory.pressed, seen.cells[columns.double]
            at = np.minimum(pins.searchsorted(cells), pins.size - 1)
            owner = np.where(pins[at] == cells, of[at], NOBODY)
        fingers, given = self.command_each(memory.fingers, seen, columns, owner, shares)
        memory = memory._replace(fingers=tuple(fingers), pressed=None)
        chosen = columns.obeyed.copy()
        if owner.size:
            chosen[columns.double] = self._choose(memory, seen, owner, columns, given.target)
        self._remember(seen.own, columns.finger[chosen])
        return memory, Commands(given.target[chosen], given.mode[chosen], given.command[chosen])

    def _remember(self, own: Floats, obeyed: Cells) -> None:
        """Keep of each pin's command, in rows (r, m), what the finger obeyed remembers, (m,), for all."""
        count = int(self.runs[0].rows)
        for row in getattr(self.runs[0], "pin_rows", ()):
            own[row::count] = own[obeyed * count + row, np.arange(obeyed.size)]

    def locate_each(
        self, memory: tuple[Any, ...], touched: Measurement, pressed: Cells, owner: Cells, under: Floats
    ) -> list[tuple[Any, Disc | None]]:
        """Return memory and disc of each finger; pressed cells (q,), their owners, undersides (f, q), m."""
        raise NotImplementedError

    def command_each(
        self,
        memory: tuple[Any, ...],
        seen: Measurement,
        columns: Columns,
        owner: Cells,
        shares: Floats | None,
    ) -> tuple[list[Any], Commands]:
        """Return the memories, and commands for the cells of all columns, one after the other.

        Cells in several columns have owners, (g,), and are seen in shares, (f, g); None: those of `_hide`.
        """
        raise NotImplementedError

    def _claim(self, memory: Hands, seen: Measurement, double: Cells) -> tuple[Cells, Floats]:
        """Return whose pins in several columns are, (g,), and what each finger sees of them, (f, g).

        That is a share of the force; `HIDDEN`: not even the pin. A pin that a fingertip presses, or would if
        a blister raised it to its top, is that fingertip's. Where one blister would press it into another's
        fingertip, and not the other way round, it is the other's alone: it cannot be high for the one.
        """
        basis = seen.quadratic_basis.take(double, 1)
        under = self._predict_under(memory, basis, seen.height[double])
        owner = find_lowest(under)
        shares, _ = self._share(under, owner, seen, double)
        others = under.copy()
        others[owner, np.arange(owner.size)] = np.inf
        low, second = np.minimum.reduce(under), np.minimum.reduce(others)
        x, y, radius, ground, top = self._find_blisters(memory)
        inside = measure_square(x, y, basis) <= (radius * np.abs(radius))[:, None]
        tops = np.where(inside, np.maximum(top, ground)[:, None], -np.inf)
        harms = tops > low + TIE
        claimed = (seen.force[double] != 0.0) | np.logical_or.reduce(harms)
        harms &= (under > low + TIE) | (tops > second + TIE)
        harms &= ~np.logical_and.reduce(harms | np.isinf(under))
        if any_true(harms):
            np.putmask(shares, harms, HIDDEN)
            np.putmask(under, harms, np.inf)
            owner = find_lowest(under)
        return np.where(claimed, owner, NOBODY), shares

    def _share(self, under: Floats, owner: Cells, measured: Measurement, pins: Cells) -> tuple[Floats, Flags]:
        """Return the shares of fingers in the forces of pins (q,), (f, q), and of which pins they are known.

        By the undersides over them, m: of a pin that two may press each has its share in the forces
        predicted; where none is predicted, nobody knows who presses it.
        """
        shares = self._hide(owner)
        known = np.ones(pins.size, np.bool_)
        if self._predicts:
            height = measured.height[pins]
            (both,) = (np.add.reduce(under < height + UNCLEAR, axis=0) > 1).nonzero()
            if not both.size:
                return shares, known
            forces = np.maximum(height[both] - under[:, both], 0.0)
            rows = measured.own[:, pins[both]].reshape(len(self.runs), int(self.runs[0].rows), both.size)
            for run, alike in self._alike:
                forces[alike] = run.predict_force(forces[alike], rows[alike])
            total = forces.sum(axis=0)
            known[both] = total > 0.0
            shares[:, both] = np.where(known[both], forces / np.maximum(total, TINY), shares[:, both])
        return shares, known

    def _hide(self, owner: Cells) -> Floats:
        """Return the shares of fingers in the forces of pins (q,), (f, q): none in what is another's."""
        shares: Floats = ((owner == self._sizes[0]) | (owner == NOBODY)).astype(np.float64)
        return shares

    @cached_property
    def _alike(self) -> list[tuple[Any, list[int]]]:
        """Controllers, and which fingers have each: fingers that are alike have one."""
        return [(run, [i for i, one in enumerate(self.runs) if one is run]) for run in set(self.runs)]

    @property
    def _predicts(self) -> bool:
        """Whether the method predicts undersides."""
        return hasattr(self.runs[0], "predict_under")

    def _find_blisters(self, memory: Hands) -> Floats:
        """Return the blisters of all fingers, (5, f), as `find_blister` does."""
        followed = zip(self.runs, memory.fingers, strict=True)
        return np.array([find_blister(run, own) for run, own in followed]).T

    def _place(self, memory: Hands) -> Floats:
        """Return where all fingers are, (f, 2), m; `BEYOND`: not found."""
        places: Floats = np.array([own.place or (BEYOND, BEYOND) for own in memory.fingers])
        return places

    def _predict_under(self, memory: Hands, basis: Floats, height: Floats) -> Floats:
        """Return the undersides of fingers over pins of a `height`, (f, q), m; infinite where one is far."""
        x, y = self._place(memory).T
        square = measure_square(x, y, basis)
        _, size, reach = self._sizes
        far: Flags = square > reach
        if not self._predicts:
            tops = np.array([getattr(own, "height", 0.0) for own in memory.fingers])[:, None]
            square /= size * size
            heights = continue_ball(square)
            heights *= size
            heights += tops + size
            heights[far] = np.inf
            return heights
        under = np.full(square.shape, np.inf)
        for run, alike in self._alike:
            own = [i for i in alike if x[i] < BEYOND]
            if own:
                under[own] = run.predict_under([memory.fingers[i] for i in own], basis)
        under[far] = np.inf
        return under

    def _find_new(self, touched: Measurement, pressed: Cells, owner: Cells) -> Cells:
        """Return the owners of pressed pins, those of new fingers among them: about the strongest forces."""
        left, seeds = np.where(owner == NOBODY, touched.force[pressed], 0.0), []
        if left.max() < self.felt:
            return owner
        free = [i for i in range(len(self.runs)) if not (owner == i).any()]
        x, y = touched.quadratic_basis[1:3, pressed]
        while free and left.max() >= self.felt:
            strongest = int(find_first_largest(left))
            # Who presses is but the name of the new one, so that figures of finger and controller agree.
            named = int(find_first_largest(touched.pressing[:, pressed[strongest]]))
            finger = free.pop(free.index(named) if named in free else 0)
            apart = np.hypot(x - x[strongest], y - y[strongest])
            apart[apart > NEW * self.capture[finger]] = np.inf
            np.putmask(left, apart < np.inf, 0.0)
            seeds.append((finger, apart))
        if not seeds:
            return owner
        # Of those that land in one period each has what is nearest to it.
        fingers, apart = np.array([finger for finger, _ in seeds]), np.array([apart for _, apart in seeds])
        taken = (owner == NOBODY) & (apart < np.inf).any(axis=0)
        return np.where(taken, fingers[find_first_largest(-apart)], owner)

    def _choose(
        self, memory: Hands, seen: Measurement, owner: Cells, columns: Columns, target: Floats
    ) -> Cells:
        """Return which of the commands for each pin with several is obeyed, (g,)."""
        fingers, (x, y) = columns.named, columns.places
        at_x, at_y, radius, ground, _ = self._find_blisters(memory)
        limits = radius * np.abs(radius), UNDER**2 * self._sizes[2][:, 0]
        at_x, at_y, ground, edge, under = np.array((at_x, at_y, ground, *limits)).take(fingers, axis=1)
        square = (x - at_x) ** 2
        square += (y - at_y) ** 2
        inside = square <= edge
        # Outside of all blisters pins are led, or left as they are; of two the nearer one is obeyed.
        asked = target.take(columns.pairs)
        still = np.abs(asked - seen.target.take(columns.several)) <= TIE
        aside = np.where(still, -1.0, -0.5)
        off = np.where(inside, np.abs(asked - ground), aside - square)
        # Under a fingertip its own blister is obeyed, and where it presses before all.
        inside &= square <= under
        off = np.where(inside, 1.0 - square, off)
        off[owner.take(columns.which) == fingers] = 2.0
        return columns.pick(off)

    def arrange(self, part: str, seen: Measurement) -> Columns:
        """Return the columns of a part of the active cells; those of one active set are the same."""
        basis, columns = self._kept.get(part, (None, None))
        if columns is None or basis is not seen.quadratic_basis:
            x, y, radius = (part[: len(self.runs)] for part in seen.discs)
            columns = Columns(seen.quadratic_basis, (x, y, radius))
            self._kept[part] = seen.quadratic_basis, columns
        return columns

    @cached_property
    def _kept(self) -> dict[str, tuple[Floats, Columns]]:
        """The last columns, and the basis they are of; keeping them changes no command."""
        return {}


@dataclass(frozen=True, eq=False)
class HandTogether(HandControl):
    """Controller of several fingers, for a method whose formulas hold for many at once."""

    together: Any
    """The method's of all of them."""

    def locate_each(
        self, memory: tuple[Any, ...], touched: Measurement, pressed: Cells, owner: Cells, under: Floats
    ) -> list[tuple[Any, Disc | None]]:
        """Let each see the pressed cells, without the forces on those of the others."""
        # `under` takes a fingertip for a ball; it is less tall than wide.
        tops = np.array([finger.height for finger in memory])[:, None]
        flatness = np.array(self.heights)[:, None] / self._sizes[1]
        tips = tops + (under - tops) * flatness
        near = find_lowest(np.where(tips < touched.height[pressed] - ASIDE, np.inf, tips))
        owner = np.where(near == NOBODY, owner, near)
        own = owner[:, None] == self._sizes[0].T
        columns = touched._replace(
            quadratic_basis=touched.quadratic_basis[:, pressed, None],
            height=touched.height[pressed, None],
            force=np.where(own, touched.force[pressed, None], 0.0),
        )
        return list(zip(*self.together.locate(list(memory), columns), strict=True))

    def command_each(
        self,
        memory: tuple[Any, ...],
        seen: Measurement,
        columns: Columns,
        owner: Cells,
        shares: Floats | None,
    ) -> tuple[list[Any], Commands]:
        """Let each command its column, without the forces on cells of the others."""
        (at, absent, basis, back), count = columns.padded, int(self.runs[0].rows)
        fingers, who = np.arange(len(self.runs)), np.full(seen.force.size, NOBODY)
        who[columns.double] = owner
        of = who.take(at)
        hidden = of != fingers
        hidden &= of != NOBODY
        hidden |= absent
        force = seen.force.take(at)
        np.putmask(force, hidden, 0.0)
        own = seen.own[np.arange(count)[:, None, None] + count * fingers, at]
        shown = Measurement(
            basis,
            seen.height.take(at),
            force,
            seen.target.take(at),
            seen.mode.take(at),
            own,
            seen.cells.take(at),
        )
        after, orders = self.together.command(list(memory), shown)
        for row in range(count):
            seen.own[row + count * columns.finger, columns.flat] = own[row].take(back)
        return after, Commands(*(one.take(back) for one in orders))


@dataclass(frozen=True, eq=False)
class HandInGroups(HandControl):
    """Controller of several fingers, for other methods; those `sort`ed alike are served together, if any."""

    def locate_each(
        self, memory: tuple[Any, ...], touched: Measurement, pressed: Cells, owner: Cells, under: Floats
    ) -> list[tuple[Any, Disc | None]]:
        """Let each see its column without the cells of the others, and what it presses elsewhere."""
        shares, known = self._share(under, owner, touched, pressed)
        if self._predicts:
            # What a finger that is not found yet presses would draw the estimates of the others to it.
            shares[:, owner == NOBODY] = 0.0
            shares[:, ~known] = HIDDEN
        shape = len(self.runs), touched.force.size
        seen, parts = np.zeros(shape, np.bool_), np.ones(shape)
        if touched.discs is not None:
            followed = np.array([own.place is not None for own in memory])[:, None]
            seen = self.arrange("touched", touched).inside & followed
            seen[:, pressed] &= self._hide(owner) > 0.0
        parts[:, pressed] = shares
        seen[:, pressed] |= (owner != NOBODY) & (shares > 0.0)
        seen[:, pressed] &= shares != HIDDEN
        located: dict[int, tuple[Any, Disc | None]] = {}
        finger, cells = seen.nonzero()
        for group, _, part, sections in self._divide(
            memory, touched, touched.force[cells] * parts[finger, cells], finger, cells
        ):
            run, own = self.runs[group[0]], [memory[i] for i in group]
            if len(group) == 1:
                located[group[0]] = run.locate(*own, part)
            else:
                located |= zip(group, zip(*run.locate_all(own, part, sections), strict=True), strict=True)
        return [located[i] for i in range(len(memory))]

    def command_each(
        self,
        memory: tuple[Any, ...],
        seen: Measurement,
        columns: Columns,
        owner: Cells,
        shares: Floats | None,
    ) -> tuple[list[Any], Commands]:
        """Let each command its column, without the forces on cells of the others."""
        finger, cells = columns.finger, columns.flat
        parts, shares = np.ones(cells.size), self._hide(owner) if shares is None else shares
        parts[columns.pairs] = shares[columns.named, columns.which]
        force = seen.force[cells] * np.maximum(parts, 0.0)
        fingers = list(memory)
        given = Commands(np.empty(cells.size), np.empty(cells.size, np.int8), np.empty(cells.size))
        for group, chosen, part, sections in self._divide(memory, seen, force, finger, cells):
            run, own = self.runs[group[0]], [memory[i] for i in group]
            part.quadratic_basis[:, parts[chosen] == HIDDEN] = OUTSIDE
            if len(group) == 1:
                fingers[group[0]], orders = run.command(*own, part)
            else:
                after, orders = run.command_all(own, part, sections)
                for i, one in zip(group, after, strict=True):
                    fingers[i] = one
            given.target[chosen], given.mode[chosen], given.command[chosen] = orders
        return fingers, given

    def _divide(
        self, memory: tuple[Any, ...], seen: Measurement, force: Floats, finger: Cells, cells: Cells
    ) -> Iterator[tuple[list[int], Any, Measurement, Whole]]:
        """Give fingers that are served together, which of the cells are theirs, and what is measured there.

        `cells` (m,), those of each `finger` one after the other, with the `force` shown of each. What changes
        of the controllers' rows is kept as soon as the next fingers are asked for.
        """
        counts, count = np.bincount(finger, minlength=len(self.runs)).tolist(), int(self.runs[0].rows)
        groups: dict[Any, list[int]] = {}
        for i, (run, own) in enumerate(zip(self.runs, memory, strict=True)):
            alike = run.sort(own) if counts[i] and hasattr(run, "sort") else None
            groups.setdefault(i if alike is None else (run, alike), []).append(i)
        kept, width = seen.own.reshape(-1), seen.own.shape[1]
        rows = (count * width * finger + cells) + width * np.arange(count)[:, None]
        for group in groups.values():
            chosen: Any = slice(None) if len(group) == len(memory) else np.isin(finger, group).nonzero()[0]
            at, own_rows = cells[chosen], rows[:, chosen]
            part = Measurement(
                seen.quadratic_basis.take(at, 1),
                seen.height[at],
                force[chosen],
                seen.target[at],
                seen.mode[at],
                kept.take(own_rows, mode="clip"),  # another mode checks
                seen.cells[at],
            )
            yield group, chosen, part, WHOLE if len(group) == 1 else Sections([counts[i] for i in group])
            kept[own_rows.ravel()] = part.own.ravel()  # one row of numbers takes half the time


def find_lowest(under: Floats) -> Cells:
    """Return the finger with the lowest of undersides (f, q), (q,); `NOBODY`: all are infinite."""
    lowest: Cells = find_first_largest(-under)
    lowest[np.minimum.reduce(under) == np.inf] = NOBODY
    return lowest


def find_blister(run: Any, memory: Any) -> tuple[float, float, float, float, float]:
    """Return where a blister is, x, y and radius, m, below 0: none; the heights of its ground and top, m."""
    place = memory.place
    x, y = place or (BEYOND, BEYOND)
    # That of a method without a master reaches from the pressed cells on.
    radius = run.blister.radius + getattr(run.parameters, "jump", 0.0)
    radius = radius * (1.0 + RELATIVE_TOLERANCE) if place else -1.0
    return x, y, radius, memory.edge, getattr(memory, "top", getattr(memory, "height", memory.edge))
