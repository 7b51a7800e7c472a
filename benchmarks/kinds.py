"""The benchmarks in one table, their parser, and what runs them."""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from digiclay.commands.arguments import Help, add_command, add_scene
from digiclay.commands.parser import Parser
from digiclay.commands.stop import refuse_unwritable, refuse_without, refuse_without_blender
from digiclay.core.base.errors import OutputError

from .report import Report, Steps

Options = Callable[[argparse.ArgumentParser], object]

#: Recorded strokes of the made things.
STROKES = Path(__file__).parent / "strokes"
#: Packages that benchmarks need, and the extra that has them.
EXTRAS = {"distributed": "cluster", "scipy": "suite", "websockets": "serve"}
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
    options: Options = lambda parser: None
    needs: str = ""
    """Package without which it cannot run, and whose version is given."""
    quick: bool = True
    out: bool = True
    """Whether it has these options."""


def _add_session(parser: argparse.ArgumentParser) -> None:
    add_scene(parser, default="ridge_mound_valley")
    parser.add_argument(
        "--repeats", metavar="N", type=_read_repeats, default=3,
        help="number of runs, of which the median counts; default: 3",
    )  # fmt: skip
    parser.add_argument("--calls", action="store_true", help="count numpy's calls")


def _read_repeats(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"must be a whole number from 1 to 1000 (got {text!r})")
    return int(text)


def _flag(name: str, help: str) -> Options:
    return lambda parser: parser.add_argument(name, action="store_true", help=help)


def _add_made(parser: argparse.ArgumentParser) -> None:
    names = ", ".join(sorted(path.stem for path in STROKES.glob("*.toml")))
    parser.add_argument("things", nargs="*", metavar="THING", help=names)
    parser.add_argument("--bed", metavar="BED", help="a size of beds; default: that of the strokes' file")
    parser.add_argument("--pictures", metavar="FOLDER", type=Path, help="also draw them, formed and intended")


def _add_commits(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("old", help="commit, branch or tag")
    parser.add_argument("new", nargs="?", default="HEAD", help="another one, by default HEAD")
    parser.add_argument("--turns", type=int, default=5, metavar="N", help="runs of each commit, default 5")


BENCHMARKS = {
    "session": Benchmark(
        "session_parts.measure", "time of one session and of its parts, on one core",
        ("", "--scene tap --repeats 9", "--calls"), _add_session, quick=False, out=False,
    ),
    "stiff": Benchmark(
        "stiff.measure", "errors of the steppers in stiff and extreme cases", ("", "--full --out results"),
        _flag("--full", "also the adaptive stepper, which takes longer than all others"),
    ),
    "precision": Benchmark(
        "precision.measure",
        "error against run time, beside SciPy's solvers",
        ("--quick", "--out results", "--whole-bed --out results"),
        _flag("--whole-bed", "also peers that integrate all cells, on the paper's bed (11 minutes more)"),
        needs="scipy",
    ),
    "terms": Benchmark(
        "session_parts.measure_terms", "cost and effect of each part of the model",
        ("tap", "ridge_mound_valley --out results"), add_scene,
    ),
    "scale": Benchmark("bed_size.measure", "a control period from 625 pins to a million"),
    "export": Benchmark("bed_size.measure_export", "writing a bed as a mesh, from 625 pins to a million"),
    "viewport": Benchmark(
        "tick_times.measure_viewport", "a tick of a live session in Blender, part by part (needs bpy)",
        needs="bpy",
    ),
    "ticks": Benchmark(
        "tick_times.measure", "how the time of a tick of a live session is distributed (needs bpy)",
        needs="bpy",
    ),
    "stack": Benchmark(
        "runs_together.measure", "sessions a second, one at a time and many in one call",
        options=partial(add_scene, default="ridge_mound_valley"),
    ),
    "made": Benchmark(
        "made.measure", "things formed by recorded strokes, beside the intended relief (needs bpy)",
        ("", "letter_a --bed paper", "leaf face --pictures made"), _add_made, needs="bpy",
    ),
    "cluster": Benchmark(
        "processes.measure_cluster", "overhead of a Dask cluster, one worker and two", needs="distributed"
    ),
    "serve": Benchmark(
        "processes.measure_serve", "deadlines of digiclay serve at 1 kHz, with a client", needs="websockets"
    ),
    "methods": Benchmark(
        "method_figures.measure", "force deviation of Method III in fast drags and on other devices"
    ),
    "ablation": Benchmark(
        "method_figures.measure_ablation", "Method III with one part left out at a time",
        ("", "--part skirt"),
        lambda parser: parser.add_argument("--part", metavar="P", help="a row of the table, such as skirt"),
    ),
    "commits": Benchmark(
        "processes.measure_commits", "time of a control period at two commits",
        ("v0.1.0", "v0.1.0 main --turns 9"), _add_commits,
    ),
}  # fmt: skip


def parser() -> argparse.ArgumentParser:
    """Return the parser of all benchmarks."""
    top = Parser(
        prog="python -m benchmarks",
        description="Measure cost, error and stability.",
        epilog=EXAMPLES,
        formatter_class=Help,
        allow_abbrev=False,
    )
    kinds = top.add_subparsers(title="benchmarks", metavar="WHAT", required=True, parser_class=Parser)
    for name, benchmark in BENCHMARKS.items():
        examples = "\n".join(
            f"  python -m benchmarks {name} {words}".rstrip() for words in benchmark.examples
        )
        command = add_command(kinds, name, benchmark.help, f"examples:\n{examples}\n")
        benchmark.options(command)
        if benchmark.quick:
            command.add_argument("--quick", action="store_true", help="fewer and shorter runs")
        command.add_argument("--quiet", action="store_true", help="no progress")
        if benchmark.out:
            command.add_argument(
                "--out", metavar="DIR", type=_read_folder, help="also write the results into this folder"
            )
        command.set_defaults(carry_out=partial(run, name), quick=False, out=None)
    return top


def _read_folder(text: str) -> Path:
    """Read the name of a folder to write into; what would fail after the work is refused before it."""
    try:
        refuse_unwritable(Path(text))
    except OutputError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None
    return Path(text)


def run(name: str, arguments: argparse.Namespace) -> int:
    """Run a benchmark, print its reports, and write them with ``--out``."""
    benchmark = BENCHMARKS[name]
    if benchmark.needs == "bpy":
        refuse_without_blender()
    elif benchmark.needs:
        refuse_without(f"python -m benchmarks {name}", EXTRAS[benchmark.needs], benchmark.needs)
    module, _, function = benchmark.measure.partition(".")
    measure: Any = getattr(import_module(f"{__package__}.{module}"), function)
    with Steps(io.StringIO() if arguments.quiet else sys.stderr, name) as steps:
        reports: Report | list[Report] = measure(arguments, steps)
    for report in reports if isinstance(reports, list) else [reports]:
        text = report.text(benchmark.needs)
        print(text)
        if arguments.out is not None:
            report.write(arguments.out, report.name or name, text)
    return 0
