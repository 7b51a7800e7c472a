"""digiclay study of cases: what its values are, the least candidate, continuation, mistakes; on 35 pins."""

import math
from pathlib import Path

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.stop import STOPPED
from digiclay.core.scene.scene_source import load
from digiclay.core.session.run_scene import run, select_rows
from digiclay.core.studies.speed_limits import Stroke, make_trial

from digiclay_study.case_study import (
    Candidate,
    answer,
    compare_relief,
    find_candidates,
    find_least,
    read_study,
)
from tests.assemble import assert_near, table
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
rfd_ratio = 1.5
relief_deviation = 0.05
"""
ACROSS = Stroke(direction=90.0, length=6e-3, press=3e-3, height=1e-3, approach=20e-3, speed=20e-3)
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


@table(
    "direction, height, x, y",
    {
        "along a row, on a ridge": (0.0, 13.5e-3, (-0.021, 0.021), (0.0, 0.0)),
        "along a column, as deep as pressed": (90.0, -4.5e-3, (0.0, 0.0), (-0.0195, 0.0225)),
        "aslant": (30.0, 0.0, 0.001 + 0.021 * 3**0.5 / 2 * np.array([-1, 1]), (-0.0105, 0.0105)),
    },
)
def test_a_stroke_is_a_straight_level_drag_in_its_direction_through_its_middle_at_its_speed(
    direction, height, x, y
):
    stroke = Stroke(direction=direction, height=height, x=np.mean(x), y=np.mean(y))
    path, start, end = stroke.path(0.01, 0.04)
    assert end - start == pytest.approx(0.042 / 0.01)
    places = path.trajectory().poses(np.linspace(start, end, 5))[:, :3]
    ends = np.column_stack([x, y, [0.04 + height] * 2])
    assert_near(places, np.linspace(*ends, 5), 1e-12)


def test_the_values_of_a_study_are_those_of_its_runs_and_a_finished_folder_has_other_limits_at_once():
    study = read_study(place())
    assert main(COMMAND) == 0
    found = rows(Path("out/runs.csv"))
    across = make_trial(load(Path("bed.toml")), ACROSS, ACROSS.speed)
    assert len(found) == 4
    wide = run(study.points[3].scene).history  # that of the reference
    assert [float(row["rfd_ratio"]) for row in found[2:]] == [1.0, 1.0]
    assert [float(row["relief_deviation"]) for row in found[2:]] == [0.0, 0.0]
    narrow = run(study.points[1].scene).history
    left, wanted = (each["height"][-1] - 0.04 for each in (narrow, wide))
    off = np.linalg.norm(left - wanted) / np.linalg.norm(wanted)
    assert float(found[1]["relief_deviation"]) == pytest.approx(off, rel=1e-9)
    ratio = math.sqrt(square(narrow, *across[1:]) / square(wide, *across[1:]))
    assert float(found[1]["rfd_ratio"]) == pytest.approx(ratio, rel=1e-9)
    for name in ("rfd_ratio", "relief_deviation"):
        cases = [float(row[name]) for row in found]
        worst = [float(row[name]) for row in rows(Path("out/worst.csv"))]
        assert worst == [max(cases[:2]), max(cases[2:])]
    before = {path: path.stat().st_mtime_ns for path in Path("out/points").iterdir()}
    place(STUDY.replace("= 1.5", "= 1e9").replace("= 0.05", "= 1e9"))
    assert main(COMMAND) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert "valve.stroke 1.5e-05 (15 um)" in read_text(Path("out/study.md"))


def test_a_study_that_was_stopped_goes_on_to_the_same_table_and_another_reference_is_refused(
    monkeypatch, refused
):
    place()
    with monkeypatch.context() as patched:
        interrupt_after(1, patched)
        assert main(COMMAND) == STOPPED
    assert len(list(Path("out/points").iterdir())) == 1
    assert main(COMMAND) == 0
    assert main([*COMMAND[:-2], "again", "--quiet"]) == 0
    assert read_text(Path("out/runs.csv")) == read_text(Path("again/runs.csv"))
    place(
        STUDY.replace('[reference]\nvalve.stroke = "45 um"', '[reference]\nvalve.stroke = "30 um"')
    )
    refused(COMMAND, "out holds another study")


@pytest.mark.parametrize(
    "amounts, excesses, least",
    [
        ((1.0, 2.0, 3.0), (2.0, 0.9, 0.5), 1),  # the least that meets, not the best
        ((1.0, 2.0, 3.0), (0.9, 1.5, 0.5), 0),  # although a larger one fails
        ((3.0, 2.0, 2.0), (0.1, 0.9, 0.8), 2),  # of equal ones the better
        ((1.0, 2.0), (7.0, 4.0), 1),  # none meets: the nearest
        ((1.0, 2.0), (1.0, 0.5), 0),  # a limit itself is met
    ],
)
def test_the_least_candidate_is_that_with_the_smallest_amount_within_all_limits(
    amounts, excesses, least
):
    candidates = [
        Candidate(amount, excess, (), ()) for amount, excess in zip(amounts, excesses, strict=True)
    ]
    assert find_least(candidates) is candidates[least]


def test_a_candidate_of_a_variant_has_the_worst_figures_of_its_cases():
    variants = "[compare]\nsoft = { contact.stiffness = 300 }\nhard = { contact.stiffness = 500 }\n"
    study = read_study(place(STUDY.replace("[vary]", f"{variants}[vary]")))
    figures = np.array([[1.2, 0.01], [1.0, 0.02], [np.inf, 0.0], [3.0, 0.0], *[[0.3, 0.05]] * 4])
    found = find_candidates(study, figures)
    assert [[each.figures for each in group] for group in found.values()] == [
        [[1.2, 0.02], [np.inf, 0.0]],
        [[0.3, 0.05]] * 2,
    ]
    assert [each.excess for each in (*found["soft"], *found["hard"])] == [
        pytest.approx(0.8),
        np.inf,
        1.0,
        1.0,
    ]
    # A method without a set point, say, has no force deviation.
    assert "nearest: valve.stroke 4.5e-05 (45 um), rfd_ratio absent (" in answer(
        study, found["soft"][1:]
    )
    assert [(each.amount, *each.words) for each in found["hard"]] == [
        (pytest.approx(15e-6), "15 um"),
        (pytest.approx(45e-6), "45 um"),
    ]
    assert [point.scene.fingers[0].contact.stiffness for point in study.points[::4]] == [
        300.0,
        500.0,
    ]


def test_a_deviation_is_relative_to_the_relief_of_the_reference_and_a_flat_one_has_none():
    found = compare_relief(np.array([3.0, 4.0, 1.0]), np.array([3.0, 4.0, 0.0]))
    assert found == {"relief_deviation": pytest.approx(0.2), "relief_deviation_largest": 1.0}
    assert compare_relief(np.ones(3), np.zeros(3))["relief_deviation"] is None


@pytest.mark.parametrize(
    "old, new, message",
    [
        ('scene = "bed.toml"', "", "study.toml: scene must be a text (got none)."),
        ('"bed.toml"', '"bad.toml"', "bad.toml: there is no such file."),
        ("minimize", "minimze", "study.toml: minimze must be a known key"),
        ('"valve.stroke"', '"valve.law"', "study.toml: minimize must be valves or a parameter"),
        ("[cases]", "[case]", "study.toml has no [cases]"),
        ("along = {}", "[ratio]", "study.toml: ratio must be a known key"),
        ("[cases]", "[compare]\nall = 3\n[cases]", "study.toml: compare.all must be a table such as"),
        ("[cases]", "[compare.all]\nvalve.stroke = 1e-5\n[cases]", "valve.stroke must be given once"),
        ("along = {}", "along = 3", "study.toml: cases.along must be a table such as"),
        ('["15 um", "45 um"]', '"15 um"', "study.toml: valve.stroke must be varied over a list"),
        ('"15 um", "45 um"', '"15 um", "15 um"', "valve.stroke must not have a value twice"),
        ('"15 um", "45 um"', '"0 um"', "valve.stroke must be above 0"),
        ("valve.stroke = [", "valve.stoke = [", "valve.stoke must be a known key"),
        ("direction = 90", "direction = nan", "study.toml: stroke.direction must be"),
        ("direction = 90", "directions = 90", "study.toml: stroke.directions must be a known key"),
        ('length = "6 mm"', 'length = "17 mm"', "layout.rows must make the bed at least as wide as"),
        ('speed = "20 mm/s"', "speed = 0", "study.toml: stroke.speed must be above 0 m/s"),
        ("relief_deviation", "relief_deviatoin", "study.toml: limits.relief_deviatoin must be a"),
        ("= 1.5", "= 0", "limits.rfd_ratio must be a finite number above 0 (got 0)."),
        ('valve.stroke = "45 um"\n\n[l', "[l", "reference must have settings: limits.rfd_ratio compares"),
        ("= 1.5", "= inf", "limits.rfd_ratio must be a finite number above 0 (got inf)."),
        ("= 1.5", '= "1"', "study.toml: limits.rfd_ratio must be a number (got '1')."),
        ("rfd_ratio = 1.5\nrelief_deviation = 0.05", "", "limits must have a metric (got nothing)."),
        ('["15 um", "45 um"]', "[]", "valve.stroke must be varied over at least one value"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_in_one_line(old, new, message, refused):
    assert old in STUDY
    place(STUDY.replace(old, new, 1))
    refused(COMMAND, message)


@pytest.mark.parametrize(
    "words, message",
    [
        (
            "study bed.toml --out out",
            "bed.toml has no [cases]: a study needs them, or at least two --vary",
        ),
        ("study slow_press --out out", "slow_press.toml has no [cases]"),
        ("study study.toml --second --out out", "--second and --uncertain are for a study with"),
        ("study study.toml --metric lag --out out", "--metric, --second and --uncertain are for"),
        ("study study.toml --set valve.stroke=1e-5 --out out", "must not be given to --set as"),
        ("study study.toml --set stroke.speed=0 --out out", "stroke.speed must be above 0 m/s"),
    ],
)
def test_options_that_do_not_fit_are_refused(words, message, refused):
    place()
    refused(words, message)
