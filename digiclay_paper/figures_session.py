"""Session of the paper: heights and force (Fig. 8), a detail (Fig. 9), the final surfaces (Fig. 10)."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from digiclay.plots.bed import draw_map, draw_path, draw_relief
from digiclay.plots.figure import DASHES, LINES, MM, canvas
from digiclay.plots.run import LETTERS, draw_force, session_cells, shade_contact

from .paper_figures import list_methods
from .relief_sections import sections
from .results import Results, Session
from .scenes import METHODS, NAMES, THIRD

#: What is looked at closely: the first press and its end, and a part of the even lift, s.
PRESSING, LIFTING = (0.5, 1.5), (2.4, 3.4)


def heights_and_force(results: Results) -> Any:
    """Draw heights and total force of the session."""
    return draw_heights(results.session, f"The paper's session{results.slowness}")


def heights_at_own_times(results: Results) -> Any:
    """Draw the same at the times that the session has in the paper."""
    return draw_heights(results.printed, "The paper's session at its own times")


def draw_heights(sessions: Mapping[str, Session], title: str) -> Any:
    """Draw the heights of the same cells, and the total force, side by side for all methods."""
    cells = session_cells(sessions[METHODS[0]].history)
    spots = sessions[METHODS[0]].history["position"][cells] * MM
    names = [f"{name} ({x:.0f}, {y:.0f})" for name, (x, y) in zip(LETTERS, spots, strict=False)]
    lowest = (
        min(float(one.history["height"][:, cells].min()) for one in sessions.values()) * MM - 2.0
    )
    highest = (
        max(float(one.history["height"][:, cells].max()) for one in sessions.values()) * MM + 2.0
    )
    strongest = 1.1 * max(float(one.history["total_force"].max()) for one in sessions.values())
    methods = list_methods(sessions)
    across = 0.5 + 6.5 * len(methods)
    with canvas(across, 7.4, title) as (figure, place):
        for column, method in enumerate(methods):
            history = sessions[method].history
            left = 0.85 + 6.5 * column
            heights = place(f"{method} heights", left, 3.5, 5.75, 2.7)
            force = place(f"{method} force", left, 0.7, 5.75, 2.0)
            for name, color, cell in zip(names, LINES, cells, strict=False):
                heights.plot(
                    history["time"], history["height"][:, cell] * MM, color=color, label=name
                )
            shade_contact(heights, history)
            draw_force(force, history, history["set_point"], "set point")
            ends = history["time"][0], history["time"][-1]
            heights.set(ylim=(lowest, highest), ylabel="height (mm)", title=NAMES[method])
            heights.tick_params(labelbottom=False)
            force.set(ylim=(0.0, strongest), ylabel="force (N)", title="Total force")
            for axes in (heights, force):
                axes.set(xlim=ends, xlabel="time (s)")
                axes.yaxis.label.set_visible(column == 0)
            heights.xaxis.label.set_visible(False)
        figure.text(0.85 / across, 1.0 - 0.78 / 7.4, "Cells at x, y (mm):")
        beside: dict[str, Any] = {
            "loc": "upper left",
            "bbox_to_anchor": (2.77 / across, 1.0 - 0.5 / 7.4),
        }
        figure.legend(*heights.get_legend_handles_labels(), ncols=6, **beside)
    return figure


def details(results: Results) -> Any:
    """Draw a detail of the heights in the session: the first press, and what swings during the lift."""
    shown, title = _detailed(results), "Details of the heights in the paper's session"
    with canvas(4.5 * max(len(shown), 3), 7.6, title) as (
        figure,
        place,
    ):
        wide = 4.5 * max(len(shown), 3) / len(shown)
        for column, (name, session) in enumerate(shown):
            left, across = 0.95 + (wide - 0.08) * column, wide - 1.05
            cells = _under(session)
            time, height = session.detail["time"], session.detail["height"][:, cells] * MM
            heights = place(f"{column} heights", left, 4.25, across, 2.35)
            swing = place(f"{column} swing", left, 0.7, across, 2.35)
            press, lift = (_within(time, ends) for ends in (PRESSING, LIFTING))
            for number, cell in enumerate(cells):
                away = f"{session.history['position'][cell, 0] * MM:.0f} mm"
                style: dict[str, Any] = {
                    "color": LINES[number],
                    "linewidth": 1.5,
                    "label": f"x = {away}",
                }
                heights.plot(time[press], height[press, number], **style)
                swing.plot(time[lift], _swinging(time[lift], height[lift, number]) * 1e3, **style)
            heights.set(title=name, xlim=PRESSING, ylim=(36.5, 40.5), ylabel="height (mm)")
            swing.set(title="the same cells, lifted", xlim=LIFTING, ylim=(-20, 20))
            swing.set_ylabel("height less its course (µm)")
            for axes in (heights, swing):
                axes.set_xlabel("time (s)")
                axes.yaxis.label.set_visible(column == 0)
        legend = figure.axes[0].get_legend_handles_labels()
        figure.legend(*legend, loc="upper right", ncols=len(cells), bbox_to_anchor=(0.99, 0.955))
    return figure


def _detailed(results: Results) -> list[tuple[str, Session]]:
    """Return the sessions of which details are shown, by name."""
    one, two = (results.printed[method] for method in METHODS)
    first = [one] if results.wild is None else [one, results.wild]
    third = [("Method III", results.printed[THIRD])] if THIRD in results.printed else []
    return [
        *((f"Method I, $K_f$ = {session.gain('force_gain'):g} 1/N", session) for session in first),
        ("Method II", two),
        *third,
    ]


def _under(session: Session) -> list[int]:
    """Return the cell the fingertip first presses, and some beside it in its row, outwards."""
    place, first = session.history["position"], session.history["fingertip"][0, :2]
    pitch = session.scene.layout.pitch
    return [
        int(np.argmin(np.hypot(*(place - first - (step * pitch, 0.0)).T))) for step in range(0, 5)
    ]


def _within(time: Any, ends: tuple[float, float]) -> Any:
    return (time >= ends[0] - 1e-9) & (time <= ends[1] + 1e-9)


def _swinging(time: Any, height: Any) -> Any:
    """Return a signal less its course, a cubic."""
    middle = 0.5 * (time[0] + time[-1])
    return height - np.polyval(np.polyfit(time - middle, height, 3), time - middle)


def surfaces(results: Results) -> Any:
    """Draw the final surfaces in relief and from above, side by side for all methods."""
    methods = list_methods(results.session)
    across = 0.3 + 6.6 * len(methods)
    with canvas(across, 9.6, f"Final surfaces. The paper's session{results.slowness}") as (
        figure,
        place,
    ):
        for column, method in enumerate(methods):
            history, left = results.session[method].history, 6.6 * column
            relief = place(
                f"{method} relief",
                left - 0.9,
                3.9,
                8.0,
                5.9,
                projection="3d",
                computed_zorder=False,
            )
            room = (left + 0.3) / across, 4.75 / 9.6, (left + 6.3) / across, 8.7 / 9.6
            draw_relief(relief, history, room)
            # Its own title would lie far above the picture.
            figure.text((left + 0.3) / across, 8.85 / 9.6, f"({'ace'[column]}) {NAMES[method]}")
            plan = place(f"{method} map", left + 1.1, 0.7, 4.2, 3.6)
            draw_map(plan, history, f"({'bdf'[column]})")
            draw_path(plan, history)
            for axes in (relief, plan):
                for artist in (*axes.collections, *axes.images):
                    artist.set_rasterized(True)
    return figure


def surface_rows(sessions: Mapping[str, Session]) -> Iterator[tuple[str, float, float, float]]:
    """Give the final surfaces as rows of method, x, y and height in mm."""
    for method in list_methods(sessions):
        history = sessions[method].history
        for (x, y), height in zip(history["position"], history["height"][-1], strict=True):
            yield method, float(x) * MM, float(y) * MM, float(height) * MM


def profiles(results: Results) -> Any:
    """Draw sections through the final surfaces, formed and asked for."""
    drawn = {
        method: list(sections(results.session[method])) for method in list_methods(results.session)
    }
    count = len(drawn[METHODS[0]])
    with canvas(13.5, 8.6, f"Sections. The paper's session{results.slowness}") as (figure, place):
        for number in range(count):
            row, column = divmod(number, 3)
            axes = place(f"section {number}", 0.85 + 4.38 * column, 4.55 - 3.85 * row, 3.5, 2.7)
            for method, color, marker in zip(drawn, LINES, "os^", strict=False):
                one = drawn[method][number]
                name = NAMES[method].split(",")[0]
                asked: dict[str, Any] = {"color": color, "linewidth": 1.1, "linestyle": DASHES}
                axes.plot(one.along * MM, one.asked * MM, label=f"{name}, asked for", **asked)
                axes.plot(
                    one.along * MM,
                    one.formed * MM,
                    color=color,
                    marker=marker,
                    markersize=4.5,
                    label=name,
                )
            axes.set(title=one.name, xlabel="y (mm)" if one.name.startswith("across") else "x (mm)")
            axes.set_ylabel("height over rest (mm)")
        legend = axes.get_legend_handles_labels()
        figure.legend(*legend, loc="upper right", ncols=6, bbox_to_anchor=(0.99, 0.955))
    return figure
