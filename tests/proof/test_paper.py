"""`digiclay paper --quick`: every file its page names is there, and no claim is left open."""

import csv
import re

import numpy as np
import pytest

from digiclay_paper.claims import TEXTS
from digiclay_paper.results import DRAGS
from digiclay_paper.scenes import COMPARED
from tests.scene_files import call, read_json, read_text


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("paper") / "quick"
    assert call(f"paper --quick --quiet --out {out}") == 0
    return out


@pytest.fixture(scope="module")
def text(folder):
    return read_text(folder / "paper.md")


@pytest.fixture(scope="module")
def numbers(folder):
    return read_json(folder / "metrics.json")


def claims(text):
    table = text.split("## Claims")[1].split("## Figures")[0]
    rows = [line for line in table.splitlines() if line.startswith("| ")][2:]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]


def test_every_file_the_page_names_is_there_and_nothing_else(folder, text):
    named = re.findall(r"\]\(([^)]+)\)", text)
    assert len(named) >= 16
    assert sorted(path.name for path in folder.iterdir()) == sorted(
        [*named, "paper.md", "metrics.json"]
    )


def test_every_figure_is_a_vector_file_with_lettered_panels_and_its_data_beside_it(folder):
    for path in folder.glob("*.svg"):
        content = read_text(path)
        assert content.startswith("<?xml")
        # Letters are outlines, and what they say is a comment beside each.
        letters = re.findall(r"<!-- \(([a-z])\)", content)
        assert sorted(letters) == [chr(ord("a") + number) for number in range(len(letters))] != []
        with path.with_suffix(".csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) >= 8  # two curves of two points in each of two panels
        # Two panels have names for one axis.
        numbers = [row[name] for row in rows for name in ("x", "y") if row[name] not in DRAGS]
        assert np.isfinite(np.array(numbers, dtype=float)).all()
        assert [row for row in rows if "panel" in row and not row["x_axis"]] == []


def test_the_data_of_the_surfaces_are_the_final_heights(folder, numbers):
    with (folder / "fig10_surfaces.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    known = numbers["session"]
    assert {row["method"] for row in rows} == set(COMPARED)
    for method in COMPARED:
        heights = [float(row["height (mm)"]) for row in rows if row["method"] == method]
        # Six digits are written.
        assert max(heights) == pytest.approx(1e3 * known[method]["highest"], rel=1e-5)
        assert len(heights) == 625


def test_method_one_leaves_the_sections_asked_for_and_method_two_a_cross_with_a_rim(numbers):
    known = numbers["sections"]
    assert [name for name, one in known["virtual_master"].items() if not one["meets"]] == []
    mound = known["cell_states"]["along ridge and mound"]
    assert not mound["meets"]
    assert [mound["rim"], mound["rim_by_pins"]] == pytest.approx([4.5e-3, 6.2e-3], abs=0.1e-3)


def test_every_claim_has_numbers_those_of_the_metrics_a_verdict_and_a_reason_if_it_fails(
    text, numbers
):
    rows = claims(text)
    assert len(rows) == len(TEXTS["claim"])
    assert [row for row in rows if len(row) != 4 or not all(row[:3])] == []
    assert [row[0] for row in rows if not re.search(r"\d|never lost", row[1])] == []
    assert [row[0] for row in rows if row[2] != "**holds**" and not row[3]] == []
    assert re.findall(r"\b(?:nan|inf|None)\b", text) == []
    one, two = (
        numbers["session"][method]["rfd_shaping"] for method in ("virtual_master", "cell_states")
    )
    assert f"{one:.3g} and {two:.3g} N, ratio {two / one:.1f}" in text


def test_in_the_papers_own_windows_method_two_deviates_four_to_nine_times_as_much(numbers):
    # RFD, total force, height. Both windows together: the level of Method II differs between them.
    known = numbers["windows_of_the_paper"]
    for window, ratios in (("both", (4.5, 8.5, 5.5)), ("valley alone", (4.3, 1.5, 1.4))):
        one, two = (
            list(known[method][window].values()) for method in ("virtual_master", "cell_states")
        )
        assert np.array(two) / one == pytest.approx(ratios, abs=0.1)  # two digits are claimed


def test_an_older_folder_is_kept_unless_it_may_be_replaced(folder, capfd):
    before = (folder / "paper.md").stat().st_mtime_ns
    assert call(f"paper --quick --out {folder}") == 2
    assert "--overwrite" in capfd.readouterr().err
    assert (folder / "paper.md").stat().st_mtime_ns == before


def test_the_page_sets_method_three_beside_the_others(text, numbers):
    known = numbers["session"]
    table = text.split("## Method III")[1]
    row = next(line for line in table.splitlines() if line.startswith("| RFD in the session (N)"))
    shown = [float(cell) for cell in row.strip("|").split("|")[1:]]
    # Three digits.
    assert shown == pytest.approx([known[method]["rfd"] for method in COMPARED], rel=5e-3)
    # The goal of Method III on the session: at most half of Method I's.
    assert shown[2] < 0.5 * shown[0]
