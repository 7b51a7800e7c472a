"""Folders are claimed and files locked: one process at a time, and what a killed one leaves goes away."""

import os
import re
import shutil
import subprocess
import sys
import time
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.files.file_lock import (
    find_host,
    find_start,
    hold_lock,
    hold_record,
    may_have_made,
)
from digiclay.core.files.run_folder import (
    claim_files,
    claim_folder,
    find_lock,
    is_unfinished,
    name_unfinished,
    remove_abandoned,
    resolve_inside,
    write_folder,
)

from tests.other_process import PROGRAM, dead, finish, start
from tests.scene_files import call
from tests.timeouts import TIMEOUT, wait_until

#: What the second process says.
REFUSED = "o is being {} by another digiclay: choose another place with --out, or wait.\n"


pytestmark = pytest.mark.usefixtures("here")


@contextmanager
def running(*arguments, sign):
    process = start(PROGRAM, *arguments)
    try:
        wait_until(lambda: process.poll() is not None or list(Path().glob(sign)))
        assert process.poll() is None, process.communicate()
        yield process
    finally:
        process.kill()
        process.communicate(timeout=TIMEOUT)


def write_jobs():
    Path("jobs.toml").write_text('scenes = ["my.toml"]\nerrors = false\n', encoding="utf-8")


def names(folder=Path()):
    return sorted(path.name for path in folder.iterdir())


def test_a_folder_that_is_being_written_is_refused_at_once_by_every_command(refused):
    write_jobs()
    assert call("batch jobs.toml --out b --prepare --quiet") == 0
    assert call("run my.toml --out older --quiet --no-errors") == 0
    before = names(Path("older"))
    commands = ["run my.toml", "form dome", "compare my.toml", "paper", "job b/jobs/my"]
    commands += ["sweep my.toml --vary layout.rows=3,4", "batch jobs.toml"]
    with claim_folder(Path("o"), overwrite=False), claim_folder(Path("older"), overwrite=True):
        for command in commands:
            refused(f"{command} --out o --quiet", REFUSED.format("written"))
        assert not Path("o").exists()
        # A run that is being replaced takes in no mesh and no plot.
        for command in ("export older", "plot older", "run my.toml --out older --overwrite"):
            refused(f"{command} --quiet", "older is being written by another digiclay")
        assert call("export older --out elsewhere --quiet") == 0
    assert names(Path("older")) == before
    assert call("export older --quiet") == 0


@pytest.mark.parametrize(
    "line", ["sweep my.toml --vary layout.rows=3,4 --metric rfd --workers 1", "batch jobs.toml"]
)
def test_a_second_series_in_one_folder_is_refused_at_once(line, refused):
    write_jobs()
    # Nothing is to be simulated.
    finished = f"{line} --prepare" if line.startswith("batch") else line
    assert call(f"{finished} --out o --quiet") == 0
    with hold_lock(Path("o/.lock"), "no"):
        refused(f"{line} --out o --quiet", REFUSED.format("used"))
        refused("run my.toml --out o --quiet", "o contains something other than a run")


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no folder here that takes no files")
@pytest.mark.timeout(20)
def test_a_folder_of_the_system_that_takes_no_files_is_refused(refused):
    refused("run my.toml --out /proc/o --quiet", "/proc/o cannot be made")


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_what_a_killed_job_leaves_is_taken_away_by_the_next_and_its_lock_with_it():
    write_jobs()
    call("batch jobs.toml --prepare --quiet")
    scene = Path("jobs/jobs/my/scene.toml")
    short = scene.read_text(encoding="utf-8")
    hours = re.sub(
        r"(?m)^duration = \S+", "duration = 1e4", re.sub(r"(?m)^every = 1", "every = 1000", short)
    )
    scene.write_text(hours, encoding="utf-8")
    with running("job", "jobs/jobs/my", "--quiet", sign="jobs/runs/.my.*.part") as process:
        (part,) = Path("jobs/runs").glob(".my.*.part")
        # As long as it lives, nobody takes away what it has begun.
        remove_abandoned(Path("jobs/runs"))
        assert part.is_dir()
        process.kill()
        process.wait(TIMEOUT)
    assert names(Path("jobs/runs")) == [part.name, ".my.lock"]
    scene.write_text(short, encoding="utf-8")
    assert call("job jobs/jobs/my --quiet") == 0
    assert names(Path("jobs/runs")) == ["my"]


def test_an_older_run_that_was_moved_aside_when_its_process_was_killed_is_put_back(refused):
    call("run my.toml --out o --quiet --no-errors")
    shutil.move("o", f".o.{dead()}@{find_host()}.old")
    refused("run my.toml --out o --quiet", "o is not empty")
    assert names() == ["my.toml", "o"]


def test_what_comes_in_between_is_not_replaced_at_the_end():
    def interfere():
        with write_folder(Path("o"), overwrite=False):
            Path("o").mkdir()
            Path("o/thesis.doc").touch()

    with pytest.raises(OutputError, match="o contains something other"):
        interfere()
    assert names(Path("o")) == ["thesis.doc"]


def test_a_claim_ends_with_its_block_and_leaves_no_folder():
    with claim_folder(Path("a/b/o"), overwrite=False):
        Path("link").symlink_to("a")
        for name in ("a/b/o", "link/../link/b/o"):  # one folder by two names
            with (
                pytest.raises(OutputError, match="being written"),
                claim_folder(Path(name), overwrite=False),
            ):
                pass
        with claim_folder(Path("a/b/other"), overwrite=False):
            pass
    with claim_folder(Path("a/b/o"), overwrite=False) as claim, claim.write():
        pass
    assert names(Path("a/b")) == ["o"]
    with pytest.raises(ZeroDivisionError), claim_folder(Path("c/d/o"), overwrite=False):
        raise ZeroDivisionError
    assert names() == ["a", "link", "my.toml"]
    # Two exports do not write one file at once.
    with claim_files([Path("a/a.stl"), Path("a/b.stl")]):
        with claim_files([Path("a/c.stl")]):
            pass
        with (
            pytest.raises(OutputError, match=r"b\.stl is being written"),
            claim_files([Path("a/b.stl")]),
        ):
            pass
    assert names(Path("a")) == ["b"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no fork")
def test_whoever_waits_gets_the_claim_when_the_other_one_ends_and_a_child_does_not_keep_it():
    script = (
        "import sys, time\n"
        "from pathlib import Path\n"
        "from digiclay.core.files.run_folder import claim_folder\n"
        "with claim_folder(Path('o'), overwrite=False):\n"
        "    print('here', flush=True)\n"
        "    sys.stdin.readline()\n"
        "    time.sleep(0.3)\n"
    )
    other = start(script)
    assert other.stdout.readline() == "here\n"
    other.communicate("go\n", timeout=TIMEOUT)
    with claim_folder(Path("o"), overwrite=False, patience=TIMEOUT):
        assert find_lock(Path("o")).exists()
        child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert names() == ["my.toml"]
    with claim_folder(Path("o"), overwrite=False):
        child.communicate(b"\n", timeout=TIMEOUT)
    assert child.returncode == 0


def test_a_path_that_leads_out_of_a_folder_is_refused(here):
    (here / "o" / "runs").mkdir(parents=True)
    (here / "elsewhere").mkdir()
    (here / "o" / "link").symlink_to(here / "elsewhere")
    assert resolve_inside(Path("o"), "runs", "a") == Path("o/runs/a")
    for parts in (("..",), ("runs", "..", ".."), ("",), ("link", "a"), (str(here / "elsewhere"),)):
        with pytest.raises(OutputError, match="leads out of o"):
            resolve_inside(Path("o"), *parts)


def test_only_what_processes_of_this_machine_have_left_that_are_gone_is_taken_away():
    gone, since = dead(), find_start(os.getpid())
    left = [f".o.{gone}.part", f".o.{gone}@{find_host()}.part", f".o.{os.getpid()}.part"]
    kept = [
        f".o.{os.getpid()}@{find_host()}.part",  # this one lives
        f".o.{gone}@elsewhere.part",  # nobody knows
        f".p.{gone}.part",  # another one's
        ".o.part",
        "o.1.part",
        f".o.{gone}.doc",
    ]
    for name in left + kept:
        Path("d", name).mkdir(parents=True)
    # Another process has got its number since.
    os.utime(Path("d", left[-1]), (since - 3600.0, since - 3600.0))
    remove_abandoned(Path("d"), "o")
    assert names(Path("d")) == sorted(kept)
    assert not is_unfinished(Path("a/.b.stl"))
    for kind in ("part", "old", "frames"):
        assert is_unfinished(name_unfinished(Path("a/b c.stl"), kind))


def test_a_process_is_known_by_the_time_it_was_started():
    before = time.time()
    process = start("import time; time.sleep(1000)")
    try:
        since = find_start(process.pid)
        # The system counts in hundredths of a second from when it was booted, which it knows to a
        # second.
        assert before - 2.0 <= since <= time.time() + 2.0
        assert may_have_made(process.pid, since + 1.0)
        assert not may_have_made(process.pid, since - 3600.0)
    finally:
        process.kill()
        # Although nobody has asked how it ended.
        wait_until(lambda: find_start(process.pid) is None)
        finish(process)
    assert not may_have_made(process.pid, time.time())


def test_where_a_drive_has_no_locks_a_record_is_held_instead(here):
    record = here / "record"
    hold = partial(hold_record, record, "It is held.")
    with hold(), pytest.raises(OutputError, match=r"^It is held\.$"), hold():
        pass
    assert not record.exists()
    record.write_text(f"{find_host()} {dead()}\n", encoding="utf-8")  # left by a crash
    with hold():
        assert record.read_text(encoding="utf-8").split() == [find_host(), str(os.getpid())]
    record.write_text("", encoding="utf-8")  # the disk was full, long ago
    os.utime(record, (0.0, 0.0))
    with hold():
        pass
    record.write_text("elsewhere 1\n", encoding="utf-8")
    rule = r"begun on elsewhere; if nothing runs there, remove .*record"
    with pytest.raises(OutputError, match=rule), hold():
        pass


def test_a_lock_taken_away_by_its_owner_is_made_anew():
    # Of hundreds of owners in three processes there is one at a time: a file tells who is inside.
    script = (
        "import os\n"
        "from pathlib import Path\n"
        "from digiclay.core.files.file_lock import hold_lock\n"
        "for _ in range(60):\n"
        "    with hold_lock(Path('d/lock'), 'no', 100.0):\n"
        "        os.close(os.open('inside', os.O_CREAT | os.O_EXCL))\n"
        "        os.unlink('inside')\n"
    )
    assert [finish(process)[0] for process in [start(script) for _ in range(3)]] == [0, 0, 0]
    assert names(Path("d")) == []
