"""Errors of `digiclay serve` and `python -m benchmarks serve` are one line, and nothing is left behind."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest

from benchmarks.processes import ENDS, sum_bins
from tests.scene_files import left

SMALL = ["--set", "layout.rows=3", "--set", "layout.columns=3", "--set", "control=absent"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--rate 0", "must be from 1 to 1000 Hz"),
        ("--rate nan", "must be from 1 to 1000 Hz"),
        ("--rate 1e9", "must be from 1 to 1000 Hz"),
        ("--port 65536", "must be a port from 0 to 65535"),
        ("--port -1", "must be a port from 0 to 65535"),
        ("--osc-port x", "must be a port from 0 to 65535"),
        ("--token short", "--token must have 8 to 128"),
        ("--most-force 0", "must be from 0.001 to 1000 N"),
        ("--most-speed inf", "must be from 1 to 10000 mm/s"),
        ("--part 0", "must be from 0.1 to 600 s"),
        ("--seconds inf", "must be from 0 to 1e+09 s"),
        ("--tokn x", "Did you mean --token (not --tokn)?"),
        ("--report missing/report.json --out .", "holds other things"),
        ("missing.toml", "missing.toml"),
    ],
)
def test_a_wrong_option_is_refused_in_one_line(words: str, message: str, here: Path, refused: Any) -> None:
    refused(["serve", "--seconds", "0", *words.split()], message)
    assert left(here) == []


def test_what_cannot_be_opened_is_told_in_a_line(here: Path, refused: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        command = ["serve", *SMALL, "--osc-port", "0", "--port", port, "--out", "take"]
        refused(command, f"Port {port} of 127.0.0.1 cannot be opened: ")
    assert left(here) == []


def test_the_times_of_the_benchmark_are_summed_below_each_end() -> None:
    bins = [(0.0, 1), (0.00024, 2), (0.00025, 4), (0.00099, 8), (0.001, 16), (0.2, 32)]
    assert sum_bins(bins, ENDS) == [3, 4, 0, 8, 16, 0, 0, 0, 0, 32]
