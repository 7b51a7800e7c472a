"""Table of all metrics of sessions and of methods: units, labels and meanings; time and errors as text."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from ..base.quantity import show_digits

#: Factor from the SI unit to the unit that people read.
FACTORS = {"mm": 1e3, "mm/s": 1e3, "mN": 1e3, "µm": 1e6, "µs": 1e6, "ml": 1e6, "%": 1e2}


class Metric(NamedTuple):
    """Number by which a session or a control method is judged."""

    unit: str
    """SI; "1" of a share or a count."""
    worse: Literal["higher", "lower", "absent", "neither"]
    """Which amounts are worse; absent: higher ones, and none at all is worst."""
    doc: str
    label: str = ""
    """Short name for people, where one is shown."""
    shown: str = ""
    """Unit that people read."""

    @property
    def factor(self) -> float:
        """Factor from SI to the unit shown."""
        return FACTORS.get(self.shown, 1.0)

    @property
    def title(self) -> str:
        """Label with the unit shown, ``lag (mm)``."""
        return f"{self.label} ({self.shown})" if self.shown else self.label


#: Metrics of a history, from `summary.compute_metrics`, in its order.
METRICS: dict[str, Metric] = {
    "duration": Metric(
        "s", "neither", "simulated time from the first row to the last", "duration", "s"
    ),
    "set_point": Metric(
        "N",
        "neither",
        "total force asked for; one that changes from row to row: its mean while shaping",
        "set point",
        "N",
    ),
    "rfd": Metric(
        "N",
        "higher",
        "rms over time of (total force - set point) while the fingertip touches",
        "RFD",
        "mN",
    ),
    "rfd_shaping": Metric(
        "N",
        "higher",
        "the same, only while a cell follows the force: without touching down",
        "RFD while shaping",
        "mN",
    ),
    "rfd_session": Metric(
        "N", "higher", "the same over the whole session; without contact the force is 0"
    ),
    "contact_share": Metric(
        "1", "lower", "share of the session's time in which the fingertip touches"
    ),
    "contact_loss_share": Metric(
        "1",
        "higher",
        "share of the time from first to last contact in which it does not touch",
        "without contact",
        "%",
    ),
    "lag_mean": Metric(
        "m",
        "higher",
        "mean horizontal distance from fingertip to the centroid of the cells' forces",
        "lag",
        "mm",
    ),
    "lag_max": Metric("m", "higher", "largest such distance", "largest lag", "mm"),
    "force_deviation": Metric(
        "N",
        "higher",
        "standard deviation over time of the total force while shaping",
        "force deviation",
        "mN",
    ),
    "force_oscillation": Metric(
        "N",
        "higher",
        "rms over time of the total force minus its moving average over 0.25 s, while shaping",
    ),
    "force_overshoot": Metric(
        "1", "higher", "first touch: largest force beyond the set point, as a share of it"
    ),
    "settling_time": Metric(
        "s",
        "absent",
        "first touch: from touching down until the force stays within 10 % of its set point",
    ),
    "height_deviation": Metric(
        "m",
        "higher",
        "standard deviation over time of the surface's height over the fingertip, shaping",
        "height deviation",
        "mm",
    ),
    "ridge_offset": Metric(
        "m", "higher", "mean height of what the fingertip left behind over its path"
    ),
    "ridge_error": Metric("m", "higher", "rms of the same", "ridge-height error", "mm"),
    "ridge_unevenness": Metric("m", "higher", "standard deviation of the same", "unevenness", "mm"),
    "max_cell_force": Metric("N", "higher", "largest force on one cell"),
    "max_total_force": Metric(
        "N", "higher", "largest force on all cells together", "largest force", "N"
    ),
    "lowest": Metric("m", "neither", "height of the lowest pin at the end"),
    "highest": Metric("m", "neither", "height of the highest pin at the end"),
    "height_range": Metric(
        "m",
        "neither",
        "highest minus lowest pin: the relief that was formed",
        "relief formed",
        "mm",
    ),
    "raised_volume": Metric("m3", "neither", "volume formed above the initial surface"),
    "sunk_volume": Metric("m3", "neither", "volume formed below the initial surface"),
    "rfd_jnd_least": Metric(
        "1",
        "higher",
        "RFD divided by the largest just noticeable difference of the set point",
        "RFD, at least",
        "JND",
    ),
    "rfd_jnd_most": Metric(
        "1",
        "higher",
        "RFD divided by the smallest just noticeable difference of the set point",
        "RFD, at most",
        "JND",
    ),
    "ridge_unevenness_touch": Metric(
        "1",
        "higher",
        "ridge_unevenness divided by the spatial resolution of a fingertip",
        "unevenness",
        "spatial resolutions",
    ),
}
#: Metrics of a run beside those of its history.
RUN: dict[str, Metric] = {
    "losses": Metric(
        "1",
        "higher",
        "how often the controller lost the fingertip, at every lift-off too",
        "losses",
    ),
    "run_time": Metric("s", "higher", "time the simulation took", "run time", "s"),
    "real_time_factor": Metric("1", "lower", "simulated time over run time"),
    "simulated": Metric("s", "neither", "simulated time", "simulated", "s"),
    "max_indentation": Metric("m", "higher", "largest indentation of the fingertip by a pin"),
}
#: Messages among the metrics of a run on what goes beyond the models of finger and body.
BEYOND = ("beyond_a_finger", "beyond_cap")
#: Errors of a run, for which it is integrated once more. Each covers the truth in 95 of 100 runs:
#: no bound.
ERRORS: dict[str, Metric] = {
    "height_error": Metric(
        "m", "higher", "largest error of a pin's height, estimated", "height error, about", "µm"
    ),
    "force_error": Metric(
        "N", "higher", "largest error of the force on a cell, estimated", "force error, about", "mN"
    ),
    "total_force_error": Metric(
        "N",
        "higher",
        "largest error of the total force, estimated",
        "total force error, about",
        "mN",
    ),
}
#: Largest speeds at which a fingertip is followed.
SPEEDS: dict[str, Metric] = {
    "largest_drag_speed": Metric(
        "m/s",
        "lower",
        "fastest straight level drag of a ridge that is followed",
        "largest speed of drags",
        "mm/s",
    ),
    "largest_lift_speed": Metric(
        "m/s",
        "lower",
        "fastest lift straight up that is followed",
        "largest speed of lifts",
        "mm/s",
    ),
}
#: Speed limit of every lift.
FREE: dict[str, Metric] = {
    "free_rise": Metric(
        "m/s", "lower", "speed of a pin without load", "speed limit of lifts", "mm/s"
    )
}
#: Metrics of a method beside those of a history.
METHOD: dict[str, Metric] = {
    "relief_rms": Metric(
        "m",
        "higher",
        "rms deviation of the formed relief from the nominal one",
        "relief error",
        "mm",
    ),
    "relief_largest": Metric(
        "m", "higher", "largest deviation of the formed relief from the nominal one"
    ),
    "losses": Metric(
        "1",
        "higher",
        "how often contact ended though the fingertip rose no faster than a pin can",
        "losses",
    ),
    "speed_limit": Metric("m/s", "lower", "largest speed that is followed", "speed limit", "mm/s"),
    "period_cost": Metric(
        "s",
        "higher",
        "processor time per control period, including the device",
        "cost per period",
        "µs",
    ),
    "cost_ratio": Metric("1", "higher", "the same over that of the first method", "cost, ratio"),
}


def describe_losses(metrics: Mapping[str, Any]) -> str:
    """Return how often each finger of a run was lost, and how long it was without contact, or ``""``."""
    fingers, lines = metrics.get("lost", ()), []
    for number, finger in enumerate(fingers, 1):
        if finger["losses"]:
            name = f"finger {number} " if len(fingers) > 1 else ""
            often = "once" if finger["losses"] == 1 else f"{finger['losses']} times"
            lines.append(f"{name}lost {often}, {show_digits(finger['time'])} s without contact")
    return "; ".join(lines)


def list_beyond(metrics: Mapping[str, Any]) -> list[str]:
    """Return what of a run goes beyond the models of finger and body."""
    return [message for name in BEYOND if (message := metrics.get(name))]


def describe_time(metrics: Mapping[str, Any]) -> str:
    """Return how long a run took, ``26.5 s simulated in 0.65 s (41 x real time)``."""
    simulated, spent, factor = (
        metrics[name] for name in ("simulated", "run_time", "real_time_factor")
    )
    return f"{simulated:.1f} s simulated in {show_digits(spent)} s ({show_digits(factor, 3)} x real time)"


def describe_errors(metrics: Mapping[str, Any]) -> str:
    """Return the estimated errors of a run, or why there are none; ``errors_in_doubt`` too."""
    if metrics.get("height_error") is None:
        return f"errors not estimated ({metrics.get('errors_absent') or 'not asked for'})"
    height, force = (
        show_digits(ERRORS[name].factor * metrics[name]) for name in ("height_error", "force_error")
    )
    doubt = f" (or more: {metrics['errors_in_doubt']})" if metrics.get("errors_in_doubt") else ""
    return f"height error about {height} µm, force error about {force} mN{doubt}"
