"""Takes in a real Blender window: recorded, exported, replayed, baked, played; Blender saves by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.window.blender_window import played

REST = 40.0
#: Pins come to rest by hundredths of a millimeter for some time after the finger has left them; mm.
SETTLING = 0.1


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; return what stood in the scene after each of its steps."""
    return played("keep_takes.py", tmp_path_factory.mktemp("takes"), (1100, 720))


def bed(seen: dict[str, Any], name: str) -> np.ndarray:
    """Return the heights of a step, mm, rows by columns."""
    return np.array(seen[name]["bed"]).reshape(25, 25)


def test_what_is_recorded_is_kept_and_exported_in_mid_session(seen: dict[str, Any]) -> None:
    assert (seen["kept"]["sessions"], len(seen["kept"]["takes"])) == (1, 1)
    assert seen["kept"]["takes"][0][1] == "A press"
    assert (seen["exported"], seen["exported in a session"]) == (["FINISHED"], True)


def test_a_finger_that_is_lifted_slowly_raises_a_ridge_and_draws_it_along(seen: dict[str, Any]) -> None:
    assert bed(seen, "pressed").min() < REST - 1.0
    assert bed(seen, "raised").max() > REST + 1.0
    # Drawn along the middle row, 3 mm a pin: what has risen there is at least twice the blister's width.
    risen = (bed(seen, "ridge left")[12] > REST + 1.0).sum()
    assert risen >= 10


def test_blender_saves_by_itself_in_mid_session_and_the_state_is_in_the_file(seen: dict[str, Any]) -> None:
    # Blender puts it off for as long as a modal operator runs: the session steps aside for it.
    assert seen["saved by itself"]
    recovered = seen["recovered"]
    assert recovered["kept"] > 0
    assert recovered["takes"][:1] == seen["kept"]["takes"]
    assert (recovered["sessions"], recovered["replay can be pressed"]) == (0, True)


def test_replaying_waits_for_the_session_to_be_stopped(seen: dict[str, Any]) -> None:
    assert not seen["kept"]["replay can be pressed"]
    assert seen["stopped"]["replay can be pressed"]


def test_what_blender_saves_by_itself_has_the_recording_under_way_as_a_take(seen: dict[str, Any]) -> None:
    assert [name for _, name, _ in seen["recovered"]["takes"]] == ["A press", "Take 2"]
    assert [name for _, name, _ in seen["saved while recording"]["takes"]] == ["A press"]


def test_esc_in_a_replay_leaves_bed_and_finger_as_they_were(seen: dict[str, Any]) -> None:
    stopped, during, after = (seen[name] for name in ("stopped", "replaying", "replay stopped"))
    assert during["pose"] != stopped["pose"]
    assert (after["bed"], after["kept"]) == (stopped["bed"], stopped["kept"])
    np.testing.assert_allclose(after["pose"], stopped["pose"], rtol=0, atol=1e-7)  # float32


def test_a_replay_ends_where_the_take_did(seen: dict[str, Any]) -> None:
    np.testing.assert_allclose(bed(seen, "replayed"), bed(seen, "kept"), rtol=0, atol=SETTLING)
    assert "bit for bit" in seen["output"]


def test_esc_in_a_bake_changes_nothing_and_gives_the_frame_back(seen: dict[str, Any]) -> None:
    before, after = seen["replayed"], seen["bake stopped"]
    assert not after["is baked"]
    assert (after["bed"], after["frame"]) == (before["bed"], 7)


def test_a_baked_take_plays_and_no_session_starts_on_it(seen: dict[str, Any]) -> None:
    assert seen["baked"]["is baked"]
    assert not seen["session on a bake"]
    assert np.ptp(seen["played"]) > 10e-3  # the fingertip goes down by a centimeter of the device: 0.1


def test_freeing_the_bake_brings_back_the_beds_own_state(seen: dict[str, Any]) -> None:
    assert not seen["freed"]["is baked"]
    assert seen["freed"]["bed"] == seen["replayed"]["bed"]


def test_every_picture_shows_more_than_an_empty_window(seen: dict[str, Any]) -> None:
    # Shaded pins and a shaded fingertip have thousands of colors, a blank screen has one.
    assert set(seen["colors"]) == {
        *(f"takes_{name}" for name in ("ridge", "recording", "replaying", "baking", "played"))
    }  # fmt: skip
    assert min(seen["colors"].values()) > 1000


@pytest.fixture(scope="module")
def closed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script that closes files in mid-recording; return what it saw, and what quitting left."""
    out = tmp_path_factory.mktemp("closed")
    seen = played("quit_while_recording.py", out, (800, 600))
    left = out / "digiclay_recording.blend"
    return seen | {"left by quitting": left.read_bytes() if left.is_file() else b""}


def test_a_file_left_for_another_one_in_mid_recording_is_recovered_with_the_take(
    closed: dict[str, Any],
) -> None:
    assert "kept as Take 1" in closed["loaded"]["said"]
    assert "File > Recover > Auto Save" in closed["loaded"]["said"]
    assert closed["recovered"] == ["Take 1"]


def test_a_file_saved_in_mid_recording_has_the_take_and_is_not_left_again(closed: dict[str, Any]) -> None:
    assert closed["saved before"] == ["Take 1", "Take 2"]
    assert not closed["left although saved"]


def test_quitting_in_mid_recording_leaves_the_file_with_the_take(closed: dict[str, Any]) -> None:
    # Names of properties stand in a .blend as they are.
    assert b"digiclay_takes" in closed["left by quitting"]
    assert b"Take 3" in closed["left by quitting"]
