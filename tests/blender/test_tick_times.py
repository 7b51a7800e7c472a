"""The benchmarks of ticks: every tick of every bed is timed, part by part, and leaves nothing."""

import csv
import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest
from digiclay.core.session import live_session
from digiclay.live import beds
from digiclay.sessions import running, sculpting

from benchmarks import tick_times
from benchmarks.__main__ import main
from benchmarks.tick_times import DEPTH, PARTS, SHARES, Bed, draw_circles, measure_bed
from tests.timeouts import TIMEOUT

ROOT = Path(__file__).parents[2]
BED = (11, 11, 3e-3, 2e-3)


def test_every_tick_is_timed_and_its_parts_are_within_it():
    before, objects = (sculpting.advance, beds.write), len(bpy.data.objects)
    timed = draw_circles(*BED, ticks=12)
    assert (sculpting.advance, beds.write, len(bpy.data.objects)) == (*before, objects)
    assert running.list_sessions() == ()
    assert timed.spent.shape == timed.elapsed.shape == (12,)
    for name in ("read", "simulate", "finger", "store", "show", "evaluate"):
        assert (timed.parts[name] > 0.0).all(), name
    # A stroke that is being formed is kept from its beginning.
    assert not timed.parts["pack"].any()
    # Garbage is collected within any of the parts.
    assert (sum(timed.parts[name] for name in PARTS if name != "garbage") <= timed.spent).all()


def test_the_finger_presses_while_ticks_are_timed(monkeypatch):
    lowest, periods = [], []
    advance = sculpting.advance

    def watched(*arguments):
        session = advance(*arguments)  # type: ignore[arg-type]
        lowest.append(float(session.state.row(0).min()))
        periods.append(session.state.period)
        return session

    monkeypatch.setattr(sculpting, "advance", watched)
    # A machine too slow for more than one period a tick.
    monkeypatch.setattr(live_session, "SHARE", 0.0)
    draw_circles(*BED, ticks=6)
    assert live_session.SHARE == 0.0
    assert min(lowest[-6:]) < 40e-3 - DEPTH / 2
    assert periods[-1] > periods[-7]


# As where a user has enabled it: everything is registered already.
@pytest.mark.usefixtures("extension")
def test_a_session_does_not_gather_memory_as_it_goes_on(monkeypatch):
    monkeypatch.setattr(tick_times, "WARM_UP", 30)
    monkeypatch.setattr(tick_times, "READINGS", 3)
    # What fits into the rings of trace and gestures is kept, and filled arrays of known widths: 61
    # kB. A leak of a state a tick were 25 times 13 kB.
    assert measure_bed(12, 12, 25)["growth_bytes"] < 200e3
    assert hasattr(bpy.types.Object, "digiclay")


def test_the_commands_print_tables_write_figures_and_draw_the_histogram(
    monkeypatch, capsys, tmp_path
):
    pytest.importorskip("matplotlib", reason="the histogram needs it; `make test` has it")
    monkeypatch.setattr(tick_times, "BEDS", (Bed(*BED, 8e-3), Bed(20, 21, 1.5e-3, 1e-3, 16e-3)))
    monkeypatch.setattr(tick_times, "VIEWPORT", ((12, 12, 5e-3), (12, 14, 5e-3)))
    for name, count in (("WARM_UP", 5), ("QUICK", 5), ("FEW", 2), ("READINGS", 1)):
        monkeypatch.setattr(tick_times, name, count)
    # Other tests go on in this process.
    monkeypatch.setattr(tick_times, "keep_to_one_core", lambda: None)
    for kind in ("ticks", "viewport"):
        assert main([kind, "--quick", "--quiet", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "11 x 11 at 3 mm, 5 ticks" in told
    assert "20 x 21 at 1.5 mm, 5 ticks" in told
    assert [line.split()[0] for line in told.splitlines()[-2:]] == ["144", "168"]
    texts = (
        (tmp_path / f"{kind}.csv").read_text(encoding="utf-8") for kind in ("ticks", "viewport")
    )
    ticks, viewport = (list(csv.DictReader(text.splitlines())) for text in texts)
    assert [row["pins"] for row in viewport] == ["144", "168"]
    assert len(ticks) == 2 * (3 + len(PARTS))
    whole = [float(ticks[0][f"share_{share:g}_s"]) for share in SHARES]
    assert ticks[0]["part"] == "whole tick"
    assert 0.0 < whole[0] <= whole[-1]
    assert (tmp_path / "ticks.png").stat().st_size > 10_000


@pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity"), reason="the system keeps no thread to a core"
)
def test_threads_that_were_started_before_are_kept_to_the_core_too():
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
    command = [sys.executable, "-c", script]
    told = subprocess.run(
        command, capture_output=True, encoding="utf-8", timeout=TIMEOUT, check=True, cwd=ROOT
    )
    assert told.stdout.splitlines()[-1].split() == ["1", "1"]  # Blender may log before
