"""Locks, the processes that hold them, and what those leave behind that are gone."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.files.file_lock import find_host, find_start, hold_lock, hold_record, may_have_made
from digiclay.core.files.run_folder import is_unfinished, name_unfinished, remove_abandoned

from tests.other_process import dead, finish, start
from tests.timeouts import TIMEOUT, wait_until

pytestmark = pytest.mark.usefixtures("here")


def names(folder: Path = Path()) -> list[str]:
    """Return what lies in a folder, hidden things too."""
    return sorted(path.name for path in folder.iterdir())


def test_only_what_processes_of_this_machine_have_left_that_are_gone_is_taken_away() -> None:
    gone, since = dead(), find_start(os.getpid())
    left = [f".o.{gone}.part", f".o.{gone}@{find_host()}.part", f".o.{os.getpid()}.part"]
    kept = [
        f".o.{os.getpid()}@{find_host()}.part",  # this one lives
        f".o.{gone}@elsewhere.part",  # nobody knows
        f".p.{gone}.part",  # another one's
        ".o.part", "o.1.part", f".o.{gone}.doc",
    ]  # fmt: skip
    for name in left + kept:
        Path("d", name).mkdir(parents=True)
    assert since is not None
    os.utime(
        Path("d", left[-1]), (since - 3600.0, since - 3600.0)
    )  # another process has got its number since
    remove_abandoned(Path("d"), "o")
    assert names(Path("d")) == sorted(kept)
    assert not is_unfinished(Path("a/.b.stl"))
    for kind in ("part", "old", "frames"):
        assert is_unfinished(name_unfinished(Path("a/b c.stl"), kind))


def test_a_process_is_known_by_the_time_it_was_started() -> None:
    before = time.time()
    process = start("import time; time.sleep(1000)")
    try:
        since = find_start(process.pid)
        assert since is not None
        # The system counts in hundredths of a second from when it was booted, which it knows to a second.
        assert before - 2.0 <= since <= time.time() + 2.0
        assert may_have_made(process.pid, since + 1.0)
        assert not may_have_made(process.pid, since - 3600.0)
    finally:
        process.kill()
        wait_until(lambda: find_start(process.pid) is None)  # although nobody has asked how it ended
        finish(process)
    assert not may_have_made(process.pid, time.time())


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
    other = start(script)
    assert other.stdout.readline() == "here\n"
    with pytest.raises(OutputError, match="taken"), hold_lock(Path("lock"), "taken"):
        pass
    other.send_signal(signal.SIGKILL)
    other.communicate(timeout=TIMEOUT)
    assert Path("lock").exists()
    with hold_lock(Path("lock"), "taken"):
        pass
    assert not Path("lock").exists()
