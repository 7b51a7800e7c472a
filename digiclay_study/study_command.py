"""``digiclay study``: Sobol indices of a scene's metrics over ranges of its parameters, and their page."""

import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from digiclay import __version__
from digiclay.commands.arguments import add_command, add_options, whole_number
from digiclay.commands.evaluation_pool import Evaluation, run_series
from digiclay.commands.progress import Counted, format_command
from digiclay.commands.refusals import refuse_without
from digiclay.commands.series_options import UNCERTAIN
from digiclay.commands.uncertain import list_options
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.files.run_folder import write_whole
from digiclay.core.files.tables import Record
from digiclay.core.metrics.bands import LEAST, MOST, find_band
from digiclay.core.scene.scene_source import Setting
from digiclay.core.studies.axes import Point, find_ends, place_points, refuse_twice
from digiclay.core.studies.evaluation import FIGURES, describe_effort, make_bundles
from digiclay.core.studies.sweep_plan import format_csv, hash_points
from digiclay.core.studies.uncertainty import Members, draw_members
from digiclay.plots.sweep import read_unit

from .case_study import run_cases
from .indices import (
    ALLOWED,
    CONFIDENCE,
    LOSS,
    Indices,
    Response,
    compute_indices,
    count_points,
    find_excess_losses,
    make_response,
    sample_shares,
)
from .point_series import UNCHANGED, Subject, add_subject, read_subject, refuse_too_many

EXAMPLES = """\
examples:
  digiclay study slow_press --vary control.force_gain=0.5:8:log --vary control.dead_band=1e-5:1e-4 --out which
  digiclay study my.toml --vary valve.stroke="20 um:40 um" --vary control.force_gain=1:6 --samples 128 \\
    --second --metric rfd,lag --out which
  digiclay study valves.toml --out valves

A design of N x (parameters + 2) runs, with --second N x (2 parameters + 2). The folder holds study.md
(start there), indices.csv, indices.png, points.csv with every run, and points/, a small file for each
finished run; with --uncertain bands.csv, 95 % bands of each point. After Ctrl-C the same command continues.

Without --vary SCENE is a STUDY file, with [cases]: the least device that meets limits in all cases. The
folder then holds study.md, limits.png, worst.csv and runs.csv.
"""
METRICS = "rfd,lag,oscillation,relief"
PICTURE = "indices.png"
#: Largest number of samples.
MOST_SAMPLES = 4096


def add(commands: Any) -> None:
    """Add the command."""
    description = (
        "Find which parameters matter: Sobol indices of metrics over ranges of parameters."
    )
    purpose = "find which parameters matter for which metric"
    parser = add_command(commands, "study", purpose, EXAMPLES, description, carry_out=carry_out)
    add_subject(parser, METRICS, required=False)
    add_options(
        parser,
        {
            "--samples N": (_read_samples, "a power of two; default: 64", 64),
            "--second": "indices of pairs of parameters, too",
            "--uncertain FILE": UNCERTAIN["--uncertain FILE"],
            "--members N": (whole_number(LEAST, MOST), f"runs per band; default: {LEAST}", LEAST),
        },
    )


def _read_samples(text: str) -> int:
    """Read a number of samples."""
    number = int(text) if text.isdecimal() and len(text) < 10 else 0
    if not 4 <= number <= MOST_SAMPLES or number & (number - 1):
        rule = f"must be a power of two from 4 to {MOST_SAMPLES}, such as 64 or 128"
        raise ArgumentTypeError(f"{rule} (got {text!r})")
    return number


def carry_out(arguments: Namespace) -> int:
    """Run what is not done yet, and write tables, page and plot."""
    if not arguments.vary:
        if arguments.second or arguments.uncertain or arguments.metric != METRICS:
            raise OutputError("--metric, --second and --uncertain are for a study with --vary.")
        return run_cases(arguments)
    refuse_without("digiclay study", "study", "SALib", "matplotlib")
    arguments.parts = [*arguments.parts, *arguments.uncertain]
    subject = read_subject(arguments)
    count, second = len(subject.ranges), arguments.second
    if count < 2:
        raise OutputError(
            "A study needs at least two --vary: with one parameter all indices are 1. Use digiclay sweep."
        )
    members = _draw(arguments, subject)
    total = count_points(arguments.samples, count, second=second) * (1 + len(members.points))
    refuse_too_many("--samples", total)
    orders = "first, second" if second else "first"
    plan = {"samples": arguments.samples, "seed": arguments.seed, "orders": orders}
    if members.points:
        plan["uncertainty"] = [hash_points(members.points)]
    with Counted(sys.stderr, "study", "points read", quiet=arguments.quiet) as bar:
        shares = sample_shares(arguments.samples, count, arguments.seed, second=second)
        points = subject.make_points(shares, 1, bar)
        bundles = make_bundles(points)
        keys = (*subject.keys, *members.keys)
        rows = [(*point.words, *member.words) for point in points for member in members.points]
        repeated = place_points(subject.path, subject.settings, keys, rows, first=len(points) + 1)
        repeats = make_bundles(repeated)

    def evaluate(evaluation: Evaluation) -> None:
        if subject.evaluate_unchanged(evaluation, quiet=arguments.quiet):
            evaluation.finish(bundles.every, subject.keys)
            evaluation.finish(repeats.every, keys)
            if len(evaluation.records) == evaluation.total:
                evaluation.judge(find_ends(points, subject.keys), subject.keys)

    def write(records: dict[int, Record]) -> list[str]:
        lines = _write(arguments, subject, points, records)
        if members.points:
            table = list_bands(subject.names, len(points), len(members.points), records)
            write_whole(arguments.out / "bands.csv", format_csv(table).encode())
            lines += [f"bands.csv: {members.note}", *repeats.describe()]
        return [*lines, *bundles.describe(), f"written to {arguments.out}: start with study.md"]

    opened = subject.open_folder(arguments.out, "study", plan)
    return run_series(
        arguments, "study", total + 1, opened, evaluate, write, pieces=len(bundles.every)
    )


def _draw(arguments: Namespace, subject: Subject) -> Members:
    """Return the members at each point, or none without fitted files."""
    files = arguments.uncertain
    if not files:
        return Members([], [], "")
    sizes = arguments.members, arguments.seed
    members = draw_members(files, subject.path, subject.settings, *sizes)
    refuse_twice(subject.keys, [Setting(key, "", "--uncertain") for key in members.keys])
    return members


def list_bands(
    names: Sequence[str], points: int, members: int, records: Mapping[int, Record]
) -> Iterator[list[Any]]:
    """Give the rows of a table: both ends of the 95 % band of each output at each point, in SI units."""
    ends = product(names, ("low", "high"))
    yield ["point", *(f"{name} {end} ({FIGURES[name].unit})" for name, end in ends)]
    for point in range(1, points + 1):
        first = points + 1 + (point - 1) * members
        figures = [records[index].get("figures", {}) for index in range(first, first + members)]
        row: list[Any] = [point]
        for name in names:
            values = [each[name] for each in figures if each.get(name) is not None]
            row += find_band(values) or ["", ""]
        yield row


def _write(
    arguments: Namespace, subject: Subject, points: Sequence[Point], records: dict[int, Record]
) -> list[str]:
    """Write the files; return lines for a person."""
    from digiclay.plots.figure import save

    from .study_plots import draw_indices

    results = [records[point.index] for point in points]
    excess = find_excess_losses(results, records[UNCHANGED])
    responses: dict[str, Response] = {}
    notes = []
    for name in subject.names:
        try:
            responses[name] = make_response(name, results, excess)
        except OutputError as error:
            notes.append(str(error))
    if not responses:
        raise OutputError(notes[0])
    indices = {
        name: compute_indices(
            response.values, len(subject.ranges), arguments.seed, second=arguments.second
        )
        for name, response in responses.items()
    }
    unchanged = records[UNCHANGED]["figures"]
    findings = Findings(arguments, subject, describe_effort(records), unchanged, responses, indices)
    out = arguments.out
    subject.write_table(out / "points.csv", [subject.unchanged, *points], records, LOSS)
    write_whole(out / "indices.csv", format_index_table(findings).encode())
    save(draw_indices(subject.keys, indices, f"Sobol indices, {subject.scene.name}"), out / PICTURE)
    write_whole(out / "study.md", ("\n".join(list_page(findings)) + "\n").encode())
    return [*_summarize(findings), *notes, findings.effort]


def _format_call(arguments: Namespace, subject: Subject) -> str:
    """Return the command that repeats the study."""
    words = ["study", arguments.scene]
    words += [word for varied in arguments.vary for word in ("--vary", varied)]
    words += [word for key, value, _ in subject.settings for word in ("--set", f"{key}={value}")]
    words += ["--samples", str(arguments.samples), "--seed", str(arguments.seed)]
    words += ["--metric", ",".join(subject.names), *(["--second"] if arguments.second else [])]
    return format_command([*words, *list_options(arguments), "--out", str(arguments.out)])


class Findings(NamedTuple):
    """Results of a study."""

    arguments: Namespace
    subject: Subject
    #: What `evaluation.describe_effort` says.
    effort: str
    #: Outputs of the unchanged scene, None where it has none.
    unchanged: Mapping[str, float | None]
    responses: Mapping[str, Response]
    #: None for an output that does not vary.
    indices: Mapping[str, Indices | None]


def _summarize(findings: Findings) -> Iterator[str]:
    """Give one line per output: its parameters by total index."""
    keys = findings.subject.keys
    for name, indices in findings.indices.items():
        if indices is None:
            yield f"{name} does not vary"
            continue
        parts = (f"{keys[i]} {_format(indices, 'total', i)}" for i in _rank(indices["total"]))
        _, _, absent, lost = findings.responses[name]
        gaps = (
            f" ({absent} runs without a value, {lost} that lost the fingertip)"
            if absent + lost
            else ""
        )
        yield f"{name}: total indices {', '.join(parts)}{gaps}"


#: Of the table of the outputs.
HEAD = (
    "output",
    "unit",
    "unchanged scene",
    "mean",
    "standard deviation",
    "least",
    "largest",
    "without a value",
    "fingertip lost",
)


def format_index_table(findings: Findings) -> str:
    """Return all indices as CSV, with half the widths of their intervals; empty where there are none."""
    rows = [["output", "order", "parameter", "with", "index", f"interval ({CONFIDENCE:.0%}, +-)"]]
    keys = findings.subject.keys
    for name, indices in findings.indices.items():
        for order in ("first", "total"):
            for i, key in enumerate(keys):
                pair = [part[i] for part in indices[order]] if indices else ["", ""]
                rows.append([name, order, key, "", *pair])
        if indices and "second" in indices:
            for i, j in zip(*np.triu_indices(len(keys), 1), strict=True):
                pair = [part[i, j] for part in indices["second"]]
                rows.append([name, "second", keys[i], keys[j], *pair])
    return format_csv(rows)


def list_page(findings: Findings) -> Iterator[str]:
    """Give the lines of the page of a study in Markdown."""
    arguments, subject = findings.arguments, findings.subject
    yield f"# Sensitivity of {subject.scene.name}, digiclay {__version__}\n"
    yield f"    {_format_call(arguments, subject)}\n"
    yield (
        f"{arguments.samples} samples of Saltelli's design, seed {arguments.seed}. "
        "All values of a range are equally likely; on a logarithmic scale, equal ratios are. "
        f"With the unchanged scene, {findings.effort}.\n"
    )
    yield from _list_table(
        ("parameter", "range"), [(f"`{each.key}`", each) for each in subject.ranges], 2
    )
    yield "\n## Outputs\n"
    outputs = [
        _describe(findings.unchanged[name], each) for name, each in findings.responses.items()
    ]
    yield from _list_table(HEAD, outputs, 2)
    yield (
        "\n*Without a value* are runs that failed or to which the output does not apply. *Fingertip lost* "
        f"are other runs whose `{LOSS}` exceeds that of the unchanged scene by more than {ALLOWED:g}. Both "
        "enter the indices with the largest value of the remaining runs.\n"
    )
    yield "## Indices\n"
    yield (
        "The first-order index is the share of the variance of the output that the parameter causes alone, "
        "the total index the share it causes alone and by interactions. A total index near 0 means that the "
        "parameter has no effect on the output within its range. ± is half the width of the "
        f"{CONFIDENCE:.0%} interval, from resampling.\n"
    )
    yield f"![Indices]({PICTURE})\n"
    keys = subject.keys
    for name, indices in findings.indices.items():
        yield f"### `{name}`\n"
        if indices is None:
            yield "It does not vary.\n"
            continue
        rows = [
            [f"`{keys[i]}`", _format(indices, "first", i), _format(indices, "total", i)]
            for i in _rank(indices["total"])
        ]
        yield from _list_table(("parameter", "first order", "total"), rows)
        yield ""
        if "second" in indices:
            first, second = np.triu_indices(len(keys), 1)
            ranked = _rank(indices["second"], (first, second))
            pairs = zip(first[ranked], second[ranked], strict=True)
            rows = [
                [f"`{keys[i]}`, `{keys[j]}`", _format(indices, "second", (i, j))] for i, j in pairs
            ]
            yield from _list_table(("interaction of", "second order"), rows)
            yield ""


def _list_table(
    head: Sequence[str], rows: Sequence[Sequence[object]], texts: int = 1
) -> Iterator[str]:
    """Give the lines of a table in Markdown; the first `texts` columns are texts, all others numbers."""
    yield f"| {' | '.join(head)} |"
    yield f"|{' --- |' * texts}{' ---: |' * (len(head) - texts)}"
    yield from (f"| {' | '.join(map(str, row))} |" for row in rows)


def _describe(unchanged: float | None, response: Response) -> list[object]:
    """Return an output as a row of the table."""
    factor, unit = read_unit(FIGURES[response.name].unit, response.values)
    values = response.values * factor
    usual = "–" if unchanged is None else f"{unchanged * factor:.4g}"
    numbers = (
        f"{number:.4g}" for number in (values.mean(), values.std(), values.min(), values.max())
    )
    return [f"`{response.name}`", unit or "1", usual, *numbers, response.absent, response.lost]


def _rank(order: tuple[Floats, Floats], part: Any = slice(None)) -> list[int]:
    """Return the places of indices, the largest first."""
    return np.argsort(-order[0][part], kind="stable").tolist()


def _format(indices: Indices, order: str, row: Any) -> str:
    """Return an index and half its interval."""
    index, interval = (part[row] for part in indices[order])
    return f"{round(float(index), 2) + 0.0:.2f} ± {interval:.2f}"  # no minus before a zero
