"""Height of a pin over commands of its valve: dead time, lag and flow, with exact derivatives.

The opening is exact between commands, which are held from sample to sample; the flow is summed by three
points of Gauss in each piece of time. The load is known, so nothing is integrated step by step. Fitted
is the conductance of the orifice, from which its diameter follows, and where the stroke is free the knee,
from which that follows; else the knee is that of the scene's stroke.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import DigiclayError
from digiclay.core.model.laws import select_law
from digiclay.core.scene.schema import Scene

from .estimation import Derived, Model, Parameter
from .records import Trial

#: Groups of parameters that may be free beside the diameter of the orifice.
GROUPS = ("stroke", "supply", "lag", "delay")
#: Points of Gauss in a piece of time, and their weights.
NODES = 0.5 + np.array((-(0.15**0.5), 0.0, 0.15**0.5))
WEIGHTS = np.array((5.0, 8.0, 5.0)) / 18.0
#: Knees at which a fit starts, Pa: above the supply it has no effect, and stays.
KNEES = (1e4, 4e4, 1e7)
DIAMETER, STROKE = "valve.orifice_diameter", "valve.stroke"
HIGH, LOW = "supply.high", "supply.low"
LAG, DELAY, ZERO = "valve_lag.time_constant", "delay.dead_time", "zero of height {}"


class CellTrial:
    """Commands of a trial as events, and the instants at which its flow is taken.

    The opening has a kink where a command arrives, so a piece ends there.
    """

    def __init__(self, trial: Trial) -> None:
        self.time, self.given_load = trial.time - trial.time[0], trial.load
        changed = np.flatnonzero(np.diff(trial.drive, prepend=0.0))
        self.events, self.commands = self.time[changed], trial.drive[changed]

    def divide(self, delay: float) -> None:
        """Place the instants, between samples and arriving commands."""
        arrived = self.events + delay
        edges = np.concatenate((self.time, arrived[arrived < self.time[-1]]))
        order = np.argsort(edges, kind="stable")
        edges, pieces = edges[order], np.diff(edges[order])
        self.at_sample = np.argsort(order, kind="stable")[: self.time.size]
        self.nodes = (edges[:-1, None] + pieces[:, None] * NODES).reshape(-1)
        self.weight = (pieces[:, None] * WEIGHTS).reshape(-1)
        self.load = np.interp(self.nodes, self.time, self.given_load)

    def open(self, lag: float, delay: float) -> tuple[Floats, Floats, Floats]:
        """Return the openings at the nodes, and their derivatives by lag and dead time."""
        commands = np.concatenate(([0.0], self.commands))
        starts, slopes = np.zeros(commands.size), np.zeros(commands.size)
        for number, gap in enumerate(np.diff(self.events).tolist(), 1):
            stay, away = math.exp(-gap / lag), starts[number] - commands[number]
            starts[number + 1] = commands[number] + away * stay
            slopes[number + 1] = (slopes[number] + away * gap / lag**2) * stay
        place = np.searchsorted(self.events, self.nodes - delay, side="right")
        first = np.concatenate(([0.0], self.events + delay))
        since = np.where(place > 0, self.nodes - first[place], 0.0)
        stay = np.exp(-since / lag)
        away = starts[place] - commands[place]
        opening = commands[place] + away * stay
        by_lag = (slopes[place] + away * since / lag**2) * stay
        return opening, by_lag, np.where(place > 0, away * stay / lag, 0.0)

    def sum_up(self, rates: Floats) -> Floats:
        """Return integrals (k, n) at the samples, of rates (k, nodes) at the nodes."""
        weighted = (rates * self.weight).reshape(len(rates), -1, NODES.size)
        pieces = sum(weighted[:, :, node] for node in range(NODES.size))
        summed = np.zeros((len(rates), pieces.shape[1] + 1))
        np.cumsum(pieces, axis=1, out=summed[:, 1:])
        return summed[:, self.at_sample]


class CellModel(Model):
    """Model of all samples of some trials; `groups`: what is free."""

    held_first = STROKE, LAG, DELAY

    def __init__(self, scene: Scene, trials: Sequence[Trial], groups: Sequence[str]) -> None:
        self.trials, self.groups = [CellTrial(trial) for trial in trials], tuple(groups)
        self.measured = np.concatenate([trial.answer for trial in trials])
        longest = max(float(np.ptp(trial.answer)) for trial in trials)
        if longest >= scene.actuator.stroke:
            rule = f"must change by less than actuator.stroke, {scene.actuator.stroke:g} m"
            raise DigiclayError(f"height {rule} (got {longest:g} m).")
        law = getattr(scene.valve, "law", "orifice")
        if law != "orifice":
            raise DigiclayError(f"valve.law must be orifice to be fitted (got {law}).")
        self.valve, self.fluid, self.area = scene.valve, scene.fluid, scene.actuator.area
        orifice = select_law("valve", scene.valve).flow_law(scene.fluid, scene.actuator.area)
        self.power = orifice.power
        self.resistance = scene.conduit.resistance(scene.fluid) if scene.conduit else 0.0
        absent = 1e-3 if "lag" in groups else 1e-9
        self.usual = {
            HIGH: scene.supply.high,
            LOW: scene.supply.low,
            LAG: scene.valve_lag.time_constant if scene.valve_lag else absent,
            DELAY: scene.dead_time,
        }
        #: Logarithm of knee times conductance: that of a stroke, at any diameter.
        self.knee = math.log(orifice.knee * orifice.laminar)
        self.parameters = tuple(self._list_parameters(orifice.laminar, trials))
        if STROKE in self.index:
            self.defaults[self.index[STROKE]] = math.log(orifice.knee)

    def _list_parameters(self, conductance: float, trials: Sequence[Trial]) -> Iterator[Parameter]:
        """Give what is free: the conductance first, then the knee if it is; a zero of each trial last."""
        start, far = math.log(conductance), math.log(1e4)
        yield Parameter(DIAMETER, "m3/(s Pa)", start, start - far, start + far, log=True)
        if "stroke" in self.groups:
            low, high = math.log(10.0), math.log(1e9)
            yield Parameter(STROKE, "Pa", math.log(KNEES[0]), low, high, True, beside=DIAMETER)
        if "supply" in self.groups:
            for key in (HIGH, LOW):
                yield Parameter(key, "Pa", self.usual[key], -1e6, 1e6)
        if "lag" in self.groups:
            yield Parameter(LAG, "s", math.log(self.usual[LAG]), math.log(1e-5), 0.0, log=True)
        if "delay" in self.groups:
            longest = max(float(trial.time[-1]) for trial in self.trials) / 2.0
            yield Parameter(DELAY, "s", min(self.usual[DELAY], longest / 2.0), 0.0, longest)
        for number, trial in enumerate(trials, 1):
            key, rest = ZERO.format(number), float(trial.answer[0])
            yield Parameter(key, "m", rest, rest - 1.0, rest + 1.0, wanted=False, of_trial=True)

    def predict_trial(self, number: int, free: Floats) -> tuple[Floats, Floats]:
        """Return the heights at the samples of a trial, and their Jacobian."""
        trial, index = self.trials[number], self.index
        lag, delay = self.read_value(free, LAG), self.read_value(free, DELAY)
        trial.divide(delay)
        opening, by_lag, by_delay = trial.open(lag, delay)
        up = opening > 0.0
        source = np.where(up, self.read_value(free, HIGH), self.read_value(free, LOW))
        drop = source - trial.load / self.area
        knee = free[index[STROKE]] if STROKE in index else self.knee - free[0]
        flow, by_conductance, by_knee, by_drop, by_opening = self._flow(
            math.exp(free[0]), math.exp(knee), opening, drop
        )
        slopes = {
            DIAMETER: by_conductance if STROKE in index else by_conductance - by_knee,
            STROKE: by_knee,
            HIGH: by_drop * up,
            LOW: by_drop * ~up,
            LAG: by_opening * by_lag * lag,
            DELAY: by_opening * by_delay,
        }
        rates = np.zeros((1 + len(self.parameters), flow.size))
        rates[0] = flow
        for key in slopes.keys() & index.keys():
            rates[1 + index[key]] = slopes[key]
        risen = trial.sum_up(rates / self.area)
        zero = index[ZERO.format(number + 1)]
        risen[1 + zero] = 1.0
        return free[zero] + risen[0], risen[1:].T

    def _flow(
        self, conductance: float, knee: float, opening: Floats, drop: Floats
    ) -> tuple[Floats, ...]:
        """Return the flow, and its derivatives by log conductance, log knee, drop and opening."""
        size, sign = np.abs(opening), np.sign(opening)
        lift = size if self.power == 1 else size * size
        lift_slope = np.ones_like(size) if self.power == 1 else 2.0 * size
        series = 1.0 + self.resistance * conductance * lift
        laminar = conductance * lift / series
        wide = conductance * math.sqrt(knee) * size
        loss, push = self.resistance * wide * wide, np.abs(drop)
        turbulent = 0.5 * (np.sqrt(loss * loss + 4.0 * wide * wide * push) - loss)
        calm = laminar * push <= turbulent
        flow = np.where(calm, laminar * push, turbulent)
        below = np.maximum(2.0 * turbulent + loss, 1e-300)
        by_wide = 2.0 * turbulent**2 / below
        by_log = np.where(calm, laminar * push / series, by_wide)
        by_knee = np.where(calm, 0.0, 0.5 * by_wide)
        by_drop = np.where(calm, laminar, wide * wide / below)
        by_size = np.where(
            calm,
            conductance * lift_slope / series**2 * push,
            np.divide(by_wide, size, out=np.zeros_like(size), where=size > 0.0),
        )
        down = np.sign(drop)
        return flow * down, by_log * down, by_knee * down, by_drop, by_size * down * sign

    def list_starts(self) -> list[Floats]:
        """Return the values at which a fit starts: with a free knee below, about and above the supply."""
        (start,) = super().list_starts()
        if STROKE not in self.index:
            return [start]
        return [np.where(np.arange(start.size) == 1, math.log(knee), start) for knee in KNEES]

    def derive(self, free: Floats) -> list[Derived]:
        """Return the values for a scene; the stroke too if it is free, else the diameter with that stroke."""
        valve, fluid, unit = self.valve, self.fluid, np.eye(free.size)
        drag = 8.0 * valve.knee_reynolds**2 * fluid.density * fluid.viscosity
        shape = math.log(math.pi * valve.discharge_slope)
        wide, gradient = 0.5 * (math.log(drag * valve.stroke) + free[0]), 0.5 * unit[0]
        derived = super().derive(free)
        if "stroke" in self.groups:
            wide = math.log(4.0 * math.sqrt(fluid.density / 2.0)) + free[0] + 0.5 * free[1]
            gradient = unit[0] + 0.5 * unit[1]
            stroke = 2.0 * wide - math.log(drag) - free[0]
            derived[1] = Derived(STROKE, "m", stroke, unit[0] + unit[1], True)
        derived[0] = Derived(DIAMETER, "m", 0.5 * (wide - shape), 0.5 * gradient, True)
        return derived
