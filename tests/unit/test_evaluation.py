"""Which points of a sweep run together, what is said of it, and that it makes no difference."""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.batch.packing import extend_path
from digiclay.core.engine.simulation import simulate_period
from digiclay.core.model.fingertip import Fingertip, compute_reach
from digiclay.core.model.touch import trace_finger
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.columns import begin, make_batch
from digiclay.core.scene.scene_source import Setting, find
from digiclay.core.studies.axes import Point, make_points, read_axis
from digiclay.core.studies.evaluation import (
    RUNS,
    TIMES,
    BatchWarning,
    evaluate,
    evaluate_bundle,
    make_bundles,
)

SHORT = [Setting("simulation.duration", "0.1")]


pytestmark = pytest.mark.usefixtures("here")


def some(*varied: str, settings: list[Setting] | None = None) -> list[Point]:
    """Return the points of a sweep over a tap."""
    return make_points(find("tap"), settings or SHORT, [read_axis(one) for one in varied])


def indices(parts: tuple[tuple[Point, ...], ...]) -> list[list[int]]:
    """Return which points are in which bundle."""
    return [[point.index for point in part] for part in parts]


def calls(count: int) -> list[int]:
    """Return how many functions of numpy and others each control period of so many taps calls."""
    scenes = [point.scene for point in some(f"control.force_gain=1:6:{count}", settings=[])]
    systems = [assemble(scene) for scene in scenes if scene]
    stack = make_batch(systems)
    state, ways = begin(stack), [scene.section("trajectory").trajectory() for scene in scenes if scene]
    made, counted = [0], []

    def count_one(frame: Any, event: str, argument: Any) -> None:
        made[0] += event == "c_call"

    fingers = extend_path(None, systems, ways, 0)
    assert fingers
    for period in range(100):
        made[0] = 0
        sys.setprofile(count_one)
        try:
            state = simulate_period(stack, state, fingers.at(period))
        finally:
            sys.setprofile(None)
        counted.append(made[0])
    return counted


def test_a_control_period_of_a_larger_stack_takes_no_more_calls() -> None:
    # The median: now and then a set of cells is made anew, and not in the same periods.
    assert np.median(calls(16)) == np.median(calls(4))


@pytest.mark.parametrize(
    ("count", "duration", "sizes"),
    [
        (2 * RUNS - 1, "0.1", [2 * RUNS - 1]),
        (2 * RUNS + 1, "0.1", [RUNS, RUNS + 1]),
        (20, "1e4", [10, 10]),  # 2 million rows of 41 bytes are 82 MB, and a stack may hold 1 GiB
        (5, "1e5", []),
    ],
)
def test_a_stack_has_no_more_runs_than_pay_or_fit_into_memory(count, duration, sizes):
    settings = [Setting("simulation.duration", duration)]
    parts = make_bundles(some(f"control.force_gain=1:6:{count}", settings=settings))
    assert [len(batch) for batch in parts.batches] == sizes
    reason = f"{count} points one at a time: they have too many rows to keep for many at once"
    assert (parts.describe() == [reason]) == (not sizes)


HALVED = ("delay.dead_time=1 ms,2.5 ms", "control.force_gain=1:4:4")
METHODS = "control.method=viscous,push_pull,cell_states,virtual_master"
NOISE = ("sensors.force_noise=1e-3,2e-3,3e-3", "sensors.seed=1,2")
TRIGGERS = ("control.blister_trigger=0.01,0.03", "control.spring_trigger=0.02,0.06,0.08")


@pytest.mark.parametrize(
    ("varied", "setting", "errors", "batches", "alone", "said"),
    [
        pytest.param(
            ("control.force_gain=1,2,3,4", "layout.rows=11,13"), "", False, [[0, 2, 4, 6], [1, 3, 5, 7]], [],
            "8 points run in 2 stacks", id="points of one structure run together",
        ),
        pytest.param(
            ("layout.rows=11,13,15",), "", False, [], [[0], [1], [2]],
            "3 points one at a time: fewer than 4 have the same bed, parts and steps", id="too few of a kind",
        ),
        pytest.param(HALVED, "", False, [[*range(8)]], [], "8 points run in 1 stack", id="not judged"),
        # A dead time of half a control period falls on the end of a half step.
        pytest.param(HALVED, "", True, [[0, 1, 2, 3], [4, 5, 6, 7]], [], "8 points run in 2 stacks", id="ha"),
        pytest.param(
            HALVED[1:], "simulation.physics_step=5e-6", True, [], [[0], [1], [2], [3]], None, id="too fine"
        ),
        pytest.param(
            (METHODS, *NOISE), "", False, [[*range(first, first + 6)] for first in (0, 6, 12, 18)], [],
            "24 points run in 4 stacks", id="every method with noise",
        ),
        pytest.param(
            ("sensors.force_noise=0,1e-3", NOISE[1]), "", False, [], [[0], [1], [2], [3]], None,
            id="with noise and without it are two structures",
        ),
        pytest.param(
            TRIGGERS, "control.method=cell_states", False, [[0, 1, 2, 4, 5]], [[3]], None,
            id="values that do not go together",
        ),
    ],
)  # fmt: skip
def test_points_of_one_structure_run_together_and_others_alone(varied, setting, errors, batches, alone, said):
    settings = [*SHORT, *([Setting(*setting.split("="))] if setting else [])]
    parts = make_bundles(some(*varied, settings=settings), errors=errors)
    assert (indices(parts.batches), indices(parts.alone)) == (batches, alone)
    assert said is None or parts.describe() == [said]


def test_the_reach_of_many_fingers_is_that_of_each() -> None:
    poses = np.zeros((3, 2, 7))
    poses[..., 3], poses[:, :, 2] = 1.0, np.array([[0.03, 0.031], [0.0405, 0.04], [0.06, 0.06]])
    windows = trace_finger(Fingertip(), poses).windows
    alone = [compute_reach(window, 0.04) for window in windows]
    together = np.array(compute_reach(np.array(windows).T, np.full(3, 0.04))).T
    np.testing.assert_allclose(together[:2], alone[:2], rtol=1e-12)
    assert alone[2] is None  # the last one is far above the bed
    assert together[2, 2] < 0.0


@pytest.mark.parametrize("errors", [False, True])
def test_a_bundle_comes_to_the_figures_of_its_points_and_can_be_stopped(errors):
    bundle = some("control.force_gain=1,5")
    assert evaluate_bundle(bundle, lambda: True) == [None, None]
    for record, point in zip(evaluate_bundle(bundle, errors=errors), bundle, strict=True):
        own, other = (
            {name: value for name, value in one["figures"].items() if name not in TIMES and value is not None}
            for one in (record, evaluate(point.scene, errors=errors))
        )
        assert own == pytest.approx(other, rel=1e-9, abs=1e-15)


def break_stacks(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """Let stacks fail as a whole."""

    def faulty(*given: Any, **known: Any) -> Any:
        raise error

    monkeypatch.setattr("digiclay.core.studies.evaluation.measure_together", faulty)


def test_a_fault_in_a_stack_is_not_passed_over(here, monkeypatch, capsys):
    # Warnings are errors in tests: a stack that fails by our own fault fails the test it runs in.
    break_stacks(monkeypatch, ZeroDivisionError("by\nzero"))
    with pytest.warns(BatchWarning, match="A batch of 2 runs failed: ZeroDivisionError: by zero"):
        records = evaluate_bundle(some("control.force_gain=1,5"))
    assert [record and record["alone"] for record in records] == ["ZeroDivisionError: by zero"] * 2
    break_stacks(monkeypatch, MemoryError())
    varied = ["--vary", "control.force_gain=1:5:4", "--set", "simulation.duration=0.1", "--workers", "1"]
    assert main(["sweep", "tap", *varied, "--out", "out"]) == 0
    assert "\n4 points one at a time: there is not enough memory for a stack\n" in capsys.readouterr().out
    table = (here / "out" / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert [line.endswith(",") for line in table[1:]] == [True] * 4  # no point has an error


def test_a_sweep_says_how_its_points_were_run_and_one_done_again_comes_to_the_same_bits(here, capsys):
    sweep = ["sweep", "tap", "--vary", "control.force_gain=1:6:4", "--set", "simulation.duration=0.1"]
    main([*sweep, "--out", "out"])
    assert "4 points\n4 points run in 1 stack\n" in capsys.readouterr().out
    file, figures = here / "out" / "points" / "000003.json", []
    for _ in range(2):
        kept = json.loads(file.read_text(encoding="utf-8"))["figures"]
        figures.append({name: value for name, value in kept.items() if name not in TIMES})
        file.unlink()
        main([*sweep, "--out", "out", "--quiet"])
    assert figures[0] == figures[1]
