"""``digiclay study``: Sobol indices of a scene's metrics over ranges of its parameters."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from digiclay import __version__
from digiclay.commands.arguments import add_command
from digiclay.commands.extras import format_command
from digiclay.commands.progress import Counted, format_duration
from digiclay.commands.stop import STOPPED, Stop, refuse_without
from digiclay.core.base.errors import OutputError
from digiclay.core.files.run_folder import write_whole
from digiclay.core.studies.axes import Point
from digiclay.core.studies.evaluation import Bundles, Record, make_bundles
from digiclay.core.studies.sweep_plan import Folder

from .index_page import Findings, format_index_table, format_page
from .indices import compute_indices, count_points, sample_shares
from .point_series import (
    UNCHANGED,
    Subject,
    add_subject,
    describe_stop,
    make_points,
    open_evaluation,
    open_folder,
    read_subject,
    refuse_too_many,
    write_points,
)
from .responses import LOSS, Response, find_excess_losses, make_response

EXAMPLES = """\
examples:
  digiclay study slow_press --vary control.force_gain=0.5:8:log --vary control.dead_band=1e-5:1e-4 --out which
  digiclay study my.toml --vary valve.stroke="20 um:40 um" --vary control.force_gain=1:6 --samples 128 \\
    --second --metric rfd,lag --out which

A design of N x (parameters + 2) runs, with --second N x (2 parameters + 2). The folder holds study.md
(start there), indices.csv, indices.png, points.csv with every run, and points/, a small file for each
finished run. After Ctrl-C the same command continues.
"""
METRICS = "rfd,lag,oscillation,relief"
PICTURE = "indices.png"
#: Largest number of samples.
MOST_SAMPLES = 4096


def add(commands: Any) -> None:
    """Add the command."""
    said = "Find which parameters matter: Sobol indices of metrics over ranges of parameters."
    parser = add_command(commands, "study", "find which parameters matter for which metric", EXAMPLES, said)
    add_subject(parser, METRICS)
    parser.add_argument(
        "--samples", metavar="N", type=_read_samples, default=64, help="a power of two; default: 64"
    )
    parser.add_argument("--second", action="store_true", help="indices of pairs of parameters, too")
    parser.set_defaults(carry_out=carry_out)


def _read_samples(text: str) -> int:
    """Read a number of samples."""
    number = int(text) if text.isdecimal() and len(text) < 10 else 0
    if not 4 <= number <= MOST_SAMPLES or number & (number - 1):
        rule = f"must be a power of two from 4 to {MOST_SAMPLES}, such as 64 or 128"
        raise argparse.ArgumentTypeError(f"{rule} (got {text!r})")
    return number


def carry_out(arguments: argparse.Namespace) -> int:
    """Run what is not done yet, and write tables, page and plot."""
    for module in ("SALib", "matplotlib"):
        refuse_without(module, "digiclay study", "pip install digiclay[study]")
    subject = read_subject(arguments)
    count, second = len(subject.ranges), arguments.second
    if count < 2:
        raise OutputError(
            "A study needs at least two --vary: of one parameter all indices are 1. Use digiclay sweep."
        )
    total = count_points(arguments.samples, count, second=second)
    refuse_too_many("--samples", total)
    plan = {
        "samples": arguments.samples,
        "seed": arguments.seed,
        "orders": "first, second" if second else "first",
    }
    with Counted(sys.stderr, "study", "points read") as bar:
        shares = sample_shares(arguments.samples, count, arguments.seed, second=second)
        points = make_points(subject, shares, 1, None if arguments.quiet else bar)
        bundles = make_bundles(points, errors=subject.errors)
    with open_folder(arguments.out, "study", subject, plan) as folder:
        with Stop() as stop:
            records = _evaluate(arguments, subject, folder, points, bundles, stop)
            if stop() and len(records) <= total:
                if not arguments.quiet:
                    print(describe_stop(folder.path, len(records), total + 1))
                return STOPPED
        lines = _write(arguments, subject, points, records)
        if not arguments.quiet:
            print(*lines, *bundles.describe(), f"written to {arguments.out}: start with study.md", sep="\n")
    return 0


def _evaluate(
    arguments: argparse.Namespace,
    subject: Subject,
    folder: Folder,
    points: Sequence[Point],
    bundles: Bundles,
    stop: Stop,
) -> dict[int, Record]:
    """Run the unchanged scene and the points that are not in the folder yet; return the records of all."""
    every = (*bundles.batches, *bundles.alone)
    with open_evaluation(
        arguments, "study", subject, folder, len(every), len(points) + 1, stop
    ) as evaluation:
        unchanged = evaluation.evaluate_unchanged()
        if unchanged is None:
            return evaluation.records
        left = len(points) + 1 - len(evaluation.records)
        if left and not arguments.quiet:
            each = unchanged["figures"]["run_time"]
            time = format_duration(left * each)
            print(
                f"{left} runs: about {time} of one core if each is run by itself, less in batches", flush=True
            )
        failed = evaluation.evaluate(every, subject.keys)
        return {**evaluation.records, **failed}


def _write(
    arguments: argparse.Namespace, subject: Subject, points: Sequence[Point], records: dict[int, Record]
) -> list[str]:
    """Write the files; return lines for a person."""
    from digiclay.plots.figure import save

    from .study_plots import draw_indices

    found = [records[point.index] for point in points]
    excess = find_excess_losses(found, records[UNCHANGED])
    responses: dict[str, Response] = {}
    notes = []
    for name in subject.names:
        try:
            responses[name] = make_response(name, found, excess)
        except OutputError as error:
            notes.append(str(error))
    if not responses:
        raise OutputError(notes[0])
    indices = {
        name: compute_indices(one.values, len(subject.ranges), arguments.seed, second=arguments.second)
        for name, one in responses.items()
    }
    findings = Findings(
        title=f"{subject.scene.name}, digiclay {__version__}",
        command=_format_call(arguments, subject),
        ranges=subject.ranges,
        samples=arguments.samples,
        points=len(points),
        seed=arguments.seed,
        second=arguments.second,
        unchanged=records[UNCHANGED]["figures"],
        responses=responses,
        indices=indices,
    )
    out: Path = arguments.out
    every = (Point(UNCHANGED, (), subject.scene), *points)
    write_points(out / "points.csv", subject, every, records, [LOSS])
    write_whole(out / "indices.csv", format_index_table(findings).encode())
    save(draw_indices(subject.keys, indices, f"Sobol indices, {subject.scene.name}"), out / PICTURE)
    write_whole(out / "study.md", format_page(findings, [PICTURE]).encode())
    return [*_summarize(findings), *notes]


def _format_call(arguments: argparse.Namespace, subject: Subject) -> str:
    """Return the command that repeats the study."""
    varied = [word for said in arguments.vary for word in ("--vary", said)]
    settings = [word for key, value, _ in subject.settings for word in ("--set", f"{key}={value}")]
    rest = [
        "--samples",
        str(arguments.samples),
        "--seed",
        str(arguments.seed),
        "--metric",
        ",".join(subject.names),
    ]
    second = ["--second"] if arguments.second else []
    return format_command(
        ["study", arguments.scene, *varied, *settings, *rest, *second, "--out", str(arguments.out)]
    )


def _summarize(findings: Findings) -> list[str]:
    """Return a line an output: its parameters by total index."""
    lines = []
    for name, found in findings.indices.items():
        if found is None:
            lines.append(f"{name} does not vary")
            continue
        order = sorted(range(len(findings.ranges)), key=lambda number: -found.total[number])
        parts = (
            f"{findings.ranges[i].key} {found.total[i]:.2f} ± {found.total_interval[i]:.2f}" for i in order
        )
        one = findings.responses[name]
        gaps = (
            f" ({one.absent} runs without a value, {one.lost} that lost the fingertip)"
            if one.absent + one.lost
            else ""
        )
        lines.append(f"{name}: total indices {', '.join(parts)}{gaps}")
    return lines
