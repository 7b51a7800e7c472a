"""The benchmark of a session: its parts, its clocks, what it refuses."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.session_parts import CORE, FILES, PARTS
from tests.scene_files import SMALL_BLISTER, TOUCH, folder_with, scene_text

SCENE = scene_text(3, 4, *TOUCH, parts=SMALL_BLISTER)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder with one scene, my.toml."""
    return folder_with(SCENE, tmp_path, monkeypatch)


def test_there_is_a_cost_for_every_part(capsys: pytest.CaptureFixture[str]) -> None:
    main(["session", "--scene", "my.toml", "--repeats", "1"])
    lines = capsys.readouterr().out.splitlines()
    costs = {
        part: float(line.split("%")[0].split()[-2])
        for part in PARTS
        for line in lines
        if line.startswith(f"  {part} ")
    }
    assert [part for part in PARTS if not costs[part] > 0.0] == []


def test_every_part_is_made_of_files_that_there_are() -> None:
    files = [path.relative_to(CORE).as_posix() for path in CORE.rglob("*.py")]
    assert [name for name in FILES if not any(file.startswith(name) for file in files)] == []
    assert set(FILES.values()) == set(PARTS)


def test_the_processor_time_stands_beside_the_time_gone_by(capsys: pytest.CaptureFixture[str]) -> None:
    main(["session", "--scene", "my.toml", "--repeats", "1"])
    out = capsys.readouterr().out
    gone, used = (float(re.search(told, out)[1]) for told in (r"in ([\d.e-]+) s \(", r"time ([\d.e-]+) s \("))
    # One process, one thread: it uses no more than goes by, but for the grain of the two clocks.
    assert 0.0 < used <= 1.1 * gone


MISTAKES = {
    "session --repeats 0": "must be a whole number from 1 to 1000",
    "scale --out my.toml/new": (
        "python -m benchmarks scale: argument --out: my.toml/new cannot be a folder: my.toml is a file. "
        "See 'python -m benchmarks scale --help'."
    ),
    "sesion": "Did you mean session?",
}


@pytest.mark.parametrize(("line", "said"), MISTAKES.items())
def test_a_mistake_is_one_line_and_exit_code_2(
    line: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code, told = main(line.split()), capsys.readouterr()
    assert (code, told.out, told.err.count("\n"), said in told.err) == (2, "", 1, True)
