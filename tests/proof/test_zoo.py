"""Figures of real displays: simulated again, they are those of the page's file."""

from pathlib import Path

import pytest

from benchmarks.__main__ import main
from tests.scene_files import command, rows

STORED = Path(__file__).parents[2] / "benchmarks" / "results" / "zoo.csv"


def test_all_figures_of_displays_are_those_of_the_page_and_one_is_outside(tmp_path):
    assert main(command(f"zoo --quiet --out {tmp_path}")) == 0
    simulated = rows(tmp_path / "zoo.csv")
    for row, old in zip(simulated, rows(STORED), strict=True):
        # Times are counted in periods of 5 ms.
        figure = pytest.approx(float(old.pop("simulated")), rel=0.02)
        assert (float(row.pop("simulated")), row) == (figure, old)
    assert [row["figure"] for row in simulated if row["verdict"] == "no"] == [
        "a dome of 40 mm, one line at a time"
    ]
