"""``digiclay compare --suite``: control methods over many trajectories with noise, and their league."""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .. import __version__
from ..core.base.errors import DigiclayError, OutputError, ParameterError
from ..core.control.methods import METHODS, find_method
from ..core.files.run_folder import find_name, write_whole
from ..core.scene.scene_source import Setting, find, load
from ..core.studies.axes import Point
from ..core.studies.evaluation import Record
from ..core.studies.league import Table, find_league
from ..core.studies.method_trials import (
    GROUPS,
    QUICK,
    list_trials,
    place_trial,
    read_groups,
)
from ..core.studies.series import Kind, open_series
from ..core.studies.sweep_plan import POINTS, Folder, hash_points
from ..plugins.method_loader import OwnRow
from .arguments import METHOD, settings_of
from .evaluation_pool import add_pool, finish_points
from .extras import format_command
from .machine import describe_machine
from .stop import STOPPED, Stop, refuse_without
from .suite_page import (
    Provenance,
    format_league,
    format_page,
    format_results,
    format_trajectories,
    print_league,
)

#: Scene of a suite where none is given: the paper's session.
SCENE = "ridge_mound_valley"
#: Columns of a point.
KEYS = ("method", "trajectory", "seed")
#: Largest number of seeds, and of random drags.
MOST_REPEATS, MOST_DRAGS = 100, 200
#: The pictures.
RFD_PICTURE, MEASURES_PICTURE = "rfd.svg", "measures.svg"


@dataclass(frozen=True)
class Plan:
    """Plan of a suite.

    Attributes
    ----------
    seeds : tuple of int
        Of the noise.
    points : tuple of Point
        A trial each; words are method, trajectory and seed.
    noise : float
        Standard deviation of the force sensors, N.
    title : str
        Name of the scene.
    identity : str
        Hash of all scenes with all parameters, and of the code of methods of one's own.
    """

    methods: tuple[str, ...]
    groups: tuple[str, ...]
    seeds: tuple[int, ...]
    points: tuple[Point, ...]
    noise: float
    title: str
    identity: str


def add_suite(parser: argparse.ArgumentParser) -> None:
    """Add the options of a suite."""
    group = parser.add_argument_group("benchmark of methods (--suite)")
    group.add_argument(
        "--suite", action="store_true", help=f"many trajectories with repeated noise; default scene {SCENE}"
    )
    group.add_argument("--trajectories", metavar="T,...", help=f"some of {', '.join(GROUPS)}; default: all")
    group.add_argument(
        "--repeats", metavar="N", type=_read_repeats, help="number of seeds of the noise; default: 5"
    )
    group.add_argument("--first-seed", metavar="N", type=_read_seed, help="default: 1")
    group.add_argument("--noise", metavar="FORCE", help='noise of the force sensors; default: "2 mN"')
    group.add_argument("--drags", metavar="N", type=_read_drags, help="number of random drags; default: 20")
    group.add_argument("--quick", action="store_true", help=f"{', '.join(QUICK)}, 2 seeds: for a first look")
    add_pool(parser)


def _read_repeats(text: str) -> int:
    return _read_count(text, 1, MOST_REPEATS)


def _read_drags(text: str) -> int:
    return _read_count(text, 1, MOST_DRAGS)


def _read_seed(text: str) -> int:
    return _read_count(text, 0, 2**31)


def _read_count(text: str, least: int, most: int) -> int:
    """Read a whole number."""
    if not (text.isascii() and text.isdecimal() and len(text) < 12 and least <= int(text) <= most):
        raise argparse.ArgumentTypeError(f"must be a whole number from {least} to {most} (got {text!r})")
    return int(text)


def list_suite_methods() -> tuple[str, ...]:
    """Return the methods of a suite where none are named: those that carry a blister."""
    return tuple(name for name, method in METHODS.items() if method.blister is not None)


def run_suite(arguments: argparse.Namespace, methods: Sequence[str], words: Sequence[str]) -> int:
    """Run what is not done yet, and write tables, page and plots.

    `methods`: the first is the one that the others are compared with; `words`: by which the command line
    names them.
    """
    if arguments.overwrite:
        raise OutputError("--overwrite is not for --suite, which continues its folder: choose another --out.")
    if arguments.speed:
        raise OutputError("--speed is not for --suite: its trajectories ridge-limit and lift-limit are that.")
    for module in ("matplotlib", "scipy"):
        refuse_without(module, "digiclay compare --suite", "pip install digiclay[suite]")
    plan = make_plan(arguments, methods)
    out: Path = arguments.out or Path(f"{plan.title}_suite")
    with _open_folder(out, plan) as folder, Stop() as stop:
        bundles = [(point,) for point in plan.points]
        records = finish_points(arguments, "suite", folder, bundles, KEYS, stop)
        if stop() and len(records) < len(plan.points):
            if not arguments.quiet:
                said = f"{len(records)} of {len(plan.points)} trials are done and kept in {out}"
                print(f"Stopped: {said}. The same command goes on from there.")
            return STOPPED
        _write(arguments, out, plan, records, _format_own_command(arguments, plan, words))
    return 0


def make_plan(arguments: argparse.Namespace, methods: Sequence[str]) -> Plan:
    """Return the plan of a suite; all that can be wrong with it is refused here.

    Raises ParameterError, SceneError: in one line.
    """
    quick, words = arguments.quick, arguments.trajectories
    asked = QUICK if quick and words is None else GROUPS
    groups = read_groups(
        [word.strip() for word in words.split(",") if word.strip()] if words is not None else asked
    )
    repeats = arguments.repeats or (2 if quick else 5)
    first = 1 if arguments.first_seed is None else arguments.first_seed
    seeds = tuple(range(first, first + repeats))
    trials = list_trials(groups, arguments.drags or (2 if quick else 20))
    path = find(arguments.scene or SCENE)
    noise = Setting("sensors.force_noise", arguments.noise or "2 mN", "--noise")
    scenes = {
        (method, seed): load(
            path,
            [
                *settings_of(arguments),
                Setting(METHOD, method, "--methods"),
                noise,
                Setting("sensors.seed", str(seed), "--first-seed"),
            ],
        )
        for method in methods
        for seed in seeds
    }
    sensors = next(iter(scenes.values())).sensors
    if repeats > 1 and not (sensors and sensors.noisy):
        raise ParameterError("--repeats", "", "must be 1 without noise", str(repeats))
    points: list[Point] = []
    for (method, seed), scene in scenes.items():
        for trial in trials:
            placed, measure = place_trial(scene, trial)
            points.append(Point(len(points), (method, trial.name, str(seed)), placed, measure=measure))
    strength = sensors.force_noise if sensors else 0.0
    return Plan(
        tuple(methods), groups, seeds, tuple(points), strength, find_name(path), identify(points, methods)
    )


def identify(points: Sequence[Point], methods: Sequence[str]) -> str:
    """Return a number that identifies scenes, and the code of methods of one's own."""
    rows = [find_method(name) for name in methods]
    codes = [row.source.digest for row in rows if isinstance(row, OwnRow)]
    scenes = hash_points(points)
    return hashlib.sha256(" ".join([scenes, *codes]).encode()).hexdigest() if codes else scenes


@contextmanager
def _open_folder(path: Path, plan: Plan) -> Iterator[Folder]:
    """Make the folder of a suite, or go on with one of the same plan; nobody else works in it meanwhile."""
    description = {
        "digiclay": __version__,
        "methods": list(plan.methods),
        "trajectories": list(plan.groups),
        "seeds": list(plan.seeds),
        "points": len(plan.points),
        "scenes": plan.identity,
    }

    def refuse_another(there: Any) -> None:
        if there != description:
            known = there if isinstance(there, dict) else {}
            said = f"{known.get('points', '?')} trials, digiclay {known.get('digiclay', '?')}"
            raise OutputError(f"{path} holds another suite ({said}): choose another folder with --out.")

    with open_series(path, Kind("suite", "suite.json", (POINTS,)), description, refuse_another):
        yield Folder(path)


def _write(
    arguments: argparse.Namespace, out: Path, plan: Plan, records: dict[int, Record], command: str
) -> None:
    """Write tables, plots and page of finished trials, and print the league."""
    from ..plots.figure import save
    from ..plots.league_figures import draw_measures, draw_rfd

    table: Table = {
        (point.words[0], point.words[1], int(point.words[2])): records[point.index]["figures"]
        for point in plan.points
        if "figures" in records[point.index]
    }
    errors = {point.index: records[point.index].get("error", "") for point in plan.points}
    failed = [(point, errors[point.index]) for point in plan.points if errors[point.index]]
    if not table:
        raise DigiclayError(f"Every trial failed; the first one: {failed[0][1]}")
    league = find_league(table, plan.methods)
    now = datetime.now(UTC).date().isoformat()
    source = Provenance(
        plan.title, __version__, plan.identity, plan.methods, plan.seeds, plan.noise,
        describe_machine("scipy"), now, command,
    )  # fmt: skip
    write_whole(out / "results.csv", format_results(source, plan.points, records).encode())
    write_whole(out / "trajectories.csv", format_trajectories(source, table, plan.methods).encode())
    write_whole(out / "league.csv", format_league(source, league).encode())
    save(draw_rfd(table, plan.methods), out / RFD_PICTURE)
    save(draw_measures(league, plan.methods), out / MEASURES_PICTURE)
    said = [f"{' '.join(point.words)}: {why}" for point, why in failed]
    pictures = (RFD_PICTURE, MEASURES_PICTURE)
    write_whole(out / "index.html", format_page(source, league, table, said, pictures).encode())
    if not arguments.quiet:
        print("\n".join(print_league(league)))
        if failed:
            print(f"{len(failed)} of {len(plan.points)} trials failed; the first one: {said[0]}")
        print(f"written to {out}: start with {out / 'index.html'}")


def _format_own_command(arguments: argparse.Namespace, plan: Plan, methods: Sequence[str]) -> str:
    """Return the command that repeats a suite, with what was left to defaults."""
    words = ["compare", arguments.scene or SCENE, "--suite", "--methods", ",".join(methods)]
    words += ["--trajectories", ",".join(plan.groups), "--repeats", str(len(plan.seeds))]
    words += ["--first-seed", str(plan.seeds[0]), "--noise", f"{plan.noise:g} N"]
    if any(point.words[1].startswith("random") for point in plan.points):
        words += ["--drags", str(arguments.drags or (2 if arguments.quick else 20))]
    for key, value in ((one.key, one.value) for one in settings_of(arguments) if one.key != METHOD):
        words += ["--set", f"{key}={value}"]
    return format_command(words)
