"""Run of one part of the tests under a time limit, evaluated by its output.

A part has passed when pytest ended with status 0 and at least one test passed: nothing
collected, everything skipped, a crash or a hang after the summary are all failures. Its
summary line goes to the report file, which the caller prints with the verdicts.
"""

import argparse
import contextlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from types import FrameType

SUMMARY = re.compile(r"^=*\s*((?:no tests ran|\d+ \w+).* in [\d.]+s.*?)\s*=*$")


def run(command: list[str], limit: float) -> tuple[int | None, str]:
    """Run `command`, passing its output on; return its status (None: stopped at the limit) and summary."""
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
        start_new_session=True,
    )  # fmt: skip
    late, summary = False, ""

    def end() -> None:
        # The whole session goes, so that no Blender started by a test outlives it.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal late
        late = True
        end()

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        assert process.stdout is not None
        for line in process.stdout:
            print(line, end="", flush=True)
            match = SUMMARY.match(line.rstrip())
            summary = match[1] if match else summary
        status = process.wait()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        end()
    return (None if late else status), summary


def judge(status: int | None, summary: str, limit: float, whole: bool) -> str:
    """Return why the part failed, or ``""``."""
    if status is None:
        return f"stopped at the time limit of {limit:g} s"
    if status < 0 or status >= 128:
        number = -status if status < 0 else status - 128
        return f"ended by {signal.Signals(number).name}" + (" after its summary" if summary else "")
    if not re.search(r"\b[1-9]\d* passed\b", summary):
        return "no test passed"
    if whole and re.search(r"\b[1-9]\d* skipped\b", summary):
        return "tests were skipped"
    return f"status {status}" if status else ""


def main() -> int:
    """Run the part named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("report", type=Path, help="file the summary line is appended to")
    parser.add_argument("name", help="what the part is called there")
    parser.add_argument("limit", type=float, help="time limit, s")
    parser.add_argument("--whole", action="store_true", help="a test that is skipped is a failure")
    parser.add_argument("pytest", nargs="+", help="arguments of pytest (after --)")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    command = [sys.executable, "-m", "pytest", *arguments.pytest]
    status, summary = run(command, arguments.limit)
    reason = judge(status, summary, arguments.limit, arguments.whole)
    verdict = f"FAILED ({reason})" if reason else "passed"
    spent = os.times()
    processor = f"{spent.children_user + spent.children_system:.0f} s of processor time"
    line = f"{arguments.name}: {verdict}" + (f": {summary}" if summary else "") + f"; {processor}"
    arguments.report.parent.mkdir(exist_ok=True)
    with arguments.report.open("a", encoding="utf-8") as report:
        report.write(line + "\n")
    print(line, flush=True)
    return 1 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
