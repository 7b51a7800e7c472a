"""Folders of series: safe names of jobs, inside the folder; a full disk, and what was left half-made."""

import json
import os
import re
import shutil
from contextlib import contextmanager
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.commands.batch_folder import open_batch
from digiclay.core.base.errors import OutputError, SceneError
from digiclay.core.files import run_folder
from digiclay.core.files.file_lock import find_host
from digiclay.core.session.finished_run import is_whole
from digiclay.core.studies.job_table import read_jobs
from digiclay.core.studies.series import Kind, open_series
from hypothesis import example, given
from hypothesis import strategies as st

from tests.assemble import refused_in_a_line
from tests.other_process import dead
from tests.scene_files import SCENE, command, folder_with, left, read_text, write_text

QUICK = 'errors = false\nexport = ["stl"]\n'


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    work = tmp_path / "work"
    work.mkdir()
    write_text(tmp_path / "scene.toml", SCENE)
    write_text(work / "jobs.toml", 'scenes = ["my.toml"]')
    return folder_with(SCENE, work, monkeypatch)


ODD_NAMES = ["100 %", "#1", "it's", 'a "b"', "-lead", "%20", "a;b&c", "$HOME", "~", "漢 é"]


def test_scenes_with_any_signs_in_their_names_are_jobs_with_safe_names_of_their_own():
    for number, name in enumerate(ODD_NAMES, 1):
        write_text(Path(f"{name}.toml"), f"simulation.duration = {number}")
    names = [f"{name}.toml" for name in ODD_NAMES]
    jobs = Path("jobs.toml")
    write_text(jobs, f"scenes = {json.dumps(names)}")
    made = read_jobs(jobs).jobs
    assert [job.scene and job.scene.simulation.duration for job in made] == [
        *range(1, len(names) + 1)
    ]
    assert len({job.name for job in made}) == len(names)
    assert all(re.fullmatch(r"[\w+][\w.+-]*", job.name) for job in made)
    write_text(Path("a\nb.toml"), "")
    write_text(jobs, 'scenes = ["a\\nb.toml"]')
    with refused_in_a_line(SceneError, "name must be printable"):
        read_jobs(jobs)


@given(st.text())
@example("..")
@example(" . ")
@example("-x")
@example("con.toml")
@example("LPT²")
@example("ü" * 200)
@example("\ud800")
def test_any_text_makes_a_name_that_every_file_system_takes(text):
    name = run_folder.make_safe_name(text)
    assert 0 < len(name.encode()) <= run_folder.LONGEST + 1  # a device's name gets one letter more
    assert not set(name) & set('/\\:*?"<>|\0 ')
    assert name[0] not in ".-"
    assert name[-1] != "."
    assert name.partition(".")[0].lower() not in ("con", "nul", "lpt²")
    assert run_folder.make_safe_name(name) == name


@given(
    st.lists(
        st.sampled_from(
            ["a", "A", "a-2", "a-2-2", "ä", "a\u0308", "a b", "a_b", ".", "a.", "x" * 300]
        )
    )
)
@example(["x" * 300 + end for end in ("a", "b", "b")])
def test_no_two_names_are_alike_and_a_name_of_its_own_is_kept(texts):
    names = run_folder.make_unique_names(texts)
    assert len({run_folder.fold_name(name) for name in names}) == len(texts)
    assert max([0, *map(len, names)]) <= run_folder.LONGEST
    safe = [run_folder.make_safe_name(text) for text in texts]
    for place, name in enumerate(names):
        first = [run_folder.fold_name(one) for one in safe].index(run_folder.fold_name(safe[place]))
        assert (name == safe[place]) == (first == place)


def test_scenes_by_odd_paths_are_done_and_nothing_is_written_outside(here, capsys):
    for name in ("scene.toml", "MY.toml"):
        write_text(Path(name), SCENE)
    absolute = str(here.parent / "scene.toml")
    jobs = jobs_file(
        f'scenes = ["../scene.toml", "scene.toml", "MY.toml", "my.toml", {absolute!r}]\n{QUICK}'
    )
    assert main(["batch", str(jobs), "--out", "o", "--quiet"]) == 2
    assert "scenes must not name the same thing twice" in capsys.readouterr().err
    before = set(here.parent.rglob("*"))
    jobs = jobs_file(f'scenes = ["..", "scene.toml", "MY.toml", "my.toml"]\n{QUICK}')
    assert main(["batch", str(jobs), "--out", "o", "--jobs", "2"]) == 0
    assert "4 of 4 jobs done" in capsys.readouterr().out
    names = sorted(path.name for path in Path("o/runs").iterdir())
    assert names == sorted([run_folder.make_safe_name(here.parent.name), "work", "MY", "my-2"])
    for name in names:
        assert (Path("o/runs", name, "surface.stl")).stat().st_size > 84
    new = {path.relative_to(here) for path in here.parent.rglob("*") if path not in before}
    assert {path.parts[0] for path in new} == {"o"}


def jobs_file(said):
    path = Path("jobs.toml")
    write_text(path, said.replace("'", '"'))
    return path


@pytest.mark.parametrize("folder", ["jobs", "runs", "logs", "runs/my"])
def test_a_link_that_leads_out_of_the_batchs_folder_is_refused(folder, here, refused):
    (here / "away").mkdir()
    assert (
        main(
            ["batch", str(jobs_file('scenes = ["my.toml"]')), "--out", "o", "--prepare", "--quiet"]
        )
        == 0
    )
    link = here / "o" / folder
    shutil.rmtree(link, ignore_errors=True)
    link.symlink_to(here / "away")
    refused(command("batch jobs.toml --out o --quiet"), f"{Path('o', folder)} leads out of o, to ")
    assert list((here / "away").iterdir()) == []


def test_a_link_in_a_sweeps_folder_is_refused_and_a_link_to_the_folder_is_not(here, refused):
    (here / "away").mkdir()
    (here / "o").symlink_to(here / "away")
    assert main(SWEEP) == 0
    assert len(list((here / "away" / "points").iterdir())) == 2
    shutil.rmtree(here / "away" / "points")
    (here / "else").mkdir()
    (here / "away" / "points").symlink_to(here / "else")
    refused(SWEEP, "points leads out of o")
    assert list((here / "else").iterdir()) == []


def test_a_run_of_which_something_is_missing_or_cut_off_is_not_done():
    made = read_jobs(jobs_file(f'scenes = ["my.toml"]\n{QUICK}'))
    (job,) = made.jobs
    assert main(command("batch jobs.toml --out o --prepare --quiet")) == 0
    assert main(command("job o/jobs/my --quiet")) == 0
    with open_batch(Path("o"), made) as folder:
        for harm in ("surface.stl", "history.npz", "metrics.json", "thumbnail.png", "timing.json"):
            assert folder.is_done(job)
            path = Path("o/runs/my", harm)
            content = path.read_bytes()
            for left in (content[: len(content) // 2], None):
                path.write_bytes(left) if left else path.unlink()
                whole_without_sizes = harm not in ("history.npz", "metrics.json")
                assert not folder.is_done(job), harm
                assert is_whole(folder.find_run(job), job.scene) == whole_without_sizes
            path.write_bytes(content)
        shutil.rmtree("o/jobs/my")
        write_text(Path("o/jobs/my"), "a file")
        with pytest.raises(OutputError, match="cannot be made"):
            folder.describe(job)


@pytest.mark.parametrize("word", [".", "../work", "scene.toml"])
def test_a_run_of_a_folder_by_an_odd_path_has_the_folders_name(word):
    shutil.copy("my.toml", "scene.toml")
    assert main(["run", word, "--quiet", "--no-errors"]) == 0
    assert Path("work/metrics.json").is_file()
    assert (
        run_folder.find_name(Path("/scene.toml"))
        == run_folder.find_name(Path("...toml"))
        == "scene"
    )
    assert not os.path.lexists("metrics.json")


SWEEP = command("sweep my.toml --vary layout.rows=3,4 --metric rfd --workers 1 --out o --quiet")
BATCH = command("batch jobs.toml --prepare --out o --quiet")
COMMANDS = {"sweep": SWEEP, "batch": BATCH}
KIND = Kind("series", "series.json", ("parts",))


@contextmanager
def room_for(size):
    """Let files be written up to so many bytes only: the system refuses more, as it does on a full disk."""
    resource = pytest.importorskip("resource", reason="Windows cannot limit how much is written")
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
    assert run_folder.read_json(here / "o" / f"{name}.json")
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
def test_a_description_that_cannot_be_read_counts_as_none_where_nothing_is_done(
    name, content, here
):
    # What an older version, or a machine that lost its power, left of a full disk.
    for folder in ("points",) if name == "sweep" else ("jobs", "runs", "logs"):
        (here / "o" / folder).mkdir(parents=True)
    (here / "o" / ".lock").touch()
    write_text(here / "o" / f".{name}.json.{dead()}@{find_host()}.part", "{")
    if content is not None:
        write_text(here / "o" / f"{name}.json", content)
    assert main(COMMANDS[name]) == 0
    assert run_folder.read_json(here / "o" / f"{name}.json")
    assert [path.name for path in (here / "o").iterdir() if path.name.startswith(".")] == []


def test_a_sweep_of_which_points_are_done_is_not_begun_anew(here, refused):
    assert main(SWEEP) == 0
    write_text(here / "o" / "sweep.json", "")
    refused(SWEEP, "its sweep.json cannot be read")
    (here / "o" / "sweep.json").unlink()
    refused(SWEEP, "o contains something other than a sweep")


@pytest.mark.parametrize("stranger", ["letter.txt", "points/letter.txt", "sub/", ".git/"])
def test_a_folder_with_other_things_is_left_alone(stranger, here, refused):
    path = here / "o" / stranger
    (path if stranger.endswith("/") else path.parent).mkdir(parents=True)
    if not stranger.endswith("/"):
        path.touch()
    before = sorted((here / "o").rglob("*"))
    refused(SWEEP, "o contains something other than a sweep")
    assert sorted((here / "o").rglob("*")) == before


def test_what_a_killed_process_left_in_a_series_is_taken_away(here):
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
    assert json.loads(read_text(folder / "series.json")) == {"a": 1}
    assert not (folder / ".lock").exists()


def test_another_series_and_what_is_no_folder_are_refused(here):
    def refuse(there):
        raise OutputError(f"found {there}")

    with open_series(here / "o", KIND, {"a": 1}, refuse):  # nothing is there to be refused
        pass
    (here / "file").touch()
    for path, why in (
        ("o", r"found \{'a': 1\}"),
        ("file", "file is a file"),
        ("file/o", "cannot be used"),
    ):
        with (
            pytest.raises(OutputError, match=why),
            open_series(here / path, KIND, {"a": 2}, refuse),
        ):
            pass
