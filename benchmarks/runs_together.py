"""``python -m benchmarks stack``: sessions a second, alone and in a batch."""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from digiclay.commands.arguments import add_scene, scene_of
from digiclay.core.batch.run_together import measure_together, run_together
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run
from digiclay.core.studies.evaluation import evaluate
from digiclay.plots.figure import empty

from .plots import STYLE, write
from .report import add_kind, kept, made_with, progress, table

#: Runs in one call; a sweep puts 32 to 63 together.
COUNTS = (1, 4, 16, 32, 64, 128)
#: Simulated time of a run, s.
DURATION = 4.0
#: Time between two measurements, s: the linear algebra library keeps its threads busy for a while.
REST = 0.15
#: What varies from run to run: section, key, and from which to which share of its value. The first leaves the
#: cells alike, the second does not.
STUDIES: dict[str, tuple[str, str, float, float]] = {
    "control": ("control", "force_gain", 0.5, 1.2),
    "device": ("valve", "stroke", 0.9, 1.2),
}


@dataclass(frozen=True)
class Size:
    """CPU time of a run, alone and in a batch of one size, s.

    Attributes
    ----------
    alone, stacked : float
        Simulated only.
    judged_alone, judged_stacked : float
        Recorded and judged, as in a sweep.
    errors_alone, errors_stacked : float
        The same with the integration's errors estimated, as in a sweep that is asked for them.
    """

    study: str
    runs: int
    alone: float
    stacked: float
    judged_alone: float
    judged_stacked: float
    errors_alone: float
    errors_stacked: float


def study(scene: Scene, name: str, count: int) -> list[Scene]:
    """Return the runs of a study: a parameter of the scene spread evenly.

    `name`: key of `STUDIES`; `count`: runs.
    """
    section, key, low, high = STUDIES[name]
    part: Any = scene.section(section)
    shares = [low + (high - low) * (i + 0.5) / count for i in range(count)]
    return [scene.with_sections(**{section: replace(part, **{key: getattr(part, key) * s})}) for s in shares]


def _spent(work: Callable[[], Any]) -> float:
    """Return the CPU time of some work, s, once what was before it has come to rest."""
    time.sleep(REST)
    started = time.process_time()
    work()
    return time.process_time() - started


def measured(scene: Scene, name: str, count: int, repeats: int) -> Size:
    """Run a study of so many runs; the medians of the repeats count.

    One run alone and all in one call take turns, so that what else the machine does befalls both alike.

    `name`: key of `STUDIES`; `count`: runs of the study.
    """
    scenes = study(scene, name, count)
    plain = study(replace(scene, recorder=None), name, count)
    one, middle = scenes[count // 2], plain[count // 2]
    works: list[tuple[Callable[[], Any], int]] = [
        (lambda: run(middle), 1),
        (lambda: list(run_together(plain)), count),
        (lambda: evaluate(one), 1),
        (lambda: list(measure_together(scenes)), count),
        (lambda: evaluate(one, errors=True), 1),
        (lambda: list(measure_together(scenes, errors=True)), count),
    ]
    spent = [[_spent(work) / runs for work, runs in works] for _ in range(repeats)]
    return Size(name, count, *(statistics.median(column) for column in zip(*spent, strict=True)))


def add(kinds: Any) -> None:
    """Add the benchmark."""
    examples = "  python -m benchmarks stack\n  python -m benchmarks stack --quick --out results\n"
    parser = add_kind(kinds, "stack", "sessions a second, one at a time and many in one call", examples)
    add_scene(parser, default="ridge_mound_valley")
    parser.set_defaults(carry_out=carry_out)


def carry_out(arguments: argparse.Namespace) -> int:
    """Measure every study and size, and print the table."""
    scene, _ = scene_of(arguments)
    lasts = min(scene.simulation.duration, 1.0 if arguments.quick else DURATION)
    scene = replace(scene, simulation=replace(scene.simulation, duration=lasts))
    counts, repeats = (COUNTS[:3], 1) if arguments.quick else (COUNTS, 5)
    with progress(arguments, "stack", len(STUDIES) * len(counts)) as bar:
        sizes = []
        for name in STUDIES:
            for count in counts:
                sizes.append(measured(scene, name, count, repeats))
                bar(f"{count} runs")
    text = "\n".join(_text(scene, sizes))
    print(text)
    head = [field.name for field in fields(Size)]
    kept(arguments.out, "stack", text, head, [[getattr(one, name) for name in head] for one in sizes])
    if arguments.out:
        _draw(sizes, arguments.out / "stack.png")
    return 0


def _draw(sizes: Sequence[Size], out: Path) -> Path:
    """Draw how many times the runs a second a stack comes to, over its runs, and return the path."""
    with empty(6.0, 3.6, STYLE, layout="constrained") as figure:
        panel = figure.subplots()
        for study, color, marker in (("control", "#0072B2", "o"), ("device", "#D55E00", "s")):
            own = [one for one in sizes if one.study == study]
            runs = [one.runs for one in own]
            for gains, line, label in (
                ([one.alone / one.stacked for one in own], "-", "simulated"),
                ([one.judged_alone / one.judged_stacked for one in own], "--", "recorded and judged"),
                ([one.errors_alone / one.errors_stacked for one in own], ":", "errors estimated too"),
            ):
                panel.loglog(
                    runs, gains, line, color=color, marker=marker,
                    markerfacecolor=color if line == "-" else "white", label=f"{study} varies, {label}",
                )  # fmt: skip
        panel.axhline(6.0, color="#777777", linewidth=1.0, label="the goal")
        panel.set_xticks(runs, [str(count) for count in runs])
        panel.set_yticks([1, 2, 4, 6, 10, 20], ["1", "2", "4", "6", "10", "20"])
        panel.minorticks_off()
        panel.set_xlabel("runs in one call")
        panel.set_ylabel("runs a second, to one at a time")
        panel.set_title("Many sessions in one call")
        panel.legend(loc="lower right", fontsize=8.5)
        return write(figure, out)


def _text(scene: Scene, sizes: Sequence[Size]) -> Iterator[str]:
    """Give the lines of the report."""
    yield made_with()
    yield f"\nThe first {scene.simulation.duration:g} s of {scene.name}: {scene.periods} control periods,"
    yield f"{scene.cells} cells; CPU time of one core, runs a second; medians, taken in turns."
    yield "judged: recorded and judged, as digiclay sweep does;"
    yield "errors: the integration's errors estimated as well."
    three = ("alone", "in one call", "times")
    head = ("runs", *three, "judged: alone", *three[1:], "errors: alone", *three[1:])
    for name, (section, key, _, _) in STUDIES.items():
        yield f"\n{section}.{key} varies"
        yield from table(head, [_row(one) for one in sizes if one.study == name], left=0)


def _row(one: Size) -> list[str]:
    """Return a line of the table."""
    row = [str(one.runs)]
    for alone, stacked in (
        (one.alone, one.stacked),
        (one.judged_alone, one.judged_stacked),
        (one.errors_alone, one.errors_stacked),
    ):
        row += [f"{1.0 / alone:.3g}", f"{1.0 / stacked:.3g}", f"{alone / stacked:.1f}"]
    return row
