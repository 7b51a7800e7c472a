"""Locks, the processes that hold them, and what those leave behind that are gone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.files.file_lock import find_host, find_start, hold_lock, hold_record, may_have_made
from digiclay.core.files.run_folder import is_unfinished, name_unfinished, remove_abandoned

from tests.other_process import dead
from tests.timeouts import TIMEOUT, wait_until

ADDON = Path(__file__).parents[2] / "addon"


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def names(folder: Path = Path()) -> list[str]:
    """Return what lies in a folder, hidden things too."""
    return sorted(path.name for path in folder.iterdir())


def test_only_what_processes_of_this_machine_have_left_that_are_gone_is_taken_away() -> None:
    gone = dead()
    left = [f".o.{gone}.part", f".o.{gone}@{find_host()}.part"]
    kept = [
        f".o.{os.getpid()}@{find_host()}.part",  # this one lives
        f".o.{gone}@elsewhere.part",  # nobody knows
        f".p.{gone}.part",  # another one's
        ".o.part", "o.1.part", f".o.{gone}.doc",
    ]  # fmt: skip
    for name in left + kept:
        Path("d", name).mkdir(parents=True)
    remove_abandoned(Path("d"), "o")
    assert names(Path("d")) == sorted(kept)


def test_a_number_that_another_process_has_got_since_counts_as_gone() -> None:
    path = Path(f".o.{os.getpid()}.part")
    path.mkdir()
    since = find_start(os.getpid())
    assert since is not None
    os.utime(path, (since - 3600.0, since - 3600.0))  # before this process was started
    remove_abandoned(Path(), "o")
    assert not path.exists()


def test_a_process_is_known_by_the_time_it_was_started() -> None:
    before = time.time()
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"])
    try:
        since = find_start(process.pid)
        assert since is not None
        # The system counts in hundredths of a second from when it was booted, which it knows to a second.
        assert before - 2.0 <= since <= time.time() + 2.0
        assert may_have_made(process.pid, since + 1.0)
        assert not may_have_made(process.pid, since - 3600.0)
    finally:
        process.kill()
        process.wait(TIMEOUT)
    assert find_start(process.pid) is None
    assert not may_have_made(process.pid, time.time())


def test_a_process_that_nobody_has_asked_how_it_ended_is_gone() -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    wait_until(lambda: find_start(process.pid) is None)
    process.wait(TIMEOUT)


def test_where_a_drive_has_no_locks_a_record_is_held_instead(here: Path) -> None:
    record = here / "record"
    with (
        hold_record(record, "It is held."),
        pytest.raises(OutputError, match=r"^It is held\.$"),
        hold_record(record, "It is held."),
    ):
        pass
    assert not record.exists()
    record.write_text(f"{find_host()} {dead()}\n", encoding="utf-8")  # left by a crash
    with hold_record(record, "It is held."):
        assert record.read_text(encoding="utf-8").split() == [find_host(), str(os.getpid())]
    record.write_text("", encoding="utf-8")  # the disk was full, long ago
    os.utime(record, (0.0, 0.0))
    with hold_record(record, "It is held."):
        pass
    record.write_text("elsewhere 1\n", encoding="utf-8")
    with (
        pytest.raises(OutputError, match=r"begun on elsewhere; if nothing runs there, remove .*record"),
        hold_record(record, "It is held."),
    ):
        pass


def test_a_lock_taken_away_by_its_owner_is_made_anew() -> None:
    # Of hundreds of owners in four processes there is one at a time: a file tells who is inside.
    script = (
        "import os\n"
        "from pathlib import Path\n"
        "from digiclay.core.files.file_lock import hold_lock\n"
        "for _ in range(60):\n"
        "    with hold_lock(Path('d/lock'), 'no', 100.0):\n"
        "        os.close(os.open('inside', os.O_CREAT | os.O_EXCL))\n"
        "        os.unlink('inside')\n"
    )
    several = [
        subprocess.Popen([sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": str(ADDON)})
        for _ in range(3)
    ]
    assert [process.wait(TIMEOUT) for process in several] == [0, 0, 0]
    assert names(Path("d")) == []


def test_what_is_unfinished_is_known_by_its_name() -> None:
    for kind in ("part", "old", "frames"):
        assert is_unfinished(name_unfinished(Path("a/b c.stl"), kind))
    assert not is_unfinished(Path("a/.b.stl"))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_lock_is_free_as_soon_as_its_process_is_killed() -> None:
    script = (
        "import sys\n"
        "from pathlib import Path\n"
        "from digiclay.core.files.file_lock import hold_lock\n"
        "with hold_lock(Path('lock'), 'no'):\n"
        "    print('here', flush=True)\n"
        "    sys.stdin.readline()\n"
    )
    other = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ADDON)},
    )  # fmt: skip
    assert other.stdout is not None
    assert other.stdout.readline() == "here\n"
    with pytest.raises(OutputError, match="taken"), hold_lock(Path("lock"), "taken"):
        pass
    other.send_signal(signal.SIGKILL)
    other.communicate(timeout=TIMEOUT)
    assert Path("lock").exists()
    with hold_lock(Path("lock"), "taken"):
        pass
    assert not Path("lock").exists()
