"""The benchmarks in one table, their parser, and what runs them."""

import argparse
import io
import sys
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from digiclay.commands.arguments import (
    Help,
    Options,
    add_command,
    add_options,
    add_scene,
    whole_number,
)
from digiclay.commands.parser import Parser
from digiclay.commands.refusals import refuse_unwritable, refuse_without, refuse_without_blender
from digiclay.commands.stop import FAILED
from digiclay.core.base.errors import OutputError

from .report import Report, Steps

#: The paper's session.
PAPER = "ridge_mound_valley"
#: Packages that benchmarks need, and the extra that has them.
EXTRAS = {"scipy": "suite", "websockets": "serve"}
EXAMPLES = """\
examples:
  python -m benchmarks session
  python -m benchmarks terms tap --quick
  python -m benchmarks scale --out results
"""


@dataclass(frozen=True)
class Benchmark:
    """Benchmark of the table."""

    measure: str
    """Module and function ``(arguments, steps) -> Report``, or list of reports; imported when it runs."""
    help: str
    examples: tuple[str, ...] = ("", "--quick --out results")
    """Arguments."""
    options: Options = field(default_factory=dict)
    """Beside SCENE and `OPTIONS`."""
    scene: str | None = None
    """Default of --scene; empty: SCENE must be named; None: it takes no scene."""
    needs: str = ""
    """Package without which it cannot run, and whose version is given."""


def _read_folder(text: str) -> Path:
    """Read the name of a folder to write into; what would fail after the work is refused before it."""
    try:
        refuse_unwritable(Path(text))
    except OutputError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None
    return Path(text)


#: Options of all.
OPTIONS: Options = {
    "--quick": "fewer and shorter runs",
    "--quiet": "no progress",
    "--out DIR": (_read_folder, "also write the results into this folder"),
}
BENCHMARKS = {
    "session": Benchmark(
        "session_parts.measure",
        "time of one session and of its parts, on one core",
        ("", "--scene tap --repeats 9", "--calls"),
        {
            "--repeats N": (
                whole_number(1, 1000),
                "number of runs, of which the median counts; default: 3",
                3,
            ),
            "--calls": "count numpy's calls",
        },
        PAPER,
    ),
    "stiff": Benchmark(
        "stiff.measure",
        "errors of the steppers in stiff and extreme cases",
        ("", "--full --out results"),
        {"--full": "also the adaptive stepper, which takes longer than all others"},
    ),
    "peers": Benchmark(
        "pinbench.run.measure",
        "engines on eight problems, by their adapters: error against run time",
        ("", "mine.py --out results"),
        {
            "files FILE": {
                "nargs": "*",
                "help": "more adapters: Python files, see benchmarks/README.md",
            },
            "--make-references": "make the references of the problems again, instead (10 minutes)",
        },
        needs="scipy",
    ),
    "fit": Benchmark(
        "fit_coverage.measure",
        "how often intervals of digiclay fit contain the truth, and what it refuses by name",
        needs="scipy",
    ),
    "terms": Benchmark(
        "session_parts.measure_terms",
        "cost and effect of each part of the model",
        ("tap", "ridge_mound_valley --out results"),
        scene="",
    ),
    "scale": Benchmark("bed_size.measure", "a control period from 625 pins to a million"),
    "export": Benchmark(
        "bed_size.measure_export", "writing a bed as a mesh, from 625 pins to a million"
    ),
    "viewport": Benchmark(
        "tick_times.measure_viewport",
        "a tick of a live session in Blender, part by part (needs bpy)",
        needs="bpy",
    ),
    "ticks": Benchmark(
        "tick_times.measure",
        "how the time of a tick of a live session is distributed (needs bpy)",
        needs="bpy",
    ),
    "stack": Benchmark(
        "runs_together.measure",
        "sessions a second, one at a time and many in one call",
        scene=PAPER,
    ),
    "serve": Benchmark(
        "processes.measure_serve",
        "deadlines of digiclay serve, and poses to pins, with a client",
        ("", "--fingers 10 --rate 200"),
        {
            "--rate HZ": (whole_number(1, 1000), "control periods a second; default: 1000", 1000),
            "--fingers N": (
                whole_number(1, 10),
                "fingertips, those of a hand side by side; default: 1",
                1,
            ),
        },
        needs="websockets",
    ),
    "several_fingers": Benchmark(
        "several_fingers.measure", "what several fingertips cost, and two near each other feel"
    ),
    "hand": Benchmark(
        "yielding_hands.measure", "the methods under prescribed paths and under yielding hands"
    ),
    "zoo": Benchmark("zoo.measure", "published figures of pin displays beside simulated ones"),
    "kernels": Benchmark(
        "kernels.measure",
        "sessions on other kernels of numpy's library: what the last bit changes",
        ("--quick", "--python other/bin/python --out results"),
        {
            "--python FILE": {
                "action": "append",
                "default": [],
                "help": "also this Python, with its numpy",
            }
        },
    ),
    "figures": Benchmark(
        "figures.measure",
        "figures of the pages beside those of now; exit code 1 where one is stale",
        ("", "docs/accuracy.md --quick"),
        {"page PAGE": {"nargs": "?", "help": "one page; default: all"}},
    ),
    "commits": Benchmark(
        "processes.measure_commits",
        "time of a control period at two commits",
        ("v0.1.0", "v0.1.0 main --turns 9"),
        {
            "old": {"help": "commit, branch or tag"},
            "new": {"nargs": "?", "default": "HEAD", "help": "another one, by default HEAD"},
            "--turns N": (int, "runs of each commit, default 5", 5),
        },
    ),
}


def parser() -> argparse.ArgumentParser:
    """Return the parser of all benchmarks."""
    top = Parser(
        prog="python -m benchmarks",
        description="Measure cost, error and stability.",
        epilog=EXAMPLES,
        formatter_class=Help,
        allow_abbrev=False,
    )
    kinds = top.add_subparsers(
        title="benchmarks", metavar="WHAT", required=True, parser_class=Parser
    )
    for name, benchmark in BENCHMARKS.items():
        examples = "\n".join(
            f"  python -m benchmarks {name} {words}".rstrip() for words in benchmark.examples
        )
        command = add_command(kinds, name, benchmark.help, f"examples:\n{examples}\n")
        if benchmark.scene is not None:
            add_scene(command, benchmark.scene)
        add_options(command, {**benchmark.options, **OPTIONS})
        command.set_defaults(carry_out=partial(run, name))
    return top


def run(name: str, arguments: argparse.Namespace) -> int:
    """Run a benchmark, print its reports, and write them with ``--out``."""
    benchmark = BENCHMARKS[name]
    if benchmark.needs == "bpy":
        refuse_without_blender()
    elif benchmark.needs:
        refuse_without(f"python -m benchmarks {name}", EXTRAS[benchmark.needs], benchmark.needs)
    module, _, function = benchmark.measure.rpartition(".")
    measure: Any = getattr(import_module(f"{__package__}.{module}"), function)
    with Steps(io.StringIO() if arguments.quiet else sys.stderr, name) as steps:
        reports: Report | list[Report] = measure(arguments, steps)
    reports = reports if isinstance(reports, list) else [reports]
    for report in reports:
        text = report.text(benchmark.needs)
        print(text)
        if arguments.out is not None:
            report.write(arguments.out, report.name or name, text)
    return FAILED if any(report.failed for report in reports) else 0
