"""Tasks of a job series on a render farm, and their files for OpenJD, Flamenco and OpenCue.

Of each job: the run, the frames of its films in ranges, one task per film that encodes them; last,
the page. Each task is a command of digiclay that does nothing, with exit code 0, where it is done
already.
"""

import json
import os
import re
import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..core.base.errors import DigiclayError, OutputError
from ..core.files.run_folder import format_json
from ..core.files.tables import Record
from ..core.studies.job_table import MOVING, Job, JobSeries, Outputs
from ..plugins.method_loader import find_word

#: The option that takes a range of frames.
FRAME_OPTION = "--frames"


@dataclass(frozen=True)
class Task:
    """A command of digiclay in the folder of a series."""

    #: Unique.
    name: str
    #: One of "runs", "frames", "films", "page".
    stage: str
    #: Of digiclay.
    command: str
    #: What the command works on, from the series' folder; empty: that folder itself.
    folder: str
    options: tuple[str, ...] = ()
    #: Names of the tasks before it.
    needs: tuple[str, ...] = ()
    #: Whether it draws.
    blender: bool = False
    #: First frames of the parts of a film, a task each, up to the number of its frames; none: one
    #: task.
    frames: range = range(0)

    def list_arguments(self, series: str) -> list[str]:
        """Return the arguments of digiclay for a series in a folder."""
        folder = f"{series.rstrip('/')}/{self.folder}" if self.folder else series
        return [self.command, folder, *self.options]


def plan_series(series: JobSeries, chunk: int) -> tuple[Task, ...]:
    """Return the tasks of all jobs that have a scene, each after those it needs; `chunk` frames per task."""
    tasks = [task for job in series.jobs for task in _plan_job(job, series.outputs, chunk)]
    if not tasks:
        raise OutputError("No job can be submitted: the values of each are in conflict.")
    needed = {name for task in tasks for name in task.needs}
    last = tuple(task.name for task in tasks if task.name not in needed)
    return (*tasks, Task("page", "page", "page", "", needs=last))


def _plan_job(job: Job, outputs: Outputs, chunk: int) -> list[Task]:
    """Return the tasks of a job; OutputError where a film shows what is not in its session."""
    if job.scene is None:
        return []
    time = (0.0, job.scene.periods * job.scene.simulation.control_period)
    kinds = [kind for kind in MOVING if getattr(outputs, kind)]
    folder, first = f"jobs/{job.name}", f"{job.name}: run"
    word = find_word(job.scene)
    method = ("--method", word) if word else ()
    part = (*method, "--only", "run") if kinds else method
    tasks = [Task(first, "runs", "job", folder, part, blender=outputs.still is not None)]
    for kind in kinds:
        try:
            count = getattr(outputs, kind).count(time)
        except DigiclayError as error:
            raise OutputError(f"{job.name}: {error}") from None
        only, frames = (*method, "--only", kind), f"{job.name}: frames of {kind}"
        tasks += [
            Task(frames, "frames", "job", folder, only, (first,), True, range(0, count, chunk)),
            Task(f"{job.name}: {kind}", "films", "job", folder, only, (frames,), True),
        ]
    return tasks


def split_frames(tasks: Sequence[Task]) -> list[Task]:
    """Return tasks of which each draws one range of frames at most, for farms without ranges of their own."""
    parts: dict[str, list[Task]] = {}
    for task in tasks:
        needs = tuple(part.name for need in task.needs for part in parts[need])
        parts[task.name] = [] if task.frames else [replace(task, needs=needs)]
        for first in task.frames:
            text = f"{first}-{min(first + task.frames.step, task.frames.stop) - 1}"
            name, options = f"{task.name} {text}", (*task.options, FRAME_OPTION, text)
            parts[task.name].append(
                replace(task, name=name, options=options, needs=needs, frames=range(0))
            )
    return [part for group in parts.values() for part in group]


@dataclass(frozen=True)
class Submission:
    """Series as a farm gets it: its name, folder and tasks, and the program with its first arguments."""

    name: str
    series: str
    tasks: Sequence[Task]
    program: Sequence[str]

    def show(self, *words: str) -> str:
        """Return a command as it is typed into a terminal."""
        return join_words(words, windows=os.name == "nt")

    def find(self, name: str) -> str:
        """Return the path of a file in the folder of the series."""
        return os.path.join(self.series, name)


#: What a format makes: the text of each file by its path in the folder, and how they are submitted.
Written = tuple[dict[str, str], list[str]]
#: Characters of a step's name, and seconds a task gets to stop by itself.
LONGEST, GRACE = 64, 30
#: Names of the parameter that is the program, by the first of its arguments: the others fit that
#: kind alone.
PROGRAMS = {"-m": "Python", "--background": "Blender", "": "Digiclay"}


def write_openjd(submission: Submission) -> Written:
    """Return the job template of OpenJD."""
    path, *leading = submission.program
    program, steps = PROGRAMS[leading[0] if leading else ""], _name_steps(submission.tasks)
    template = {
        "specificationVersion": "jobtemplate-2023-09",
        "name": submission.name,
        "description": "A series of digiclay: runs, frames, films and the page.",
        "parameterDefinitions": [
            {
                "name": "Series",
                "type": "PATH",
                "default": ".",
                "objectType": "DIRECTORY",
                "dataFlow": "INOUT",
                "description": "The folder of the series, on a drive that all machines share.",
            },
            {
                "name": program,
                "type": "PATH",
                "objectType": "FILE",
                "dataFlow": "NONE",
                "description": f"The path of {program}; it is started with: {' '.join([*leading, 'job'])}",
            },
        ],
        "steps": [_make_step(task, steps, program, leading) for task in submission.tasks],
    }
    name = "openjd.json"
    file = submission.find(name)
    return {name: format_json(template).decode()}, [
        f"check: {submission.show('openjd', 'check', file)}",
        f"run on this machine: {submission.show('openjd', 'run', file, '-p', f'{program}={path}')}",
    ]


def _name_steps(tasks: Sequence[Task]) -> dict[str, str]:
    """Return the names of steps by those of their tasks: a long one is cut and gets a number."""
    steps = {}
    for number, task in enumerate(tasks, 1):
        mark = f" #{number}"
        long = len(task.name) > LONGEST
        steps[task.name] = f"{task.name[: LONGEST - len(mark)]}{mark}" if long else task.name
    return steps


def _make_step(task: Task, steps: dict[str, str], program: str, leading: Sequence[str]) -> Record:
    """Return a step, with a parameter space where it draws frames."""
    arguments = [*leading, *task.list_arguments("{{Param.Series}}")]
    step: Record = {"name": steps[task.name]}
    if task.needs:
        step["dependencies"] = [{"dependsOn": steps[need]} for need in task.needs]
    if task.frames:
        span = f"0-{task.frames.stop - 1}:{task.frames.step}"
        step["parameterSpace"] = {
            "taskParameterDefinitions": [{"name": "Frame", "type": "INT", "range": span}]
        }
        arguments += [FRAME_OPTION, f"{{{{Task.Param.Frame}}}}+{task.frames.step}"]
    stop = {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": GRACE}
    run = {"command": f"{{{{Param.{program}}}}}", "args": arguments, "cancelation": stop}
    return {**step, "script": {"actions": {"onRun": run}}}


#: The script of Flamenco's job type; its name without ending, with - for _, is the type's.
SCRIPT = Path(__file__).with_name("digiclay_series.js")
#: Flamenco's names of systems.
PLATFORMS = {"win32": "windows", "darwin": "darwin"}


def write_flamenco(submission: Submission) -> Written:
    """Return the job type of Flamenco, and the job as its Manager takes it."""
    parts = split_frames(submission.tasks)
    places = {part.name: number for number, part in enumerate(parts)}
    plan = [
        {
            "name": part.name,
            "type": "blender" if part.blender else "misc",
            "command": part.command,
            "folder": part.folder,
            "options": part.options,
            "needs": [places[need] for need in part.needs],
        }
        for part in parts
    ]
    table = {
        "name": submission.name,
        "type": SCRIPT.stem.replace("_", "-"),
        "priority": 50,
        "submitter_platform": PLATFORMS.get(sys.platform, "linux"),
        "metadata": {"project": "digiclay"},
        "settings": {
            "program": submission.program[0],
            "program_args": json.dumps(submission.program[1:], ensure_ascii=False),
            "series": submission.series,
            "tasks": json.dumps(plan, ensure_ascii=False),
        },
    }
    script, job = f"flamenco/{SCRIPT.name}", "flamenco/job.json"
    post = (
        "curl",
        "--header",
        "Content-Type: application/json",
        "--data-binary",
        f"@{submission.find(job)}",
    )
    return {script: SCRIPT.read_text(encoding="utf-8"), job: format_json(table).decode()}, [
        f"once: put {submission.find(script)} into the folder 'scripts' beside flamenco-manager, "
        "and restart it",
        f"submit: {submission.show(*post, 'http://MANAGER:8080/api/v3/jobs')}",
    ]


def write_cuecmd(submission: Submission) -> Written:
    """Return lists of commands for OpenCue, in the order in which they are to be submitted."""
    depth: dict[str, int] = {}
    lists: dict[tuple[int, str], list[str]] = {}
    for task in split_frames(submission.tasks):
        depth[task.name] = 1 + max((depth[need] for need in task.needs), default=0)
        line = submission.show(*submission.program, *task.list_arguments(submission.series))
        lists.setdefault((depth[task.name], task.stage), []).append(line)
    files = {
        f"cuecmd/{number}-{stage}.txt": "\n".join(lines) + "\n"
        for (number, stage), lines in sorted(lists.items())
    }
    submits = [submission.show("cuecmd", submission.find(name)) for name in files]
    return files, ["submit each when the one before has ended:", *submits]


#: The formats by their names.
FORMATS: dict[str, Callable[[Submission], Written]] = {
    "openjd": write_openjd,
    "flamenco": write_flamenco,
    "cuecmd": write_cuecmd,
}


def join_words(words: Sequence[str], *, windows: bool) -> str:
    """Return a command as one line of a shell; OutputError when a word cannot stand in a line."""
    for word in words:
        if re.search(r"[\x00-\x1f\x7f]", word) or (windows and re.search('[%"]', word)):
            raise OutputError(
                f"{word!r} cannot stand in a line of a command list: choose another folder with --out."
            )
    if not windows:
        return shlex.join(words)
    # In cmd.exe double quotes protect all but themselves and percent signs.
    quoted = (re.sub(r"(\\+)$", r"\1\1", word) for word in words)
    return " ".join(word if re.fullmatch(r"[\w.:\\/+-]+", word) else f'"{word}"' for word in quoted)
