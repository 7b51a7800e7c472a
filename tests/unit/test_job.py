"""A job of a series, started again and again, and the page of the series, from its folder alone."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pytest
from digiclay.cli import main
from digiclay.core.base.errors import OutputError
from digiclay.core.files.run_folder import lock_name
from digiclay.core.session.render_settings import format_range, list_missing, name_frame, read_range

JOBS = """
scenes = ["tap"]
errors = false
[settings]
quick = { simulation.duration = 0.05 }
endless = { simulation.duration = 1e6 }
narrow = { layout.pitch = "1 mm" }
"""
#: How a page says that a browser is to load it again.
AGAIN = 'http-equiv="refresh"'
JOB, RUN = Path("two/jobs/tap-quick"), Path("two/runs/tap-quick")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work beside the files of one job that is not done."""
    monkeypatch.chdir(tmp_path)
    prepare(JOBS)
    return tmp_path


def prepare(said: str) -> None:
    """Write the files of the job."""
    Path("two.toml").write_text(said, encoding="utf-8")
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0


def written(run: Path = RUN) -> int:
    """Return when a run was written, ns."""
    return (run / "history.npz").stat().st_mtime_ns


def test_a_job_that_is_done_is_left_as_it_is_with_exit_code_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["job", str(JOB)]) == 0
    assert capsys.readouterr().out.startswith("written to ")
    before = written()
    assert main(["job", str(JOB)]) == 0
    out, err = capsys.readouterr()
    assert (out, err) == (f"was done already: {RUN.resolve()}\n", "")
    assert main(["job", str(JOB), "--only", "run", "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert written() == before
    assert main(["job", str(JOB), "--overwrite", "--quiet"]) == 0
    assert written() > before


def test_a_job_whose_files_changed_or_a_copy_broke_off_is_done_again_and_says_so(capsys):
    main(["job", str(JOB), "--quiet"])
    before = written()
    prepare(JOBS.replace("0.05", "0.06"))
    assert main(["job", str(JOB)]) == 0
    assert "is of another definition: it is done again.\n" in capsys.readouterr().out
    assert written() > before
    for harm, rest in (("history.npz", 100), ("scene.toml", 0), ("job.toml", 0)):
        whole = (RUN / harm).read_bytes()
        (RUN / harm).write_bytes(whole[:rest]) if rest else (RUN / harm).unlink()
        assert main(["job", str(JOB)]) == 0
        assert "is incomplete: it is done again.\n" in capsys.readouterr().out
        assert (RUN / harm).stat().st_size == len(whole)
    prepare(f'export = ["stl"]\n{JOBS.replace("0.05", "0.06")}')
    assert main(["job", str(JOB), "--quiet"]) == 0
    assert (RUN / "surface.stl").is_file()


def test_a_folder_outside_the_series_is_replaced_only_when_asked(refused: Any) -> None:
    own = ["job", str(JOB), "--out", "mine", "--quiet"]
    assert (main(own), main(own)) == (0, 0)
    before = written(Path("mine"))
    prepare(JOBS.replace("0.05", "0.06"))
    refused(own, "mine is not empty: choose another folder with --out")
    assert written(Path("mine")) == before
    assert main([*own, "--overwrite"]) == 0
    assert written(Path("mine")) > before


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--frames 0-9", "--frames must be given with --only film or --only turntable."),
        ("--only run --frames 0-9", "--frames must be given with --only film"),
        ("--only film", "job.toml has no section [film]."),
        ("--only turntable", "--only turntable needs a finished run, and the run in "),
        ("--only fim", "Did you mean film?"),
    ],
)
def test_a_part_that_cannot_be_done_is_refused_in_one_line(words: str, said: str, refused: Any) -> None:
    prepare(f"{JOBS}[turntable]\nframes = 4\n")
    refused(["job", str(JOB), *words.split()], said)
    assert list(Path("two/runs").iterdir()) == []


RANGES: dict[str, tuple[int, int] | None] = {
    "0-24": (0, 25), "7": (7, 8), "50+25": (50, 60), "59+1": (59, 60), "0-59": (0, 60), " 3-3 ": (3, 4),
    **dict.fromkeys(["", "a", "1-", "-3", "5-2", "0-60", "60", "60+1", "3+0", "1e2", "٣"]),
}  # fmt: skip


@pytest.mark.parametrize(("text", "ends"), RANGES.items())
def test_a_range_of_frames_reads_back_and_one_that_is_none_is_refused(text, ends):
    if ends is None:
        with pytest.raises(OutputError, match="--frames must be "):
            read_range(text, 60)
        return
    frames = read_range(text, 60)
    assert (frames.start, frames.stop) == ends
    assert read_range(format_range(frames), 60) == frames


def test_a_frame_that_is_cut_off_is_missing(tmp_path: Path) -> None:
    whole = b"anything" + b"IEND\xaeB`\x82"
    for frame, content in enumerate((whole, whole[:-3], b"", whole)):
        name_frame(tmp_path, frame).write_bytes(content)
    assert list_missing(tmp_path, range(6)) == [1, 2, 4, 5]
    assert list_missing(tmp_path / "none", range(2)) == [0, 1]


def page() -> str:
    """Return the page."""
    return Path("two/index.html").read_text(encoding="utf-8")


def test_jobs_that_are_started_alone_write_the_page_of_their_series(capsys):
    assert main(["job", "two/jobs/tap-endless", "--quiet"]) == 2
    said = capsys.readouterr().err.strip()
    assert "0 of 3 jobs done, 2 failed." in page()
    assert AGAIN in page()
    # Another job has just written the page; the last task of a farm writes it in any case.
    assert main(["job", "two/jobs/tap-quick", "--quiet"]) == 0
    assert "0 of 3 jobs done" in page()
    os.utime("two/index.html", (0, 0))
    assert main(["job", "two/jobs/tap-quick", "--quiet"]) == 0
    assert "1 of 3 jobs done, 2 failed." in page()
    Path("two.toml").unlink()
    Path("two/index.html").unlink()
    assert main(["page", "two"]) == 0
    assert capsys.readouterr().out == "1 of 3 jobs done, 2 failed; written to two/index.html\n"
    assert page().count('class="failed"') == 2
    assert said in page()
    assert "layout.pitch must be at least" in page()
    assert page().count("data:image/png;base64,") == 1
    assert AGAIN not in page()


def test_a_job_that_another_process_does_has_not_failed_and_one_described_anew_forgets_it() -> None:
    with lock_name(Path("two/runs/tap-quick")):
        assert main(["job", "two/jobs/tap-quick", "--quiet"]) == 2
    assert main(["page", "two", "--quiet"]) == 0
    assert "0 of 3 jobs done, 1 failed." in page()
    assert main(["job", "two/jobs/tap-endless", "--quiet"]) == 2
    prepare(JOBS.replace("1e6", "0.1"))
    assert main(["page", "two", "--quiet"]) == 0
    assert "0 of 3 jobs done, 1 failed." in page()
    assert page().count("not done yet") == 2


def test_what_is_no_series_has_no_page_and_one_of_an_older_version_the_jobs_in_it(capsys):
    shutil.copytree("two/jobs/tap-quick", "alone/jobs/tap-quick")
    assert main(["job", "alone/jobs/tap-quick", "--quiet"]) == 0
    assert sorted(path.name for path in Path("alone").iterdir()) == ["jobs", "runs"]
    assert main(["page", "alone"]) == 2
    rule = "alone is no folder of a job series: it has no batch.json of 'digiclay batch'.\n"
    assert capsys.readouterr().err == rule
    Path("two/batch.json").write_text('{"batch": "two", "digiclay": "0.1.0"}', encoding="utf-8")
    assert main(["page", "two"]) == 0
    assert capsys.readouterr().out.startswith("0 of 2 jobs done; ")
