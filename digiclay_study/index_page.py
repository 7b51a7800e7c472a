"""Table and page of a sensitivity study."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from digiclay.core.studies.evaluation import FIGURES
from digiclay.plots.sweep import read_unit

from .indices import CONFIDENCE, Indices
from .point_series import Range
from .responses import ALLOWED, LOSS, Response

#: Of the table of the outputs.
HEAD = (
    "output", "unit", "unchanged scene", "mean", "standard deviation", "least", "largest", "without a value",
    "fingertip lost",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Findings:
    """Results of a study.

    Attributes
    ----------
    title : str
        Scene and version.
    command : str
        By which the study is repeated.
    second : bool
        Whether there are second-order indices.
    unchanged : mapping
        Outputs of the unchanged scene, None where it has none.
    indices : mapping of str to Indices or None
        None for an output that does not vary.
    """

    title: str
    command: str
    ranges: tuple[Range, ...]
    samples: int
    points: int
    seed: int
    second: bool
    unchanged: Mapping[str, float | None]
    responses: Mapping[str, Response]
    indices: Mapping[str, Indices | None]


def format_index_table(findings: Findings) -> str:
    """Return all indices as CSV, with half the widths of their intervals; empty where there are none."""
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(["output", "order", "parameter", "with", "index", f"interval ({CONFIDENCE:.0%}, +-)"])
    keys = [one.key for one in findings.ranges]
    for name, found in findings.indices.items():
        for order, kind in (("first", "first"), ("total", "total")):
            for number, key in enumerate(keys):
                pair = ("", "")
                if found is not None:
                    pair = (
                        repr(float(getattr(found, kind)[number])),
                        repr(float(getattr(found, f"{kind}_interval")[number])),
                    )
                writer.writerow([name, order, key, "", *pair])
        if findings.second and found is not None:
            for i, j in zip(*np.triu_indices(len(keys), 1), strict=True):
                pair = (repr(float(found.second[i, j])), repr(float(found.second_interval[i, j])))
                writer.writerow([name, "second", keys[i], keys[j], *pair])
    return lines.getvalue()


def format_page(findings: Findings, pictures: Sequence[str]) -> str:
    """Return the page of a study in Markdown. `pictures`: files beside it."""
    return "\n".join(_write(findings, pictures)) + "\n"


def _write(findings: Findings, pictures: Sequence[str]) -> Iterator[str]:
    yield f"# Sensitivity of {findings.title}\n"
    yield f"    {findings.command}\n"
    yield (
        f"{findings.points} runs: {findings.samples} samples of Saltelli's design, seed {findings.seed}. "
        "All values of a range are equally likely; on a logarithmic scale, equal ratios are.\n"
    )
    yield "| parameter | range |"
    yield "| --- | --- |"
    yield from (f"| `{one.key}` | {one} |" for one in findings.ranges)
    yield "\n## Outputs\n"
    yield f"| {' | '.join(HEAD)} |"
    yield f"| --- | --- |{' ---: |' * (len(HEAD) - 2)}"
    yield from (_describe(findings.unchanged[name], one) for name, one in findings.responses.items())
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
    yield from (f"![Indices]({name})\n" for name in pictures)
    keys = [one.key for one in findings.ranges]
    for name, found in findings.indices.items():
        yield f"### `{name}`\n"
        if found is None:
            yield "It does not vary.\n"
            continue
        yield "| parameter | first order | total |"
        yield "| --- | ---: | ---: |"
        for i in np.argsort(-found.total, kind="stable"):
            first, total = (
                _pair(found.first[i], found.first_interval[i]),
                _pair(found.total[i], found.total_interval[i]),
            )
            yield f"| `{keys[i]}` | {first} | {total} |"
        yield ""
        if findings.second:
            yield from _write_pairs(keys, found)


def _describe(unchanged: float | None, one: Response) -> str:
    """Return an output as a row of the table."""
    factor, unit = read_unit(FIGURES[one.name].unit, one.values)
    values = one.values * factor
    usual = "–" if unchanged is None else f"{unchanged * factor:.4g}"
    numbers = (values.mean(), values.std(), values.min(), values.max())
    middle = " | ".join(f"{number:.4g}" for number in numbers)
    return f"| `{one.name}` | {unit or '1'} | {usual} | {middle} | {one.absent} | {one.lost} |"


def _write_pairs(keys: Sequence[str], found: Indices) -> Iterator[str]:
    """Give the second-order indices, the largest first."""
    yield "| interaction of | second order |"
    yield "| --- | ---: |"
    rows, columns = np.triu_indices(len(keys), 1)
    for number in np.argsort(-found.second[rows, columns], kind="stable"):
        i, j = rows[number], columns[number]
        yield f"| `{keys[i]}`, `{keys[j]}` | {_pair(found.second[i, j], found.second_interval[i, j])} |"
    yield ""


def _pair(index: float, interval: float) -> str:
    return f"{round(index, 2) + 0.0:.2f} ± {interval:.2f}"  # no minus before a zero
