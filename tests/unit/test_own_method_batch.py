"""A control method of one's own in a job series: its code lies beside each job, a command loads it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from digiclay.cli import main
from digiclay.commands.run_state import RunState, judge_run
from digiclay.core.control.methods import remove_method

from tests.own_methods import PAD, forgotten, write_method

JOBS = """
scenes = ["tap"]
methods = ["elastic"]
errors = false

[settings]
small = { layout.rows = 11, layout.columns = 11, simulation.duration = 0.05 }
"""
JOB = Path("jobs", "jobs", "tap-soft_pad-small")
RUN = Path("jobs", "runs", "tap-soft_pad-small")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Work in a folder with a JOBS file and a method, which is unknown after the test."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "jobs.toml").write_text(JOBS, encoding="utf-8")
    write_method(tmp_path)
    with forgotten():
        yield tmp_path


def prepare() -> int:
    """Write the files of the jobs, and forget the method as another process would not know it."""
    code = main(["batch", "jobs.toml", "--method", "pad.py:SoftPad", "--prepare", "--quiet"])
    remove_method("soft_pad")
    return code


def test_a_job_has_its_code_beside_it_and_is_done_again_after_a_change_of_it(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert prepare() == 0
    assert sorted(path.name for path in JOB.iterdir()) == ["job.toml", "method.py", "scene.toml"]
    assert not (JOB.with_name("tap-elastic-small") / "method.py").exists()
    assert (JOB / "method.py").read_text(encoding="utf-8") == PAD
    assert main(["job", str(JOB), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert (said.count("\n"), "--method path/to/mine.py:Mine" in said) == (1, True)
    assert judge_run(JOB, RUN) is RunState.ABSENT
    own = ["--method", "method.py:SoftPad", "--quiet"]
    assert main(["job", str(JOB), *own]) == 0
    assert judge_run(JOB, RUN) is RunState.WHOLE
    found = json.loads((RUN / "metrics.json").read_text(encoding="utf-8"))
    assert found["versions"]["method"].startswith("method.py:SoftPad sha256:")
    remove_method("soft_pad")
    write_method(here, PAD.replace("50e-6", "60e-6"))
    assert prepare() == 0
    assert judge_run(JOB, RUN) is RunState.CHANGED
    assert main(["job", str(JOB), *own]) == 0
    assert judge_run(JOB, RUN) is RunState.WHOLE


def test_a_series_runs_with_it_in_processes_and_farms_are_told_its_code(here: Path) -> None:
    methods = JOBS.replace('methods = ["elastic"]\n', "")
    (here / "jobs.toml").write_text(methods, encoding="utf-8")
    own = ["batch", "jobs.toml", "--method", "pad.py:SoftPad", "--quiet"]
    assert main(own) == 0
    assert judge_run(JOB, RUN) is RunState.WHOLE
    assert [path.name for path in RUN.parent.iterdir()] == [RUN.name]  # without methods in the file: this one
    assert main([*own, "--submit", "cuecmd"]) == 0
    lists = "".join(path.read_text(encoding="utf-8") for path in sorted(here.glob("jobs/cuecmd/*.txt")))
    assert "--method method.py:SoftPad" in lists


def test_a_series_with_a_method_that_cannot_be_loaded_leaves_nothing(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["batch", "jobs.toml", "--method", "pad.py:Pad"]) == 2
    said = capsys.readouterr().err
    assert said == "--method: pad.py:Pad: the file must have the class Pad (it has pad.py:SoftPad).\n"
    assert sorted(path.name for path in here.iterdir()) == ["jobs.toml", "pad.py"]
