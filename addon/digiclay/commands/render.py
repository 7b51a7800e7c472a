"""``digiclay render``: picture, turntable or film of a run, drawn by Blender."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from ..core.base.errors import DigiclayError
from ..core.files.run_folder import claim_files
from ..core.metrics.summary import compute_metrics
from ..core.scene.schema import Scene
from ..core.session.finished_run import find_last_touch, find_row, read_run
from ..core.session.render_settings import COLORS, ENGINES, Film, Still, Turntable
from .arguments import add_run, seconds, size, told_as_options
from .progress import Counted
from .stop import STOPPED, Stop, refuse_file, refuse_without_blender

if TYPE_CHECKING:
    from ..pictures.film import Shots

EXAMPLES = """\
examples:
  digiclay render ridge_mound_valley
  digiclay render ridge_mound_valley --time 10 --size 800x500 --out ridge.png
  digiclay render ridge_mound_valley --film --speed 2 --color force
  digiclay render ridge_mound_valley --turntable --frames 48 --engine cycles
"""
#: What a picture is called unless told otherwise.
PICTURE = "pins.png"
#: What drawing needs of a history.
ARRAYS = ("height", "force", "mode", "fingertip", "position", "total_force")
#: Options of one kind of picture only.
OF_FILMS = ("rate", "speed", "start", "stop", "strip")
OF_TURNTABLES = ("rate", "frames")


def add(commands: Any) -> None:
    """Add the command."""
    said = "draw an instant of a run as a PNG, or a film of it; needs Blender's module, bpy"
    parser = add_run(commands, "render", said, EXAMPLES)
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--film", action="store_true", help="session as film.mp4, with a plot of the force")
    kind.add_argument("--turntable", action="store_true", help="one rotation at an instant, as turntable.mp4")
    parser.add_argument(
        "--time", metavar="T", type=seconds,
        help="instant, s; default: the last touch, or the end for a turntable",
    )  # fmt: skip
    parser.add_argument("--out", metavar="FILE", type=Path, help="output file; default: in the run folder")
    parser.add_argument("--size", metavar="WxH", type=size, help="default 1600x1000; 960x600 for films")
    parser.add_argument("--engine", choices=ENGINES, help="default cycles; workbench for films")
    parser.add_argument(
        "--color", choices=COLORS, help="quantity shown by the colors of the pins; default: mode"
    )
    # Scripts written for older versions have it so.
    parser.add_argument("--colour", dest="color", choices=COLORS, help=argparse.SUPPRESS)
    parser.add_argument(
        "--arrows", action=argparse.BooleanOptionalAction, help="forces as arrows; default: in films only"
    )
    parser.add_argument("--rate", metavar="N", type=int, help="frames a second of film; default 25")
    parser.add_argument("--frames", metavar="N", type=int, help="frames of a rotation; default: 75")
    parser.add_argument(
        "--speed", metavar="X", type=float, help="simulated seconds a second of film; default 1"
    )
    parser.add_argument("--start", metavar="T", type=seconds, help="first instant of the film, s")
    parser.add_argument("--stop", metavar="T", type=seconds, help="last instant of the film, s")
    parser.add_argument(
        "--strip",
        action=argparse.BooleanOptionalAction,
        help="plot of the total force over time; default: in films",
    )
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Render."""
    with told_as_options("Still", "Film", "Turntable", width="size", height="size"):
        looks = _looks(arguments)
        return _drawn(arguments, looks)


def _drawn(arguments: argparse.Namespace, looks: Still | Turntable | Film) -> int:
    """Draw, and print the path."""
    name, ending = ("film" if isinstance(looks, Film) else "turntable"), ".mp4"
    if isinstance(looks, Still):
        name, ending = Path(PICTURE).stem, ".png"
    out: Path = arguments.out or arguments.run / f"{name}{ending}"
    refuse_file(out, ending)
    refuse_without_blender()
    run = read_run(arguments.run, *ARRAYS)
    row = None if arguments.time is None else find_row(run.history, arguments.time, "--time")
    path: Path | None
    with claim_files([out]), Stop() as stop, Counted(sys.stderr, name, "frames") as bar:
        told = None if arguments.quiet else bar
        if isinstance(looks, Film):
            path = draw_film(run.scene, run.history, looks, out, told, stop)
        elif isinstance(looks, Turntable):
            path = draw_turntable(run.scene, run.history, looks, out, told, stop, row)
        else:  # Blender does not stop within a picture
            path = draw_still(run.scene, run.history, looks, out, row)
    if path is None:
        print("Stopped; nothing was written.", file=sys.stderr)
        return STOPPED
    if not arguments.quiet:
        print(path)
    return STOPPED if stop() else 0


def _looks(arguments: argparse.Namespace) -> Still | Turntable | Film:
    """Return what the picture is to look like; refuse options that mean nothing for it."""
    kind: type[Still | Turntable | Film] = Still
    own: tuple[str, ...] = ()
    if arguments.film:
        kind, own = Film, OF_FILMS
    elif arguments.turntable:
        kind, own = Turntable, OF_TURNTABLES
    for name in {*OF_FILMS, *OF_TURNTABLES} - {*own}:
        if getattr(arguments, name) is not None:
            wanted = "--film" if name in OF_FILMS else "--turntable"
            raise DigiclayError(f"--{name} must be given with {wanted} only.")
    if arguments.film and arguments.time is not None:
        raise DigiclayError("--time must not be given with --film: give --start and --stop.")
    names = ("engine", "color", "arrows", *own)
    given = {name: getattr(arguments, name) for name in names if getattr(arguments, name) is not None}
    if kind is Still:
        given = {"engine": "cycles", "width": 1600, "height": 1000, **given}
    if arguments.size is not None:
        given["width"], given["height"] = arguments.size
    return kind(**given)


def sizes(scene: Scene) -> dict[str, Any]:
    """Return the sizes of the device for drawing."""
    from ..device.instant import find_ellipsoid

    return {"pitch": scene.layout.pitch, "actuator": scene.actuator, "finger": find_ellipsoid(scene)}


def picture(
    scene: Scene,
    history: Mapping[str, NDArray[Any]],
    row: int,
    out: Path,
    *,
    width: int = 1600,
    height: int = 1000,
    engine: str = "cycles",
) -> Path:
    """Draw one row of a history. `row`: of the history; `width`, `height`: pixels."""
    return draw_still(scene, history, Still(width=width, height=height, engine=engine), out, row)


def draw_still(
    scene: Scene, history: Mapping[str, NDArray[Any]], looks: Still, out: Path, row: int | None = None
) -> Path:
    """Draw an instant, or one row of a history; Blender is imported only now.

    `row`: of the history; by default the instant of `looks`.
    """
    from ..device.instant import Instant
    from ..pictures.still import render_still

    instant = Instant.of(history, _row(history, looks.when, row), **sizes(scene))
    names = ("width", "height", "engine", "samples", "color", "arrows")
    return render_still(instant, out, **{name: getattr(looks, name) for name in names})


def draw_turntable(
    scene: Scene,
    history: Mapping[str, NDArray[Any]],
    looks: Turntable,
    out: Path,
    progress: Callable[[int, int], None] | None = None,
    stopped: Callable[[], bool] | None = None,
    row: int | None = None,
) -> Path | None:
    """Draw an instant, or one row of a history, turning once; None when it was stopped.

    `progress`: told of frames done, and of all; `stopped`: whether to stop; asked before each frame; `row`:
    of the history; by default the instant of `looks`.
    """
    from ..device.instant import Instant
    from ..pictures.film import render_turntable

    instant = Instant.of(history, _row(history, looks.when, row), **sizes(scene))
    return render_turntable(instant, out, looks, progress=progress, stopped=stopped)


def draw_film(
    scene: Scene,
    history: Mapping[str, NDArray[Any]],
    looks: Film,
    out: Path,
    progress: Callable[[int, int], None] | None = None,
    stopped: Callable[[], bool] | None = None,
) -> Path | None:
    """Draw a session; None when it was stopped.

    `progress`: told of frames done, and of all; `stopped`: whether to stop; asked before each frame.
    """
    from ..pictures.film import render_film

    return render_film(
        history, out, looks, progress=progress, stopped=stopped, **_describe_session(scene, history)
    )


def stage_moving(
    scene: Scene, history: Mapping[str, NDArray[Any]], looks: Film | Turntable
) -> AbstractContextManager[Shots]:
    """Set the stage for single frames of the film `draw_film` or `draw_turntable` would draw."""
    from ..device.instant import Instant
    from ..pictures.film import stage_film, stage_turntable

    if isinstance(looks, Film):
        return stage_film(history, looks, **_describe_session(scene, history))
    return stage_turntable(Instant.of(history, _row(history, looks.when, None), **sizes(scene)), looks)


def _describe_session(scene: Scene, history: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return what a film shows besides the rows of the history."""
    return {"set_point": compute_metrics(history, scene.set_point)["set_point"], **sizes(scene)}


def _row(history: Mapping[str, NDArray[Any]], when: str, row: int | None) -> int:
    """Return the row asked for, or that of an instant by its name."""
    if row is not None:
        return row
    return find_last_touch(history) if when == "last touch" else len(history["time"]) - 1
