"""Files for render farms: each reader of their formats finds the same tasks in them, in the same order."""

import json
import re
import shlex
import sys
from pathlib import Path

import pytest
import quickjs
from digiclay.cli import main
from digiclay.core.base.errors import OutputError
from digiclay.core.session.render_settings import read_range
from digiclay.core.session.run_scene import run
from digiclay.core.studies.job_table import read_jobs
from digiclay.farms.series_plan import LONGEST, SCRIPT, join_words, plan_series, split_frames
from openjd.model import (
    StepDependencyGraph,
    StepParameterSpaceIterator,
    create_job,
    decode_job_template,
    preprocess_job_parameters,
)

from tests.assemble import table
from tests.scene_files import call, read_json

JOBS = """
scenes = ["tap"]
errors = false
[settings]
a = { simulation.duration = 0.05 }
b = { simulation.duration = 1.21 }
"""
FILMS = "[film]\nrate = 10\n[turntable]\nframes = 4\n"
#: What a film of 1.21 s at 10 frames a second has: one every 0.1 s, and the last instant.
COUNT = 13
WINDOWS = r"C:\Program Files\Blender Foundation\Blender 4.5\blender.exe"
#: How Blender is asked for the command line.
BLENDER = ["--background", "--addons", "bl_ext.user_default.digiclay", "--command", "digiclay"]


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """Work in a folder that a shell, a template and a script could misread."""
    folder = tmp_path / "schöne 'Tasten' {{Param.Series}} $HOME; #"
    (folder / "below").mkdir(parents=True)
    monkeypatch.chdir(folder)
    return folder


def submit(form, said=JOBS + FILMS, *options):
    Path("two.toml").write_text(said, encoding="utf-8")
    out = ["--out", str(Path("below/../out")), "--submit", form, "--chunk", "5", "--quiet"]
    return main(["batch", "two.toml", *out, *options])


def planned():
    """Return the arguments of each task and the names of those it needs, frames split."""
    tasks = split_frames(plan_series(read_jobs(Path("two.toml")), 5))
    return {task.name: (task.list_arguments("S"), set(task.needs)) for task in tasks}


def test_the_tasks_of_a_job_are_its_run_then_frames_then_films_and_the_page_is_last():
    assert submit("openjd") == 0
    found = planned()
    assert list(found)[:1] + list(found)[-1:] == ["tap-a: run", "page"]
    assert found["tap-b: run"] == (["job", "S/jobs/tap-b", "--only", "run"], set())
    ranges = [name for name in found if name.startswith("tap-b: frames of film")]
    assert [name.split()[-1] for name in ranges] == ["0-4", "5-9", "10-12"]
    drawn = ["job", "S/jobs/tap-b", "--only", "film", "--frames", "10-12"]
    assert found[ranges[2]] == (drawn, {"tap-b: run"})
    assert found["tap-b: film"] == (["job", "S/jobs/tap-b", "--only", "film"], set(ranges))
    films = {f"tap-{job}: {kind}" for job in "ab" for kind in ("film", "turntable")}
    assert found["page"] == (["page", "S"], films)
    submit("openjd", JOBS)
    assert planned()["page"][1] == {"tap-a: run", "tap-b: run"}
    assert planned()["tap-a: run"][0] == ["job", "S/jobs/tap-a"]


@table("before", {"short names": "", "names cut to one length": "x" * 100})
def test_an_openjd_template_has_these_tasks_in_an_order_that_respects_the_steps(before, here):
    jobs = JOBS.replace("a =", f"{before}a =").replace("b =", f"{before}b =")
    assert submit("openjd", jobs + FILMS, "--program", WINDOWS) == 0
    template = decode_job_template(template=read_json(Path("out/openjd.json")))
    names = [step.name for step in template.steps]
    assert len(set(names)) == len(names) == 11
    if before:
        assert max(map(len, names)) == LONGEST
        return
    values = preprocess_job_parameters(
        job_template=template,
        job_parameter_values={"Blender": "/p"},
        job_template_dir=here / "out",
        current_working_dir=here,
    )
    job = create_job(job_template=template, job_parameter_values=values)
    assert {name: one.value for name, one in values.items()} == {
        "Series": str(here / "out"),
        "Blender": "/p",
    }
    wanted, seen = planned(), []
    for name in [step.name for step in StepDependencyGraph(job=job).topo_sorted()]:
        (step,) = (one for one in job.steps if one.name == name)
        action = step.script.actions.onRun
        assert str(action.command) == "{{Param.Blender}}"
        given = [str(one).replace("{{Param.Series}}", "S") for one in action.args]
        blender, given = given[:5], given[5:]
        assert blender == BLENDER
        assert {need.dependsOn for need in step.dependencies or ()} <= set(seen)
        seen.append(name)
        if step.parameterSpace is None:
            assert given == wanted[name][0]
            continue
        assert given[-2:] == ["--frames", "{{Task.Param.Frame}}+5"]
        starts = [
            task["Frame"].value for task in StepParameterSpaceIterator(space=step.parameterSpace)
        ]
        count = 4 if "turntable" in name else (2 if "tap-a" in name else COUNT)
        frames = [list(read_range(f"{start}+5", count)) for start in starts]
        assert [frame for part in frames for frame in part] == list(range(count))
        ranges = [f"{name} {part[0]}-{part[-1]}" for part in frames]
        assert ranges == [task for task in wanted if task.startswith(name)]
    assert (seen[-1], len(seen)) == ("page", 11)


@pytest.mark.parametrize("every", [1, 7])
def test_a_film_is_planned_with_the_frames_its_run_will_have(every):
    setting = f"a = {{ simulation.duration = 0.123, recorder.every = {every} }}"
    submit(
        "openjd", f'scenes = ["tap"]\nerrors = false\n[settings]\n{setting}\n[film]\nrate = 100\n'
    )
    (job,) = (series := read_jobs(Path("two.toml"))).jobs
    frames = series.outputs.film.count(run(job.scene).history["time"])
    assert [task.frames.stop for task in plan_series(series, 5) if task.frames] == [frames]


STUB = """
var tasks = [];
var author = {
    Task: function (name, type) {
        var own = { name: name, type: type, commands: [], needs: [] };
        own.addCommand = function (command) { own.commands.push(command); };
        own.addDependency = function (other) { own.needs.push(other.name); };
        return own;
    },
    Command: function (name, parameters) { return { name: name, parameters: parameters }; }
};
function compile(text) {
    var job = JSON.parse(text);
    job.addTask = function (task) { tasks.push(task); };
    compileJob(job);
    return JSON.stringify(tasks);
}
"""


def compiled(job):
    """Return what Flamenco's Manager would be told of a job by the script, in strict mode as there."""
    context = quickjs.Context()
    context.eval(
        f'"use strict";\n{STUB}{SCRIPT.read_text(encoding="utf-8")}\nglobalThis.compile = compile;'
    )
    return json.loads(context.get("compile")(job))  # type: ignore[no-any-return]


@pytest.mark.parametrize("program", ["", WINDOWS, "/opt/with blank/digiclay", "{digiclay}"])
def test_the_flamenco_script_makes_these_tasks_with_these_dependencies(program, here):
    assert submit("flamenco", JOBS + FILMS, *(["--program", program] if program else [])) == 0
    text = Path("out/flamenco/job.json").read_text(encoding="utf-8")
    job = json.loads(text)
    assert job["type"] == SCRIPT.stem.replace("_", "-") == "digiclay-series"
    assert Path("out/flamenco/digiclay_series.js").read_bytes() == SCRIPT.read_bytes()
    tasks, wanted, before = compiled(text), planned(), set[str]()
    assert [task["name"] for task in tasks] == list(wanted)
    leading = {"": ["-m", "digiclay"], WINDOWS: BLENDER}.get(program, [])
    series = str(here / "out")
    for task in tasks:
        arguments, needs = wanted[task["name"]]
        exact = [
            one.replace("S", series, 1) if one[:2] in ("S", "S/") else one for one in arguments
        ]
        parameters = {"exe": program or sys.executable, "args": [*leading, *exact]}
        assert task["commands"] == [{"name": "exec", "parameters": parameters}]
        assert set(task["needs"]) == needs <= before
        before.add(task["name"])
        rendered = "film" in task["name"] or "turntable" in task["name"]
        assert task["type"] == ("blender" if rendered else "misc")


def test_the_flamenco_script_has_the_settings_its_jobs_give_and_is_plain_javascript():
    submit("flamenco")
    context = quickjs.Context()
    context.eval(SCRIPT.read_text(encoding="utf-8"))
    known = json.loads(context.eval("JSON.stringify(JOB_TYPE.settings)"))
    kinds = {one["key"]: (one["type"], one["required"]) for one in known}
    given = read_json(Path("out/flamenco/job.json"))["settings"]
    assert kinds == dict.fromkeys(given, ("string", True))
    assert {type(value) for value in given.values()} == {str}
    # goja knows ECMAScript 5.1 and a part of the later ones.
    code = re.sub(r'//[^\n]*|"[^"\n]*"', "", SCRIPT.read_text(encoding="utf-8"))
    words = r"\b(?:let|const|class|async|await|import|export|of|includes)\b"
    assert re.findall(rf"{words}|=>|`|\.\.\.|\?\.|\?\?|\*\*", code) == []


def test_the_lists_of_cuecmd_hold_these_tasks_stage_by_stage(here):
    assert submit("cuecmd") == 0
    lists = sorted(Path("out/cuecmd").iterdir())
    assert [path.name for path in lists] == [
        "1-runs.txt",
        "2-frames.txt",
        "3-films.txt",
        "4-page.txt",
    ]
    wanted, before = planned(), set[str]()
    commands = {tuple(arguments): name for name, (arguments, _) in wanted.items()}
    for path in lists:
        stage = set()
        for line in path.read_text(encoding="utf-8").splitlines():
            words = shlex.split(line)
            assert words[:3] == [sys.executable, "-m", "digiclay"]
            name = commands.pop(tuple(one.replace(str(here / "out"), "S") for one in words[3:]))
            assert wanted[name][1] <= before
            stage.add(name)
        before |= stage
    assert commands == {}
    # Lists that another series of this folder had would be submitted with the others.
    assert submit("cuecmd", JOBS) == 0
    assert sorted(path.name for path in Path("out/cuecmd").iterdir()) == [
        "1-runs.txt",
        "2-page.txt",
    ]


def test_a_line_for_windows_protects_what_its_shell_would_read():
    words = [WINDOWS, "job", r"Z:\a & b\jobs\x", "--only", "run", "C:\\my folder\\", "^", "|"]
    assert join_words(words, windows=True) == (
        f'"{WINDOWS}" job "Z:\\a & b\\jobs\\x" --only run "C:\\my folder\\\\" "^" "|"'
    )
    for word, windows in (("%PATH%", True), ('a"b', True), ("a\nb", False)):
        with pytest.raises(OutputError, match="cannot stand in a line"):
            join_words([word], windows=windows)


OPENJD = "--submit openjd"
NARROW = 'layout.pitch = "1 mm"'
REFUSED = [
    (JOBS, "--program p", 2, "--program must be given with --submit only."),
    (JOBS, "--chunk 5", 2, "--chunk must be given with --submit only."),
    (JOBS, f"{OPENJD} --prepare", 2, "not allowed with argument"),
    (JOBS, "--submit flamingo", 2, "Did you mean flamenco?"),
    (JOBS, f"{OPENJD} --chunk 0", 2, "--chunk"),
    (JOBS, f"{OPENJD} --program ' '", 2, "--program must be the path of digiclay or Blender"),
    (f"{JOBS}[film]\nstart = 1\n", OPENJD, 2, "tap-a: Film.start must be between 0 s and 0.05 s"),
    (f"{JOBS}c = {{ {NARROW} }}\n", OPENJD, 1, "1 of 3 jobs failed; the first one: tap-c: "),
    (f'scenes = ["tap"]\nsettings.a.{NARROW}', OPENJD, 2, "No job can be submitted"),
]


@pytest.mark.parametrize("said, options, code, told", REFUSED)
def test_what_cannot_be_submitted_is_refused_in_one_line(said, options, code, told, capsys):
    Path("two.toml").write_text(said, encoding="utf-8")
    assert call(f"batch two.toml --quiet {options}") == code
    out, err = capsys.readouterr()
    assert (out, err.count("\n"), told in err) == ("", 1, True), err
    assert Path("two/openjd.json").exists() == (code == 1)
