"""Matrix drive: valves for the lines and columns of a bed, in place of one per cell.

A cell opens if its line is addressed, and then as its column commands. The lines are divided into
k interleaved sets with column valves of their own: line i belongs to set i mod k. A bed of n lines
of m cells has n + k m valves, and in a slot a set addresses one line, or several that share the
column commands. The valves of all other cells stay shut.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.arrays import TIE, Cells, Flags, Floats, settle
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from .control_interface import Commands, Measurement
from .layout import Layout

#: Urgency (n,) of lines, by the effort of each and whether it is addressed. Of equally urgent lines
#: the one that has waited longest is addressed.
Urgency = Callable[[Floats, Flags], Floats]
POLICIES: dict[str, Urgency] = {
    "pressed": lambda effort, served: effort,
    "largest": lambda effort, served: effort,
    "needed": lambda effort, served: np.sign(effort),
    "one_time": lambda effort, served: np.sign(effort) * (1.0 + served),
    "round_robin": lambda effort, served: 0.0 * effort,
}
#: Parameters by kind of drive.
KINDS = {
    "matrix": (
        "sections",
        "axis",
        "slot",
        "policy",
        "share",
        "line_lag",
        "overlap",
        "leak",
        "trapped_volume",
        "bulk_modulus",
    ),
    "servo": ("frame", "dead_zone", "height_step", "servo_gain"),
}
#: Least time constant of a gate, as of a valve, s.
SHORTEST_LAG = 1e-9
#: Weight of a line under a fingertip, with the policy *pressed*.
PRESSED = 5.0


@dataclass(frozen=True, eq=False, repr=False)
class DriveParameters(Parameters):
    """Parameters of a drive: of valves for lines and columns of cells, or of servos."""

    kind: str = quantity(
        "matrix",
        "how valves belong to cells: to their lines and columns, or each to a servo of its own",
        choices=tuple(KINDS),
    )
    sections: int = quantity(
        4,
        "interleaved sets of column valves; one per line: a valve per cell",
        symbol="k",
        at_least=1,
    )
    axis: str = quantity(
        "rows", "lines that are addressed: rows or columns of cells", choices=("rows", "columns")
    )
    slot: float = quantity(
        0.0,
        "time for which lines stay addressed, whole control periods; 0: one of them",
        unit="s",
        symbol="s",
        at_least=0.0,
    )
    policy: str = quantity(
        "pressed",
        "lines addressed first: those with the largest sum of commands, where lines under the "
        "fingertip count five times (pressed) or once (largest); those that need it, in turn "
        "(needed) or each until it has arrived (one_time); all in turn (round_robin)",
        choices=tuple(POLICIES),
    )
    share: bool = quantity(
        False,
        "whether lines of a set are addressed together, with the commands they have in common",
    )
    line_lag: float = quantity(
        0.0,
        "time constant of the gates of lines, in series with those of columns, whose lag is that of "
        "the valve; 0: a cell opens and shuts as one valve",
        unit="s",
        symbol="τ_l",
        at_least=0.0,
    )
    overlap: float = quantity(
        0.0,
        "time by which gates of lines follow those of columns",
        unit="s",
        symbol="t_o",
        at_least=0.0,
    )
    leak: float = quantity(
        0.0,
        "conductance of a shut gate as a share of an open one",
        symbol="ε",
        at_least=0.0,
        below=1.0,
    )

    trapped_volume: float = quantity(
        0.0, "volume between the gates of a cell", unit="m3", symbol="V_t", at_least=0.0
    )
    bulk_modulus: float = quantity(
        1e9, "bulk modulus of the fluid in it", unit="Pa", symbol="β", above=0.0
    )

    frame: float = quantity(
        0.0,
        "time for which servos hold commanded heights, whole control periods; 0: one of them",
        unit="s",
        symbol="T_f",
        at_least=0.0,
    )
    dead_zone: float = quantity(
        0.0, "height error without a command of the servo", unit="m", symbol="δ_s", at_least=0.0
    )
    height_step: float = quantity(
        0.0, "step of commanded heights; 0: none", unit="m", symbol="q_s", at_least=0.0
    )
    servo_gain: float = quantity(
        500.0, "proportional gain of the servo", unit="1/m", symbol="K_s", above=0.0
    )

    def list_idle(self) -> frozenset[str]:
        """Return the parameters of other kinds."""
        kinds = (names for kind, names in KINDS.items() if kind != self.kind)
        return frozenset(name for names in kinds for name in names)

    def check(self) -> None:
        """Refuse parameters of another kind, and properties of gates without gates."""
        for name in self.list_idle():
            value, default = getattr(self, name), type(self).__dataclass_fields__[name].default
            if value != default:
                rule = f"must be left out with drive.kind = {self.kind}"
                raise ParameterError("drive", name, rule, str(value))
        if 0.0 < self.line_lag < SHORTEST_LAG:
            rule = f"must be 0 or at least {SHORTEST_LAG:g} s"
            raise ParameterError("drive", "line_lag", rule, f"{self.line_lag:g} s")
        if self.trapped_volume and self.leak:
            rule = "must be 0 with drive.leak, which empties it"
            raise ParameterError("drive", "trapped_volume", rule, f"{self.trapped_volume:g} m3")
        for name in ("overlap", "leak", "trapped_volume"):
            value = getattr(self, name)
            if value and not self.line_lag:
                rule = "must be 0 without gates of lines: give drive.line_lag"
                raise ParameterError("drive", name, rule, f"{value:g}")

    def count_lines(self, layout: Layout) -> int:
        """Return the number n of lines of a bed."""
        return layout.rows if self.axis == "rows" else layout.columns

    def count_valves(self, layout: Layout) -> int:
        """Return the number of valves, n + k m."""
        lines, cells = self.count_lines(layout), layout.rows * layout.columns
        return cells if self.kind == "servo" else lines + self.sections * (cells // lines)

    def count_turns(self, layout: Layout) -> int:
        """Return in how many turns all lines are addressed."""
        at_once = self.share or self.kind == "servo"
        return 1 if at_once else math.ceil(self.count_lines(layout) / self.sections)

    def locate(self, layout: Layout, cells: Cells) -> tuple[Cells, Cells]:
        """Return the lines of cells (m,), and their places along them."""
        row, column = np.divmod(cells, layout.columns)
        return (row, column) if self.axis == "rows" else (column, row)

    def check_device(self, layout: Layout, period: float, dead_time: float) -> None:
        """Refuse more sections than lines, and times that do not fit the control period or dead time, s."""
        for name in ("frame", "slot"):
            time = getattr(self, name)
            if time and abs(time - count_periods(time, period) * period) > TIE * period:
                rule = f"must be a whole number of control periods, {period:g} s, or 0"
                raise ParameterError("drive", name, rule, f"{time:g} s")
        if self.kind == "servo":
            return
        lines = self.count_lines(layout)
        if self.sections > lines:
            rule = f"must be at most the number of layout.{self.axis}, {lines}"
            raise ParameterError("drive", "sections", rule, str(self.sections))
        slot = self.slot or period
        if slot < dead_time:
            rule = f"must be at least delay.dead_time, {dead_time:g} s"
            raise ParameterError("drive", "slot", rule, f"{slot:g} s")
        if self.overlap > slot:
            rule = f"must be at most a slot, {slot:g} s, or lines open for the columns of others"
            raise ParameterError("drive", "overlap", rule, f"{self.overlap:g} s")


def count_periods(time: float, period: float) -> int:
    """Return the control periods, of `period` s, of a slot or frame, s; 0: one of them."""
    return max(1, round(time / period))


class Addressing(NamedTuple):
    """State of the drive."""

    served: Flags
    last: Cells
    """(n,): Whether a line is addressed, and the control period in which it last was; -1: never."""
    waiting: Cells
    """(w,): Numbers of cells whose commands did not act, or only in part, in the last period."""


@dataclass(frozen=True, eq=False)
class MatrixAddressing:
    """Drive of a bed by lines and columns."""

    parameters: DriveParameters
    layout: Layout
    slot: int
    """Control periods."""
    floor: float
    """Largest force of a cell that is not touched, N."""

    @property
    def lines(self) -> int:
        """Number of lines."""
        return self.parameters.count_lines(self.layout)

    @property
    def sets(self) -> list[str | int]:
        """Axis and number of sets."""
        return [self.parameters.axis, self.parameters.sections]

    def begin(self) -> Addressing:
        """Return the state before a session: each set addresses its first line."""
        lines = self.lines
        return Addressing(
            np.arange(lines) < self.parameters.sections,
            np.full(lines, -1, np.intp),
            np.empty(0, np.intp),
        )

    def serve(
        self, state: Addressing, period: int, seen: Measurement, orders: Commands
    ) -> tuple[Addressing, Commands]:
        """Return the commands that act in a control period: 0 for cells whose line is not addressed."""
        line, place = self.parameters.locate(self.layout, seen.cells)
        table = np.zeros((self.lines, seen.cells.size and int(place.max()) + 1))
        table[line, place] = orders.command
        served = state.served
        if period % self.slot == 0:
            served = self.choose(state, period, self.measure_effort(line, seen, orders), table)
        command = np.where(served[line], orders.command, 0.0)
        if self.parameters.share:
            common = self.find_common(table, served)
            command = np.where(served[line], common[line % self.parameters.sections, place], 0.0)
        waiting = seen.cells[command != orders.command]
        last = np.where(served, period, state.last)
        return Addressing(served, last, waiting), orders._replace(command=command)

    def measure_effort(self, line: Cells, seen: Measurement, orders: Commands) -> Floats:
        """Return the efforts of all lines, (n,): the sums of their commands' amounts."""
        effort: Floats = settle(np.bincount(line, np.abs(orders.command), self.lines))
        if self.parameters.policy == "pressed":
            effort[line[seen.force > self.floor]] *= PRESSED
        return effort

    def choose(self, state: Addressing, period: int, effort: Floats, table: Floats) -> Flags:
        """Return which lines are addressed in the slot that begins, (n,)."""
        sections = self.parameters.sections
        urgency = POLICIES[self.parameters.policy](effort, state.served)
        order = np.lexsort((-np.arange(self.lines), period - state.last, urgency))[::-1]
        _, first = np.unique(order % sections, return_index=True)
        served = np.zeros(self.lines, np.bool_)
        served[order[first]] = True
        if self.parameters.share:
            for leader in order[first]:
                served[self.join(leader, order[order % sections == leader % sections], table)] = (
                    True
                )
        return served

    def join(self, leader: int, lines: Cells, table: Floats) -> list[int]:
        """Return the lines of a set that are addressed with its leader, as long as all get more done."""
        joined, common = [leader], table[leader]
        for line in lines:
            closer = np.clip(0.0, *np.sort((common, table[line]), axis=0))
            more = np.abs(closer).sum() * (len(joined) + 1)
            if line != leader and more > np.abs(common).sum() * len(joined) + TIE:
                joined, common = [*joined, line], closer
        return joined

    def find_common(self, table: Floats, served: Flags) -> Floats:
        """Return the column commands of each set, (k, m): what all its addressed lines command at least."""
        sections = self.parameters.sections
        by_set = (table[first::sections][served[first::sections]] for first in range(sections))
        return np.array([np.clip(0.0, lines.min(axis=0), lines.max(axis=0)) for lines in by_set])


def make_addressing(
    drive: DriveParameters, layout: Layout, period: float, floor: float
) -> MatrixAddressing:
    """Put the drive of a bed together; control period, s; noise floor of a cell's force, N."""
    return MatrixAddressing(drive, layout, count_periods(drive.slot, period), max(floor, TIE))
