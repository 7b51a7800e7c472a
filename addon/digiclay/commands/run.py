"""``digiclay run``: simulate a scene, within a budget of error if one is given, and write its folder.

What a stop prevents of the files in the folder is printed, with the commands that make them.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..core.base.errors import OutputError, ParameterError, SceneError
from ..core.control.methods import list_added
from ..core.files.run_folder import Claim, claim_folder, find_name
from ..core.metrics.bands import MEMBERS
from ..core.scene.schema import Scene
from ..core.session.finished_run import require_surface
from ..core.session.plate import list_cautions
from ..core.session.run_scene import History, Result, run, save
from .arguments import (
    QUIET,
    add_scene,
    command,
    formats,
    length,
    say,
    scene_of,
    told_as_options,
)
from .progress import Bar, Line, table, tell_stopped_before
from .refusals import refuse_without, refuse_without_blender
from .series_options import UNCERTAIN, add_pool
from .stop import STOPPED, Stop

if TYPE_CHECKING:
    from ..core.studies.omissions import Fitted


def within(scene: Scene, budget: float, *, quiet: bool) -> Fitted:
    """Leave out of a scene what a budget of height error, m, allows; print what that is."""
    from ..core.studies.omissions import find_omissions

    with Line(sys.stderr, quiet=quiet) as line, told_as_options("run"):
        fit = find_omissions(scene, budget, show=lambda text: line.draw(f"trying: {text}"))
    if not quiet:
        print("\n".join(report(fit)))
    return fit


def noted(fit: Fitted) -> dict[str, Any]:
    """Return what ``metrics.json`` holds of it."""
    lengths = {
        "allowed": fit.budget,
        "measured": fit.error,
        "departure": fit.departure,
        "own_error": fit.own_error,
    }
    units = {**dict.fromkeys(lengths, "m"), "work": "1", "time": "1"}
    return {**lengths, "work": fit.work, "time": fit.time, "left_out": fit.left_out, "units": units}


def report(fit: Fitted) -> Iterator[str]:
    """Give the lines of the report."""
    yield f"Parts that {fit.scene.name} can omit, within {fit.budget * 1e6:g} µm of height:"
    rows = [
        [
            trial.text,
            f"> {fit.budget * 1e6:g}"
            if math.isinf(trial.departure)
            else f"{trial.departure * 1e6:.3g}",
            "" if math.isnan(trial.time) else f"{100 * trial.time:.0f} %",
            "left out" if trial.kept else "",
        ]
        for trial in fit.tried
    ]
    yield from table(("replaced by", "error, µm", "time", ""), rows)
    omitted = "; ".join(fit.left_out) or "nothing: all parts are needed"
    yield f"Left out: {omitted}."
    yield (
        f"Measured without them: {fit.error * 1e6:.3g} µm "
        f"({fit.departure * 1e6:.3g} µm from the full model, {fit.own_error * 1e6:.3g} of integration), "
        f"in {100 * fit.time:.0f} % of its time as measured."
    )


#: Sections whose parameters can make a session too large.
SIZES = ("layout", "recorder", "simulation", "trajectory", "delay")
#: What the folder of a run says where a stop came before its errors.
UNJUDGED = "stopped before they were"
#: Option of the commands that write a run's folder.
NO_ERRORS = {
    "--no-errors": "without error estimates, which take about as long as the run",
}
EXAMPLES = """\
examples:
  digiclay run ridge_mound_valley
  digiclay run my.toml --out first --overwrite --export stl,obj --plots --render
  digiclay run ridge_mound_valley --budget 20um
  digiclay run slow_press --uncertain finger/fitted.toml
  digiclay run tap --set layout.rows=9 --set control.force_setpoint="300 mN" --set conduit=absent

The run folder holds scene.toml (every parameter), history.npz, metrics.json, the files of the options,
and method.py, the code of a method of your own. Ctrl-C keeps the computed rows, marked as incomplete.
"""
OPTIONS: dict[str, Any] = {
    "--out DIR": (Path, "folder; default: the scene's name in the working folder"),
    "--overwrite": "replace an older run at the end",
    "--export F,...": (formats, "also meshes, in formats of 'digiclay export'", []),
    "--budget E": (
        length,
        "omit parts of the model that change no height by more than this, such as 20um, and report them",
    ),
    "--plots": "also plots, session.png and surface.png",
    "--render": "also a picture, pins.png (needs bpy)",
    **NO_ERRORS,
    **UNCERTAIN,
    "--quiet": QUIET,
}


@command(
    "simulate a scene",
    EXAMPLES,
    add_scene,
    OPTIONS,
    add_pool,
    description="Simulate a scene and write its folder.",
)
def carry_out(arguments: Namespace) -> int:
    """Run, write, and print a summary line."""
    members = None
    if arguments.uncertain:
        from .uncertain import add_bands, read_members

        members = read_members(arguments)
    scene, path = scene_of(arguments)
    out = arguments.out or Path(find_name(path))
    _refuse_early(arguments, scene)
    with claim_folder(out, overwrite=arguments.overwrite) as claim:
        fit = None
        if arguments.budget is not None:
            fit = within(scene, arguments.budget, quiet=arguments.quiet)
            scene = fit.scene
        with Stop() as stop:
            result = simulate(arguments, scene, path, stop)
            if fit:
                result = replace(result, metrics={**result.metrics, "budget": noted(fit)})
            extras = _plan_extras(arguments, result)
            code = write_run(arguments, claim, result, extras, stop, *list_cautions(scene))
            return add_bands(arguments, members, result, out, stop) if members else code


def _refuse_early(arguments: Namespace, scene: Scene) -> None:
    """Refuse before the session options that mean nothing, and what is bound to fail after it."""
    of_members = arguments.workers, arguments.scheduler, arguments.members, arguments.seed
    if not arguments.uncertain and (arguments.speed or of_members != (None, None, MEMBERS, 1)):
        rule = "must be given with --uncertain only"
        raise OutputError(f"--members, --seed, --speed, --workers and --scheduler {rule}.")
    names = "export", "plots", "render", "uncertain"
    extras = [name for name in names if getattr(arguments, name)]
    for name in extras:
        if scene.recorder is None:
            raise OutputError(f"--{name} needs a recorder, and the scene has recorder = 'absent'.")
    if arguments.export:
        require_surface(scene, "--export")
    if arguments.plots:
        require_surface(scene, "--plots")
        refuse_without("--plots", "plots", "matplotlib")
    if arguments.render:
        refuse_without_blender()


def _plan_extras(arguments: Namespace, result: Result) -> list[Extra]:
    """Return the outputs of the options beside the session."""
    scene, history = result.scene, result.history
    if not history:
        return []
    extras = [plan_meshes(scene, history, arguments.export)] if arguments.export else []
    if arguments.plots:
        from .render import PLOTS, plotted

        extras.append(
            Extra(PLOTS, partial(plotted, scene, history), lambda run: ["plot", str(run)])
        )
    if arguments.render:
        from .render import PICTURE, STILL, draw_still

        draw = partial(draw_still, scene, history, STILL)
        extras.append(
            Extra([PICTURE], lambda out: draw(out / PICTURE), lambda run: ["render", str(run)])
        )
    return extras


class Extra(NamedTuple):
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
    from .export import exported, file_names

    def make(folder: Path) -> None:
        (folder / within).mkdir(exist_ok=True)
        exported(scene, history, row, kinds, folder / within)

    def later(run: Path) -> list[str]:
        instant = [] if row == -1 else ["--time", repr(float(history["time"][row]))]
        options = ["--out", str(run / within)] if within else []
        return ["export", str(run), "--format", ",".join(kinds), *instant, *options]

    return Extra(
        [f"{within}/{name}" if within else name for name in file_names(kinds)], make, later
    )


def simulate(arguments: Namespace, scene: Scene, path: Path, stop: Stop) -> Result:
    """Run the session of a scene and estimate its errors under progress bars; `path`: of its file."""
    versions = dict[str, str]()
    if scene.method in list_added():
        from ..plugins.method_loader import describe_origin

        versions = describe_origin(scene)
    period, quiet = scene.simulation.control_period, arguments.quiet
    try:
        with Bar(sys.stderr, scene.name, period, quiet=quiet) as bar:
            result = run(scene, progress=bar, stopped=stop, versions=versions)
        if arguments.no_errors:
            return result.without_errors("--no-errors")
        with Bar(sys.stderr, "errors", period, quiet=quiet) as bar:
            return result.estimate_errors(bar, stop) or result.without_errors(UNJUDGED)
    except ParameterError as error:
        changed = any(setting.key.split(".")[0] in SIZES for setting in arguments.settings)
        raise SceneError(f"{'--set' if changed else path.name}: {error}") from None


def write_run(
    arguments: Namespace,
    claim: Claim,
    result: Result,
    extras: Iterable[Extra],
    stop: Stop,
    *notes: str,
) -> int:
    """Write the folder of a run with its extras, print, and return the exit code; `notes` come first."""
    skipped: list[Extra] = []
    wrong: list[Exception] = []
    with claim.write() as folder:
        save(result, folder)
        if result.scene.method in list_added():
            from ..plugins.method_loader import write_code

            write_code(result.scene, folder)
        for extra in extras:
            if stop():
                skipped.append(extra)
                continue
            try:
                extra.make(folder)
            except Exception as error:  # the session itself is worth keeping
                wrong.append(error)
    out = claim.out
    say(arguments, *notes, result.summary(), f"written to {out}")
    if result.metrics.get("errors_absent") == UNJUDGED:
        tell_stopped_before(
            "its errors were estimated", ["run", str(out), "--out", str(out), "--overwrite"]
        )
    for extra in skipped:
        tell_stopped_before(", ".join(extra.files), extra.later(out))
    if wrong:
        raise wrong[0]
    return STOPPED if stop() else 0
