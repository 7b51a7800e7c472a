"""``digiclay sweep``: a scene at many points of its parameters, on all cores of this machine."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, TextIO

from .. import __version__
from ..core.errors import DigiclayError, OutputError, ParameterError
from ..core.scene import Scene
from ..core.scene_file import Setting, find
from ..core.sweep import ERRORS, Point, Record, figure, finish, points
from ..core.sweep_axis import Axis, axis
from ..core.sweep_bundles import Bundles, bundles, evaluate_all, fallen_apart
from ..core.sweep_folder import Folder, columns, grid, opened, table
from ..core.whole_files import write_whole
from .arguments import add_scene, settings_of
from .exit_codes import STOPPED
from .progress import PAUSE, WIDTH
from .stop import Stop

__all__ = ["add", "local", "workers"]

Task = Callable[..., list[Record | None]]

EXAMPLES = """\
examples:
  digiclay sweep slow_press --vary control.force_gain=1:10:10 --metric rfd,lag --out gains
  digiclay sweep slow_press --vary control.force_gain=0.5:8:5:log --vary control.dead_band=1e-5,5e-5 --out two
  digiclay sweep my.toml --vary valve.stroke="20 um:40 um:5" --set layout.rows=15 --out strokes

The folder holds points/, a small file for each finished point; sweep.csv; and for one or two
axes a picture of each metric. Stopped by Ctrl-C, it goes on when the same command is given again;
a point that failed is done again if its file is removed. Points of one bed, parts and steps run
together in stacks, which takes a fraction of the time; it is said which cannot. For the metrics
height_error, force_error and total_force_error every point is integrated once more.
"""


def add(commands: Any) -> None:
    """Add the command."""
    said = "Run a scene at many points of its parameters."
    parser = commands.add_parser(
        "sweep", help="run a scene at many points of its parameters", description=said, epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False,
    )  # fmt: skip
    add_scene(parser)
    parser.add_argument(
        "--vary", metavar="KEY=VALUES", action="append", required=True,
        help="START:STOP:COUNT, START:STOP:COUNT:log or A,B,C; may be repeated",
    )  # fmt: skip
    parser.add_argument(
        "--metric", metavar="M,...", default="rfd,lag", help="what to tabulate and plot; default rfd,lag"
    )
    parser.add_argument("--out", metavar="DIR", type=Path, required=True, help="the folder")
    parser.add_argument("--workers", metavar="N", type=workers, help="processes; default one a core")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors, and no progress")
    parser.set_defaults(carry_out=carry_out)


def workers(text: str) -> int:
    """Read a number of processes."""
    if not text.isdecimal() or not 1 <= int(text) <= 61:  # Windows can wait for no more
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 to 61 (got {text!r})")
    return int(text)


def carry_out(arguments: argparse.Namespace) -> int:
    """Run what is not done yet, and write the table and the pictures."""
    names = list(dict.fromkeys(figure(word.strip()) for word in arguments.metric.split(",")))
    axes = [axis(said) for said in arguments.vary]
    every = points(find(arguments.scene), _settings(arguments, axes), axes)
    if not any(point.scene and point.scene.recorder for point in every):
        raise OutputError("A sweep needs a recorder, and the scene has recorder = 'absent'.")
    errors = any(name in ERRORS for name in names)
    parts = bundles(every, errors=errors)
    with opened(arguments.out, every, axes, __version__) as folder:
        with Stop() as stop:
            done = _finished(arguments, folder, parts, axes, stop, errors=errors)
            if stop() and len(done) < len(every):
                if not arguments.quiet:
                    said = f"Stopped: {len(done)} of {len(every)} points are done and kept in {folder.path}."
                    print(f"{said} The same command goes on from there.")
                return STOPPED
        return _told(arguments, every, parts, axes, names, done)


def _told(
    arguments: argparse.Namespace,
    every: Sequence[Point],
    parts: Bundles,
    axes: Sequence[Axis],
    names: Sequence[str],
    done: dict[int, Record],
) -> int:
    """Write the table and the pictures, and tell what came of the sweep; return the exit code."""
    write_whole(arguments.out / "sweep.csv", table(every, columns(every, axes), done, names).encode("utf-8"))
    notes = _pictures(arguments.out, every, axes, done, names)
    failed = [record["error"] for _, record in sorted(done.items()) if "error" in record]
    if len(failed) == len(every):
        raise DigiclayError(f"Every point failed; the first one: {failed[0]}")
    if not arguments.quiet:
        tail = f", {len(failed)} of them failed: see the column error" if failed else ""
        told = [*parts.told(), *fallen_apart(done), *notes, f"written to {arguments.out}"]
        print(f"{len(every)} points{tail}", *told, sep="\n")
    return 0


def _settings(arguments: argparse.Namespace, axes: Sequence[Axis]) -> list[Setting]:
    """Return what the options change of the scene; what varies is given by --vary alone."""
    settings = settings_of(arguments)
    varied = [one.key for one in axes]
    for key, _, option in settings[len(arguments.settings) :]:
        if key in varied:
            raise ParameterError(f"--vary {key}", "", f"must not be given to {option} as well", key)
    return settings


def _finished(
    arguments: argparse.Namespace,
    folder: Folder,
    parts: Bundles,
    axes: Sequence[Axis],
    stop: Stop,
    *,
    errors: bool,
) -> dict[int, Record]:
    """Run the points that are not in the folder yet; return all that are done.

    Where errors are asked for, a point without them is not done.
    """
    done = {
        index: record
        for index, record in folder.done().items()
        if not errors or "error" in record or record["figures"].keys() >= ERRORS.keys()
    }
    every = (*parts.stacks, *parts.alone)
    # A stack of which a point is missing is run as a whole, or its results would be others in the last bit.
    todo = [bundle for bundle in every if any(point.index not in done for point in bundle)]
    bar = Points(sys.stderr, len(done), sum(len(bundle) for bundle in every), shown=not arguments.quiet)

    def keep(point: Point, record: Record) -> None:
        if point.index not in done:
            folder.keep(point, axes, record)
            done[point.index] = record
            bar.draw(len(done))

    if todo:
        count = min(arguments.workers or _cores(), len(todo))
        with local(count) as (executor, task, halt), bar:

            def stopped() -> bool:
                if stop():
                    halt()
                bar.draw(len(done))
                return stop()

            finish(executor, partial(task, errors=errors), todo, keep, stopped=stopped)
    return done


def _pictures(
    out: Path, every: Sequence[Point], axes: Sequence[Axis], done: dict[int, Record], names: Sequence[str]
) -> list[str]:
    """Draw the figures over one or two axes; return what there is to be said of it."""
    if len(axes) > 2:
        return [f"{len(axes)} axes: a table only, no pictures"]
    from ..plots.sweep import picture

    known = columns(every, axes)
    try:
        for name in names:
            picture(known, name, grid(done, axes, name), out / f"{name}.png")
    except OutputError as error:  # the table is there, and pictures can be had later
        return [str(error)]
    return []


def _cores() -> int:
    """Return how many cores this process may use; one where it cannot start others like itself."""
    if __name__.partition(".")[0] != "digiclay":  # an extension inside Blender
        return 1
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), 61)
    return min(os.cpu_count() or 1, 61)


@contextmanager
def local(count: int) -> Iterator[tuple[Executor, Task, Callable[[], None]]]:
    """Give an executor on this machine, what it is to run, and what stops the sessions that run.

    One worker is a thread of this process; more are processes, started afresh.
    """
    if count == 1:
        ended = threading.Event()
        with ThreadPoolExecutor(1) as one:
            try:
                yield one, partial(evaluate_all, stopped=ended.is_set), ended.set
            finally:
                ended.set()
                one.shutdown(cancel_futures=True)
        return
    import multiprocessing

    fresh = multiprocessing.get_context("spawn")
    halted = fresh.Event()
    with _Processes(count, fresh, _begin, (halted,)) as pool:
        try:
            yield pool, _run, halted.set
        finally:
            halted.set()
            pool.shutdown(cancel_futures=True)


class _Processes(ProcessPoolExecutor):
    """Workers that Ctrl-C on a terminal does not reach, from their first moment on."""

    def submit(self, task: Callable[..., Any], /, *arguments: Any, **known: Any) -> Future[Any]:
        """Submit a task; the worker that is started for it takes over that Ctrl-C is held back."""
        with _held():
            return super().submit(task, *arguments, **known)


@contextmanager
def _held() -> Iterator[None]:
    """Let Ctrl-C wait for the end of the block. Windows cannot: there it is ignored from `_begin` on."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    former = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)


def _begin(halted: Any) -> None:
    """Set up a worker: Ctrl-C is for the process that started it, and it ends with that one."""
    import multiprocessing

    global _halted
    _halted = halted.is_set
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent:
            parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


_halted: Callable[[], bool] | None = None


def _run(scenes: list[Scene], *, errors: bool) -> list[Record | None]:
    """Run a bundle in a worker."""
    return evaluate_all(scenes, _halted, errors=errors)


class Points:
    """Shows on a terminal how many points are done, and how long the others will take."""

    def __init__(self, stream: TextIO, before: int, total: int, *, shown: bool) -> None:
        self._stream, self._before, self._total = stream, before, total
        self._shown = shown and stream.isatty()
        self._started, self._drawn = time.monotonic(), 0.0

    def __enter__(self) -> Points:
        return self

    def draw(self, done: int) -> None:
        """Draw the bar, if it is time to."""
        now = time.monotonic()
        if not self._shown or now - self._drawn < PAUSE:
            return
        filled, here = WIDTH * done // self._total, done - self._before
        left = f", {(now - self._started) * (self._total - done) / here:.0f} s left" if here else ""
        bar = "#" * filled + "." * (WIDTH - filled)
        self._stream.write(f"\rsweep [{bar}] {done} of {self._total} points{left}\033[K")
        self._stream.flush()
        self._drawn = now

    def __exit__(self, *raised: object) -> None:
        if self._shown:
            self._stream.write("\r\033[K")
            self._stream.flush()
