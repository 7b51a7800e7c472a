"""Force of a fingertip over position and time: contact law and relaxation, with exact derivatives.

Between samples the position is cubic. On a grid of quarters of a sample the elastic force drives the filters
(equation 13), which are exact for a force that is linear between two points of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError, ParameterError
from digiclay.core.scene.schema import Scene
from digiclay.core.session.plate import DEEPEST

from .estimation import Derived, Model, Parameter
from .records import Trial, estimate_noise

#: Parts of a sample, and most points of the grid.
PARTS, MOST_POINTS = 4, 800_000
#: Largest m (x - x0).
STEEPEST = 60.0
#: Groups of parameters that may be free.
GROUPS = ("contact", "relaxation", "lag", "drift", "compliance")


class PulpTrial:
    """Grid of a trial, its cubic position, and the weights that bring the grid to the samples."""

    def __init__(self, trial: Trial) -> None:
        from scipy.interpolate import Akima1DInterpolator

        time = trial.time - trial.time[0]
        parts = PARTS if time.size * PARTS < MOST_POINTS else 2
        self.step = max(float(np.median(np.diff(time))) / parts, time[-1] / MOST_POINTS)
        self.time, self.position = time, trial.drive
        count = math.ceil(time[-1] / self.step) + 3
        grid = np.minimum(np.arange(count) * self.step, time[-1])
        self.grid = Akima1DInterpolator(time, trial.drive, method="makima")(grid)
        self.felt = np.interp(
            grid, time, trial.answer - np.median(trial.answer[: max(3, time.size // 100)])
        )
        self.elapsed = trial.time

    def sample(self, columns: Floats, lag: float) -> tuple[Floats, Floats]:
        """Return grid columns (g, k) at the samples (n, k), cubic, and the slope of the first one, 1/s."""
        place = np.clip((self.time - lag) / self.step, 1.0, len(columns) - 2.0 - 1e-9)
        first = place.astype(np.intp)
        u = place - first
        w = np.stack(
            [
                -u * (u - 1) * (u - 2) / 6,
                (u * u - 1) * (u - 2) / 2,
                -u * (u + 1) * (u - 2) / 2,
                u * (u * u - 1) / 6,
            ]
        )
        d = np.stack(
            [
                -(3 * u * u - 6 * u + 2) / 6,
                (3 * u * u - 4 * u - 1) / 2,
                -(3 * u * u - 2 * u - 2) / 2,
                (3 * u * u - 1) / 6,
            ]
        )
        near = columns[first + np.arange(-1, 3)[:, None]]
        return np.einsum("jn,jnk->nk", w, near), np.einsum("jn,jn->n", d, near[..., 0]) / self.step


class PulpModel(Model):
    """Model of all samples of some trials; `law`: plate or pin; `groups`: what is free."""

    def __init__(
        self, scene: Scene, trials: Sequence[Trial], groups: Sequence[str], law: str = "plate"
    ) -> None:
        self.trials = [PulpTrial(trial) for trial in trials]
        self.measured = np.concatenate([trial.answer for trial in trials])
        self.noise = estimate_noise(self.measured)
        tip, contact = scene.section("fingertip"), scene.section("contact")
        relaxation = scene.section("relaxation")
        for name, part in (("fingertip", tip), ("relaxation", relaxation)):
            if part is None and (name == "fingertip" or name in groups):
                raise ParameterError(name, "", "must be given to be fitted", "absent")
        self.plate, self.height = law == "plate", tip.height
        plan = scene.layout
        self.factor = contact.share
        if self.plate:
            area = 2.0 * math.pi * tip.length * tip.width / tip.height
            self.factor *= area / (plan.pitch * plan.row_spacing)
        self.times = np.array(relaxation.times if relaxation else ())
        weights = np.array(relaxation.weights if relaxation else (1.0,))
        self.weights = weights / weights.sum()
        #: The weight that follows from the sum of all.
        self.follows = int(self.weights.argmax())
        self.groups = tuple(groups)
        self.parameters = (*self._list_wanted(contact), *self._list_zeros(trials))
        self.fixed = math.log(contact.stiffness), math.log(contact.exponent)
        self.rounds = 0

    def _list_wanted(self, contact: Any) -> list[Parameter]:
        """Return the free parameters of contact and relaxation, with their declared ranges."""
        found = []
        if "contact" in self.groups:
            for name, unit in (("stiffness", "N/m"), ("exponent", "1/m")):
                start = math.log(getattr(contact, name))
                bounds = start - math.log(50.0), start + math.log(50.0)
                found.append(Parameter(f"contact.{name}", unit, start, *bounds, log=True))
        if "relaxation" in self.groups:
            for number, weight in enumerate(self.weights, 1):
                if number - 1 != self.follows:
                    found.append(Parameter(f"relaxation.weights.{number}", "", weight, 0.0, 1.0))
            for number, time in enumerate(self.times, 1):
                ends = math.log(time / 30.0), math.log(time * 30.0)
                found.append(
                    Parameter(f"relaxation.times.{number}", "s", math.log(time), *ends, log=True)
                )
        return found

    def _list_zeros(self, trials: Sequence[Trial]) -> list[Parameter]:
        """Return the parameters of the measurement, which no scene has; zeros are always free."""
        first, *_ = trials
        quiet = max(3, first.time.size // 100)
        force = float(np.median(first.answer[:quiet]))
        span, length = float(np.ptp(first.answer)), float(np.ptp(first.drive))
        touched = first.answer - force > 0.02 * span + 4.0 * self.noise
        start = float(first.drive[int(touched.argmax())]) - 0.3e-3
        reach, sizes = 5.0 * length + 1e-3, 10.0 * span
        found = [
            Parameter("zero of position", "m", start, start - reach, start + reach, wanted=False),
            Parameter("zero of force", "N", force, force - sizes, force + sizes, wanted=False),
        ]
        if "lag" in self.groups:
            found.append(Parameter("lag", "s", 0.0, -0.05, 0.05, wanted=False))
        if "drift" in self.groups:
            rate = sizes / max(float(np.ptp(first.time)), 1e-3)
            found.append(Parameter("drift", "N/s", 0.0, -rate, rate, wanted=False))
        if "compliance" in self.groups:
            found.append(Parameter("compliance", "m/N", 2e-5, 0.0, 2e-3, wanted=False))
        return found

    def read(self, free: Floats) -> tuple[float, float, Floats, Floats]:
        """Return b, m, weights (k + 1,) and times (k,)."""
        weights, times = self.weights.copy(), self.times.copy()
        if "relaxation" in self.groups:
            others = [i for i in range(weights.size) if i != self.follows]
            weights[others] = [free[self.index[f"relaxation.weights.{i + 1}"]] for i in others]
            weights[self.follows] = 1.0 - weights[others].sum()
            times = np.exp(
                [free[self.index[f"relaxation.times.{i + 1}"]] for i in range(times.size)]
            )
        b, m = map(math.exp, free[:2] if "contact" in self.groups else self.fixed)
        return b, m, weights, times

    def press(self, b: float, m: float, depth: Floats) -> tuple[Floats, Floats, Floats]:
        """Return elastic force, N, its slope, N/m, and its derivative by the logarithm of m."""
        turn = np.clip(m * depth, 0.0, STEEPEST)
        grown = np.expm1(turn)
        if not self.plate:
            unit = self.factor * b / m
            return (
                unit * grown,
                unit * m * (grown + 1.0) * (depth > 0.0),
                unit * (turn * (grown + 1.0) - grown),
            )
        unit, high = self.factor * b / m**2, m * self.height
        first = grown - turn
        second = (first - 0.5 * turn * turn) / high
        force = unit * (first - second)
        bend = grown - first / high
        return force, unit * m * bend, unit * (turn * bend + second) - 2.0 * force

    def predict_trial(self, number: int, free: Floats) -> tuple[Floats, Floats]:
        """Return the forces at the samples of a trial, and their Jacobian."""
        b, m, weights, times = self.read(free)
        trial, index = self.trials[number], self.index
        give = self.read_value(free, "compliance")
        depth = trial.grid - give * trial.felt - free[index["zero of position"]]
        force, slope, stiffening = self.press(b, m, depth)
        slopes = {
            "zero of position": -slope,
            "contact.stiffness": force,
            "contact.exponent": stiffening,
            "compliance": -slope * trial.felt,
        }
        driving = [key for key in slopes if key in index]
        elastic = np.column_stack([force, *(slopes[key] for key in driving)])
        relaxed, states = elastic.copy(), []
        for weight, time in zip(weights[1:], times, strict=True):
            filtered, by_time = relax(elastic, time, trial.step)
            relaxed -= weight * filtered
            states.append((filtered[:, 0], by_time))
        columns = np.zeros((len(depth), 1 + len(self.parameters)))
        columns[:, [0, *(1 + index[key] for key in driving)]] = relaxed
        if "relaxation" in self.groups:
            self._add_relaxation(columns, states, weights)
        columns *= columns[:, :1] > 0.0
        sampled, rate = trial.sample(columns, self.read_value(free, "lag"))
        predicted, jacobian = sampled[:, 0], sampled[:, 1:]
        added = {"zero of force": np.ones(len(rate)), "lag": -rate, "drift": trial.elapsed}
        for key in added.keys() & index.keys():
            jacobian[:, index[key]] = added[key]
        drift = self.read_value(free, "drift")
        return predicted + free[index["zero of force"]] + drift * trial.elapsed, jacobian

    def _add_relaxation(
        self, columns: Floats, states: Sequence[tuple[Floats, Floats]], weights: Floats
    ) -> None:
        """Write the derivatives by weights and logarithms of times; F = T - sum of c_i z_i, i from 1."""
        losses = np.column_stack([np.zeros(len(columns)), *(state for state, _ in states)])
        for number in range(weights.size):
            if number != self.follows:
                change = losses[:, self.follows] - losses[:, number]
                columns[:, 1 + self.index[f"relaxation.weights.{number + 1}"]] = change
        for number, (_, by_time) in enumerate(states, 1):
            columns[:, 1 + self.index[f"relaxation.times.{number}"]] = -weights[number] * by_time

    def refine(self, free: Floats) -> bool:
        """Take the fitted force as that which bends the frame; return whether it is to be fitted again."""
        deepest = (
            max(float(trial.grid.max()) for trial in self.trials)
            - free[self.index["zero of position"]]
        )
        if self.plate and deepest > DEEPEST * self.height:
            most = DEEPEST * self.height * 1e3
            rule = f"must press at most {most:.3g} mm deep (got {deepest * 1e3:.3g} mm)"
            raise DigiclayError(f"A record {rule}: the finger is no ellipsoid there.")
        for trial in self.trials:
            begun = trial.grid[0] - free[self.index["zero of position"]]
            if begun > 0.2 * deepest:
                rule = "must begin without contact"
                raise DigiclayError(f"A record {rule} (it begins {begun * 1e3:.2g} mm deep).")
        if "compliance" not in self.groups or self.rounds >= 4:
            return False
        self.rounds += 1
        quiet = free.copy()
        quiet[self.index["zero of force"]] = 0.0
        for key in ("lag", "drift"):
            if key in self.index:
                quiet[self.index[key]] = 0.0
        for number, trial in enumerate(self.trials):
            predicted, _ = self.predict_trial(number, quiet)
            grid = np.arange(len(trial.grid)) * trial.step
            trial.felt = np.interp(grid, trial.time, predicted)
        return True

    def derive(self, free: Floats) -> list[Derived]:
        """Return the values for a scene: all weights, of the sum 1, are given together."""
        derived = super().derive(free)
        if "relaxation" in self.groups:
            gradient = np.array(
                [-1.0 * each.key.startswith("relaxation.weights") for each in self.parameters]
            )
            value = float(self.read(free)[2][self.follows])
            at = self.follows + sum(each.key.startswith("contact") for each in derived)
            key = f"relaxation.weights.{self.follows + 1}"
            derived.insert(at, Derived(key, "", value, gradient, False))
        return derived


def relax(columns: Floats, time: float, step: float) -> tuple[Floats, Floats]:
    """Return filtered columns (g, k), and the first one's derivative by the logarithm of the time (g,)."""
    from scipy.signal import lfilter

    turn = step / time
    stay = math.exp(-turn)
    mean = -math.expm1(-turn) / turn
    start, end = mean - stay, 1.0 - mean
    filtered = lfilter([end, start], [1.0, -stay], columns, axis=0)
    # By the logarithm of the time: turn falls as it grows.
    mean_slope = (mean - stay) if turn > 1e-4 else 0.5 * turn
    stay_slope = turn * stay
    driven = np.zeros(len(columns))
    driven[1:] = stay_slope * filtered[:-1, 0] + (mean_slope - stay_slope) * columns[:-1, 0]
    driven -= mean_slope * columns[:, 0]
    by_time: Floats = lfilter([1.0], [1.0, -stay], driven)
    return filtered, by_time
