"""Least squares with exact Jacobians: what the data tell of each parameter, and what they cannot."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats

#: Quantile of a 95 % interval, and of twice the logarithm of a likelihood ratio with one parameter.
NORMAL, CHI = 1.959964, 3.841459
#: Smallest singular value of the scaled Jacobian, as a share of the largest, that is not rounding.
NULL = 1e-7
#: Scale of a column of zeros.
NOTHING = 1e-60
#: Half width, of a logarithm or as a share of the value, below which the profile is a parabola.
NARROW = 0.3
#: Ratio to the estimate at which a profile of a logarithm ends, and evaluations of a point of it.
FAR, EFFORT = math.log(100.0), 8
#: Half width, of a logarithm or as a share of the value, from which a parameter is not determined.
USELESS = 1.0
#: Share of the worst direction below which a parameter is not named.
NAMED = 0.2
#: Lag-1 autocorrelation, in standard deviations, from which residuals count as correlated.
SEEN = 3.0
#: Robust standard deviations beyond which a residual is an outlier.
OUTLIER = 6.0


class Parameter(NamedTuple):
    """A free parameter: key in scene files or name, unit, start and bounds; all as logarithms if `log`."""

    key: str
    unit: str
    start: float
    low: float
    high: float
    log: bool = False
    wanted: bool = True
    """Whether it is asked for, and not only free."""
    of_trial: bool = False
    """Whether each trial has one."""
    beside: str = ""
    """Key of what it cannot be told from where it is not bounded; its profile is always taken."""


class Derived(NamedTuple):
    """A value that a model reports: its number and its gradient over the free parameters."""

    key: str
    unit: str
    value: float
    """In SI; as a logarithm if `log`."""
    gradient: Floats
    log: bool


class Model(ABC):
    """Base of predictions of all samples of some trials from free parameters."""

    trials: Sequence[Any]
    parameters: tuple[Parameter, ...]
    measured: Floats
    held_first: tuple[str, ...] = ()
    """Keys of parameters that are held until the others are fitted, against other minima."""
    usual: Mapping[str, float] = MappingProxyType({})
    """Values in SI of parameters that are not free, by key; of all others 0."""

    @cached_property
    def index(self) -> dict[str, int]:
        """Places of the parameters, by key."""
        return {each.key: place for place, each in enumerate(self.parameters)}

    @cached_property
    def defaults(self) -> dict[int, float]:
        """Values of the scene for the parameters that it has, by index."""
        return {place: each.start for place, each in enumerate(self.parameters) if each.wanted}

    def predict(self, free: Floats) -> tuple[Floats, Floats]:
        """Return the prediction (n,) and its Jacobian (n, p)."""
        parts = [self.predict_trial(number, free) for number in range(len(self.trials))]
        return np.concatenate([part[0] for part in parts]), np.vstack([part[1] for part in parts])

    def read_value(self, free: Floats, key: str) -> float:
        """Return a parameter in SI, or what it is where it is not free."""
        if key not in self.index:
            return self.usual.get(key, 0.0)
        place = self.index[key]
        return math.exp(free[place]) if self.parameters[place].log else float(free[place])

    @abstractmethod
    def predict_trial(self, number: int, free: Floats) -> tuple[Floats, Floats]:
        """Return the prediction of a trial, and its Jacobian."""

    def list_starts(self) -> list[Floats]:
        """Return the values at which a fit starts; the best end counts."""
        return [np.array([each.start for each in self.parameters])]

    def refine(self, free: Floats) -> bool:
        """Renew what the model takes from an earlier fit; return whether another fit is needed."""
        return False

    def derive(self, free: Floats) -> list[Derived]:
        """Return the values of a scene that the parameters give: those that are wanted, in their order."""
        unit = np.eye(free.size)
        return [
            Derived(each.key, each.unit, float(free[i]), unit[i], each.log)
            for i, each in enumerate(self.parameters)
            if each.wanted
        ]


@dataclass(frozen=True)
class Judgment:
    """What the data tell of a parameter: verdict, and the ends of its 95 % interval."""

    verdict: str
    """bounded, one-sided, flat or at-bound."""
    low: float
    high: float


@dataclass(frozen=True)
class Estimate:
    """Fit of a model."""

    model: Model
    free: Floats
    predicted: Floats
    noise: float
    """Standard deviation of the residuals, without outliers."""
    covariance: Floats
    worst: tuple[str, ...]
    """Keys of the direction that is known worst."""
    ratio: float
    """Smallest singular value of the scaled Jacobian, as a share of the largest."""
    correlated: float
    """Lag-1 autocorrelation of the residuals, in standard deviations."""
    autocorrelation: float
    outliers: int
    cost: float
    loss: dict[str, Any]
    """Options of SciPy's loss: a robust one where there are outliers."""
    judgments: tuple[Judgment, ...] = ()

    @property
    def residual(self) -> Floats:
        """Measured less predicted, (n,)."""
        return self.model.measured - self.predicted

    @property
    def independent(self) -> float:
        """Number of independent samples that the residuals count as."""
        rho = max(self.autocorrelation, 0.0) if self.correlated > SEEN else 0.0
        return self.residual.size * (1.0 - rho) / (1.0 + rho)

    @property
    def widths(self) -> Floats:
        """Half widths of the Gauss-Newton intervals, (p,)."""
        return NORMAL * np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def unknown(self) -> list[str]:
        """Keys of the wanted parameters that the data do not determine."""
        names: list[str] = []
        for each, judged in zip(self.model.parameters, self.judgments, strict=True):
            if each.wanted and judged.verdict != "bounded":
                names += [name for name in (each.beside, each.key) if name]
        if set(self.worst) & set(names):
            names += self.worst
        return list(dict.fromkeys(names))


def minimize(
    model: Model, start: Floats, fixed: Mapping[int, float] = MappingProxyType({}), **more: Any
) -> Any:
    """Return SciPy's result, and all parameters as its `whole`; `fixed`: values by index."""
    from scipy.optimize import least_squares

    free = np.array([i for i in range(len(model.parameters)) if i not in fixed], np.intp)
    whole = start.copy()
    for index, value in fixed.items():
        whole[index] = value
    last: dict[bytes, tuple[Floats, Floats]] = {}

    def compute(values: Floats) -> tuple[Floats, Floats]:
        key = values.tobytes()
        if key not in last:
            last.clear()
            whole[free] = values
            last[key] = model.predict(whole)
        return last[key]

    ends = np.array([(each.low, each.high) for each in model.parameters])[free].T
    inside = 1e-9 * (ends[1] - ends[0])
    result = least_squares(
        lambda values: compute(values)[0] - model.measured,
        np.clip(start[free], ends[0] + inside, ends[1] - inside),
        jac=lambda values: compute(values)[1][:, free],
        bounds=ends,
        x_scale="jac",
        **{"xtol": 1e-9, "ftol": 1e-9, "gtol": 1e-12, "max_nfev": 60, **more},
    )
    whole[free] = result.x
    result.whole = whole.copy()
    return result


def measure_units(model: Model, free: Floats) -> Floats:
    """Return the units of relative widths, (p,): 1 of a logarithm, else the size of the value."""
    pairs = zip(model.parameters, free, strict=True)
    return np.array([1.0 if each.log else max(abs(value), 1e-12) for each, value in pairs])


def estimate(model: Model) -> Estimate:
    """Fit a model to its measured samples, with intervals and a verdict for each parameter."""
    results = []
    for start in model.list_starts():
        held = {
            place: start[place] for key, place in model.index.items() if key in model.held_first
        }
        begun = minimize(model, start, held).whole if held else start
        results.append(minimize(model, begun))
    result = min(results, key=lambda each: float(each.cost))
    while model.refine(result.whole):
        result = minimize(model, result.whole)
    residual = result.fun
    noise = math.sqrt(2.0 * result.cost / max(1, residual.size - result.whole.size))
    robust = 1.4826 * float(np.median(np.abs(residual)))
    outliers = int((np.abs(residual) > OUTLIER * robust).sum())
    loss: dict[str, Any] = {}
    if outliers:
        loss = {"loss": "soft_l1", "f_scale": robust}
        result = minimize(model, result.whole, **loss)
        residual = result.fun
        ratio = residual / robust
        root = np.sqrt(1.0 + ratio * ratio)
        noise = robust * math.sqrt(float(np.mean((ratio / root) ** 2))) / float(np.mean(root**-3.0))
    free = result.whole
    predicted, jacobian = model.predict(free)
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = NOTHING
    _, values, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    sound = values > NULL * values[0]
    inverse = rows[sound].T / values[sound] / scale[:, None]
    centered = residual - residual.mean()
    rho = float(centered[1:] @ centered[:-1] / max(centered @ centered, 1e-300))
    seen = rho * math.sqrt(residual.size)
    covariance = noise**2 * inverse @ inverse.T
    if seen > SEEN:
        middle = jacobian @ (inverse @ inverse.T)
        covariance = noise**2 * middle.T @ _correlate(middle, rho)
    units = measure_units(model, free)
    null = rows[~sound] / scale / units
    null /= np.linalg.norm(null, axis=1, keepdims=True)
    worst = _name_worst(model, null, covariance / np.outer(units, units))
    made = Estimate(
        model,
        free,
        predicted,
        noise,
        covariance,
        worst,
        float(values[-1] / values[0]),
        seen,
        rho,
        outliers,
        float(result.cost),
        loss,
    )
    flat = (null**2).sum(axis=0) > 1e-3
    return replace(made, judgments=tuple(_judge(made, i, bool(flat[i])) for i in range(free.size)))


def _name_worst(model: Model, null: Floats, relative: Floats) -> tuple[str, ...]:
    """Return the keys of the direction that is known worst: a null direction, else the widest.

    `null`: null directions of the Jacobian, (k, p); `relative`: covariance in units of the values.
    """
    wanted = np.array([each.wanted for each in model.parameters])
    shares = np.abs(null[np.linalg.norm(null[:, wanted], axis=1) > 0.3])
    if len(shares):
        worst = shares[0] * wanted
    else:
        worst = np.zeros(wanted.size)
        _, vectors = np.linalg.eigh(relative[np.ix_(wanted, wanted)])
        worst[wanted] = np.abs(vectors[:, -1])
    order = [model.parameters[i] for i in np.argsort(-worst) if worst[i] > NAMED * worst.max()]
    names = [name for each in order for name in (each.beside, each.key) if name]
    return tuple(dict.fromkeys(names))


def _correlate(columns: Floats, rho: float) -> Floats:
    """Return columns multiplied by the correlations of an AR(1) process."""
    from scipy.signal import lfilter

    ahead = lfilter([1.0], [1.0, -rho], columns, axis=0)
    behind = lfilter([1.0], [1.0, -rho], columns[::-1], axis=0)[::-1]
    summed: Floats = ahead + behind - columns
    return summed


def _judge(made: Estimate, index: int, flat: bool) -> Judgment:
    """Return verdict and interval of a parameter: Gauss-Newton's where it is narrow, else a profile."""
    each, value, half = made.model.parameters[index], made.free[index], made.widths[index]
    low, high = max(value - half, each.low), min(value + half, each.high)
    if flat and not each.beside:
        return Judgment("flat", each.low, each.high)
    if not each.wanted:
        return Judgment("bounded", low, high)
    if min(value - each.low, each.high - value) < min(1e-4 * (each.high - each.low), 0.05 * half):
        return Judgment("at-bound", low, high)
    if not each.beside and half < (NARROW if each.log else NARROW * abs(value)):
        return Judgment("bounded", low, high)
    reach = FAR if each.log else math.inf
    ends = max(value - reach, each.low), min(value + reach, each.high)
    below, above = (_excess(made, index, end) < CHI for end in ends)
    if below and above:
        return Judgment("flat", *ends)
    if below == above:
        useless = half > USELESS * (1.0 if each.log else abs(value))
        return Judgment("flat" if useless else "bounded", low, high)
    far, near = (ends[0], value) if above else (ends[1], value)
    for _ in range(7):
        middle = 0.5 * (far + near)
        if _excess(made, index, middle) < CHI:
            near = middle
        else:
            far = middle
    return Judgment("one-sided", *((near, ends[1]) if above else (ends[0], near)))


def _excess(made: Estimate, index: int, value: float) -> float:
    """Return twice the logarithm of the likelihood ratio with a parameter at a value, the others refitted."""
    column = made.covariance[:, index]
    moved = column / column[index] if column[index] > 0.0 else np.zeros(column.size)
    starts = made.free, made.free + moved * (value - made.free[index])
    fixed = {index: value}
    begun = [minimize(made.model, start, fixed, max_nfev=2, **made.loss) for start in starts]
    best = min(begun, key=lambda each: each.cost).whole
    result = minimize(made.model, best, fixed, max_nfev=EFFORT, **made.loss)
    share = made.independent / made.residual.size
    return float(2.0 * max(result.cost - made.cost, 0.0) / made.noise**2 * share)


def find_rms(values: Floats) -> float:
    """Return the root mean square of values."""
    return float(np.sqrt(np.mean(values**2)))


def improves(made: Estimate, plain: Floats, count: int) -> bool:
    """Return whether a fit of `count` parameters beats the residuals `plain` by likelihood ratio."""
    from scipy.special import gammaincinv

    residual = made.residual
    regular = np.abs(residual) <= OUTLIER * made.noise
    squares = [max(float(np.mean(each[regular] ** 2)), 1e-300) for each in (plain, residual)]
    gain = made.independent * math.log(squares[0] / squares[1])
    return bool(gain > 2.0 * gammaincinv(0.5 * count, 0.95))  # of the chi-squared distribution
