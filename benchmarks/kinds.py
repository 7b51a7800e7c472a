"""Parser of all benchmarks."""

from __future__ import annotations

import argparse

from digiclay.commands.arguments import Help
from digiclay.commands.parser import Parser

from . import (
    ablation,
    bed_size,
    cluster_cost,
    commit_pair,
    made,
    mesh_export,
    method_figures,
    precision,
    runs_together,
    serve_times,
    session_parts,
    stiff,
    terms,
    ticks,
    viewport,
)

EXAMPLES = """\
examples:
  python -m benchmarks session        time of a control period, part by part
  python -m benchmarks stiff          errors in stiff and extreme cases
  python -m benchmarks precision      error over run time, beside SciPy
  python -m benchmarks terms tap      cost and effect of each part of the model
  python -m benchmarks scale          a control period from 625 pins to a million
  python -m benchmarks stack          sessions a second, alone and in a batch
  python -m benchmarks cluster        overhead of a Dask cluster, one worker against two
  python -m benchmarks export         mesh files of beds from 625 pins to a million
  python -m benchmarks viewport       a tick of a live session in Blender
  python -m benchmarks ticks          how the time of a tick is distributed
  python -m benchmarks serve          deadlines of a session for other programs at 1 kHz
  python -m benchmarks methods        force deviation of Methods I and III over paths and drags
  python -m benchmarks ablation       Method III with one of its parts left out at a time
  python -m benchmarks commits main   a control period at another commit and at this one
  python -m benchmarks made           things formed by recorded strokes, beside what was intended
"""


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
    for kind in (
        session_parts, stiff, precision, terms, bed_size, mesh_export, viewport, ticks, runs_together, made,
        cluster_cost, serve_times, method_figures, ablation, commit_pair,
    ):  # fmt: skip
        kind.add(kinds)
    return top
