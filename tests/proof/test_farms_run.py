"""Farms' files are executed: a template with a film by openjd, lists of commands by a shell."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from digiclay.cli import main

from tests.proof.conftest import told
from tests.scene_files import call, read_json, read_text, write_text
from tests.timeouts import TIMEOUT

JOBS = """
scenes = ["tap"]
errors = false
settings.short.simulation.duration = 0.3
[film]
width = 64
height = 40
rate = 10
"""

QUICK = 'scenes = ["tap"]\nerrors = false\nsettings.a.simulation.duration = 0.05\n'
COMMAND = str(Path(sys.executable).with_name("digiclay"))


def openjd(*arguments):
    return told(sys.executable, "-m", "openjd", *arguments)


def test_openjd_checks_a_template_and_runs_its_steps_in_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_text(Path("my film.toml"), JOBS)
    out = tmp_path / "das Büro's Laufwerk"
    submit = ["--submit", "openjd", "--chunk", "3", "--quiet"]
    assert main(["batch", "my film.toml", "--out", str(out), *submit]) == 0
    template = out / "openjd.json"
    assert "passes validation checks" in openjd("check", template)
    said = openjd("run", template, "-p", f"Python={sys.executable}")
    steps = re.findall(r"Running step '(.*)'", said)
    assert steps == ["tap-short: run", "tap-short: frames of film", "tap-short: film", "page"]
    assert re.findall(r"frames (\S+) of .*film.mp4 (.*)", said) == [
        ("0+3", "drawn"),
        ("3+3", "drawn"),
    ]
    run = out / "runs" / "tap-short"
    files = read_json(run / "timing.json")["files"]
    assert (run / "film.mp4").stat().st_size == files["film.mp4"] > 1000
    assert "1 of 1 jobs done." in read_text(out / "index.html")
    # A task that is sent again ends well and changes nothing.
    before = {path: path.stat().st_mtime_ns for path in run.iterdir()}
    again = openjd("run", template, "-p", f"Python={sys.executable}", "--step", "tap-short: film")
    assert "was done already" in again
    assert {path: path.stat().st_mtime_ns for path in run.iterdir()} == before


def test_a_step_whose_task_fails_stops_those_that_need_it(tmp_path):
    jobs = tmp_path / "two.toml"
    write_text(jobs, JOBS.replace("0.3", "0.05"))
    assert call(f"batch {jobs} --out {tmp_path / 'out'} --submit openjd --quiet") == 0
    write_text(tmp_path / "out" / "jobs" / "tap-short" / "scene.toml", "name = 3\n")
    template, program = tmp_path / "out" / "openjd.json", f"Python={sys.executable}"
    done = subprocess.run(
        [sys.executable, "-m", "openjd", "run", template, "-p", program],
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=TIMEOUT,
    )
    said = done.stdout + done.stderr
    assert done.returncode != 0
    assert re.findall(r"Running step '(.*)'", said) == ["tap-short: run"]
    page = read_text(tmp_path / "out" / "index.html")
    assert "0 of 1 jobs done, 1 failed." in page


@pytest.mark.parametrize(
    "program, name",
    [
        ("", f"Python={sys.executable}"),
        (sys.executable, f"Python={sys.executable}"),
        (COMMAND, f"Digiclay={COMMAND}"),
    ],
)
def test_the_program_of_a_template_is_named_by_its_kind(program, name, tmp_path):
    jobs, out = tmp_path / "two.toml", tmp_path / "out"
    write_text(jobs, QUICK)
    named = f"--program {program}" if program else ""
    assert call(f"batch {jobs} --out {out} --submit openjd {named} --quiet") == 0
    openjd("run", out / "openjd.json", "-p", name)
    assert "1 of 1 jobs done." in read_text(out / "index.html")


def test_a_shell_executes_each_line_of_the_lists_of_cuecmd(tmp_path):
    jobs, out = tmp_path / "two.toml", tmp_path / "schöne 'Tasten' $HOME; #"
    write_text(jobs, QUICK)
    assert main(["batch", str(jobs), "--out", str(out), "--submit", "cuecmd", "--quiet"]) == 0
    for path in sorted((out / "cuecmd").iterdir()):
        for line in read_text(path).splitlines():
            subprocess.run(
                line, shell=True, check=True, timeout=TIMEOUT, capture_output=True, cwd="/"
            )
    assert [path.name for path in (out / "runs").iterdir()] == ["tap-a"]
    assert "1 of 1 jobs done." in read_text(out / "index.html")
