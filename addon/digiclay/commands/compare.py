"""``digiclay compare``: metrics of several control methods on the same input."""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from ..core.base.errors import OutputError, ParameterError
from ..core.base.quantity import find_nearest_name
from ..core.control.methods import list_methods
from ..core.files.run_folder import check_folder, find_name, write_folder
from ..core.metrics.metric_table import SPEEDS
from ..core.metrics.summary import find_worst_finger, sum_cells
from ..core.model.control_interface import find_set_point
from ..core.scene.recorder import Recorder
from ..core.scene.scene_source import Setting, find, load
from ..core.scene.schema import Scene
from ..core.session.run_scene import RUN_METRICS, run
from ..core.studies.speed_limits import Criterion, Drag, Lift, find_largest_speed
from ..plugins.method_loader import find_installed, is_file_word
from .arguments import METHOD, QUIET, add_scene, command, load_by_option, say, settings_of
from .outside import SUITE, find_beside, refuse_absent
from .progress import Bar
from .progress import table as aligned
from .stop import allow_interrupt, refuse_without

EXAMPLES = """\
examples:
  digiclay compare ridge_mound_valley
  digiclay compare slow_press --methods virtual_master,cell_states --speed --out both
  digiclay compare slow_press --method mine.py:Mine     a method of your own beside these two
  digiclay compare --suite --out league
  digiclay compare --suite --method mine.py:Mine --out mine
  digiclay compare --suite --quick --methods virtual_master,hybrid --out look

The folder holds compare.png and metrics.json; docs/metrics.md defines the metrics. That of --suite
holds index.html, the tables league.csv, trajectories.csv and results.csv, and points/, a small file
for each finished trial; after Ctrl-C the same command continues (docs/suite.md).
"""
#: Units people read: factor and name.
READ = {"m": (1e3, "mm"), "m3": (1e6, "ml"), "m/s": (1e3, "mm/s"), "1": (1.0, "")}
Metrics = dict[str, float | None]
#: Methods where none are named.
DEFAULT = ("virtual_master", "cell_states")
#: Options that need --suite.
SUITE_ONLY = (
    "trajectories", "repeats", "first_seed", "noise", "drags", "quick", "workers", "scheduler",
)  # fmt: skip


def _add_suite(parser: argparse.ArgumentParser) -> None:
    """Add the options of a suite, where its package is installed."""
    if suite := find_beside(*SUITE):
        suite.add_suite(parser)
    else:
        parser.add_argument("--suite", nargs=0, action=_AbsentSuite, help="(not part of the extension)")
        parser.set_defaults(suite=None, **dict.fromkeys(SUITE_ONLY))


class _AbsentSuite(argparse.Action):
    """Refusal of --suite where its package is not installed."""

    def __call__(self, *given: Any) -> NoReturn:
        refuse_absent("compare --suite", "suite")


def _methods(text: str) -> tuple[str, ...]:
    """Read a list of methods."""
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise argparse.ArgumentTypeError(f"must name at least one method (got {text!r})")
    for name in names:
        methods = list_methods()
        if name not in methods and not is_file_word(name) and find_installed(name) is None:
            close = find_nearest_name(name, list(methods))
            asked = f"; did you mean {close}" if close else ""
            raise argparse.ArgumentTypeError(f"must be among {', '.join(methods)} (got {name!r}{asked})")
    return names


OPTIONS = {
    "--methods M,...": (
        _methods, "default virtual_master,cell_states; with --suite all that carry a blister",
    ),
    "--speed": "also the largest tracking speeds",
    "--out DIR": (Path, "folder; default: SCENE_compare in the working folder"),
    "--overwrite": "replace an older folder at the end",
    "--quiet": QUIET,
}  # fmt: skip


@command(
    "compare control methods on the same input", EXAMPLES, partial(add_scene, optional=True), OPTIONS,
    _add_suite, description="Run control methods on the same input, and compare their metrics.",
)  # fmt: skip
def carry_out(arguments: argparse.Namespace) -> int:
    """Run every method, print the table, write the folder."""
    if arguments.suite and (suite := find_beside(*SUITE)):
        words = _list_words(arguments, suite.list_suite_methods())
        code: int = suite.run_suite(arguments, _list_methods(words), [word for word, _ in words])
        return code
    for name in SUITE_ONLY:
        if getattr(arguments, name) not in (None, False):
            raise OutputError(f"--{name.replace('_', '-')} is for --suite.")
    if arguments.scene is None:
        raise OutputError("The following arguments are required: SCENE, or --suite.")
    path, methods = find(arguments.scene), _list_methods(_list_words(arguments, DEFAULT))
    out: Path = arguments.out or Path(f"{find_name(path)}_compare")
    check_folder(out, overwrite=arguments.overwrite)
    refuse_without("digiclay compare", "plots", "matplotlib")
    from ..plots.figure import save
    from ..plots.sweep import comparison

    settings = settings_of(arguments)
    scenes = {name: load(path, [*settings, Setting(METHOD, name, "--methods")]) for name in methods}
    measured: dict[str, Metrics] = {}
    forces: dict[str, tuple[Any, Any, Any]] = {}
    beyond: dict[str, str] = {}
    each: dict[str, list[Metrics]] = {}
    with allow_interrupt(), write_folder(out, overwrite=arguments.overwrite) as folder:
        for method, scene in scenes.items():
            with Bar(sys.stderr, method, scene.simulation.control_period, quiet=arguments.quiet) as bar:
                done = run(replace(scene, recorder=Recorder()), progress=bar)
            measured[method] = done.figures | (_speeds(scene) if arguments.speed else {})
            worst = find_worst_finger(done.history, scene.set_point)
            wanted = find_set_point(scene.set_point, sum_cells(worst).following)
            forces[method] = worst["time"], worst["total_force"], wanted
            beyond[method] = done.metrics.get("beyond_a_finger", "")
            each |= {method: done.metrics["fingers"]} if "fingers" in done.metrics else {}
        units = {name: metric.unit for name, metric in {**RUN_METRICS, **SPEEDS}.items()}
        content = {"scene": scene.name, "methods": measured, "units": units, "beyond_a_finger": beyond}
        content |= {"fingers": each} if each else {}
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        (folder / "metrics.json").write_text(text + "\n", encoding="utf-8")
        several = len(scene.fingers) > 1
        called = "force of the worst finger" if several else "total force"
        save(comparison(measured, forces, scene.name, called), folder / "compare.png")
    notes = [f"{method}: {words}" for method, words in beyond.items() if words]
    alone = ", the first of the fingers alone" if several else ""
    notes += [f"Followed{alone}: {Criterion()}."] if arguments.speed else []
    notes += [f"Of {len(scene.fingers)} fingers the worst; metrics.json has each."] if several else []
    say(arguments, *table(measured), *notes, f"written to {out}")
    return 0


def _list_words(arguments: argparse.Namespace, default: Sequence[str]) -> list[tuple[str, str]]:
    """Return the words that name methods, each with its option."""
    words = [(word, "--methods") for word in arguments.methods or default]
    return [*words, (arguments.method, "--method")] if arguments.method is not None else words


def _list_methods(words: Sequence[tuple[str, str]]) -> list[str]:
    """Return the names of the methods to compare; those of one's own are loaded."""
    return list(dict.fromkeys(load_by_option(word, option) for word, option in words))


def _speeds(scene: Scene) -> Metrics:
    """Measure the largest speeds; None where the slowest is too fast, or the bed too small."""
    measured: Metrics = {}
    ways: tuple[Drag | Lift, ...] = Drag(), Lift()
    for name, way in zip(SPEEDS, ways, strict=True):
        try:
            measured[name] = find_largest_speed(scene, way, Criterion())
        except ParameterError:
            measured[name] = None
    return measured


def table(measured: dict[str, Metrics]) -> Iterator[str]:
    """Give the lines of the table: a metric a line, a method a column, units people read."""
    metrics, columns = {**RUN_METRICS, **SPEEDS}, list(measured)
    names = [name for name in metrics if name in measured[columns[0]]]
    rows = []
    for name in names:
        factor, unit = READ.get(metrics[name].unit, (1.0, metrics[name].unit))
        values = (measured[method][name] for method in columns)
        rows.append([name, unit, *("–" if value is None else f"{value * factor:.4g}" for value in values)])
    yield from aligned(("metric", "unit", *columns), rows, left=2)
