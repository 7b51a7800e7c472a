"""Fingers are a tuple in scenes, kept states and takes; few places take the only one out of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError, SceneError, StateError
from digiclay.core.engine.simulation import begin
from digiclay.core.files.tables import parse_tables
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, load
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.snapshot import START
from digiclay.core.session.take import Take, from_bytes, to_bytes

BED = "[layout]\nrows = 6\ncolumns = 6\n[control]\nmethod = 'elastic'\n"
#: A thumb and a finger without relaxation.
TWO = """
[[finger]]
[finger.fingertip]
length = "14 mm"
[finger.trajectory]
waypoints = [{ time = 0.0, position = [-0.004, 0.0, 0.042] }, { time = 0.5, position = [-0.004, 0.0, 0.038] }]
[[finger]]
relaxation = "absent"
[finger.trajectory]
interpolation = "linear"
waypoints = [{ time = 0.0, position = [0.004, 0.0, 0.042] }, { time = 0.7, position = [0.004, 0.0, 0.038] }]
"""
ONE = TWO[: TWO.rindex("[[finger]]")]


def scene(words: str) -> Scene:
    """Return the scene of a text."""
    return resolve(parse_tables(BED + words), "bed")


def test_a_scene_may_have_two_fingers_and_lasts_as_long_as_the_longest_path() -> None:
    assert scene(TWO).simulation.duration == 0.7
    thumb, other = scene(TWO).fingers
    assert thumb.fingertip is not None
    assert (thumb.fingertip.length, thumb.relaxation is None, other.relaxation) == (14e-3, False, None)
    assert (thumb.trajectory.interpolation, other.trajectory.interpolation) == ("smooth", "linear")


@pytest.mark.parametrize("text", [BED + TWO, "finger = []\nsimulation.duration = 1.0\n" + BED])
def test_a_scene_of_any_number_of_fingers_is_written_and_read_back(text: str) -> None:
    made = resolve(parse_tables(text), "bed")
    assert resolve(parse_tables(format_scene(made))) == made


def test_a_setting_names_the_only_finger_of_a_list_as_any_other_and_none_of_two(tmp_path: Path) -> None:
    beside = ONE.replace("[[finger]]", "").replace("[finger.", "[")
    assert scene(ONE) == scene(beside)
    assert "[[finger]]" not in format_scene(scene(ONE))
    file = tmp_path / "one.toml"
    file.write_text(BED + ONE, encoding="utf-8")
    (finger,) = load(file, [Setting("fingertip.length", "0.009"), Setting("relaxation", "absent")]).fingers
    assert finger.fingertip is not None
    assert (finger.fingertip.length, finger.relaxation) == (9e-3, None)
    file.write_text(BED + TWO, encoding="utf-8")
    with pytest.raises(SceneError, match=r"^--set: fingertip must be left out where there is \[\[finger\]\]"):
        load(file, [Setting("fingertip.length", "9 mm")])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("[[finger]]\nlength = 1\n", r"finger #1.length must be a known key"),
        ("[[finger]]\n[[finger]]\nfingertip = 3\n", r"finger #2.fingertip must be a section"),
        ("[[finger]]\n[finger.contact]\nshare = -1.0\n", r"finger #1.contact.share must be"),
        ("[[finger]]\ntrajectory.waypoints = [{ time = 0.0 }]\n", r"finger #1.trajectory.waypoints #1.posit"),
        ("[[finger]]\n[contact]\n", r"contact must be left out where there is \[\[finger\]\]"),
        ("[finger]\n", r"finger must be a list of tables, \[\[finger\]\] \(got an empty section\)"),
    ],
)
def test_what_is_wrong_with_a_finger_is_told_with_its_number(words: str, said: str) -> None:
    with pytest.raises(ParameterError, match=f"^{said}"):
        scene(words)


@pytest.mark.parametrize("number", [0, 33])
def test_no_finger_and_33_are_refused_in_one_line(number: int) -> None:
    with pytest.raises(ParameterError, match=rf"^scene\.fingers must be 1 to 32 \(got {number}\)\.$"):
        assemble(replace(scene(ONE), fingers=scene(ONE).fingers * number))


def test_a_kept_state_of_two_fingers_is_refused() -> None:
    system = assemble(scene(ONE))
    data = snapshot.dump(system, begin(system))
    length = int.from_bytes(data[len(START) : len(START) + 4], "little")
    header = json.loads(data[len(START) + 4 : len(START) + 4 + length])
    assert header["gathered"]["fingers"] == [{"reach": None}]
    header["gathered"] |= {"fingers": [{"reach": None}] * 2, "control": [None, None]}
    head = json.dumps(header).encode()
    two = START + len(head).to_bytes(4, "little") + head + data[len(START) + 4 + length :]
    with pytest.raises(StateError, match=r"must have the same number of fingers as the bed now, 1 \(got 2\)"):
        snapshot.load(system, two)


def test_a_take_keeps_the_path_of_every_finger() -> None:
    poses = np.tile([0.0, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0], (4, 2, 1))
    poses[:, 1, 0] = 1e-3
    take = Take(scene(TWO), b"start", poses, b"end")
    back = from_bytes(to_bytes(take))
    assert np.array_equal(back.poses, poses)
    assert (back.scene, back.start, back.end) == (take.scene, take.start, take.end)
