"""Scenes with bodies: imprints, walls, several bodies and fingers, stored states, and what is refused."""

import re
import struct
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from digiclay.cli import main
from digiclay.core.base.errors import DigiclayError
from digiclay.core.batch.run_together import run_together
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, load
from digiclay.core.scene.toml_table import format_scene, resolve, tabulate
from digiclay.core.session import snapshot
from digiclay.core.session.accuracy import Replay, estimate_errors
from digiclay.core.session.finished_run import HISTORY_ARRAYS, read_run
from digiclay.core.session.memory_limit import (
    BYTES_A_CELL,
    check_memory,
    measure_available_memory,
)
from digiclay.core.session.run_scene import run, save
from digiclay.core.shapes.body import pack_mesh
from digiclay.plots.run import session_figure

from digiclay_serve.served_session import begin_session
from tests.assemble import refused_in_a_line

BALL = trimesh.creation.icosphere(4, radius=12e-3)
BOX = trimesh.creation.box((12e-3, 12e-3, 20e-3))
REST = 40e-3


def path(*places):
    """Return a path of straight lines through (time, x, y, z)."""
    points = [{"time": time, "position": place} for time, *place in places]
    return {"interpolation": "linear", "waypoints": points}


#: The lowest point goes from 2 mm above the pins to 8 mm below, stays, and leaves.
PRESS = path((0, 0, 0, 54e-3), (0.4, 0, 0, 44e-3), (0.7, 0, 0, 44e-3), (0.9, 0, 0, 60e-3))


def body(mesh, way=PRESS, **values):
    """Return the table of a body."""
    return {"mesh": pack_mesh(mesh.vertices, mesh.faces), "trajectory": way, **values}


def table(*bodies, method="plastic", size=21, **sections):
    """Return the tables of a scene of bodies."""
    bed = {"layout": {"rows": size, "columns": size}, "control": {"method": method}}
    return {**bed, "body": list(bodies), **sections}


#: A box is dragged through the pins, 15 mm deep.
DRAG = path((0, -45e-3, 0, REST - 5e-3), (0.65, 20e-3, 0, REST - 5e-3))


def press_bodies(*bodies, held=False, **values):
    """Return the run of a scene of bodies; `held`: without a method, behind shut valves."""
    scene = resolve(table(*bodies, **values))
    return run(replace(scene, control=None) if held else scene)


def assert_formed(done, time, least):
    """Assert that more pins than so many have the form of the underside at a time, s; the others rest."""
    under, height = find_under(done.scene, time)[0], done.history["height"][-1]
    pressed = under < done.scene.actuator.rest_height
    assert pressed.sum() > least
    assert np.corrcoef(height[pressed], under[pressed])[0, 1] > 0.999
    assert np.sqrt(np.mean((height - under)[pressed] ** 2)) < 0.3e-3
    assert (height[~pressed] == done.scene.actuator.rest_height).all()


@pytest.fixture(scope="module")
def press():
    """Return a run in which a ball presses."""
    return press_bodies(body(BALL))


def find_under(scene, time):
    """Return the undersides of the bodies of a scene at a time, (b, n), m."""
    system = assemble(scene)
    stretch = system.undersides.find(round(time / system.period))
    cells = np.arange(system.grid.count)
    return np.array([stretch.at(number, cells)[0] for number in range(len(scene.bodies))])


def test_clay_keeps_the_form_of_the_body(press):
    assert_formed(press, 0.5, 40)


def test_the_force_is_that_of_the_body_and_its_metrics_are_recorded(press):
    history, (felt,) = press.history, press.metrics["bodies"]
    assert np.array_equal(history["body_force"][:, 0], history["force"])
    assert felt["max_total_force"] == press.metrics["max_total_force"] > 4.0
    assert felt["pressed_pins"] == (history["force"] > 0.0).sum(axis=1).max() > 40
    assert np.array_equal(history["body"][:, 0], history["fingertip"])
    assert press.metrics["duration"] == pytest.approx(0.9)


@pytest.mark.parametrize("deep, pressed", [(0.0, 0), (1e-17, 0), (0.1e-3, 25)])
def test_a_body_that_goes_down_to_the_pins_but_for_rounding_presses_none(deep, pressed):
    low = REST + 10e-3 - deep
    way = path((0, 0, 0, low + 5e-3), (0.1, 0, 0, low), (0.2, 0, 0, low))
    (felt,) = press_bodies(body(BOX, way)).metrics["bodies"]
    assert felt["pressed_pins"] == pressed


def test_the_force_is_stiffness_times_indentation_up_to_the_cap():
    # A pin behind a shut valve does not move.
    done = press_bodies(body(BALL, stiffness=300.0, cap=1e-3), held=True)
    wanted = 300.0 * np.clip(REST - find_under(done.scene, 0.5)[0], 0.0, 1e-3)
    # The spring is straight to 0.1 %.
    assert done.history["force"][100] == pytest.approx(wanted, rel=1e-3, abs=1e-12)
    assert (done.history["height"][-1] == REST).all()


def test_damping_adds_to_the_force_of_a_fast_press_and_not_to_that_of_a_held_one():
    way = path((0, 0, 0, 52e-3), (0.04, 0, 0, 51e-3), (0.4, 0, 0, 51e-3))
    free, damped = (
        press_bodies(body(BALL, way, damping=damping), held=True).history for damping in (0.0, 0.4)
    )
    added = damped["total_force"] - free["total_force"]
    # At 25 mm/s.
    assert added[8] == pytest.approx(0.4 * 25e-3 * (free["force"][8] > 0).sum(), rel=0.2)
    assert abs(added[-1]) < 1e-6 * free["total_force"][-1]


@pytest.mark.parametrize(
    "method, damping",
    [("plastic", 0.0), ("plastic", 0.2), ("elastic", 0.2), ("viscous", 0.2), ("push_pull", 0.2),
     ("force_display", 0.2)],
)  # fmt: skip
def test_a_wall_that_meets_pins_sideways_presses_them_at_a_bounded_force(method, damping):
    (felt,) = press_bodies(body(BOX, DRAG, damping=damping), method=method).metrics["bodies"]
    assert 0.3 < felt["max_cell_force"] < 2.0
    assert felt["pressed_pins"] >= 16


def test_turned_sides_of_triangles_change_nothing(press):
    mesh = BALL.copy()
    mesh.faces = mesh.faces[:, ::-1]
    again = press_bodies(body(mesh))
    assert np.array_equal(again.history["height"], press.history["height"])


def test_a_thin_blade_presses_pins_with_round_ends():
    blade = trimesh.creation.box((1e-3, 40e-3, 20e-3))
    way = path((0, 1.4e-3, 0, 52e-3), (0.4, 1.4e-3, 0, 46e-3))
    flat, round_ = (
        press_bodies(body(blade, way, tip_radius=radius)).metrics["bodies"][0]["pressed_pins"]
        for radius in (0.0, 0.5e-3)
    )
    assert flat == 0
    assert round_ >= 12


FINGER = {"trajectory": path((0, 0.02, 0.02, 42e-3), (0.4, 0.02, 0.02, 38e-3))}


def place(mesh, x, y):
    """Return a path of a press at a place."""
    points = [{**point, "position": [x, y, point["position"][2]]} for point in PRESS["waypoints"]]
    return body(mesh, {**PRESS, "waypoints": points})


def test_several_bodies_press_as_one_mesh_of_all():
    places = (-9e-3, 0.0, 0.0), (12e-3, 3e-3, 0.0)
    two = trimesh.util.concatenate(
        [mesh.copy().apply_translation(at) for mesh, at in zip((BALL, BOX), places, strict=True)]
    )
    apart = press_bodies(place(BALL, *places[0][:2]), place(BOX, *places[1][:2]))
    joint = press_bodies(body(two))
    # They touch no pin in common; the mesh's vertices are rounded elsewhere.
    assert np.abs(apart.history["height"] - joint.history["height"]).max() < 1e-9
    assert apart.history["body_force"].sum(axis=2).max(axis=0).min() > 1.0


def test_a_body_and_a_finger_are_felt_apart():
    ball = place(BALL, -15e-3, -15e-3)
    both, body_alone = press_bodies(ball, **FINGER), press_bodies(ball)
    finger_alone = run(resolve(table(**FINGER) | {"simulation": {"duration": 0.9}}))
    height = body_alone.history["height"] + finger_alone.history["height"] - REST
    # 0.00 µm from both alone.
    assert np.abs(both.history["height"] - height).max() < 5e-9
    force = finger_alone.history["total_force"]
    assert both.history["finger_force"] == pytest.approx(force, abs=1e-6)
    for name in ("max_cell_force", "max_total_force", "contact_share"):
        assert both.metrics[name] == pytest.approx(finger_alone.metrics[name], rel=1e-5)
    (felt,) = both.metrics["bodies"]
    said = f"body 1 at most {felt['max_total_force']:.2g} N on {felt['pressed_pins']} pins"
    assert said in both.summary()
    assert both.describe()["bodies"] == said


def test_a_fingertip_on_a_pin_that_a_body_presses_is_capped_too():
    deep = {"trajectory": path((0, 0, 0, 42e-3), (0.05, 0, 0, 25e-3), (0.9, 0, 0, 25e-3))}
    way = path((0, 0, 0, 38e-3 + 12e-3), (0.9, 0, 0, 38e-3 + 12e-3))
    alone = press_bodies(held=True, **deep)
    both = press_bodies(body(BALL, way), held=True, **deep)
    assert alone.metrics["max_cell_force"] > 1e6
    middle = len(both.history["position"]) // 2
    # 0.64 N of the body, and at most 1 N of a fingertip 1.6 mm deep.
    assert both.history["force"][:, middle].max() < 1.7


def test_a_fingertip_relaxes_while_a_body_hovers_over_its_pins():
    places = ((0, 42), (0.1, 39), (0.2, 60), (0.6, 60), (0.7, 39), (0.9, 39))
    twice = {"trajectory": path(*((time, 0, 0, height * 1e-3) for time, height in places))}
    hovers = ((0, 70), (0.25, 70), (0.3, 50.05), (0.6, 50.05), (0.62, 70))
    away = path(*((time, 0, 0, height * 1e-3) for time, height in hovers))
    alone = press_bodies(held=True, **twice)
    both = press_bodies(body(BOX, away), held=True, **twice)
    assert both.metrics["bodies"][0]["max_total_force"] == 0.0
    assert both.history["finger_force"] == pytest.approx(alone.history["total_force"], abs=1e-9)


def test_pins_beside_a_body_that_stops_suddenly_are_not_touched():
    # Within 0.1 s, the longest time between two undersides, the path bends by 40 mm.
    way = path((0, 0, 0, 0.23), (0.05, 0, 0, 0.111), (0.3, 0, 0, 0.111))
    full = {"actuator": {"rest_height": 0.1}, "simulation": {"duration": 0.3}}
    done = press_bodies(body(BOX, way), held=True, **full)
    assert done.history["force"].max() == 0.0


def press_on(scene, state, system, count):
    """Return the state after more control periods."""
    *_, last = periods(system, scene.trajectories(), state, count)
    return last


@pytest.mark.parametrize("others", [{}, FINGER], ids=["alone", "beside a finger"])
def test_a_stored_state_in_mid_press_goes_on_to_the_last_bit(others):
    (start, end), sides = DRAG["waypoints"], [0.9, 0.1, 0.2, 0.3]
    turned = {**DRAG, "waypoints": [start, {**end, "orientation": sides}]}
    scene = resolve(table(body(BOX, turned, damping=0.2), body(BALL), **others))
    whole = press_on(scene, begin(assemble(scene)), assemble(scene), 110)
    for count in (47, 58):  # neither is a multiple of the periods between two undersides
        first = assemble(scene)
        data = snapshot.dump(first, press_on(scene, begin(first), first, count))
        second = assemble(scene)
        after = press_on(scene, snapshot.load(second, data), second, 110 - count)
        assert snapshot.dump(second, after) == snapshot.dump(second, whole)


def test_the_error_estimate_covers_the_error():
    way = path((0, -20e-3, 0, 44e-3), (0.15, 10e-3, 5e-3, 43e-3))
    scene = resolve(table(body(BALL, way, travel=8e-3)))
    done = run(scene)
    bodies = tuple(replace(each, body=replace(each.body, travel=0.0)) for each in scene.bodies)
    fine = replace(scene, simulation=scene.simulation.refined(20), bodies=bodies, control=None)
    system = assemble(fine)
    system = replace(system, controller=Replay(system.grid, done.history["command"]))
    exact = [state.row(0) for state in periods(system, scene.trajectories(), begin(system), 30)]
    error = np.abs(exact - done.history["height"][1:]).max()
    assert 1e-6 < error < estimate_errors(scene, done.history).height < 1e-3


@pytest.mark.parametrize("stepper", ["richardson", "runge_kutta_4"])
def test_other_steppers_agree(stepper):
    heights = [
        press_bodies(body(BOX, DRAG), simulation=simulation).history["height"][-1]
        for simulation in ({}, {"stepper": stepper, "physics_step": 1e-3})
    ]
    # The default step is 5 ms: the closed form is then within some micrometers.
    assert np.abs(heights[1] - heights[0]).max() < 10e-6


def test_only_pins_below_the_outline_are_active():
    mesh = trimesh.creation.box((100e-3, 9e-3, 20e-3))
    way = path((0, 0, 0, 51e-3), (0.2, 0, 0, 46e-3))
    way["waypoints"] = [{**at, "orientation": [0.92388, 0, 0, 0.382683]} for at in way["waypoints"]]
    scene = resolve(table(body(mesh, way), size=41))
    system = assemble(scene)
    state = press_on(scene, begin(system), system, 40)
    pressed = np.count_nonzero(state.row(system.rows.force))
    # A bounding ball includes all pins within 50 mm, some 870.
    assert 90 < pressed <= state.active.near < 1.3 * pressed


def test_a_scene_of_bodies_is_written_read_and_changed(tmp_path, press):
    (tmp_path / "ball.stl").write_bytes(BALL.export(file_type="stl"))
    given = {"file": "ball.stl", "unit": "m", "scale": 0.5, "trajectory": PRESS}
    scene = resolve(table(given))
    (tmp_path / "mine.toml").write_text(format_scene(scene), encoding="utf-8")
    found = load(tmp_path / "mine.toml", [Setting("body.1.stiffness", "'0.3 N/m'")])
    assert found.bodies[0].body.file == str(tmp_path / "ball.stl")
    assert found.bodies[0].body.stiffness == 0.3
    assert find_under(found, 0.5).min() == pytest.approx(44e-3 - 6e-3, abs=1e-7)
    assert resolve(tabulate(found)) == found
    save(press, tmp_path)
    again = read_run(tmp_path, *HISTORY_ARRAYS).history
    assert all(np.array_equal(again[name], rows) for name, rows in press.history.items())
    assert "body" not in format_scene(resolve({}))


@pytest.mark.parametrize("pitch", [2.5e-3, 3e-3])
def test_no_fingertip_joins_bodies_in_a_file_of_any_pitch(pitch, tmp_path):
    # A file without a format has the contact's share of version 0.2, which is that of 3 mm.
    place = "{ time = 0, position = [0, 0, 0.06] }"
    head = f"control.method = 'plastic'\nlayout.pitch = {pitch}\nsimulation.duration = 1\n"
    text = f"{head}[[body]]\nfile = 'a.stl'\ntrajectory.waypoints = [{place}]\n"
    (tmp_path / "my.toml").write_text(text, encoding="utf-8")
    (finger,) = load(tmp_path / "my.toml").fingers
    assert finger.fingertip is None


def change(**values):
    """Return a table whose body has other values."""
    return table({**body(BALL), **values})


def stl(folder, triangles):
    """Write a binary STL of equal triangles."""
    one = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    (folder / "many.stl").write_bytes(bytes(80) + struct.pack("<I", triangles) + one * triangles)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (change(scale=0.0), "body #1.scale must be above 0"),
        (change(scale=float("nan")), "body #1.scale must be a finite number"),
        (change(stiffness=0), "body #1.stiffness must be above 0"),
        (change(damping=-1.0), "body #1.damping must be at least 0"),
        (change(cap=0.0), "body #1.cap must be above 0"),
        (change(samples=4), "body #1.samples must be odd"),
        (change(stifness=3.0), "body #1.stifness must be a known key"),
        (change(file="x.stl"), "body #1.file must be left out where mesh is given"),
        (change(up="y"), "body #1.up must be left out where mesh is given"),
        (change(unit="mm"), "body #1.unit must be left out where mesh is given"),
        (change(up="w"), "body #1.up must be one of auto, z, y, x, -z, -y, -x (got 'w')"),
        (change(unit="km"), "body #1.unit must be one of auto, mm, cm, m, inch (got 'km')"),
        (change(mesh=""), "body #1.file or mesh must be given"),
        (change(mesh="abc"), "body #1.mesh must be a mesh packed as text"),
        (change(mesh="", file="none.stl"), "body #1.file must be a file that exists"),
        (change(mesh="", file="note.txt"), "body #1.file must be the file of a mesh"),
        (change(mesh="", file="empty.stl"), "cut off (got empty.stl: 0 of at least 84 bytes)"),
        (change(mesh="", file="lines.obj"), "body #1.file must be triangles"),
        (change(mesh="", file="many.stl"), "body #1.file must have at most 1,000,000 triangles"),
        (change(trajectory={}), "body #1.trajectory must be a path with waypoints"),
        (
            change(trajectory=path((0, 0, 0, float("nan")))),
            "body #1.trajectory.waypoints #1.position",
        ),
        (
            change(trajectory=path((0, 0, 0, -0.01), (1, 0, 0, 0))),
            "body #1.trajectory must begin above",
        ),
        (
            table(body(trimesh.creation.box((0.01, 0.01, 1e-12)))),
            "body #1.mesh must have a thickness",
        ),
        (table(3), "body must be a list of tables"),
        (table(body(BALL), hand={}), "hand must be left out beside [[body]]"),
        # As of --with a finger's file: no finger presses where nobody said.
        (table(body(BALL), contact={"stiffness": 300.0}), "contact must be left out where only"),
        (
            table(body(BALL), method="virtual_master"),
            "body must be left out: the method virtual_master",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_cannot_press_is_refused_in_one_line(given, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "note.txt").write_text("no mesh", encoding="utf-8")
    (tmp_path / "empty.stl").write_bytes(b"")
    (tmp_path / "lines.obj").write_text("v 0 0 0\nv 1 1 1\nl 1 2\n", encoding="utf-8")
    if "many.stl" in str(given["body"][:1]):
        stl(tmp_path, 2_000_000)
    with refused_in_a_line(DigiclayError, re.escape(words)) as raised:
        assemble(resolve(given))
    assert len(str(raised.value)) <= 400


@pytest.mark.parametrize(
    "vertices",
    [np.full((3, 3), np.nan), np.zeros((3, 2)), np.zeros((0, 3))],
    ids=["NaN", "two coordinates", "none"],
)
def test_arrays_that_are_no_mesh_are_refused(vertices):
    with pytest.raises(DigiclayError, match="mesh must"):
        pack_mesh(vertices, [[0, 1, 2]])


def test_a_packed_mesh_of_too_many_triangles_is_refused():
    many = pack_mesh(np.eye(3), np.tile([0, 1, 2], (1_000_001, 1)))
    with pytest.raises(DigiclayError, match="of at most 1,000,000 triangles"):
        assemble(resolve(change(mesh=many)))


def run_batch(scene):
    return list(run_together([scene] * 2))


@pytest.mark.parametrize(
    "use, words",
    [(run_batch, "must have no bodies"), (begin_session, "must be left out")],
    ids=["a batch", "a server"],
)
def test_what_runs_scenes_without_bodies_refuses_them(use, words):
    with pytest.raises(DigiclayError, match=words):
        use(resolve(table(body(BALL))))


@pytest.mark.parametrize("others", [{}, FINGER], ids=["alone", "beside a finger"])
def test_the_plot_of_a_session_has_the_force_of_each_body(others):
    done = run(resolve(table(place(BALL, -15e-3, -15e-3), place(BALL, 15e-3, 0.0), **others)))
    axes = {axes.get_label(): axes for axes in session_figure(done.history, None).axes}
    lines = {line.get_label(): line.get_ydata() for line in axes["force"].get_lines()}
    for number, force in enumerate(done.history["body_force"].sum(axis=2).T, 1):
        assert np.array_equal(lines[f"body {number}"], force)


def test_memory_counts_the_forces_of_bodies():
    scene = resolve(table(body(BALL)))
    rows = assemble(scene).rows
    # As many periods as fill four fifths of the memory, without the forces of the body.
    fitting = 0.8 * measure_available_memory() / (scene.cells * BYTES_A_CELL)
    long = replace(scene.simulation, duration=fitting * scene.simulation.control_period)
    check_memory(replace(scene, simulation=long, bodies=()), rows)
    with pytest.raises(DigiclayError, match="free memory"):
        check_memory(replace(scene, simulation=long), rows)


def test_describe_names_the_bodies_their_sizes_and_paths(tmp_path, capsys):
    egg = BALL.copy().apply_scale((1.0, 2.0, 0.5))
    (tmp_path / "my.toml").write_text(format_scene(resolve(table(body(egg)))), encoding="utf-8")
    assert main(["describe", str(tmp_path / "my.toml")]) == 0
    assert "body 1: a packed mesh, 24 x 48 x 12 mm, its path until 0.9 s" in capsys.readouterr().out
