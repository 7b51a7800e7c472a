"""Stopped between simulating and the end: what is missing is named, and what is named makes it."""

from __future__ import annotations

import json
import shlex
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands import form as form_command
from digiclay.commands import run as run_command
from digiclay.commands.run import plan_meshes
from digiclay.core.scene.scene_source import load
from digiclay.core.session.finished_run import find_row
from digiclay.core.session.run_scene import Result, RunRecording

from tests.scene_files import left

#: A folder whose name a shell would take for several words.
OUT = "first run"


pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture(autouse=True)
def plain_relief(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the texts of a relief where they are: to move them apart takes seconds."""
    monkeypatch.setattr("digiclay.plots.bed.fit_relief", lambda *given: None)


def stop_before(monkeypatch: pytest.MonkeyPatch, module: Any, name: str, number: int = signal.SIGINT) -> None:
    """Send Ctrl-C, or another signal, when a command comes to a step."""
    step: Callable[..., Any] = getattr(module, name)

    def interrupted(*given: Any, **known: Any) -> Any:
        assert signal.getsignal(number) is not signal.SIG_DFL  # it would end the tests
        signal.raise_signal(number)
        return step(*given, **known)

    monkeypatch.setattr(module, name, interrupted)


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Give a way to stop a command before a step; it returns the commands on stderr by their files."""

    def run(module: Any, name: str, *arguments: str, number: int = signal.SIGINT) -> dict[str, list[str]]:
        with monkeypatch.context() as patched:
            stop_before(patched, module, name, number)
            assert main([*arguments, "--out", OUT]) == 130
        said = capsys.readouterr().err.splitlines()
        pairs = (line.removeprefix("Stopped before ").split("; to have it: ") for line in said)
        return {what: shlex.split(command)[1:] for what, command in pairs}

    return run


def files(folder: Path) -> set[str]:
    """Return the files in a folder and below it."""
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


SMALL = ["--set", "layout.rows=13", "--set", "layout.columns=13", "--quiet"]


@pytest.mark.parametrize(
    ("command", "made"),
    [
        (
            ["run", "my.toml", "--quiet", "--export", "stl,obj", "--plots", "--no-errors"],
            ["surface.stl, surface.obj", "session.png, surface.png"],
        ),
        (["form", "dome", *SMALL], ["surface.stl", "displayed/surface.stl"]),
    ],
    ids=["run", "form"],
)  # fmt: skip
def test_what_is_stopped_before_its_extras_names_them_and_how_to_make_them(
    command: list[str], made: list[str], here: Path, stopped: Any
) -> None:
    assert main([*command, "--out", "whole"]) == 0
    commands = stopped(run_command, "save", *command)
    assert list(commands) == made
    assert files(here / OUT) == {"scene.toml", "history.npz", "metrics.json"}
    assert not json.loads((here / OUT / "metrics.json").read_text(encoding="utf-8"))["incomplete"]
    for command in commands.values():
        assert main(command) == 0
    assert files(here / OUT) == files(here / "whole")
    for name in {*", ".join(made).split(", ")}:
        assert (here / OUT / name).read_bytes() == (here / "whole" / name).read_bytes()


def test_plot_writes_into_a_folder_and_prints_its_files(here, capsys):
    assert main(["run", "my.toml", "--out", "o", "--quiet", "--no-errors"]) == 0
    assert main(["plot", "o", "--out", "new/pictures"]) == 0
    assert [Path(line).name for line in capsys.readouterr().out.split()] == ["session.png", "surface.png"]
    assert files(here / "new") == {"pictures/session.png", "pictures/surface.png"}


def test_a_run_stopped_before_its_errors_are_estimated_says_so(here: Path, stopped: Any) -> None:
    commands = stopped(Result, "estimate_errors", "run", "my.toml")
    assert list(commands) == ["its errors were estimated"]
    assert "height_error" not in json.loads((here / OUT / "metrics.json").read_text(encoding="utf-8"))
    assert main(commands["its errors were estimated"]) == 0
    assert "height_error" in json.loads((here / OUT / "metrics.json").read_text(encoding="utf-8"))
    assert left(here) == [OUT]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["Ctrl-C", "as farms stop"])
def test_a_run_stopped_within_its_session_is_kept_and_can_be_exported_as_it_says(number, here, stopped):
    arguments = ("run", "my.toml", "--quiet", "--export", "ply")
    commands = stopped(RunRecording, "observe", *arguments, number=number)
    assert list(commands) == ["surface.ply"]
    assert json.loads((here / OUT / "metrics.json").read_text(encoding="utf-8"))["incomplete"]
    assert main(commands["surface.ply"]) == 0
    assert (here / OUT / "surface.ply").is_file()


@pytest.mark.parametrize("step", ["scene_of", "fit_shape", "make_forming_scene"])
def test_form_that_is_stopped_before_its_session_writes_nothing(step, here, monkeypatch, capsys):
    monkeypatch.setattr(run_command, "run", lambda *given, **known: pytest.fail("It went on."))
    stop_before(monkeypatch, form_command, step)
    assert main(["form", "dome", "--out", OUT, "--set", "simulation.duration=1e4", "--quiet"]) == 130
    assert capsys.readouterr().err == "Stopped; no file is half-written.\n"
    assert left(here) == []


@pytest.mark.parametrize(
    ("settings", "arguments", "said"),
    [
        (["--set", "layout.rows=1"], ["plot", "o"], "plot needs at least 2 x 2 cells"),
        (["--set", "recorder=absent"], ["plot", "o"], "o has no history.npz"),
        ([], ["plot", "o", "--out", "my.toml/x"], "my.toml/x cannot be a folder: my.toml is a file."),
    ],
)
def test_what_cannot_be_plotted_is_told_in_a_line(settings, arguments, said, refused):
    assert main(["run", "my.toml", "--out", "o", "--quiet", "--no-errors", *settings]) == 0
    refused(arguments, said)


def test_the_instant_before_the_finger_is_named_to_the_last_digit(here: Path) -> None:
    times = np.arange(2000) * 0.005
    for row in (1, 777, 1999):
        extra = plan_meshes(load(Path("my.toml")), {"time": times}, ["stl"], row, "displayed")
        later = extra.later(Path("o"))
        assert find_row({"time": times}, float(later[later.index("--time") + 1]), "--time") == row
