"""Method II's arrows: every one of Fig. 5 is walked, and no other exists."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.cell_states import BY_FORCE, BY_PLACE, VIRTUAL_SPRING, follow_arrows

#: Fig. 5, written down from the paper: from, to, when. VS is any cell on a virtual spring.
FIGURE_5 = [
    ("VS", "FF", "above_spring_trigger"),
    ("blister", "FF", "above_blister_trigger"),
    ("frozen", "FF", "above_blister_trigger"),
    ("FF", "critical", "below_critical_trigger"),
    ("critical", "FF", "above_critical_trigger"),
    ("critical", "blister", "timed_out"),
    ("VS", "blister", "in_blister"),
    ("blister", "frozen", "left_behind"),
    ("VS", "edge", "at_edge"),
    ("blister", "edge", "at_edge"),
    ("frozen", "edge", "at_edge"),
    ("edge", "VS", "outside"),
    ("blister", "VS", "outside"),
    ("frozen", "VS", "outside"),
]
STATES = {
    "VS": (Mode.REST, Mode.HOLD, Mode.SPRING, Mode.EDGE),
    "FF": (Mode.FORCE_FOLLOW,),
    "blister": (Mode.BLISTER,),
    "frozen": (Mode.FROZEN,),
    "critical": (Mode.CRITICAL,),
    "edge": (Mode.EDGE,),
}
GOALS = {"VS": Mode.HOLD, **{name: modes[0] for name, modes in STATES.items() if name != "VS"}}
CONDITIONS = sorted({arrow.condition for arrow in (*BY_FORCE, *BY_PLACE)})


def after(mode: Mode, condition: str | None) -> Mode:
    """Return where one cell goes when only `condition` holds."""
    holds = {name: np.array([name == condition]) for name in CONDITIONS}
    modes = follow_arrows(np.array([mode], np.int8), BY_FORCE, holds)
    return Mode(int(follow_arrows(modes, BY_PLACE, holds)[0]))


@pytest.mark.parametrize(("source", "goal", "condition"), FIGURE_5)
def test_an_arrow_of_the_figure_leads_where_it_points(source: str, goal: str, condition: str) -> None:
    assert {after(mode, condition) for mode in STATES[source]} == {GOALS[goal]}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_no_cell_moves_along_an_arrow_the_figure_lacks(condition: str) -> None:
    drawn = {mode for source, _, when in FIGURE_5 if when == condition for mode in STATES[source]}
    assert {mode for mode in Mode if after(mode, condition) != mode} <= drawn


@pytest.mark.parametrize("mode", list(Mode))
def test_a_cell_stays_what_it_is_while_no_condition_holds(mode: Mode) -> None:
    assert after(mode, None) == mode


def test_every_spring_mode_is_a_source_of_the_first_arrow() -> None:
    assert set(BY_FORCE[0].source) == set(VIRTUAL_SPRING)


def test_of_two_arrows_from_one_mode_the_later_wins() -> None:
    holds = {
        name: np.array([name in ("below_critical_trigger", "above_critical_trigger")]) for name in CONDITIONS
    }
    assert follow_arrows(np.array([Mode.CRITICAL], np.int8), BY_FORCE, holds)[0] == Mode.FORCE_FOLLOW
