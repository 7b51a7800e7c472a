"""Deviations in the paper's windows: the times in its session between which it compares the methods."""

from __future__ import annotations

import numpy as np
from digiclay.core.metrics.finger_path import measure_surface_under, sum_cells
from digiclay.core.metrics.force import compute_deviation, compute_rfd, compute_weights
from digiclay.core.model.control_interface import find_set_point
from digiclay.core.session.run_scene import Result

#: Along the ridge and along the valley, s.
RIDGE, VALLEY = (5.0, 10.0), (18.0, 25.0)
WINDOWS = {"both": (RIDGE, VALLEY), "ridge alone": (RIDGE,), "valley alone": (VALLEY,)}


def measure_windows(done: Result) -> dict[str, dict[str, float | None]]:
    """Return RFD, N, and deviations of force, N, and height, m, while shaping, by the names of `WINDOWS`."""
    time, sums = done.history["time"], sum_cells(done.history)
    weight, wanted = compute_weights(time), find_set_point(done.scene.set_point, sums.following)
    above = np.full(len(time), np.nan)
    above[sums.touching] = measure_surface_under(sums, done.history["fingertip"])
    found = {}
    for name, spans in WINDOWS.items():
        rows = sums.shaping & np.any([(time >= start) & (time <= end) for start, end in spans], axis=0)
        found[name] = {
            "rfd": compute_rfd(time, sums.total, wanted, rows),
            "force_deviation": compute_deviation(sums.total[rows], weight[rows]),
            "height_deviation": compute_deviation(above[rows], weight[rows]),
        }
    return found
