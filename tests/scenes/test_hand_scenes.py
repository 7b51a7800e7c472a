"""Scenes of several fingers: what the samples form, and every command that takes such a scene or its run."""

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError
from digiclay.core.model.touch import MOST_FORCE
from digiclay.core.scene.recorder import write
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.session.finished_run import HISTORY, read_run
from digiclay.core.session.run_scene import run, save
from digiclay.core.studies.omissions import propose_omissions
from digiclay.plugins.method_loader import load_method

from tests.own_methods import (
    COPY,
    COPY_THREE,
    COPY_TWO,
    PAD,
    PLACED,
    forgotten,
    small,
    write_method,
)
from tests.scene_files import call, folder_with, left, read_json, rows, timeless

WAY = """trajectory.waypoints = [
  {{ time = 0, position = [{0}, 0, 0.041] }}, {{ time = 0.1, position = [{0}, 0, 0.038] }}]
"""
TWO = f"""\
[layout]
rows = 7
columns = 11
[blister]
radius = 0.005
edge_radius = 0.008
flat_radius = 0.002
[[finger]]
{WAY.format(-0.009)}
[[finger]]
fingertip.length = "11 mm"
{WAY.format(0.009)}
"""
SHAPED = "form dome --scene my.toml --out out --finger"
SHARES = "sweep my.toml --vary finger.2.contact.share=0.2,0.3 --metric rfd,lag --workers"


def assert_sample(name, fingers):
    """Assert that a sample of hands loses no finger, and forms what it is called."""
    done = run(load(find(name)))
    formed = done.history["height"][-1] - done.scene.actuator.rest_height
    x, y = done.history["position"].T
    out = np.hypot(x, y)
    each = done.metrics["fingers"]
    assert len(each) == fingers
    # Measured 0.041 to 0.066 N, one of these fingers alone 0.04 to 0.06 N; and 0.49 to 0.72 N.
    assert all(one["contact_loss_share"] == 0.0 and one["rfd"] < 0.08 for one in each)
    assert all(one["max_total_force"] < 0.8 for one in each)
    # Where it is high, and where low.
    high, low = {
        "two_hands_bowl": (abs(out - 29e-3) < 2e-3, out < 10e-3),
        "pinch_crease": (
            (abs(abs(y) - 7e-3) < 2e-3) & (abs(x) < 15e-3),
            (abs(y) < 1e-3) & (abs(x) < 15e-3),
        ),
        "five_fingers_mound": ((out > 6e-3) & (out < 16e-3), out > 34e-3),
    }[name]
    assert np.median(formed[high]) > 6e-3
    # Where the hands meet too; 7.5 mm measured.
    assert formed[high].min() > 7e-3 or name != "two_hands_bowl"
    assert np.median(formed[low]) < np.median(formed[high]) - (
        0.5e-3 if name == "pinch_crease" else 8e-3
    )


def test_a_pinch_loses_no_finger_and_forms_a_crease():
    assert_sample("pinch_crease", 2)


@pytest.mark.parametrize(
    "line, made, said",
    [
        (
            "run my.toml --plots --budget 300um --set contact.stiffness=300 --out out",
            {"session.png", "history.npz"},
            "at finger",
        ),
        (
            f"{SHAPED} press",
            {"history.npz"},
            "formed by the first of 2 fingers alone",
        ),
        (f"{SHAPED} scene", {"history.npz"}, ""),
        (
            "compare my.toml --methods virtual_master,cell_states --speed --out out",
            {"compare.png", "metrics.json"},
            "Followed, for the first finger alone, ",
        ),
    ],
    ids=["run", "form by a press", "form", "compare"],
)
def test_a_command_takes_two_fingers_and_says_what_of_them(
    line, made, said, tmp_path, monkeypatch, capsys
):
    folder = folder_with(TWO, tmp_path, monkeypatch)
    assert call(line) == 0
    assert made <= set(left(folder / "out"))
    told = capsys.readouterr().out
    assert said in told
    if not line.startswith("compare"):
        return
    assert "The worst of 2 fingers; metrics.json has each." in told
    found = read_json(folder / "out" / "metrics.json")
    for method, fingers in found["fingers"].items():
        largest = max(finger["max_total_force"] for finger in fingers)
        assert found["methods"][method]["max_total_force"] == largest


def test_rows_are_beyond_a_finger_where_one_is_and_not_where_all_together_are():
    made = load(
        find("pinch_crease"), [Setting("control", "absent"), Setting("relaxation", "absent")]
    )
    done = run(replace(made, simulation=replace(made.simulation, duration=1.0)))
    marked, each = done.history["beyond_a_finger"], done.history["finger_force"]
    # Pressed 3 mm deep into pins that hold, each finger alone comes to more than 2 N, both together
    # before.
    np.testing.assert_array_equal(marked, (each > MOST_FORCE).any(axis=1))
    assert (each.sum(axis=1)[~marked] > MOST_FORCE).any()


def test_a_budget_leaves_out_the_relaxation_of_all_fingers():
    made = load(find("pinch_crease"))
    texts = {one.kind: one for one in propose_omissions(made, 1e-3)}
    assert texts["relaxation"].leave_out(made).list_parts("relaxation") == (None, None)


def test_describe_names_the_finger_of_a_part_and_counts_all_rows(tmp_path, monkeypatch, capsys):
    folder_with(TWO, tmp_path, monkeypatch)
    assert call("describe my.toml") == 0
    said = capsys.readouterr().out
    assert "of 2: length 11 mm" in said
    assert "  contact     stiffness" in said
    assert (
        "14 rows: height, relaxation (6), valve, commands on their way (2), commanded height, force, "
        in said
    )
    assert "forces of the fingers (2); 112 bytes" in said
    assert call("describe my.toml --parameters") == 0
    assert "finger #2.fingertip.length = 0.011 m" in capsys.readouterr().out


def test_points_of_several_fingers_run_one_at_a_time_to_the_same_bits(
    tmp_path, monkeypatch, capsys
):
    folder = folder_with(TWO, tmp_path, monkeypatch)
    for count in "12":
        assert call(f"{SHARES} {count} --out {count}") == 0
    assert "2 points one at a time: they have several fingers" in capsys.readouterr().out
    assert timeless(folder / "1" / "sweep.csv") == timeless(folder / "2" / "sweep.csv")
    assert call("run my.toml --set finger.2.contact.share=0.3 --out run --quiet") == 0
    metrics = read_json(folder / "run" / "metrics.json")
    assert float(rows(folder / "1" / "sweep.csv")[1]["rfd (N)"]) == metrics["rfd"]
    assert metrics["rfd"] == max(finger["rfd"] for finger in metrics["fingers"])


def test_a_run_of_two_fingers_is_read_back_and_one_with_too_few_is_refused(tmp_path):
    scene = tmp_path / "my.toml"
    scene.write_text(TWO, encoding="utf-8")
    done = run(load(scene))
    save(done, tmp_path)
    stored = read_run(tmp_path, "fingertip", "finger_force").history
    np.testing.assert_array_equal(stored["finger_force"], done.history["finger_force"])
    for name in ("fingertip", "finger_force"):
        write({**done.history, name: done.history[name][:, :1]}, tmp_path / HISTORY)
        with pytest.raises(
            OutputError, match=rf"{name} must have the shape \(21, 2.*of its scene \(got \(21, 1"
        ):
            read_run(tmp_path, "fingertip", "finger_force")


@pytest.mark.parametrize(
    "code, word, like",
    [
        (COPY, "one.py:MethodOne", "virtual_master"),
        (COPY_TWO, "two.py:MethodOne", "cell_states"),
        (COPY_THREE, "three.py:MethodOne", "hybrid"),
        (PAD, "pad.py:SoftPad", ""),
        (PLACED, "p.py:SoftPad", ""),
    ],
)
def test_a_method_of_ones_own_takes_several_fingers(code, word, like, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_method(tmp_path, code, word.partition(":")[0])
    longer = "simulation.duration=0.5"
    with forgotten():
        own = run(with_two(small(load_method(word), longer)))
    assert all(one["contact_share"] > 0.0 for one in own.metrics["fingers"])
    assert np.ptp(own.history["height"]) > 1e-4
    if like:  # a controller a finger; what they sum goes in another order
        built_in = run(with_two(small(like, longer)))
        np.testing.assert_allclose(
            own.history["height"], built_in.history["height"], rtol=0, atol=1e-9
        )
        assert own.metrics["losses"] == built_in.metrics["losses"]


def with_two(scene):
    """Return a scene with its fingertip twice, 18 mm apart and 3 mm aside."""
    (finger,) = scene.fingers
    path = finger.trajectory
    ways = (
        tuple(replace(at, position=(side, side / 6, at.position[2])) for at in path.waypoints)
        for side in (-9e-3, 9e-3)
    )
    return replace(
        scene,
        fingers=tuple(replace(finger, trajectory=replace(path, waypoints=way)) for way in ways),
    )
