"""Figures of real displays: simulated again, they are those of the page's file."""

import csv
from pathlib import Path

import pytest

from benchmarks.__main__ import main

STORED = Path(__file__).parents[2] / "benchmarks" / "results" / "zoo.csv"


def read(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_all_figures_of_displays_are_those_of_the_page_and_one_is_outside(tmp_path):
    assert main(["zoo", "--quiet", "--out", str(tmp_path)]) == 0
    rows, stored = read(tmp_path / "zoo.csv"), read(STORED)
    for row, old in zip(rows, stored, strict=True):
        # Times are counted in periods of 5 ms.
        simulated = (
            float(row.pop("simulated")),
            pytest.approx(float(old.pop("simulated")), rel=0.02),
        )
        assert (row, simulated[0]) == (old, simulated[1])
    assert [row["figure"] for row in rows if row["verdict"] == "no"] == [
        "a dome of 40 mm, one line at a time"
    ]
