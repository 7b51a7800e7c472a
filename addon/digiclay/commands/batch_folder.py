"""Folder of a job series: files of the jobs, finished runs, logs, and the page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from .. import __version__
from ..core.base.errors import OutputError
from ..core.base.run_folder import resolve_inside
from ..core.base.unfinished import remove_abandoned
from ..core.base.whole_files import read_json, write_whole
from ..core.scene.toml_table import format_scene
from ..core.studies.job_table import JOB, SCENE, Job, JobSeries
from ..core.studies.series import Kind, open_series
from .gallery import Card, page
from .progress import format_duration
from .run_state import RUNS, TIMING, is_done
from .thumbnail import NAMES

__all__ = ["JOBS", "MARK", "Folder", "open_batch"]

#: The file by which a folder is known as a batch's, its other folders, and its page.
MARK, JOBS, LOGS, INDEX = "batch.json", "jobs", "logs", "index.html"
#: What a thumbnail leads to: the first of these there is.
SHOWN = ("film.mp4", "turntable.mp4", "still.png")
#: What is told of a run: its figure, what it is called, factor and unit.
FACTS: tuple[tuple[str, str, float, str], ...] = (
    ("method", "method", 0.0, ""),
    ("simulated", "simulated", 1.0, "s"),
    ("run_time", "run time", 1.0, "s"),
    ("rfd", "force deviation (RFD)", 1e3, "mN"),
    ("lag_mean", "lag", 1e3, "mm"),
    ("height_error", "height error, about", 1e6, "µm"),
    ("force_error", "force error, about", 1e3, "mN"),
)


@dataclass(frozen=True)
class Folder:
    """Folder of a job series."""

    path: Path
    batch: JobSeries

    def find_job(self, job: Job) -> Path:
        """Return the folder of a job's files."""
        return resolve_inside(self.path, JOBS, job.name)

    def find_run(self, job: Job) -> Path:
        """Return the folder of a job's run."""
        return resolve_inside(self.path, RUNS, job.name)

    def find_log(self, job: Job) -> Path:
        """Return the log file of a job's process."""
        return resolve_inside(self.path, LOGS, f"{job.name}.log")

    def is_done(self, job: Job) -> bool:
        """Return whether there is a whole run of just this job, and not of one it once was."""
        return not job.error and is_done(self.find_job(job), self.find_run(job))

    def describe(self, job: Job) -> None:
        """Write the files of a job."""
        if job.scene is None:
            return
        try:
            self.find_job(job).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.find_job(job)} cannot be made: {error.strerror or error}.") from None
        remove_abandoned(self.find_job(job))
        write_whole(self.find_job(job) / SCENE, format_scene(job.scene).encode())
        write_whole(self.find_job(job) / JOB, self.batch.outputs.format().encode())

    def measure_start_up(self) -> float | None:
        """Return the seconds it usually took until a job's process began to work."""
        timings = (read_json(self.find_run(job) / TIMING) or {} for job in self.batch.jobs)
        known = [timing["start_up"] for timing in timings if isinstance(timing.get("start_up"), float)]
        return median(known) if known else None

    def write_index(self, failed: Mapping[str, str], said: str) -> Path:
        """Write the page about all jobs; `failed` has the reasons by name.

        Parameters
        ----------
        failed : mapping of str to str
            Why jobs have failed, by their names.
        said : str
            What is said of all.
        """
        cards = []
        for job in self.batch.jobs:
            error = failed.get(job.name, "") or job.error
            if error:
                log = self.find_log(job)
                links = [("log", f"{LOGS}/{log.name}")] if log.is_file() else []
                cards.append(Card(job.name, links=links, error=error))
            elif self.is_done(job):
                cards.append(self._make_card(job))
            else:
                cards.append(Card(job.name, facts=[("not done yet", "")]))
        path = self.path / INDEX
        write_whole(path, page(f"Batch {self.batch.name}", said, cards).encode())
        return path

    def _make_card(self, job: Job) -> Card:
        """Return the content of the page for a finished job."""
        run = self.find_run(job)
        thumbnail = next(((run / name).read_bytes() for name in NAMES if (run / name).is_file()), b"")
        metrics, timing = (read_json(run / name) or {} for name in ("metrics.json", TIMING))
        facts = [(said, _format_figure(metrics.get(key), factor, unit)) for key, said, factor, unit in FACTS]
        if metrics.get("beyond_a_finger"):
            facts.append(("not to be trusted", metrics["beyond_a_finger"]))
        took = sum(value for value in timing.values() if isinstance(value, float))
        facts += [
            ("start of its process", _format_figure(timing.get("start_up"), 1.0, "s")),
            ("whole job", format_duration(took)),
        ]
        hidden = {*NAMES, TIMING, JOB}
        links = [
            (path.name, f"{RUNS}/{job.name}/{path.name}")
            for path in sorted(run.iterdir())
            if path.name not in hidden and not path.name.startswith(".") and path.is_file()
        ]
        shown = next((path for name in SHOWN for said, path in links if said == name), "")
        return Card(job.name, thumbnail, [fact for fact in facts if fact[1]], links, shown)


@contextmanager
def open_batch(path: Path, batch: JobSeries) -> Iterator[Folder]:
    """Make a batch's folder, or go on with one; nobody else may work in it meanwhile.

    Parameters
    ----------
    path : Path
    batch : JobSeries

    Raises
    ------
    OutputError
        When it holds other things, cannot be written, or another process works in it.
    """
    known = {"batch": batch.name, "digiclay": __version__}
    with open_series(path, Kind("batch", MARK, (JOBS, RUNS, LOGS)), known):
        yield Folder(path, batch)


def _format_figure(value: Any, factor: float, unit: str) -> str:
    """Write a figure with its unit; nothing where there is none."""
    if value is None:
        return ""
    if not isinstance(value, (int, float)):
        return str(value)
    return f"{value * factor:.3g} {unit}".rstrip()
