"""Folder of a job series: files of the jobs, finished runs, logs, and the page."""

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from ..core.base.errors import DigiclayError, OutputError
from ..core.files import run_folder
from ..core.metrics.metric_table import (
    ERRORS,
    METRICS,
    RUN,
    describe_errors,
    describe_losses,
    list_beyond,
)
from ..core.scene.toml_table import format_scene
from ..core.studies.job_table import JOB, SCENE, Job, JobSeries, Outputs
from ..core.studies.series import Kind, open_series
from ..core.version import __version__
from ..plugins.method_loader import write_code
from .gallery import NAMES, Card, page
from .job_steps import ERROR, RUNS, TIMING, find_error, is_done, read_tail
from .progress import format_duration

#: The file by which a folder is known as a batch's, its other folders, and its page.
MARK, JOBS, LOGS, INDEX = "batch.json", "jobs", "logs", "index.html"
#: What a thumbnail leads to: the first of these there is.
SHOWN = ("film.mp4", "turntable.mp4", "still.png")
#: What a card says of a job that is not done, and after how many seconds a browser then loads the
#: page again.
UNDONE, AGAIN = [("not done yet", "")], 30
#: Seconds to wait for another process that writes the page; and the age from which on jobs write it
#: anew, s.
PATIENCE, AGE = 20.0, 10.0
#: Metrics on the card of a run.
FACTS = {
    name: (RUN | METRICS | ERRORS)[name]
    for name in ("simulated", "run_time", "rfd", "lag_mean", "height_error", "force_error")
}


@dataclass(frozen=True)
class Folder:
    """Folder of a job series."""

    path: Path
    batch: JobSeries

    def find_job(self, job: Job) -> Path:
        """Return the folder of a job's files."""
        return run_folder.resolve_inside(self.path, JOBS, job.name)

    def find_run(self, job: Job) -> Path:
        """Return the folder of a job's run."""
        return run_folder.resolve_inside(self.path, RUNS, job.name)

    def find_log(self, job: Job) -> Path:
        """Return the log file of a job's process."""
        return run_folder.resolve_inside(self.path, LOGS, f"{job.name}.log")

    def is_done(self, job: Job) -> bool:
        """Return whether there is a whole run of this job as it is defined now."""
        return not job.error and is_done(self.find_job(job), self.find_run(job))

    def describe(self, job: Job) -> None:
        """Write the files of a job."""
        if job.scene is None:
            return
        folder = run_folder.make_folder(self.find_job(job))
        run_folder.remove_abandoned(folder)
        write_code(job.scene, folder)
        run_folder.write_whole(folder / SCENE, format_scene(job.scene).encode())
        run_folder.write_whole(folder / JOB, self.batch.outputs.format().encode())

    def read_failures(self) -> dict[str, str]:
        """Return why jobs failed that other processes have done, by their names.

        The log of a job that was described anew since says nothing about it.
        """
        failed = {job.name: job.error for job in self.batch.jobs if job.error}
        for job in self.batch.jobs:
            log = self.find_log(job)
            try:
                new = log.stat().st_mtime_ns >= (self.find_job(job) / SCENE).stat().st_mtime_ns
            except OSError:
                continue
            error = find_error(read_tail(log)) if new else ""
            if error and not self.is_done(job):
                failed[job.name] = error
        return failed

    def measure_start_up(self) -> float | None:
        """Return the seconds it usually took until a job's process began to work."""
        timings = (
            run_folder.read_json(self.find_run(job) / TIMING) or {} for job in self.batch.jobs
        )
        times = [
            timing["start_up"] for timing in timings if isinstance(timing.get("start_up"), float)
        ]
        return median(times) if times else None

    def write_index(self, failed: Mapping[str, str], summary: str) -> Path:
        """Write the page about all jobs; `failed` has the reasons by name."""
        cards = [
            self._make_card(job, failed.get(job.name, "") or job.error) for job in self.batch.jobs
        ]
        path = self.path / INDEX
        refresh = AGAIN if any(card.facts == UNDONE for card in cards) else 0
        with run_folder.lock_name(path, PATIENCE):
            run_folder.write_whole(
                path, page(f"Batch {self.batch.name}", summary, cards, refresh).encode()
            )
        return path

    def summarize(self, count: int, failed: Mapping[str, str], state: str = "done") -> str:
        """Write how many jobs are in a state, and how many have failed."""
        text = f"{count} of {len(self.batch.jobs)} jobs {state}"
        return f"{text}, {len(failed)} failed" if failed else text

    def write_page(self) -> str:
        """Write the page from what the folder holds, and return what it says of all jobs."""
        failed = self.read_failures()
        done = sum(self.is_done(job) for job in self.batch.jobs)
        summary = self.summarize(done, failed)
        self.write_index(failed, f"{summary}.")
        return summary

    def _make_card(self, job: Job, error: str) -> Card:
        """Return the content of the page for a job; `error`: why it has failed, empty if it has not."""
        if error:
            log = self.find_log(job)
            links = [("log", f"{LOGS}/{log.name}")] if log.is_file() else []
            return Card(job.name, links=links, error=error)
        if not self.is_done(job):
            return Card(job.name, facts=UNDONE)
        run = self.find_run(job)
        thumbnail = next(
            ((run / name).read_bytes() for name in NAMES if (run / name).is_file()), b""
        )
        metrics, timing = (
            run_folder.read_json(run / name) or {} for name in ("metrics.json", TIMING)
        )
        took = sum(value for value in timing.values() if isinstance(value, float))
        facts = [
            ("method", str(metrics.get("method", ""))),
            *(
                (fact.label, _format(metrics.get(name), fact.factor, fact.shown))
                for name, fact in FACTS.items()
            ),
            ("losses", describe_losses(metrics)),
            ("not to be trusted", "; ".join(list_beyond(metrics))),
            (
                "errors",
                metrics.get("errors_in_doubt")
                or ("" if "height_error" in metrics else describe_errors(metrics)),
            ),
            ("start of its process", _format(timing.get("start_up"), 1.0, "s")),
            ("whole job", format_duration(took)),
        ]
        hidden = {*NAMES, TIMING, JOB}
        links = [
            (path.name, f"{RUNS}/{job.name}/{path.name}")
            for path in sorted(run.iterdir())
            if path.name not in hidden and not path.name.startswith(".") and path.is_file()
        ]
        shown = next((path for name in SHOWN for label, path in links if label == name), "")
        return Card(job.name, thumbnail, [fact for fact in facts if fact[1]], links, shown)


@contextmanager
def open_batch(path: Path, batch: JobSeries) -> Iterator[Folder]:
    """Make a batch's folder, or continue one; no other process may work in it meanwhile."""
    description = {
        "batch": batch.name,
        "digiclay": __version__,
        "jobs": {job.name: job.error for job in batch.jobs},
    }
    with open_series(path, Kind("batch", MARK, (JOBS, RUNS, LOGS)), description):
        yield Folder(path, batch)


def read_batch(path: Path) -> Folder:
    """Return a batch's folder with the jobs it has, without their definitions."""
    description = run_folder.read_json(path / MARK)
    if description is None or not isinstance(description.get("batch"), str):
        raise OutputError(
            f"{path} is not the folder of a job series: it has no {MARK} of 'digiclay batch'."
        )
    named = description.get("jobs")
    if not isinstance(named, dict):  # of an older version
        named = {job.name: "" for job in sorted((path / JOBS).glob("*/")) if (job / JOB).is_file()}
    jobs = tuple(Job(str(name), None, str(error)) for name, error in named.items())
    return Folder(path, JobSeries(description["batch"], jobs, Outputs()))


def _find_series(job: Path) -> Folder | None:
    """Return the series in whose folder the files of a job are; None where they stand alone."""
    full = job.resolve()
    path = full.parent.parent
    if full.parent.name != JOBS or not (path / MARK).is_file():
        return None
    series = read_batch(path)
    return series if any(job.name == full.name for job in series.batch.jobs) else None


def note_failure(job: Path, error: str) -> None:
    """Note for the page why a job failed that was started by itself; an empty text removes the note."""
    with suppress(OSError, DigiclayError):  # the job itself matters more
        series = _find_series(job)
        if series is None:
            return
        log = series.find_log(Job(job.resolve().name, None))
        if error:
            log.parent.mkdir(exist_ok=True)
            run_folder.write_whole(log, f"{ERROR}{error}\n".encode())
        elif find_error(read_tail(log)):
            log.unlink(missing_ok=True)


def refresh_page(job: Path) -> None:
    """Write the page of a job's series anew, unless another job has just done so."""
    with suppress(OSError, DigiclayError):
        series = _find_series(job)
        if series is None:
            return
        page = series.path / INDEX
        if not page.is_file() or time.time() - page.stat().st_mtime > AGE:
            series.write_page()


def _format(value: Any, factor: float, unit: str) -> str:
    """Write a figure with its unit; nothing where there is none."""
    if value is None:
        return ""
    if not isinstance(value, (int, float)):
        return str(value)
    return f"{value * factor:.3g} {unit}".rstrip()
