"""``digiclay job``: one job of a series, from its two files alone."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.base.errors import DigiclayError, OutputError, one_line
from ..core.base.run_folder import write_folder
from ..core.base.whole_files import format_json, write_whole
from ..core.scene.scene_source import load
from ..core.scene.schema import Scene
from ..core.session.accuracy import estimate_errors, has_every_command
from ..core.session.run_scene import run, save
from ..core.studies.job_outputs import Outputs
from ..core.studies.job_table import JOB, SCENE, read_outputs
from .arguments import add_command
from .exit_codes import STOPPED, WRONG
from .export import exported, formats
from .progress import Counted
from .refusals import refuse_what_has_no_surface, refuse_without_blender
from .render import draw_film, draw_still, draw_turntable
from .stop import Stop
from .thumbnail import of_heights, of_picture

__all__ = ["ERROR", "FILES", "PROGRESS", "RUNS", "TIMING", "add", "check_outputs"]

EXAMPLES = """\
examples:
  digiclay batch first --prepare            write the files of the jobs, run none
  digiclay job first/jobs/tap-cell_states   run one of them, on any machine: into first/runs
  digiclay batch first                      collect finished jobs, run the rest, write first/index.html

A job is a folder with scene.toml (every parameter of its session) and job.toml (its outputs).
"""
#: Where a batch keeps its runs, beside its jobs; what each took; and in there, the size of each file.
RUNS, TIMING, FILES = "runs", "timing.json", "files"
#: What the lines begin with that are meant for the batch that has started the job.
PROGRESS, ERROR = "@ ", "! "
#: Seconds between two lines of progress, and those the process of a batch that was killed gets to end.
PAUSE, GRACE = 0.2, 20.0

#: Told of a step, and of how much of the whole job is done.
Tell = Callable[[str, float], None]


def add(commands: Any) -> None:
    """Add the command."""
    said = "run one job of a series from its files alone; for render farms"
    parser = add_command(commands, "job", said, EXAMPLES)
    parser.add_argument("job", metavar="JOB", type=Path, help="the folder of the job")
    parser.add_argument("--out", metavar="DIR", type=Path, help="default: ../../runs/JOB, as in a series")
    parser.add_argument("--overwrite", action="store_true", help="replace an older run at the end")
    parser.add_argument("--quiet", action="store_true", help="print errors only")
    # How a batch starts it: at what time, and that it is to stop when its standard input ends.
    parser.add_argument("--since", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--follow", action="store_true", help=argparse.SUPPRESS)
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Do the job."""
    if not arguments.follow:
        with Stop() as stop, Counted(sys.stderr, arguments.job.name, "%") as bar:
            out = _do_job(arguments, stop, lambda step, share: bar(100.0 * share, 100, f", {step}"))
        if not arguments.quiet:
            print(f"written to {out}")
        return 0
    ended = watch_input()
    try:
        _do_job(
            arguments, ended.is_set, lambda step, share: print(f"{PROGRESS}{step} {share:.4f}", flush=True)
        )
        return 0
    except KeyboardInterrupt:
        return STOPPED
    except DigiclayError as error:
        print(f"{ERROR}{one_line(error)}", flush=True)
        return WRONG
    except MemoryError:
        print(f"{ERROR}There is not enough memory: use fewer cells, or a higher recorder.every.", flush=True)
        return WRONG
    except Exception as error:  # the batch goes on, and has to tell what this was
        traceback.print_exc()
        print(f"{ERROR}{type(error).__name__}: {one_line(error)}", flush=True)
        return 1


def watch_input() -> threading.Event:
    """Return an event that is set when standard input ends."""
    ended = threading.Event()

    def watch() -> None:
        # Not sys.stdin: a thread that waits in it would keep Python from shutting down.
        while os.read(0, 1):
            pass
        ended.set()

    threading.Thread(target=watch, daemon=True).start()
    return ended


def check_outputs(scene: Scene, outputs: Outputs) -> None:
    """Refuse, before any work, what is bound to fail after it.

    Parameters
    ----------
    scene : Scene
    outputs : Outputs
    """
    if outputs.export:
        try:
            formats(",".join(outputs.export))
        except argparse.ArgumentTypeError as error:
            raise OutputError(f"export: {error}.") from None
        refuse_what_has_no_surface(scene, "export")
    if (outputs.needs_blender or outputs.export) and scene.recorder is None:
        raise OutputError("Pictures and exports need a recorder, and the scene has recorder = 'absent'.")
    if outputs.needs_blender:
        refuse_without_blender()


def _do_job(arguments: argparse.Namespace, stopped: Callable[[], bool], tell: Tell) -> Path:
    """Do the job, and return its folder; KeyboardInterrupt when it was stopped."""
    folder: Path = arguments.job
    if not os.path.isfile(folder / JOB):
        raise OutputError(f"{folder} is no job's folder: it has no {JOB}.")
    scene, outputs = load(folder / SCENE), read_outputs(folder / JOB)
    name = folder.resolve().name
    out: Path = arguments.out or folder.resolve().parent.parent / RUNS / name
    check_outputs(scene, outputs)
    started = time.time()
    timing: dict[str, Any] = {"start_up": started - arguments.since if arguments.since else None}
    patience = GRACE if arguments.follow else 0.0
    with write_folder(out, overwrite=arguments.overwrite, patience=patience) as staged:
        _make_outputs(scene, outputs, staged, timing, stopped, tell)
        for file in (SCENE, JOB):  # as they were given: by them a batch knows what this is the run of
            shutil.copyfile(folder / file, staged / file)
        timing[FILES] = {path.name: path.stat().st_size for path in sorted(staged.iterdir())}
        write_whole(staged / TIMING, format_json(timing))
    return out


def _make_outputs(
    scene: Scene,
    outputs: Outputs,
    out: Path,
    timing: dict[str, Any],
    stopped: Callable[[], bool],
    tell: Tell,
) -> None:
    """Run the session, and make all that belongs to it; KeyboardInterrupt when it was stopped."""
    names = ["run", *(n for n in ("errors", "export", "still", "turntable", "film") if getattr(outputs, n))]
    told = 0.0

    @contextmanager
    def step(name: str) -> Iterator[Callable[[int, int], None]]:
        """Time a step; give what is to be called with how much of it is done."""

        def progress(done: int, total: int) -> None:
            nonlocal told
            if time.monotonic() - told >= PAUSE:
                told = time.monotonic()
                tell(name, (names.index(name) + done / total) / len(names))

        if stopped():
            raise KeyboardInterrupt
        began = time.perf_counter()
        yield progress
        timing[name] = time.perf_counter() - began

    with step("run") as progress:
        result = run(scene, progress=progress, stopped=stopped, versions={"digiclay": __version__})
        if result.incomplete:
            raise KeyboardInterrupt
    if outputs.errors:
        with step("errors") as progress:
            if has_every_command(scene):
                errors = estimate_errors(scene, result.history, progress=progress, stopped=stopped)
                if errors is None:
                    raise KeyboardInterrupt
                result = result.with_errors(errors)
    with step("save"):
        save(result, out)
    history = result.history
    if not history:
        return
    if outputs.export:
        with step("export"):
            exported(scene, history, -1, outputs.export, out, outputs.mesh)
    if outputs.still:
        with step("still"):
            draw_still(scene, history, outputs.still, out / "still.png")
    if outputs.turntable:
        with step("turntable") as progress:
            path = out / "turntable.mp4"
            if not draw_turntable(scene, history, outputs.turntable, path, progress, stopped):
                raise KeyboardInterrupt
    if outputs.film:
        with step("film") as progress:
            if not draw_film(scene, history, outputs.film, out / "film.mp4", progress, stopped):
                raise KeyboardInterrupt
    with step("thumbnail"):
        if outputs.still:
            of_picture(out / "still.png", out)
        else:
            of_heights(history["height"][-1], scene.layout.rows, scene.layout.columns, out)
