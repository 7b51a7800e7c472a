"""Overlay in the 3D views during live sessions.

The draw handler is there only while a session runs whose bed has the overlay enabled: one that is
off costs nothing. `follow` is called after each start and end of a session.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from .. import preferences
from ..bridge import project
from ..compat import Area, Context, Object, Region, bpy
from ..core.base.modes import COLORS, Mode
from ..core.engine.state import State
from ..core.model.control_interface import find_set_point
from ..core.session.recent_trace import exceeds_law
from ..device import palettes, view
from ..device.instant import find_ellipsoids
from ..device.node_tree import TOP_FORCE
from ..roles import bed_of, fingertips_of
from ..sessions import running
from .picture import BLACK, WHITE, Dot, Look, Picture, Words, choose_colors, contrast, move_apart
from .sections import COMPACT, FULL, Readings, Room, find_covered, find_room, lay_out

#: Radius of the number of a fingertip at a UI scale of 1, pixels.
NUMBER = 8.0
#: How often the views are redrawn while nothing moves in them, s: the curves continue.
QUIET = 0.25


@dataclass
class DrawHandler:
    """Blender's handle of the draw handler; None while there is none."""

    handle: Any = None


HANDLER = DrawHandler()


def follow() -> None:
    """Draw the overlay if a live session has it enabled, and remove it otherwise."""
    if any(_is_wanted(bed) for bed in _beds()):
        if not shown():
            HANDLER.handle = bpy.types.SpaceView3D.draw_handler_add(
                _draw, (), "WINDOW", "POST_PIXEL"
            )
            bpy.app.timers.register(_again, first_interval=QUIET)
    else:
        stop()
    redraw()


def stop() -> None:
    """Remove the overlay."""
    if bpy.app.timers.is_registered(_again):
        bpy.app.timers.unregister(_again)
    if shown():
        bpy.types.SpaceView3D.draw_handler_remove(HANDLER.handle, "WINDOW")
        HANDLER.handle = None


def shown() -> bool:
    """Return whether the draw handler is there."""
    return HANDLER.handle is not None


def redraw() -> None:
    """Request a redraw of every 3D view."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _again() -> float:
    """Redraw the views now and then, as a timer."""
    redraw()
    return QUIET


def read_session(
    bed: Object, session: running.Running, colors: dict[Mode, tuple[float, float, float]]
) -> Readings:
    """Return the content of the overlay for a bed and its session."""
    trace, scene = session.trace, session.scene
    wanted = float(trace.set_point[-1] if len(trace.rows) else find_set_point(scene.set_point, 0))
    errors, forces = session.errors, session.state.finger_forces()[: len(session.poses)]
    return Readings(
        name=bed.name,
        method=scene.method if scene.control else "",
        paused=session.paused,
        waiting=bool(session.blocking_reason),
        factor=session.clock.factor or None,
        errors=None if errors is None else (errors.height, errors.force),
        correction=session.correction,
        set_point=wanted if math.isfinite(wanted) else None,
        time=trace.time,
        force=trace.force,
        pins=trace.pins,
        fingers=tuple((number, palettes.finger_color(number)) for number in _list_numbers(session)),
        finger_force=trace.finger_forces,
        heights=trace.heights,
        modes=np.bincount(session.state.mode(), minlength=len(Mode)),
        colors=tuple(colors[mode] for mode in Mode),
        seconds=bed.digiclay_display.seconds,
        top=view.read_setting(bed, TOP_FORCE, None) if view.shows_force(bed) else None,
        hardest=float(forces.max()) if len(forces) > 1 else None,
        drive=_count_served(session.state),
        beyond=exceeds_law(session.system, session.state, session.tips[0]),
        pressed=_count_pressed(session) if scene.bodies else None,
    )


def _count_served(state: State) -> tuple[int, int, int] | None:
    """Return the numbers of lines addressed, of all lines, and of pins that wait; None without a drive."""
    now = state.addressing
    return now and (int(now.served.sum()), now.served.size, now.waiting.size)


def _count_pressed(session: running.Running) -> int:
    """Return the number of pins with a force."""
    return int(np.count_nonzero(session.state.row(session.system.rows.force)))


def _list_numbers(session: running.Running) -> tuple[int, ...]:
    """Return the numbers of several fingertips; a single one needs no number."""
    return session.numbers if len(session.numbers) > 1 else ()


def _beds() -> list[Object]:
    """Return the beds with a running session; fetched anew each time, since undo invalidates them."""
    uids = {session.uid for session in running.list_sessions()}
    return [thing for thing in bpy.data.objects if thing.session_uid in uids] if uids else []


def _is_wanted(bed: Object) -> bool:
    """Return whether the overlay is enabled for a bed."""
    display = getattr(bed, "digiclay_display", None)
    return display is not None and bool(display.overlay)


def _choose_bed(context: Context) -> Object | None:
    """Return the bed of a view's overlay: the active one, or the first one in the view's scene."""
    beds = [bed for bed in _beds() if _is_wanted(bed) and bed.name in context.scene.objects]
    active = bed_of(context)
    return active if active in beds else beds[0] if beds else None


def find_free_room(
    area: Area, region: Region, closed: Mapping[str, float] = MappingProxyType({})
) -> Room:
    """Return the part of a view, pixels, that toolbar, sidebar and headers leave free.

    `closed`: how wide or high regions are to be taken that are closed, by their types.
    """
    sides = {
        "TOOLS": "LEFT",
        "UI": "RIGHT",
        "HEADER": "TOP",
        "TOOL_HEADER": "TOP",
        "ASSET_SHELF": "BOTTOM",
    }
    covered = []
    for other in area.regions:
        lies_over = other.x < region.x + region.width and other.x + other.width > region.x
        lies_over &= other.y < region.y + region.height and other.y + other.height > region.y
        if other.type in sides and lies_over:
            side = other.alignment if other.alignment in sides.values() else sides[other.type]
            depth = other.width if side in ("LEFT", "RIGHT") else other.height
            shut = min(other.width, other.height) <= 1
            covered.append((side, closed.get(other.type, 0.0) if shut else depth))
    return find_room(region.width, region.height, covered)


def find_taken(context: Context, bed: Object, room: Room) -> Room:
    """Return what the overlay of a bed takes of a room, pixels, as soon as it tells all fingertips."""
    scale, corner = context.preferences.system.ui_scale, preferences.get(context).overlay_corner
    session, numbers = running.find(bed), tuple(fingertips_of(bed))
    numbers, boxes = numbers if len(numbers) > 1 else (), []
    if session is not None:
        readings = replace(
            read_session(bed, session, COLORS),
            fingers=tuple((number, BLACK) for number in numbers),
            finger_force=np.zeros((len(session.trace.time), len(numbers))),
        )
        content = FULL if bed.digiclay_display.overlay_full else COMPACT
        boxes = lay_out(readings, choose_colors(BLACK, WHITE), room, scale, content, corner).boxes
    return find_covered(room, scale, corner, boxes[0] if boxes else None, len(numbers))


def _draw() -> None:
    """Draw the overlay into the region Blender is drawing: marks in all of a quad view, text in one."""
    from .draw import draw

    context = bpy.context
    bed = _choose_bed(context) if context.space_data.overlay.show_overlays else None
    session = running.find(bed)
    if bed is None or session is None:
        return
    settings = context.preferences
    theme = settings.themes[0].user_interface.wcol_menu_back
    colors = palettes.PALETTES[preferences.get(context).palette]
    chosen = choose_colors(tuple(theme.inner[:3]), tuple(theme.text))
    scale = settings.system.ui_scale
    picture = Picture()
    if context.region_data == context.space_data.region_3d:
        content = FULL if bed.digiclay_display.overlay_full else COMPACT
        room = find_free_room(context.area, context.region)
        corner = preferences.get(context).overlay_corner
        picture = lay_out(read_session(bed, session, colors), chosen, room, scale, content, corner)
    _mark(context, bed, session, chosen, picture, scale)
    draw(picture, context.region.width, context.region.height)


def _mark(
    context: Context,
    bed: Object,
    session: running.Running,
    colors: Look,
    picture: Picture,
    scale: float,
) -> None:
    """Add dots on picked pins in the colors of their curves, and numbered ones beside several fingertips.

    None covers the boxes of the picture, and no number a fingertip.
    """
    pins, boxes = list(session.trace.pins), tuple(picture.boxes)
    tops = np.column_stack([session.system.grid.positions[pins], session.state.row(0)[pins]])
    numbers = _list_numbers(session)
    sizes = np.array(
        [[finger.length, finger.width, finger.height] for finger in find_ellipsoids(session.scene)]
    )
    middles = session.poses[: len(numbers), :3] + [0.0, 0.0, 1.0] * sizes[: len(numbers)]
    around = middles[:, None] + sizes[: len(numbers), None] * np.vstack([np.zeros(3), np.eye(3)])
    marks = [(color, 4.0, "") for _, color in zip(pins, colors.pins, strict=False)]
    marks += [(palettes.finger_color(number), NUMBER, f"{number}") for number in numbers]
    places = project(context, bed, np.concatenate([tops, around.reshape(-1, 3)]))
    balls = places[len(pins) :].reshape(-1, 4, 2)
    radii = np.linalg.norm(balls - balls[:, :1], axis=2).max(axis=1, initial=0.0)
    radius = (NUMBER + 1.5) * scale
    above = balls[:, 0] + np.outer(radii + radius, [0.0, 1.0])
    places = np.concatenate([places[: len(pins)], move_apart(above, radius, balls[:, 0], radii)])
    for (x, y), (color, radius, text) in zip(places, marks, strict=True):
        hidden = any(0 <= x - box.x < box.width and 0 <= y - box.y < box.height for box in boxes)
        if math.isfinite(x) and not hidden:
            rim = Dot(x, y, (radius + 1.5) * scale, colors.back)
            picture.dots += [rim, Dot(x, y, radius * scale, color)]
            if text:
                ink = max(BLACK, WHITE, key=lambda ink: contrast(ink, color))
                size, wide = 11.0 * scale, 3.1 * len(text) * scale
                picture.words.append(Words(x - wide, y - 0.36 * size, size, ink, text))
