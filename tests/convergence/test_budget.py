"""What a scene does without within a budget: the budget holds against the full model, and is used."""

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.base.errors import ParameterError
from digiclay.core.scene.assembly import assemble
from digiclay.core.studies.omissions import find_omissions, propose_omissions

from tests.assemble import record, sample

#: A sample of each method, arrangement and use of a shape.
NAMES = (
    "tap",
    "dome_peaked",
    "crater_breached",
    "plastic_press",
    "elastic_press",
    "viscous_press",
    "force_display",
    "shape_display",
    "push_pull",
    "staggered_bed",
)
#: What is checked of each session, s: the first touches, and what follows from them.
CUT = 0.7
BUDGET = 20e-6


def cut(name):
    scene = sample(name)
    lasts = min(CUT, scene.simulation.duration)
    return replace(scene, simulation=replace(scene.simulation, duration=lasts))


def heights(scene):
    return record(assemble(scene), scene.section("trajectory").trajectory(), scene.periods).height


@cache
def found(name, budget):
    return find_omissions(cut(name), budget)


@pytest.mark.parametrize("name", NAMES)
def test_no_height_is_further_from_the_full_model_than_the_budget(name):
    one = found(name, BUDGET)
    off = np.abs(heights(one.scene) - heights(cut(name))).max()
    assert off == one.departure  # the very same runs
    assert off + one.own_error <= BUDGET


def test_the_error_told_is_the_one_against_a_tenfold_finer_integration_within_its_estimate():
    # A press that no switch cuts short: here a finer step changes no mode, so the two can be
    # compared.
    one = found("elastic_press", 50e-6)
    full = cut("elastic_press")
    fine = replace(full.simulation, physics_step=full.simulation.physics_step / 10)
    off = np.abs(heights(one.scene) - heights(replace(full, simulation=fine))).max()
    assert off <= one.departure + 2.0 * one.own_error + 1e-6  # the full scene's own error at 1 ms


def test_a_larger_budget_leaves_less_to_do_and_what_is_left_out_is_left_out_of_the_scene():
    assert found("tap", BUDGET).work <= found("tap", 5e-6).work < 1.0
    one = find_omissions(cut("tap"), 500e-6)
    full = {omission.text: omission.leave_out for omission in propose_omissions(cut("tap"), 500e-6)}
    rebuilt = cut("tap")
    for said in one.left_out:
        rebuilt = full[said](rebuilt)
    assert one.left_out
    assert one.scene == rebuilt


def test_a_trial_beyond_the_budget_is_broken_off_and_one_below_the_own_error_refused():
    relaxation = next(tried for tried in found("tap", 5e-6).tried if "relax" in tried.text)
    assert (relaxation.departure, relaxation.kept) == (math.inf, False)
    with pytest.raises(ParameterError, match=r"own integration.*richardson"):
        find_omissions(cut("tap"), 1e-10)


@pytest.mark.parametrize("budget", [0.0, -1e-6, math.nan, math.inf])
def test_a_budget_that_is_no_length_is_refused(budget):
    with pytest.raises(ParameterError, match=r"run.budget must be above 0 m"):
        find_omissions(cut("tap"), budget)


def test_run_with_a_budget_tells_what_it_left_out_and_writes_it(tmp_path, capsys):
    out = tmp_path / "run"
    assert main(["run", "tap", "--budget", "20um", "--out", str(out), "--no-errors"]) == 0
    text = capsys.readouterr().out
    noted = json.loads((out / "metrics.json").read_text())["budget"]
    assert noted["allowed"] == pytest.approx(20e-6, rel=1e-15)  # read from "20um": rounding
    assert noted["measured"] <= 20e-6
    assert noted["left_out"]
    assert all(said in text for said in noted["left_out"])
