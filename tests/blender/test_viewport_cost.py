"""What the viewport's benchmark times is a session that lives: it forms the bed and leaves nothing."""

from __future__ import annotations

import bpy
import pytest
from digiclay.sessions import running

from benchmarks import viewport_cost
from benchmarks.__main__ import main


def test_every_part_of_a_tick_is_timed_and_nothing_is_left_in_the_file() -> None:
    objects = len(bpy.data.objects)
    cost = viewport_cost.measured(12, 12, 2)
    assert set(cost.parts) == set(viewport_cost.PARTS)
    assert min(cost.parts.values()) > 0.0
    assert len(bpy.data.objects) == objects
    assert running.list_sessions() == ()


def test_a_session_does_not_gather_memory_as_it_goes_on() -> None:
    # What fits into the rings of trace and gestures is kept, and filled arrays of known widths: up to
    # 77 kB in ten runs. A leak of a state a tick were 25 times 13 kB.
    assert viewport_cost.measured(12, 12, 25).growth < 200e3


def test_the_command_prints_a_row_a_bed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewport_cost, "BEDS", ((12, 12, 5e-3), (12, 14, 5e-3)))
    monkeypatch.setattr(viewport_cost, "QUICK", 2)
    assert main(["viewport", "--quick", "--quiet"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[-2:]] == ["144", "168"]


@pytest.mark.usefixtures("extension")
def test_the_costs_are_measured_with_the_extension_enabled_too() -> None:
    # As where a user has enabled it: there everything is registered already.
    assert viewport_cost.measured(12, 12, 2).whole > 0.0
    assert hasattr(bpy.types.Object, "digiclay")
