"""Open Job Description: a job template of the revision 2023-09, as JSON.

Paths are parameters of the job, so that the farm can map them: the folder of the series, by default that
of the template, and the program. Ranges of frames are the parameter space of a step.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from .series_plan import FRAME_OPTION, Task

#: Characters of a step's name, and seconds a task gets to stop by itself.
LONGEST, GRACE = 64, 30
#: Names of the parameter that is the program, by the first of its arguments: the others fit that kind alone.
PROGRAMS = {"-m": "Python", "--background": "Blender", "": "Digiclay"}


def format_template(name: str, tasks: Sequence[Task], leading: Sequence[str]) -> str:
    """Return the template of a series; `leading` are the program's arguments before those of digiclay."""
    steps, program = name_steps(tasks), name_program(leading)
    template = {
        "specificationVersion": "jobtemplate-2023-09",
        "name": name,
        "description": "A series of digiclay: runs, frames, films and the page.",
        "parameterDefinitions": [
            {
                "name": "Series", "type": "PATH", "default": ".",
                "objectType": "DIRECTORY", "dataFlow": "INOUT",
                "description": "The folder of the series, on a drive that all machines share.",
            },
            {
                "name": program, "type": "PATH", "objectType": "FILE", "dataFlow": "NONE",
                "description": f"The path of {program}; it is started with: {' '.join([*leading, 'job'])}",
            },
        ],
        "steps": [_make_step(task, steps, program, leading) for task in tasks],
    }  # fmt: skip
    return json.dumps(template, indent=1, ensure_ascii=False) + "\n"


def name_program(leading: Sequence[str]) -> str:
    """Return the name of the parameter that is the program, by its arguments before those of digiclay."""
    return PROGRAMS[leading[0] if leading else ""]


def name_steps(tasks: Sequence[Task]) -> dict[str, str]:
    """Return the names of steps by those of their tasks: a long one is cut and gets a number."""
    steps = {}
    for number, task in enumerate(tasks, 1):
        mark = f" #{number}"
        long = len(task.name) > LONGEST
        steps[task.name] = f"{task.name[: LONGEST - len(mark)]}{mark}" if long else task.name
    return steps


def _make_step(task: Task, steps: dict[str, str], program: str, leading: Sequence[str]) -> dict[str, Any]:
    """Return a step, with a parameter space where it draws frames."""
    arguments = [*leading, *task.list_arguments("{{Param.Series}}")]
    step: dict[str, Any] = {"name": steps[task.name]}
    if task.needs:
        step["dependencies"] = [{"dependsOn": steps[need]} for need in task.needs]
    if task.frames:
        span = f"0-{task.frames.count - 1}:{task.frames.chunk}"
        step["parameterSpace"] = {
            "taskParameterDefinitions": [{"name": "Frame", "type": "INT", "range": span}]
        }
        arguments += [FRAME_OPTION, f"{{{{Task.Param.Frame}}}}+{task.frames.chunk}"]
    stop = {"mode": "NOTIFY_THEN_TERMINATE", "notifyPeriodInSeconds": GRACE}
    run = {"command": f"{{{{Param.{program}}}}}", "args": arguments, "cancelation": stop}
    return {**step, "script": {"actions": {"onRun": run}}}
