"""``digiclay run``: simulate a scene and write its folder."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.accuracy import can_be_estimated, estimated
from ..core.errors import DigiclayError, OutputError, ParameterError, SceneError
from ..core.finished import last_touch
from ..core.run_folder import may_be_written, written
from ..core.scene import Scene
from ..core.session import Result, run, save
from .arguments import add_command, add_scene, length, scene_of
from .budget import noted, within
from .exit_codes import STOPPED
from .export import exported, formats
from .progress import Bar
from .refusals import refuse_what_has_no_surface, refuse_without, refuse_without_blender
from .render import picture
from .stop import Stop

__all__ = ["add"]

EXAMPLES = """\
examples:
  digiclay run ridge_mound_valley
  digiclay run my.toml --out first --overwrite --export stl,obj --plots --render
  digiclay run ridge_mound_valley --budget 20um
  digiclay run tap --set layout.rows=9 --set control.force_setpoint="300 mN" --set conduit=absent

The folder holds scene.toml (every parameter), history.npz, metrics.json, and what the options
add. Ctrl-C keeps what was computed, marked as incomplete.
"""


def add(commands: Any) -> None:
    """Add the command."""
    said = "Simulate a scene and write its folder."
    parser = add_command(commands, "run", "simulate a scene", EXAMPLES, said)
    add_scene(parser)
    parser.add_argument("--out", metavar="DIR", type=Path, help="the folder; default the scene's name, here")
    parser.add_argument("--overwrite", action="store_true", help="replace an older run when all is done")
    parser.add_argument(
        "--export", metavar="F,...", type=formats, default=[], help="also meshes: stl,obj,ply,glb,3mf"
    )
    parser.add_argument(
        "--budget",
        metavar="E",
        type=length,
        help="leave out of the model what changes no height by more than this, such as 20um, and say what",
    )
    parser.add_argument("--plots", action="store_true", help="also plots, session.png and surface.png")
    parser.add_argument("--render", action="store_true", help="also a picture, pins.png (needs bpy)")
    parser.add_argument(
        "--no-errors",
        action="store_true",
        help="do not estimate the errors, which takes some one and a half times the run's time",
    )
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors, and no progress")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Run, write, and tell in a line what came of it."""
    scene, path = scene_of(arguments)
    out: Path = arguments.out or Path(path.parent.name if path.name == "scene.toml" else path.stem)
    may_be_written(out, overwrite=arguments.overwrite)
    _refuse_early(arguments, scene)
    found = within(scene, arguments.budget, quiet=arguments.quiet) if arguments.budget is not None else None
    scene = found.scene if found else scene
    with Stop() as stop:
        result = _simulated(scene, _blamed(arguments, path), stop, quiet=arguments.quiet)
        if not arguments.no_errors:
            result = _judged(result, stop, quiet=arguments.quiet)
        if found:
            result = replace(result, metrics={**result.metrics, "budget": noted(found)})
        wrong: list[DigiclayError] = []
        with written(out, overwrite=arguments.overwrite) as folder:
            save(result, folder)
            for extra in _extras(arguments, result, folder):
                if stop():
                    break
                try:
                    extra()
                except DigiclayError as error:  # the session itself is worth keeping
                    wrong.append(error)
    if not arguments.quiet:
        print(result.summary())
        print(f"written to {out}")
    if wrong:
        raise wrong[0]
    return STOPPED if stop() else 0


def _refuse_early(arguments: argparse.Namespace, scene: Scene) -> None:
    """Refuse before the session what is bound to fail after it."""
    extras = [name for name in ("export", "plots", "render") if getattr(arguments, name)]
    for name in extras:
        if scene.recorder is None:
            raise OutputError(f"--{name} needs a recorder, and the scene has recorder = 'absent'.")
    if arguments.export:
        refuse_what_has_no_surface(scene, "--export")
    if arguments.plots:
        refuse_what_has_no_surface(scene, "--plots")
        refuse_without("matplotlib", "--plots", "pip install digiclay[plots]")
    if arguments.render:
        refuse_without_blender()


def _blamed(arguments: argparse.Namespace, path: Path) -> str:
    """Return what to name when a session is too large: the options that can make it so, or the file."""
    sizes = ("layout", "recorder", "simulation", "trajectory", "delay")
    return "--set" if any(one.key.split(".")[0] in sizes for one in arguments.settings) else path.name


def _simulated(scene: Scene, origin: str, stop: Stop, *, quiet: bool) -> Result:
    """Run the session under a progress bar."""
    period = scene.simulation.control_period
    try:
        with Bar(sys.stderr, scene.name, period) as bar:
            return run(
                scene, progress=None if quiet else bar, stopped=stop, versions={"digiclay": __version__}
            )
    except ParameterError as error:
        raise SceneError(f"{origin}: {error}") from None


def _judged(result: Result, stop: Stop, *, quiet: bool) -> Result:
    """Return the result with its errors, where they can be estimated, under a progress bar."""
    if result.history is None or result.incomplete or not can_be_estimated(result.scene):
        return result
    with Bar(sys.stderr, "errors", result.scene.simulation.control_period) as bar:
        errors = estimated(result.scene, result.history, progress=None if quiet else bar, stopped=stop)
    return result.with_errors(errors) if errors else result


def _extras(arguments: argparse.Namespace, result: Result, folder: Path) -> Iterator[Callable[[], object]]:
    """Give what the options ask for besides the session."""
    scene, history = result.scene, result.history
    if history is None:
        return
    if arguments.export:
        yield lambda: exported(scene, history, -1, arguments.export, folder)
    if arguments.plots:
        from ..plots.run import session, surface

        yield lambda: session(history, folder / "session.png", scene.set_point)
        yield lambda: surface(history, folder / "surface.png")
    if arguments.render:
        yield lambda: picture(scene, history, last_touch(history), folder / "pins.png")
