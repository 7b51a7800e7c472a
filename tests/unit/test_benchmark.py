"""The benchmarks: their commands, tables and files, what they count and vary."""

import re
import statistics
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError, OutputError
from digiclay.core.batch.structure import describe_structure
from digiclay.core.scene.assembly import assemble
from digiclay.core.studies.axes import Point
from digiclay.core.studies.evaluation import LEAST, make_bundles

from benchmarks import processes, runs_together, session_parts
from benchmarks.__main__ import main
from benchmarks.kinds import BENCHMARKS
from benchmarks.report import Report
from benchmarks.runs_together import STUDIES, study
from tests.assemble import sample
from tests.scene_files import command, read_text, write_text


@pytest.fixture
def ledger():
    """A ledger of its own, in place of the class's."""
    former, session_parts.Counted.ledger = session_parts.Counted.ledger, Counter()
    yield session_parts.Counted.ledger
    session_parts.Counted.ledger = former


def test_every_kind_of_call_is_counted_once_and_changes_no_result(ledger):
    a = np.ones(3).view(session_parts.Counted)
    b = a + 1.0  # add
    np.exp(b, b)  # exp
    b *= 2.0  # multiply
    np.dot(b, a)  # dot
    b.max()  # maximum.reduce
    b[1:]  # __getitem__
    b[0] = 1.0  # __setitem__
    assert ledger.total() == 7
    assert (type(b), b.tolist()) == (
        session_parts.Counted,
        [1.0, *(2.0 * np.exp(np.full(2, 2.0))).tolist()],
    )
    ledger.clear()
    bound = np.eye(3).dot
    with session_parts.note_methods():  # of plain arrays
        product = bound(a)
        np.zeros(2).copy()
    assert ledger == {"dot": 1, "zeros": 1, "copy": 1}
    assert type(product) is session_parts.Counted


def test_a_period_of_method_i_makes_at_most_115_numpy_calls_all_counted_and_of_method_iii_under_231():
    # A count, not seconds: the same wherever it is taken, and a call more for the cells is one
    # more.
    scene, asked = sample("ridge_mound_valley"), 0
    system, trajectories = assemble(scene), scene.trajectories()

    def note(frame, event, called):
        # Python's own profiler counts the products of the master's view of the cells.
        nonlocal asked
        owner = getattr(called, "__self__", None)
        asked += event == "c_call" and type(owner) is np.ndarray and owner.shape == (2, 6)

    calls, counted = session_parts.period_calls(system, trajectories, 200)
    sys.setprofile(note)
    try:
        session_parts.simulate(system, scene, 200)
    finally:
        sys.setprofile(None)
    assert counted["dot"] >= asked > 100
    assert (len(calls), statistics.median(calls) <= 115) == (200, True)
    # While the force is near its set point Method III solves every second period for less: 230.7 on
    # average.
    scene = sample("ridge_mound_valley", "control.method=hybrid")
    calls, _ = session_parts.period_calls(assemble(scene), scene.trajectories(), 320)
    assert statistics.mean(calls[240:]) < 231


@pytest.mark.parametrize(
    "line, message",
    [
        ("session --repeats 0", "must be a whole number from 1 to 1000"),
        (
            "scale --out my.toml/new",
            "scale: argument --out: my.toml/new cannot be a folder: my.toml is a fi",
        ),
        ("sesion", "Did you mean session?"),
        ("commits nonsense --quiet", "commits: nonsense must be a commit, branch or tag"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(line, message, here, capsys):
    code, told = main(line.split()), capsys.readouterr()
    assert (code, told.out, told.err.count("\n"), message in told.err) == (2, "", 1, True)


def test_a_session_gives_the_cost_of_every_part_and_its_processor_time(here, capsys):
    files = [
        path.relative_to(session_parts.CORE).as_posix() for path in session_parts.CORE.rglob("*.py")
    ]
    assert [
        name for name in session_parts.FILES if not any(file.startswith(name) for file in files)
    ] == []
    assert set(session_parts.FILES.values()) == set(session_parts.PARTS)
    main(command("session --scene my.toml --repeats 1 --calls"))
    out = capsys.readouterr().out
    costs = {
        part: re.search(rf"^  {part} .* ([\d.]+)  ", out, re.MULTILINE)
        for part in session_parts.PARTS
    }
    assert [part for part, cost in costs.items() if not cost or not float(cost[1]) > 0.0] == []
    elapsed, spent = (
        float(re.search(rf"{word} ([\d.e-]+) s \(", out)[1]) for word in ("in", "time")
    )
    # One process, one thread: it uses no more than passes, but for the grain of the two clocks.
    assert 0.0 < spent <= 1.1 * elapsed
    assert re.search(r"^  multiply +[\d.]+$", out, re.MULTILINE)


def test_every_benchmark_shows_an_example_and_one_without_scipy_what_to_install(
    capsys, monkeypatch
):
    for kind in BENCHMARKS:
        code, out = main([kind, "--help"]), capsys.readouterr().out
        assert (code, f"  python -m benchmarks {kind}" in out.partition("examples:")[2]) == (
            0,
            True,
        )
    monkeypatch.setitem(sys.modules, "scipy", None)
    assert main(command("peers --quick")) == 2
    assert "pip install" in capsys.readouterr().err


def test_a_term_left_out_is_absent_and_nothing_else_changes(capsys):
    scene = sample("tap")
    for term, section in session_parts.TERMS.items():
        less = session_parts.without(scene, term)
        part = scene.section(section)
        assert (less and less.with_sections(**{section: part})) == (None if part is None else scene)
    less = session_parts.without(
        replace(scene, simulation=replace(scene.simulation, physics_step=1e-3)),
        session_parts.LONGER,
    )
    assert less.simulation.physics_step == less.simulation.control_period
    assert session_parts.without(less, session_parts.LONGER) is None
    assert main(command("terms tap --quick --quiet --set simulation.duration=0.1")) == 0
    out = capsys.readouterr().out
    for name in ("the full scene", "without conduit", "without relaxation", "all of these"):
        assert name in out


def test_two_commits_are_timed_by_their_own_code(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "STARTS", 1)
    tree = processes.extract("HEAD", tmp_path)
    times = processes.run_commit(tree, "HEAD", 2)
    assert len(times) == len(processes.CASES) + 1
    assert all(0.0 < time < 1.0 for time in times[:-1])
    assert 0.0 < times[-1] < 30.0
    write_text(tree / "addon" / "digiclay" / "core" / "engine" / "simulation.py", "1 / 0\n")
    with pytest.raises(DigiclayError, match=r"^commits: HEAD failed: ZeroDivisionError: division"):
        processes.run_commit(tree, "HEAD", 2)


@pytest.mark.parametrize("name", list(STUDIES))
def test_the_runs_of_a_study_differ_and_form_one_batch(name):
    scenes = study(sample("tap"), name, LEAST)
    section, key, low, high = STUDIES[name]
    usual = getattr(sample("tap").section(section), key)
    values = np.array([getattr(scene.section(section), key) for scene in scenes])
    assert np.all(np.diff(values) > 0.0)
    assert low * usual < values[0] < values[-1] < high * usual
    assert len({describe_structure(scene) for scene in scenes}) == 1
    assert make_bundles([Point(i, (), scene) for i, scene in enumerate(scenes)]).alone == ()


def test_a_benchmark_prints_and_writes_a_table_and_a_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(runs_together, "COUNTS", (2,))
    line = f"stack --scene tap --set simulation.duration=0.1 --quick --quiet --out {tmp_path}"
    assert main(command(line)) == 0
    printed = capsys.readouterr().out
    assert "control.force_gain varies" in printed
    assert "valve.stroke varies" in printed
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "stack.csv",
        "stack.md",
        "stack.png",
    ]
    text = read_text(tmp_path / "stack.md")
    assert printed in text
    # Results name versions and no path.
    assert f"numpy {np.__version__}" in text
    assert not re.search(r"(^|\s)/\w", text)
    with pytest.raises(OutputError, match="Cannot write into"):
        Report(iter(["a line"]), []).write(tmp_path / "stack.md", "what", text)
    lines = read_text(tmp_path / "stack.csv").splitlines()
    assert lines[0] == "study,runs,what,alone,together,times"
    kinds = ("simulated", "recorded and judged", "errors estimated too")
    assert [line.split(",")[:3] for line in lines[1:]] == [
        [name, "2", kind] for name in STUDIES for kind in kinds
    ]
