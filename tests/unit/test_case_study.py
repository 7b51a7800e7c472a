"""digiclay study of cases: what its values are, the least candidate, continuation, mistakes; on 35 pins."""

import math
from pathlib import Path

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.stop import STOPPED
from digiclay.core.session.run_scene import run, select_rows

from digiclay_study.case_command import Candidate, find_least
from digiclay_study.case_study import Stroke, compare_relief, divide, read_study
from tests.scene_files import SMALL_BLISTER, interrupt_after, read_text, rows, write_text

BED = f"[layout]\nrows = 5\ncolumns = 7\n{SMALL_BLISTER}"
STUDY = """
scene = "bed.toml"
minimize = "valve.stroke"

[settings]
stroke = { length = "9 mm", press = "3 mm", height = "1 mm", approach = "20 mm/s", speed = "20 mm/s" }

[vary]
valve.stroke = ["15 um", "45 um"]

[cases]
along = {}
across = { stroke.direction = 90, stroke.length = "6 mm" }

[reference]
valve.stroke = "45 um"

[limits]
relief_deviation = 0.05

[ratios]
rfd = 1.5
"""
COMMAND = ["study", "study.toml", "--workers", "1", "--out", "out", "--quiet"]

pytestmark = pytest.mark.usefixtures("here")


def place(text=STUDY):
    write_text(Path("bed.toml"), BED)
    write_text(Path("study.toml"), text)
    return Path("study.toml")


def square(history, start, end):
    """Return the sum of squared deviations from the set point, with half the weight at both ends."""
    part = select_rows(history, start, end)["total_force"] - 0.4
    return np.sum(part**2) - 0.5 * (part[0] ** 2 + part[-1] ** 2)


@pytest.mark.parametrize(
    "direction, offset, first, last",
    [
        (0.0, (0.0, 0.0), (-0.021, 0.0), (0.021, 0.0)),
        (90.0, (0.0, 0.0015), (0.0, -0.0195), (0.0, 0.0225)),
        (30.0, (0.001, 0.0), (0.001 - 0.021 * 3**0.5 / 2, -0.0105), (0.001 + 0.021 * 3**0.5 / 2, 0.0105)),
    ],
)  # fmt: skip
def test_a_stroke_is_a_straight_drag_in_its_direction_through_its_offset(
    direction, offset, first, last
):
    path, start, end = Stroke(direction=direction, offset=offset).path(0.01, 0.04)
    x, y, z = path.trajectory().poses(np.linspace(start, end, 5))[:, :3].T
    np.testing.assert_allclose(x, np.linspace(first[0], last[0], 5), atol=1e-12)
    np.testing.assert_allclose(y, np.linspace(first[1], last[1], 5), atol=1e-12)
    np.testing.assert_allclose(z, 0.04 + 0.0135, rtol=1e-12)


def test_the_values_of_a_study_are_those_of_its_runs_and_a_finished_folder_has_other_limits_at_once():
    study = read_study(place())
    assert main(COMMAND) == 0
    found = rows(Path("out/runs.csv"))
    assert (len(found), len(list(Path("out/points").iterdir()))) == (4, 4 + 2)
    across = study.references[1]
    history = {across.number: run(across.scene).history}
    for row, trial in zip(found[1::2], study.trials[1::2], strict=True):
        history[trial.case.number] = run(trial.case.scene).history
        ended, reference = history[trial.case.number], history[trial.reference]
        left, wanted = (each["height"][-1] - 0.04 for each in (ended, reference))
        # Heights of the reference are kept to a nanometer.
        off = np.linalg.norm(left - wanted) / np.linalg.norm(wanted)
        assert float(row["relief_deviation"]) == pytest.approx(off, rel=1e-4, abs=1e-6)
        squares = (square(each, *trial.case.phase) for each in (ended, reference))
        ratio = math.sqrt(next(squares) / next(squares))
        assert float(row["rfd ratio"]) == pytest.approx(ratio, rel=1e-9)
    before = {path: path.stat().st_mtime_ns for path in Path("out/points").iterdir()}
    place(STUDY.replace("rfd = 1.5", "rfd = 1e9").replace("= 0.05", "= 1e9"))
    assert main(COMMAND) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert "valve.stroke 0.015 mm" in read_text(Path("out/study.md"))


def test_a_study_that_was_stopped_at_a_reference_and_at_a_candidate_goes_on_to_the_same_tables(
    monkeypatch,
):
    place()
    for count, more in ((1, 1), (3, 2)):
        with monkeypatch.context() as patched:
            interrupt_after(more, patched)
            assert main(COMMAND) == STOPPED
        assert len(list(Path("out/points").iterdir())) == count
    assert main(COMMAND) == 0
    assert main([*COMMAND[:-2], "again", "--quiet"]) == 0
    for name in ("runs.csv", "candidates.csv"):
        assert read_text(Path("out") / name) == read_text(Path("again") / name)


@pytest.mark.parametrize(
    "amounts, excesses, least",
    [
        ((1.0, 2.0, 3.0), (2.0, 0.9, 0.5), 1),  # the least that meets, not the best
        ((1.0, 2.0, 3.0), (0.9, 1.5, 0.5), 0),  # although a larger one fails
        ((3.0, 2.0, 2.0), (0.1, 0.9, 0.8), 2),  # of equal ones the better
        ((1.0, 2.0), (7.0, 4.0), 1),  # none meets: the nearest
        ((1.0, 2.0), (math.inf, 1.0), 1),  # a limit itself is met
    ],
)
def test_the_least_candidate_is_that_with_the_smallest_amount_within_all_limits(
    amounts, excesses, least
):
    candidates = [
        Candidate((), (), amount, np.zeros(1), (), excess)
        for amount, excess in zip(amounts, excesses, strict=True)
    ]
    assert find_least(candidates) is candidates[least]


def test_what_has_no_value_exceeds_every_limit_and_a_flat_reference_has_no_deviation():
    assert [divide(None, 1.0), divide(1.0, None), divide(1.0, 0.0), divide(0.0, 0.0)] == [
        math.inf, math.inf, math.inf, 0.0
    ]  # fmt: skip
    assert compare_relief(np.ones(3), np.zeros(3))["relief_deviation"] is None
    found = compare_relief(np.array([3.0, 4.0, 1.0]), np.array([3.0, 4.0, 0.0]))
    assert found == {"relief_deviation": pytest.approx(0.2), "relief_deviation_largest": 1.0}


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('scene = "bed.toml"', "", "study.toml: scene must be a text (got none)."),
        ('"bed.toml"', '"bad.toml"', "bad.toml: there is no such file."),
        ("minimize", "minimise", "study.toml: minimise must be a known key"),
        ('"valve.stroke"', '"valve.law"', "study.toml: minimize must be valves or a parameter"),
        ("[cases]", "[case]", "A study needs at least two --vary, or a STUDY file with [cases]."),
        ("along = {}", "[ratio]", "study.toml: ratio must be a known key"),
        ("along = {}", "along = 3", "study.toml: along must be a table such as"),
        ('["15 um", "45 um"]', '"15 um"', "study.toml: vary.valve.stroke must be a list"),
        ('"15 um", "45 um"', '"15 um", "15 um"', "study.toml: vary.valve.stroke must be a list"),
        ('"15 um", "45 um"', '"0 um"', "valve.stroke must be above 0"),
        ("valve.stroke = [", "valve.stoke = [", "valve.stoke must be a known key"),
        ("direction = 90", "direction = nan", "study.toml: stroke.direction must be"),
        ("direction = 90", "directions = 90", "study.toml: stroke.directions must be a known key"),
        ('length = "6 mm"', 'length = "17 mm"', "study.toml: stroke must keep the drag on the bed"),
        ('speed = "20 mm/s"', "speed = 0", "study.toml: stroke.speed must be above 0 m/s"),
        ("relief_deviation", "relief_deviatoin", "study.toml: limits.relief_deviatoin must be a"),
        ("rfd = 1.5", "rfd = -1", "study.toml: ratios.rfd must be a number, 0 or above (got -1)."),
        ("rfd = 1.5", 'rfd = "1"', "study.toml: ratios.rfd must be a number, 0 or above"),
        ("[limits]\nrelief_deviation = 0.05\n\n[ratios]\nrfd = 1.5", "", "limits must not be empty"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_in_one_line(old, new, message, refused):
    assert old in STUDY
    place(STUDY.replace(old, new, 1))
    refused(COMMAND, message)


@pytest.mark.parametrize(
    "words, message",
    [
        ("study bed.toml --out out", "A study needs at least two --vary, or a STUDY file"),
        ("study slow_press --out out", "A study needs at least two --vary, or a STUDY file"),
        ("study study.toml --second --out out", "--second and --uncertain are for a study with"),
        ("study study.toml --metric lag --out out", "--metric, --second and --uncertain are for"),
        ("study study.toml --set valve.stroke=1e-5 --out out", "must not be given to --set as"),
        ("study study.toml --set stroke.speed=0 --out out", "stroke.speed must be above 0 m/s"),
    ],
)
def test_options_that_do_not_fit_are_refused(words, message, refused):
    place()
    refused(words, message)
