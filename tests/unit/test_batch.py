"""Job series: JOBS files, a batch while it runs, a job started alone, and the page of them all."""

import base64
import itertools
import os
import re
import shutil
import signal
import time
from collections import Counter
from contextlib import redirect_stderr
from html import unescape
from io import BytesIO, StringIO
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.batch import JobProcess
from digiclay.commands.batch_folder import Folder
from digiclay.commands.gallery import Card, height_map, page
from digiclay.core.base.errors import OutputError, ParameterError, SceneError
from digiclay.core.files.formats import encode_png
from digiclay.core.files.run_folder import lock_name
from digiclay.core.model.layout import make_grid
from digiclay.core.scene.scene_source import SAMPLES, load
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.session.render_settings import (
    Film,
    Still,
    Turntable,
    format_range,
    list_missing,
    name_frame,
    read_range,
)
from digiclay.core.shapes.fitting import fit_shape
from digiclay.core.studies.job_table import Outputs, make_outputs, read_jobs, read_outputs

from tests.assemble import refused_in_a_line
from tests.other_process import PROGRAM, dead, finish, start
from tests.scene_files import call, read_json
from tests.timeouts import TIMEOUT, wait_until

#: More settings than a batch may have.
MANY = "\n".join(f"n{i} = {{}}" for i in range(10_001))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in an empty folder, with a blank and an umlaut in its path."""
    folder = tmp_path / "schöne Tasten"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def write(said):
    path = Path("two.toml").resolve()
    path.write_text(said, encoding="utf-8")
    return path


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
        ('scenes = ["tapp"]', "tapp is neither a file nor a sample .* Did you mean tap?"),
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


def index():
    return Path("two/index.html").read_text(encoding="utf-8")


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


ENDLESS = """
scenes = ["tap"]
errors = false
[settings]
quick = { simulation.duration = 0.05 }
endless = { simulation.duration = 1e6 }
narrow = { layout.pitch = "1 mm" }
"""
#: How a page says that a browser is to load it again.
AGAIN = 'http-equiv="refresh"'
JOB, RUN = Path("two/jobs/tap-quick"), Path("two/runs/tap-quick")


def prepare(said=ENDLESS):
    """Write the files of the jobs, none of which is done."""
    write(said)
    with redirect_stderr(StringIO()):
        assert call("batch two.toml --prepare --quiet") == int("narrow" in said)


def written(run=RUN):
    """Return when a run was written, ns."""
    return (run / "history.npz").stat().st_mtime_ns


def test_a_job_that_is_done_is_left_as_it_is_with_exit_code_0(capsys):
    prepare()
    assert call(f"job {JOB}") == 0
    assert capsys.readouterr().out.startswith("written to ")
    before = written()
    assert call(f"job {JOB}") == 0
    out, err = capsys.readouterr()
    assert (out, err) == (f"was done already: {RUN.resolve()}\n", "")
    assert call(f"job {JOB} --only run --quiet") == 0
    assert capsys.readouterr().out == ""
    assert written() == before
    assert call(f"job {JOB} --overwrite --quiet") == 0
    assert written() > before


def test_a_job_whose_files_changed_or_a_copy_broke_off_is_done_again_and_says_so(capsys):
    prepare()
    call(f"job {JOB} --quiet")
    before = written()
    prepare(ENDLESS.replace("0.05", "0.06"))
    assert call(f"job {JOB}") == 0
    assert "is of another definition: it is repeated.\n" in capsys.readouterr().out
    assert written() > before
    for harm, rest in (("history.npz", 100), ("scene.toml", 0), ("job.toml", 0)):
        whole = (RUN / harm).read_bytes()
        (RUN / harm).write_bytes(whole[:rest]) if rest else (RUN / harm).unlink()
        assert call(f"job {JOB}") == 0
        assert "is incomplete: it is repeated.\n" in capsys.readouterr().out
        assert (RUN / harm).stat().st_size == len(whole)
    prepare(f'export = ["stl"]\n{ENDLESS.replace("0.05", "0.06")}')
    assert call(f"job {JOB} --quiet") == 0
    assert (RUN / "surface.stl").is_file()


def test_a_folder_outside_the_series_is_replaced_only_when_asked(refused):
    prepare()
    own = f"job {JOB} --out mine --quiet"
    assert (call(own), call(own)) == (0, 0)
    before = written(Path("mine"))
    prepare(ENDLESS.replace("0.05", "0.06"))
    refused(own, "mine is not empty: choose another folder with --out")
    assert written(Path("mine")) == before
    assert call(f"{own} --overwrite") == 0
    assert written(Path("mine")) > before


@pytest.mark.parametrize(
    "words, said",
    [
        ("--frames 0-9", "--frames must be given with --only film or --only turntable."),
        ("--only run --frames 0-9", "--frames must be given with --only film"),
        ("--only film", "job.toml has no section [film]."),
        ("--only turntable", "--only turntable needs a finished run, and the run in "),
        ("--only fim", "Did you mean film?"),
    ],
)
def test_a_part_that_cannot_be_done_is_refused_in_one_line(words, said, refused):
    prepare(f"{ENDLESS}[turntable]\nframes = 4\n")
    refused(f"job {JOB} {words}", said)
    assert list(Path("two/runs").iterdir()) == []


RANGES = {
    "0-24": (0, 25), "7": (7, 8), "50+25": (50, 60), "59+1": (59, 60), "0-59": (0, 60), " 3-3 ": (3, 4),
    **dict.fromkeys(["", "a", "1-", "-3", "5-2", "0-60", "60", "60+1", "3+0", "1e2", "٣"]),
}  # fmt: skip


@pytest.mark.parametrize("text, ends", RANGES.items())
def test_a_range_of_frames_reads_back_and_one_that_is_none_is_refused(text, ends):
    if ends is None:
        with pytest.raises(OutputError, match="--frames must be "):
            read_range(text, 60)
        return
    frames = read_range(text, 60)
    assert (frames.start, frames.stop) == ends
    assert read_range(format_range(frames), 60) == frames


def test_a_frame_that_is_cut_off_is_missing(tmp_path):
    whole = b"anything" + b"IEND\xaeB`\x82"
    for frame, content in enumerate((whole, whole[:-3], b"", whole)):
        name_frame(tmp_path, frame).write_bytes(content)
    assert list_missing(tmp_path, range(6)) == [1, 2, 4, 5]
    assert list_missing(tmp_path / "none", range(2)) == [0, 1]


def test_jobs_that_are_started_alone_write_the_page_of_their_series(capsys):
    write(ENDLESS)
    assert call("batch two.toml --prepare") == 1
    said = "".join(capsys.readouterr())
    assert re.match("2 jobs written to .*\n1 of 3 jobs failed; the first one: tap-narrow: ", said)
    assert call("job two/jobs/tap-endless --quiet") == 2
    said = capsys.readouterr().err.strip()
    assert "0 of 3 jobs done, 2 failed." in index()
    assert AGAIN in index()
    # Another job has just written the page; the last task of a farm writes it in any case.
    assert call("job two/jobs/tap-quick --quiet") == 0
    assert "0 of 3 jobs done" in index()
    os.utime("two/index.html", (0, 0))
    assert call("job two/jobs/tap-quick --quiet") == 0
    assert "1 of 3 jobs done, 2 failed." in index()
    Path("two.toml").unlink()
    Path("two/index.html").unlink()
    assert call("page two") == 0
    assert capsys.readouterr().out == "1 of 3 jobs done, 2 failed; written to two/index.html\n"
    assert index().count('class="failed"') == 2
    assert said in index()
    assert "layout.pitch must be at least" in index()
    assert index().count("data:image/png;base64,") == 1
    assert AGAIN not in index()


def test_a_job_that_another_process_does_has_not_failed_and_one_described_anew_forgets_it():
    prepare()
    with lock_name(Path("two/runs/tap-quick")):
        assert call("job two/jobs/tap-quick --quiet") == 2
    assert call("page two --quiet") == 0
    assert "0 of 3 jobs done, 1 failed." in index()
    assert call("job two/jobs/tap-endless --quiet") == 2
    prepare(ENDLESS.replace("1e6", "0.1"))
    assert call("page two --quiet") == 0
    assert "0 of 3 jobs done, 1 failed." in index()
    assert index().count("not done yet") == 2


def test_what_is_no_series_has_no_page_and_one_of_an_older_version_the_jobs_in_it(capsys):
    prepare()
    shutil.copytree("two/jobs/tap-quick", "alone/jobs/tap-quick")
    assert call("job alone/jobs/tap-quick --quiet") == 0
    assert sorted(path.name for path in Path("alone").iterdir()) == ["jobs", "runs"]
    assert call("page alone") == 2
    rule = "alone is not the folder of a job series: it has no batch.json of 'digiclay batch'.\n"
    assert capsys.readouterr().err == rule
    Path("two/batch.json").write_text('{"batch": "two", "digiclay": "0.1.0"}', encoding="utf-8")
    assert call("page two") == 0
    assert capsys.readouterr().out.startswith("0 of 2 jobs done; ")
