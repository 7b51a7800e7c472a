"""Python's front door: scenes, runs, folders, sweeps, periods, own methods, and the device's own answers."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import digiclay
import numpy as np
import pandas
import pytest
from digiclay import DigiclayError
from digiclay.core.base.errors import LONGEST
from digiclay.core.scene.scene_source import Setting, find, list_samples, load
from digiclay.core.scene.toml_table import format_scene, resolve, tabulate

from tests.assemble import refused_in_a_line
from tests.other_process import finish, start
from tests.own_methods import Mine
from tests.scene_files import call

pytestmark = pytest.mark.usefixtures("here", "no_methods")

TABLES = {
    "layout": {"rows": 5, "columns": 5},
    "control": "absent",
    "simulation": {"duration": "50 ms"},
}


@pytest.fixture(scope="module")
def done(tap):
    return digiclay.run(tap)


def test_a_scene_is_of_tables_of_a_file_a_name_another_scene_or_nothing(here):
    file = here / "my.toml"
    file.write_text(format_scene(resolve(TABLES, "my")), encoding="utf-8")
    assert digiclay.scene(TABLES) == resolve(TABLES)
    assert digiclay.scene(file) == digiclay.scene(str(file)) == load(file)
    assert digiclay.scene("ridge_mound_valley") == load(find("ridge_mound_valley"))
    assert digiclay.scene() == digiclay.scene({}) == resolve({})
    assert digiclay.scene(digiclay.scene(file)) == load(file)


@pytest.mark.parametrize("name", list_samples())
def test_the_tables_of_a_scene_resolve_to_it(name):
    scene = load(find(name))
    assert resolve(tabulate(scene)) == scene


@pytest.mark.parametrize(
    "changes, settings",
    [
        ({"control.force_setpoint": "0.3 N"}, ["control.force_setpoint=0.3"]),
        ({"control": {"force_gain": 3, "travel": 2e-3}}, ["control.force_gain=3", "control.travel=2e-3"]),
        ({"conduit": "absent", "layout.rows": np.int64(15)}, ["conduit=absent", "layout.rows=15"]),
        ({"contact.stiffness": np.array(200)}, ["contact.stiffness=200"]),
        ({"layout.pitch": np.float32(0.25)}, ["layout.pitch=0.25"]),
        ({"control.method": "hybrid"}, ["control.method=hybrid"]),
        ({"preset": "fast"}, ["preset=fast"]),
        ({"layout.arrangement": "hexagonal"}, ["layout.arrangement=hexagonal"]),
        ({"actuator.rest_height": "30 mm"}, ["actuator.rest_height=0.03"]),
        ({"name": "true"}, ['name="true"']),
        (
            {"trajectory.waypoints": [{"time": np.float64(1.0), "position": np.array([0.0, 0.0, 0.04])}]},
            ["trajectory.waypoints=[{time=1.0, position=[0.0, 0.0, 0.04]}]"],
        ),
    ],
)  # fmt: skip
@pytest.mark.parametrize("source", ["name", "scene"])
def test_changes_are_those_of_the_command_line_also_of_a_scene_that_is_made(
    changes, settings, source
):
    # What follows from a method, a preset or an arrangement of pins follows in a scene as in its
    # file.
    wanted = load(find("tap"), [Setting(*one.split("=", 1)) for one in settings])
    assert digiclay.scene("tap" if source == "name" else digiclay.scene("tap"), changes) == wanted


@pytest.mark.parametrize(
    "tables, changes",
    [
        ({"layout": {"arrangement": "hexagonal"}}, {"layout.arrangement": "aligned"}),
        ({}, {"actuator.rest_height": 0.03}),
        ({"control": {"method": "cell_states"}}, {"control.method": "virtual_master"}),
        ({"preset": "design"}, {"preset": "paper"}),
    ],
)
def test_what_a_scene_has_by_its_arrangement_height_method_or_preset_follows_their_change(
    tables, changes
):
    # As if the tables had been changed: the share of a pin, the default press, the blister, valve
    # and lag.
    assert digiclay.scene(digiclay.scene(tables), changes) == digiclay.scene(
        {}, {**tables, **changes}
    )


@pytest.mark.parametrize(
    "number", [np.float32(0.25), np.array(0.25), pandas.Series([0.25])[0]], ids=type
)
def test_numbers_of_numpy_and_pandas_are_numbers_in_tables(number):
    points = [{"time": number, "position": np.array([0.0, 0.0, 0.04])}]
    scene = digiclay.scene(
        {"control": {"force_setpoint": number}, "trajectory": {"waypoints": points}}
    )
    assert scene.control.force_setpoint == scene.simulation.duration == 0.25


@pytest.mark.parametrize(
    "content, changes, message",
    [
        ("no_such_scene", None, "no_such_scene is neither a file nor a sample"),
        (7, None, "A scene must be tables, a file or a name (got 7)."),
        ({"control": np.array([1, 2])}, None, "control must be a section, [control]"),
        (
            {"layout": {"rows": np.array([5, 6])}},
            None,
            "layout.rows must be a whole number (got [5, 6]).",
        ),
        ("tap", [1], "Changes must be a table of keys and values (got [1])."),
        (
            "tap",
            {"control": {"force_gain": float("nan")}},
            "changes: control.force_gain must be a finite",
        ),
        ("tap", {"control.force_gain": None}, "changes: control.force_gain must be a number"),
        ("tap", {3: 4}, "changes: 3 must be a known key (got 4)"),
        (
            "tap",
            {"control.method": int},
            "int: the class must derive from digiclay.Method (got int).",
        ),
        (
            "tap",
            {"control.method": "no.py:No"},
            "no.py cannot be read as a control method: No such file",
        ),
        (
            {"control": {"method": "no.py:No"}},
            None,
            "no.py cannot be read as a control method: No such",
        ),
    ],
)
def test_a_wrong_scene_is_refused_in_one_line(content, changes, message):
    with refused_in_a_line(DigiclayError, f"^{re.escape(message)}") as caught:
        digiclay.scene(content, changes)
    assert len(str(caught.value)) <= LONGEST


@pytest.mark.parametrize(
    "change, message",
    [
        (
            lambda scene: scene.with_sections(method="hybrid"),
            "control must be Hybrid with the method hybrid (g",
        ),
        (
            lambda scene: replace(scene, control=Mine()),
            "control must be VirtualMaster with the method v",
        ),
        (
            lambda scene: replace(scene, method="mine", control=Mine()),
            "control.method must be one of virtual",
        ),
        (
            lambda scene: replace(scene, blister=None),
            "blister must be Blister with the method virtual_master",
        ),
        (
            lambda scene: scene.with_sections(layot=3),
            "layot must be a known key (got 3). Did you mean layout",
        ),
        (lambda scene: scene.with_sections(valve=None), "valve must be Valve or Motor (got None)."),
        (
            lambda scene: scene.with_sections(fingertip=scene.valve),
            "fingertip must be Fingertip or None (got Valve)",
        ),
        (lambda scene: replace(scene, fingers=[1]), "fingers must be a tuple of Finger (got [1])."),
        (lambda scene: scene.with_sections(trajectory=None), "trajectory must be Path (got None)."),
    ],
)
def test_a_scene_has_only_parts_of_its_sections_and_its_method(tap, change, message):
    with refused_in_a_line(DigiclayError, f"^{re.escape(message)}"):
        change(tap)


def test_importing_it_imports_no_part_of_the_simulation():
    parts = "{'numpy', 'bpy', 'trimesh', 'digiclay.core.base'}"
    assert finish(start(f"import sys, digiclay; print({parts} & {{*sys.modules}})"))[1] == "set()\n"
    with pytest.raises(AttributeError, match="has no attribute 'swep'"):
        digiclay.swep  # noqa: B018
    assert {*digiclay.__all__} <= {*dir(digiclay)}


def test_a_run_has_heights_metrics_and_a_summary():
    periods = []
    done = digiclay.run(digiclay.scene(TABLES), lambda *counts: periods.append(counts))
    assert periods == [(count, 10) for count in range(1, 11)]
    assert done.history["height"].shape == done.history["force"].shape == (11, 25)
    np.testing.assert_allclose(done.history["time"], np.arange(11) * 5e-3)
    assert done.metrics["simulated"] == pytest.approx(0.05)
    assert done.metrics["versions"]["digiclay"] == digiclay.__version__
    assert done.summary().startswith("0.1 s simulated in ")
    without = digiclay.run(digiclay.scene(TABLES), errors=False)
    assert done.metrics["height_error"] >= 0.0
    assert without.metrics["errors_absent"] == "errors=False"


def test_a_run_is_restored_from_its_folder_as_the_commands_have_it(here, tap, done):
    assert done.save("out") == Path("out")
    assert call("run tap --set simulation.duration=0.3 --out cli") == 0
    again, other = digiclay.load("out"), digiclay.load(here / "cli")
    assert again.scene == other.scene == tap
    for name, array in done.history.items():
        np.testing.assert_array_equal(again.history[name], array)
        np.testing.assert_array_equal(other.history[name], array)
    assert again.metrics == done.metrics
    assert again.summary() == done.summary()
    with refused_in_a_line(DigiclayError, "^out is not empty: .* overwrite=True"):
        done.save("out")
    assert done.save("out", overwrite=True) == Path("out")
    assert call("export out --format obj") == 0


def test_a_run_without_a_record_is_restored_too(tap):
    done = digiclay.run(digiclay.scene(tap, {"recorder": "absent"}))
    done.save("bare")
    again = digiclay.load("bare")
    assert again.history == {}
    assert again.metrics == done.metrics
    for name, ask in (("finger_force", lambda: again.finger_force), ("surface", again.surface)):
        with refused_in_a_line(DigiclayError, f"^{name} needs a recorder, and the scene has"):
            ask()
    with refused_in_a_line(DigiclayError, "^plot needs a recorder"):
        again.plot("a.png")
    assert "<img" not in again._repr_html_()
    assert "force: not recorded" in repr(again)


def test_the_surface_is_exported_by_the_ending_and_compared_with_a_former_one(here):
    run = digiclay.run(digiclay.scene("plastic_press"), errors=False)
    run.save("out")
    for ending in ("stl", "glb"):
        assert run.surface().export(f"a.{ending}") == Path(f"a.{ending}")
        assert call(f"export out --format {ending}") == 0
        assert (here / f"a.{ending}").read_bytes() == (
            here / "out" / f"surface.{ending}"
        ).read_bytes()
    run.surface().export("a.obj", kind="features")
    with refused_in_a_line(DigiclayError, "^There is no feature"):
        run.surface(former=run.scene.simulation.duration).export("a.obj", kind="features")
    assert run.surface(time=np.float32(0.0)).formed.height.max() == pytest.approx(0.04)


def test_forces_contact_and_losses_are_of_each_finger(done):
    np.testing.assert_array_equal(done.finger_force, done.history["total_force"][:, None])
    (contact,) = done.fingers
    assert contact.losses == 0
    assert contact.contact_time == pytest.approx(
        done.metrics["contact_share"] * done.metrics["duration"]
    )
    two = digiclay.scene("pinch_crease", {"simulation.duration": 2.0})
    pinch = digiclay.run(two, errors=False)
    assert pinch.finger_force.shape == (len(pinch.history["time"]), 2)
    shares = [one["contact_share"] * pinch.metrics["duration"] for one in pinch.metrics["fingers"]]
    assert [finger.contact_time for finger in pinch.fingers] == pytest.approx(shares)
    lost = digiclay.run(digiclay.scene("slow_press", {"control.force_gain": 1}), errors=False)
    assert [(one.losses, one.lost_time) for one in lost.fingers] == [
        (1, lost.metrics["lost"][0]["time"])
    ]
    assert lost.fingers[0].lost_time > 1.0


def test_scene_and_run_are_shown_in_a_few_lines_and_in_a_notebook_with_the_plot(tap, done):
    assert len(repr(tap).splitlines()) == len(repr(done).splitlines()) == 6
    assert "11 x 11 pins, 3 mm apart" in repr(tap)
    assert "real time" in repr(done)
    assert "height error about" in repr(done)
    assert f"force: RFD {done.metrics['rfd']:.2g} N" in repr(done)
    plastic = digiclay.run(digiclay.scene(tap, {"control.method": "plastic"}), errors=False)
    assert f"force: at most {plastic.metrics['max_total_force']:.2g} N" in repr(plastic)
    assert "cell_states, set point 0.04 N per cell" in repr(
        digiclay.scene({"control": {"method": "cell_states"}})
    )
    deep = digiclay.scene(tap, {"control": "absent", "contact.stiffness": 5000})
    pressed = digiclay.run(deep, errors=False)
    assert f"\n  caution: {pressed.metrics['beyond_a_finger']}\n" in repr(pressed)
    named = replace(tap, name="a<b")
    assert ">Scene a&lt;b</caption>" in named._repr_html_()
    assert re.search(r"<tr><th [^>]+>bed</th><td [^>]+>11 x 11 pins", named._repr_html_())
    assert re.search(
        r'^<table>.*</table><img alt="[^"]+" width="800" src="data:image/png;base64,iVBOR',
        done._repr_html_(),
    )


def test_without_matplotlib_there_is_the_table_and_a_line_with_the_extra(done, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert done._repr_html_().endswith("</table>")
    with refused_in_a_line(
        DigiclayError, r"^Plots need matplotlib: run 'pip install .*digiclay\[plots\]'"
    ):
        done.plot("a.png")


@pytest.mark.parametrize(
    "ask, message",
    [
        (
            lambda run: run.plot("a.pdf"),
            "The file of a plot must end with .png or .svg (got a.pdf).",
        ),
        (lambda run: run.plot(None), "A file or folder must be a path (got None)."),
        (lambda run: run.surface().export("a.xyz"), "Unknown mesh format 'xyz': known are stl, "),
        (lambda run: run.surface().export("no/a.stl"), "Cannot write no/a.stl: No such file"),
        (
            lambda run: run.surface().export("a.stl", kind="soild"),
            "Model.kind must be one of solid, ",
        ),
        (
            lambda run: run.surface().export("a.stl", unit="inch"),
            "Export.unit must be one of mm, m",
        ),
        (lambda run: run.surface(time=9.0), "time must be between 0 s and 0.3 s (got 9 s)."),
        (
            lambda run: run.surface(time=float("nan")),
            "time must be between 0 s and 0.3 s (got nan s).",
        ),
        (
            lambda run: run.surface(former="rest"),
            "former must be between 0 s and 0.3 s (got 'rest').",
        ),
        (lambda run: run.save(3), "A file or folder must be a path (got 3)."),
        (
            lambda run: digiclay.load("none"),
            "none is not the folder of a run: it has no scene.toml.",
        ),
        (lambda run: digiclay.load(None), "A file or folder must be a path (got None)."),
        (
            lambda run: digiclay.run("tap"),
            "scene must be a Scene, as digiclay.scene returns it (got 'tap').",
        ),
        (
            lambda run: digiclay.steps("tap"),
            "scene must be a Scene, as digiclay.scene returns it (got 'tap').",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(done, ask, message):
    with refused_in_a_line(DigiclayError, f"^{re.escape(message)}"):
        ask(done)


@pytest.mark.parametrize(
    "file, text, message",
    [
        ("metrics.json", "[", "out/metrics.json must be a table of metrics in JSON."),
        (
            "metrics.json",
            '{"run_time": 0, "control_periods": 3}',
            "out/metrics.json must have the numbers cont",
        ),
        (
            "metrics.json",
            '{"digiclay": 1}',
            "out/metrics.json must have the numbers control_periods and run_t",
        ),
        ("history.npz", "", "out/history.npz cannot be read as a run's history"),
        (
            "scene.toml",
            "layot = 3",
            "out/scene.toml: layot must be a known key (got 3). Did you mean layout?",
        ),
    ],
)
def test_a_damaged_folder_is_refused_in_one_line(done, file, text, message):
    (done.save("out") / file).write_text(text, encoding="utf-8")
    with refused_in_a_line(DigiclayError, f"^{re.escape(message)}"):
        digiclay.load("out")


def test_steps_are_the_rows_of_a_run_and_stay_as_they_are(done, tap):
    states = list(digiclay.steps(tap))
    assert len(states) == tap.periods
    for name in ("height", "force"):
        np.testing.assert_array_equal(
            [getattr(state, name) for state in states], done.history[name][1:]
        )
    np.testing.assert_allclose(
        [state.finger_forces for state in states], done.finger_force[1:], rtol=1e-12
    )
    np.testing.assert_allclose(
        [state.time for state in states], done.history["time"][1:], rtol=1e-12
    )


def test_tables_name_metrics_methods_and_samples():
    assert digiclay.METRICS["rfd"].unit == "N"
    assert digiclay.METRICS["height_error"].unit == "m"
    assert list(digiclay.samples()) == list_samples()
    assert all(digiclay.samples().values())
    digiclay.scene("tap", {"control.method": Mine})
    assert digiclay.methods()["mine"] == "Pins under a force give way"
