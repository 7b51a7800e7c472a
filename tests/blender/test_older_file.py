"""A file saved before the modules were moved and renamed opens, and its beds go on as they did then."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import load
from digiclay.core.session import snapshot
from digiclay.device import view
from digiclay.device.node_tree import TOP_FORCE
from digiclay.exchange import formed_bed
from digiclay.live import beds, tick
from digiclay.recorded import takes
from digiclay.roles import fingertip_of
from digiclay.sessions import running
from digiclay.settings import properties

from tests.assemble import assert_near
from tests.blender.at_hand import activate
from tests.blender.session.live import FLOAT32, Clock, exact, press, shown

pytestmark = pytest.mark.usefixtures("extension")
SAMPLES = Path(__file__).parents[1] / "samples" / "blend"
#: A sum in another order, or another numpy, moves a pin by a few units of the last place of 40 mm;
#: m.
ROUNDING = 1e-12
HEIGHTS = dict(np.load(SAMPLES / "heights.npz"))


@pytest.fixture(autouse=True)
def older_file(extension):
    """Open the file that was saved by Blender 4.2 with the code of 22 November 2026."""
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLES / "beds.blend"))


def bed(name):
    found = bpy.data.objects[name]
    activate(found)
    return found


def go_on(name, x):
    """Start a session of a bed, press once more at x, mm, and stop."""
    found, clock = bed(name), Clock()
    assert tick.start(bpy.context, found) == []
    clock.tick()
    press(found, clock, x, pressed=8, lifted=20)
    tick.stop(found.session_uid)


@pytest.mark.parametrize("name, stored", [("Session", "session"), ("Settings", "settings")])
def test_the_kept_state_has_the_stored_heights_and_is_what_is_drawn(name, stored):
    np.testing.assert_array_equal(exact(bed(name)), HEIGHTS[stored])
    assert_near(shown(bed(name)), HEIGHTS[stored], FLOAT32)


@pytest.mark.parametrize("name, x", [("Session", 4.0), ("Settings", 0.0)])
def test_the_session_goes_on_to_the_stored_heights(name, x):
    go_on(name, x)
    stored = HEIGHTS[f"{name.lower()}_later"]
    assert np.abs(stored - HEIGHTS[name.lower()]).max() > 1e-4  # the press forms something
    # The finger's place comes from Blender's 32 bits, which its versions round differently.
    assert_near(exact(bed(name)), stored, FLOAT32)


def test_an_older_bed_is_colored_by_force_under_the_former_names():
    found = bed("Session")
    shown_as = found.digiclay_display
    shown_as.color, shown_as.top_force = "force", 0.5
    assert (shown_as.color, view.read_setting(found, TOP_FORCE, 0.0)) == ("force", 0.5)
    shown_as.color = "neutral"  # which these have not
    assert shown_as.color == "force"
    names = set(found.modifiers["Pins"].node_group.interface.items_tree.keys())
    assert {"Colour by Force", "Top Colour at (N)"} <= names


def test_the_take_replays_to_the_stored_heights():
    found = bed("Session")
    first, second = takes.list_takes(found)
    # The second was recorded when it was saved.
    assert (first.name, second.name) == (
        "A press",
        "Take 2",
    )
    take = takes.read(found, first.number)
    system = assemble(take.scene)
    np.testing.assert_array_equal(snapshot.load(system, take.start).row(0), HEIGHTS["take_start"])
    np.testing.assert_array_equal(snapshot.load(system, take.end).row(0), HEIGHTS["take_end"])
    assert bpy.ops.digiclay.take_replay(take=first.number) == {"FINISHED"}
    assert_near(exact(found), HEIGHTS["take_end"], ROUNDING)


def test_a_session_resets_and_goes_back_from_the_older_state_with_its_fingertip():
    found = bed("Session")
    pose = bridge.pose(fingertip_of(found))
    assert_near(pose, beds.read_poses(found)[0], 1e-6)  # Blender's 32 bits
    assert bpy.ops.digiclay.session_reset() == {"FINISHED"}
    assert beds.read_snapshot(found) is None
    assert (exact(found) == 40e-3).all()
    assert running.list_sessions() == ()


def test_settings_and_features_of_the_user_s_own_are_those_of_the_scene_file():
    found = bed("Settings")
    assert properties.scene_of(found) == load(SAMPLES / "settings.toml")
    display = found.digiclay_display
    assert (display.color, display.arrows) == ("force", True)
    assert tuple(display.picked) == (40, 41, -1, -1, -1, -1)
    assert view.shows_force(found)
    # Features are measured from the surface that was kept.
    assert formed_bed.has_reference(found)
    listed = found["digiclay_features"]
    assert listed.startswith("0 bosses and 1 crease")
    assert bpy.ops.digiclay.find_features() == {"FINISHED"}
    assert found["digiclay_features"] == listed
