"""Job series: JOBS files, a batch while it runs, a job started alone, and the page of them all."""

import base64
import itertools
import os
import re
import shutil
import signal
import time
from collections import Counter
from html import unescape
from io import BytesIO
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.batch import JobProcess
from digiclay.commands.batch_folder import Folder
from digiclay.commands.gallery import Card, height_map, page
from digiclay.core.base.errors import ParameterError, SceneError
from digiclay.core.files.formats import encode_png
from digiclay.core.model.layout import make_grid
from digiclay.core.scene.scene_source import SAMPLES, load
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.session.render_settings import (
    Film,
    Still,
    Turntable,
)
from digiclay.core.shapes.fitting import fit_shape
from digiclay.core.studies.job_table import Outputs, make_outputs, read_jobs, read_outputs

from tests.assemble import refused_in_a_line
from tests.other_process import PROGRAM, dead, finish, start
from tests.scene_files import call, read_json
from tests.series import index, prepare, write
from tests.timeouts import TIMEOUT, wait_until

pytestmark = pytest.mark.usefixtures("folder")

#: More settings than a batch may have.
MANY = "\n".join(f"n{i} = {{}}" for i in range(10_001))


def test_every_scene_meets_every_method_and_every_setting():
    said = """
    scenes = ["tap", "slow_press"]
    methods = ["virtual_master", "cell_states"]
    [settings]
    soft = { control.force_setpoint = "300 mN" }
    firm.control.force_setpoint = 0.6
    """
    made = read_jobs(write(said)).jobs
    axes = (("tap", "slow_press"), ("virtual_master", "cell_states"), ("soft", "firm"))
    assert [job.name for job in made] == ["-".join(words) for words in itertools.product(*axes)]
    for jobs in (made, read_jobs(SAMPLES.parent / "batches" / "first.toml").jobs):
        assert [job.error for job in jobs] == [""] * 8
    assert [
        (job.scene.method, job.scene.control.force_setpoint) for job in made[:4] if job.scene
    ] == [
        ("virtual_master", 0.3),
        ("virtual_master", 0.6),
        ("cell_states", 0.3),
        ("cell_states", 0.6),
    ]


def test_a_scene_beside_the_jobs_file_is_found_from_any_folder(tmp_path, monkeypatch):
    Path("Übung 1.toml").write_text("simulation.duration = 0.25", encoding="utf-8")
    file = write('scenes = ["Übung 1.toml"]')
    monkeypatch.chdir(tmp_path)
    (job,) = read_jobs(file).jobs
    assert (job.name, job.scene and job.scene.simulation.duration) == ("Übung_1", 0.25)


@pytest.mark.parametrize(
    "said, told",
    [
        ("", "scenes must be a list of scenes"),
        ("scenes = []", "scenes must be a list of scenes"),
        ('scenes = "tap"', "scenes must be a list of scenes"),
        ('scenes = ["tap", 3]', "scenes must be a list of scenes"),
        ('scenes = ["tapp"]', "tapp is neither a file nor a sample. Did you mean tap?"),
        (
            'scenes = ["tap"]\nmethod = ["cell_states"]',
            "method must be a known key .* Did you mean methods?",
        ),
        ('scenes = ["tap"]\nmethods = []', "methods must be a list"),
        ('scenes = ["tap"]\nmethods = ["magic"]', "methods must be one of virtual_master"),
        ('scenes = ["tap", "tap"]', r"scenes must not name the same thing twice \(got tap twice\)"),
        ('scenes = ["tap"]\nsettings = 3', "settings must be a section of labels"),
        ('scenes = ["tap"]\nsettings.a = 3', r"settings\.a must be a table"),
        ('scenes = ["tap"]\nsettings."../a" = {}', "settings must have labels of letters"),
        ('scenes = ["tap"]\nexport = "stl"', "export must be a list of formats"),
        ('scenes = ["tap"]\nexport = ["stl", "stl"]', "export must not name a format twice"),
        ('scenes = ["tap"]\nerrors = 1', "errors must be true or false"),
        ('scenes = ["tap"]\nfilm = true', r"film must be a section, \[film\]"),
        (
            'scenes = ["tap"]\n[film]\nheight = 101',
            r"film\.height must be an even number of pixels",
        ),
        ('scenes = ["tap"]\n[film]\nspeed = 0', r"film\.speed must be at least 0\.001"),
        ('scenes = ["tap"]\n[film]\nspeed = nan', r"film\.speed must be a finite number"),
        ('scenes = ["tap"]\n[film]\nrate = 2.5', r"film\.rate must be a whole number"),
        (
            'scenes = ["tap"]\n[still]\nengine = "eevee"',
            r"still\.engine must be one of cycles, workbench",
        ),
        ('scenes = ["tap"]\n[turntable]\nframes = 1', r"turntable\.frames must be at least 2"),
        ('scenes = ["tap"]\n[film]\nfps = 3', r"film\.fps must be a known key"),
        ('scenes = ["tap"', r"two\.toml, line 1: "),
        pytest.param(
            f'scenes = ["tap"]\n[settings]\n{MANY}', r"10000 jobs at most \(got 10001", id="many"
        ),
    ],
)
def test_a_mistake_is_told_in_one_line(said, told):
    with refused_in_a_line(SceneError, told):
        read_jobs(write(said))


def test_a_jobs_own_files_say_all_there_is_to_do():
    film = Film(speed=0.5, start=0.1, arrows=False)
    full = Outputs(
        ("stl", "glb"),
        errors=False,
        still=Still(engine="cycles"),
        turntable=Turntable(frames=4),
        film=film,
    )
    mesh = {"kind": "features", "skin": "smooth"}
    for made in (Outputs(), make_outputs({"export": ["stl"], "mesh": mesh}), full):
        assert read_outputs(write(made.format())) == made
    # An older file has the color under the former key.
    assert make_outputs({"still": {"colour": "force"}}).still == Still(color="force")
    with pytest.raises(ParameterError, match="colour"):
        make_outputs({"still": {"colour": "force", "color": "mode"}})


def test_a_job_needs_no_other_file_for_its_shape(tmp_path):
    np.save("own.npy", np.arange(25.0).reshape(5, 5))
    said = 'control = "absent"\nlayout = { rows = 5, columns = 5 }\nshape.file = "own.npy"\n'
    Path("shaped.toml").write_text(said, encoding="utf-8")
    (job,) = read_jobs(write('scenes = ["shaped.toml"]')).jobs
    (tmp_path / "scene.toml").write_text(format_scene(job.scene), encoding="utf-8")
    found = []
    for scene in (job.scene, load(tmp_path / "scene.toml")):
        found.append(fit_shape(scene.shape, make_grid(scene.layout), scene.actuator).heights)
        Path("own.npy").unlink(missing_ok=True)
    np.testing.assert_array_equal(*found)
    assert np.ptp(found[0]) > 1e-3


TWO = """
scenes = ["tap"]
export = ["stl"]
errors = false
[settings]
quick = { simulation.duration = 0.1 }
slow = { simulation.duration = 0.2 }
"""
#: Sessions of hours: for being stopped.
HOURS = """
scenes = ["tap"]
[settings]
a = { simulation.duration = 1e4, recorder.every = 1000 }
b = { simulation.duration = 1e4, recorder.every = 1000 }
"""


def started():
    """Start a batch of sessions of hours in a process of its own; return it when both have begun."""
    write(HOURS)
    process = start(PROGRAM, "batch", "two.toml", "--jobs", "2", start_new_session=True)
    wait_until(lambda: len(list(Path("two/runs").glob(".*.part"))) == 2)
    return process


def runs():
    """Return what lies in the folder of runs, hidden things too."""
    return sorted(path.name for path in Path("two/runs").iterdir())


def test_every_job_leaves_a_whole_folder_and_the_page_links_to_it(capsys, monkeypatch):
    write(TWO)
    pages = []
    write_index = Folder.write_index

    def keep(*given):
        path = write_index(*given)
        pages.append(index())
        return path

    monkeypatch.setattr(Folder, "write_index", keep)
    started = time.time()
    assert call("batch two.toml --jobs 2") == 0
    took = time.time() - started
    assert runs() == ["tap-quick", "tap-slow"]
    files = {path.name for path in Path("two/runs/tap-slow").iterdir()}
    wanted = "history.npz job.toml metrics.json scene.toml surface.stl thumbnail.png timing.json"
    assert files == set(wanted.split())
    out, err = capsys.readouterr()
    assert err == ""
    assert "2 of 2 jobs done; 2 of them now, in" in out
    # A process that imports numpy needs a tenth of a second at the very least, on any machine.
    timing = read_json(Path("two/runs/tap-slow/timing.json"))
    assert 0.1 < timing["start_up"] < took
    assert "s to start" in out
    # It is written when the first job has ended, and in the end.
    during, page = pages[0], pages[-1]
    assert "1 of 2 jobs ended so far." in during
    assert during.count("not done yet") == during.count('http-equiv="refresh"')
    assert 'http-equiv="refresh"' not in page
    assert 'href="runs/tap-slow/surface.stl"' in page
    assert page.count("start of its process") == page.count("data:image/png;base64,") == 2


def test_finished_jobs_are_kept_also_from_elsewhere_and_changed_or_half_written_ones_are_done_again(
    folder,
):
    prepare(TWO)
    assert runs() == []
    far = folder.parent / "a farm"
    shutil.copytree("two/jobs/tap-quick", far / "jobs" / "tap-quick")
    for folder in (
        far / "jobs/tap-quick",
        "two/jobs/tap-slow",
    ):
        # In this process: others take seconds.
        assert main(["job", str(folder), "--quiet"]) == 0
    shutil.copytree(far / "runs" / "tap-quick", "two/runs/tap-quick")
    shutil.rmtree("two/jobs")
    before = {name: Path("two/runs", name, "history.npz").stat().st_mtime_ns for name in runs()}
    write(TWO.replace("0.2", "0.3"))
    shutil.copytree("two/runs/tap-quick", f"two/runs/.tap-quick.{dead()}.part")
    assert call("batch two.toml --quiet") == 0
    after = {name: Path("two/runs", name, "history.npz").stat().st_mtime_ns for name in runs()}
    assert (after["tap-quick"] == before["tap-quick"], after["tap-slow"] > before["tap-slow"]) == (
        True,
        True,
    )
    assert list(after) == ["tap-quick", "tap-slow"]
    metrics = read_json(Path("two/runs/tap-slow/metrics.json"))
    assert metrics["simulated"] == pytest.approx(0.3, abs=1e-9)


def test_a_failing_job_is_told_of_and_the_rest_goes_on(capsys):
    # One fails when its scene is read, one when it is run: its history fits into no memory.
    one, _, _ = TWO.partition("slow")
    write(one + 'narrow.layout.pitch = "1 mm"\nendless.simulation.duration = 1e6\n')
    assert call("batch two.toml") == 1
    assert runs() == ["tap-quick"]
    out, err = capsys.readouterr()
    assert "failed: tap-narrow: settings.narrow: layout.pitch must be at least" in out
    assert "failed: tap-endless: recorder.every must be at least" in out
    assert err.startswith("2 of 3 jobs failed; the first one: tap-narrow: ")
    assert err.count("\n") == 1
    assert index().count('class="failed"') == 2
    assert "recorder.every must be at least" in index()


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_ctrl_c_ends_all_processes_and_leaves_nothing_half_done():
    process = started()
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    code, out, err = finish(process)
    assert (code, err, runs()) == (130, "", [])
    assert "Stopped: finished work is kept, and the same command continues." in out


@pytest.mark.skipif(os.name == "nt", reason="Windows has no signals to send")
def test_when_a_batch_is_killed_its_processes_end_and_a_process_that_dies_is_told_by_its_signal():
    process = started()
    process.kill()
    process.communicate(timeout=TIMEOUT)
    # The processes notice that nobody is there, and take back what they have begun.
    wait_until(lambda: runs() == [])
    worker = JobProcess(["job", "two/jobs/tap-a", "--follow"], Path("log.txt"))
    wait_until(lambda: list(Path("two/runs").glob(".*.part")))
    worker.kill()
    assert worker.read_error().startswith("The process ended with signal 9")


@pytest.mark.parametrize(
    "words, said, told",
    [
        ("", 'scenes = ["tap"]\nexport = ["doc"]', "export: "),
        (
            "",
            'scenes = ["tap"]\nexport = ["stl"]\nsettings.a.recorder = "absent"',
            "need a recorder",
        ),
        ("--out two.toml", TWO, "two.toml is a file"),
        ("--out .", TWO, ". contains something other than a batch"),
        ("--jobs 0", TWO, "--jobs"),
        ("--out two secnod", TWO, "unrecognized arguments: secnod"),
    ],
)
def test_a_mistake_is_refused_in_one_line_before_any_work(words, said, told, refused):
    write(said)
    refused(f"batch two.toml {words}", told)
    assert [path.name for path in Path().iterdir()] == ["two.toml"]


def read(made):
    """Return what a page refers to; its tags are closed."""
    tags = re.findall(r"<(/?)(\w+)", made)
    opened, closed = (Counter(tag for end, tag in tags if end == kind) for kind in ("", "/"))
    assert opened - Counter(dict.fromkeys(("meta", "img", "br"), len(tags))) == closed
    return [unescape(found) for found in re.findall(r'(?:src|href)="([^"]*)"', made)]


def test_a_page_refers_to_files_beside_it_alone_and_shows_names_and_errors_never_as_html():
    picture = encode_png(np.full((3, 5, 3), 77, np.uint8))
    done = Card("a", picture, [("lag", "1 mm")], [("film", "runs/a b/film #1.mp4")], leads="f.mp4")
    failed = Card("b", error="it broke", links=[("log", "l")])
    leads, shown, *links = read(page("Batch", "1 of 2 jobs done.", [done, failed]))
    kind, _, data = shown.partition(",")
    assert (kind, base64.b64decode(data)) == ("data:image/png;base64", picture)
    assert [leads, *links] == ["f.mp4", "runs/a%20b/film%20%231.mp4", "l"]
    nasty = '<script>alert("x")</script> & Söhne'
    made = page(nasty, nasty, [Card(nasty, facts=[(nasty, nasty)]), Card(nasty, error=nasty)])
    assert read(made) == []
    assert "<script" not in made
    assert unescape(made).count(nasty) == 8  # the title stands in the head as well


@pytest.mark.parametrize("shape", [(1, 1), (7, 3), (40, 61)])
def test_a_png_is_read_back_by_another_program_as_it_was(shape):
    pixels = np.random.default_rng(1).integers(0, 256, (*shape, 3), np.uint8)
    back = matplotlib.image.imread(BytesIO(encode_png(pixels)), format="png")
    np.testing.assert_array_equal(np.round(back[..., :3] * 255.0).astype(np.uint8), pixels)


def test_a_map_of_heights_has_about_the_width_asked_for_and_shows_high_pins_bright_far_ones_above():
    for shape in ((1, 1), (25, 25), (3, 40), (1000, 700)):
        rows, columns, channels = height_map(np.zeros(shape), 320).shape
        assert (channels, 160 < max(rows, columns) <= 320) == (3, True)
    height = np.zeros((4, 4))
    height[3, 0] = 1.0  # far, left
    shown = height_map(height, 4).astype(int).sum(axis=2)
    assert np.unravel_index(shown.argmax(), shown.shape) == (0, 0)
