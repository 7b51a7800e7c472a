"""A problem of PinBench, read from its JSON file, and its law in numpy for adapters that need one."""

import json
import math
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from digiclay.core.base.arrays import Cells, Floats
from digiclay.core.files.tables import Record

FOLDER = Path(__file__).parent / "problems"
#: Squared reduced radius at which the paraboloid continues the ellipsoid.
JOIN = 0.96
ROOT = math.sqrt(1.0 - JOIN)


@dataclass(frozen=True, eq=False)
class Problem:
    """A problem: its file, SI units; n pins, pin ``row * columns + column``."""

    name: str
    file: Record

    @cached_property
    def places(self) -> tuple[Floats, Floats]:
        """x along a row and y of the pins, (n,) each, m; the bed is centered on the origin."""
        rows, columns, pitch = (self.file["bed"][key] for key in ("rows", "columns", "pitch"))
        y, x = np.indices((rows, columns)).reshape(2, -1)
        return (x - (columns - 1) / 2) * pitch, (y - (rows - 1) / 2) * pitch

    @property
    def count(self) -> int:
        """Number of periods."""
        return round(self.file["path"][-1][0] / self.file["period"])

    @cached_property
    def pins(self) -> Cells:
        """Judged pins, (p,)."""
        return np.array(self.file["judged"]["pins"])

    @property
    def judged(self) -> list[int]:
        """Periods, (t,), at whose ends heights and forces of the judged pins are compared."""
        return list(self.file["judged"]["periods"])

    @cached_property
    def commands(self) -> Floats:
        """Commands of the valves, held for a period each, (periods, n), or (periods, 1) for all pins."""
        given = self.file.get("commands", [[0.0, -1.0]])
        if isinstance(given, str):
            with np.load(FOLDER / given) as recorded:
                commands = np.zeros((self.count, self.places[0].size))
                commands[:, recorded["pins"]] = recorded["commands"]
            return commands
        starts = np.arange(self.count) * self.file["period"] + 1e-9
        times, values = np.array(given).T
        played: Floats = values[np.searchsorted(times, starts, side="right") - 1]
        return played[:, None]

    def compare(self, heights: Floats, forces: Floats) -> tuple[float, float]:
        """Return the largest errors of heights, m, and forces, N, (t, p); infinite ones where it diverged."""
        if not (np.isfinite(heights).all() and np.isfinite(forces).all()):
            return math.inf, math.inf
        exact = self.file["reference"]
        return tuple(
            float(np.abs(values - np.array(exact[key])).max())
            for key, values in (("heights", heights), ("forces", forces))
        )  # type: ignore[return-value]


def read_problems() -> dict[str, Problem]:
    """Return all problems by name."""
    files = sorted(FOLDER.glob("*.json"))
    return {p.stem: Problem(p.stem, json.loads(p.read_text(encoding="utf-8"))) for p in files}


class Law:
    """The law of a problem over some pins; state rows (1 + k, n): height, m, and k filters of the pulp, N."""

    def __init__(self, problem: Problem, pins: Any = slice(None)) -> None:
        file = problem.file
        self.period, self.pin, self.tip = file["period"], file["pin"], file["fingertip"]
        self.x, self.y = (at[pins] for at in problem.places)
        self.across, self.along = self.x / self.tip["length"], self.y / self.tip["width"]
        self.times, self.points = (
            [t for t, *_ in file["path"]],
            [point for _, *point in file["path"]],
        )
        self.exponent, self.unit = (file["contact"][key] for key in ("exponent", "unit"))
        pulp = file.get("relaxation") or {"times": [], "weights": [1.0]}
        self.rates = 1.0 / np.array(pulp["times"])[:, None]
        self.shares = np.array(pulp["weights"][1:]) / sum(pulp["weights"])
        self.area = math.pi * self.pin["bore"] ** 2 / 4.0
        self.damping, self.lag, dead = (
            file.get("damping"),
            file.get("lag", 0.0),
            file.get("dead_time", 0.0),
        )
        if self.damping is None:
            self.high, self.low = file["supply"]["high"], file["supply"]["low"]
            self.laminar, self.turbulent, self.resistance = (
                file["valve"][key] for key in ("laminar", "turbulent", "conduit")
            )
        # Segments of a held command that has come to the valve; the first waits for the dead time.
        self.starts = np.arange(problem.count) * self.period + dead
        self.held = (
            problem.commands if problem.commands.shape[1] == 1 else problem.commands[:, pins]
        )
        if dead:
            self.starts = np.append(0.0, self.starts)
            self.held = np.vstack([np.zeros_like(self.held[:1]), self.held])
        self.openings = np.zeros_like(self.held)
        if self.lag:
            for i in range(1, self.starts.size):
                self.openings[i] = self.opening(self.starts[i], i - 1)

    def begin(self) -> Floats:
        """Return the state at rest, (1 + k, n)."""
        state = np.zeros((1 + self.rates.size, self.x.size))
        state[0] = self.pin["rest_height"]
        return state

    def segment(self, time: float) -> int:
        """Return the segment of the commands that begins at or contains a time, s."""
        return int(np.searchsorted(self.starts, time + 1e-9, side="right")) - 1

    def pieces(self, period: int) -> Iterator[tuple[float, float, int]]:
        """Give start, end, s, and segment of the pieces of a period, which a change of command cuts."""
        start, end = period * self.period, (period + 1) * self.period
        cuts = [t for t in self.starts.tolist() if start + 1e-9 < t < end - 1e-9]
        for a, b in zip([start, *cuts], [*cuts, end], strict=True):
            yield a, b, self.segment(a)

    def opening(self, time: float, segment: int) -> Floats:
        """Return the openings at a time, s, within a segment, (n,) or (1,): exact."""
        if not self.lag:
            return self.held[segment]
        held = self.held[segment]
        fade = math.exp(-(time - self.starts[segment]) / self.lag)
        return held + (self.openings[segment] - held) * fade

    def pose(self, time: float) -> list[float]:
        """Return x, y, z of the fingertip's lowest point, m."""
        i = min(max(bisect_right(self.times, time) - 1, 0), len(self.times) - 2)
        share = (time - self.times[i]) / (self.times[i + 1] - self.times[i])
        return [
            a + share * (b - a) for a, b in zip(self.points[i], self.points[i + 1], strict=True)
        ]

    def underside(self, time: float) -> Floats:
        """Return the fingertip's underside over the pins, (n,), m."""
        at_x, at_y, at_z = self.pose(time)
        across = self.across - at_x / self.tip["length"]
        along = self.along - at_y / self.tip["width"]
        inward = 1.0 - across * across - along * along
        inside = np.maximum(inward, 1.0 - JOIN)
        shape = np.sqrt(inside) + (inward - inside) * (0.5 / ROOT)
        return (at_z + self.tip["height"]) - self.tip["height"] * shape

    def tension(self, depth: Floats) -> Floats:
        """Return the elastic force of depths, (n,), N."""
        exponent = np.minimum(np.maximum(self.exponent * depth, 0.0), 300.0)
        return self.unit * np.expm1(exponent)

    def load(self, time: float, state: Floats) -> tuple[Floats, Floats]:
        """Return the elastic force and the contact force, (n,) each, N."""
        tension = self.tension(state[0] - self.underside(time))
        return tension, np.maximum(
            tension - self.shares @ state[1:], 0.0
        ) if self.shares.size else tension

    def conductance(self, opening: Floats, drop: Floats) -> Floats:
        """Return flow over pressure drop, (n,), m³/(s Pa), of valve and conduit in series."""
        lift, a = self.laminar * opening * opening, self.turbulent * np.abs(opening)
        bend = self.resistance * a
        root = bend + np.sqrt(bend * bend + 4.0 * np.abs(drop)) + 1e-300
        return np.minimum(lift / (1.0 + self.resistance * lift), 2.0 * a / root)

    def change(self, time: float, state: Floats, segment: int) -> Floats:
        """Return the rates of the state, (1 + k, n)."""
        tension, force = self.load(time, state)
        out = np.empty_like(state)
        if self.damping is not None:
            speed = -force / self.damping
        else:
            opening = self.opening(time, segment)
            drop = np.where(opening > 0.0, self.high, self.low) - force / self.area
            speed = self.conductance(opening, drop) * drop / self.area
        stuck = ((state[0] <= 0.0) & (speed < 0.0)) | (
            (state[0] >= self.pin["stroke"]) & (speed > 0.0)
        )
        out[0] = np.where(stuck, 0.0, speed)
        out[1:] = self.rates * (tension - state[1:])
        return out

    def stop(self, state: Floats) -> None:
        """Bring heights back to the end stops, in place."""
        np.clip(state[0], 0.0, self.pin["stroke"], out=state[0])
