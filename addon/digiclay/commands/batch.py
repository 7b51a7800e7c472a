"""``digiclay batch``: scenes × methods × settings in the background, on several processes."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ..core.errors import DigiclayError
from ..core.jobs import Job, batch, find_jobs
from .arguments import add_command
from .batch_folder import Folder, opened
from .exit_codes import FAILED, STOPPED
from .job import check_outputs
from .progress import Counted, duration
from .stop import Stop
from .sweep import workers
from .worker import Worker, cores

__all__ = ["add"]

EXAMPLES = """\
examples:
  digiclay batch first                    the sample batch, into ./first
  digiclay batch my.toml --jobs 4         four processes; index.html shows what came of it
  digiclay batch my.toml --prepare        only the files of the jobs, for a render farm: see 'digiclay job'

Stopped by Ctrl-C, or killed, it goes on when the same command is given again: finished jobs are kept, and
done again only if the JOBS file has changed them. Exit code 1: some jobs failed, the others are there.
"""
#: Seconds between two looks at the processes, and those a process gets to stop by itself.
LOOK, GRACE = 0.1, 20.0


def add(commands: Any) -> None:
    """Add the command."""
    said = "run many scenes in the background, with exports, pictures and films"
    parser = add_command(commands, "batch", said, EXAMPLES)
    parser.add_argument("file", metavar="JOBS", help="a .toml file, or a sample's name")
    parser.add_argument("--out", metavar="DIR", type=Path, help="the folder; default the file's name, here")
    parser.add_argument("--jobs", metavar="N", type=workers, help="processes; default one a core")
    parser.add_argument("--prepare", action="store_true", help="write the jobs' files, and run none")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors, and no progress")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Do the jobs that are not done yet, and write the page about all."""
    made = batch(find_jobs(arguments.file))
    sound = next((job.scene for job in made.jobs if job.scene is not None), None)
    if sound is not None:  # outputs that cannot be had here at all are refused before any work
        check_outputs(sound, made.outputs)
    out: Path = arguments.out or Path(made.name)
    with opened(out, made) as folder:
        for job in made.jobs:
            folder.describe(job)
        if arguments.prepare:
            if not arguments.quiet:
                print(f"{len(made.jobs)} jobs written to {out / 'jobs'}")
            return 0
        return _carry_on(arguments, folder)


def _carry_on(arguments: argparse.Namespace, folder: Folder) -> int:
    """Do the jobs, tell of them, and return the exit code."""
    made, started = folder.batch, time.monotonic()
    failed = {job.name: job.error for job in made.jobs if job.error}
    before = sum(folder.is_done(job) for job in made.jobs)
    todo = [job for job in made.jobs if not job.error and not folder.is_done(job)]

    def tell(line: str) -> None:
        if not arguments.quiet:
            print(line, flush=True)

    for name, error in failed.items():
        tell(f"failed: {name}: {error}")
    count = max(1, min(arguments.jobs or cores(), len(todo)))
    with Stop() as stop, Counted(sys.stderr, made.name, "jobs", before + len(failed)) as bar:

        def draw(done: float) -> None:
            if not arguments.quiet:
                bar(before + len(failed) + done, len(made.jobs), f", {len(failed)} failed" if failed else "")

        _work(folder, todo, count, stop, failed, draw, tell)
        stopped = stop()
    done = sum(folder.is_done(job) for job in made.jobs)
    said = f"{done} of {len(made.jobs)} jobs done" + (f", {len(failed)} failed" if failed else "")
    took = time.monotonic() - started
    if todo:
        processes = "1 process" if count == 1 else f"{count} processes"
        said += f"; {done - before} of them now, in {duration(took)} on {processes}"
    ready = folder.start_up()
    if ready is not None:
        said += f"; a job's process takes {ready:.1f} s to start"
    index = folder.write_index(failed, f"{said}.")
    tell(f"{said}.\nwritten to {index}")
    if stopped and done + len(failed) < len(made.jobs):
        tell("Stopped: what is done is kept, and the same command goes on from there.")
        return STOPPED
    if failed:
        name, error = next(iter(failed.items()))
        first = f"{len(failed)} of {len(made.jobs)} jobs failed; the first one: {name}: {error}"
        print(first, file=sys.stderr)
        return FAILED
    return 0


def _work(
    folder: Folder,
    todo: list[Job],
    count: int,
    stop: Callable[[], bool],
    failed: dict[str, str],
    draw: Callable[[float], None],
    tell: Callable[[str], None],
) -> None:
    """Keep so many processes busy until all jobs are done, or somebody asks to stop."""
    waiting, running, ended = list(reversed(todo)), dict[str, tuple[Job, Worker]](), 0
    with ExitStack() as at_the_end:
        at_the_end.callback(lambda: [worker.kill() for _, worker in running.values()])
        while running or (waiting and not stop()):
            while waiting and len(running) < count and not stop():
                job = waiting.pop()
                running[job.name] = job, _started(folder, job)
            time.sleep(LOOK)
            for job, worker in list(running.values()):
                if not worker.ended():
                    continue
                del running[job.name]
                if not folder.is_done(job) and not stop():
                    failed[job.name] = worker.error()
                    tell(f"failed: {job.name}: {failed[job.name]}")
                else:
                    ended += 1
            draw(ended + sum(worker.fraction() for _, worker in running.values()))
            if stop():
                deadline = time.monotonic() + GRACE
                for _, worker in running.values():
                    worker.stop()
                for _, worker in running.values():
                    worker.wait(deadline)


def _started(folder: Folder, job: Job) -> Worker:
    """Start the process of a job."""
    arguments = [
        "job",
        str(folder.job(job).resolve()),
        "--out",
        str(folder.run(job).resolve()),
        "--overwrite",
        "--follow",
        "--since",
        repr(time.time()),
    ]
    try:
        return Worker(arguments, folder.log(job))
    except OSError as error:
        raise DigiclayError(f"A process cannot be started: {error.strerror or error}.") from None
