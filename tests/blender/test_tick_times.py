"""The benchmark of ticks: every tick of every bed is timed, part by part."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from pathlib import Path

import pytest
from digiclay.core.session import live_session
from digiclay.live import bed_state
from digiclay.sessions import running, sculpting

from benchmarks import tick_times
from benchmarks.__main__ import main
from benchmarks.tick_times import DEPTH, PARTS, RATE, SHARES, time_ticks
from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]


def test_every_tick_is_timed_and_its_parts_are_within_it() -> None:
    before = sculpting.advance, bed_state.write
    found = time_ticks(11, 11, 3e-3, 2e-3, ticks=12)
    assert (sculpting.advance, bed_state.write) == before
    assert running.list_sessions() == ()
    assert found.spent.shape == found.elapsed.shape == (12,)
    assert tuple(found.parts) == PARTS
    for name in ("read", "simulate", "pack", "finger", "store", "show", "evaluate"):
        assert (found.parts[name] > 0.0).all(), name
    # Garbage is collected within any of the parts.
    inside = sum(found.parts[name] for name in PARTS if name != "garbage")
    assert (inside <= found.spent).all()


def test_the_finger_presses_while_ticks_are_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    lowest, periods = [], []
    advance = sculpting.advance

    def watched(*arguments: object) -> running.Running:
        session = advance(*arguments)  # type: ignore[arg-type]
        lowest.append(float(session.state.row(0).min()))
        periods.append(session.state.period)
        return session

    monkeypatch.setattr(sculpting, "advance", watched)
    monkeypatch.setattr(live_session, "SHARE", 0.0)  # a machine too slow for more than one period a tick
    time_ticks(11, 11, 3e-3, 2e-3, ticks=6)
    assert live_session.SHARE == 0.0
    assert min(lowest[-6:]) < 40e-3 - DEPTH / 2
    assert periods[-1] - periods[-7] == 6 / RATE / 5e-3


def test_the_command_prints_a_table_a_bed_and_draws_the_histogram(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib", reason="the histogram needs it; `make test` has it")
    monkeypatch.setattr(tick_times, "BEDS", ((11, 11, 3e-3, 2e-3, 8e-3), (20, 21, 1.5e-3, 1e-3, 16e-3)))
    monkeypatch.setattr(tick_times, "QUICK", 5)
    monkeypatch.setattr(tick_times, "keep_to_one_core", lambda: None)  # other tests go on in this process
    assert main(["ticks", "--quick", "--quiet", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "11 x 11 at 3 mm, 5 ticks" in told
    assert "20 x 21 at 1.5 mm, 5 ticks" in told
    with (tmp_path / "ticks.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * (3 + len(PARTS))
    whole = [float(rows[0][f"share_{share:g}_s"]) for share in SHARES]
    assert rows[0]["part"] == "whole tick"
    assert 0.0 < whole[0] <= whole[-1]
    assert (tmp_path / "ticks.png").stat().st_size > 10_000


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system keeps no thread to a core")
def test_threads_that_were_started_before_are_kept_to_the_core_too() -> None:
    script = (
        "import os, threading\n"
        "from benchmarks.tick_times import keep_to_one_core\n"
        "over = threading.Event()\n"
        "thread = threading.Thread(target=over.wait)\n"
        "thread.start()\n"
        "keep_to_one_core()\n"
        "print(*(len(os.sched_getaffinity(each)) for each in (0, thread.native_id)))\n"
        "over.set()\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=TIMEOUT, check=True,
        cwd=ROOT,
    ).stdout  # fmt: skip
    assert told.splitlines()[-1].split() == ["1", "1"]  # Blender may log before
