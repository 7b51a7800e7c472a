"""``digiclay job`` and ``page``: one job of a series, or a part of it, from its files alone; its page."""

import os
import select
import shutil
import sys
import time
import traceback
from argparse import SUPPRESS, Namespace
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ..core.base.errors import BusyError, DigiclayError, OutputError, one_line
from ..core.files.run_folder import claim_folder, format_json, write_whole
from ..core.files.tables import Record
from ..core.scene.scene_source import load
from ..core.studies.job_table import JOB, MOVING, SCENE, Outputs, read_outputs
from ..core.studies.series import describe_error
from ..plugins.method_loader import CODE, resolve_word
from .arguments import command, load_by_option, say
from .batch_folder import note_failure, read_batch, refresh_page
from .job_steps import (
    ERROR,
    FILES,
    PROGRESS,
    RUNS,
    TIMING,
    RunState,
    Tell,
    Work,
    check_outputs,
    judge_run,
)
from .progress import Counted
from .stop import FAILED, STOPPED, WRONG, Stop

EXAMPLES = """\
examples:
  digiclay batch first --prepare            write the files of the jobs, run none
  digiclay job first/jobs/tap-cell_states   run one of them, on any machine: into first/runs
  digiclay batch first                      collect finished jobs, run the rest, write first/index.html

A job is a folder with scene.toml (every parameter of its session) and job.toml (its outputs). A finished
job is left as it is, with exit code 0; after a change of its files it is repeated.

On several machines, a long film in parts:
  digiclay job JOB --only run                     all but the films
  digiclay job JOB --only film --frames 0-49      some frames; on any machine, in any order
  digiclay job JOB --only film                    the film of these frames; draws those that are missing
"""
OPTIONS = {
    "job JOB": (Path, "the folder of the job"),
    "--out DIR": (Path, "default: ../../runs/JOB, as in a series"),
    "--only": (("run", *MOVING), "a part: all but the films, or one film"),
    "--frames A-B": "with --only: these frames of the film, from 0",
    "--method M": "a control method of your own, from the job's folder (method.py:Mine) or elsewhere",
    "--overwrite": "replace a run, a finished one too",
    "--quiet": "print errors only",
    # How a batch starts it: at what time, and that it is to stop when its standard input ends.
    "--since": (float, SUPPRESS),
    "--follow": SUPPRESS,
}
#: Seconds that the process of a batch that was killed gets to end.
GRACE = 20.0


@command(
    "run one job of a series from its files alone; for render farms",
    EXAMPLES,
    OPTIONS,
    listed=False,
)
def carry_out(arguments: Namespace) -> int:
    """Do the job, by itself or as a process of a batch."""
    return _follow(arguments) if arguments.follow else _do_alone(arguments)


def _do_alone(arguments: Namespace) -> int:
    """Do the job with a progress line, and write its failure and its end to the page of its series."""
    note_failure(arguments.job, "")
    try:
        with Stop() as stop, Counted(sys.stderr, arguments.job.name, "%") as bar:
            outcome = _do_job(
                arguments, stop, lambda step, share: bar(100.0 * share, 100, f", {step}")
            )
    except DigiclayError as error:
        if not isinstance(error, BusyError):  # another process may still do it
            note_failure(arguments.job, one_line(error))
        raise
    finally:
        refresh_page(arguments.job)
    say(arguments, outcome)
    return 0


def _follow(arguments: Namespace) -> int:
    """Do the job for a batch, which reads progress and error from this process's output."""

    def tell(step: str, share: float) -> None:
        print(f"{PROGRESS}{step} {share:.4f}", flush=True)

    try:
        _do_job(arguments, has_input_ended, tell)
        return 0
    except KeyboardInterrupt:
        return STOPPED
    except Exception as error:  # the batch continues, and has to report this
        mendable = isinstance(error, (DigiclayError, MemoryError))
        if not mendable:
            traceback.print_exc()
        print(f"{ERROR}{describe_error(error)}", flush=True)
        return WRONG if mendable else FAILED


def has_input_ended() -> bool:
    """Return whether standard input, into which nothing is written, has ended."""
    if sys.platform == "win32":  # where select is for sockets alone
        import _winapi
        import msvcrt

        with suppress(BrokenPipeError):
            _winapi.PeekNamedPipe(msvcrt.get_osfhandle(0), 0)
            return False
        return True
    return bool(select.select([0], [], [], 0.0)[0])


def _do_job(arguments: Namespace, stopped: Callable[[], bool], tell: Tell) -> str:
    """Do the job or a part of it, and return its outcome; KeyboardInterrupt when it was stopped."""
    folder, only, frames = arguments.job, arguments.only, arguments.frames
    if not os.path.isfile(folder / JOB):
        raise OutputError(f"{folder} is not the folder of a job: it has no {JOB}.")
    if frames is not None and only not in MOVING:
        raise OutputError("--frames must be given with --only film or --only turntable.")
    if arguments.method is not None:
        load_by_option(resolve_word(arguments.method, folder), "--method")
    out = arguments.out or _find_place(folder)
    work = Work(folder, out, read_outputs(folder / JOB), stopped, tell)
    if only not in MOVING:
        return _do_run(arguments, work)
    if frames is not None:
        drawn = work.make_frames(only, frames)
        return f"frames {frames} of {out / only}.mp4 {'drawn' if drawn else 'were there already'}"
    written = work.make_film(only)
    return f"{'written to' if written else 'was done already:'} {out / only}.mp4"


def _find_place(job: Path) -> Path:
    """Return where a series keeps the run of a job."""
    full = job.resolve()
    return full.parent.parent / RUNS / full.name


def _do_run(arguments: Namespace, work: Work) -> str:
    """Do the run, or only what is missing of it."""
    wanted = replace(work.outputs, turntable=None, film=None) if arguments.only else work.outputs
    done = arguments.overwrite or judge_run(work.job, work.run) is not RunState.WHOLE
    if done:
        done = _write_run(arguments, work, wanted)
    done |= work.make_films(wanted)
    return f"written to {work.run}" if done else f"was done already: {work.run}"


def _write_run(arguments: Namespace, work: Work, outputs: Outputs) -> bool:
    """Write the folder of the run; False when another process has just done so."""
    folder, out = work.job, work.run
    scene = load(folder / SCENE)
    check_outputs(scene, outputs)
    timing: Record = {"start_up": time.time() - arguments.since if arguments.since else None}
    # What a series keeps there is its own; a folder elsewhere may be the user's.
    overwrite = arguments.overwrite or out.resolve() == _find_place(folder)
    patience = GRACE if arguments.follow else 0.0
    with claim_folder(out, overwrite=overwrite, patience=patience) as claim:
        state = judge_run(folder, out)
        if state is RunState.WHOLE and not arguments.overwrite:
            return False
        if state in (RunState.CHANGED, RunState.INCOMPLETE):
            say(arguments, f"The run in {out} is {state.value}: it is repeated.")
        with claim.write() as staged:
            work.make_outputs(scene, outputs, staged, timing)
            # As they were given: by them a batch recognizes what this is the run of.
            for file in (SCENE, JOB, *([CODE] if (folder / CODE).is_file() else [])):
                shutil.copyfile(folder / file, staged / file)
            timing[FILES] = {path.name: path.stat().st_size for path in sorted(staged.iterdir())}
            write_whole(staged / TIMING, format_json(timing))
    return True


PAGE_EXAMPLES = """\
examples:
  digiclay batch first --submit openjd      files for a render farm; its last task is this command
  digiclay page first                       write first/index.html from the runs that are done

It needs neither the JOBS file nor Blender. Exit code 0 also while jobs are missing.
"""


@command(
    "write the page of a job series from the runs that are done",
    PAGE_EXAMPLES,
    {"series DIR": (Path, "the folder of the series"), "--quiet": "print errors only"},
    listed=False,
)
def write_page(arguments: Namespace) -> int:
    """Write the page."""
    series = read_batch(arguments.series)
    say(arguments, f"{series.write_page()}; written to {arguments.series / 'index.html'}")
    return 0
