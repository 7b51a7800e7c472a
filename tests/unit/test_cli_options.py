"""Options of the command line: what they reach, and what is refused before any work is done."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main
from digiclay.commands import describe, export
from digiclay.core.base.errors import BEGINNING, END, one_line

from tests.other_process import PROGRAM, finish, start
from tests.scene_files import left

pytestmark = pytest.mark.usefixtures("here")


MISTAKES: dict[str, tuple[list[str], str]] = {
    "picture": (["render", "my", "--out", "my.jpg"], "--out must end with .png (got my.jpg)."),
    "film": (["render", "my", "--film", "--out", "my.avi"], "--out must end with .mp4 (got my.avi)."),
    "folder": (["render", "my", "--out", "d.png"], "--out must be a file (d.png is a folder)."),
    "no folder": (["render", "my", "--out", "my.toml/a.png"], "my.toml cannot be a folder: my.toml is"),
    "width": (["render", "my", "--size", "1x1"], "--size must be at least 16 (got 1)."),
    "budget": (["run", "my.toml", "--budget", "0"], "--budget must be above 0 m (got 0 m)."),
    "option": (["run", "my.toml", "--fast"], "digiclay run: unrecognized arguments: --fast. See '"),
    "job": (["job", "."], ". is no job's folder: it has no job.toml."),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "said"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_one_line_before_any_work(
    arguments: list[str], said: str, here: Path, refused: Any
) -> None:
    (here / "d.png").mkdir()
    refused(arguments, said)
    assert left(here) == ["d.png"]


MEANT = {
    "rn my.toml": "Did you mean run?",
    "Run my.toml": "Did you mean run?",
    "ex my": "Did you mean export?",
    "run my.toml --exprot stl": "Did you mean --export (not --exprot)?",
    "run my.toml --exprot=stl": "Did you mean --export (not --exprot)?",
    "run my.toml -export stl": "Did you mean --export (not -export)?",
    "run my.toml --over": "Did you mean --overwrite (not --over)?",
    "sweep tap --varry layout.rows=3 --out o": "Did you mean --vary (not --varry)?",
    "export my --kind soild": "Did you mean solid?",
    "--verson": "Did you mean --version (not --verson)?",
    **dict.fromkeys(["walk", "run my.toml --fast", "run my.toml --set x", "run -- --exprot stl"], ""),
}


@pytest.mark.parametrize(("line", "asked"), MEANT.items())
def test_a_misspelt_word_gets_a_suggestion_and_what_is_like_nothing_gets_none(
    line: str, asked: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line.split()) == 2
    said = capsys.readouterr().err
    assert f". {asked} See 'digiclay" in said if asked else "Did you mean" not in said


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "my.toml", "--set", f"layout.rows={'x' * 5000}"],
        ["run", "my.toml", "--set", "valve.stroke='\x1b[2J\x07 a\nb'"],
        ["run", "x" * 5000], ["run", "my.toml", "--export", "x" * 5000], ["y" * 5000],
        ["run", "my.toml", f"--{'z' * 5000}"],
    ],
)  # fmt: skip
def test_an_error_is_one_line_of_a_sane_length(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert 0 < len(said) < 600
    assert said[:-1].isprintable()
    # What is cut keeps its beginning and its end.
    whole = "a" * (BEGINNING + END)
    cut = one_line(f"b{whole}c")
    assert (one_line(f" {whole}\n"), cut[0], cut[-1], " ... " in cut) == (whole, "b", "c", True)


@pytest.mark.parametrize("command", ["export", "features"])
def test_a_resolution_must_be_a_number_of_points(command: str, refused: Any) -> None:
    assert main(["run", "my.toml", "--quiet", "--no-errors"]) == 0
    for said in ("0", "-1", "2.5", "65", "9" * 400, "x"):
        refused([command, "my", f"--resolution={said}"], " 64")


def test_a_file_that_fails_half_way_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def full(*given: Any) -> None:
        raise OSError(28, "No space left on device", "a file")

    monkeypatch.setattr(describe, "description", full)
    assert main(["describe", "my.toml"]) == 2
    assert capfd.readouterr().err == "a file cannot be used: No space left on device.\n"


def test_the_list_of_commands_has_a_line_for_each_but_for_plumbing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    main(["--help"])
    listed = capsys.readouterr().out.partition("COMMAND\n")[2].partition("\n\n")[0].splitlines()
    assert [line for line in listed if len(line.split()) < 3 or not line.startswith("    ")] == []
    assert {line.split()[0] for line in listed} & {"job", "page", "benchmark"} == set()
    main(["job", "--help"])
    said = capsys.readouterr().out.split("\n\n")[1]
    assert (said[0].isupper(), said[-1]) == (True, ".")


def test_a_terminal_that_does_not_know_a_letter_gets_another() -> None:
    process = start(PROGRAM, "run", "my.toml", env={"PYTHONIOENCODING": "ascii"})
    code, out, err = finish(process)
    assert (code, err, "height error about " in out) == (0, "", True)


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_signal_while_the_program_starts_stops_it_in_one_line(here: Path) -> None:
    # As numpy and trimesh do: what an import is interrupted by passes for a library that is broken.
    script = (
        "import os, signal, sys\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'numpy' and self in sys.meta_path:\n"
        "            sys.meta_path.remove(self)\n"
        "            try:\n"
        f"                os.kill(os.getpid(), {int(signal.SIGINT)})\n"
        "            except KeyboardInterrupt:\n"
        "                raise ImportError('numpy is broken')\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "from digiclay.cli import console; console()\n"
    )
    code, _, err = finish(start(script, "run", "my.toml"))
    assert (code, err, left(here)) == (130, "Stopped; no file is half-written.\n", [])


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_what_is_written_before_a_signal_is_not_denied(
    here: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    main(["run", "my.toml", "--quiet", "--no-errors"])
    write = export.write

    def interrupted(*given: Any) -> Path:
        if given[3] == "ply":
            raise KeyboardInterrupt
        return write(*given)

    monkeypatch.setattr(export, "write", interrupted)
    code = main(["export", "my", "--format", "obj,ply"])
    assert (code, capfd.readouterr()) == (
        130, (f"{Path('my', 'surface.obj')} (y up)\n", "Stopped; no file is half-written.\n"),
    )  # fmt: skip
