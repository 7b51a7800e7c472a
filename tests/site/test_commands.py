"""Commands of all pages: executed in the order of their page, or listed with what shows them instead."""

import functools
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.form.test_pages import CONTINUED, PAGES, list_lines
from tests.scene_files import read_text, write_text

ROOT = Path(__file__).parents[2]
LIST = Path(__file__).with_name("not_executed.toml")
#: Beyond this a command hangs, s.
LONGEST = 1200.0
#: Programs whose lines are commands; a number behind a name is a version.
PROGRAM = re.compile(
    r"(?:\$ )?(python (?:tools|docs/examples)/\w+\.py(?: .*)?"
    r"|(?:digiclay|python -m (?:benchmarks|digiclay)|make|pip install"
    r"|blender (?:--command|--background|-b)|dask|\.venv/bin/\w+) (?!\d).*)"
)
#: Word in place of which a reader writes something: DIR, RUN, SCENE.
PLACEHOLDER = re.compile(r"(?<![\w./-])[A-Z]{3,}[0-9]?(?![\w./])(?!=)|\.\.\.|…|/path/to")
#: Command without arguments: within a sentence it is the name of the command.
NAME = re.compile(r"(?:blender --command digiclay|digiclay [\w-]+)")
FILE = re.compile(r'^```\w+ title="([^"]+)"\n(.*?)^```', re.MULTILINE | re.DOTALL)


class Command(NamedTuple):
    text: str
    block: bool


def _complete(text: str) -> str:
    return re.split(r"\s{2,}|\s#\s", text.strip())[0].strip()


def find_commands(text: str) -> list[Command]:
    """Return the commands of a page: lines of its blocks, and complete ones in its sentences, in order.

    One of a sentence with a placeholder is a form, and one without arguments a name.
    """
    found = []
    for line, block in list_lines(CONTINUED.sub(" ", text)):
        texts = [line.strip()] if block else re.findall(r"`([^`]+)`", line)
        for match in filter(None, map(PROGRAM.fullmatch, texts)):
            if block or not (PLACEHOLDER.search(match[0]) or NAME.fullmatch(match[0])):
                found.append(Command(_complete(match[1]), block))
    return found


@functools.cache
def _listed() -> dict[str, Any]:
    return tomllib.loads(read_text(LIST))


def _excused() -> set[str]:
    return {command for group in _listed()["group"] for command in group["commands"]}


def execute(command: str, folder: Path) -> str:
    program, *words = shlex.split(command)
    beside = Path(sys.executable).parent / Path(program).name
    found = str(beside) if beside.exists() else shutil.which(program)
    paths = os.pathsep.join((str(ROOT), str(ROOT / "addon")))
    environment = {**os.environ, "PYTHONPATH": paths, "MPLBACKEND": "agg", "COLUMNS": "80"}
    done = subprocess.run(
        [found or program, *words],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        timeout=LONGEST,
        check=False,
    )
    return f"{command}: status {done.returncode}: {done.stderr[-400:]}" if done.returncode else ""


def play(text: str, folder: Path, excused: set[str]) -> list[str]:
    """Carry out the commands of a page that are not excused, in a folder with its files; return failures."""
    for name, content in FILE.findall(text):
        write_text(folder / name, content)
    once = dict.fromkeys(
        command.text for command in find_commands(text) if command.text not in excused
    )
    return list(filter(None, (execute(one, folder) for one in once if not one.startswith("make "))))


def _commands() -> list[Command]:
    return [command for page in PAGES for command in find_commands(read_text(page))]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_command_of_the_page_is_carried_out(page: Path, tmp_path: Path) -> None:
    assert play(read_text(page), tmp_path, _excused()) == []


def test_every_make_of_the_pages_is_carried_out_in_the_checkout_where_it_belongs() -> None:
    made = sorted({one.text for one in _commands() if one.text.startswith("make ")} - _excused())
    assert "make demo" in made
    assert list(filter(None, (execute(one, ROOT) for one in made))) == []


def test_a_command_that_fails_is_noticed(tmp_path: Path) -> None:
    text = "    digiclay run \\\n absent_scene\n    digiclay --version\n"
    text += "`digiclay run`, `digiclay run SCENE`\n"
    (failure,) = play(text, tmp_path, set())
    assert "digiclay run absent_scene: status 2" in failure
    assert play(text, tmp_path, {"digiclay run absent_scene"}) == []


def test_every_listed_command_is_on_a_page_and_has_a_reason_and_something_that_shows_it() -> None:
    groups = _listed()["group"]
    listed = [command for group in groups for command in group["commands"]]
    assert len({command.text for command in _commands() if command.block} - _excused()) > 40
    assert sorted(set(listed) - {command.text for command in _commands()}) == []
    assert len(listed) == len(set(listed))
    assert [
        group for group in groups if not group["reason"] or not (ROOT / group["shown"]).is_file()
    ] == []


def test_a_command_shown_by_the_whole_check_is_one_of_its_parts() -> None:
    parts = read_text(ROOT / ".ci" / "run")
    (shown,) = [group["commands"] for group in _listed()["group"] if group["shown"] == ".ci/run"]
    assert [
        command for command in shown if not re.search(rf" {command}( [A-Z]+=.*)?\n", parts)
    ] == []
