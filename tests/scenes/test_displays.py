"""Displays that were built: their figures, small ones; how far apart pins can be that a finger forms."""

import tomllib
from pathlib import Path

import digiclay
import pytest
from digiclay.core.scene.scene_source import DISPLAY_SAMPLES, find, load
from digiclay.core.session.plate import list_cautions

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


#: A finger starts a blister, lifts it by 7 mm and draws a ridge at 10 mm/s.
RIDGE = [
    (0.0, -0.02, 0.044), (0.3, -0.02, 0.041), (1.2, -0.02, 0.036), (1.4, -0.02, 0.036), (1.8, -0.02, 0.037),
    (3.8, -0.02, 0.047), (4.1, -0.02, 0.047), (8.1, 0.02, 0.047), (8.4, 0.02, 0.047),
]  # fmt: skip


@pytest.mark.parametrize(
    "pitch, count, rfd",
    [(3e-3, 31, 0.023), (5.08e-3, 19, 0.046), (7e-3, 13, 0.223), (12.7e-3, 7, 0.275)],
)
def test_a_ridge_is_drawn_on_beds_that_do_not_say_they_cannot_be_sculpted(pitch, count, rfd):
    points = [{"time": time, "position": [x, 0.0, z]} for time, x, z in RIDGE]
    changes = {
        "layout": {"rows": count, "columns": count, "pitch": pitch},
        "control": {"method": "hybrid"},
        "trajectory": {"waypoints": points},
    }
    done = digiclay.run(digiclay.scene(changes))
    # Figures of docs/displays.md; the last bit moves the second in the last two.
    assert done.metrics["rfd"] == pytest.approx(rfd, rel=0.1)
    said = any("cannot be sculpted" in line for line in list_cautions(done.scene))
    # The set point is 400 mN.
    assert said == (rfd > 0.1) == (pitch > 6e-3)
    assert (done.metrics["losses"] > 0) == (pitch > 10e-3)


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
