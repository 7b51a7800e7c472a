"""Effects of one change: no rise, cells ahead, Method II's gain, search radius."""

from __future__ import annotations

from typing import Any

import numpy as np
from digiclay.plots.figure import INK, LINES, MM, canvas

from .panel import NAMED
from .results import AHEAD, AS_IT_IS, PAPER_SPEED, SUSTAINED, Results
from .scenes import METHODS
from .variants import NO_RISE

DASHED = (0, (5, 3))


def variants(results: Results) -> Any:
    """Draw what the claims on the variants rest on."""
    with canvas(13.0, 8.4, "One thing changed") as (figure, place):
        _rise(place("rise", 1.9, 4.75, 4.4, 2.6), results)
        _ahead(place("ahead", 8.2, 4.75, 4.4, 2.6), results)
        _gains(place("gains", 0.95, 0.75, 5.35, 2.7), results)
        _radius(place("radius", 7.25, 0.75, 5.35, 2.7), results)
    return figure


def _rise(axes: Any, results: Results) -> None:
    names = [name for variant, _, name in results.dragged if variant == NO_RISE]
    for number, (variant, called) in enumerate(((AS_IT_IS, "with the rise"), (NO_RISE, "without"))):
        found = [results.dragged[variant, METHODS[1], name] for name in names]
        _across(axes, names, [one.force for one in found], number, called)
    axes.set(xlabel="mean total force (N)", title=f"Method II, drags at {PAPER_SPEED * MM:g} mm/s")
    axes.set_xlim(0.0, 1.55 * max(line.get_xdata().max() for line in axes.get_lines()))
    axes.legend(loc="center right", borderaxespad=0.0)


def _ahead(axes: Any, results: Results) -> None:
    found = {
        (method, name): one.ahead * MM
        for (variant, method, name), one in results.dragged.items()
        if variant == AS_IT_IS and one.ahead is not None and "ridge" not in name
    }
    names = list(dict.fromkeys(name for _, name in found))
    for number, (method, called) in enumerate(zip(METHODS, ("Method I", "Method II"), strict=True)):
        _across(axes, names, [found.get((method, name), np.nan) for name in names], number, called)
    near, far = (f"{one * MM:g}" for one in AHEAD)
    axes.axvline(0.0, color=INK, linewidth=1.0, linestyle=DASHED)
    axes.set(xlabel="height over the bed at rest (mm)", title=f"Cells {near} to {far} mm ahead")
    lowest, highest = min(found.values()), max(found.values())
    axes.set_xlim(1.15 * lowest, max(-0.1 * lowest, 1.5 * highest))
    axes.legend(loc="upper left", borderaxespad=0.0)


def _across(axes: Any, names: list[str], values: list[float], number: int, called: str) -> None:
    """Draw a marker for each name, a color and shape for each call."""
    y = -np.arange(len(names)) + 0.12 - 0.24 * number
    style: dict[str, Any] = {"color": LINES[number], "linestyle": "", "markersize": 9}
    axes.plot(values, y, "os"[number], label=called, **style)
    axes.set_yticks(-np.arange(len(names)), names)
    axes.set_gid(NAMED)
    axes.set_ylim(-len(names) + 0.4, 0.6)


def _gains(axes: Any, results: Results) -> None:
    used = getattr(results.printed[METHODS[0]].scene.control, "position_gain", 0.0)
    one = [swing for swing in results.swings if swing.position_gain == used]
    shown = (("Method I", one, LINES[0], "o-"), ("Method II", results.cell_swings, LINES[1], "s-"))
    for called, swings, color, look in shown:
        row = sorted(swings, key=lambda swing: swing.gain)
        values = [swing.gain for swing in row], [swing.amplitude for swing in row]
        axes.plot(*values, look, color=color, label=called)
    axes.axhline(SUSTAINED, color=INK, linewidth=1.0, linestyle=DASHED)
    axes.set_xscale("log")
    ticks = [2, 5, 10, 20, 50, 100, 200, 400]
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.set(xlabel="$K_f$ of the master, $K_{FF}$ of a cell (1/N)", ylim=(0.0, None))
    axes.set(ylabel="amplitude of the force (N)", title="Held still after a quick press")
    axes.legend(loc="upper left", borderaxespad=0.0)


def _radius(axes: Any, results: Results) -> None:
    kinds = sorted({(one.thresholds, one.radius) for one in results.located})
    least = min(radius for _, radius in kinds)
    for known, radius in kinds:
        row = [
            one
            for one in sorted(results.located, key=lambda one: one.noise)
            if (one.thresholds, one.radius) == (known, radius) and one.scatter is not None
        ]
        # With thresholds both lie upon each other: the smaller markers on top.
        near = f"$r_{{VM}}$ = {radius * MM:g} mm" if radius == least else "no radius"
        axes.plot(
            [one.noise * MM for one in row], [(one.scatter or 0.0) * MM for one in row],
            color=LINES[int(radius != least)], marker="os"[int(radius != least)],
            markersize=5 if radius == least else 9, zorder=3 if radius == least else 2,
            linestyle="--" if known else "-", markerfacecolor="white" if known else None,
            label=near + (", thresholds" if known else ""),
        )  # fmt: skip
    axes.set(xlabel="noise of a cell's force sensor (mN)", ylabel="scatter of the master (mm)")
    axes.set(title="Method I, finger held still", xlim=(0.0, None), ylim=(0.0, None))
    axes.legend(loc="upper left", borderaxespad=0.0)
