"""Blisters in section (Figs. 4 and 5 of the paper), and freezing along a drag (Fig. 6)."""

from __future__ import annotations

from typing import Any

import numpy as np
from digiclay.core.base.modes import Mode
from digiclay.core.session.run_scene import Result
from digiclay.plots.figure import INK, LINES, MM, canvas, legend_above

from .results import Results
from .scenes import COMPARED, NAMES

#: Color, marker and its size of each profile.
PROFILES = {"cone": (LINES[0], "o", 8.0), "gaussian": (LINES[1], "s", 5.0)}
#: Instants of a drag that are drawn.
INSTANTS = 5


def blisters(results: Results) -> Any:
    """Draw sections through raised and sunken blisters, both profiles, all methods."""
    methods = [method for method in COMPARED if (method, "convex", "cone") in results.blisters]
    height = 0.8 + 3.4 * len(methods)
    with canvas(12.5, height, "Blisters in section, the finger in place") as (figure, place):
        for row, method in enumerate(methods):
            for column, shape in enumerate(("convex", "concave")):
                axes = place(f"{method} {shape}", 0.85 + 6.15 * column, height - 3.5 - 3.4 * row, 5.25, 2.55)
                for profile, look in PROFILES.items():
                    done = results.blisters[method, shape, profile]
                    _section(axes, done, look, profile)
                _finger(axes, done, -1)
                rest = done.scene.actuator.rest_height * MM
                axes.axhline(rest, color=INK, linewidth=1.0, linestyle=(0, (5, 3)))
                axes.set(xlim=(-25, 25), title=f"{NAMES[method]}, {shape}", ylabel="height (mm)")
                axes.set_ylim((36, 64) if shape == "convex" else (28, 43))
                if row == len(methods) - 1:
                    axes.set_xlabel("distance from the middle (mm)")
        first = figure.axes[0]
        first.plot([], [], color=INK, linewidth=1.0, linestyle=(0, (5, 3)), label="bed at rest")
        first.plot([], [], color=INK, linewidth=1.2, label="fingertip")
        first.plot([], [], "o", color=INK, label="cell that feels it")
        handles, labels = first.get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper right", ncols=5, bbox_to_anchor=(0.99, 0.998),
                      handlelength=1.6, columnspacing=1.2)  # fmt: skip
    return figure


def _section(axes: Any, done: Result, look: tuple[str, str, float], name: str) -> None:
    """Draw the heights of the middle row; cells that feel the finger are filled."""
    place, height, force = (done.history[key] for key in ("position", "height", "force"))
    row = np.abs(place[:, 1]) < 1e-6
    color, marker, size = look
    across, top, felt = place[row, 0] * MM, height[-1, row] * MM, force[-1, row] > 0.0
    axes.plot(across, top, color=color, marker=marker, markersize=size, markerfacecolor="white", label=name)
    axes.plot(across[felt], top[felt], marker, color=color, markersize=size)


def _finger(axes: Any, done: Result, row: int) -> None:
    """Draw the fingertip's outline in the section."""
    tip, x, z = done.scene.section("fingertip"), *(done.history["fingertip"][row, [0, 2]] * MM)
    if tip is None:
        return
    turn = np.linspace(np.pi, 2.0 * np.pi, 91)
    wide, high = tip.length * MM, tip.height * MM
    axes.plot(x + wide * np.cos(turn), z + high * (1.0 + np.sin(turn)), color=INK, linewidth=1.2)


def freezing(results: Results) -> Any:
    """Draw sections along a drag at several times; frozen cells are marked."""
    methods = [method for method in COMPARED if method in results.drags]
    height = 0.8 + 3.7 * len(methods)
    with canvas(12.5, height, "Freezing: what the finger has left keeps its height") as (figure, place):
        from matplotlib import colormaps

        for panel, method in enumerate(methods):
            done, start, end = results.drags[method]
            axes = place(method, 0.85, height - 3.85 - 3.7 * panel, 11.3, 2.8)
            moments = done.history["time"]
            ridge = np.abs(done.history["position"][:, 1]) < 1e-6
            across = done.history["position"][ridge, 0] * MM
            for number, moment in enumerate(np.linspace(start, end, INSTANTS)):
                instant = int(np.argmin(np.abs(moments - moment)))
                color = colormaps["cividis"](0.9 * number / (INSTANTS - 1))
                top = done.history["height"][instant, ridge] * MM
                frozen = done.history["mode"][instant, ridge] == Mode.FROZEN
                axes.plot(across, top, color=color, label=f"{moment - start:.1f} s")
                axes.plot(
                    across[frozen], top[frozen], "s", color=color, markersize=8, markeredgecolor="white"
                )
                x, z = done.history["fingertip"][instant, [0, 2]] * MM
                axes.plot(x, z + 6.0, "v", color=color, markersize=9)
            axes.set(xlim=(-38, 38), ylim=(38, 65), ylabel="height (mm)", title=NAMES[method])
            if panel == 0:
                axes.plot([], [], "s", color=INK, label="frozen cell")
                axes.plot([], [], "v", color=INK, label="finger")
                legend_above(axes, 8)
        axes.set_xlabel("along the drag (mm)")
    return figure
