"""Figures of the pages are what the commands give now; one that is stale is told."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks import figures
from benchmarks.__main__ import main

QUICK = [figure for figure in figures.read_figures() if not figure["slow"]]
README = (figures.ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("figure", QUICK, ids=lambda figure: f"{figure['page']} {figure['metric']}")
def test_a_figure_of_a_page_is_what_the_command_gives(figure: Any) -> None:
    judged = figures.judge(figure)
    assert judged["stale"] == "", judged


@pytest.mark.parametrize(
    ("page", "code", "said"),
    [
        (README, 0, "0 of 1 figures are stale."),
        (README.replace("26.5 s", "26.6 s"), 1, "1 of 1 figures are stale."),
        ("", 2, "README.md has no number 2 behind"),
    ],
)
def test_a_stale_page_is_told_and_one_that_has_lost_its_figure_refused(
    page: str, code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(figures, "ROOT", tmp_path)
    (tmp_path / "README.md").write_text(page, encoding="utf-8")
    assert main(["figures", "README.md", "--quiet"]) == code
    told = capsys.readouterr()
    assert said in told.out + told.err
