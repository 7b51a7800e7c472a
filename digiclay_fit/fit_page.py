"""Page and picture of a fit: signals, residuals, table, correlations, held-out trials, what it cannot see."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from digiclay.commands.gallery import make_table, wrap
from digiclay.core.base.arrays import Floats
from digiclay.plots.figure import LINES, canvas, legend_above, save

from .experiment import Prediction, Task
from .records import Trial
from .verdicts import Findings

#: Traps that residuals may not show, by part.
UNSEEN = {
    "pulp": (
        "a force some milliseconds late: --free lag",
        "position measured at the motor of a frame that gives: --free compliance",
        "a force that drifts: --free drift",
        "a wrong size of the fingertip: 10 % changes the stiffness by 10 to 12 %",
        "the law of a pin (--law pin) for a whole finger: 3.8 times the stiffness",
        "noise or steps of the position below some tenths of a micrometer",
        "more relaxation times than the scene has",
        "a tilted finger, or one that is no ellipsoid; adhesion",
    ),
    "cell": (
        "a wrong bore or fluid: viscosity times 1.5 changes the orifice by 11 %",
        "a wrong load: 10 % changes the pressures by 10 %",
        "a second lag in series: it counts as dead time",
        "gas in the fluid, friction and inertia of the pin, which the model does not have",
    ),
}
#: Scale and unit of what drives a part, and its name.
DRIVEN = {"pulp": (1e3, "mm", "position"), "cell": (1.0, "", "command")}
#: Scale and unit of a signal and of its residuals, and its name, by part.
SHOWN = {"pulp": (1.0, "N", 1e3, "mN", "force"), "cell": (1e3, "mm", 1e6, "µm", "height")}


def draw(found: Findings, part: str, out: Path) -> None:
    """Draw signals and residuals over time, of fitted and of held-out trials."""
    factor, unit, small, tiny, name = SHOWN[part]
    columns = [("fitted", found.trials, found.made.predicted, found.plain)]
    if found.held:
        columns.append(("held out", found.held, *found.held_predictions))
    width = 12.0 / len(columns) - 1.0
    with canvas(12.5, 6.6, f"Fit of a {part}") as (figure, place):
        for number, (title, trials, fitted, plain) in enumerate(columns):
            left = 0.95 + number * (width + 1.0)
            above = place(f"signal {number}", left, 2.75, width, 2.9)
            below = place(f"residual {number}", left, 0.7, width, 1.55)
            time = _lay_out(trials)
            measured = np.concatenate([trial.answer for trial in trials])
            for values, label, color, wide in (
                (measured, "measured", "#8A8A8A", 2.6),
                (plain, "unchanged scene", LINES[1], 1.6),
                (fitted, "fit", LINES[0], 1.6),
            ):
                shown = _break(trials, values) * factor
                line = "--" if label.startswith("un") else "-"
                above.plot(time, shown, line, color=color, label=label, linewidth=wide)
            rest = _break(trials, measured - fitted) * small
            below.plot(time, rest, color=LINES[0], linewidth=0.8)
            above.set_ylabel(f"{name} ({unit})")
            above.set_title(title, pad=26)
            below.set(xlabel="time, trials one after another (s)", ylabel=f"residual ({tiny})")
            legend_above(above, 3)
        save(figure, out)


def draw_protocol(best: Prediction, plain: Prediction, task: Task, other: str, out: Path) -> None:
    """Draw a designed measurement, and its intervals beside those of another one."""
    factor, unit, driven = DRIVEN[task.part]
    large, measured, _, _, answer = SHOWN[task.part]
    time = np.arange(best.drive.size) * task.limits.step
    with canvas(12.5, 6.6, f"Measurement of a {task.part}, designed") as (figure, place):
        for bottom, values, label in (
            (3.75, factor * best.drive, f"{driven} ({unit})" if unit else driven),
            (0.7, large * best.answer, f"predicted {answer} ({measured})"),
        ):
            axes = place(label, 0.95, bottom, 5.8, 2.15)
            axes.plot(time, values, color=LINES[0], linewidth=1.2)
            axes.set(xlabel="time (s)", ylabel=label)
        beside = place("widths", 9.4, 0.7, 2.8, 5.2)
        keys = [each.key for each in best.derived]
        beside.plot(100.0 * plain.widths, keys, "s", color=LINES[1], label=other)
        beside.plot(100.0 * best.widths, keys, "o", color=LINES[0], label="designed")
        beside.set(xscale="log", xlabel="half of the 95 % interval (%)")
        beside.invert_yaxis()
        legend_above(beside, 2)
        save(figure, out)


def _lay_out(trials: Sequence[Trial]) -> Floats:
    """Return the time of trials one after another, with NaN between them."""
    parts: list[Floats] = []
    end = 0.0
    for trial in trials:
        time = trial.time - trial.time[0] + end
        end = 1.05 * time[-1] - 0.05 * time[0]
        parts += [time, np.array([np.nan])]
    return np.concatenate(parts)


def _break(trials: Sequence[Trial], values: Floats) -> Floats:
    """Return values of trials with NaN between them."""
    ends = np.cumsum([trial.time.size for trial in trials])
    return np.insert(values, ends, np.nan)


def write_page(
    found: Findings, part: str, head: Sequence[str], rows: Sequence[Sequence[str]]
) -> str:
    """Return the page."""
    made, keys = found.made, [each.key for each in found.derived]
    cells = [
        [key, *(f"{value:.2f}" for value in row)]
        for key, row in zip(keys, found.correlation, strict=True)
    ]
    facts = (
        f"Known worst: {', '.join(made.worst)}. Smallest singular value of the scaled Jacobian: "
        f"{made.ratio:.2g} of the largest. Residuals: autocorrelation at lag 1 "
        f"{made.autocorrelation:.3f}, z {made.correlated:.1f}."
    )
    lines = [
        f"<p><strong>{escape(found.message)}</strong></p>",
        *(f"<p>{escape(line)}</p>" for line in found.cautions),
        '<p><img alt="signals and residuals" src="fit.png" style="max-width:100%"></p>',
        *make_table(head, rows),
        f"<p>{escape(facts)}</p>",
        "<h2>Correlations</h2>",
        *make_table(["", *keys], cells),
        "<h2>What residuals may not show</h2>",
        f"<ul>{''.join(f'<li>{escape(trap)}</li>' for trap in UNSEEN[part])}</ul>",
    ]
    return wrap(f"Fit of a {part}", lines)
