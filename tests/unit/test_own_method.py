"""Control methods of one's own: command line, scenes, processes, job series, template; their mistakes."""

import json
import pickle
import re
import subprocess
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.job_steps import RunState, judge_run
from digiclay.core.base.errors import MethodError, SceneError
from digiclay.core.batch.run_together import run_together
from digiclay.core.control.methods import METHODS, list_added, remove_method
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.session.finished_run import read_run
from digiclay.core.session.run_scene import run
from digiclay.plugins import method_loader
from digiclay.plugins.method_loader import load_method
from numpy.testing import assert_array_equal

from tests.assemble import assert_near
from tests.own_methods import (
    COPY,
    PAD,
    refused,
    small,
    write_method,
)
from tests.scene_files import command, read_text, write_text
from tests.timeouts import TIMEOUT

pytestmark = pytest.mark.usefixtures("folder", "no_methods")


def test_a_method_runs_by_its_file_and_its_parameters_are_in_the_scene_file():
    write_method(Path())
    name = load_method("pad.py:SoftPad")
    assert (name, name in METHODS, name in list_added()) == ("soft_pad", False, True)
    scene = small(name, "control.step=80 um")
    text = format_scene(scene)
    assert 'method = "soft_pad"' in text
    assert "# m: way in a control period" in text
    softer = run(small(name, "control.step=20 um")).history["height"].min()
    assert run(scene).history["height"].min() < softer < 0.04


def test_the_code_is_shipped_to_processes_that_have_no_file(folder):
    path = write_method(folder)
    scene = small(load_method("pad.py:SoftPad"), "control.step=70 um")
    packed = pickle.dumps(scene)
    path.unlink()
    script = (
        "import pickle, sys; from digiclay.core.session.run_scene import run\n"
        "scene = pickle.load(sys.stdin.buffer)\n"
        "sys.stdout.buffer.write(run(scene).history['height'].tobytes())"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        input=packed,
        capture_output=True,
        check=True,
        timeout=TIMEOUT,
    )
    assert done.stdout == run(scene).history["height"].tobytes()
    remove_method("soft_pad")
    assert pickle.loads(packed).control.step == 70e-6


def test_an_installed_package_offers_a_method_by_its_name(folder, monkeypatch):
    write_method(folder, name="padpackage.py")
    monkeypatch.syspath_prepend(folder)
    info = folder / "pads-1.2.dist-info"
    info.mkdir()
    write_text(info / "METADATA", "Metadata-Version: 2.1\nName: pads\nVersion: 1.2\n")
    write_text(info / "entry_points.txt", "[digiclay.methods]\npad = padpackage:SoftPad\n")
    with pytest.raises(SceneError, match=r"must be one of virtual_master"):
        small("pad")  # installed is not loaded
    assert "padpackage" not in sys.modules
    scene = small(load_method("pad"))
    assert scene.method == "pad"
    packed = pickle.dumps(scene)
    assert b"way in a control period" not in packed
    remove_method("pad")
    assert run(pickle.loads(packed)).metrics["method"] == "pad"
    remove_method("pad")
    write_text(folder / "padpackage.py", PAD + "\n# another\n")
    with pytest.raises(MethodError, match=r"The method pad must be that of pads 1.2 here too"):
        pickle.loads(packed)
    monkeypatch.setattr(
        "importlib.metadata.entry_points",
        lambda **_: [
            EntryPoint("pad", "one:Pad", method_loader.GROUP),
            EntryPoint("pad", "two:Pad", method_loader.GROUP),
        ],
    )
    with pytest.raises(MethodError, match=r"one installed package \(got one:Pad, two:Pad\)"):
        load_method("pad")


def test_a_copy_of_method_one_gives_its_run_bit_for_bit(folder):
    write_method(folder, COPY, "one.py")
    name = load_method("one.py:MethodOne")
    own, built_in = run(small(name)), run(small("virtual_master"))
    assert built_in.history["mode"].max() > 1
    for key, values in built_in.history.items():
        assert_array_equal(own.history[key], values, key)
    assert own.metrics["losses"] == built_in.metrics["losses"]


#: Opens the valves of pressed pins; the other one then raises all it was shown at the root of each
#: view.
OPEN = f"{PAD.partition('        return')[0]}        orders = Orders(cells.target, -0.2 * down, 3 * down)\n"
CHEAT = f"""{OPEN.replace("SoftPad", "Cheat")}
        for shown in (*cells, device.grid.x, device.grid.y):
            while isinstance(shown.base, np.ndarray):
                shown = shown.base
            shown.flags.writeable = True
            shown += shown.dtype.type(1)
        return memory, orders
"""


def test_nothing_shown_leads_to_the_bed_and_openings_are_limited_to_those_of_a_valve(folder):
    write_method(folder, f"{OPEN}        return memory, orders\n")
    write_method(folder, CHEAT, "cheat.py")
    honest, cheat = (run(small(load_method(word))) for word in ("pad.py:SoftPad", "cheat.py:Cheat"))
    for key, values in honest.history.items():
        assert_array_equal(cheat.history[key], values, key)
    heights = []
    for number, opening in enumerate((-3, -1, 0, 1, 3)):
        orders = f"return memory, Orders(opening=np.full(cells.height.size, {opening}))"
        text = f"{PAD.partition('        down')[0]}        {orders}\n".replace(
            "SoftPad", f"Pad{number}"
        )
        write_method(folder, text, "open.py")
        heights.append(run(small(load_method(f"open.py:Pad{number}"))).history["height"].sum())
    assert heights[0] == heights[1] < heights[2] < heights[3] == heights[4]


def test_a_batch_gives_what_the_runs_give_alone_and_a_shape_is_displayed_before(folder):
    write_method(folder)
    name = load_method("pad.py:SoftPad")
    scenes = [
        small(name, f"control.step={step} um", "sensors.force_noise=1 mN") for step in (20, 40, 80)
    ]
    found = {number: result.history["height"] for number, result in run_together(scenes)}
    for number, scene in enumerate(scenes):
        assert_near(found[number], run(scene).history["height"], 1e-12)
    assert np.abs(found[0] - found[2]).max() > 1e-5
    shown = run(small(name, "shape.file=saddle", "simulation.duration=0.4")).history["height"]
    assert np.ptp(shown[-1]) > 1e-3


# A job series: the code lies beside each job, a command loads it.

JOBS = """
scenes = ["tap"]
methods = ["elastic"]
errors = false

[settings]
small = { layout.rows = 11, layout.columns = 11, simulation.duration = 0.05 }
"""
JOB = Path("jobs", "jobs", "tap-soft_pad-small")
RUN = Path("jobs", "runs", "tap-soft_pad-small")


@pytest.fixture
def jobs(folder):
    write_text(folder / "jobs.toml", JOBS)
    write_method(folder)
    return folder


def prepare():
    code = main(command("batch jobs.toml --method pad.py:SoftPad --prepare --quiet"))
    remove_method("soft_pad")
    return code


def test_a_job_has_its_code_beside_it_and_is_done_again_after_a_change_of_it(jobs, capsys):
    assert prepare() == 0
    assert sorted(path.name for path in JOB.iterdir()) == ["job.toml", "method.py", "scene.toml"]
    assert not (JOB.with_name("tap-elastic-small") / "method.py").exists()
    assert read_text(JOB / "method.py") == PAD
    assert "--method path/to/mine.py:Mine" in refused(capsys, "job", str(JOB), "--quiet")
    assert judge_run(JOB, RUN) is RunState.ABSENT
    own = command("--method method.py:SoftPad --quiet")
    assert main(["job", str(JOB), *own]) == 0
    assert judge_run(JOB, RUN) is RunState.WHOLE
    found = json.loads(read_text(RUN / "metrics.json"))
    assert found["versions"]["method"].startswith("method.py:SoftPad sha256:")
    remove_method("soft_pad")
    write_method(jobs, PAD.replace("50e-6", "60e-6"))
    assert prepare() == 0
    assert judge_run(JOB, RUN) is RunState.CHANGED
    assert main(["job", str(JOB), *own]) == 0
    assert judge_run(JOB, RUN) is RunState.WHOLE
    assert main(command("batch jobs.toml --method pad.py:SoftPad --submit cuecmd --quiet")) == 0
    lists = "".join(read_text(path) for path in sorted(jobs.glob("jobs/cuecmd/*.txt")))
    assert "--method method.py:SoftPad" in lists  # farms are told the code


PAGE = Path(__file__).parents[2] / "docs" / "own-methods.md"
CODE = re.findall(r"```python[^\n]*\n(.*?)```", read_text(PAGE), re.DOTALL)


def test_the_template_runs_as_it_is_and_its_run_needs_no_code_any_more(folder, capsys):
    assert main(command("new-method soft_pad --out own")) == 0
    assert "--method own/soft_pad.py:SoftPad" in capsys.readouterr().out
    assert main(command("describe tap --set control.method=own/soft_pad.py:SoftPad")) == 0
    assert "soft_pad: " in capsys.readouterr().out
    size = command("--set layout.rows=11 --set layout.columns=11 --set simulation.duration=0.25")
    own = command("--method own/soft_pad.py:SoftPad --quiet --no-errors")
    assert main(["run", "tap", *own, *size, "--out", "r"]) == 0
    text = read_text(folder / "own" / "soft_pad.py")
    assert read_text(folder / "r" / "method.py") == text
    pressed = read_run(folder / "r", "height")
    assert pressed.history["height"].min() < 39.9e-3  # it gives way
    assert pressed.scene.method == "soft_pad"
    remove_method("soft_pad")
    assert read_run(folder / "r", "height").scene.control is None
    assert main(command("export r --format stl --quiet")) == 0
    assert main(command("run r --out again")) == 2
    assert "--method path/to/mine.py:Mine" in capsys.readouterr().err
    assert main(command("run r --method r/method.py:SoftPad --out again --quiet")) == 0
    again = read_run(folder / "again", "height").history["height"]
    assert again.tobytes() == pressed.history["height"].tobytes()


@pytest.mark.parametrize(
    "arguments, said",
    [
        (["mine"], "mine.py is there already"),
        (["Mine"], "must be small letters and digits"),
        (["a/b"], "must be small letters and digits"),
        (["elastic"], "must not be that of a built-in method"),
        (command("pad --out mine.py"), "mine.py is a file"),
    ],
)
def test_a_name_that_cannot_be_is_refused_in_a_line(folder, arguments, said, capsys):
    write_text(folder / "mine.py", "")
    assert said in refused(capsys, "new-method", *arguments)
    assert [(path.name, path.stat().st_size) for path in folder.iterdir()] == [("mine.py", 0)]


def test_a_sweep_varies_methods_and_goes_on_with_the_same_code_only(folder, capsys):
    assert main(command("new-method mine --quiet")) == 0
    size = command("--set layout.rows=11 --set layout.columns=11 --set simulation.duration=0.05")
    varied = command(
        "--vary control.method=elastic,mine.py:Mine --metric rfd --workers 1 --out s --quiet"
    )
    assert main(["sweep", "tap", *varied, *size]) == 0
    assert read_text(folder / "s" / "sweep.csv").split()[-2:][0].startswith("elastic,")
    assert main(["sweep", "tap", *varied, *size]) == 0
    (folder / "mine.py").write_text(read_text(folder / "mine.py") + "\n", encoding="utf-8")
    remove_method("mine")
    assert main(["sweep", "tap", *varied, *size]) == 2
    assert "s holds another sweep" in capsys.readouterr().err


@pytest.mark.parametrize("code", CODE)
def test_the_code_of_the_page_runs(folder, code):
    write_text(folder / "page.py", code)
    name = re.findall(r"class (\w+)", code)[-1]
    assert load_method(f"page.py:{name}") in list_added()
    assert run(small(load_method(f"page.py:{name}"))).history["height"].min() < 0.04
