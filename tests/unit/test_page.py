"""The page of a series is written from its folder alone, by each job and by a command."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.core.files.run_folder import lock_name

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


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work beside the files of a series of which nothing is done."""
    monkeypatch.chdir(tmp_path)
    Path("two.toml").write_text(JOBS, encoding="utf-8")
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0
    return tmp_path


def page() -> str:
    """Return the page."""
    return Path("two/index.html").read_text(encoding="utf-8")


def test_jobs_that_are_started_alone_write_the_page_of_their_series(
    capsys: pytest.CaptureFixture[str],
) -> None:
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


def test_a_job_that_another_process_does_has_not_failed() -> None:
    with lock_name(Path("two/runs/tap-quick")):
        assert main(["job", "two/jobs/tap-quick", "--quiet"]) == 2
    assert main(["page", "two", "--quiet"]) == 0
    assert "0 of 3 jobs done, 1 failed." in page()


def test_a_failure_is_forgotten_when_the_job_is_described_anew() -> None:
    assert main(["job", "two/jobs/tap-endless", "--quiet"]) == 2
    Path("two.toml").write_text(JOBS.replace("1e6", "0.1"), encoding="utf-8")
    assert main(["batch", "two.toml", "--prepare", "--quiet"]) == 0
    assert main(["page", "two", "--quiet"]) == 0
    assert "0 of 3 jobs done, 1 failed." in page()
    assert page().count("not done yet") == 2


def test_a_folder_of_an_older_version_has_the_jobs_that_lie_in_it(capsys: pytest.CaptureFixture[str]) -> None:
    Path("two/batch.json").write_text('{"batch": "two", "digiclay": "0.1.0"}', encoding="utf-8")
    assert main(["page", "two"]) == 0
    assert capsys.readouterr().out.startswith("0 of 2 jobs done; ")


def test_what_is_no_series_has_no_page(capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree("two/jobs/tap-quick", "alone/jobs/tap-quick")
    assert main(["job", "alone/jobs/tap-quick", "--quiet"]) == 0
    assert sorted(path.name for path in Path("alone").iterdir()) == ["jobs", "runs"]
    assert main(["page", "alone"]) == 2
    assert (
        capsys.readouterr().err
        == "alone is no folder of a job series: it has no batch.json of 'digiclay batch'.\n"
    )
