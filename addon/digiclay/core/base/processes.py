"""Processes of this machine: identity and life."""

from __future__ import annotations

import ctypes
import os
import platform
import re
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

#: Clocks of a machine and of the drive it writes to differ by less than this, s.
CLOCKS_DIFFER = 60.0
#: Seconds from 1601, where Windows begins to count, to 1970.
WINDOWS_EPOCH = 11_644_473_600.0


def find_host() -> str:
    """Return the name of this machine, as it may stand in the name of a file."""
    return re.sub(r"[^A-Za-z0-9_-]", "-", platform.node())[:32] or "unknown"


def may_have_made(pid: int, changed: float) -> bool:
    """Return whether a process of this machine may be the one that made a file or folder.

    Numbers of processes are used again: one that was started after the last change is another one.

    `pid`: the number of the process that made it; `changed`: when it was changed last, s since 1970.
    """
    since = find_start(pid)
    return since is not None and since <= changed + CLOCKS_DIFFER


def find_start(pid: int) -> float | None:
    """Return when a process was started, s since 1970; None when none of this number runs.

    Where the system does not tell when, it is 0.
    """
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
    except (OSError, OverflowError):  # it runs, and belongs to somebody else
        pass
    return _ask_ps(pid)


def _find_start_in_linux(pid: int) -> float | None:
    """Return when a process was started, from /proc."""
    try:
        told = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        booted = re.search(r"^btime (\d+)$", Path("/proc/stat").read_text(encoding="ascii"), re.MULTILINE)
    except OSError:
        return None
    state, *fields = told.rpartition(")")[2].split()  # the command's name may hold blanks and brackets
    if state in "ZX":  # it has ended, and nobody has asked how
        return None
    return int(booted[1]) + int(fields[18]) / os.sysconf("SC_CLK_TCK") if booted else 0.0


def _ask_ps(pid: int) -> float | None:
    """Return when a process was started, from ps; macOS has no /proc."""
    with suppress(OSError, ValueError, subprocess.SubprocessError):
        told = subprocess.run(
            ["ps", "-o", "lstart=", "-p", str(pid)], capture_output=True, text=True, timeout=10.0,
            env={**os.environ, "LC_ALL": "C"}, check=False,
        ).stdout.strip()  # fmt: skip
        return time.mktime(time.strptime(told, "%a %b %d %H:%M:%S %Y")) if told else None
    return 0.0


def _find_start_in_windows(pid: int) -> float | None:
    """Return when a process was started; ``os.kill`` would end it there."""
    system: Any = ctypes
    kernel = system.WinDLL("kernel32", use_last_error=True)
    kernel.OpenProcess.restype = system.c_void_p
    handle = kernel.OpenProcess(0x1000, False, pid)  # PROCESS_QUERY_LIMITED_INFORMATION
    if not handle:
        return 0.0 if system.get_last_error() == 5 else None  # access denied: it runs
    try:
        owned, code = system.c_void_p(handle), system.c_ulong()
        times = [system.c_ulonglong() for _ in range(4)]
        if kernel.GetExitCodeProcess(owned, system.byref(code)) and code.value != 259:  # STILL_ACTIVE
            return None
        if not kernel.GetProcessTimes(owned, *(system.byref(one) for one in times)):
            return 0.0
        return float(times[0].value) * 1e-7 - WINDOWS_EPOCH
    finally:
        kernel.CloseHandle(system.c_void_p(handle))
