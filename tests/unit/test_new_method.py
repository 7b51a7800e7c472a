"""The template of a control method: it is written, runs as it is, and its run is read without it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.core.control.methods import list_added, remove_method
from digiclay.core.session.finished_run import read_run
from digiclay.core.session.run_scene import run
from digiclay.plugins.method_loader import load_method

from tests.own_methods import forgotten, small

DOCS = Path(__file__).parents[2] / "docs" / "own-methods.md"
#: The methods on the page.
CODE = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Work in an empty folder; methods that a test loads are unknown after it."""
    monkeypatch.chdir(tmp_path)
    with forgotten():
        yield tmp_path


def test_the_template_runs_as_it_is_and_its_run_needs_no_code_any_more(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new-method", "soft_pad", "--out", "own"]) == 0
    assert "--method own/soft_pad.py:SoftPad" in capsys.readouterr().out
    size = ["--set", "layout.rows=11", "--set", "layout.columns=11", "--set", "simulation.duration=0.25"]
    own = ["--method", "own/soft_pad.py:SoftPad", "--quiet", "--no-errors"]
    assert main(["run", "tap", *own, *size, "--out", "r"]) == 0
    text = (here / "own" / "soft_pad.py").read_text(encoding="utf-8")
    assert (here / "r" / "method.py").read_text(encoding="utf-8") == text
    pressed = read_run(here / "r", "height")
    assert pressed.history["height"].min() < 39.9e-3  # it gives way
    assert pressed.scene.method == "soft_pad"
    remove_method("soft_pad")
    assert read_run(here / "r", "height").scene.control is None
    assert main(["export", "r", "--format", "stl", "--quiet"]) == 0
    assert main(["run", "r", "--out", "again"]) == 2
    assert "--method path/to/mine.py:Mine" in capsys.readouterr().err
    assert main(["run", "r", "--method", "r/method.py:SoftPad", "--out", "again", "--quiet"]) == 0
    again = read_run(here / "again", "height").history["height"]
    assert again.tobytes() == pressed.history["height"].tobytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["mine"], "mine.py is there already"),
        (["Mine"], "must be small letters and digits"),
        (["a/b"], "must be small letters and digits"),
        (["elastic"], "must not be that of a built-in method"),
        (["pad", "--out", "mine.py"], "mine.py is a file"),
    ],
)
def test_a_name_that_cannot_be_is_refused_in_a_line(
    here: Path, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "mine.py").write_text("", encoding="utf-8")
    assert main(["new-method", *arguments]) == 2
    err = capsys.readouterr().err
    assert (err.count("\n"), said in err) == (1, True), err
    assert [(path.name, path.stat().st_size) for path in here.iterdir()] == [("mine.py", 0)]


def test_a_sweep_varies_methods_and_goes_on_with_the_same_code_only(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new-method", "mine", "--quiet"]) == 0
    size = ["--set", "layout.rows=11", "--set", "layout.columns=11", "--set", "simulation.duration=0.05"]
    varied = ["--vary", "control.method=elastic,mine.py:Mine", "--workers", "1", "--out", "s", "--quiet"]
    assert main(["sweep", "tap", *varied, *size]) == 0
    assert (here / "s" / "sweep.csv").read_text(encoding="utf-8").split()[-2:][0].startswith("elastic,")
    assert main(["sweep", "tap", *varied, *size]) == 0
    (here / "mine.py").write_text((here / "mine.py").read_text(encoding="utf-8") + "\n", encoding="utf-8")
    remove_method("mine")
    assert main(["sweep", "tap", *varied, *size]) == 2
    assert "s holds another sweep" in capsys.readouterr().err


@pytest.mark.parametrize(
    "code", re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
)
def test_the_code_of_the_page_runs(here: Path, code: str) -> None:
    (here / "page.py").write_text(code, encoding="utf-8")
    name = re.findall(r"class (\w+)", code)[-1]
    assert load_method(f"page.py:{name}") in list_added()
    assert run(small(load_method(f"page.py:{name}"))).history["height"].min() < 0.04
