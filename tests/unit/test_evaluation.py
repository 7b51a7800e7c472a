"""Which points of a sweep run together, what is said of it, and that it makes no difference."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.batch.packing import begin, classify, extend_path, make_batch, merge_parts
from digiclay.core.engine.simulation import simulate_period
from digiclay.core.model.actuator import Supply
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import Fingertip, compute_reach
from digiclay.core.model.touch import trace_finger
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
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


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def some(*varied: str, settings: list[Setting] | None = None) -> list[Point]:
    """Return the points of a sweep over a tap."""
    return make_points(find("tap"), settings or SHORT, [read_axis(one) for one in varied])


def indices(parts: tuple[tuple[Point, ...], ...]) -> list[list[int]]:
    """Return which points are in which bundle."""
    return [[point.index for point in part] for part in parts]


def test_numbers_that_differ_become_an_array_and_the_others_stay() -> None:
    part = merge_parts([Contact(stiffness=100.0), Contact(stiffness=200.0)])
    np.testing.assert_array_equal(part.stiffness, [100.0, 200.0])
    assert part.exponent == Contact().exponent


def test_the_formulas_of_a_part_hold_for_many_runs() -> None:
    supplies = [Supply(high=4e4), Supply(low=-3e4)]
    openings = np.linspace(-1.0, 1.0, 12).reshape(6, 2)
    alone = np.column_stack([one.pressure(openings[:, run]) for run, one in enumerate(supplies)])
    np.testing.assert_array_equal(merge_parts(supplies).pressure(openings), alone)


def test_the_kind_of_a_part_is_all_but_its_numbers() -> None:
    assert classify(Contact(stiffness=100.0)) == classify(Contact())
    layout = load(find("tap")).layout
    assert classify(layout) != classify(replace(layout, rows=15))


def test_the_reach_of_many_fingers_is_that_of_each() -> None:
    poses = np.zeros((3, 2, 7))
    poses[..., 3], poses[:, :, 2] = 1.0, np.array([[0.03, 0.031], [0.0405, 0.04], [0.06, 0.06]])
    windows = trace_finger(Fingertip(), poses).windows
    alone = [compute_reach(window, 0.04) for window in windows]
    together = np.array(compute_reach(np.array(windows).T, np.full(3, 0.04))).T
    np.testing.assert_allclose(together[:2], alone[:2], rtol=1e-12)
    assert alone[2] is None  # the last one is far above the bed
    assert together[2, 2] < 0.0


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


def test_points_of_one_structure_run_together() -> None:
    parts = make_bundles(some("control.force_gain=1,2,3,4", "layout.rows=11,13"))
    assert indices(parts.batches) == [[0, 2, 4, 6], [1, 3, 5, 7]]
    assert parts.describe() == ["8 points run in 2 stacks"]


@pytest.mark.parametrize(
    ("count", "duration", "sizes"),
    [
        (2 * RUNS - 1, "0.1", [2 * RUNS - 1]),
        (2 * RUNS + 1, "0.1", [RUNS, RUNS + 1]),
        (20, "1e4", [10, 10]),  # 2 million rows of 41 bytes are 82 MB, and a stack may hold 1 GiB
        (5, "1e5", []),
    ],
)
def test_a_stack_has_no_more_runs_than_pay_or_fit_into_memory(
    count: int, duration: str, sizes: list[int]
) -> None:
    settings = [Setting("simulation.duration", duration)]
    parts = make_bundles(some(f"control.force_gain=1:6:{count}", settings=settings))
    assert [len(batch) for batch in parts.batches] == sizes
    reason = f"{count} points one at a time: they have too many rows to keep for many at once"
    assert (parts.describe() == [reason]) == (not sizes)


def test_points_whose_half_steps_are_cut_elsewhere_are_judged_in_stacks_of_their_own() -> None:
    # A dead time of half a control period falls on the end of a half step.
    varied = ("delay.dead_time=1 ms,2.5 ms", "control.force_gain=1:4:4")
    assert indices(make_bundles(some(*varied)).batches) == [[0, 1, 2, 3, 4, 5, 6, 7]]
    assert indices(make_bundles(some(*varied), errors=True).batches) == [[0, 1, 2, 3], [4, 5, 6, 7]]


def test_points_whose_steps_cannot_be_halved_are_told_when_they_run() -> None:
    finest = [*SHORT, Setting("simulation.physics_step", "5e-6")]
    parts = make_bundles(some("control.force_gain=1:4:4", settings=finest), errors=True)
    assert (parts.batches, indices(parts.alone)) == ((), [[0], [1], [2], [3]])


def test_points_without_their_like_run_alone_and_it_is_said() -> None:
    parts = make_bundles(some("layout.rows=11,13,15"))
    assert (parts.batches, indices(parts.alone)) == ((), [[0], [1], [2]])
    assert parts.describe() == ["3 points one at a time: fewer than 4 have the same bed, parts and steps"]


def test_every_method_stands_in_stacks_with_noise_and_without() -> None:
    noise = ("sensors.force_noise=1e-3,2e-3,3e-3", "sensors.seed=1,2")
    parts = make_bundles(some("control.method=viscous,push_pull,cell_states,virtual_master", *noise))
    assert indices(parts.batches) == [list(range(first, first + 6)) for first in (0, 6, 12, 18)]
    assert parts.describe() == ["24 points run in 4 stacks"]
    quiet = make_bundles(some("control.method=virtual_master", "sensors.force_noise=0,1e-3", noise[1]))
    assert quiet.batches == ()  # with noise and without it are two structures, of two runs each


def test_values_that_do_not_go_together_are_in_no_stack() -> None:
    triggers = ("control.blister_trigger=0.01,0.03", "control.spring_trigger=0.02,0.06,0.08")
    method = [*SHORT, Setting("control.method", "cell_states")]
    parts = make_bundles(some(*triggers, settings=method))
    assert (indices(parts.batches), indices(parts.alone)) == ([[0, 1, 2, 4, 5]], [[3]])


@pytest.mark.parametrize("errors", [False, True])
def test_a_bundle_comes_to_the_figures_of_its_points(errors: bool) -> None:
    bundle = some("control.force_gain=1,5")
    assert evaluate_bundle(bundle, lambda: True) == [None, None]
    for record, point in zip(evaluate_bundle(bundle, errors=errors), bundle, strict=True):
        assert point.scene
        alone = evaluate(point.scene, errors=errors)
        assert record is not None
        assert alone is not None
        own, other = (
            {name: value for name, value in one["figures"].items() if name not in TIMES and value is not None}
            for one in (record, alone)
        )
        assert own == pytest.approx(other, rel=1e-9, abs=1e-15)


def break_stacks(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    """Let stacks fail as a whole."""

    def faulty(*given: Any, **known: Any) -> Any:
        raise error

    monkeypatch.setattr("digiclay.core.studies.evaluation.measure_together", faulty)


def test_a_fault_in_a_stack_is_not_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    # Warnings are errors in tests: a stack that fails by our own fault fails the test it runs in.
    break_stacks(monkeypatch, ZeroDivisionError("by\nzero"))
    with pytest.warns(BatchWarning, match="A batch of 2 runs failed: ZeroDivisionError: by zero"):
        records = evaluate_bundle(some("control.force_gain=1,5"))
    assert [record and record["alone"] for record in records] == ["ZeroDivisionError: by zero"] * 2


def test_a_sweep_says_which_points_ran_alone_because_their_stack_failed(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    break_stacks(monkeypatch, MemoryError())
    varied = ["--vary", "control.force_gain=1:5:4", "--set", "simulation.duration=0.1", "--workers", "1"]
    assert main(["sweep", "tap", *varied, "--out", "out"]) == 0
    assert "\n4 points one at a time: there is not enough memory for a stack\n" in capsys.readouterr().out
    table = (here / "out" / "sweep.csv").read_text(encoding="utf-8").splitlines()
    assert [line.endswith(",") for line in table[1:]] == [True] * 4  # no point has an error


def test_a_sweep_says_how_its_points_were_run_and_one_done_again_comes_to_the_same_bits(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = ["sweep", "tap", "--vary", "control.force_gain=1:6:5", "--set", "simulation.duration=0.2"]
    main([*sweep, "--out", "out"])
    assert "5 points\n5 points run in 1 stack\n" in capsys.readouterr().out
    file, figures = here / "out" / "points" / "000003.json", []
    for _ in range(2):
        kept = json.loads(file.read_text(encoding="utf-8"))["figures"]
        figures.append({name: value for name, value in kept.items() if name not in TIMES})
        file.unlink()
        main([*sweep, "--out", "out", "--quiet"])
    assert figures[0] == figures[1]
