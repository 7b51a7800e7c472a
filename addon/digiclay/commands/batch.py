"""``digiclay batch``: a job series in the background, on several processes, or as files for a render farm.

No network is contacted: what --submit prints in the end is how the files are handed to the farm.
"""

import os
import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Sequence
from functools import partial
from pathlib import Path, PureWindowsPath

from ..core.base.errors import OutputError, one_line
from ..core.files.run_folder import make_safe_name, resolve_inside, write_whole
from ..core.studies.job_table import Job, find_jobs_file, read_jobs
from ..farms.series_plan import FORMATS, Submission, plan_series, split_frames
from ..plugins.method_loader import find_word
from .arguments import QUIET, Options, command, load_by_option, one_of, say
from .batch_folder import Folder, open_batch
from .job_steps import PROGRESS, check_outputs, find_error, read_fraction, read_tail
from .progress import Counted, format_duration
from .series_options import read_count
from .stop import FAILED, STOPPED, Stop
from .worker import Process, Processes, count_cores, find_program, start_blender

EXAMPLES = """\
examples:
  digiclay batch first                    the sample batch, into ./first
  digiclay batch my.toml --jobs 4         four processes; results in index.html
  digiclay batch my.toml --method mine.py:Mine      with a method of your own, too
  digiclay batch my.toml --prepare        files of the jobs only, for another machine: see 'digiclay job'
  digiclay batch my.toml --submit openjd  a job for a render farm: tasks, their order, ranges of frames

After Ctrl-C or a kill, the same command continues: finished jobs are kept, and repeated only after a change
in the JOBS file. Exit code 1: some jobs failed, the others are complete.
"""
#: Frames of a film that a task draws by default.
CHUNK = 50
#: Options that need --submit.
FARM_OPTIONS = {
    "--program PATH": (
        "with --submit: digiclay, its Python or Blender on the machines there; default: the one running"
    ),
    "--chunk N": (
        read_count,
        f"with --submit: frames of a film that a task draws; default {CHUNK}",
    ),
    "--quiet": QUIET,
}
OPTIONS: Options = {
    "file JOBS": "a .toml file, or a sample's name",
    "--out DIR": (Path, "folder; default: the file's name in the working folder"),
    "--method M": {
        "action": "append",
        "default": [],
        "help": "one more method for all scenes, also one of your own, mine.py:Mine; may be repeated",
    },
    "--jobs N": (read_count, "number of processes; default: one per core"),
}
#: Options of which one may be given.
INSTEAD = {
    "--prepare": "write the files of the jobs, run none",
    "--submit FORMAT": (
        FORMATS,
        f"write the files of the jobs and those of a render farm: {', '.join(FORMATS)}; run none",
    ),
}
#: Seconds between two pages that are written while jobs run, at least, and times that a page's
#: writing takes.
PAUSE, REST = 2.0, 10.0


class JobProcess(Process):
    """A process that does one job of a batch, by the arguments of its command line; `log` gets its output."""

    def __init__(self, arguments: Sequence[str], log: Path) -> None:
        self._log = log
        with log.open("wb") as output:
            super().__init__(arguments, stdout=output, stderr=subprocess.STDOUT)

    def read_fraction(self) -> float:
        """Return how much of the job is done, from 0 to 1."""
        return read_fraction(read_tail(self._log))

    def read_error(self) -> str:
        """Return in one line why the job was not done."""
        lines = read_tail(self._log)
        if error := find_error(lines):
            return error
        others = [line for line in lines if line.strip() and not line.startswith(PROGRESS)]
        last = f": {others[-1].strip()}" if others else ""
        return one_line(f"The process ended with {self.wait()}{last}")


@command(
    "run a job series in the background: scenes, exports, pictures and films",
    EXAMPLES,
    OPTIONS,
    one_of(INSTEAD),
    FARM_OPTIONS,
)
def carry_out(arguments: Namespace) -> int:
    """Do the jobs that are not done yet, and write the page about all."""
    for name in ("program", "chunk"):
        if getattr(arguments, name) is not None and arguments.submit is None:
            raise OutputError(f"--{name} must be given with --submit only.")
    methods = [load_by_option(word, "--method") for word in arguments.method]
    series = read_jobs(find_jobs_file(arguments.file), list(dict.fromkeys(methods)))
    sound = next((job.scene for job in series.jobs if job.scene is not None), None)
    if sound is not None:  # outputs that cannot be had here at all are refused before any work
        check_outputs(sound, series.outputs)
    out = arguments.out or Path(series.name)
    with open_batch(out, series) as folder:
        for job in series.jobs:
            folder.describe(job)
        failed = {job.name: job.error for job in series.jobs if job.error}
        if arguments.prepare:
            say(arguments, f"{len(series.jobs) - len(failed)} jobs written to {out / 'jobs'}")
        elif arguments.submit:
            say(
                arguments,
                *write_farm_files(folder, arguments.submit, arguments.program, arguments.chunk),
            )
        elif not _finish(arguments, folder, failed):
            return STOPPED
    if not failed:
        return 0
    name, error = next(iter(failed.items()))
    print(
        f"{len(failed)} of {len(series.jobs)} jobs failed; the first one: {name}: {error}",
        file=sys.stderr,
    )
    return FAILED


def _finish(arguments: Namespace, folder: Folder, failed: dict[str, str]) -> bool:
    """Run the jobs, add to `failed` why some failed, and report; return False after a stop."""
    series, started = folder.batch, time.monotonic()
    todo = [job for job in series.jobs if not job.error and not folder.is_done(job)]
    before = len(series.jobs) - len(todo)
    for name, error in failed.items():
        say(arguments, f"failed: {name}: {error}")
    count = max(1, min(arguments.jobs or count_cores(), len(todo)))
    ended, due = before, started
    with Stop() as stop, Counted(sys.stderr, series.name, "jobs", before) as bar:

        def draw() -> None:
            if not arguments.quiet:  # each reads its log
                done = ended + sum(map(JobProcess.read_fraction, processes.alive))
                bar(done, len(series.jobs), f", {len(failed)} failed" if failed else "")

        with Processes[JobProcess](stop, draw) as processes:
            for job, outcome in processes.finish(count, todo, partial(_start_job, folder)):
                ended += 1
                if not folder.is_done(job):
                    if stop():
                        continue
                    error = outcome if isinstance(outcome, str) else outcome.read_error()
                    failed[job.name] = error
                    say(arguments, f"failed: {job.name}: {error}")
                began = time.monotonic()
                if began >= due:
                    folder.write_index(
                        failed, f"{folder.summarize(ended, failed, 'ended so far')}."
                    )
                    due = time.monotonic() + max(PAUSE, REST * (time.monotonic() - began))
        stopped = stop()
    now = sum(folder.is_done(job) for job in todo)
    done = before - sum(bool(job.error) for job in series.jobs) + now
    summary = folder.summarize(done, failed)
    took = time.monotonic() - started
    if todo:
        at_a_time = "1 process" if count == 1 else f"{count} processes"
        summary += f"; {now} of them now, in {format_duration(took)} on {at_a_time}"
    ready = folder.measure_start_up()
    if ready is not None:
        summary += f"; a job's process takes {ready:.1f} s to start"
    index = folder.write_index(failed, f"{summary}.")
    say(arguments, f"{summary}.", f"written to {index}")
    if stopped and done + len(failed) < len(series.jobs):
        say(arguments, "Stopped: finished work is kept, and the same command continues.")
        return False
    return True


def _start_job(folder: Folder, job: Job) -> JobProcess:
    """Run a job in a process of its own."""
    arguments = [
        "job",
        str(folder.find_job(job).resolve()),
        "--out",
        str(folder.find_run(job).resolve()),
        "--follow",
        "--since",
        repr(time.time()),
    ]
    if job.scene is not None and (word := find_word(job.scene)):
        arguments += ["--method", word]
    return JobProcess(arguments, folder.find_log(job))


def write_farm_files(
    folder: Folder, form: str, program: str | None, chunk: int | None
) -> list[str]:
    """Write the files of a farm, or none in case of an error; return the lines to print."""
    tasks = plan_series(folder.batch, chunk or CHUNK)
    # Without "..", through the links by which the user named it where that is right.
    series = os.path.abspath(folder.path)
    if not os.path.exists(series) or not os.path.samefile(series, folder.path):
        series = os.path.realpath(folder.path)
    submission = Submission(make_safe_name(folder.batch.name), series, tasks, find_start(program))
    files, lines = FORMATS[form](submission)
    for word in (submission.series, *submission.program):
        try:
            word.encode()
        except UnicodeEncodeError:
            raise OutputError(
                f"{word!r} is not valid text: choose another folder with --out."
            ) from None
    if form == "cuecmd":  # an earlier submission may have had more lists
        for path in folder.path.glob("cuecmd/[0-9]-*.txt"):
            if f"cuecmd/{path.name}" not in files:
                path.unlink()
    for name, text in files.items():
        path = resolve_inside(folder.path, *name.split("/"))
        path.parent.mkdir(exist_ok=True)
        write_whole(path, text.encode())
    count = len(split_frames(tasks))
    return [
        f"{count} tasks written to {', '.join(str(folder.path / name) for name in files)}",
        *lines,
    ]


def find_start(program: str | None) -> list[str]:
    """Return a program of the farm, or this process's, and its arguments before those of digiclay."""
    if program is None:
        return find_program()[0]
    if not program.strip():
        raise OutputError("--program must be the path of digiclay or Blender (got an empty one).")
    # The paths of the farm need not be those of this system; this kind knows both separators.
    kind = PureWindowsPath(program).stem.lower()
    if kind.startswith("blender"):
        return start_blender(program)
    return [program, "-m", "digiclay"] if kind.startswith("python") else [program]
