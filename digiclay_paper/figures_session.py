"""Session of the paper: heights and force (Fig. 8), a detail (Fig. 9), the final surfaces (Fig. 10)."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from digiclay.plots.bed import draw_map, draw_path, draw_relief
from digiclay.plots.figure import LINES, MM, canvas
from digiclay.plots.run import LETTERS, draw_force, session_cells, shade_contact

from .paper_figures import DASHED, add_legend, list_methods, sheet
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
    strongest = 1.1 * max(float(each.history["total_force"].max()) for each in sessions.values())
    methods = list_methods(sessions)
    with sheet(0.5 + 6.5 * len(methods), 7.4, title) as figure:
        panels = figure.subplots(2, len(methods), sharex="col", sharey="row", height_ratios=(4, 3))
        for method, (heights, force) in zip(methods, panels.T, strict=True):
            history = sessions[method].history
            for name, color, cell in zip(names, LINES, cells, strict=False):
                height = history["height"][:, cell] * MM
                heights.plot(history["time"], height, color=color, label=name)
            shade_contact(heights, history)
            draw_force(force, history, history["set_point"], "set point")
            heights.set(title=NAMES[method], xlabel="time (s)", ylabel="height (mm)")
            force.set(
                title="Total force", xlabel="time (s)", ylabel="force (N)", ylim=(0.0, strongest)
            )
        add_legend(figure, heights, title="Cells at x, y (mm)")
    return figure


def details(results: Results) -> Any:
    """Draw a detail of the heights in the session: the first press, and what swings during the lift."""
    shown = _detailed(results)
    with sheet(4.5 * len(shown), 7.6, "Details of the heights in the paper's session") as figure:
        panels = figure.subplots(2, len(shown), sharey="row")
        for (name, session), (heights, swing) in zip(shown, panels.T, strict=True):
            press, lift = (_within(session.detail["time"], ends) for ends in (PRESSING, LIFTING))
            time = session.detail["time"]
            for color, cell in zip(LINES, _under(session), strict=False):
                height = session.detail["height"][:, cell]
                away = f"x = {session.history['position'][cell, 0] * MM:.0f} mm"
                style: dict[str, Any] = {"color": color, "linewidth": 1.5, "label": away}
                heights.plot(time[press], height[press] * MM, **style)
                swing.plot(time[lift], _swinging(time[lift], height[lift]) * 1e6, **style)
            heights.set(title=name, xlim=PRESSING, ylim=(36.5, 40.5), ylabel="height (mm)")
            swing.set(title="the same cells, lifted", xlim=LIFTING, ylim=(-20, 20))
            swing.set_ylabel("height less its course (µm)")
            heights.set_xlabel("time (s)")
            swing.set_xlabel("time (s)")
        add_legend(figure, heights)
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
    methods = list_methods(results.session)
    drawn = zip(*(sections(results.session[method]) for method in methods), strict=True)
    with sheet(13.5, 8.6, f"Sections. The paper's session{results.slowness}") as figure:
        for axes, lines in zip(figure.subplots(2, 3).flat, drawn, strict=True):
            for method, section, color, marker in zip(methods, lines, LINES, "os^", strict=False):
                name = NAMES[method].split(",")[0]
                along, look = section.along * MM, {"color": color, "markersize": 4.5}
                asked = {**DASHED, "color": color, "label": f"{name}, asked for"}
                axes.plot(along, section.asked * MM, **asked)
                axes.plot(along, section.formed * MM, marker=marker, label=name, **look)
            across = "y (mm)" if section.name.startswith("across") else "x (mm)"
            axes.set(title=section.name, xlabel=across, ylabel="height over rest (mm)")
        add_legend(figure, axes)
    return figure
