"""``digiclay compare``: metrics of several control methods on the same input."""

import sys
from argparse import Action, ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ..core.base.errors import OutputError, ParameterError
from ..core.base.quantity import find_nearest_name
from ..core.control.methods import list_methods
from ..core.files.run_folder import MARK, find_name, format_json, write_whole
from ..core.files.tables import Record, Table
from ..core.metrics.metric_table import BEYOND, ERRORS, SPEEDS, describe_errors, list_beyond
from ..core.metrics.summary import find_worst_finger, sum_cells
from ..core.model.control_interface import find_set_point
from ..core.scene.recorder import Recorder
from ..core.scene.scene_source import Setting, find, load
from ..core.scene.schema import Scene
from ..core.session.plate import list_cautions
from ..core.session.run_scene import RUN_METRICS, run
from ..core.studies.axes import Point
from ..core.studies.speed_limits import (
    HIGH,
    LOW,
    MOTIONS,
    Criterion,
    describe_end,
    find_largest_speed,
)
from ..core.studies.sweep_plan import Folder, hash_points, open_points
from ..core.version import __version__
from ..plugins.method_loader import find_installed, is_file_word
from .arguments import METHOD, QUIET, add_scene, command, load_by_option, say, settings_of
from .outside import SUITE, find_beside, refuse_absent
from .progress import Bar
from .progress import table as aligned
from .refusals import refuse_without
from .stop import STOPPED, allow_interrupt

EXAMPLES = """\
examples:
  digiclay compare ridge_mound_valley
  digiclay compare slow_press --methods virtual_master,cell_states --speed --out both
  digiclay compare slow_press --method mine.py:Mine     a method of your own beside these two
  digiclay compare --suite --out league
  digiclay compare --suite --method mine.py:Mine --out mine
  digiclay compare --suite --quick --methods virtual_master,hybrid --out look

The folder holds compare.png and metrics.json; docs/metrics.md defines the metrics. That of --suite
holds index.html and the tables league.csv, trajectories.csv and results.csv (docs/suite.md). Both
hold points/, a small file for each finished method or trial: after Ctrl-C the same command continues.
"""
#: Units people read: factor and name.
READ = {"m": (1e3, "mm"), "m3": (1e6, "ml"), "m/s": (1e3, "mm/s"), "1": (1.0, "")}
Metrics = dict[str, float | None]
#: Rows of the table.
FIGURES = {**RUN_METRICS, **ERRORS, **SPEEDS}
#: Messages of a run on what is not to be trusted of it.
DOUBTS = (*BEYOND, "errors_in_doubt")
#: Methods where none are named.
DEFAULT = ("virtual_master", "cell_states")
#: Options that need --suite.
SUITE_ONLY = (
    "trajectories",
    "repeats",
    "first_seed",
    "noise",
    "drags",
    "quick",
    "workers",
    "scheduler",
)


def _add_suite(parser: ArgumentParser) -> None:
    """Add the options of a suite, where its package is installed."""
    if suite := find_beside(*SUITE):
        suite.add_suite(parser)
    else:
        parser.add_argument(
            "--suite", nargs=0, action=_AbsentSuite, help="(not part of the extension)"
        )
        parser.set_defaults(suite=None, **dict.fromkeys(SUITE_ONLY))


class _AbsentSuite(Action):
    """Refusal of --suite where its package is not installed."""

    def __call__(self, *given: Any) -> NoReturn:
        refuse_absent("compare --suite", "suite")


def _methods(text: str) -> tuple[str, ...]:
    """Read a list of methods."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise ArgumentTypeError(f"must name at least one method (got {text!r})")
    for name in names:
        methods = list_methods()
        if name not in methods and not is_file_word(name) and find_installed(name) is None:
            close = find_nearest_name(name, list(methods))
            asked = f"; did you mean {close}" if close else ""
            raise ArgumentTypeError(f"must be among {', '.join(methods)} (got {name!r}{asked})")
    return names


OPTIONS = {
    "--methods M,...": (
        _methods,
        "default virtual_master,cell_states; with --suite all that carry a blister",
    ),
    "--speed": "also the largest tracking speeds",
    "--out DIR": (Path, "folder; default: SCENE_compare in the working folder"),
    "--overwrite": "replace another comparison in the folder",
    "--quiet": QUIET,
}


@command(
    "compare control methods on the same input",
    EXAMPLES,
    partial(add_scene, optional=True),
    OPTIONS,
    _add_suite,
    description="Run control methods on the same input, and compare their metrics.",
)
def carry_out(arguments: Namespace) -> int:
    """Run every method, print the table, write the folder."""
    if arguments.suite and (suite := find_beside(*SUITE)):
        words = _list_words(arguments, suite.list_suite_methods())
        return suite.run_suite(arguments, _list_methods(words), [word for word, _ in words])
    for name in SUITE_ONLY:
        if getattr(arguments, name) not in (None, False):
            raise OutputError(f"--{name.replace('_', '-')} is for --suite.")
    if arguments.scene is None:
        raise OutputError("The following arguments are required: SCENE, or --suite.")
    path, methods = find(arguments.scene), _list_methods(_list_words(arguments, DEFAULT))
    out = arguments.out or Path(f"{find_name(path)}_compare")
    refuse_without("digiclay compare", "plots", "matplotlib")
    settings = settings_of(arguments)
    scenes = [load(path, [*settings, Setting(METHOD, name, "--methods")]) for name in methods]
    points = [
        Point(number, (name,), replace(scene, recorder=Recorder()))
        for number, (name, scene) in enumerate(zip(methods, scenes, strict=True))
    ]
    records: dict[int, Record] = {}
    try:
        with allow_interrupt(), _open_folder(out, points, arguments) as folder:
            records |= folder.read_records()
            for point in points:
                if point.index not in records:
                    record = _measure(point, arguments)
                    folder.keep(point, (METHOD,), record)
                    records[point.index] = record
            every = {point.words[0]: records[point.index] for point in points}
            notes = _write(out, scenes, every, speed=arguments.speed)
    except KeyboardInterrupt:
        if not records:
            raise
        done = f"{len(records)} of {len(points)} methods are done and kept in {out}"
        say(arguments, f"Stopped: {done}. The same command continues.")
        return STOPPED
    say(arguments, *table({name: record["figures"] for name, record in every.items()}), *notes)
    return 0


def _open_folder(
    out: Path, points: Sequence[Point], arguments: Namespace
) -> AbstractContextManager[Folder]:
    """Open the folder of a comparison, see `open_points`; with --overwrite another one in it is removed."""
    methods = [point.words[0] for point in points]
    plan = {"digiclay": __version__, "methods": methods, "speed": arguments.speed}

    def describe(there: Table) -> str:
        return f"{', '.join(there['methods'])}, digiclay {there['digiclay']}"

    def accept(there: Table, folder: Folder) -> bool:
        if arguments.overwrite:
            folder.clear()
        return bool(arguments.overwrite)

    return open_points(out, "comparison", {**plan, "scenes": hash_points(points)}, describe, accept)


def _measure(point: Point, arguments: Namespace) -> Record:
    """Run a method; return its figures, the force over time, N, and what else the files hold of it."""
    scene, method = point.scene, point.words[0]
    assert scene is not None  # values go together, or nothing was begun
    with Bar(sys.stderr, method, scene.simulation.control_period, quiet=arguments.quiet) as bar:
        done = run(scene, progress=bar)
    with Bar(sys.stderr, "errors", scene.simulation.control_period, quiet=arguments.quiet) as bar:
        done = done.estimate_errors(bar) or done
    speeds, absent = _speeds(scene) if arguments.speed else ({}, [])
    worst = find_worst_finger(done.history, scene.set_point)
    wanted = find_set_point(scene.set_point, sum_cells(worst).following)
    asked = np.where(np.isnan(wanted), None, wanted)  # type: ignore[call-overload]  # JSON has no NaN
    return {
        "figures": done.figures | {name: done.metrics.get(name) for name in ERRORS} | speeds,
        "absent": [
            *absent,
            *([describe_errors(done.metrics)] if "height_error" not in done.metrics else []),
        ],
        "forces": [worst["time"].tolist(), worst["total_force"].tolist(), asked.tolist()],
        **{name: done.metrics.get(name, "") for name in DOUBTS},
        "fingers": done.metrics.get("fingers"),
    }


def _write(
    out: Path, scenes: Sequence[Scene], every: Mapping[str, Record], *, speed: bool
) -> list[str]:
    """Write the table and the picture of all methods' records; return the lines to print below the table."""
    from ..plots.figure import save
    from ..plots.sweep import comparison

    scene = scenes[0]
    several = len(scene.fingers) > 1
    measured = {name: record["figures"] for name, record in every.items()}
    units = {name: metric.unit for name, metric in FIGURES.items()}
    content = {"scene": scene.name, "methods": measured, "units": units}
    content |= {
        key: {name: record.get(key, "") for name, record in every.items()} for key in DOUBTS
    }
    if several:
        content["fingers"] = {name: each["fingers"] for name, each in every.items()}
    write_whole(out / MARK, format_json(content))
    forces = {name: tuple(np.array(each["forces"], np.float64)) for name, each in every.items()}
    called = "force of the worst finger" if several else "total force"
    save(comparison(measured, forces, scene.name, called), out / "compare.png")
    notes = _list_notes(scenes, every)
    alone = ", for the first finger alone" if several else ""
    if speed:
        ends = f"searched from {LOW * 1e3:g} to {HIGH * 1e3:g} mm/s"
        notes.append(f"Followed{alone}, {ends}: {Criterion()}.")
    notes += dict.fromkeys(why for each in every.values() for why in each.get("absent", ()))
    notes += (
        [f"The worst of {len(scene.fingers)} fingers; metrics.json has each."] if several else []
    )
    return [*notes, f"written to {out}"]


def _list_notes(scenes: Sequence[Scene], every: Mapping[str, Record]) -> list[str]:
    """Return what is to be known of a scene or its results, after the methods that it is true of."""
    said: dict[str, list[str]] = {}
    for scene, (name, record) in zip(scenes, every.items(), strict=True):
        doubt = record.get("errors_in_doubt")
        larger = [f"larger errors: {doubt}"] if doubt else []
        for note in (*list_cautions(scene), *list_beyond(record), *larger):
            said.setdefault(note, []).append(name)
    return [f"{', '.join(names)}: {note}" for note, names in said.items()]


def _list_words(arguments: Namespace, default: Sequence[str]) -> list[tuple[str, str]]:
    """Return the words that name methods, each with its option."""
    words = [(word, "--methods") for word in arguments.methods or default]
    return [*words, (arguments.method, "--method")] if arguments.method is not None else words


def _list_methods(words: Sequence[tuple[str, str]]) -> list[str]:
    """Return the names of the methods to compare; those of one's own are loaded."""
    return list(dict.fromkeys(load_by_option(word, option) for word, option in words))


def _speeds(scene: Scene) -> tuple[Metrics, list[str]]:
    """Measure the largest speeds, None where the slowest is too fast; return why others are absent too."""
    measured: Metrics = {}
    absent = []
    for name, motion in MOTIONS.items():
        try:
            measured[name] = find_largest_speed(scene, motion, Criterion())
        except ParameterError as error:
            absent.append(f"{name}: not measured, {error}")
    return measured, absent


def table(measured: dict[str, Metrics]) -> Iterator[str]:
    """Give the lines of the table: one line per metric, one column per method, in units people read."""

    def write(name: str, value: float | None, factor: float) -> str:
        end = describe_end(value) if name in SPEEDS else ""
        return end or ("–" if value is None else f"{value * factor:.4g}")

    rows = []
    for name, metric in FIGURES.items():
        if any(name in figures for figures in measured.values()):
            factor, unit = READ.get(metric.unit, (1.0, metric.unit))
            if name in ERRORS:
                factor, unit = metric.factor, metric.shown
            rows.append(
                [
                    name,
                    unit,
                    *(write(name, values.get(name), factor) for values in measured.values()),
                ]
            )
    yield from aligned(("metric", "unit", *measured), rows, left=2)
