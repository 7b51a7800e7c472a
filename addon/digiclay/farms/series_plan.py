"""Tasks of a job series on a render farm, and which of them need others.

Of each job: the run, the frames of its films in ranges, and one task a film that encodes them; the page
last. Each task is a command of digiclay that does nothing, with exit code 0, where it is done already.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..core.base.errors import DigiclayError, OutputError
from ..core.studies.job_outputs import MOVING, Outputs
from ..core.studies.job_table import Job, JobSeries
from ..plugins.method_copy import find_word

#: The option that takes a range of frames.
FRAME_OPTION = "--frames"


@dataclass(frozen=True)
class Frames:
    """Frames of a film, in parts of so many."""

    count: int
    chunk: int

    def list_ranges(self) -> list[str]:
        """Return the parts as the option takes them, ``0-49``."""
        starts = range(0, self.count, self.chunk)
        return [f"{first}-{min(first + self.chunk, self.count) - 1}" for first in starts]


@dataclass(frozen=True)
class Task:
    """A command of digiclay in the folder of a series.

    Attributes
    ----------
    name : str
        Unique.
    stage : {"runs", "frames", "films", "page"}
    command : str
        Of digiclay.
    folder : str
        What the command works on, from the series' folder; empty: that folder itself.
    options : tuple of str
    needs : tuple of str
        Names of the tasks before it.
    blender : bool
        Whether it draws.
    frames : Frames or None
        A task for each range of them; None: one task.
    """

    name: str
    stage: str
    command: str
    folder: str
    options: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    blender: bool = False
    frames: Frames | None = None

    def list_arguments(self, series: str) -> list[str]:
        """Return the arguments of digiclay for a series in a folder."""
        place = f"{series.rstrip('/')}/{self.folder}" if self.folder else series
        return [self.command, place, *self.options]


def plan_series(series: JobSeries, chunk: int) -> tuple[Task, ...]:
    """Return the tasks of all jobs whose values go together, each after those it needs.

    `chunk`: frames of a film that a task draws, at most. Raises DigiclayError when a film shows what is not
    in the session of its job, or there is no job.
    """
    tasks = [task for job in series.jobs for task in _plan_job(job, series.outputs, chunk)]
    if not tasks:
        raise OutputError("No job can be submitted: the values of none go together.")
    needed = {name for task in tasks for name in task.needs}
    last = tuple(task.name for task in tasks if task.name not in needed)
    return (*tasks, Task("page", "page", "page", "", needs=last))


def _plan_job(job: Job, outputs: Outputs, chunk: int) -> list[Task]:
    """Return the tasks of a job."""
    if job.scene is None:
        return []
    time = (0.0, job.scene.periods * job.scene.simulation.control_period)
    kinds = [kind for kind in MOVING if getattr(outputs, kind)]
    folder, first = f"jobs/{job.name}", f"{job.name}: run"
    word = find_word(job.scene)
    own = ("--method", word) if word else ()
    part = (*own, "--only", "run") if kinds else own
    tasks = [Task(first, "runs", "job", folder, part, blender=outputs.still is not None)]
    for kind in kinds:
        try:
            count = getattr(outputs, kind).count(time)
        except DigiclayError as error:
            raise OutputError(f"{job.name}: {error}") from None
        only, frames = (*own, "--only", kind), f"{job.name}: frames of {kind}"
        tasks += [
            Task(frames, "frames", "job", folder, only, (first,), True, Frames(count, chunk)),
            Task(f"{job.name}: {kind}", "films", "job", folder, only, (frames,), True),
        ]
    return tasks


def split_frames(tasks: tuple[Task, ...]) -> tuple[Task, ...]:
    """Return tasks of which each draws one range of frames at most, for farms without ranges of their own."""
    parts: dict[str, tuple[str, ...]] = {}
    found: list[Task] = []
    for task in tasks:
        needs = tuple(name for need in task.needs for name in parts[need])
        if task.frames is None:
            own = [replace(task, needs=needs)]
        else:
            own = [
                replace(
                    task, name=f"{task.name} {text}", options=(*task.options, FRAME_OPTION, text),
                    needs=needs, frames=None,
                )
                for text in task.frames.list_ranges()
            ]  # fmt: skip
        parts[task.name] = tuple(part.name for part in own)
        found += own
    return tuple(found)
