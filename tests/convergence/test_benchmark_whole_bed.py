"""Peers that are not told which cells take part solve the same problem, with all of its cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.peers import LOOP, SOLVERS, loop, peer
from benchmarks.precision import EVERYWHERE, LEVELS, Beside, Plan, list_beside, run_beside, spread_everywhere
from benchmarks.problems import Problem, Solution, Work, problem

PERIODS = 16


@pytest.fixture(scope="module")
def task() -> Problem:
    """The start of a press on a bed of 13 x 13 cells."""
    whole = problem("deep press", side=13)
    scene = replace(whole.scene, simulation=replace(whole.scene.simulation, duration=PERIODS * 5e-3))
    return Problem(whole.name, scene, whole.commands[:PERIODS], whole.sets[:PERIODS])


@pytest.fixture(scope="module")
def exact(task: Problem) -> Solution:
    """Richardson's form at 0.1 ms: within 1 nm."""
    return task.solve("richardson", 1e-4)


def idle(task: Problem) -> NDArray[np.intp]:
    """Return the cells that take no part in any period."""
    return np.setdiff1d(np.arange(task.scene.cells), np.concatenate([cells for cells, _ in task.sets]))


def found_by(task: Problem, method: str) -> Solution:
    """Return what a peer finds over the whole bed."""
    if method == LOOP:
        return loop(spread_everywhere(task), 1e-3)[0]
    return peer(spread_everywhere(task), SOLVERS[method], 1e-7)[0]


def test_the_problem_has_cells_that_take_no_part_and_others_that_move(task: Problem, exact: Solution) -> None:
    assert (task.scene.periods, idle(task).size > 50) == (PERIODS, True)
    assert np.ptp(exact.heights, axis=0).max() > 0.1e-3


def test_over_the_whole_bed_every_cell_may_be_touched_in_every_period(task: Problem) -> None:
    sets = spread_everywhere(task).sets
    assert len(sets) == PERIODS
    assert all(cells.tolist() == list(range(169)) and near == 169 for cells, near in sets)


def test_the_loop_over_the_whole_bed_finds_what_it_finds_when_told(task: Problem) -> None:
    # Same formulas, same steps, other order of the sums: rounding only.
    height, force = found_by(task, LOOP).compare(loop(task, 1e-3)[0])
    assert (height < 1e-14, force < 1e-9) == (True, True)


@pytest.mark.parametrize("method", [*SOLVERS, LOOP])
def test_a_peer_over_the_whole_bed_finds_our_heights(task: Problem, exact: Solution, method: str) -> None:
    found, cells = found_by(task, method), idle(task)
    # A tolerance of 1e-7 of 10 mm is 1 nm a step, which the contact's spring forgets; ours adds its 1 nm.
    assert method == LOOP or found.compare(exact)[0] < 5e-9
    # Cells that take no part stay exactly as in ours: their valves are shut and nothing presses.
    assert np.array_equal(found.heights[:, cells], exact.heights[:, cells])


def test_both_forms_of_a_peer_run_at_the_same_settings_to_the_same_errors(
    task: Problem, exact: Solution
) -> None:
    # The cells that take no part add no error; their share in a solver's sums is rounding.
    work = run_beside(task, exact, Plan((), {"bernoulli": (1e-3,)}, {"LSODA": (1e-3, 1e-5)}, side=13))
    ours, *peers = [(run.method, run.setting) for run in work]
    assert ours == ("bernoulli", 1e-3)
    forms = [(f"LSODA{form}", setting) for form in ("", EVERYWHERE) for setting in (1e-3, 1e-5)]
    assert peers == [*forms, (LOOP, 1e-3), (LOOP + EVERYWHERE, 1e-3)]
    assert work[1].height_error == pytest.approx(work[3].height_error, rel=0.02)
    assert [run.method for run in run_beside(task, exact, Plan((), {}, {}))] == [LOOP]


def test_over_the_whole_bed_nothing_is_known_of_which_cells_take_part(task: Problem, exact: Solution) -> None:
    # Told a lie, that one cell takes part, the told are wrong; the others are as exact as their setting.
    lied = replace(task, sets=[(cells[:1], 1) for cells, _ in task.sets])
    work = run_beside(lied, exact, Plan((), {}, {"LSODA": (1e-3,)}, side=13))
    assert [run.height_error > 1e-4 for run in work] == [EVERYWHERE not in run.method for run in work]
    assert max(run.height_error for run in work if EVERYWHERE in run.method) < 1e-5


def test_the_report_sets_the_ratios_of_both_forms_side_by_side(task: Problem) -> None:
    def run(method: str, setting: float, seconds: float, *, peer: bool) -> Work:
        return Work(task.name, method, setting, 1e-10, 0.0, seconds, 0, peer)

    work = [
        run("bernoulli", 1e-3, 2.0, peer=False), run("richardson", 5e-3, 1.0, peer=False),
        run("LSODA", 1e-3, 5.0, peer=True), run(f"LSODA{EVERYWHERE}", 1e-3, 20.0, peer=True),
        run(LOOP, 1e-3, 30.0, peer=True), run(LOOP + EVERYWHERE, 1e-3, 150.0, peer=True),
    ]  # fmt: skip
    lines = list(list_beside([Beside(task, work)], Plan((), {}, {}, side=13)))
    rows = [line.split() for line in lines if line.endswith((" 15.0", " 75.0"))]
    every = len(LEVELS)
    assert rows == [
        ["deep", "press", "told", *["5.0"] * every, "15.0"],
        ["whole", "bed", *["20.0"] * every, "75.0"],
    ]
    assert any("LSODA, whole bed" in line for line in lines)
