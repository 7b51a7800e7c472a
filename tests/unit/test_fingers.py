"""Several fingers in scenes, kept states and takes; a run beyond what a finger is says so."""

import json
from dataclasses import replace

import digiclay
import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError, SceneError, StateError
from digiclay.core.engine.simulation import begin
from digiclay.core.files.tables import parse_tables
from digiclay.core.model import touch
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.touch import (
    MOST_FORCE,
    MOST_INDENTATION,
    describe_excess,
    find_indentations,
)
from digiclay.core.model.trajectory import Path as FingerPath
from digiclay.core.model.trajectory import Waypoint
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, load
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.recent_trace import exceeds_law
from digiclay.core.session.run_scene import run
from digiclay.core.session.snapshot import START
from digiclay.core.shapes.body import pack_mesh
from digiclay.core.studies.axes import find_value
from digiclay.overlay.sections import force_message

from tests.assemble import sample, table, under
from tests.scene_files import call, read_json

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


def scene(words):
    return resolve(parse_tables(BED + words), "bed")


def test_a_scene_may_have_two_fingers_and_lasts_as_long_as_the_longest_path():
    assert scene(TWO).simulation.duration == 0.7
    thumb, other = scene(TWO).fingers
    assert (thumb.fingertip.length, thumb.relaxation is None, other.relaxation) == (
        14e-3,
        False,
        None,
    )
    assert (thumb.trajectory.interpolation, other.trajectory.interpolation) == ("smooth", "linear")


@pytest.mark.parametrize("text", [BED + TWO, "finger = []\nsimulation.duration = 1.0\n" + BED])
def test_a_scene_of_any_number_of_fingers_is_written_and_read_back(text):
    made = resolve(parse_tables(text), "bed")
    assert resolve(parse_tables(format_scene(made))) == made


def test_a_setting_names_the_only_finger_of_a_list_as_any_other(tmp_path):
    beside = ONE.replace("[[finger]]", "").replace("[finger.", "[")
    assert scene(ONE) == scene(beside)
    assert "[[finger]]" not in format_scene(scene(ONE))
    file = tmp_path / "one.toml"
    file.write_text(BED + ONE, encoding="utf-8")
    (finger,) = load(
        file, [Setting("fingertip.length", "0.009"), Setting("relaxation", "absent")]
    ).fingers
    assert (finger.fingertip.length, finger.relaxation) == (9e-3, None)
    with pytest.raises(
        SceneError, match=r"^--set: finger\.2\.contact must begin with .*has one fingertip"
    ):
        load(file, [Setting("finger.2.contact", "{}")])


@pytest.mark.parametrize(
    "key, value, lengths",
    [
        ("fingertip.length", "0.009", (9e-3, 9e-3)),  # of all
        ("finger.2.fingertip.length", "0.009", (14e-3, 9e-3)),
        ("finger #1.fingertip.length", "0.009", (9e-3, 10e-3)),  # as describe and messages write it
        ("finger.1.fingertip", "{}", (10e-3, 10e-3)),
        ("finger.3.fingertip.length", "9 mm", "finger.3 must be a number from 1 to 2 here"),
        ("finger.fingertip.length", "9 mm", "finger.fingertip must be a number from 1 to 2 here"),
        ("finger.2.fingertip.lenght", "9 mm", "finger #2.fingertip.lenght must be a known key"),
        ("fingertip.length", "-9 mm", "finger #1.fingertip.length must be above 0 m"),
        ("finger.2.control.force_gain", "3", "finger #2.control must be a known key"),
        ("finger.2.fingertip.length", "nan", "finger #2.fingertip.length must be a finite number"),
    ],
)
def test_a_setting_is_of_all_fingers_or_of_the_one_it_names(key, value, lengths, tmp_path):
    file = tmp_path / "two.toml"
    file.write_text(BED + TWO, encoding="utf-8")
    settings = [Setting(key, value), Setting("control.dead_band", "9 um", "--vary")]
    if isinstance(lengths, tuple):
        made = load(file, settings)
        assert tuple(part.length for part in made.list_parts("fingertip")) == lengths
        own = tuple(dict.fromkeys(lengths))
        assert find_value(made, "fingertip.length", "differs") == (
            own[0] if len(own) == 1 else "differs"
        )
        assert find_value(made, "finger.2.fingertip.length", "") == lengths[1]
    else:
        with pytest.raises(SceneError, match=f"^--(set|vary): {lengths}") as refused:
            load(file, settings)
        # Of a value out of bounds the option that has it is known.
        assert str(refused.value).startswith("--set") or "must be above" not in lengths


@pytest.mark.parametrize(
    "words, said",
    [
        ("[[finger]]\nlength = 1\n", r"finger #1.length must be a known key"),
        ("[[finger]]\n[[finger]]\nfingertip = 3\n", r"finger #2.fingertip must be a section"),
        ("[[finger]]\n[finger.contact]\nshare = -1.0\n", r"finger #1.contact.share must be"),
        (
            "[[finger]]\ntrajectory.waypoints = [{ time = 0.0 }]\n",
            r"finger #1.trajectory.waypoints #1.posit",
        ),
        ("[[finger]]\n[contact]\n", r"contact must be left out where there is \[\[finger\]\]"),
        ("[finger]\n", r"finger must be a list of tables, \[\[finger\]\] \(got an empty section\)"),
    ],
)
def test_what_is_wrong_with_a_finger_is_told_with_its_number(words, said):
    with pytest.raises(ParameterError, match=f"^{said}"):
        scene(words)


@pytest.mark.parametrize("number", [0, 33])
def test_no_finger_and_33_are_refused_in_one_line(number):
    with pytest.raises(
        ParameterError, match=rf"^scene\.fingers must be 1 to 32 \(got {number}\)\.$"
    ):
        assemble(replace(scene(ONE), fingers=scene(ONE).fingers * number))


def test_a_kept_state_of_two_fingers_is_refused():
    system = assemble(scene(ONE))
    data = snapshot.dump(system, begin(system))
    length = int.from_bytes(data[len(START) : len(START) + 4], "little")
    header = json.loads(data[len(START) + 4 : len(START) + 4 + length])
    assert header["gathered"]["fingers"] == [{"reach": None}]
    header["gathered"] |= {"fingers": [{"reach": None}] * 2, "control": [None, None]}
    head = json.dumps(header).encode()
    two = START + len(head).to_bytes(4, "little") + head + data[len(START) + 4 + length :]
    with pytest.raises(
        StateError, match=r"must have the same number of fingers as the bed now, 1 \(got 2\)"
    ):
        snapshot.load(system, two)


def pressed(depth, tilt=0.0, x=0.0, **parts):
    """Return a run whose finger, tilted, rad, comes down at x to `depth` below the tops within 0.1 s, m."""
    points = ((0.0, 41e-3), (0.1, 40e-3 - depth), (0.15, 40e-3 - depth))
    turn = (np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0)
    way = FingerPath("linear", tuple(Waypoint(time, (x, 0.0, z), turn) for time, z in points))
    known = sample("tap", "simulation.duration=0.15")
    return run(known.with_sections(trajectory=way, **{"control": None, "blister": None, **parts}))


@pytest.fixture(scope="module")
def shallow():
    """Return a run within what a finger is."""
    return pressed(1.5e-3)


def test_a_finger_driven_through_the_bed_is_remarked_in_the_summary_line_and_no_other(shallow):
    assert (shallow.metrics["beyond_a_finger"], "contact law" in shallow.summary()) == ("", False)
    through = pressed(60e-3)  # all valves are shut
    said = through.metrics["beyond_a_finger"]
    assert said.startswith("the contact law does not hold: ")
    assert said.endswith("e+51 N (fingers were measured up to 2 N), 60 mm deep (up to 3 mm)")
    assert through.summary().endswith(f"; {said}")
    # Only what is beyond is named.
    most = (MOST_FORCE, MOST_INDENTATION)
    given = (
        most,
        (1.001 * MOST_FORCE, most[1]),
        (most[0], 1.001 * most[1]),
        (476.0, 4e-3),
        (None, None),
    )
    assert [describe_excess(*values).count("up to") for values in given] == [0, 1, 1, 2, 0]


@pytest.mark.parametrize(
    "depth, tilt, x, stiffness",
    [
        (1.5e-3, 0, 0, 250), (3.5e-3, 0, 0, 250),
        # By depth alone: above a pin, between pins, and tilted.
        (3.5e-3, 0, 0, 0.01), (3.2e-3, 0, 1.5e-3, 0.01), (2.9e-3, 0.6, 0, 0.01), (4e-3, 0.6, 0, 0.01),
    ],
)  # fmt: skip
def test_rows_and_live_states_beyond_the_law_are_marked(depth, tilt, x, stiffness, monkeypatch):
    monkeypatch.setattr(touch, "ROWS", 1)
    result = pressed(depth, tilt, x, contact=Contact(stiffness=stiffness))
    history, system = result.history, assemble(result.scene)
    unders = under(Fingertip().outline(history["fingertip"]), *history["position"].T)
    depths = (history["height"] - unders).max(axis=1, where=history["force"] > 0.0, initial=0.0)
    told = result.metrics["max_indentation"], result.metrics["units"]["max_indentation"]
    assert told == (pytest.approx(depths.max(), rel=1e-12), "m")
    # No valve is open, and the underside is an ellipse of 10 and 8 mm.
    assert depths.max() == pytest.approx(
        depth - 8e-3 * (1.0 - np.sqrt(1.0 - (x / 10e-3) ** 2)), rel=1e-9
    )
    wanted = (history["total_force"] > MOST_FORCE) | (depths > MOST_INDENTATION)
    assert wanted.any() == (depth > MOST_INDENTATION) == ("beyond_a_finger" in history)
    np.testing.assert_array_equal(history.get("beyond_a_finger", wanted), wanted)
    states = simulate_path(system, begin(system), history["fingertip"][:, None])
    live = [exceeds_law(system, *one) for one in zip(states, history["fingertip"][1:], strict=True)]
    assert live == wanted[1:].tolist()


def test_a_pin_that_is_not_felt_does_not_count(shallow):
    # Beyond the rim of a finger that is lifted: no force, whatever the heights.
    free = {**shallow.history, "force": np.zeros_like(shallow.history["force"])}
    assert find_indentations(Fingertip(), free).max() == 0.0


def test_the_overlay_says_when_no_finger_presses_so_hard():
    assert [force_message(force) for force in (0.7, 2.0, 2.5, 476.0, 1e66)] == [
        "0.70 N",
        "2.00 N",
        "2.5 N: beyond 2 N",
        "476 N: no finger",
        "1e+66 N: no finger",
    ]
    assert force_message(0.7, beyond=True) == "0.70 N: beyond 3 mm"


#: A hammer, whose head is 50 mm from its origin, level and turned by 60° about y.
HAMMER = trimesh.creation.box((4e-3, 4e-3, 4e-3)).apply_translation((50e-3, 0.0, 0.0))
LEVEL, TURNED = [1.0, 0.0, 0.0, 0.0], [np.cos(np.pi / 6), 0.0, np.sin(np.pi / 6), 0.0]


@table(
    "start, end, turn, cap, fall",
    {
        "2 mm per period": (70e-3, 30e-3, LEVEL, 1.6e-3, "2 mm"),
        "as far as it may": (70e-3, 30e-3, LEVEL, 2.001e-3, ""),
        "above the pins": (140e-3, 100e-3, LEVEL, 1.6e-3, ""),
        "upwards": (43e-3, 100e-3, LEVEL, 1.6e-3, ""),
        "a head that comes down as its handle turns": (70e-3, 70e-3, TURNED, 2.1e-3, "2.3"),
        "a head that comes down slower": (70e-3, 70e-3, TURNED, 2.4e-3, ""),
    },
)
def test_a_body_that_falls_by_more_than_its_cap_per_period_is_cautioned(
    start, end, turn, cap, fall, here, capsys
):
    x = -50e-3 if turn is LEVEL else -41e-3
    points = [
        {"time": time, "position": [x, 0, z], "orientation": turn}
        for time, z, turn in ((0.0, start, LEVEL), (0.1, end, turn))
    ]
    path = {"interpolation": "linear", "waypoints": points}
    body = {"mesh": pack_mesh(HAMMER.vertices, HAMMER.faces), "cap": cap, "trajectory": path}
    made = resolve({"layout": {"rows": 5, "columns": 5}, "control": "absent", "body": [body]})
    (here / "my.toml").write_text(format_scene(made), encoding="utf-8")
    assert call("run my.toml --out out") == 0
    said = read_json(here / "out" / "metrics.json")["beyond_cap"]
    assert said.startswith(f"body 1 falls by up to {fall}") if fall else said == ""
    assert capsys.readouterr().out.splitlines()[0].endswith(f"; {said}" if said else "mN")
    assert digiclay.load("out").describe().get("caution", "") == said
