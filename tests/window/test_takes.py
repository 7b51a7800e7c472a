"""Takes in a real Blender window: recorded, exported, replayed, baked, played; Blender saves by itself."""

import numpy as np

from tests.assemble import assert_near
from tests.window.blender_window import REST, bed

PLAYED = {"script": "keep_takes.py", "size": (1000, 640)}
#: Pins come to rest by hundredths of a millimeter for some time after the finger has left them; mm.
SETTLING = 0.1


def test_a_finger_that_is_lifted_slowly_raises_a_ridge_and_draws_it_along(seen):
    assert bed(seen, "pressed").min() < REST - 1.0
    assert bed(seen, "raised").max() > REST + 1.0
    # Drawn along the middle row, 3 mm a pin: what has risen there is at least twice the blister's
    # width.
    risen = (bed(seen, "ridge left")[12] > REST + 1.0).sum()
    assert risen >= 10


def test_what_is_recorded_is_kept_and_exported_in_mid_session_and_replayed_after_it(seen):
    assert (seen["kept"]["sessions"], [name for _, name, *_ in seen["kept"]["takes"]]) == (
        1,
        ["A press"],
    )
    assert (seen["exported"], seen["exported in a session"]) == (["FINISHED"], True)
    assert [seen[name]["replay can be pressed"] for name in ("kept", "stopped")] == [False, True]


def test_blender_saves_by_itself_in_mid_session_with_the_recording_as_a_take(seen):
    # Blender puts it off for as long as a modal operator runs: the session steps aside for it.
    assert seen["saved by itself"]
    recovered = seen["recovered"]
    assert recovered["kept"] > 0
    assert recovered["takes"][:1] == seen["kept"]["takes"] == seen["saved while recording"]["takes"]
    assert [name for _, name, *_ in recovered["takes"]] == ["A press", "Take 2"]
    assert (recovered["sessions"], recovered["replay can be pressed"]) == (0, True)


def test_esc_in_a_replay_leaves_bed_and_finger_as_they_were_and_a_replay_ends_where_the_take_did(
    seen,
):
    stopped, during, after = (seen[name] for name in ("stopped", "replaying", "replay stopped"))
    assert during["pose"] != stopped["pose"]
    # What is formed meanwhile would be lost at its end.
    assert seen["formed in a replay"] == [False, False]
    assert not during["replay can be pressed"]
    assert (after["bed"], after["kept"]) == (stopped["bed"], stopped["kept"])
    assert_near(after["pose"], stopped["pose"], 1e-7)  # float32
    assert_near(bed(seen, "replayed"), bed(seen, "kept"), SETTLING)
    assert "bit for bit" in seen["output"]


def test_an_animated_file_is_written_in_steps_that_esc_stops_also_from_the_file_browser(seen):
    assert not seen["animation stopped"]
    same, size = seen["animations"]
    assert same
    # 625 pins, 12 bytes each in a frame.
    assert size > 625 * 12 * 24
    assert seen["animated"]["bed"] == seen["replayed"]["bed"]
    assert (seen["animated"]["sessions"], seen["animated"]["is baked"]) == (0, False)


def test_a_baked_take_plays_without_a_session_and_esc_and_free_give_bed_and_frame_back(seen):
    names = ("bake stopped", "baked", "freed")
    assert [seen[name]["is baked"] for name in names] == [False, True, False]
    assert seen["bake stopped"]["frame"] == 7
    assert [seen[name]["bed"] for name in ("bake stopped", "freed")] == [
        seen["replayed"]["bed"]
    ] * 2
    assert not seen["session on a bake"]
    assert seen["pressed on a bake"].startswith("Error: The bed plays a baked session")
    # The fingertip goes down by a centimeter of the device: 0.1.
    assert np.ptp(seen["played"]) > 10e-3


def test_a_file_left_in_mid_recording_has_the_take(seen):
    for words in ("kept as Take 1", "File > Recover > Auto Save"):
        assert words in seen["loaded"]["said"]
    assert seen["kept when another was loaded"] == ["Take 1"]
    # What was saved before is not left again.
    assert (seen["kept when saved before"], seen["left although saved"]) == (
        ["Take 1", "Take 2"],
        False,
    )
    # By quitting: names of properties stand in a .blend as they are.
    left = (seen["folder"] / "digiclay_recording.blend").read_bytes()
    assert (b"digiclay_takes" in left, b"Take 3" in left) == (True, True)
