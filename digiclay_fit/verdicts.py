"""What a fit to measured trials is worth: compared with the unchanged scene, and on held-out trials."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from digiclay.core.base.arrays import Floats
from digiclay.core.base.errors import OutputError
from digiclay.core.model.touch import describe_excess
from digiclay.core.scene.schema import Scene

from .cell import KNEES, CellModel
from .estimation import (
    NORMAL,
    SEEN,
    Derived,
    Estimate,
    Model,
    estimate,
    find_rms,
    improves,
    minimize,
)
from .pulp import PulpModel
from .records import Trial, estimate_noise

#: Twice the logarithm of a likelihood ratio from which a free stroke contradicts a held one: 99.9 %.
CONTRADICTED = 10.83
#: Noise of the position that matters, as a share of that of the force.
TOO_NOISY = 0.15


class Findings(NamedTuple):
    """Fit, and what it is compared with."""

    made: Estimate
    derived: list[Derived]
    plain: Floats
    """Prediction of the unchanged scene, its zeros fitted."""
    trials: Sequence[Trial]
    held: Sequence[Trial]
    held_predictions: tuple[Floats, Floats]
    """Of held-out trials: fitted, and of the unchanged scene."""
    code: str
    """OK, NO_IMPROVEMENT or NOT_IDENTIFIABLE."""
    message: str
    cautions: list[str]

    @property
    def covariance(self) -> Floats:
        """Covariance of the derived values, (d, d)."""
        gradients = np.array([each.gradient for each in self.derived])
        covariance: Floats = gradients @ self.made.covariance @ gradients.T
        return covariance

    @property
    def spread(self) -> Floats:
        """Standard deviations of the derived values, (d,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))

    @property
    def half_widths(self) -> Floats:
        """Half widths of the 95 % intervals of the derived values, (d,); of logarithms where they are."""
        return NORMAL * self.spread

    @property
    def correlation(self) -> Floats:
        """Correlations of the derived values, (d, d)."""
        return self.covariance / np.outer(self.spread, self.spread)


def make_model(
    part: str, scene: Scene, trials: Sequence[Trial], groups: Sequence[str], law: str = "plate"
) -> Model:
    """Return the model of a part."""
    if part == "cell":
        return CellModel(scene, trials, groups)
    return PulpModel(scene, trials, groups, law)


def split_trials(trials: Sequence[Trial], text: str) -> tuple[list[Trial], list[Trial]]:
    """Return the trials to fit and those to predict, whose names are in a text."""
    names = [word.strip() for word in text.split(",") if word.strip()]
    known = [trial.name for trial in trials]
    for name in names:
        if name not in known:
            rule = f"must be of the trials {', '.join(known)[:200]}"
            raise OutputError(f"--holdout {rule} (got {name[:40]!r}).")
    fitted = [trial for trial in trials if trial.name not in names]
    if not fitted:
        raise OutputError("--holdout must leave a trial to fit (got all).")
    return fitted, [trial for trial in trials if trial.name in names]


def fit(
    part: str,
    scene: Scene,
    trials: Sequence[Trial],
    held: Sequence[Trial],
    groups: Sequence[str],
    law: str = "plate",
) -> Findings:
    """Fit a part of a scene to trials, and judge the fit."""
    model = make_model(part, scene, trials, groups, law)
    made = estimate(model)
    usual = minimize(model, made.free, model.defaults, **made.loss).whole
    plain, _ = model.predict(usual)
    unit, factor = ("mN", 1e3) if part == "pulp" else ("µm", 1e6)
    sizes = [factor * find_rms(model.measured - each) for each in (made.predicted, plain)]
    code, why = "OK", f"residuals {sizes[0]:.3g} {unit}, unchanged scene {sizes[1]:.3g} {unit}"
    predictions, errors = (np.empty(0), np.empty(0)), [0.0, 0.0]
    if held:
        other = make_model(part, scene, held, groups, law)
        predictions = _predict(other, made.free, model), _predict(other, usual, model)
        errors = [factor * find_rms(other.measured - each) for each in predictions]
        told = f"{errors[0]:.3g} {unit}, unchanged scene {errors[1]:.3g} {unit}"
        why += f"; held out {told}"
    if not improves(made, model.measured - plain, len(model.defaults)):
        code, why = "NO_IMPROVEMENT", f"the unchanged scene describes the data as well: {why}"
    elif errors[0] > errors[1]:
        code = "NO_IMPROVEMENT"
        why = f"the unchanged scene predicts the held-out trials better: {told}"
    lost = []
    if made.unknown:
        direction = f"known worst: {{{', '.join(made.worst)}}}"
        lost.append(f"the data do not determine {', '.join(made.unknown)}; {direction}")
    if part == "cell" and _needs_stroke(made, scene, trials, groups):
        lost.append("the flow is turbulent elsewhere than by valve.stroke, which must be free, too")
    if lost:
        unknown = "; ".join(lost)
        code, why = ("NOT_IDENTIFIABLE", unknown) if code == "OK" else (code, f"{why}; {unknown}")
    derived = model.derive(made.free)
    cautions = list(_list_cautions(made, trials))
    return Findings(
        made, derived, plain, trials, held, predictions, code, f"{code}: {why}", cautions
    )


def _needs_stroke(
    made: Estimate, scene: Scene, trials: Sequence[Trial], groups: Sequence[str]
) -> bool:
    """Return whether the stroke is held, and the data contradict it."""
    if "stroke" in groups:
        return False
    model = CellModel(scene, trials, (*groups, "stroke"))
    starts = [np.insert(made.free, 1, np.log(knee)) for knee in KNEES]
    best = min(float(minimize(model, start, **made.loss).cost) for start in starts)
    gain = 2.0 * (made.cost - best) / made.noise**2 * made.independent / made.residual.size
    return gain > CONTRADICTED


def _predict(other: Model, free: Floats, model: Model) -> Floats:
    """Return the prediction of held-out trials; only zeros that belong to a trial are fitted there."""
    start, *_ = other.list_starts()
    fixed = {
        number: free[model.index[each.key]]
        for number, each in enumerate(other.parameters)
        if each.key in model.index and not each.of_trial
    }
    start[list(fixed)] = list(fixed.values())
    if len(fixed) < start.size:
        start = minimize(other, start, fixed).whole
    return other.predict(start)[0]


def _list_cautions(made: Estimate, trials: Sequence[Trial]) -> Iterator[str]:
    """Give lines on what the residuals and the records show."""
    if made.correlated > SEEN:
        yield (
            "caution: the law does not describe the data, or their noise is not white: residuals are "
            f"correlated (lag 1: {made.autocorrelation:.2f}, z {made.correlated:.1f})"
        )
    if made.outliers:
        yield f"caution: outliers count little ({made.outliers})"
    model = made.model
    if isinstance(model, CellModel):
        return
    assert isinstance(model, PulpModel)
    b, m, _, times = model.read(made.free)
    step = max(float(np.median(np.diff(trial.time))) for trial in trials)
    if times.size and step > times.min():
        yield (
            f"caution: samples {step * 1e3:.3g} ms apart are too coarse for a relaxation time of "
            f"{times.min() * 1e3:.3g} ms"
        )
    zero = made.free[model.index["zero of position"]]
    jitter = max(estimate_noise(trial.drive) for trial in trials)
    steepest = max(float(model.press(b, m, trial.drive - zero)[1].max()) for trial in trials)
    if jitter * steepest > TOO_NOISY * made.noise:
        yield (
            f"caution: intervals are too narrow: noise or steps of the position, {jitter * 1e6:.2g} µm, "
            f"make {jitter * steepest * 1e3:.2g} mN; give the commanded position"
        )
    force = max(float(np.ptp(trial.answer)) for trial in trials)
    deepest = max(float(trial.drive.max()) for trial in trials) - float(zero)
    if excess := describe_excess(force, deepest):
        yield f"caution: {excess}"
