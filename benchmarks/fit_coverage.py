"""Benchmark ``fit``: how often 95 % intervals of `digiclay fit` contain the truth of synthetic devices."""

import argparse
import itertools
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import digiclay
import numpy as np
from digiclay.core.base.arrays import Floats

from digiclay_fit.records import Trial
from digiclay_fit.verdicts import Findings, fit

from .report import Report, Row, Steps, tabulate
from .synthetic_devices import Cell, Finger, command_at_random, press_at

#: Devices of each kind, and repeats of what cannot be known; noise of force, N, and height, m; samples
#: per second of force and height.
DEVICES, QUICK, REPEATS = 300, 10, 10
FORCE_NOISE, HEIGHT_NOISE = 10e-3, 10e-6
FORCE_RATE, HEIGHT_RATE = 500.0, 1000.0
#: Speeds of the ramps, m/s, and samples of a sequence of commands.
SPEEDS, SAMPLES = (1e-3, 8e-3, 32e-3), 2000
#: What loads a cell in the second half of a record, N.
LOAD = 80e-3
COLUMNS = {
    "parameter": "parameter",
    "inside, %": "inside .1f",
    "half width, median, %": "half .3g",
    "devices": "devices",
}


class Measured(NamedTuple):
    """A synthetic device, measured: its truth by key, and trials."""

    truth: dict[str, float]
    trials: list[Trial]
    groups: tuple[str, ...]


def measure_finger(
    random: np.random.Generator, speeds: Sequence[float] = SPEEDS, hold: float = 1.0
) -> Measured:
    """Return a finger that differs from the default by 15 to 40 %, pressed at some speeds."""
    weights = np.array((0.08, 0.62, 0.20, 0.10)) * _spread(random, 0.2, 4)
    weights /= weights.sum()
    times = np.array((4e-3, 70e-3, 1.4)) * _spread(random, 0.2, 3)
    stiffness, exponent = np.array((250.0, 2000.0)) * _spread(random, (0.3, 0.15), 2)
    touch, offset = random.normal(0.0, (1e-4, 20e-3))
    finger = Finger(stiffness, exponent, tuple(weights), tuple(times), touch, offset)
    trials = []
    for number, path in enumerate(press_at(speeds, touch, hold), 1):
        time, position, force = finger.measure(path, FORCE_RATE)
        force += random.normal(0.0, FORCE_NOISE, force.size)
        trials.append(Trial(str(number), time, position, force, np.zeros(force.size)))
    truth = {"contact.stiffness": stiffness, "contact.exponent": exponent}
    truth |= {f"relaxation.weights.{number}": value for number, value in enumerate(weights, 1)}
    truth |= {f"relaxation.times.{number}": value for number, value in enumerate(times, 1)}
    return Measured(truth, trials, ("contact", "relaxation"))


def measure_cell(
    random: np.random.Generator, commands: Floats | None = None, loaded: bool = False
) -> Measured:
    """Return a cell that differs from the default, moved by random commands; loaded: pressures are free."""
    size, high, low, lag, delay = _spread(random, (0.15, 0.2, 0.2, 0.3, 0.3), 5)
    cell = Cell(diameter=0.5e-3 * size, lag=2e-3 * lag, delay=1e-3 * delay)
    if commands is None:
        commands = command_at_random(random, SAMPLES)
    groups: tuple[str, ...] = ("lag", "delay")
    load = np.zeros(commands.size)
    truth = {"valve.orifice_diameter": cell.diameter, "valve_lag.time_constant": cell.lag}
    truth |= {"delay.dead_time": cell.delay}
    if loaded:
        cell = cell._replace(high=50e3 * high, low=-50e3 * low)
        load = LOAD * np.clip(np.linspace(-10.0, 10.0, commands.size) + 0.5, 0.0, 1.0)
        groups = ("supply", "lag", "delay")
        truth |= {"supply.high": cell.high, "supply.low": cell.low}
    height = cell.measure(commands, HEIGHT_RATE, load)
    height += random.normal(0.0, HEIGHT_NOISE, height.size)
    time = np.arange(commands.size) / HEIGHT_RATE
    return Measured(truth, [Trial("1", time, commands, height, load)], groups)


def _spread(random: np.random.Generator, size: float | Sequence[float], count: int) -> Floats:
    """Return factors about 1."""
    return np.exp(random.normal(0.0, size, count))


def measure_stepped(random: np.random.Generator, levels: Sequence[float]) -> Measured:
    """Return a cell that is moved by commands of 0.1 s each."""
    return measure_cell(random, np.repeat(levels, round(0.1 * HEIGHT_RATE)).astype(float))


#: What is measured, by name: part, and function of a generator of random numbers.
Kinds = dict[str, tuple[str, Callable[[np.random.Generator], Measured]]]
KINDS: Kinds = {
    "pulp, three ramps": ("pulp", measure_finger),
    "cell, random commands": ("cell", measure_cell),
    "cell, random commands and a load": ("cell", partial(measure_cell, loaded=True)),
}
SLOW, FAST = 1e-3, 8e-3
#: Parameters that a record cannot tell: the record, groups that are free, and what must be named.
UNKNOWABLE: list[tuple[str, Callable[[np.random.Generator], Measured], str, str]] = [
    ("cell", measure_cell, "stroke,lag,delay", "valve.orifice_diameter valve.stroke"),
    ("cell", measure_cell, "supply,lag,delay", "valve.orifice_diameter supply.high supply.low"),
    ("cell", partial(measure_stepped, levels=(0, 1, 0)), "supply,lag", "supply.low"),
    ("pulp", partial(measure_finger, speeds=[FAST], hold=0.1), "relaxation", "relaxation.times.3"),
    ("pulp", partial(measure_finger, speeds=[SLOW], hold=0.0), "relaxation", "relaxation.times.1"),
]


def fit_measured(part: str, measured: Measured) -> Findings:
    """Fit a synthetic device."""
    return fit(part, digiclay.scene("tap"), measured.trials, (), measured.groups)


def find_inside(found: Findings, truth: dict[str, float]) -> Iterator[tuple[str, bool, float]]:
    """Give each parameter, whether its interval contains the truth, and its half width in percent."""
    for each, half in zip(found.derived, found.half_widths, strict=True):
        true = np.log(truth[each.key]) if each.log else truth[each.key]
        size = 1.0 if each.log else abs(true)
        yield each.key, abs(each.value - true) <= half, 100.0 * half / size


def list_unnamed(number: int, seed: int) -> list[str]:
    """Return what must be named of a case of `UNKNOWABLE` and was not, or the code of its fit."""
    part, make, groups, keys = UNKNOWABLE[number]
    measured = make(np.random.default_rng(seed))
    found = fit_measured(part, measured._replace(groups=tuple(groups.split(","))))
    if found.code == "OK":
        return [found.code]
    return [key for key in keys.split() if key not in found.message]


def measure(arguments: argparse.Namespace, steps: Steps) -> Report:
    """Measure the coverage of all kinds of devices, and fit what cannot be known."""
    count, repeats = (QUICK, 1) if arguments.quick else (DEVICES, REPEATS)
    steps.total = count * len(KINDS) + repeats * len(UNKNOWABLE)
    lines, rows = [], []
    for name in KINDS:
        some = list(_list_rows(name, count, steps))
        mean = np.mean([row["inside"] for row in some])
        lines += [
            f"{name}: {mean:.1f} % of the intervals contain the truth",
            *tabulate(some, COLUMNS),
            "",
        ]
        rows += [*some, {**some[0], "parameter": "all", "inside": mean, "half": None}]
    refused = 0
    for number, seed in itertools.product(range(len(UNKNOWABLE)), range(repeats)):
        refused += not list_unnamed(number, seed)
        steps("what cannot be known")
    lines.append(f"what cannot be known: {refused} of {repeats * len(UNKNOWABLE)} refused by name")
    return Report(lines, rows)


def _list_rows(name: str, count: int, steps: Steps) -> Iterator[Row]:
    """Give for each parameter of a kind how often its interval contains the truth, and its median width."""
    part, make = KINDS[name]
    seen: list[list[tuple[str, bool, float]]] = []
    for seed in range(count):
        measured = make(np.random.default_rng(seed))
        seen.append(list(find_inside(fit_measured(part, measured), measured.truth)))
        steps(name)
    for column in zip(*seen, strict=True):
        keys, inside, halves = zip(*column, strict=True)
        share, half = 100.0 * float(np.mean(inside)), float(np.median(halves))
        yield {"kind": name, "parameter": keys[0], "inside": share, "half": half, "devices": count}
