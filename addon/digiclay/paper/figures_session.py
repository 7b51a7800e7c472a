"""The paper's session: heights and force over time (Fig. 8), the final surfaces (Fig. 10)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core.metrics import in_contact
from ..plots.bed import draw_map, draw_path, draw_relief
from ..plots.figure import INK, LINES, MM, SHADE, canvas, legend_above
from ..plots.run import LETTERS, session_cells
from .scenes import METHODS, NAMES
from .trials import Session

__all__ = ["heights_and_force", "surfaces"]


def heights_and_force(sessions: Mapping[str, Session], title: str) -> Any:
    """Draw the heights of the same cells, and the total force, side by side for both methods."""
    cells = session_cells(sessions[METHODS[0]].history)
    lowest = min(float(one.history["height"][:, cells].min()) for one in sessions.values()) * MM - 2.0
    highest = max(float(one.history["height"][:, cells].max()) for one in sessions.values()) * MM + 2.0
    strongest = 1.1 * max(float(one.history["total_force"].max()) for one in sessions.values())
    with canvas(13.5, 7.4, title) as (figure, place):
        for column, method in enumerate(METHODS):
            history = sessions[method].history
            left = 0.85 + 6.5 * column
            heights = place(f"{method} heights", left, 3.5, 5.75, 2.7)
            force = place(f"{method} force", left, 0.7, 5.75, 2.0)
            touching = in_contact(history["total_force"])
            for axes in (heights, force):
                over = axes.get_xaxis_transform()
                axes.fill_between(
                    history["time"], 0, 1, where=touching, transform=over, color=SHADE, linewidth=0
                )
                axes.set_xlim(history["time"][0], history["time"][-1])
            for name, colour, cell in zip(LETTERS, LINES, cells, strict=False):
                heights.plot(history["time"], history["height"][:, cell] * MM, color=colour, label=name)
            heights.set(ylim=(lowest, highest), title=NAMES[method])
            heights.tick_params(labelbottom=False)
            force.plot(history["time"], history["total_force"], color=INK, linewidth=1.2)
            asked = {"color": LINES[1], "linewidth": 1.2, "linestyle": (0, (5, 3)), "label": "set point"}
            force.plot(history["time"], history["set_point"], **asked)
            force.fill_between([], [], color=SHADE, label="in contact")
            force.set(ylim=(0.0, strongest), xlabel="time (s)", title="Total force")
            legend_above(force)
            if column == 0:
                heights.set_ylabel("height (mm)")
                force.set_ylabel("force (N)")
                handles, _ = heights.get_legend_handles_labels()
        spots = sessions[METHODS[0]].history["position"][cells] * MM
        names = [f"{name} ({x:.0f}, {y:.0f})" for name, (x, y) in zip(LETTERS, spots, strict=False)]
        figure.text(0.85 / 13.5, 1.0 - 0.78 / 7.4, "Cells at x, y (mm):")
        figure.legend(handles, names, loc="upper left", ncols=6, bbox_to_anchor=(0.205, 1.0 - 0.5 / 7.4))
    return figure


def surfaces(sessions: Mapping[str, Session], title: str) -> Any:
    """Draw the final surfaces in relief and from above, side by side for both methods."""
    with canvas(13.5, 9.6, title) as (figure, place):
        for column, method in enumerate(METHODS):
            history, left = sessions[method].history, 6.6 * column
            relief = place(
                f"{method} relief", left - 0.9, 4.1, 8.0, 5.9, projection="3d", computed_zorder=False
            )
            draw_relief(relief, history)
            figure.text((left + 0.3) / 13.5, 8.85 / 9.6, NAMES[method])
            plan = place(f"{method} map", left + 1.1, 0.7, 4.2, 3.6)
            draw_map(plan, history, "")
            draw_path(plan, history)
            if np.ptp(history["height"][-1]) == 0.0:
                plan.set_title("nothing was formed")
    return figure
