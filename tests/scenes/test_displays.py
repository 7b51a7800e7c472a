"""Displays that were built: their figures; beds too small for a blister, or too coarse to be sculpted."""

import tomllib
from pathlib import Path

import pytest
from digiclay.core.scene.scene_source import DISPLAY_SAMPLES, find, load

from benchmarks import zoo
from tests.scene_files import call

FIGURES = tomllib.loads(Path(zoo.__file__).with_suffix(".toml").read_text(encoding="utf-8"))[
    "figure"
]
SMALL = [row for row in FIGURES if row["scene"] not in ("tomlinson_1965", "matrix_80x80")]


@pytest.mark.parametrize("row", SMALL, ids=lambda row: f"{row['scene']} {row['figure']}")
def test_a_published_figure_is_met_within_20_percent(row):
    assert zoo.judge(row)["verdict"] == "yes"


def test_figures_are_of_samples_and_each_sample_has_one():
    assert {row["scene"] for row in FIGURES} == {
        path.stem for path in DISPLAY_SAMPLES.glob("*.toml")
    }
    assert {row["measure"] for row in FIGURES} == zoo.MEASURES.keys()


def test_a_bed_smaller_than_a_blister_shows_shapes_and_says_what_to_do_with_another_method(
    here, capsys
):
    assert load(find("zhu_5x5")).blister is None
    assert call("describe tap --set layout.rows=5 --set layout.columns=5") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "blister.radius must be at most half the bed's longer side" in line
    assert "shape_display" in line
    assert len(line) <= 400


def test_run_and_describe_warn_of_a_bed_that_cannot_be_sculpted(here, capsys):
    assert call("run shapeshift --no-errors --quiet --out shown") == 0
    call("describe shapeshift")
    assert "cannot be sculpted" in " ".join(capsys.readouterr().out.split())
    assert call("run shapeshift --no-errors --out again") == 0
    assert "cannot be sculpted" in " ".join(capsys.readouterr().out.split())


def test_a_display_that_its_drive_hinders_tells_by_how_much_in_plain_numbers(here, capsys):
    assert call("form heart --scene shapeshift --finger press --out formed") == 0
    shown, formed = capsys.readouterr().out.splitlines()[1:3]
    # The dead zone of its servos is 1 mm.
    assert 900.0 < float(shown.split()[3]) <= 1000.0
    assert formed.endswith(", 0 cm³ lowered by up to 0 mm")
