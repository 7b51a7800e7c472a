"""The folder of a sweep or a batch when the disk is full, or holds what was left half-made."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main
from digiclay.core.base.errors import OutputError
from digiclay.core.files.file_lock import find_host
from digiclay.core.files.run_folder import read_json
from digiclay.core.studies.series import Kind, open_series

from tests.other_process import dead
from tests.scene_files import SCENE, folder_with, left

resource = pytest.importorskip("resource", reason="Windows cannot limit how much is written")

SWEEP = ["sweep", "my.toml", "--vary", "layout.rows=3,4", "--workers", "1", "--out", "o", "--quiet"]
BATCH = ["batch", "jobs.toml", "--prepare", "--out", "o", "--quiet"]
COMMANDS = {"sweep": SWEEP, "batch": BATCH}
KIND = Kind("series", "series.json", ("parts",))


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder with one scene, my.toml, and a JOBS file beside it."""
    (tmp_path / "jobs.toml").write_text('scenes = ["my.toml"]', encoding="utf-8")
    return folder_with(SCENE, tmp_path, monkeypatch)


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let files be written up to so many bytes only: the system refuses more, as it does on a full disk."""
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, former[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("size", [0, 40])
def test_a_series_that_found_the_disk_full_goes_on_when_there_is_room(name, size, here, refused):
    with room_for(size):
        refused(COMMANDS[name], f"Cannot write {Path('o', f'{name}.json')}: ")
    assert left(here) == ["jobs.toml"]
    assert main(COMMANDS[name]) == 0
    assert read_json(here / "o" / f"{name}.json")
    points = here / "o" / "points"
    for path in points.glob("*"):
        path.unlink()
    if name == "sweep":  # a point's file is larger
        with room_for(200):
            refused(SWEEP, "Cannot write")
        assert list(points.iterdir()) == []
        assert main(SWEEP) == 0
        assert len(list(points.iterdir())) == 2


@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("content", ["", '{\n "digiclay": "0.1', "[]", None])
def test_a_description_that_cannot_be_read_counts_as_none_where_nothing_is_done(name, content, here):
    # What an older version, or a machine that lost its power, left of a full disk.
    for folder in ("points",) if name == "sweep" else ("jobs", "runs", "logs"):
        (here / "o" / folder).mkdir(parents=True)
    (here / "o" / ".lock").touch()
    (here / "o" / f".{name}.json.{dead()}@{find_host()}.part").write_text("{", encoding="utf-8")
    if content is not None:
        (here / "o" / f"{name}.json").write_text(content, encoding="utf-8")
    assert main(COMMANDS[name]) == 0
    assert read_json(here / "o" / f"{name}.json")
    assert [path.name for path in (here / "o").iterdir() if path.name.startswith(".")] == []


def test_a_sweep_of_which_points_are_done_is_not_begun_anew(here: Path, refused: Any) -> None:
    assert main(SWEEP) == 0
    (here / "o" / "sweep.json").write_text("", encoding="utf-8")
    refused(SWEEP, "its sweep.json cannot be read")
    (here / "o" / "sweep.json").unlink()
    refused(SWEEP, "o holds other things than a sweep")


@pytest.mark.parametrize("stranger", ["letter.txt", "points/letter.txt", "sub/", ".git/"])
def test_a_folder_with_other_things_is_left_alone(stranger: str, here: Path, refused: Any) -> None:
    path = here / "o" / stranger
    (path if stranger.endswith("/") else path.parent).mkdir(parents=True)
    if not stranger.endswith("/"):
        path.touch()
    before = sorted((here / "o").rglob("*"))
    refused(SWEEP, "o holds other things than a sweep")
    assert sorted((here / "o").rglob("*")) == before


def test_what_a_killed_process_left_in_a_series_is_taken_away(here: Path) -> None:
    folder = here / "o"
    with open_series(folder, KIND, {"a": 1}):
        pass
    gone = dead()
    leftovers = [
        folder / f".series.json.{gone}.part",
        folder / "parts" / f".000001.json.{gone}@{find_host()}.part",
    ]
    foreign = folder / "parts" / f".000002.json.{gone}@elsewhere.part"
    for path in (*leftovers, foreign):
        path.touch()
    with open_series(folder, KIND, {"a": 1}):
        assert [path.exists() for path in leftovers] == [False, False]
    assert foreign.exists()
    assert json.loads((folder / "series.json").read_text(encoding="utf-8")) == {"a": 1}
    assert not (folder / ".lock").exists()


def test_another_series_and_what_is_no_folder_are_refused(here: Path) -> None:
    def refuse(there: object) -> None:
        raise OutputError(f"found {there}")

    with open_series(here / "o", KIND, {"a": 1}, refuse):  # nothing is there to be refused
        pass
    (here / "file").touch()
    for path, why in (("o", r"found \{'a': 1\}"), ("file", "file is a file"), ("file/o", "cannot be used")):
        with pytest.raises(OutputError, match=why), open_series(here / path, KIND, {"a": 2}, refuse):
            pass
