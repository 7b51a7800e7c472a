"""References of PinBench: each judged pin by itself, by DOP853 between located events, at 2.3e-14."""

import json
import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Floats

from .problem import FOLDER, JOIN, ROOT, Law, Problem

#: The method of the references and that of their check, with relative tolerances.
METHODS = (("DOP853", 2.3e-14), ("RK45", 1e-13))


class Pin:
    """The law of one pin in plain numbers, smooth within a mode, (touched, loaded, turbulent, stop)."""

    def __init__(self, problem: Problem, pin: int) -> None:
        self.law = law = Law(problem, np.array([pin]))
        self.x, self.y = float(law.x[0]), float(law.y[0])
        self.nu, self.shares = law.rates[:, 0].tolist(), law.shares.tolist()
        self.path: list[list[float]] = problem.file["path"]
        self.stroke = law.pin["stroke"]

    def cuts(self) -> list[float]:
        """Return the times at which the law is not smooth whatever the state, s."""
        law, times = self.law, [row[0] for row in self.path]
        times += law.starts[law.starts < times[-1] - 1e-9].tolist()
        times += [i * law.period for i in range(round(times[-1] / law.period))]
        for (a, *start), (b, *end) in pairwise(self.path):
            # The path enters or leaves the ellipse at which the paraboloid takes over.
            off = [(start[0] - self.x) / law.tip["length"], (start[1] - self.y) / law.tip["width"]]
            way = [(end[0] - start[0]) / law.tip["length"], (end[1] - start[1]) / law.tip["width"]]
            square, half = float(np.dot(way, way)), float(np.dot(way, off))
            rest = half * half - square * (float(np.dot(off, off)) - JOIN)
            if square > 0.0 and rest > 0.0:
                shares = [(-half + sign * math.sqrt(rest)) / square for sign in (-1.0, 1.0)]
                times += [a + share * (b - a) for share in shares if 0.0 < share < 1.0]
        for i, start_of in enumerate(law.starts if law.lag else []):
            held, opening = float(law.held[i].item()), float(law.openings[i].item())
            if held * opening < 0.0:  # the valve changes reservoir
                times.append(float(start_of + law.lag * math.log(1.0 - opening / held)))
        times = sorted(t for t in times if t <= self.path[-1][0])
        return [
            t for t, next_time in zip(times, [*times[1:], math.inf], strict=True) if next_time - t > 1e-12
        ]

    def bind(self, start: float, end: float) -> Callable[[float, Any], tuple[float, ...]]:
        """Return the terms of the law between two cuts: opening, supply, depth, tension, lost force."""
        law, middle = self.law, (start + end) / 2
        i = law.segment(middle)
        held, opening, begun = float(law.held[i].item()), float(law.openings[i].item()), float(law.starts[i])
        piece = max(j for j, row in enumerate(self.path[:-1]) if row[0] < middle)
        a, b = self.path[piece], self.path[piece + 1]
        speed = [(q - p) / (b[0] - a[0]) for p, q in zip(a, b, strict=True)][1:]
        length, width, tall = law.tip["length"], law.tip["width"], law.tip["height"]

        def inward_of(t: float) -> float:
            far_x, far_y = a[1] + speed[0] * (t - a[0]) - self.x, a[2] + speed[1] * (t - a[0]) - self.y
            return float(1.0 - (far_x / length) ** 2 - (far_y / width) ** 2)

        outside = inward_of(middle) < 1.0 - JOIN
        mean = float(law.opening(middle, i).item())
        supply = 0.0 if law.damping else law.high if mean > 0.0 else law.low

        def terms(t: float, y: Any) -> tuple[float, ...]:
            inward = inward_of(t)
            slope = (inward - (1.0 - JOIN)) * (0.5 / ROOT) + ROOT if outside else math.sqrt(inward)
            depth = y[0] - (a[3] + speed[2] * (t - a[0]) + tall * (1.0 - slope))
            k = held + (opening - held) * math.exp(-(t - begun) / law.lag) if law.lag else held
            lost = sum(c * z for c, z in zip(self.shares, y[1:], strict=True))
            return k, supply, depth, law.unit * math.expm1(min(law.exponent * depth, 300.0)), lost

        return terms

    def flows(self, k: float, drop: float) -> tuple[float, float]:
        """Return the speed of the pin by the laminar and by the turbulent branch, m/s."""
        law = self.law
        if law.damping:
            return drop * law.area / law.damping, 0.0
        lift, a = law.laminar * k * k, law.turbulent * abs(k)
        bend = law.resistance * a
        root = bend + math.sqrt(bend * bend + 4.0 * abs(drop)) + 1e-300
        return lift / (1.0 + law.resistance * lift) * drop / law.area, 2.0 * a / root * drop / law.area

    def measures(self, terms: tuple[float, ...], y: Any, mode: tuple[bool, ...]) -> tuple[float, ...]:
        """Return what is positive where a mode holds: touched, loaded, turbulent; then room, and speed."""
        k, supply, depth, tension, lost = terms
        tension = tension if mode[0] else 0.0
        force = tension - lost
        drop = supply - (force if mode[1] else 0.0) / self.law.area
        slow, fast = self.flows(k, drop)
        turbulent = -1.0 if self.law.damping else abs(slow) / (abs(fast) + 1e-300) - 1.0
        return depth / 1e-3, force, turbulent, fast if mode[2] else slow

    def solve(self, method: str, tolerance: float, judged: list[int]) -> Iterator[tuple[float, float]]:
        """Give height, m, and force, N, at the ends of the judged periods."""
        from scipy.integrate import solve_ivp

        y = self.law.begin()[:, 0]
        ends = {round(period * self.law.period / 1e-9): period for period in judged}
        cuts, stuck = self.cuts(), False
        for start, end in pairwise(cuts):
            terms = self.bind(start, end)
            t = start
            while t < end - 1e-15:
                mode = self.find_mode(terms(t, y), y, terms(t + 1e-9, y))
                speed = self.measures(terms(t, y), y, mode)[3]
                stuck = (y[0] <= 0.0 and speed < 0.0) or (y[0] >= self.stroke and speed > 0.0)

                def rates(t: float, y: Any, terms: Any = terms, mode: Any = mode, stuck: bool = stuck) -> Any:
                    values = terms(t, y)
                    tension = values[3] if mode[0] else 0.0
                    speed = 0.0 if stuck else self.measures(values, y, mode)[3]
                    filters = zip(self.nu, y[1:], strict=True)
                    return [speed, *(nu * (tension - z) for nu, z in filters)]

                def watch(t: float, y: Any, index: int, terms: Any = terms, mode: Any = mode) -> float:
                    return self.measures(terms(t, y), y, mode)[index]

                events: list[Any] = [partial(watch, index=0)]
                events += [partial(watch, index=1)] if mode[0] and self.nu else []
                events += [partial(watch, index=2)] if self.law.damping is None else []
                events += [partial(watch, index=3)] if stuck else []
                for event in events:
                    event.terminal, event.direction = True, -1.0 if event(t, y) > 0.0 else 1.0
                if not stuck:
                    bottom, top = partial(find_room, at=0.0), partial(find_room, at=self.stroke)
                    bottom.terminal = top.terminal = True  # type: ignore[attr-defined]
                    bottom.direction, top.direction = -1.0, 1.0  # type: ignore[attr-defined]
                    events += [bottom, top]
                with np.errstate(all="ignore"):  # errors that underflow
                    done = solve_ivp(
                        rates, (t, end), y, method, events=events, rtol=tolerance, atol=tolerance * 1e-2
                    )
                t, y = float(done.t[-1]), done.y[:, -1]
                if not done.success or not np.isfinite(y).all():
                    raise ArithmeticError(f"no reference at {t:g} s: {done.message}")
                y[0] = min(max(y[0], 0.0), self.stroke)
                if done.status == 1:  # the mode changes: a step of 1e-10 s across the event, without one
                    nudge = min(1e-10, end - t)
                    y = y + nudge * np.array(rates(t, y))
                    y[0] = min(max(y[0], 0.0), self.stroke)
                    t += nudge
            if round(end / 1e-9) in ends:
                yield float(y[0]), self.force(terms(end, y))

    def find_mode(self, terms: tuple[float, ...], y: Any, later: tuple[float, ...]) -> tuple[bool, ...]:
        """Return the mode at a state: touched, loaded, turbulent."""
        touched = terms[2] > 0.0 or (terms[2] == 0.0 and later[2] > 0.0)
        loaded = touched and self.measures(terms, y, (True, True, False))[1] > 0.0
        turbulent = self.measures(terms, y, (touched, loaded, False))[2] > 0.0
        return touched, loaded, turbulent

    def force(self, terms: tuple[float, ...]) -> float:
        """Return the contact force, N."""
        return max((terms[3] if terms[2] > 0.0 else 0.0) - terms[4], 0.0)


def find_room(t: float, y: Any, at: float) -> float:
    """Return how far a pin is above an end stop, m."""
    return float(y[0] - at)


def solve_pins(problem: Problem, pins: Any, method: str, tolerance: float) -> Floats:
    """Return heights and forces, (2, t, p), of some pins."""
    solved = [list(Pin(problem, int(pin)).solve(method, tolerance, problem.judged)) for pin in pins]
    return np.array(solved).transpose(2, 1, 0)


def make(problem: Problem) -> dict[str, Any]:
    """Return the reference of a problem, and how far two other methods are from it."""
    exact = solve_pins(problem, problem.pins, *METHODS[0])
    some = slice(None, None, 4)
    checked = solve_pins(problem, problem.pins[some], *METHODS[1])
    apart = np.abs(checked - exact[:, :, some]).max(axis=(1, 2)).tolist()
    return {
        "method": "each pin alone: DOP853, relative tolerance 2.3e-14; contact, load, flow regime, end stops "
        "and changes of command located",
        "check": "every fourth judged pin: RK45, 1e-13, the same events",
        "apart": {"height": apart[0], "force": apart[1]},
        "heights": exact[0].tolist(), "forces": exact[1].tolist(),
    }  # fmt: skip


def write(problem: Problem) -> None:
    """Make the reference of a problem and write it into its file, a key a line."""
    file = {**problem.file, "reference": make(problem)}
    lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in file.items())
    (FOLDER / f"{problem.name}.json").write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
