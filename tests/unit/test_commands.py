"""Commands beside run: compare, features, form; what is stopped before its end."""

import json
import shlex
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
import trimesh
from digiclay.cli import main
from digiclay.commands import compare as compare_command
from digiclay.commands import form as form_command
from digiclay.commands import run as run_command
from digiclay.commands.run import plan_meshes
from digiclay.core.metrics.metric_table import ERRORS
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene import forming
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.finished_run import find_row
from digiclay.core.session.run_scene import RUN_METRICS, Result, RunRecording
from digiclay.core.session.run_scene import run as run_scene
from digiclay.core.shapes.fitting import fit_shape
from digiclay.core.shapes.request import Shape
from digiclay.plots.sweep import PANELS, comparison

from tests.assemble import table
from tests.scene_files import SMALL_BLISTER, TOUCH, call, left, read_json, scene_text

pytestmark = pytest.mark.usefixtures("here")


PRESS = scene_text(11, 11, (0.0, 0.041), (0.3, 0.035), (0.5, 0.035))
BOTH = ["virtual_master", "cell_states"]


def test_both_methods_are_printed_side_by_side_and_kept_with_a_picture_of_the_same_input(
    here, capsys
):
    (here / "my.toml").write_text(PRESS, encoding="utf-8")
    line = "compare my.toml --methods cell_states,virtual_master --set control.force_setpoint=0.03"
    assert call(line) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["metric", "unit", *BOTH[::-1]]
    expected = {*RUN_METRICS, *ERRORS}
    printed = {line.split()[0]: line.split()[-2:] for line in lines[2 : 2 + len(expected)]}
    assert printed.keys() == expected
    assert all(float(value) > 0.0 for name in ERRORS for value in printed[name])
    assert [name for name, values in printed.items() if len(values) != 2] == []
    # The finger comes down 5 mm deep: Method I alone presses harder than fingers were measured.
    said = [line for line in lines if "the contact law does not hold" in line]
    assert [line.split(":")[0] for line in said] == ["virtual_master"]
    folder = here / "my_compare"
    files = ["compare.png", "comparison.json", "metrics.json", "points"]
    assert sorted(path.name for path in folder.iterdir()) == files
    known = read_json(folder / "metrics.json")["methods"]
    assert list(known) == BOTH[::-1]
    assert known["cell_states"].keys() == expected
    assert known["cell_states"]["duration"] == known["virtual_master"]["duration"] == 0.5
    # Other controllers, other forces: neither was run twice.
    assert known["cell_states"]["max_total_force"] != known["virtual_master"]["max_total_force"]
    # The setting reached both, and is asked of each cell that follows: of one at least, of all 121
    # at most.
    assert known["virtual_master"]["set_point"] == 0.03
    assert 0.03 <= known["cell_states"]["set_point"] < 121 * 0.03


#: A body that falls by more than its cap in a control period, and a path behind lines in turn.
FALL = """\
layout.rows = 5
[[body]]
file = "box.stl"
unit = "m"
trajectory.waypoints = [{time = 0, position = [0, 0, 90e-3]}, {time = 0.1, position = [0, 0, 30e-3]}]
"""
TURNS = f'{PRESS}[drive]\nsections = 2\npolicy = "round_robin"\n'
#: A fingertip that turns back within a step.
STEPS = "simulation.control_period = 0.02\nsimulation.physics_step = 0.02\n"
BENT = STEPS + scene_text(11, 11, *TOUCH)


@table(
    "scene, methods, said",
    {
        "a body that falls fast, by any method": (FALL, "elastic,plastic", "elastic, plastic: body 1 "),
        "lines in turn, by one method alone": (TURNS, "elastic,push_pull", "push_pull: drive.policy "),
        "a bent path, by any method": (BENT, ",".join(BOTH), f"{', '.join(BOTH)}: larger errors: within"),
    },
)  # fmt: skip
def test_a_comparison_tells_what_is_not_to_be_trusted_of_which_method(
    scene, methods, said, here, capsys
):
    trimesh.creation.box((20e-3, 20e-3, 20e-3)).export(here / "box.stl")
    (here / "my.toml").write_text(scene, encoding="utf-8")
    assert call(f"compare my.toml --methods {methods}") == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith(said) for line in lines) == 1
    falls = read_json(here / "my_compare" / "metrics.json")["beyond_cap"]
    assert [bool(falls[name]) for name in methods.split(",")] == [scene is FALL] * 2


def read_times(folder):
    """Return how long each method took, which no other run takes to the last digit."""
    known = read_json(folder / "metrics.json")["methods"]
    return {name: metrics["run_time"] for name, metrics in known.items()}


def test_a_comparison_goes_on_after_a_stop_and_gives_way_to_another_one_only_with_overwrite(
    here, capsys, monkeypatch
):
    (here / "my.toml").write_text(PRESS, encoding="utf-8")
    command = f"compare my.toml --methods {','.join(BOTH)} --out '{OUT}'"
    with monkeypatch.context() as patched:
        stop_before(patched, compare_command, "run", before=1)
        assert call(command) == 130
    assert capsys.readouterr().out.startswith(
        "Stopped: 1 of 2 methods are done and kept in first run. "
    )
    (point,) = (here / OUT / "points").iterdir()
    first = read_json(point)["figures"]["run_time"]
    assert call(command) == 0
    times = read_times(here / OUT)
    assert (list(times), times[BOTH[0]]) == (BOTH, first)
    assert call(command) == 0  # nothing is left to run
    assert read_times(here / OUT) == times
    other = f"{command} --set control.force_setpoint=0.03"
    assert call(other) == 2
    assert (
        "holds another comparison (virtual_master, cell_states, digiclay" in capsys.readouterr().err
    )
    assert call(f"{other} --overwrite") == 0
    assert not set(read_times(here / OUT).values()) & set(times.values())


def test_the_table_has_a_dash_for_what_was_not_found_and_every_panel_a_bar_for_every_method():
    found = {name: dict.fromkeys(RUN_METRICS, 12.345 * (i + 1)) for i, name in enumerate(BOTH)}
    assert len({len(line) for line in compare_command.table(found)}) == 1
    rows = [
        line.split()
        for line in compare_command.table({"one": dict.fromkeys(RUN_METRICS) | {"lag_max": 0.0025}})
    ]
    assert ["lag_max", "mm", "2.5"] in rows
    assert ["rfd", "N", "–"] in rows
    found = {name: dict.fromkeys(RUN_METRICS, 1.0) for name in (*BOTH, "third")}
    forces = {name: ([0.0, 1.0], [0.0, 0.4], [np.nan, 0.4]) for name in found}
    figure = comparison(found, forces, "scene")
    panels = {axes.get_label(): axes for axes in figure.axes}
    assert {key: len(panels[key].patches) for key in PANELS} == dict.fromkeys(PANELS, 3)
    assert len(panels["force"].get_legend().get_texts()) == 4  # and the set points


#: A folder whose name a shell would take for several words.
OUT = "first run"


def stop_before(monkeypatch, module, name, number=signal.SIGINT, before=0):
    """Send Ctrl-C, or another signal, when a command comes to a step; `before`: how often it may before."""
    step = getattr(module, name)
    passed = iter(range(before))

    def interrupted(*given, **known):
        assert signal.getsignal(number) is not signal.SIG_DFL  # it would end the tests
        if next(passed, None) is None:
            signal.raise_signal(number)
        return step(*given, **known)

    monkeypatch.setattr(module, name, interrupted)


@pytest.fixture
def stopped(monkeypatch, capsys):
    """Give a way to stop a command before a step; it returns the commands on stderr by their files."""

    def run(module, name, *arguments, number=signal.SIGINT):
        with monkeypatch.context() as patched:
            stop_before(patched, module, name, number)
            assert main([*arguments, "--out", OUT]) == 130
        said = capsys.readouterr().err.splitlines()
        pairs = (line.removeprefix("Stopped before ").split("; to have it: ") for line in said)
        return {what: shlex.split(command)[1:] for what, command in pairs}

    return run


RUN_FILES = {"scene.toml", "history.npz", "metrics.json"}


def list_files(folder):
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


FEW = ["--set", "layout.rows=13", "--set", "layout.columns=13", "--quiet"]


@table(
    "command, made",
    {
        "run": (
            ["run", "my.toml", "--quiet", "--export", "stl,obj", "--plots", "--no-errors"],
            ["surface.stl, surface.obj", "session.png, surface.png"],
        ),
        "form": (["form", "dome", *FEW], ["surface.stl", "displayed/surface.stl"]),
    },
)
def test_what_is_stopped_before_its_extras_names_them_and_how_to_make_them(
    command, made, here, stopped
):
    assert main([*command, "--out", "whole"]) == 0
    commands = stopped(run_command, "save", *command)
    assert list(commands) == made
    assert list_files(here / OUT) == RUN_FILES
    assert not read_json(here / OUT / "metrics.json")["incomplete"]
    for command in commands.values():
        assert main(command) == 0
    assert list_files(here / OUT) == list_files(here / "whole")
    for name in {*", ".join(made).split(", ")}:
        assert (here / OUT / name).read_bytes() == (here / "whole" / name).read_bytes()


def test_plot_writes_into_a_folder_prints_its_files_and_says_what_it_cannot(here, capsys, refused):
    run = "run my.toml --quiet --no-errors --out"
    assert call(f"{run} o") == 0
    assert call("plot o --out new/pictures") == 0
    assert [Path(line).name for line in capsys.readouterr().out.split()] == [
        "session.png",
        "surface.png",
    ]
    assert list_files(here / "new") == {"pictures/session.png", "pictures/surface.png"}
    refused("plot o --out my.toml/x", "my.toml/x cannot be a folder: my.toml is a file.")
    call(f"{run} row --set layout.rows=1")
    refused("plot row", "plot needs at least 2 x 2 cells")
    call(f"{run} none --set recorder=absent")
    refused("plot none", "none has no history.npz")


def test_a_run_stopped_before_its_errors_are_estimated_says_so(here, stopped):
    commands = stopped(Result, "estimate_errors", "run", "my.toml")
    assert list(commands) == ["its errors were estimated"]
    assert "height_error" not in read_json(here / OUT / "metrics.json")
    assert main(commands["its errors were estimated"]) == 0
    assert "height_error" in read_json(here / OUT / "metrics.json")
    assert left(here) == [OUT]


@table("number", {"Ctrl-C": signal.SIGINT, "as farms stop": signal.SIGTERM})
def test_a_run_stopped_within_its_session_is_kept_and_can_be_exported_as_it_says(
    number, here, stopped
):
    arguments = ("run", "my.toml", "--quiet", "--export", "ply")
    commands = stopped(RunRecording, "observe", *arguments, number=number)
    assert list(commands) == ["surface.ply"]
    assert read_json(here / OUT / "metrics.json")["incomplete"]
    assert main(commands["surface.ply"]) == 0
    assert (here / OUT / "surface.ply").is_file()


@pytest.mark.parametrize("step", ["scene_of", "fit_shape", "make_forming_scene"])
def test_form_that_is_stopped_before_its_session_writes_nothing(step, here, monkeypatch, capsys):
    monkeypatch.setattr(run_command, "run", lambda *given, **known: pytest.fail("It went on."))
    stop_before(monkeypatch, form_command, step)
    assert (
        main(["form", "dome", "--out", OUT, "--set", "simulation.duration=1e4", "--quiet"]) == 130
    )
    assert capsys.readouterr().err == "Stopped; no file is half-written.\n"
    assert left(here) == []


def test_the_instant_before_the_finger_is_named_to_the_last_digit(here):
    times = np.arange(2000) * 0.005
    for row in (1, 777, 1999):
        extra = plan_meshes(load(Path("my.toml")), {"time": times}, ["stl"], row, "displayed")
        later = extra.later(Path("o"))
        assert find_row({"time": times}, float(later[later.index("--time") + 1]), "--time") == row


MIDDLE = scene_text(9, 9, (0.0, 0.041), (0.2, 0.036), (0.3, 0.036), parts=SMALL_BLISTER)


@pytest.fixture(scope="module")
def pressed(tmp_path_factory):
    """The folder of a run that pressed the middle in."""
    folder = tmp_path_factory.mktemp("features")
    (folder / "my.toml").write_text(MIDDLE, encoding="utf-8")
    assert (
        main(
            ["run", str(folder / "my.toml"), "--out", str(folder / "run"), "--quiet", "--no-errors"]
        )
        == 0
    )
    return folder / "run"


@pytest.fixture
def run(pressed, tmp_path, monkeypatch):
    shutil.copytree(pressed, tmp_path / "run")
    monkeypatch.chdir(tmp_path)
    return tmp_path / "run"


def listed(capsys, *options):
    assert main(["features", "run", "--json", *options]) == 0
    return json.loads(capsys.readouterr().out)


def test_features_are_listed_in_a_table_and_none_at_the_start(run, capsys):
    assert call("features run") == 0
    counted, head, _, row = capsys.readouterr().out.splitlines()
    assert counted == "0 bosses and 1 crease"
    assert (head.split()[:3], row.split()[0]) == (["feature", "form", "pins"], "crease_1")
    assert call("features run --time 0") == 0
    assert capsys.readouterr().out == "0 bosses and 0 creases\n"


def deepest(run):
    """Return how far the deepest pin has sunk, and how high it is at the end, m."""
    with np.load(run / "history.npz") as history:
        return float((history["height"][0] - history["height"][-1]).max()), float(
            history["height"][-1].min()
        )


def test_json_is_in_si_units_from_any_former_surface_and_a_threshold_has_a_unit(run, capsys):
    (found,), (rest,) = listed(capsys), listed(capsys, "--former", "0.1")
    assert found["kind"] == "crease"
    # Features take heights to about a nanometer.
    assert found["depth"] == pytest.approx(deepest(run)[0], abs=1e-9)
    assert 40 in found["pins"]  # the middle of 9 x 9
    assert rest["depth"] < found["depth"]
    assert listed(capsys, "--former", "rest")[0]["depth"] == found["depth"]
    assert listed(capsys, "--threshold", "1") == listed(capsys, "--threshold", "1000 um") != [found]
    assert listed(capsys, "--smallest", "81") == []


@pytest.mark.parametrize(
    "options, names",
    [
        ("", ["surface.stl"]),
        ("--kind surface", ["skin.stl"]),
        ("--kind pins --format stl_ascii,3mf", ["pins.3mf", "pins.ascii.stl"]),
        ("--kind features", ["features.stl"]),
        ("--kind features --separate", ["crease_1.stl"]),
    ],
)
def test_each_kind_has_its_file(run, options, names):
    assert call(f"export run --out made --quiet {options}") == 0
    assert sorted(path.name for path in Path("made").iterdir()) == names


def test_a_skin_and_its_resolution_can_be_chosen(run):
    assert call("export run --quiet --skin smooth --resolution 3 --base-thickness 5") == 0
    made = trimesh.load_mesh(run / "surface.stl")
    assert len(made.faces) == 4 * 24 * 24 + 4 * 2 * 24
    # The spline goes a little lower.
    assert made.bounds[0, 2] == pytest.approx(1e3 * deepest(run)[1] - 5.0, abs=0.2)


@pytest.mark.parametrize("said", ["0.8", "800um"])
def test_a_length_is_in_millimeters_or_has_a_unit_behind_it(said, run):
    assert call(f"export run --base-thickness {said} --format obj --up z --quiet") == 0
    lines = (run / "surface.obj").read_text().splitlines()
    lowest = min(float(line.split()[3]) for line in lines if line.startswith("v "))
    assert lowest == pytest.approx(1e3 * deepest(run)[1] - 0.8, abs=1e-5)  # digits of the file


@pytest.mark.parametrize(
    "line, said",
    [
        ("export run --separate", "--separate needs --kind features."),
        ("export run --base-thickness 0", "--base-thickness must be above 0 m (got 0 m)."),
        ("export run --base-thickness thick", "argument --base-thickness: must be a number"),
        ("export run --kind features --time 0", "There is no feature of at least 3 pins"),
        ("features run --threshold -1", "--threshold must be at least 1e-06 m (got -0.001 m)."),
        ("features run --threshold '1 furlong'", "--threshold: must have a unit known here"),
        (
            "features run --threshold '1 N'",
            "argument --threshold: must be in m or a multiple of it",
        ),
        ("features run --smallest 0", "--smallest must be at least 1 (got 0)."),
        ("features run --former 99", "--former must be between 0 s and"),
        ("features run --former soon", "--former must be a time or 'rest'"),
        ("features nowhere", "nowhere is not the folder of a run"),
    ],
)
def test_a_mistake_is_one_line_and_no_file(run, refused, line, said):
    before = left(run)
    refused(line, said)
    assert left(run) == before


SMALL = ["--set", "layout.rows=13", "--set", "layout.columns=13"]
BED = make_grid(Layout(13, 13))


def form(folder, word, *options):
    """Form a shape on a bed of 13 x 13 cells; return its folder."""
    out = folder / "out"
    assert main(["form", word, "--out", str(out), "--overwrite", *SMALL, *options]) == 0
    return out


def read(out):
    with np.load(out / "history.npz") as stored:
        return dict(stored)


def test_a_mesh_goes_in_is_formed_and_comes_out(tmp_path, capsys):
    source = tmp_path / "Größe 1.stl"
    trimesh.creation.icosphere(subdivisions=3, radius=10.0).export(source)
    out = form(tmp_path, str(source), "--export", "stl,glb")
    said = capsys.readouterr().out.splitlines()
    assert (
        said[0]
        == "Größe 1.stl: heights from 40.0 to 52.0 mm, covers 137 of 169 cells, no cell clipped"
    )
    assert said[1].startswith("displayed to within ")
    assert said[2].startswith("formed: ")
    assert said[-1] == f"written to {out}"
    before, after = (
        trimesh.load_mesh(out / name) for name in ("displayed/surface.stl", "surface.stl")
    )
    assert before.is_watertight
    assert after.is_watertight
    assert (out / "surface.glb").is_file()
    # The finger draws a peak of some mm out of the top: 6 mm above where it touched, less its own
    # give.
    assert after.bounds[1, 2] - before.bounds[1, 2] > 4.0
    judged = read_json(out / "metrics.json")
    assert judged["display_error"] <= 10.1e-6
    assert judged["raised_volume"] > 1e-7
    assert judged["shape_covered"] == 137


def test_the_finger_comes_when_the_shape_stands_and_the_folder_alone_repeats_the_run(
    tmp_path, capsys
):
    source = tmp_path / "shape.npy"
    np.save(source, np.eye(4))
    out = form(tmp_path, str(source), "--finger", "press")
    assert float(capsys.readouterr().out.split("displayed to within ")[1].split(" µm")[0]) <= 10.0
    assert read(out)["total_force"].max() > 0.1
    source.unlink()
    again = run_scene(load(out / "scene.toml")).history
    assert again
    assert np.array_equal(again["height"], read(out)["height"])


@pytest.mark.parametrize(
    "refresh, preset",
    [("one_time", "viscous"), ("gradual", "paper"), ("approximate_gradual", "fast")],
)
def test_a_shape_stands_by_the_time_it_is_said_to(refresh, preset):
    table = {
        "layout": {"rows": 9, "columns": 9},
        "control": {"method": "plastic"},
        "preset": preset,
        "shape": {
            "file": "ripple",
            "rise": 30e-3,
            "foot": -10e-3,
            "refresh": refresh,
            "surfaces": 3,
        },
    }
    bare = resolve(table)
    system = assemble(bare)
    display = forming.find_display(system)
    assert display
    ready = forming.compute_display_time(display)
    scene = forming.make_forming_scene(bare, system, "away")
    height = run_scene(scene).history["height"]
    stands = np.abs(height - display.heights).max(axis=1) <= 10e-6 + 1e-12
    # Within the time, and not after a small part of it: nobody waits for nothing.
    assert stands[round(ready / 5e-3)]
    assert not stands[round(0.2 * ready / 5e-3)]


@pytest.mark.parametrize("x, y", [(0.0, 0.0), (7.3e-3, -2.1e-3)])
def test_the_finger_touches_the_highest_part_nearest_to_the_middle_at_the_height_it_is_said_to(
    x, y
):
    top = np.full(169, 40e-3)
    top[[0, 60, 84]] = 50e-3, 49.9e-3, 41e-3
    assert forming.find_summit(BED, top) == (float(BED.x[60]), float(BED.y[60]))
    heights = fit_shape(Shape(file="crater"), BED, Actuator()).heights
    touch = forming.find_touch_height(BED, heights, Fingertip(), x, y)
    finger = Fingertip()
    # The ellipsoid by its own equation, as far out as it reaches.
    square = ((BED.x - x) / finger.length) ** 2 + ((BED.y - y) / finger.width) ** 2
    under = touch + finger.height * (1.0 - np.sqrt(np.maximum(1.0 - square, 0.0)))
    near = square < 0.9
    assert np.min((under - heights)[near]) == pytest.approx(0.0, abs=1e-12)
