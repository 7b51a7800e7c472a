"""``digiclay render`` and ``plot``: a run as picture, turntable or film by Blender, and as plots."""

from __future__ import annotations

import sys
from argparse import SUPPRESS, BooleanOptionalAction, Namespace
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..core.base.errors import DigiclayError
from ..core.files.run_folder import claim_files
from ..core.files.tables import Record
from ..core.metrics.summary import compute_metrics, find_worst_finger
from ..core.scene.schema import Scene
from ..core.session.finished_run import (
    HISTORY_ARRAYS,
    find_last_touch,
    find_row,
    read_run,
    require_surface,
)
from ..core.session.render_settings import COLORS, ENGINES, Film, Still, Turntable
from ..core.session.run_scene import History
from .arguments import RUN, Options, command, one_of, say, seconds, size, told_as_options
from .progress import Counted
from .refusals import refuse_file, refuse_unwritable, refuse_without, refuse_without_blender
from .stop import STOPPED, Stop

if TYPE_CHECKING:
    from ..device.instant import Instant
    from ..pictures.film import Shots

EXAMPLES = """\
examples:
  digiclay render ridge_mound_valley
  digiclay render ridge_mound_valley --time 10 --size 800x500 --out ridge.png
  digiclay render ridge_mound_valley --film --speed 2 --color force
  digiclay render ridge_mound_valley --turntable --frames 48 --engine cycles
"""
KINDS = {
    "--film": "session as film.mp4, with a plot of the force",
    "--turntable": "one rotation at an instant, as turntable.mp4",
}
OPTIONS: Options = {
    "--time T": (seconds, "instant, s; default: the last touch, or the end for a turntable"),
    "--out FILE": (Path, "output file; default: in the run folder"),
    "--size WxH": (size, "default 1600x1000; 960x600 for films"),
    "--engine": (ENGINES, "default cycles; workbench for films"),
    "--color": (COLORS, "quantity shown by the colors of the pins; default: neutral"),
    # Scripts written for older versions have it so.
    "--colour": {"dest": "color", "choices": COLORS, "help": SUPPRESS},
    "--arrows": {
        "action": BooleanOptionalAction,
        "help": "forces as arrows; default: in films only",
    },
    "--rate N": (int, "frames per second of film; default 25"),
    "--frames N": (int, "frames per rotation; default: 75"),
    "--speed X": (float, "simulated seconds per second of film; default 1"),
    "--start T": (seconds, "first instant of the film, s"),
    "--stop T": (seconds, "last instant of the film, s"),
    "--strip": {
        "action": BooleanOptionalAction,
        "help": "plot of the force over time, one line per fingertip; default: in films",
    },
}
#: What a picture is called by default.
PICTURE = "pins.png"
#: How a picture looks by default.
STILL = Still(width=1600, height=1000, engine="cycles")
#: What drawing needs of a history.
ARRAYS = (
    "height",
    "force",
    "mode",
    "fingertip",
    "position",
    "total_force",
    "finger_force",
    "body",
    "body_force",
    "waiting",
)
#: Options of one kind of picture only; --rate is of both.
OF_FILMS, OF_TURNTABLES = ("rate", "speed", "start", "stop", "strip"), ("rate", "frames")


@command(
    "draw an instant of a run as a PNG, or a film of it; needs Blender's module, bpy",
    EXAMPLES,
    RUN,
    one_of(KINDS),
    OPTIONS,
)
def carry_out(arguments: Namespace) -> int:
    """Render."""
    with told_as_options("Still", "Film", "Turntable", width="size", height="size"):
        return _draw(arguments, _looks(arguments))


def _draw(arguments: Namespace, looks: Still | Turntable | Film) -> int:
    """Draw, and print the path."""
    default = Path(PICTURE if isinstance(looks, Still) else f"{type(looks).__name__.lower()}.mp4")
    out = arguments.out or arguments.run / default
    refuse_file(out, default.suffix)
    refuse_without_blender()
    run = read_run(arguments.run, *ARRAYS)
    row = None if arguments.time is None else find_row(run.history, arguments.time, "--time")
    path: Path | None
    bar = Counted(sys.stderr, default.stem, "frames", quiet=arguments.quiet)
    with claim_files([out]), Stop() as stop, bar:
        if isinstance(looks, Still):  # Blender does not stop within a picture
            path = draw_still(run.scene, run.history, looks, out, row)
        else:
            path = draw_moving(run.scene, run.history, looks, out, bar, stop, row)
    if path is None:
        print("Stopped; nothing was written.", file=sys.stderr)
        return STOPPED
    say(arguments, path)
    return STOPPED if stop() else 0


def _looks(arguments: Namespace) -> Still | Turntable | Film:
    """Return what the picture is to look like; refuse options that mean nothing for it."""
    kind: type[Still | Turntable | Film] = Still
    options: tuple[str, ...] = ()
    if arguments.film:
        kind, options = Film, OF_FILMS
    elif arguments.turntable:
        kind, options = Turntable, OF_TURNTABLES
    for name in {*OF_FILMS, *OF_TURNTABLES} - {*options}:
        if getattr(arguments, name) is not None:
            wanted = "--film" if name in OF_FILMS else "--turntable"
            raise DigiclayError(f"--{name} must be given with {wanted} only.")
    if arguments.film and arguments.time is not None:
        raise DigiclayError("--time must not be given with --film: give --start and --stop.")
    names = ("engine", "color", "arrows", *options)
    given = {
        name: getattr(arguments, name) for name in names if getattr(arguments, name) is not None
    }
    if arguments.size is not None:
        given["width"], given["height"] = arguments.size
    return replace(STILL, **given) if kind is Still else kind(**given)


def sizes(scene: Scene) -> Record:
    """Return the sizes of the device for drawing."""
    from ..core.shapes.body import read_bodies
    from ..device.instant import find_ellipsoids

    absent = scene.bodies and not any(scene.list_parts("fingertip"))
    return {
        "pitch": scene.layout.pitch,
        "actuator": scene.actuator,
        "finger": () if absent else find_ellipsoids(scene),
        "bodies": read_bodies(each.body for each in scene.bodies),
    }


def draw_still(
    scene: Scene, history: History, looks: Still, out: Path, row: int | None = None
) -> Path:
    """Draw the instant of `looks`, or one row of a history; Blender is imported only now."""
    from ..pictures.still import render_still

    return render_still(_find_instant(scene, history, looks, row), out, looks)


def draw_moving(
    scene: Scene,
    history: History,
    looks: Film | Turntable,
    out: Path,
    progress: Callable[[int, int], None],
    stopped: Callable[[], bool],
    row: int | None = None,
) -> Path | None:
    """Draw a session, or one rotation at the instant of `looks` or at a row; None when it was stopped."""
    from ..pictures.film import render_film

    return render_film(stage_moving(scene, history, looks, row), out, looks, progress, stopped)


def stage_moving(
    scene: Scene, history: History, looks: Film | Turntable, row: int | None = None
) -> AbstractContextManager[Shots]:
    """Set the stage for the frames of the film that `draw_moving` draws."""
    from ..pictures.film import stage_film, stage_turntable

    if isinstance(looks, Film):
        worst = find_worst_finger(history, scene.set_point)
        force = "total force", worst["total_force"]
        if worst is not history:
            force = "forces of fingertips", history["finger_force"]
        set_point = compute_metrics(worst, scene.set_point)["set_point"]
        return stage_film(history, looks, force, set_point=set_point, **sizes(scene))
    return stage_turntable(_find_instant(scene, history, looks, row), looks)


def _find_instant(
    scene: Scene, history: History, looks: Still | Turntable, row: int | None
) -> Instant:
    """Return a row of a history for drawing, by default the instant of `looks`."""
    from ..device.instant import Instant

    if row is None:
        row = find_last_touch(history) if looks.when == "last touch" else len(history["time"]) - 1
    return Instant.of(history, row, **sizes(scene))


PLOT_EXAMPLES = """\
examples:
  digiclay plot ridge_mound_valley
  digiclay plot ridge_mound_valley --out pictures
"""
#: The files.
PLOTS = ("session.png", "surface.png")


def plotted(scene: Scene, history: History, folder: Path) -> list[Path]:
    """Draw a history into a folder; return the files."""
    from ..plots.figure import save
    from ..plots.run import session_figure, surface_figure

    figures = session_figure(history, scene.set_point), surface_figure(history)
    return [save(figure, folder / name) for figure, name in zip(figures, PLOTS, strict=True)]


@command(
    "draw heights and force of a run over time, and its final surface",
    PLOT_EXAMPLES,
    RUN,
    {"--out DIR": (Path, "output folder; default: the run folder")},
)
def plot(arguments: Namespace) -> int:
    """Plot."""
    folder = arguments.out or arguments.run
    refuse_without("digiclay plot", "plots", "matplotlib")
    run = read_run(arguments.run, *(name for name in HISTORY_ARRAYS if name != "time"))
    require_surface(run.scene, "plot")
    refuse_unwritable(folder)
    with claim_files([folder / name for name in PLOTS]):
        say(arguments, *plotted(run.scene, run.history, folder))
    return 0
