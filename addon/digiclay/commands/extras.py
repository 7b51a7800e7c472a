"""Simulation of a command, its run folder, and files in it; names of those that an interruption prevents."""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .. import __version__
from ..core.base.errors import DigiclayError, ParameterError, SceneError
from ..core.files.run_folder import Claim
from ..core.scene.schema import Scene
from ..core.session.run_scene import History, Result, run, save
from ..plugins.method_loader import describe_origin, write_code
from .arguments import say
from .export import exported, file_names
from .progress import Bar
from .render import PICTURE, PLOTS, STILL, draw_still, plotted
from .stop import STOPPED, Stop

#: Sections whose parameters can make a session too large.
SIZES = ("layout", "recorder", "simulation", "trajectory", "delay")


@dataclass(frozen=True)
class Extra:
    """Files made of a session."""

    #: Seen from the run's folder.
    files: Sequence[str]
    #: Makes them in a folder.
    make: Callable[[Path], object]
    #: Returns the arguments of the command that makes them in the finished run's folder.
    later: Callable[[Path], list[str]]


def plan_meshes(
    scene: Scene, history: History, kinds: Sequence[str], row: int = -1, within: str = ""
) -> Extra:
    """Return the surface of one row as mesh files, in the run's folder or in one within it."""

    def make(folder: Path) -> None:
        (folder / within).mkdir(exist_ok=True)
        exported(scene, history, row, kinds, folder / within)

    def later(run: Path) -> list[str]:
        instant = [] if row == -1 else ["--time", repr(float(history["time"][row]))]
        place = ["--out", str(run / within)] if within else []
        return ["export", str(run), "--format", ",".join(kinds), *instant, *place]

    return Extra([f"{within}/{name}" if within else name for name in file_names(kinds)], make, later)


def plan_plots(scene: Scene, history: History) -> Extra:
    """Return the plots of a session."""
    return Extra(PLOTS, lambda folder: plotted(scene, history, folder), lambda run: ["plot", str(run)])


def plan_picture(scene: Scene, history: History) -> Extra:
    """Return the picture of the last touch."""
    return Extra(
        [PICTURE],
        lambda folder: draw_still(scene, history, STILL, folder / PICTURE),
        lambda run: ["render", str(run)],
    )


def simulate(arguments: argparse.Namespace, scene: Scene, path: Path, stop: Stop) -> Result:
    """Run the session of a scene under a progress bar; `path`: of its file."""
    versions = {"digiclay": __version__, **describe_origin(scene)}
    try:
        with Bar(sys.stderr, scene.name, scene.simulation.control_period, quiet=arguments.quiet) as bar:
            return run(scene, progress=bar, stopped=stop, versions=versions)
    except ParameterError as error:
        changed = any(setting.key.split(".")[0] in SIZES for setting in arguments.settings)
        raise SceneError(f"{'--set' if changed else path.name}: {error}") from None


def write_run(
    arguments: argparse.Namespace, claim: Claim, result: Result, extras: Iterable[Extra], stop: Stop,
    *notes: str, unjudged: bool = False,
) -> int:  # fmt: skip
    """Write the folder of a run with its extras, print, and return the exit code.

    `notes`: lines before the summary; `unjudged`: whether a stop prevented the estimation of the errors.
    """
    skipped: list[Extra] = []
    wrong: list[DigiclayError] = []
    with claim.write() as folder:
        save(result, folder)
        write_code(result.scene, folder)
        for extra in extras:
            if stop():
                skipped.append(extra)
                continue
            try:
                extra.make(folder)
            except DigiclayError as error:  # the session itself is worth keeping
                wrong.append(error)
    out = claim.out
    say(arguments, *notes, result.summary(), f"written to {out}")
    if unjudged:
        tell_stopped_before("its errors were estimated", ["run", str(out), "--out", str(out), "--overwrite"])
    for extra in skipped:
        tell_stopped_before(", ".join(extra.files), extra.later(out))
    if wrong:
        raise wrong[0]
    return STOPPED if stop() else 0


def tell_stopped_before(what: str, later: Sequence[str]) -> None:
    """Print the output that a stop prevented, and the command that makes it."""
    print(f"Stopped before {what}; to have it: {format_command(later)}", file=sys.stderr)


def format_command(arguments: Sequence[str]) -> str:
    """Return a command of this program as it is typed into a terminal."""
    words = ["digiclay", *arguments]
    return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)
