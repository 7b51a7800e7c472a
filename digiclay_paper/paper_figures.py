"""Figures of blisters, limits and variants; lettered panels, and curves as a table."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import product
from typing import Any

import numpy as np
from digiclay.core.base.modes import Mode
from digiclay.core.session.run_scene import Result
from digiclay.core.studies.sweep_plan import format_csv
from digiclay.plots.figure import DASHES, INK, LINES, MM, empty, legend_above

from .results import AHEAD, AS_IT_IS, PAPER_SPEED, SUSTAINED, Results
from .scenes import COMPARED, METHODS, NAMES, PRESSED, THIRD
from .simulations import NO_RISE

#: Columns of the tables: which panel and curve, and a point of it, with what the axes are called.
COLUMNS = ("panel", "curve", "x", "x_axis", "y", "y_axis")
#: Label of axes that only hold a scale of colors.
SCALE = "scale"
#: Identifier of axes whose vertical axis has names for its ticks, and no numbers.
NAMED = "named"


def letter(figure: Any) -> None:
    """Put a letter before the title of every panel, in the order in which they were placed."""
    panels = [axes for axes in figure.axes if axes.get_label() != SCALE]
    for number, axes in enumerate(panels):
        title = axes.get_title(loc="left")
        axes.set_title(f"({chr(ord('a') + number)}) {title}".rstrip(), loc="left")


def curves(figure: Any) -> Iterator[tuple[str, str, float, str, float | str, str]]:
    """Give every point of the named curves of a lettered figure, as rows of `COLUMNS`."""
    for axes in figure.axes:
        title = axes.get_title(loc="left")
        if not title.startswith("("):
            continue
        names = [text.get_text() for text in axes.get_yticklabels()]
        x_axis, y_axis = _plain(axes.get_xlabel()), _plain(axes.get_ylabel())
        for line in axes.get_lines():
            label = line.get_label()
            if label.startswith("_") or line.get_transform() != axes.transData:
                continue
            points = line.get_xydata()
            for x, y in points[~np.isnan(points).any(axis=1)].tolist():
                nearest = int(np.argmin(np.abs(np.asarray(axes.get_yticks()) - y)))
                value = names[nearest] if axes.get_gid() == NAMED else y
                yield title[1], _plain(label), x, x_axis, value, y_axis


def _plain(text: str) -> str:
    """Return a label without the marks of mathematics."""
    return text.replace("$", "").replace("\n", " ")


def table(rows: Iterable[Iterable[Any]], columns: Sequence[str] = COLUMNS) -> str:
    """Return rows as CSV, numbers with six digits."""
    # A 0 is added so that none is written as -0.
    written = (
        [f"{cell + 0.0:.6g}" if isinstance(cell, float) else cell for cell in row] for row in rows
    )
    return format_csv([columns, *written])


def list_methods(results: Mapping[Any, Any]) -> list[str]:
    """Return the methods that results have, by method or by method and more, in their order."""
    there = {key if isinstance(key, str) else key[0] for key in results}
    return [method for method in COMPARED if method in there]


#: Color, marker and its size of each profile.
PROFILES = {"cone": (LINES[0], "o", 8.0), "gaussian": (LINES[1], "s", 5.0)}
#: Ends of the heights of each shape of a blister, mm.
HEIGHTS = {"convex": (36, 64), "concave": (28, 43)}
#: Instants of a drag that are drawn.
INSTANTS = 5
#: Line of what was asked for, of a limit, or of the bed at rest.
DASHED: dict[str, Any] = {"color": INK, "linewidth": 1.0, "linestyle": DASHES}
DOTTED = {**DASHED, "linestyle": (0, (1, 2))}


@contextmanager
def sheet(width: float, height: float, title: str) -> Iterator[Any]:
    """Give a figure, inches, whose panels and legends find their places by themselves."""
    with empty(width, height, layout="constrained") as figure:
        figure.suptitle(title, x=0.01, ha="left", fontsize=14, fontweight="bold")
        yield figure


def add_legend(figure: Any, axes: Any, ncols: int = 7, **looks: Any) -> None:
    """Put the legend of a panel below all of them."""
    handles = axes.get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower left", ncols=ncols, **looks)


def blisters(results: Results) -> Any:
    """Draw sections through raised and sunken blisters, both profiles, all methods."""
    methods = list_methods(results.blisters)
    with sheet(
        12.5, 0.8 + 3.4 * len(methods), "Blisters in section, the fingertip in place"
    ) as figure:
        panels = figure.subplots(len(methods), len(HEIGHTS))
        for axes, (method, shape) in zip(panels.flat, product(methods, HEIGHTS), strict=True):
            for profile, look in PROFILES.items():
                done = results.blisters[method, shape, profile]
                _section(axes, done, look, profile)
            _finger(axes, done)
            axes.axhline(done.scene.actuator.rest_height * MM, **DASHED)
            axes.set(xlim=(-25, 25), title=f"{NAMES[method]}, {shape}", ylabel="height (mm)")
            axes.set(ylim=HEIGHTS[shape], xlabel="distance from the middle (mm)")
        first = figure.axes[0]
        first.plot([], [], **DASHED, label="bed at rest")
        first.plot([], [], color=INK, linewidth=1.2, label="fingertip")
        first.plot([], [], "o", color=INK, label="cell that feels it")
        add_legend(figure, first)
    return figure


def _section(axes: Any, done: Result, look: tuple[str, str, float], name: str) -> None:
    """Draw the heights of the middle row; cells that feel the fingertip are filled."""
    place, height, force = (done.history[key] for key in ("position", "height", "force"))
    row = np.abs(place[:, 1]) < 1e-6
    color, marker, size = look
    across, top, felt = place[row, 0] * MM, height[-1, row] * MM, force[-1, row] > 0.0
    axes.plot(
        across,
        top,
        color=color,
        marker=marker,
        markersize=size,
        markerfacecolor="white",
        label=name,
    )
    axes.plot(across[felt], top[felt], marker, color=color, markersize=size)


def _finger(axes: Any, done: Result) -> None:
    """Draw the fingertip's outline in the section."""
    tip, x, z = done.scene.section("fingertip"), *(done.history["fingertip"][-1, [0, 2]] * MM)
    if tip is None:
        return
    turn = np.linspace(np.pi, 2.0 * np.pi, 91)
    wide, high = tip.length * MM, tip.height * MM
    axes.plot(x + wide * np.cos(turn), z + high * (1.0 + np.sin(turn)), color=INK, linewidth=1.2)


def freezing(results: Results) -> Any:
    """Draw sections along a drag at several times; frozen cells are marked."""
    methods = list_methods(results.drags)
    title = "Freezing: what the fingertip has left keeps its height"
    with sheet(12.5, 0.8 + 3.7 * len(methods), title) as figure:
        from matplotlib import colormaps

        for axes, method in zip(figure.subplots(len(methods)), methods, strict=True):
            done, start, end = results.drags[method]
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
                    across[frozen],
                    top[frozen],
                    "s",
                    color=color,
                    markersize=8,
                    markeredgecolor="white",
                )
                x, z = done.history["fingertip"][instant, [0, 2]] * MM
                axes.plot(x, z + 6.0, "v", color=color, markersize=9)
            axes.set(xlim=(-38, 38), ylim=(38, 65), ylabel="height (mm)", title=NAMES[method])
            axes.set_xlabel("along the drag (mm)")
        axes.plot([], [], "s", color=INK, label="frozen cell")
        axes.plot([], [], "v", color=INK, label="finger")
        add_legend(figure, axes)
    return figure


#: Told apart with any color vision; markers say the same once more.
METHOD_COLORS = {"virtual_master": LINES[0], "cell_states": LINES[1], THIRD: LINES[2]}
MARKERS = "os^D"


def oscillation(results: Results) -> Any:
    """Draw the force after a quick press at three gains, and what the sweep of the gains came to."""
    gains = list(results.sweeps)
    middle = gains[len(gains) // 2]
    title = f"Method I holding still after a quick press of {PRESSED * MM:g} mm"
    with sheet(13.0, 7.6, title) as figure:
        panels = figure.subplot_mosaic([["detail", "detail"], ["swing", "settle"]])
        detail, swing, settle = panels.values()
        _details(detail, results, middle)
        set_point = results.printed[METHODS[0]].scene.set_point
        assert set_point is not None  # Method I has one
        detail.axhline(set_point.force, **DASHED)
        detail.set(xlabel="time after the press (s)", ylabel="total force (N)", xlim=(-0.2, 2.4))
        detail.set_ylim(0.0, 2.5 * set_point.force)
        detail.set_title(f"$K_p$ = {middle:g} 1/m (beyond the frame: the press itself)")
        legend_above(detail)
        sweeps = {f"$K_p$ = {gain:g} 1/m": row for gain, row in results.sweeps.items()}
        sweeps[f"{gains[0]:g} 1/m, quicker device"] = sorted(results.quicker)
        for number, (label, row) in enumerate(sweeps.items()):
            style: dict[str, Any] = {"color": LINES[number], "marker": MARKERS[number]}
            amplitudes = [(each.gain, each.amplitude) for each in row]
            times = [(each.gain, each.settling) for each in row if each.settling is not None]
            for axes, points in ((swing, amplitudes), (settle, times)):
                axes.plot(*np.reshape(points, (-1, 2)).T, label=label, **style)
        swing.axhline(SUSTAINED, **DASHED)
        swing.set(ylabel="amplitude in the last second (N)", title="Oscillation that goes on")
        settle.set(ylabel="time to settle within 10 % (s)", title="Response (no point: it goes on)")
        for axes in (swing, settle):
            _scale_gains(axes, 100, "force gain $K_f$ (1/N)")
            axes.set_xlim(1.7, 190)
        settle.legend(loc="upper right", borderaxespad=0.0)
    return figure


def _scale_gains(axes: Any, highest: float, label: str) -> None:
    """Give an axis of gains, and one of values from 0 on."""
    ticks = [tick for tick in (2, 5, 10, 20, 50, 100, 200, 400) if tick <= highest]
    axes.set_xscale("log")
    axes.set_xticks(ticks, [str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.set(xlabel=label, ylim=(0.0, None))


def _details(axes: Any, results: Results, position_gain: float) -> None:
    """Draw the force at the lowest gain, at the last one that is calm, and at the first that is not."""
    lowest = min(gain for gain, known in results.details if known == position_gain)
    chosen = dict.fromkeys(
        gain for gain in (lowest, *results.onset(position_gain)) if gain is not None
    )
    for color, gain in zip(LINES, chosen, strict=False):
        label = f"$K_f$ = {gain:g} 1/N"
        axes.plot(*results.details[gain, position_gain], color=color, linewidth=1.4, label=label)


def tracking(results: Results) -> Any:
    """Draw RFD and lag against the speed of a level drag, all methods."""
    limits = results.criterion
    measured = (
        ("rfd", "RFD (N)", 1.0, limits.deviation),
        ("lag", "largest lag (mm)", MM, limits.lag),
    )
    with sheet(12.5, 5.2, "A ridge 15 mm high, drawn straight and level") as figure:
        panels = figure.subplots(1, 2)
        for axes, (name, label, factor, limit) in zip(panels, measured, strict=True):
            for marker, method in zip(MARKERS, COMPARED, strict=False):
                row, color = results.tracks.get(method, []), METHOD_COLORS[method]
                speed = np.array([one.speed * MM for one in row])
                value = np.array([getattr(one, name) * factor for one in row])
                lost = np.array([one.losses > 0 or one.loss_share > 0.0 for one in row], dtype=bool)
                look: dict[str, Any] = {"color": color, "markersize": 7}
                title = NAMES[method] if row else None
                axes.plot(speed, value, marker=marker, label=title, **look)
                axes.plot(speed[lost], value[lost], marker, markerfacecolor="white", **look)
            axes.axhline(limit * factor, **DASHED)
            axes.axvline(PAPER_SPEED * MM, **DOTTED)
            axes.set(xlabel="finger's speed (mm/s)", ylabel=label, xlim=(0, None), ylim=(0, None))
            axes.set_title(label.split(" (")[0])
        hollow = {"color": INK, "markerfacecolor": "white"}
        axes.plot([], [], "o", label="without contact, or lost", **hollow)
        axes.plot([], [], **DASHED, label="criterion")
        axes.plot([], [], **DOTTED, label="the paper's 15 mm/s")
        add_legend(figure, axes, ncols=3)
    return figure


def variants(results: Results) -> Any:
    """Draw what the claims on the variants rest on."""
    with sheet(13.0, 8.4, "One thing changed") as figure:
        for draw, axes in zip(
            (_rise, _ahead, _gains, _radius), figure.subplots(2, 2).flat, strict=True
        ):
            draw(axes, results)
    return figure


def _rise(axes: Any, results: Results) -> None:
    names = [name for variant, _, name in results.dragged if variant == NO_RISE]
    for number, (variant, called) in enumerate(((AS_IT_IS, "with the rise"), (NO_RISE, "without"))):
        values = [results.dragged[variant, METHODS[1], name] for name in names]
        _across(axes, names, [one.force for one in values], number, called)
    axes.set(xlabel="mean total force (N)", title=f"Method II, drags at {PAPER_SPEED * MM:g} mm/s")
    axes.set_xlim(left=0.0)
    axes.legend()


def _ahead(axes: Any, results: Results) -> None:
    values = {
        (method, name): one.ahead * MM
        for (variant, method, name), one in results.dragged.items()
        if variant == AS_IT_IS and one.ahead is not None and "ridge" not in name
    }
    names = list(dict.fromkeys(name for _, name in values))
    for number, (method, called) in enumerate(zip(METHODS, ("Method I", "Method II"), strict=True)):
        _across(axes, names, [values.get((method, name), np.nan) for name in names], number, called)
    near, far = (f"{one * MM:g}" for one in AHEAD)
    axes.axvline(0.0, **DASHED)
    axes.set(xlabel="height over the bed at rest (mm)", title=f"Cells {near} to {far} mm ahead")
    axes.legend()


def _across(axes: Any, names: list[str], values: list[float], number: int, called: str) -> None:
    """Draw a marker for each name, a color and shape for each call."""
    y = -np.arange(len(names)) + 0.12 - 0.24 * number
    style: dict[str, Any] = {"color": LINES[number], "linestyle": "", "markersize": 9}
    axes.plot(values, y, "os"[number], label=called, **style)
    axes.set_yticks(-np.arange(len(names)), names)
    axes.set_gid(NAMED)
    axes.set_ylim(-len(names) + 0.4, 0.6)


def _gains(axes: Any, results: Results) -> None:
    used = results.sweeps.get(results.printed[METHODS[0]].gain("position_gain"), [])
    rows = ("Method I", used, "o-"), ("Method II", sorted(results.cell_swings), "s-")
    for color, (called, row, look) in zip(LINES, rows, strict=False):
        values = [swing.gain for swing in row], [swing.amplitude for swing in row]
        axes.plot(*values, look, color=color, label=called)
    axes.axhline(SUSTAINED, **DASHED)
    _scale_gains(axes, 400, "$K_f$ of the master, $K_{FF}$ of a cell (1/N)")
    axes.set(ylabel="amplitude of the force (N)", title="Held still after a quick press")
    axes.legend(loc="upper left", borderaxespad=0.0)


def _radius(axes: Any, results: Results) -> None:
    kinds = sorted({(one.thresholds, one.radius) for one in results.located})
    least = min(radius for _, radius in kinds)
    for thresholds, radius in kinds:
        row = [
            one
            for one in sorted(results.located)
            if (one.thresholds, one.radius) == (thresholds, radius)
        ]
        # With thresholds both lie upon each other: the smaller markers on top.
        near = radius == least
        name = f"$r_{{VM}}$ = {radius * MM:g} mm" if near else "no radius"
        look: dict[str, Any] = (
            {"markersize": 5, "zorder": 3} if near else {"markersize": 9, "zorder": 2}
        )
        look |= {"linestyle": "--", "markerfacecolor": "white"} if thresholds else {}
        noise = [one.noise * MM for one in row]
        scatter = [np.nan if one.scatter is None else one.scatter * MM for one in row]
        name += ", thresholds" if thresholds else ""
        axes.plot(noise, scatter, color=LINES[not near], marker="os"[not near], label=name, **look)
    axes.set(xlabel="noise of a cell's force sensor (mN)", ylabel="scatter of the master (mm)")
    axes.set(title="Method I, finger held still", xlim=(0.0, None), ylim=(0.0, None))
    axes.legend(loc="upper left", borderaxespad=0.0)
