"""Jobs of a series that are started alone: done, interrupted, changed, and their frames."""

import os
import re
import shutil
from pathlib import Path

import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.files.run_folder import lock_name
from digiclay.core.session.render_settings import (
    format_range,
    list_missing,
    name_frame,
    read_range,
)

from tests.scene_files import call
from tests.series import ENDLESS, JOB, RUN, index, prepare, write, written

pytestmark = pytest.mark.usefixtures("folder")

#: How a page says that a browser is to load it again.
AGAIN = 'http-equiv="refresh"'


def test_a_job_that_is_done_is_left_as_it_is_with_exit_code_0(capsys):
    prepare()
    assert call(f"job {JOB}") == 0
    assert capsys.readouterr().out.startswith("written to ")
    before = written()
    assert call(f"job {JOB}") == 0
    out, err = capsys.readouterr()
    assert (out, err) == (f"was done already: {RUN.resolve()}\n", "")
    assert call(f"job {JOB} --only run --quiet") == 0
    assert capsys.readouterr().out == ""
    assert written() == before
    assert call(f"job {JOB} --overwrite --quiet") == 0
    assert written() > before


def test_a_job_whose_files_changed_or_a_copy_broke_off_is_done_again_and_says_so(capsys):
    prepare()
    call(f"job {JOB} --quiet")
    before = written()
    prepare(ENDLESS.replace("0.05", "0.06"))
    assert call(f"job {JOB}") == 0
    assert "is of another definition: it is repeated.\n" in capsys.readouterr().out
    assert written() > before
    for harm, rest in (("history.npz", 100), ("scene.toml", 0), ("job.toml", 0)):
        whole = (RUN / harm).read_bytes()
        (RUN / harm).write_bytes(whole[:rest]) if rest else (RUN / harm).unlink()
        assert call(f"job {JOB}") == 0
        assert "is incomplete: it is repeated.\n" in capsys.readouterr().out
        assert (RUN / harm).stat().st_size == len(whole)
    prepare(f'export = ["stl"]\n{ENDLESS.replace("0.05", "0.06")}')
    assert call(f"job {JOB} --quiet") == 0
    assert (RUN / "surface.stl").is_file()


def test_a_folder_outside_the_series_is_replaced_only_when_asked(refused):
    prepare()
    own = f"job {JOB} --out mine --quiet"
    assert (call(own), call(own)) == (0, 0)
    before = written(Path("mine"))
    prepare(ENDLESS.replace("0.05", "0.06"))
    refused(own, "mine is not empty: choose another folder with --out")
    assert written(Path("mine")) == before
    assert call(f"{own} --overwrite") == 0
    assert written(Path("mine")) > before


@pytest.mark.parametrize(
    "words, said",
    [
        ("--frames 0-9", "--frames must be given with --only film or --only turntable."),
        ("--only run --frames 0-9", "--frames must be given with --only film"),
        ("--only film", "job.toml has no section [film]."),
        ("--only turntable", "--only turntable needs a finished run, and the run in "),
        ("--only fim", "Did you mean film?"),
    ],
)
def test_a_part_that_cannot_be_done_is_refused_in_one_line(words, said, refused):
    prepare(f"{ENDLESS}[turntable]\nframes = 4\n")
    refused(f"job {JOB} {words}", said)
    assert list(Path("two/runs").iterdir()) == []


RANGES = {
    "0-24": (0, 25), "7": (7, 8), "50+25": (50, 60), "59+1": (59, 60), "0-59": (0, 60), " 3-3 ": (3, 4),
    **dict.fromkeys(["", "a", "1-", "-3", "5-2", "0-60", "60", "60+1", "3+0", "1e2", "٣"]),
}  # fmt: skip


@pytest.mark.parametrize("text, ends", RANGES.items())
def test_a_range_of_frames_reads_back_and_one_that_is_none_is_refused(text, ends):
    if ends is None:
        with pytest.raises(OutputError, match="--frames must be "):
            read_range(text, 60)
        return
    frames = read_range(text, 60)
    assert (frames.start, frames.stop) == ends
    assert read_range(format_range(frames), 60) == frames


def test_a_frame_that_is_cut_off_is_missing(tmp_path):
    whole = b"anything" + b"IEND\xaeB`\x82"
    for frame, content in enumerate((whole, whole[:-3], b"", whole)):
        name_frame(tmp_path, frame).write_bytes(content)
    assert list_missing(tmp_path, range(6)) == [1, 2, 4, 5]
    assert list_missing(tmp_path / "none", range(2)) == [0, 1]


def test_jobs_that_are_started_alone_write_the_page_of_their_series(capsys):
    write(ENDLESS)
    assert call("batch two.toml --prepare") == 1
    said = "".join(capsys.readouterr())
    assert re.match("2 jobs written to .*\n1 of 3 jobs failed; the first one: tap-narrow: ", said)
    assert call("job two/jobs/tap-endless --quiet") == 2
    said = capsys.readouterr().err.strip()
    assert "0 of 3 jobs done, 2 failed." in index()
    assert AGAIN in index()
    # Another job has just written the page; the last task of a farm writes it in any case.
    assert call("job two/jobs/tap-quick --quiet") == 0
    assert "0 of 3 jobs done" in index()
    os.utime("two/index.html", (0, 0))
    assert call("job two/jobs/tap-quick --quiet") == 0
    assert "1 of 3 jobs done, 2 failed." in index()
    Path("two.toml").unlink()
    Path("two/index.html").unlink()
    assert call("page two") == 0
    assert capsys.readouterr().out == "1 of 3 jobs done, 2 failed; written to two/index.html\n"
    assert index().count('class="failed"') == 2
    assert said in index()
    assert "layout.pitch must be at least" in index()
    assert index().count("data:image/png;base64,") == 1
    assert AGAIN not in index()


def test_a_job_that_another_process_does_has_not_failed_and_one_described_anew_forgets_it():
    prepare()
    with lock_name(Path("two/runs/tap-quick")):
        assert call("job two/jobs/tap-quick --quiet") == 2
    assert call("page two --quiet") == 0
    assert "0 of 3 jobs done, 1 failed." in index()
    assert call("job two/jobs/tap-endless --quiet") == 2
    prepare(ENDLESS.replace("1e6", "0.1"))
    assert call("page two --quiet") == 0
    assert "0 of 3 jobs done, 1 failed." in index()
    assert index().count("not done yet") == 2


def test_what_is_no_series_has_no_page_and_one_of_an_older_version_the_jobs_in_it(capsys):
    prepare()
    shutil.copytree("two/jobs/tap-quick", "alone/jobs/tap-quick")
    assert call("job alone/jobs/tap-quick --quiet") == 0
    assert sorted(path.name for path in Path("alone").iterdir()) == ["jobs", "runs"]
    assert call("page alone") == 2
    rule = "alone is not the folder of a job series: it has no batch.json of 'digiclay batch'.\n"
    assert capsys.readouterr().err == rule
    Path("two/batch.json").write_text('{"batch": "two", "digiclay": "0.1.0"}', encoding="utf-8")
    assert call("page two") == 0
    assert capsys.readouterr().out.startswith("0 of 2 jobs done; ")
