"""``digiclay export`` and ``features``: the formed surface of a run as mesh files, its bosses and creases."""

import json
from argparse import ArgumentTypeError, Namespace
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from ..core.base.errors import OutputError
from ..core.files.run_folder import claim_files
from ..core.mesh_io.export_model import KINDS, Model, find_features, make_bodies
from ..core.mesh_io.mesh_writer import FORMATS, UNITS, Format, find_suffix, write
from ..core.mesh_io.obj_reader import AXES, UP, make_axes
from ..core.scene.schema import Scene
from ..core.session.finished_run import find_row, read_run, require_surface
from ..core.session.render_settings import Film
from ..core.session.run_scene import History
from ..core.surface.features import Finding, make_table, summarize
from ..core.surface.formed import Body, Formed, make_formed
from ..core.surface.skins import SKINS
from ..exchange.animation_file import ANIMATED, SUFFIXES, animate, write_animation
from .arguments import (
    RUN,
    command,
    formats,
    millimeters,
    say,
    seconds,
    told_as_options,
    whole_number,
)
from .progress import table as aligned
from .refusals import refuse_without_blender


def list_choices(
    choices: Mapping[str, str | Format], form: str = "{}: {}", separator: str = "; "
) -> str:
    """Write choices with their meanings."""
    return separator.join(form.format(*choice) for choice in choices.items())


#: What counts as a feature by default.
USUAL = Finding()
#: Options of the surface of a run, and of its features.
SURFACE = {
    "--skin": (SKINS, f"{list_choices(SKINS)}; default bilinear", "bilinear"),
    # 0 stands for the default in files alone.
    "--resolution N": (
        whole_number(1, 64),
        "points per pitch; default: 1, or 4 for curved skins",
        0,
    ),
    "--threshold L": (
        millimeters,
        "least distance of a feature from the former surface, mm, or with a unit; "
        f"default {USUAL.threshold * 1e3:g} mm",
        USUAL.threshold,
    ),
    "--smallest N": (
        int,
        f"least number of pins of a feature; default {USUAL.smallest}",
        USUAL.smallest,
    ),
    "--former T": (None, "instant of the former surface, s, or 'rest'; default: the start", "0"),
}
TIME = {"--time T": (seconds, "instant, s; default: the end")}


def finding_of(arguments: Namespace) -> Finding:
    """Return what counts as a feature."""
    with told_as_options("Finding"):
        return Finding(threshold=arguments.threshold, smallest=arguments.smallest)


def model_of(arguments: Namespace, scene: Scene, kind: str) -> Model:
    """Return what is to be made. `kind`: of the mesh."""
    names = ("skin", "resolution", "base_thickness")
    given = {name: value for name in names if (value := getattr(arguments, name, None)) is not None}
    with told_as_options("Model"):
        return Model(kind=kind, cap=scene.actuator.bore / 2.0, **given)


def read_formed(arguments: Namespace, command: str) -> tuple[Scene, Formed]:
    """Return the scene of a run, and its surface at --time compared with that at --former."""
    run = read_run(arguments.run, "height", "position", "force", "mode")
    require_surface(run.scene, command)
    row = -1 if arguments.time is None else find_row(run.history, arguments.time, "--time")
    if arguments.former.strip() == "rest":
        return run.scene, make_formed(run.history, row, float(run.scene.actuator.rest_height))
    try:
        time = seconds(arguments.former)
    except ArgumentTypeError as error:
        raise OutputError(f"--former must be a time or 'rest': {error}.") from None
    return run.scene, make_formed(run.history, row, find_row(run.history, time, "--former"))


def read_animated(text: str) -> list[str]:
    """Read the formats of animated files."""
    names = dict.fromkeys(text.lower().split(","))
    if not names.keys() <= SUFFIXES.keys():
        raise ArgumentTypeError(f"must be some of {', '.join(SUFFIXES)} (got {text!r})")
    return list(names)


EXAMPLES = """\
examples:
  digiclay export ridge_mound_valley --format stl,3mf
  digiclay export ridge_mound_valley --skin smooth --resolution 6 --format obj --up z
  digiclay export ridge_mound_valley --kind features --separate --format stl --out parts
  digiclay export ridge_mound_valley --kind pins --format ply --unit m --time 10 --out meshes
  digiclay export ridge_mound_valley --animated usd,glb --start 8 --stop 18
"""
#: What a file of each kind is called; each of several features by its own name.
STEMS = {"solid": "surface", "surface": "skin", "pins": "pins", "features": "features"}


OPTIONS = {
    **RUN,
    "--format F,...": (formats, f"{list_choices(FORMATS, '{} ({[0]})', ', ')}; default stl"),
    "--kind": (KINDS, f"{list_choices(KINDS)}; default solid; with --animated pins and surface"),
    "--animated F,...": (
        read_animated,
        "the whole session, its pins as instances and its skin: usd, glb, and abc, which needs bpy",
    ),
    "--fps N": (int, "frames per second of --animated; default 25", 25),
    "--start T": (seconds, "first instant of --animated, s", 0.0),
    "--stop T": (seconds, "last instant of --animated, s; default: the end", 0.0),
    **SURFACE,
    "--base-thickness L": (
        millimeters,
        "base under the lowest point, mm, or with a unit; default: 3 mm",
    ),
    "--separate": "one file per feature",
    "--unit": (UNITS, "unit of all formats but glb; default: mm", "mm"),
    "--up": (AXES, "upward axis of an obj; default y, as Blender's", UP),
    "--forward": (AXES, "forward axis of an obj, as --forward=-z; default: to --up", ""),
    **TIME,
    "--out DIR": (Path, "output folder; default: the run folder"),
}


def file_names(kinds: Iterable[str], kind: str = "solid") -> list[str]:
    """Return the names of the files of a kind of mesh in several formats."""
    return [f"{STEMS[kind]}{find_suffix(file_kind)}" for file_kind in kinds]


def exported(
    scene: Scene,
    history: History,
    row: int,
    kinds: Sequence[str],
    folder: Path,
    model: Model | None = None,
) -> list[Path]:
    """Write one row of a history in several formats, by default as the solid; return the files."""
    settings = model or Model(cap=scene.actuator.bore / 2.0)
    parts = make_bodies(make_formed(history, row), settings, Finding())
    names = file_names(kinds, settings.kind)
    return [
        write(parts, folder / name, "mm", kind) for name, kind in zip(names, kinds, strict=True)
    ]


@command("write the formed surface of a run as mesh files", EXAMPLES, OPTIONS)
def carry_out(arguments: Namespace) -> int:
    """Export."""
    rule = "without" if arguments.animated else "with"
    for name, default in (OF_INSTANT if arguments.animated else OF_ANIMATED).items():
        if getattr(arguments, name) != default:
            raise OutputError(f"--{name} must be given {rule} --animated.")
    if arguments.animated:
        return _export_animated(arguments)
    kind = arguments.kind or "solid"
    if arguments.separate and kind != "features":
        raise OutputError("--separate needs --kind features.")
    scene, formed = read_formed(arguments, "export")
    bodies = make_bodies(formed, model_of(arguments, scene, kind), finding_of(arguments))
    files: list[tuple[str, list[Body]]] = [(STEMS[kind], bodies)]
    if arguments.separate:
        files = [(body.name, [body]) for body in bodies]
    with told_as_options("Export"):
        make_axes(arguments.up, arguments.forward)
    folder = arguments.out or arguments.run
    targets = [
        (some, kind, folder / f"{stem}{find_suffix(kind)}")
        for stem, some in files
        for kind in arguments.format or ["stl"]
    ]
    with claim_files([path for _, _, path in targets]):
        for some, kind, path in targets:
            write(some, path, arguments.unit, kind, arguments.up, arguments.forward)
            say(arguments, f"{path} ({arguments.up} up)" if kind == "obj" else path)
    return 0


#: Options of meshes of an instant, and of animated files, with their defaults.
OF_INSTANT = {"format": None, "separate": False, "time": None}
OF_ANIMATED = {"fps": 25, "start": 0.0, "stop": 0.0}


def _export_animated(arguments: Namespace) -> int:
    """Export pins and skin of the whole session."""
    kinds = [arguments.kind] if arguments.kind else ANIMATED
    if kinds[0] not in ANIMATED:
        raise OutputError(f"--kind must be pins or surface with --animated (got {kinds[0]}).")
    if "abc" in arguments.animated:
        refuse_without_blender()
    with told_as_options("Film", rate="fps"):
        film = Film(rate=arguments.fps, start=arguments.start, stop=arguments.stop)
        run = read_run(arguments.run, "height", "position")
        moments = film.moments(run.history["time"])
    time, height, position = (run.history[name] for name in ("time", "height", "position"))
    frames = np.column_stack([np.interp(moments, time, pin) for pin in height.T])
    folder, targets = arguments.out or arguments.run, []
    for kind in kinds:
        animation = animate(position, frames, film.rate, model_of(arguments, run.scene, kind))
        stem = folder / f"animated_{STEMS[kind]}"
        targets += [
            (animation, name, Path(f"{stem}{SUFFIXES[name]}")) for name in arguments.animated
        ]
    with claim_files([path for _, _, path in targets]):
        for animation, name, path in targets:
            write_animation(path, animation, name, arguments.unit)
            say(arguments, path)
    return 0


LISTING = """\
examples:
  digiclay features ridge_mound_valley
  digiclay features ridge_mound_valley --time 13.3 --former 10.3 --threshold "1 mm"
  digiclay features ridge_mound_valley --json > features.json

Areas are in plan, lengths of crests in space. --json writes SI units, with the pins of each feature and the
points of its crests.
"""


@command(
    "list the bosses and creases of a run", LISTING, RUN, SURFACE, TIME, {"--json": "write JSON"}
)
def list_features(arguments: Namespace) -> int:
    """List the features."""
    scene, formed = read_formed(arguments, "features")
    features = find_features(formed, model_of(arguments, scene, "surface"), finding_of(arguments))
    if arguments.json:
        say(arguments, json.dumps([feature.figures() for feature in features], indent=1))
    else:
        head, *rows = make_table(features)
        say(arguments, summarize(features), *(aligned(head, rows) if rows else ()))
    return 0
