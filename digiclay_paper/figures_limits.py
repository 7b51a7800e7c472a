"""Limits: oscillation over gain (Fig. 9), and tracking speed."""

from __future__ import annotations

from typing import Any

from digiclay.plots.figure import INK, LINES, MM, canvas, legend_above

from .results import PAPER_SPEED, SUSTAINED, Results
from .scenes import COMPARED, NAMES, PRESSED, THIRD

#: Told apart with any color vision; markers say the same once more.
METHOD_COLORS = {"virtual_master": LINES[0], "cell_states": LINES[1], THIRD: LINES[2]}
MARKERS = "os^D"


def oscillation(results: Results) -> Any:
    """Draw the force after a quick press at three gains, and what the sweep of the gains came to."""
    position_gains = sorted({one.position_gain for one in results.swings})
    middle = position_gains[len(position_gains) // 2]
    with canvas(13.0, 7.6, f"Method I holding still after a quick press of {PRESSED * MM:g} mm") as (
        figure,
        place,
    ):
        detail = place("detail", 0.85, 4.4, 11.7, 2.25)
        set_point = _details(detail, results, middle)
        detail.axhline(set_point, color=INK, linewidth=1.0, linestyle=(0, (5, 3)))
        detail.set(xlabel="time after the press (s)", ylabel="total force (N)", xlim=(-0.2, 2.4))
        detail.set_ylim(0.0, 2.5 * set_point)
        detail.set_title(f"$K_p$ = {middle:g} 1/m (beyond the frame: the press itself)")
        legend_above(detail)
        swing = place("amplitude", 0.85, 0.75, 5.4, 2.6)
        settle = place("settling", 7.15, 0.75, 5.4, 2.6)
        rows = {f"$K_p$ = {gain:g} 1/m": gain for gain in position_gains}
        sweeps = {
            label: [one for one in results.swings if one.position_gain == gain]
            for label, gain in rows.items()
        }
        sweeps[f"{position_gains[0]:g} 1/m, quicker device"] = results.quicker
        for number, (label, found) in enumerate(sweeps.items()):
            row = sorted(found, key=lambda one: one.gain)
            style: dict[str, Any] = {"color": LINES[number], "marker": MARKERS[number]}
            swing.plot([one.gain for one in row], [one.amplitude for one in row], label=label, **style)
            calm = [one for one in row if one.settling is not None]
            settle.plot([one.gain for one in calm], [one.settling for one in calm], label=label, **style)
        swing.axhline(SUSTAINED, color=INK, linewidth=1.0, linestyle=(0, (5, 3)))
        swing.set(
            ylabel="amplitude in the last second (N)", ylim=(0.0, None), title="Oscillation that goes on"
        )
        settle.set(
            ylabel="time to settle within 10 % (s)", ylim=(0.0, None), title="Response (no point: it goes on)"
        )
        ticks = [2, 5, 10, 20, 50, 100]
        for axes in (swing, settle):
            axes.set_xscale("log")
            axes.set_xticks(ticks, [str(tick) for tick in ticks])
            axes.minorticks_off()
            axes.set(xlabel="force gain $K_f$ (1/N)", xlim=(1.7, 190))
        settle.legend(loc="upper right", borderaxespad=0.0)
    return figure


def _details(axes: Any, results: Results, position_gain: float) -> float:
    """Draw the force at the lowest gain, at the last one that is calm, and at the first that is not."""
    gains = sorted(gain for gain, known in results.details if known == position_gain)
    calm, wild = results.onset(position_gain)
    chosen = list(dict.fromkeys(gain for gain in (gains[0], calm, wild) if gain is not None))
    for color, gain in zip(LINES, chosen, strict=False):
        done, quick = results.details[gain, position_gain]
        axes.plot(
            done.history["time"] - quick, done.history["total_force"], color=color,
            linewidth=1.4, label=f"$K_f$ = {gain:g} 1/N",
        )  # fmt: skip
    assert done.scene.set_point is not None  # Method I has one
    return done.scene.set_point.force


def tracking(results: Results) -> Any:
    """Draw RFD and lag against the speed of a level drag, all methods."""
    limits = results.criterion
    with canvas(12.5, 5.2, "A ridge 15 mm high, drawn straight and level") as (figure, place):
        panels = (
            ("rfd", "RFD (N)", 1.0, limits.deviation, place("rfd", 0.85, 0.75, 5.1, 3.5)),
            ("lag", "largest lag (mm)", MM, limits.lag, place("lag", 7.0, 0.75, 5.1, 3.5)),
        )
        for name, label, factor, limit, axes in panels:
            for marker, method in zip(MARKERS, COMPARED, strict=False):
                row, color = results.tracks.get(method, []), METHOD_COLORS[method]
                speed = [one.speed * MM for one in row]
                value = [getattr(one, name) * factor for one in row]
                axes.plot(speed, value, color=color, alpha=0.9, label=NAMES[method] if row else None)
                for one, x, y in zip(row, speed, value, strict=True):
                    fill = color if one.losses == 0 and one.loss_share == 0.0 else "white"
                    axes.plot(x, y, marker, color=color, markerfacecolor=fill, markersize=7)
            axes.axhline(limit * factor, color=INK, linewidth=1.0, linestyle=(0, (5, 3)))
            axes.axvline(PAPER_SPEED * MM, color=INK, linewidth=1.0, linestyle=(0, (1, 2)))
            axes.set(xlabel="finger's speed (mm/s)", ylabel=label, xlim=(0, None), ylim=(0, None))
            axes.set_title(label.split(" (")[0])
        first = panels[0][-1]
        first.plot([], [], "o", color=INK, markerfacecolor="white", label="without contact, or lost")
        first.plot([], [], color=INK, linewidth=1.0, linestyle=(0, (5, 3)), label="criterion")
        first.plot([], [], color=INK, linewidth=1.0, linestyle=(0, (1, 2)), label="the paper's 15 mm/s")
        handles, labels = first.get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper left", ncols=6, bbox_to_anchor=(0.005, 0.93),
                      fontsize=10, handlelength=1.2, columnspacing=0.8)  # fmt: skip
    return figure
