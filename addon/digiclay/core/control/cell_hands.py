"""Control of several fingers by a method of cells, without a master or an estimate of the fingertip.

Beside one fingertip pins may stand high that another one follows low. So each controller sees as following,
in its blister or frozen only the pins whose last command was its own; a pressed pin belongs to the fingertip
whose underside is nearest, for no pin is pressed deep; and of two commands that of the nearer one is obeyed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import TIE, Cells, Floats, find_first_largest
from ..base.modes import Mode
from ..model.control_interface import Measurement
from .finger_sections import BEYOND, Columns, Whole
from .hands import UNDER, HandInGroups, Hands
from .travel import measure_square

#: What a finger remembers of a pin where another one's command was obeyed.
ANOTHER = -1.0


@dataclass(frozen=True, eq=False)
class CellHands(HandInGroups):
    """Controller of several fingers, whose cells each follow their own force."""

    def _remember(self, own: Floats, obeyed: Cells) -> None:
        """Keep of each pin's command, in rows (r, m), what the finger obeyed remembers, for it alone."""
        first, pins = self.runs[0], np.arange(obeyed.size)
        whose = own[first.whose :: int(first.rows)]
        kept = whose[obeyed, pins]
        whose[:] = ANOTHER
        whose[obeyed, pins] = kept

    def _divide(self, *given: Any) -> Iterator[tuple[list[int], Any, Measurement, Whole]]:
        """Show each finger the pins that obey another one as if they held their height."""
        for group, chosen, part, sections in super()._divide(*given):
            np.putmask(part.mode, part.own[self.runs[0].whose] == ANOTHER, np.int8(Mode.HOLD))
            yield group, chosen, part, sections

    def _place(self, memory: Hands) -> Floats:
        """Return where all fingers are, (f, 2), m, from the first force on: cells follow later."""
        found = [(x, y) if radius >= 0.0 else (BEYOND, BEYOND) for x, y, radius in memory.discs]
        places: Floats = np.array([own.place or at for own, at in zip(memory.fingers, found, strict=True)])
        return places

    def _predict_under(self, memory: Hands, basis: Floats, height: Floats) -> Floats:
        """Return how far from undersides pins of a height, m, are, (f, q), m: one is on the nearest pin."""
        x, y = self._place(memory).T
        apart = measure_square(x, y, basis)
        under = super()._predict_under(memory, basis, height)
        under += height[find_first_largest(-apart.T)][:, None]
        under -= height
        return np.abs(under, under)

    def _choose(
        self, memory: Hands, seen: Measurement, owner: Cells, columns: Columns, target: Floats
    ) -> Cells:
        """Return which of the commands for each pin with several is obeyed, (g,)."""
        fingers, (x, y) = columns.named, columns.places
        at_x, at_y = self._place(memory).T.take(fingers, axis=1)
        order = (x - at_x) ** 2 + (y - at_y) ** 2
        # Who leaves a pin as it is, is not asked, unless the pin is under it; who presses it is asked first.
        still = np.abs(target.take(columns.pairs) - seen.target.take(columns.several)) <= TIE
        order += still & (order > UNDER**2 * self._sizes[2][:, 0].take(fingers))
        order[owner.take(columns.which) == fingers] = -1.0
        return columns.pick(-order)
