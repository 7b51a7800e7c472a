"""The command line: what options reach; exit codes, one line a mistake, no folder left behind; signals."""

import os
import re
import signal
import sys
from pathlib import Path

import digiclay
import numpy as np
import pytest
from digiclay import __version__
from digiclay.cli import main
from digiclay.commands import describe, export, render
from digiclay.core.base.errors import LONGEST, one_line
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.layout import Layout

from tests.assemble import AWAY, one_cell, path, record, scripted
from tests.other_process import PROGRAM, finish, start
from tests.scene_files import call, left, read_json

pytestmark = pytest.mark.usefixtures("here")


def test_a_run_is_written_to_a_folder_called_like_the_scene_and_says_so(here, capfd):
    assert call("run my.toml") == 0
    out, err = capfd.readouterr()
    summary, where = out.splitlines()
    assert summary.startswith("0.1 s simulated in ")
    # No progress is shown where there is no terminal.
    assert (where, err) == ("written to my", "")
    assert left(here / "my") == ["history.npz", "metrics.json", "scene.toml"]
    versions = read_json(here / "my" / "metrics.json")["versions"]
    assert versions["digiclay"] == __version__
    assert call("run my.toml --quiet --out first") == 0
    assert capfd.readouterr() == ("", "")


def test_settings_and_stepper_reach_the_run_which_can_be_run_again_from_its_folder(here):
    call("run my.toml --quiet --set layout.rows=2 --stepper runge_kutta_4")
    assert read_json(here / "my" / "metrics.json")["stepper"] == "runge_kutta_4"
    call("run my --quiet --out second")
    with (
        np.load(here / "my" / "history.npz") as one,
        np.load(here / "second" / "history.npz") as other,
    ):
        assert one["height"].shape == (21, 8)
        assert [name for name in one.files if not np.array_equal(one[name], other[name])] == []


MISTAKES = {
    "run my.toml --set fluid.density=0": "--set: fluid.density must be above 0 kg/m3",
    "run my.toml --set fluid.densty=1": "Did you mean fluid.density?",
    "run my.toml --set nothing": "must be KEY=VALUE (got 'nothing')",
    "run my.toml --stepper leapfrog": "--stepper: simulation.stepper must be one of",
    "run my.toml --method hand": "--method: control.method must be one of",
    "run my.toml --set simulation.duration=1e6": "free memory",
    "run other.toml": "other.toml: there is no such file.",
    "form d.png": "d.png is a folder, not a file.",
    "batch d.png": "d.png is a folder, not a file.",
    "run ridge_mound_vally": "Did you mean ridge_mound_valley?",
    "run my.toml --export stp": "known are stl, stl_ascii, obj, ply, glb, 3mf",
    "run my.toml --set layout.rows=1 --export stl": "at least 2 x 2 cells",
    "run my.toml --set recorder=absent --plots": "--plots needs a recorder",
    "run my.toml --out my.toml": "my.toml is a file",
    "run my.toml --out d.png": "d.png is not empty",
    "form dome --out d.png --quiet": "replace the run in it with --overwrite",
    "": "the following arguments are required: COMMAND",
    "walk": "invalid choice: 'walk'",
    "run": "the following arguments are required: SCENE",
    "describe my.toml --set layout.rows=0": "layout.rows must be at least 1",
    "export nowhere": "nowhere is not the folder of a run",
    "plot nowhere": "nowhere is not the folder of a run",
    "render my.toml --size 3": "must be WIDTHxHEIGHT",
    "render my --out my.jpg": "--out must end with .png (got my.jpg).",
    "render my --film --out my.avi": "--out must end with .mp4 (got my.avi).",
    "render my --out d.png": "--out must be a file (d.png is a folder).",
    "render my --out my.toml/a.png": "my.toml cannot be a folder: my.toml is",
    "render my --size 1x1": "--size must be at least 16 (got 1).",
    "run my.toml --budget 0": "--budget must be above 0 m (got 0 m).",
    "run my.toml --fast": "digiclay run: unrecognized arguments: --fast. See '",
    "form craters": "Did you mean crater?",
    "form nowhere.stl": "nowhere.stl: there is no such file.",
    "form dome --set shape.fit=actual --set shape.x=1": "leave the shape over the bed",
    "form dome --set recorder=absent": "form needs a recorder",
    "form dome --set shape=absent": "form needs a shape",
    "form dome --set fingertip=absent --quiet": "fingertip must be given to form a shape",
    "form dome --set layout.rows=1": "form needs at least 2 x 2 cells",
    "compare my.toml --methods cell_stats": "did you mean cell_states",
    "compare my.toml --methods ,": "must name at least one method",
    "compare my.toml --method cell_stats": "Did you mean cell_states",
    "compare my.toml --method a.py:A --method b.py:B": "--method: may be given once",
    "compare my.toml --out my.toml": "my.toml is a file",
    "compare my.toml --set control.spring_trigger=1": "spring_trigger must be a parameter of virtual_master",
    "job .": ". is not the folder of a job: it has no job.toml.",
    "benchmark session --help": "run from a checkout: 'python -m benchmarks --help'",
}


@pytest.mark.parametrize("line, said", MISTAKES.items())
def test_a_mistake_is_one_line_exit_code_2_and_no_folder(line, said, here, refused):
    (here / "d.png").mkdir()
    (here / "d.png" / "metrics.json").touch()
    refused(line, said)
    assert left(here) == ["d.png"]


def test_a_run_is_replaced_only_when_asked(here):
    call("run my.toml --quiet --export stl")
    before = (here / "my" / "metrics.json").read_bytes()
    assert (call("run my.toml --quiet"), (here / "my" / "metrics.json").read_bytes()) == (2, before)
    call("run my.toml --quiet --overwrite")
    assert [*left(here), (here / "my" / "surface.stl").exists()] == ["my", False]


def test_export_writes_the_surface_of_a_run_in_a_unit_at_an_instant_and_refuses_what_is_damaged(
    here, capsys, refused
):
    call("run my.toml --quiet")
    call("export my --format ply,glb")
    made = [os.path.join("my", f"surface.{kind}") for kind in ("ply", "glb")]
    assert capsys.readouterr().out.split() == made
    call("export my --format obj --unit m --time 0 --up z --out meshes --quiet")
    # At rest all pins are 40 mm high; OBJ files are written to 1e-8.
    lines = (here / "meshes" / "surface.obj").read_text().splitlines()
    highest = max(float(line.split()[3]) for line in lines if line.startswith("v "))
    assert highest == pytest.approx(0.04, abs=1e-8)
    for when in ("-1", "0.2", "nan", "1 mm", "soon"):
        refused(f"export my '--time={when}'", "--time")
    for count in ("0", "-1", "2.5", "65", "9" * 400, "x"):
        for command in ("export", "features"):
            refused(f"{command} my --resolution={count}", " 64")
    scene, history = here / "my" / "scene.toml", here / "my" / "history.npz"
    scene.write_text(
        scene.read_text(encoding="utf-8").replace("rows = 3", "rows = 4"), encoding="utf-8"
    )
    refused("export my", "height must have the shape (21, 16) of its scene (got (21, 12))")
    history.write_bytes(history.read_bytes()[:1000])
    refused("export my", "cannot be read as a run's history")


def test_describe_counts_cells_periods_and_bytes_and_lists_every_parameter_with_its_meaning(capsys):
    call("describe my.toml --set conduit=absent")
    out = capsys.readouterr().out
    lines = [line.split() for line in out.splitlines()]
    assert [line[0] for line in lines if line[1:] == ["left", "out"]] == ["conduit", "sensors"]
    # Height, three filters, the valve, two commands on their way, target, force: 9 float64.
    counts = ("3 x 4 = 12 cells", "20 control periods", "9 rows", "72 bytes")
    assert [part for part in counts if part not in out] == []
    # Of the law of the valve that is selected, not of others.
    assert ("orifice diameter" in out, "stall force" in out) == (True, False)
    assert main(["describe", "tap", "--parameters", "--set", "layout.pitch=3.5 mm"]) == 0
    text = capsys.readouterr().out
    parts = {"layout": Layout, "actuator": Actuator, "control": VirtualMaster}
    names = [
        f"{section}.{name} = " for section, part in parts.items() for name in list_quantities(part)
    ]
    assert [name for name in names if name not in text] == []
    meaning = "distance of neighboring cells in a row; above 0, at most 0.5; P"
    assert f"layout.pitch = 0.0035 m\n    {meaning}\n" in text


@pytest.mark.parametrize("command", [[], ["run"], ["describe"], ["export"], ["render"], ["paper"]])
def test_help_comes_with_an_example(command, capsys):
    code, out = main([*command, "--help"]), capsys.readouterr().out
    assert (code, f"  digiclay {' '.join(command)}" in out.partition("examples:")[2]) == (0, True)
    assert (main(["--version"]), capsys.readouterr().out) == (0, f"digiclay {__version__}\n")


MEANT = {
    "rn my.toml": "Did you mean run?",
    "Run my.toml": "Did you mean run?",
    "ex my": "Did you mean export?",
    "run my.toml --exprot stl": "Did you mean --export (not --exprot)?",
    "run my.toml --exprot=stl": "Did you mean --export (not --exprot)?",
    "run my.toml -export stl": "Did you mean --export (not -export)?",
    "run my.toml --over": "Did you mean --overwrite (not --over)?",
    "sweep tap --varry layout.rows=3 --out o": "Did you mean --vary (not --varry)?",
    "export my --kind soild": "Did you mean solid?",
    "--verson": "Did you mean --version (not --verson)?",
    **dict.fromkeys(
        ["walk", "run my.toml --fast", "run my.toml --set x", "run -- --exprot stl"], ""
    ),
}


@pytest.mark.parametrize("line, asked", MEANT.items())
def test_a_misspelt_word_gets_a_suggestion_and_what_is_like_nothing_gets_none(line, asked, capsys):
    assert main(line.split()) == 2
    said = capsys.readouterr().err
    assert f". {asked} See 'digiclay" in said if asked else "Did you mean" not in said


@pytest.mark.parametrize(
    "arguments",
    [
        ["run", "my.toml", "--set", f"layout.rows={'x' * 5000}"],
        ["run", "my.toml", "--set", "valve.stroke='\x1b[2J\x07 a\nb'"],
        ["run", "x" * 5000], ["run", "my.toml", "--export", "x" * 5000], ["y" * 5000],
        ["run", "my.toml", f"--{'z' * 5000}"],
    ],
)  # fmt: skip
def test_an_error_is_one_line_of_a_sane_length(arguments, capsys):
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert 0 < len(said) <= 401
    assert said[:-1].isprintable()
    # What is cut keeps its beginning and its end.
    whole = "a" * LONGEST
    cut = one_line(f"b{whole}c")
    assert (one_line(f" {whole}\n"), cut[0], cut[-1], " ... " in cut) == (whole, "b", "c", True)
    assert len(cut) == LONGEST


def test_a_file_that_fails_half_way_is_one_line(monkeypatch, capfd):
    def full(*given):
        raise OSError(28, "No space left on device", "a file")

    monkeypatch.setattr(describe, "description", full)
    assert call("describe my.toml") == 2
    assert capfd.readouterr().err == "a file cannot be used: No space left on device.\n"


def test_the_list_of_commands_has_a_line_for_each_but_for_plumbing(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "120")
    main(["--help"])
    listed = capsys.readouterr().out.partition("COMMAND\n")[2].partition("\n\n")[0].splitlines()
    assert [line for line in listed if len(line.split()) < 3 or not line.startswith("    ")] == []
    assert {line.split()[0] for line in listed} & {"job", "page", "benchmark"} == set()
    call("job --help")
    said = capsys.readouterr().out.split("\n\n")[1]
    assert (said[0].isupper(), said[-1]) == (True, ".")


def test_a_terminal_that_does_not_know_a_letter_gets_another_and_a_notebook_hinders_no_plot(here):
    backend = "module://matplotlib_inline.backend_inline"
    known = {"PYTHONIOENCODING": "ascii", "MPLBACKEND": backend}
    code, out, err = finish(start(PROGRAM, "run", "my.toml", "--plots", env=known))
    assert (code, err, "height error about " in out) == (0, "", True)
    assert (here / "my" / "session.png").is_file()


def test_a_program_whose_output_is_closed_runs_all_the_same(here):
    script = f"import sys; sys.stdout = sys.stderr = None\n{PROGRAM}"
    assert finish(start(script, "run", "my.toml")) == (0, "", "")
    assert (here / "my" / "history.npz").is_file()


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_a_signal_while_the_program_starts_stops_it_in_one_line(here):
    # As numpy and trimesh do: what an import is interrupted by passes for a library that is broken.
    script = (
        "import os, signal, sys\n"
        "class Interrupt:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'numpy' and self in sys.meta_path:\n"
        "            sys.meta_path.remove(self)\n"
        "            try:\n"
        f"                os.kill(os.getpid(), {int(signal.SIGINT)})\n"
        "            except KeyboardInterrupt:\n"
        "                raise ImportError('numpy is broken')\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "from digiclay.cli import console; console()\n"
    )
    code, _, err = finish(start(script, "run", "my.toml"))
    assert (code, err, left(here)) == (130, "Stopped; no file is half-written.\n", [])


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_what_is_written_before_a_signal_is_not_denied(here, monkeypatch, capfd):
    call("run my.toml --quiet --no-errors")
    write = export.write

    def interrupted(*given):
        if given[3] == "ply":
            raise KeyboardInterrupt
        return write(*given)

    monkeypatch.setattr(export, "write", interrupted)
    code = call("export my --format obj,ply")
    assert (code, capfd.readouterr()) == (
        130,
        (f"{Path('my', 'surface.obj')} (y up)\n", "Stopped; no file is half-written.\n"),
    )


@pytest.mark.parametrize("said, cores", [("", "1"), ("3", "3")])
def test_the_program_works_on_one_core_unless_told_otherwise(said, cores):
    script = (
        "import os, sys\n"
        f"os.environ['OPENBLAS_NUM_THREADS'] = {said!r}\n"
        "os.environ['OPENBLAS_NUM_THREADS'] or os.environ.pop('OPENBLAS_NUM_THREADS')\n"
        "from digiclay import cli\n"
        "def parse(): sys.exit(print(os.environ['OPENBLAS_NUM_THREADS'], 'numpy' in sys.modules))\n"
        "cli.run_as_program(parse)\n"
    )
    # Numpy reads it when it is imported, so that must not have happened before.
    assert finish(start(script))[1].split() == [cores, "False"]


def test_a_run_is_kept_whatever_goes_wrong_with_what_is_made_of_it(here, monkeypatch):
    def draw(*_):
        raise ValueError("a fault of a library")

    monkeypatch.setattr(render, "plotted", draw)
    with pytest.raises(ValueError, match="a fault of a library"):
        call("run my.toml --plots --no-errors --quiet")
    assert left(here / "my") == ["history.npz", "metrics.json", "scene.toml"]


def test_a_run_imports_no_other_command_and_none_of_the_packages_it_does_without(here):
    script = "import sys; from digiclay.cli import main; main(sys.argv[1:]); print(*sys.modules)"
    modules = finish(start(script, "run", "my.toml", "--out", "o", "--quiet"))[1].split()
    parts = {name.removeprefix("digiclay.") for name in modules if name.startswith("digiclay")}
    files = {"arguments", "parser", "progress", "refusals", "run", "series_options", "stop"}
    assert {part for part in parts if part.startswith("commands.")} == {
        f"commands.{name}" for name in files
    }
    unused = {"batch", "mesh_io", "shapes", "studies", "surface"}
    assert not {part.split(".")[1] for part in parts if part.startswith("core.")} & unused
    assert {part.split(".")[0] for part in parts} == {"digiclay", "cli", "commands", "core"}
    assert not {"core.control.own_method", "difflib", "shlex"} & {*parts, *modules}


@pytest.mark.parametrize(
    "line, missing, install",
    [
        ("run my.toml --render", "bpy", "digiclay[blender]"),
        ("run my.toml --plots", "matplotlib", "pip install digiclay[plots]"),
        ("sweep my.toml --vary seed=3,4 --out o --scheduler tcp://a:1", "distributed", "digiclay[cluster]"),
    ],
)  # fmt: skip
def test_a_missing_library_is_told_before_any_work(
    line, missing, install, here, refused, monkeypatch
):
    for name in [name for name in sys.modules if name.partition(".")[0] == missing]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delitem(sys.modules, "digiclay.compat", raising=False)
    monkeypatch.setitem(sys.modules, missing, None)  # as Python marks what cannot be imported
    refused(line, install)
    assert left(here) == []


def test_a_job_of_a_batch_exports_without_any_library(here):
    (here / "jobs.toml").write_text(
        'scenes = ["my.toml"]\nexport = ["stl", "3mf"]\nerrors = false\n'
    )
    assert call("batch jobs.toml --prepare --quiet") == 0
    missing = "import sys; sys.modules.update(dict.fromkeys(['trimesh', 'scipy', 'matplotlib']))\n"
    code, _, err = finish(start(missing + PROGRAM, "job", "jobs/jobs/my"))
    assert code == 0, err
    assert {"surface.stl", "surface.3mf"} <= {
        path.name for path in (here / "jobs/runs/my").iterdir()
    }


def described(capsys, *settings):
    """Return the lines of the section on pins, by what they are about."""
    assert (
        main(["describe", "slow_press", *(part for one in settings for part in ("--set", one))])
        == 0
    )
    section = capsys.readouterr().out.split("\nThe pins\n")[1].split("\n\n")[0]
    joined = re.sub(r"\n {6,}", " ", section)
    return {line[:12].strip(): line[12:].strip() for line in joined.splitlines()}


def numbers(text):
    return [float(found) for found in re.findall(r"-?\d+(?:\.\d+)?", text)]


#: Reservoirs that are not alike, so that up and down are told apart.
UNLIKE = ("supply.high=0.4 bar", "supply.low=-0.6 bar", "layout.rows=12", "layout.columns=10")


def test_speeds_stall_forces_and_refresh_are_those_of_a_pin_with_its_valve_wide_open(capsys):
    said, moved = described(capsys, *UNLIKE), []
    for command in (1.0, -1.0):
        one = one_cell(
            supply=Supply(0.4e5, -0.6e5), control=scripted(lambda time, x, y, k=command: k)
        )
        height = record(one, AWAY, 60).height[:, 0]
        # The valve is open after five of its time constants; then the pin goes at one speed.
        moved.append(1e3 * abs(height[60] - height[20]) / (40 * one.period))
    # Three digits are written.
    up, down = numbers(said["free speed"])
    assert [up, down] == pytest.approx(moved, rel=5e-3)
    forces = [pressure * Actuator().area for pressure in (0.4e5, 0.6e5)]
    assert numbers(said["stall"]) == pytest.approx(forces, rel=5e-3)
    raised = scripted(lambda time, x, y: 1.0)
    pressing = one_cell(supply=Supply(0.4e5, -0.6e5), control=raised, relaxation=None)
    # The pin rises against a finger 10 mm above, and stops there.
    stalled = record(pressing, path((0.0, 0.0, 0.0, 50.0)), 400).force[-1, 0]
    assert numbers(said["stall"])[0] == pytest.approx(stalled, rel=5e-3)
    assert numbers(said["valves"]) == [120]
    filled, emptied, volume = numbers(said["refresh"])
    # 100 mm of stroke; three digits each.
    assert [filled * up, emptied * down] == pytest.approx([100.0, 100.0], rel=1e-2)
    assert volume == pytest.approx(120 * np.pi * 100.0 * 1e-3, rel=5e-3)
    # A reservoir that cannot lower a pin never empties the bed.
    said = described(capsys, "supply.low=0")
    assert ", 0 mm/s down" in said["free speed"]
    assert "floor: never" in said["refresh"]


def test_the_refresh_of_a_matrix_drive_is_that_of_its_lines_in_turn(capsys):
    bed = {
        "layout.rows": 4,
        "layout.columns": 3,
        "actuator.rest_height": 0.0,
        "drive.sections": 2,
        "drive.policy": "one_time",
        "fingertip": "absent",
    }
    said = described(capsys, "control=absent", *(f"{key}={value}" for key, value in bed.items()))
    valves, pins, lines = numbers(said["valves"])
    assert (valves, pins, lines) == (4 + 2 * 3, 12, 4)
    turns, filled, *_ = numbers(said["refresh"])
    np.save("full.npy", np.full((4, 3), 0.1))
    display = {"method": "shape_display", "shape": "full.npy", "patience": 10.0}
    control = {**display, "refresh": "approximate_gradual", "surfaces": 1}
    rising = digiclay.scene({"control": control}, {**bed, "simulation.duration": 10.0})
    height = digiclay.run(rising).history["height"]
    risen = 5e-3 * np.count_nonzero(height.min(axis=1) < 0.0999)
    assert (turns, filled) == (2, pytest.approx(risen, rel=0.02))


def test_the_leak_per_minute_is_that_of_a_bed_at_rest(capsys):
    changes = {
        "layout.rows": 3,
        "layout.columns": 3,
        "drive.line_lag": 2e-3,
        "drive.leak": 1e-3,
        "drive.sections": 1,
        "control": "absent",
        "fingertip": "absent",
        "simulation.duration": 6.0,
    }
    said = described(capsys, *(f"{key}={value}" for key, value in changes.items()))
    height = digiclay.run(digiclay.scene({}, changes)).history["height"]
    sunk = 1e3 * (height[0] - height[-1])
    assert 10.0 * sunk == pytest.approx(numbers(said["command 0"])[0], rel=0.02)


def test_the_stiffness_felt_is_the_slope_of_a_quick_press_on_a_shut_pin(capsys):
    first, pressed, force = numbers(described(capsys)["felt"])
    # 5 µm a period, of a pulp that does not relax.
    pulp = one_cell(relaxation=None)
    down = path((0.0, 0.0, 0.0, 40.0), (1.0, 0.0, 0.0, 39.0), interpolation="linear")
    history = record(pulp, down, 200)
    stiffness = np.gradient(history.force[:, 0], 1e-3 * history.time)
    assert np.interp(force, history.force[:, 0], stiffness) == pytest.approx(pressed, rel=0.02)
    assert np.interp(1e-3, history.force[:, 0], stiffness) == pytest.approx(first, rel=0.05)
