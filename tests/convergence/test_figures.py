"""Figures of the pages are what the commands give now, or stored; one that is stale is told."""

import re
from fnmatch import fnmatch

import pytest
from digiclay.core.base.errors import OutputError

from benchmarks import figures
from benchmarks.__main__ import main

FIGURES = [figure for figure in figures.read_figures() if not figure["slow"]]
RUNS = [figure for figure in FIGURES if not figure["stored"]]
STORED = sorted({(figure["page"], figure["stored"]) for figure in FIGURES if figure["stored"]})
PAPER = (figures.ROOT / "docs/paper.md").read_text(encoding="utf-8")
STABILITY = (figures.ROOT / "docs/stability.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("figure", RUNS, ids=lambda figure: f"{figure['page']} {figure['of']}")
def test_a_figure_of_a_page_is_what_the_command_gives(figure):
    judged = figures.judge(figure)
    assert judged["stale"] == "", judged


@pytest.mark.parametrize("page, stored", STORED)
def test_a_figure_of_a_page_is_that_of_its_stored_result(page, stored):
    judged = [
        figures.judge(one) for one in FIGURES if (one["page"], one["stored"]) == (page, stored)
    ]
    assert [one for one in judged if one["stale"]] == []
    assert len(FIGURES) > 300


def test_each_page_with_a_table_of_figures_has_rows_or_says_why_not():
    told = (
        {row["page"] for row in figures.read_plan()["figure"]},
        set(figures.read_plan()["without"]),
    )
    assert told[0] & told[1] == set()
    pages = [figures.ROOT / "README.md", *sorted((figures.ROOT / "docs").glob("*.md"))]
    counts = {
        str(page.relative_to(figures.ROOT)): page.read_text(encoding="utf-8") for page in pages
    }
    measured = {
        page
        for page, text in counts.items()
        if len(figures.list_measured_rows(text)) > 2 or "| commit |" in text
    }
    assert measured - (told[0] | told[1]) == set()


def test_each_stored_result_has_a_row_with_its_command_date_and_commit():
    page = (figures.ROOT / "benchmarks/README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\|.*\| 20\d\d-\d\d-\d\d \| [0-9a-f]{7} \|$", page, re.MULTILINE)
    patterns = re.findall(r"`([\w.*]+)`", "".join(rows))
    files = [path.name for path in figures.RESULTS.iterdir()]
    assert len(files) > 20
    assert [name for name in files if not any(fnmatch(name, pattern) for pattern in patterns)] == []


@pytest.mark.parametrize(
    "name, page, code, said",
    [
        ("docs/paper.md", PAPER, 0, "0 of 4 figures are stale."),
        ("docs/paper.md", PAPER.replace("0.068 N", "0.078 N"), 1, "1 of 4 figures are stale."),
        ("docs/paper.md", "", 2, "docs/paper.md has no number 1 behind"),
        ("docs/stability.md", STABILITY, 0, "\n0 of "),
        ("docs/stability.md", STABILITY.replace("| 7.64 |", "| 7.63 |"), 1, "\n1 of "),
        (
            "docs/stability.md",
            f"{STABILITY}\n| a new row | 7.6 |",
            0,
            "rows not compared: case; a new row\n",
        ),
        (
            "docs/stability.md",
            STABILITY.replace("| c0 = 0 |", "| c0 = 1 |"),
            2,
            "behind '| c0 = 0 |'",
        ),
        ("docs/stability.md", "", 2, "docs/stability.md has no number 1 behind"),
    ],
)
def test_a_stale_page_is_told_and_one_that_has_lost_its_figure_refused(
    name, page, code, said, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    (tmp_path / name).write_text(page, encoding="utf-8")
    assert main(["figures", name, "--quiet", "--quick"]) == code
    told = capsys.readouterr()
    assert said in told.out + told.err


def test_a_figure_of_no_row_of_its_stored_result_or_of_several_is_refused():
    one = next(figure for figure in FIGURES if figure["stored"] == "stiff.csv")
    for where in ({"case": "none"}, {"stepper": "bernoulli"}):
        with pytest.raises(OutputError, match=r"stiff\.csv must have one row"):
            figures.judge({**one, "where": where})
