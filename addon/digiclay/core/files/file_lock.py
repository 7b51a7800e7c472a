"""File lock of one process, which ends with the process; test whether a process has ended."""

import ctypes
import errno
import importlib
import os
import platform
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from ..base.errors import BusyError

#: Largest difference of the clocks of a machine and of its drive, s.
CLOCKS_DIFFER = 60.0
#: Seconds from 1601, the epoch of Windows, to 1970.
WINDOWS_EPOCH = 11_644_473_600.0


def find_host() -> str:
    """Return the name of this machine in a form for names of files."""
    return re.sub(r"[^A-Za-z0-9_-]", "-", platform.node())[:32] or "unknown"


def may_have_made(pid: int, changed: float) -> bool:
    """Return whether a process of this machine may have made a file last changed at a time, s since 1970."""
    # Process numbers are reused: a process that started after the last change is another one.
    since = find_start(pid)
    return since is not None and since <= changed + CLOCKS_DIFFER


def find_start(pid: int) -> float | None:
    """Return the start time of a process, s since 1970; 0 if unknown, None if it does not run."""
    if pid <= 0:
        return None
    if os.name == "nt":
        return _find_start_in_windows(pid)
    if Path("/proc/self/stat").exists():
        return _find_start_in_linux(pid)
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return None
    except (OSError, OverflowError):  # it runs as another user
        pass
    return _ask_ps(pid)


def _find_start_in_linux(pid: int) -> float | None:
    """Return the start time of a process from /proc."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        booted = re.search(
            r"^btime (\d+)$", Path("/proc/stat").read_text(encoding="ascii"), re.MULTILINE
        )
    except OSError:
        return None
    # The command's name may have blanks and brackets.
    state, *fields = status.rpartition(")")[2].split()
    if state in "ZX":  # it has ended, and its parent has not read its status
        return None
    return int(booted[1]) + int(fields[18]) / os.sysconf("SC_CLK_TCK") if booted else 0.0


def _ask_ps(pid: int) -> float | None:
    """Return the start time of a process from ps, on macOS, which has no /proc."""
    import subprocess

    command, plain = ["ps", "-o", "lstart=", "-p", str(pid)], os.environ | {"LC_ALL": "C"}
    with suppress(OSError, ValueError, subprocess.SubprocessError):
        done = subprocess.run(command, capture_output=True, text=True, timeout=10.0, env=plain)
        answer = done.stdout.strip()
        return time.mktime(time.strptime(answer, "%a %b %d %H:%M:%S %Y")) if answer else None
    return 0.0


def _find_start_in_windows(pid: int) -> float | None:
    """Return the start time of a process in Windows, where ``os.kill`` would end it."""
    system: Any = ctypes
    kernel = system.WinDLL("kernel32", use_last_error=True)
    kernel.OpenProcess.restype = system.c_void_p
    handle = kernel.OpenProcess(0x1000, False, pid)  # PROCESS_QUERY_LIMITED_INFORMATION
    if not handle:
        return 0.0 if system.get_last_error() == 5 else None  # access denied: it runs
    try:
        owned, code = system.c_void_p(handle), system.c_ulong()
        times = [system.c_ulonglong() for _ in range(4)]
        if kernel.GetExitCodeProcess(owned, system.byref(code)) and code.value != 259:
            # Any other code than STILL_ACTIVE: the process has ended.
            return None
        if not kernel.GetProcessTimes(owned, *map(system.byref, times)):
            return 0.0
        return float(times[0].value) * 1e-7 - WINDOWS_EPOCH
    finally:
        kernel.CloseHandle(system.c_void_p(handle))


#: Seconds between two attempts.
PAUSE = 0.05
#: Attempts to make a file in a folder that has just been removed: beyond, it takes no files, as
#: /proc.
MOST_MISSED = 100
#: A record without a name that is older than this is abandoned, s; a newer one is being written.
BEING_WRITTEN = 10.0
#: Errors of a drive without locks, such as some network drives.
NO_LOCK_NAMES = ("ENOLCK", "ENOTSUP", "EOPNOTSUPP", "ENOSYS", "EINVAL")
NO_LOCKS = {getattr(errno, name, None) for name in NO_LOCK_NAMES} - {None}

Taken = TypeVar("Taken")


class NoLocksHere(Exception):
    """Drive without locks."""


@contextmanager
def hold_lock(path: Path, refusal: str, patience: float = 0.0) -> Iterator[None]:
    """Hold a lock file, waiting `patience` s; BusyError with `refusal` when another process holds it."""
    # A lock of the system ends with a crash, and no child process inherits it.
    try:
        taken = _wait_for(lambda: _take(path), patience)
    except NoLocksHere:
        with hold_record(path.with_name(f"{path.name}.owner"), refusal, patience):
            yield
        return
    if taken is None:
        raise BusyError(refusal)
    try:
        yield
    finally:
        if os.name == "nt":
            # Windows cannot remove an open file; one that another process waits for remains.
            os.close(taken)
        with suppress(OSError):
            path.unlink()
        if os.name != "nt":
            os.close(taken)


def _wait_for(attempt: Callable[[], Taken | None], patience: float) -> Taken | None:
    """Return the first result of repeated attempts within `patience` s, or None."""
    deadline = time.monotonic() + patience
    while (taken := attempt()) is None and time.monotonic() < deadline:
        time.sleep(PAUSE)
    return taken


def _take(path: Path) -> int | None:
    """Open and lock a file; None when another process holds it."""
    missed = 0
    while True:
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
        try:
            file = os.open(path, flags, 0o666)
        except FileNotFoundError:  # another process has just removed the folder
            path.parent.mkdir(parents=True, exist_ok=True)
            missed += 1
            if missed > MOST_MISSED:
                raise
            continue
        try:
            if not _lock(file):
                os.close(file)
                return None
            if _is_at(file, path):
                return file
        except BaseException:
            os.close(file)
            raise
        # It was removed between opening and locking: the next attempt makes another file.
        os.close(file)


def _lock(file: int) -> bool:
    """Take the system's lock on an open file; return whether it was acquired."""
    if os.name == "nt":
        windows: Any = importlib.import_module("msvcrt")
        try:
            windows.locking(file, windows.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    unix: Any = importlib.import_module("fcntl")
    try:
        unix.flock(file, unix.LOCK_EX | unix.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno in NO_LOCKS:
            raise NoLocksHere from None
        raise
    return True


def _is_at(file: int, path: Path) -> bool:
    """Return whether an open file is the one of this name."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(path))
    except FileNotFoundError:
        return False


@contextmanager
def hold_record(path: Path, refusal: str, patience: float = 0.0) -> Iterator[None]:
    """Hold a file that names this process and machine; replaces one whose process has ended."""
    if _wait_for(lambda: _record(path), patience) is None:
        owner = _read_owner(path)
        if owner is not None and owner[0] != find_host():
            # After a crash of another machine its file has to be removed by hand.
            refusal += f" It was begun on {owner[0]}; if nothing runs there, remove {path}."
        raise BusyError(refusal)
    try:
        yield
    finally:
        with suppress(OSError):
            path.unlink()


def _record(path: Path) -> bool | None:
    """Make the record; None if there is one of a process that may still run."""
    try:
        changed, owner = path.stat().st_mtime, _read_owner(path)
        if owner is None:
            gone = time.time() - changed > BEING_WRITTEN
        else:
            gone = owner[0] == find_host() and not may_have_made(owner[1], changed)
        if not gone:
            return None
        path.unlink()
    except FileNotFoundError:
        path.parent.mkdir(parents=True, exist_ok=True)
    try:
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    except FileExistsError:
        return None
    try:
        os.write(file, f"{find_host()} {os.getpid()}\n".encode())
    except BaseException:
        with suppress(OSError):
            path.unlink()
        raise
    finally:
        os.close(file)
    return True


def _read_owner(path: Path) -> tuple[str, int] | None:
    """Return the machine and the process of a record, or None."""
    try:
        machine, pid = path.read_text(encoding="utf-8").split()
        return machine, int(pid)
    except (OSError, ValueError):
        return None
