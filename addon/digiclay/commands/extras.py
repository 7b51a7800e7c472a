"""Files of a command beside the run folder; names of those that an interruption prevents."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..core.base.errors import DigiclayError
from ..core.scene.schema import Scene
from ..core.session.run_scene import History
from .export import exported, file_names
from .render import PICTURE, PLOTS, STILL, draw_still, plotted


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


def make_extras(
    extras: Iterable[Extra], folder: Path, stopped: Callable[[], bool]
) -> tuple[list[Extra], list[DigiclayError]]:
    """Make one after the other; return those prevented by a stop, and the errors."""
    left_out: list[Extra] = []
    wrong: list[DigiclayError] = []
    for extra in extras:
        if stopped():
            left_out.append(extra)
            continue
        try:
            extra.make(folder)
        except DigiclayError as error:  # the session itself is worth keeping
            wrong.append(error)
    return left_out, wrong


def print_skipped(left_out: Iterable[Extra], run: Path) -> None:
    """Print the files that a stop prevented, and the command that makes them."""
    for extra in left_out:
        tell_stopped_before(", ".join(extra.files), extra.later(run))


def tell_stopped_before(what: str, later: Sequence[str]) -> None:
    """Print the output that a stop prevented, and the command that makes it."""
    print(f"Stopped before {what}; to have it: {format_command(later)}", file=sys.stderr)


def format_command(arguments: Sequence[str]) -> str:
    """Return a command of this program as it is typed into a terminal."""
    words = ["digiclay", *arguments]
    return subprocess.list2cmdline(words) if os.name == "nt" else shlex.join(words)
