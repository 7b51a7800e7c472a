"""What the buttons of the Takes panel do, in the background: record, keep, replay, bake, export, remove."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.model.control_interface import SetPoint
from digiclay.core.scene.scene_source import load
from digiclay.device import view
from digiclay.live import beds, tick
from digiclay.recorded import bake, takes
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from numpy.typing import NDArray

from tests.blender.at_hand import new_bed

pytestmark = pytest.mark.usefixtures("extension")
#: Time between two ticks, s: a session follows ten control periods in each.
TICK = 0.05


@pytest.fixture
def bed() -> Any:
    """Return a bed added as a user adds it, active, in a file that plays 40 frames a second."""
    made = new_bed(rows=12, columns=12)
    bpy.context.scene.render.fps = 40
    return made


def begin(bed: Any) -> None:
    """Start a session without a window's loop."""
    tick.start(bpy.context, bed)


def press(bed: Any, ticks: int = 12, *, deep: float = 8e-3) -> None:
    """Let a session live while the finger goes down from 2 mm above the pins."""
    tip = fingertip_of(bed)
    top = bridge.read_cells(bed.data)["height"].max() * bridge.SCALE
    reach = bridge.pose(tip)[2] * bridge.SCALE - tip.location.z
    for count in range(ticks + 1):
        tip.location.z = top - reach + (2e-3 - deep * count / ticks) * bridge.SCALE
        bpy.context.view_layer.update()
        tick.tick(bpy.context, 100.0 + TICK * count)


def heights(bed: Any) -> NDArray[np.float64]:
    """Return the heights drawn."""
    return bridge.read_cells(bed.data)["height"]


def record(bed: Any) -> str:
    """Record a press and keep it; return the take's number. The session is stopped."""
    begin(bed)
    bpy.ops.digiclay.take_record()
    press(bed)
    assert bpy.ops.digiclay.take_keep(name="A press") == {"FINISHED"}
    tick.stop(bed.session_uid)
    return takes.list_takes(bed)[-1].number


def test_a_replay_in_another_state_ends_bit_for_bit_as_the_take_did(bed: Any) -> None:
    number = record(bed)
    kept, drawn = beds.read_snapshot(bed), heights(bed)
    begin(bed)
    press(bed, deep=11e-3)
    tick.stop(bed.session_uid)
    assert beds.read_snapshot(bed) != kept
    assert bpy.ops.digiclay.take_replay(take=number) == {"FINISHED"}
    assert beds.read_snapshot(bed) == kept == takes.read(bed, number).end
    assert np.array_equal(heights(bed), drawn)
    begin(bed)  # it goes on from there
    assert running.find(bed).state.period == takes.read(bed, number).periods
    tick.stop(bed.session_uid)
    # Finer steps end near, but not at, the same heights: steps of 5 ms leave some µm.
    assert bpy.ops.digiclay.take_replay(take=number, parts=8) == {"FINISHED"}
    assert 0.0 < np.abs(heights(bed) - drawn).max() < 20e-6


def test_a_baked_take_shows_its_end_at_its_last_frame_and_starts_no_session(bed: Any) -> None:
    record(bed)
    drawn = heights(bed)
    assert bpy.ops.digiclay.bake(source="TAKE", first=10) == {"FINISHED"}
    bpy.context.scene.frame_set(10 + 24)  # 0.6 s at 40 frames a second
    next(one for one in bed.modifiers if one.name == view.MODIFIER).show_viewport = False
    bpy.context.view_layer.update()
    mesh = bed.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert np.abs(bridge.read_cells(mesh)["height"] - drawn).max() < 1e-7  # float32
    with pytest.raises(Exception, match="free the bake"):
        begin(bed)


def test_an_animated_fingertip_bakes_in_the_background_without_a_session(bed: Any) -> None:
    tip = fingertip_of(bed)
    for frame, down in ((1, 0.0), (21, 14e-3)):
        tip.location.z -= down * bridge.SCALE
        tip.keyframe_insert("location", frame=frame)
    curves = len([curve for group in bake.curves(tip) for curve in group])
    assert bpy.ops.digiclay.bake(source="FINGERTIP", first=1, last=41) == {"FINISHED"}
    assert bake.is_baked(bed)
    assert len([curve for group in bake.curves(tip) for curve in group]) == curves  # its own animation stays
    bpy.context.scene.frame_set(21)
    mesh = bed.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert mesh is not None
    assert bpy.ops.digiclay.bake_free() == {"FINISHED"}
    assert not bake.is_baked(bed)


def test_an_exported_take_is_a_scene_that_runs_as_long(bed: Any, tmp_path: Path) -> None:
    number = record(bed)
    begin(bed)
    bpy.ops.digiclay.take_record()  # meanwhile a session may record
    press(bed, deep=12e-3)
    file = tmp_path / "ein Täke 1.5.toml"
    # What follows the point of a number is no ending.
    assert bpy.ops.digiclay.take_export(filepath=str(file).removesuffix(".toml")) == {"FINISHED"}
    scene = load(file)
    assert scene.name == "A press"
    assert scene.simulation.duration == pytest.approx(0.6)
    assert scene.cells == 144
    assert len(running.find(bed).recording.path) > 1
    tick.stop(bed.session_uid)
    assert bpy.ops.digiclay.take_remove(take=number) == {"FINISHED"}
    assert number not in [entry.number for entry in takes.list_takes(bed)]


def test_a_take_from_a_formed_bed_is_not_exported_and_the_file_is_not_made(bed: Any, tmp_path: Path) -> None:
    record(bed)
    record(bed)
    file = tmp_path / "late.toml"
    with pytest.raises(RuntimeError, match="begins on a bed that is formed already"):
        bpy.ops.digiclay.take_export(filepath=str(file))
    assert not file.exists()


def test_keeping_a_take_of_nothing_says_so(bed: Any) -> None:
    begin(bed)
    bpy.ops.digiclay.take_record()
    assert bpy.ops.digiclay.take_keep() == {"CANCELLED"}
    assert running.find(bed).recording is None
    tick.stop(bed.session_uid)


def test_a_changed_parameter_ends_the_recording_and_keeps_it_as_a_take_of_the_former_scene(bed: Any) -> None:
    begin(bed)
    bpy.ops.digiclay.take_record()
    press(bed)
    bed.digiclay.control.virtual_master.force_setpoint = 0.8
    (note,) = tick.tick(bpy.context, 101.0)
    assert "The recording ended and was kept as Take 1" in note.message
    (entry,) = takes.list_takes(bed)
    assert takes.read(bed, entry.number).scene.set_point == SetPoint(0.4)
    assert running.find(bed).recording is None
    tick.stop(bed.session_uid)
    assert bpy.ops.digiclay.take_replay() == {"FINISHED"}


def test_a_reset_keeps_what_was_recorded(bed: Any) -> None:
    begin(bed)
    bpy.ops.digiclay.take_record()
    press(bed)
    assert bpy.ops.digiclay.session_reset() == {"FINISHED"}
    assert [one.seconds for one in takes.list_takes(bed)] == [pytest.approx(0.6)]
    assert running.find(bed).recording is None
    tick.stop(bed.session_uid)
