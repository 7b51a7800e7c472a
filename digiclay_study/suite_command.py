"""``digiclay compare --suite``: control methods over many trajectories with noise, and their league."""

from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from digiclay import __version__
from digiclay.commands.arguments import METHOD, add_options, settings_of, whole_number
from digiclay.commands.evaluation_pool import run_series
from digiclay.commands.progress import format_command
from digiclay.commands.refusals import refuse_without
from digiclay.commands.series_options import add_pool
from digiclay.core.base.errors import DigiclayError, OutputError, ParameterError
from digiclay.core.control.methods import METHODS
from digiclay.core.files import tables
from digiclay.core.files.run_folder import find_name, write_whole
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.studies.axes import Point
from digiclay.core.studies.sweep_plan import hash_points, open_points
from digiclay.plots.figure import save

from . import suite_page
from .league import Table, find_league
from .method_trials import GROUPS, QUICK, list_trajectories, place_trial, read_groups
from .study_plots import draw_measures, draw_rfd
from .suite_page import Plan, Provenance, describe_machine, print_league

#: Scene of a suite where none is given: the paper's session.
SCENE = "ridge_mound_valley"
#: Columns of a point.
KEYS = ("method", "trajectory", "seed")
#: The pictures.
PICTURES = ("rfd.svg", "measures.svg")


def add_suite(parser: ArgumentParser) -> None:
    """Add the options of a suite."""
    add_options(
        parser.add_argument_group("benchmark of methods (--suite)"),
        {
            "--suite": f"many trajectories with repeated noise; default scene {SCENE}",
            "--trajectories T,...": f"some of {', '.join(GROUPS)}; default: all",
            "--repeats N": (whole_number(1, 100), "number of seeds of the noise; default: 5"),
            "--first-seed N": (whole_number(0, 2**31), "default: 1"),
            "--noise FORCE": 'noise of the force sensors; default: "2 mN"',
            "--drags N": (whole_number(1, 200), "number of random drags; default: 20"),
            "--quick": f"{', '.join(QUICK)}, 2 seeds: for a first look",
        },
    )
    add_pool(parser)


def list_suite_methods() -> tuple[str, ...]:
    """Return the methods of a suite where none are named: those that carry a blister."""
    return tuple(name for name, method in METHODS.items() if method.blister is not None)


def run_suite(arguments: Namespace, methods: Sequence[str], words: Sequence[str]) -> int:
    """Run what is not done yet, and write tables, page and plots."""
    if arguments.overwrite:
        raise OutputError(
            "--overwrite is not for --suite, which continues its folder: choose another --out."
        )
    if arguments.speed:
        raise OutputError(
            "--speed is not for --suite: trajectories ridge-limit and lift-limit measure it."
        )
    refuse_without("digiclay compare --suite", "suite", "matplotlib", "scipy")
    plan = make_plan(arguments, methods)
    out = arguments.out or Path(f"{plan.title}_suite")
    description = {
        "digiclay": __version__,
        "methods": list(plan.methods),
        "trajectories": list(plan.groups),
        "seeds": list(plan.seeds),
        "points": len(plan.points),
        "scenes": plan.identity,
    }

    def describe(there: tables.Table) -> str:
        return f"{there.get('points', '?')} trials, digiclay {there.get('digiclay', '?')}"

    return run_series(
        arguments,
        "suite",
        len(plan.points),
        open_points(out, "suite", description, describe),
        lambda evaluation: evaluation.finish([(point,) for point in plan.points], KEYS),
        lambda records: _write(out, plan, records, _format_own_command(arguments, plan, words)),
        noun="trials",
    )


def make_plan(arguments: Namespace, methods: Sequence[str]) -> Plan:
    """Return the plan of a suite; ParameterError, SceneError in one line where it cannot be run."""
    quick, words = arguments.quick, arguments.trajectories
    asked = QUICK if quick else GROUPS
    if words is not None:
        asked = tuple(word.strip() for word in words.split(",") if word.strip())
    groups = read_groups(asked)
    repeats = arguments.repeats or (2 if quick else 5)
    first = 1 if arguments.first_seed is None else arguments.first_seed
    seeds = tuple(range(first, first + repeats))
    trajectories = list_trajectories(groups, _count_drags(arguments))
    path, settings = find(arguments.scene or SCENE), settings_of(arguments)
    noise = Setting("sensors.force_noise", arguments.noise or "2 mN", "--noise")
    scenes = {
        (method, seed): load(
            path,
            [
                *settings,
                Setting(METHOD, method, "--methods"),
                noise,
                Setting("sensors.seed", str(seed), "--first-seed"),
            ],
        )
        for method in methods
        for seed in seeds
    }
    if not all(scene.fingers for scene in scenes.values()):
        raise ParameterError("scene", "fingers", "must be at least 1", "0")
    sensors = next(iter(scenes.values())).sensors
    if repeats > 1 and not (sensors and sensors.noisy):
        raise ParameterError("--repeats", "", "must be 1 without noise", str(repeats))
    points: list[Point] = []
    for (method, seed), scene in scenes.items():
        for name in trajectories:
            placed, measure = place_trial(scene, name, errors=seed == first)
            points.append(Point(len(points), (method, name, str(seed)), placed, measure=measure))
    strength = sensors.force_noise if sensors else 0.0
    title = find_name(path)
    return Plan(tuple(methods), groups, seeds, tuple(points), strength, title, hash_points(points))


def _count_drags(arguments: Namespace) -> int:
    """Return the number of random drags."""
    return arguments.drags or (2 if arguments.quick else 20)


def _write(out: Path, plan: Plan, records: dict[int, tables.Record], command: str) -> list[str]:
    """Write tables, plots and page of finished trials; return the lines to print."""
    table: Table = {
        (point.words[0], point.words[1], int(point.words[2])): records[point.index]["figures"]
        for point in plan.points
        if "figures" in records[point.index]
    }
    errors = {point.words: records[point.index].get("error", "") for point in plan.points}
    failed = [f"{' '.join(words)}: {why}" for words, why in errors.items() if why]
    if not table:
        raise DigiclayError(f"Every trial failed; the first one: {next(iter(errors.values()))}")
    league = find_league(table, plan.methods)
    source = Provenance(
        plan, describe_machine("scipy"), datetime.now(UTC).date().isoformat(), command
    )
    figures = draw_rfd(table, plan.methods), draw_measures(league, plan.methods)
    for figure, name in zip(figures, PICTURES, strict=True):
        save(figure, out / name)
    files = {
        "results.csv": suite_page.format_results(source, records),
        "trajectories.csv": suite_page.format_trajectories(source, table),
        "league.csv": suite_page.format_league(source, league),
        "index.html": suite_page.format_page(source, league, table, failed, PICTURES),
    }
    for name, text in files.items():
        write_whole(out / name, text.encode())
    lines = print_league(league)
    if failed:
        lines.append(
            f"{len(failed)} of {len(plan.points)} trials failed; the first one: {failed[0]}"
        )
    return [*lines, f"written to {out}: start with {out / 'index.html'}"]


def _format_own_command(arguments: Namespace, plan: Plan, methods: Sequence[str]) -> str:
    """Return the command that repeats a suite, with what was left to defaults."""
    words = ["compare", arguments.scene or SCENE, "--suite", "--methods", ",".join(methods)]
    words += ["--trajectories", ",".join(plan.groups), "--repeats", str(len(plan.seeds))]
    words += ["--first-seed", str(plan.seeds[0]), "--noise", f"{plan.noise:g} N"]
    if any(point.words[1].startswith("random") for point in plan.points):
        words += ["--drags", str(_count_drags(arguments))]
    for setting in settings_of(arguments):
        if setting.key != METHOD:
            words += ["--set", f"{setting.key}={setting.value}"]
    return format_command(words)
