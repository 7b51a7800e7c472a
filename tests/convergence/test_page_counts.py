"""Figures of README, performance and batches that are counts, or depend on one: none is stale unseen."""

import statistics
import sys
from collections import deque
from functools import partial
from itertools import islice

import pytest
from digiclay.core.batch.play import begin_play, play_all
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.session.run_scene import run

from benchmarks import bed_size, several_fingers
from benchmarks.runs_together import study
from benchmarks.session_parts import period_calls
from tests.assemble import sample

PAPER = "ridge_mound_valley"
#: Parts of which the page leaves out one, or all.
ABSENT = ("conduit=absent", "valve_lag=absent", "relaxation=absent", "delay=absent")
#: Control periods that are counted: the fingertip has come down after 200.
COUNT = 300


def count_numpy_calls(*settings):
    """Return the numpy calls of a control period of the paper's session, the median."""
    scene = sample(PAPER, *settings)
    return statistics.median(period_calls(assemble(scene), scene.trajectories(), COUNT)[0])


def count_calls(states, count=COUNT):
    """Return the function calls of one of some control periods, the mean of the latter half."""
    calls, first = 0, count // 2

    def note(frame, event, called):
        nonlocal calls
        calls += event in ("call", "c_call")

    deque(islice(states, first), maxlen=0)
    sys.setprofile(note)
    try:
        deque(islice(states, count - first), maxlen=0)
    finally:
        sys.setprofile(None)
    return calls / (count - first)


def compare_ten_fingers(method):
    """Return the function calls of a control period of ten fingertips that press, to those of one."""
    depth, calls = several_fingers.PRESSED if method else 39.0, []
    for fingers in (1, 10):
        places = several_fingers.PLACES[:fingers]
        ways = [
            [(0.0, x, y, 41.0), (0.3, x, y, depth), (3.0, x + 10, y + 3, depth)] for x, y in places
        ]
        scene = several_fingers.make_scene(method, ways, 25)
        system = assemble(scene)
        calls.append(count_calls(periods(system, scene.trajectories(), begin(system), COUNT)))
    return calls[1] / calls[0]


def compare_batch(varied):
    """Return the function calls of a control period of a batch of 64 runs, to those of one run alone."""
    scene = sample(PAPER, "recorder=absent")
    system = assemble(scene)
    alone = count_calls(periods(system, scene.trajectories(), begin(system), COUNT))
    scenes = dict(enumerate(study(scene, varied, 64)))
    play = begin_play(scenes, {run: assemble(one) for run, one in scenes.items()})
    return count_calls(play_all(play, dict.fromkeys(scenes, COUNT), None)) / alone


def count_active_cells():
    """Return the active cells of a control period on a bed of 625 pins, the mean of a press and a drag."""
    bed = bed_size.scene(25)
    system = assemble(bed)
    states = periods(system, bed.trajectories(), begin(system), bed.periods)
    return statistics.mean(state.active.cells.size for state in states)


def count_bytes_of_history():
    """Return the bytes of a pin in a row of a history."""
    history = run(sample("tap", "simulation.duration=0.1")).history
    rows, pins = history["height"].shape
    return sum(table.nbytes for table in history.values() if table.shape == (rows, pins)) / (
        rows * pins
    )


def count_bytes_of_pin(*settings):
    """Return the bytes of a pin in the state of the paper's session."""
    return 8.0 * assemble(sample(PAPER, *settings)).rows.count


#: What is counted, the figure of the page or one on which it depends, and the share that it may be
#: off: exact without one; else a call more or less is no other figure.
FIGURES = {
    "README: control periods": (lambda: sample(PAPER).periods, 5300, 0.0),
    "performance: cells": (lambda: sample(PAPER).cells, 625, 0.0),
    "performance: numpy calls without control": (
        partial(count_numpy_calls, "control=absent"),
        74,
        0.05,
    ),
    "with force noise": (partial(count_numpy_calls, "sensors.force_noise=2 mN"), 126, 0.05),
    "of Method II": (partial(count_numpy_calls, "control.method=cell_states"), 181, 0.05),
    "without valve lag": (partial(count_numpy_calls, ABSENT[1]), 154, 0.05),
    "without all parts": (partial(count_numpy_calls, *ABSENT), 111, 0.05),
    "performance: bytes of a pin": (count_bytes_of_pin, 72, 0.0),
    "bytes without valve lag": (partial(count_bytes_of_pin, ABSENT[1]), 64, 0.0),
    "bytes without relaxation": (partial(count_bytes_of_pin, ABSENT[2]), 48, 0.0),
    "performance: active cells": (count_active_cells, 150, 0.01),
    "performance: bytes of a pin in a row of a history": (count_bytes_of_history, 25, 0.0),
    "performance: ten fingertips to one, no control": (partial(compare_ten_fingers, ""), 1.6, 0.1),
    "ten with Method I": (partial(compare_ten_fingers, "virtual_master"), 4.9, 0.1),
    "ten with Method II": (partial(compare_ten_fingers, "cell_states"), 9.1, 0.1),
    "ten with Method III": (partial(compare_ten_fingers, "hybrid"), 7.4, 0.1),
    "batches: 64 runs to one, control": (partial(compare_batch, "control"), 2.6, 0.1),
    "64 runs to one, device": (partial(compare_batch, "device"), 2.5, 0.1),
}


@pytest.mark.parametrize("name", FIGURES)
def test_a_count_on_which_a_figure_of_a_page_depends_is_what_it_was(name):
    count, figure, off = FIGURES[name]
    assert count() == pytest.approx(figure, rel=off, abs=0)
