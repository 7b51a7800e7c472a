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
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.base.errors import DigiclayError, OutputError, one_line
from ..core.base.run_folder import write_folder
from ..core.base.whole_files import as_json, write_whole
from ..core.scene.scene_source import load
from ..core.scene.schema import Scene
from ..core.session.accuracy import estimate_errors, has_every_command
from ..core.session.run_scene import Result, run, save
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
            out = _done(arguments, stop, lambda step, share: bar(100.0 * share, 100, f", {step}"))
        if not arguments.quiet:
            print(f"written to {out}")
        return 0
    ended = watch_input()
    try:
        _done(arguments, ended.is_set, lambda step, share: print(f"{PROGRESS}{step} {share:.4f}", flush=True))
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
    if (outputs.drawn or outputs.export) and scene.recorder is None:
        raise OutputError("Pictures and exports need a recorder, and the scene has recorder = 'absent'.")
    if outputs.drawn:
        refuse_without_blender()


def _done(arguments: argparse.Namespace, stopped: Callable[[], bool], tell: Tell) -> Path:
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
        for step, work in _steps(scene, outputs, staged, stopped, tell):
            began = time.perf_counter()
            if stopped() or not work():
                raise KeyboardInterrupt
            timing[step] = time.perf_counter() - began
        for file in (SCENE, JOB):  # as they were given: by them a batch knows what this is the run of
            shutil.copyfile(folder / file, staged / file)
        timing[FILES] = {path.name: path.stat().st_size for path in sorted(staged.iterdir())}
        write_whole(staged / TIMING, as_json(timing))
    return out


def _steps(
    scene: Scene, outputs: Outputs, out: Path, stopped: Callable[[], bool], tell: Tell
) -> Iterator[tuple[str, Callable[[], bool]]]:
    """Give each step by its name; a step returns False when it was stopped."""
    results: list[Result] = []
    names = ["run", *(n for n in ("errors", "export", "still", "turntable", "film") if getattr(outputs, n))]
    said = [0.0]

    def telling(step: str) -> Callable[[int, int], None]:
        before = names.index(step)

        def told(done: int, total: int) -> None:
            now = time.monotonic()
            if now - said[0] >= PAUSE:
                said[0] = now
                tell(step, (before + done / total) / len(names))

        return told

    def simulate() -> bool:
        versions = {"digiclay": __version__}
        results.append(run(scene, progress=telling("run"), stopped=stopped, versions=versions))
        return not results[-1].incomplete

    def judge() -> bool:
        result = results[-1]
        if has_every_command(scene):
            errors = estimate_errors(scene, result.history, progress=telling("errors"), stopped=stopped)
            if errors is None:
                return False
            results.append(result.with_errors(errors))
        return True

    def keep() -> bool:
        save(results[-1], out)
        return True

    yield "run", simulate
    if outputs.errors:
        yield "errors", judge
    yield "save", keep
    history = results[-1].history
    if not history:
        return
    if outputs.export:
        yield "export", lambda: bool(exported(scene, history, -1, outputs.export, out, outputs.mesh))
    still, turning, film = outputs.still, outputs.turntable, outputs.film
    if still:
        yield "still", lambda: bool(draw_still(scene, history, still, out / "still.png"))
    if turning:
        path, turns = out / "turntable.mp4", telling("turntable")
        yield "turntable", lambda: bool(draw_turntable(scene, history, turning, path, turns, stopped))
    if film:
        whole, plays = out / "film.mp4", telling("film")
        yield "film", lambda: bool(draw_film(scene, history, film, whole, plays, stopped))
    if still:
        yield "thumbnail", lambda: bool(of_picture(out / "still.png", out))
    else:
        yield (
            "thumbnail",
            lambda: bool(of_heights(history["height"][-1], scene.layout.rows, scene.layout.columns, out)),
        )
