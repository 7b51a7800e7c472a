"""What the benchmarks share, and the arithmetic of their tables."""

from __future__ import annotations

import re
import statistics
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import FrameType

import numpy as np
import pytest
from digiclay.commands.progress import table
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble

from benchmarks import commit_pair
from benchmarks import peers as peers
from benchmarks.__main__ import main
from benchmarks.numpy_calls import Counted, Ledger, floor, methods_noted, period_calls
from benchmarks.problems import PROBLEMS, problem, solved
from benchmarks.python_loop import loop
from benchmarks.report import kept, made_with
from benchmarks.terms import LONGER, TERMS, without
from benchmarks.work_precision import Work, best_ratio
from tests.assemble import sample

ONE = "one cell, load step"


@pytest.fixture
def ledger() -> Iterator[Ledger]:
    """A ledger of its own, in place of the class's."""
    former, Counted.ledger = Counted.ledger, Ledger()
    yield Counted.ledger
    Counted.ledger = former


def test_every_kind_of_call_is_counted_once(ledger: Ledger) -> None:
    a = np.ones(3).view(Counted)
    b = a + 1.0  # add
    np.exp(b, b)  # exp
    b *= 2.0  # multiply
    np.dot(b, a)  # dot
    b.max()  # maximum.reduce
    b[1:]  # __getitem__
    b[0] = 1.0  # __setitem__
    assert ledger.calls.total() == 7


def test_methods_of_plain_arrays_are_counted(ledger: Ledger) -> None:
    a, bound = np.ones(3).view(Counted), np.eye(3).dot
    with methods_noted():
        product = bound(a)
        np.zeros(2).copy()
    assert {key[0]: times for key, times in ledger.calls.items()} == {"dot": 1, "zeros": 1, "copy": 1}
    assert type(product) is Counted


def test_the_products_of_plain_arrays_in_a_period_are_all_counted() -> None:
    # Python's own profiler says how often the core asks for that of the master's view of the cells.
    scene, asked = sample("ridge_mound_valley"), 0
    system, trajectories = assemble(scene), scene.trajectories()

    def noted(frame: FrameType, event: str, called: object) -> None:
        nonlocal asked
        owner = getattr(called, "__self__", None)
        asked += event == "c_call" and type(owner) is np.ndarray and owner.shape == (2, 6)

    calls, counted = period_calls(system, trajectories, 300)
    sys.setprofile(noted)
    try:
        for _ in periods(system, trajectories, begin(system), 300):
            pass
    finally:
        sys.setprofile(None)
    assert counted.calls["dot", (2, 6)] == asked > 100
    assert len(calls) == 300


def test_a_period_of_method_i_makes_at_most_115_numpy_calls() -> None:
    # A count, not seconds: the same wherever it is taken, and a call more for the cells is one more.
    scene = sample("ridge_mound_valley")
    calls, _ = period_calls(assemble(scene), scene.trajectories(), 2000)
    assert statistics.median(calls) <= 115


def test_a_period_of_method_iii_makes_fewer_than_twice_the_numpy_calls_of_method_i() -> None:
    scene = sample("ridge_mound_valley", "control.method=hybrid")
    calls, _ = period_calls(assemble(scene), scene.trajectories(), 400)
    # While the force is held every second period makes 174 calls, the others 262.
    assert statistics.mean(calls[300:]) < 2 * 115


def test_counting_does_not_change_a_result(ledger: Ledger) -> None:
    a = np.linspace(0.0, 1.0, 5)
    counted = np.exp(a.view(Counted) * 2.0)[1:]
    assert (type(counted), counted.tolist()) == (Counted, np.exp(a * 2.0)[1:].tolist())


def test_every_counted_call_can_be_timed_by_itself(ledger: Ledger) -> None:
    a = np.ones(3).view(Counted)
    np.add(a, a, a)
    a[1:]
    alone = floor(ledger)
    assert set(alone) == set(ledger.calls)
    assert min(alone.values()) > 0.0


def test_a_table_is_aligned() -> None:
    lines = list(table(("case", "µm"), [["a", "1"], ["long name", "1234"]]))
    assert lines == [
        "  case         µm",
        "  ---------  ----",
        "  a             1",
        "  long name  1234",
    ]


def test_results_name_versions_and_no_path(tmp_path: Path) -> None:
    kept(tmp_path / "new", "what", made_with(), ("a", "b"), [(1, 2.5)])
    assert (tmp_path / "new" / "what.csv").read_text(encoding="utf-8") == "a,b\n1,2.5\n"
    said = (tmp_path / "new" / "what.md").read_text(encoding="utf-8")
    assert f"numpy {np.__version__}" in said
    assert not re.search(r"(^|\s)/\w", said)


def test_results_that_cannot_be_written_are_told_of_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OutputError, match="Cannot write into"):
        kept(tmp_path / "file", "what", "", ("a",), [])


def test_the_cheapest_run_is_the_fastest_that_is_exact_enough() -> None:
    def run(method: str, error: float, seconds: float, *, peer: bool) -> Work:
        return Work("p", method, 0.0, error, 0.0, seconds, 0, peer)

    work = [
        run("bernoulli", 1e-5, 1.0, peer=False), run("bernoulli", 1e-7, 3.0, peer=False),
        run("LSODA", 1e-7, 60.0, peer=True), run("Python loop", 1e-9, 9.0, peer=True),
    ]  # fmt: skip
    ratios = [best_ratio(work, level) for level in (1e-5, 1e-6, 1e-8)]
    assert ratios == [60.0, 20.0, None]


@pytest.mark.parametrize("name", [ONE, "pressed and held"])
def test_scipys_physics_are_ours(name: str) -> None:
    # LSODA at 1e-8 and Richardson's form at 0.1 ms are each within 1 nm of the exact solution.
    known = problem(name)
    simulation = replace(known.scene.simulation, stepper="richardson", physics_step=1e-4)
    mine = solved(replace(known.scene, simulation=simulation), known.commands)
    theirs, _, evaluations = peers.peer(known, peers.SOLVERS["LSODA"], 1e-8)
    assert mine.against(theirs)[0] < 2e-9
    assert evaluations > known.scene.periods


def test_the_python_loop_is_the_closed_form_step() -> None:
    # Same formulas, same steps: rounding only.
    known = problem(ONE)
    looped, _ = loop(known, 1e-3, known.scene.periods)
    assert solved(known.scene, known.commands).against(looped)[0] < 1e-12


def test_every_problem_has_contact_and_moving_pins() -> None:
    idle = []
    for name in PROBLEMS:
        known = problem(name)
        found = solved(known.scene, known.commands)
        if found.forces.max() <= 0.1 or np.ptp(found.heights) <= 0.1e-3:
            idle.append(name)
    assert idle == []


def test_without_scipy_the_benchmark_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy.integrate", None)
    assert "pip install" in peers.missing()


@pytest.mark.parametrize("term", TERMS)
def test_a_term_left_out_is_absent_and_nothing_else_changes(term: str) -> None:
    scene = sample("tap")
    less = without(scene, term)
    section = TERMS[term]
    if scene.section(section) is None:
        assert less is None
    else:
        assert less is not None
        assert less.with_sections(**{section: scene.section(section)}) == scene


def test_the_longer_step_is_the_control_period() -> None:
    scene = sample("tap")
    less = without(replace(scene, simulation=replace(scene.simulation, physics_step=1e-3)), LONGER)
    assert less is not None
    assert less.simulation.physics_step == less.simulation.control_period
    assert without(less, LONGER) is None


def test_terms_gives_a_line_for_every_term(capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["terms", "tap", "--quick", "--quiet"])
    out = capsys.readouterr().out
    named = ("the full scene", "without conduit", "without relaxation", "all of these")
    assert (code, [name for name in named if name not in out]) == (0, [])


@pytest.mark.parametrize("kind", ["session", "stiff", "precision", "scale", "terms"])
def test_every_benchmark_shows_an_example(kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out = main([kind, "--help"]), capsys.readouterr().out
    assert (code, f"  python -m benchmarks {kind}" in out.partition("examples:")[2]) == (0, True)


def test_two_commits_are_timed_by_their_own_code(tmp_path: Path) -> None:
    tree = commit_pair.extract("HEAD", tmp_path)
    times = commit_pair.run(tree, "HEAD", 2)
    assert len(times) == len(commit_pair.CASES)
    assert all(0.0 < time < 1.0 for time in times)
    (tree / "digiclay" / "core" / "engine" / "simulation.py").write_text("1 / 0\n", encoding="utf-8")
    with pytest.raises(
        DigiclayError, match=r"^commits: HEAD cannot be timed: ZeroDivisionError: division by"
    ):
        commit_pair.run(tree, "HEAD", 2)
    with pytest.raises(DigiclayError, match=r"^commits: nonsense must be a commit, branch or tag"):
        commit_pair.extract("nonsense", tmp_path)
