"""Run of one part of the tests under a time limit, evaluated by its results.

A part has passed when pytest ended with status 0 and at least one test passed: nothing collected,
everything skipped, a crash or a hang after the results are all failures. A line about it goes to
the report file, which the caller prints.
"""

import argparse
import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree


def run(command: list[str], limit: float) -> int | None:
    """Run `command`; return its status, None where it was stopped at the limit, s."""
    process = subprocess.Popen(command, start_new_session=True)
    try:
        return process.wait(limit)
    except subprocess.TimeoutExpired:
        return None
    finally:
        # The whole session goes, so that no Blender started by a test outlives it.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def count(results: Path) -> tuple[int, int]:
    """Return how many tests passed and were skipped, by pytest's own file; none where there is none."""
    if not results.exists():
        return 0, 0
    suite = ElementTree.parse(results).getroot()[0].attrib
    total, failed, wrong, skipped = (
        int(suite[key]) for key in ("tests", "failures", "errors", "skipped")
    )
    return total - failed - wrong - skipped, skipped


def judge(status: int | None, passed: int, skipped: int, arguments: argparse.Namespace) -> str:
    """Return why the part failed, or ``""``."""
    if status is None:
        return f"stopped at the time limit of {arguments.limit:g} s"
    if status < 0:
        return f"ended by {signal.Signals(-status).name}"
    if not passed:
        return "no test passed"
    if arguments.whole and skipped:
        return "tests were skipped"
    return f"status {status}" if status else ""


def main() -> int:
    """Run the part named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("report", type=Path, help="file the line is appended to")
    parser.add_argument("name", help="what the part is called there")
    parser.add_argument("limit", type=float, help="time limit, s")
    parser.add_argument("--whole", action="store_true", help="a test that is skipped is a failure")
    parser.add_argument("pytest", nargs="+", help="arguments of pytest (after --)")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    results: Path = arguments.report.with_suffix(".xml")
    results.unlink(missing_ok=True)
    status = run(
        [sys.executable, "-m", "pytest", f"--junitxml={results}", *arguments.pytest],
        arguments.limit,
    )
    passed, skipped = count(results)
    reason = judge(status, passed, skipped, arguments)
    verdict, spent = f"FAILED ({reason})" if reason else "passed", os.times()
    processor = f"{spent.children_user + spent.children_system:.0f} s of processor time"
    line = f"{arguments.name}: {verdict}: {passed} passed, {skipped} skipped; {processor}"
    arguments.report.parent.mkdir(exist_ok=True)
    with arguments.report.open("a", encoding="utf-8") as report:
        report.write(f"{line}\n")
    print(line, flush=True)
    return 1 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
