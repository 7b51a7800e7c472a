"""Looks at a bed as a designer does: pins and skin, from near and far, at rest and pressed by a hand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

from tests.window.hand_strokes import act, add_bed, done, finish, focus_window, hand, line, on_the_screen, to


def count_orange(name: str, blender: Any) -> int:
    """Return how many pixels of the 3D view in a picture have the color of a selection's outline."""
    _, region = blender.view()
    image = bpy.data.images.load(str(blender.OUT / f"{name}.png"))
    width, height = image.size
    pixels = np.array(image.pixels[:], np.float32).reshape(height, width, -1)
    bpy.data.images.remove(image)
    shown = pixels[region.y : region.y + region.height, region.x : region.x + region.width, :3]
    red, green, blue = np.moveaxis(shown, -1, 0)
    return int(((red > 0.85) & (green > 0.45) & (green < 0.75) & (blue < 0.35)).sum())


def rectangle_of_the_bed(blender: Any) -> list[float]:
    """Return left, bottom, right and top of the bed in its 3D view, pixels."""
    bed = blender.beds()[0]
    corners = np.array([blender.pixel(bed.matrix_world @ Vector(corner)) for corner in bed.bound_box])
    _, region = blender.view()
    corners -= (region.x, region.y)
    return [float(value) for value in (*corners.min(axis=0), *corners.max(axis=0))]


def note(blender: Any, name: str) -> None:
    """Write down what is shown, and take a picture."""
    form, bed = blender.part("device.view"), blender.beds()[0]
    blender.shot(name)
    blender.SEEN[name] = {
        "form": bed.digiclay_display.form,
        "skin": form.is_skin_shown(bed),
        "far": form.is_far(bed),
        "orange": count_orange(name, blender),
        "selected": [thing.name for thing in bpy.context.selected_objects],
        "lowest": float(blender.part("bridge").read_cells(bed.data)["height"].min()),
    }


def watch_overlay(blender: Any) -> None:
    """Write down the box of the overlay whenever it is drawn."""
    module = blender.part("overlay.draw")
    draw = module.draw

    def noted(picture: Any, width: float, height: float) -> None:
        if picture.boxes:
            box = picture.boxes[0]
            blender.SEEN["overlay"] = [box.x, box.y, box.x + box.width, box.y + box.height]
        draw(picture, width, height)

    module.draw = noted


def script(blender: Any) -> Iterator[float | None]:
    """Look."""
    add_bed(blender)
    watch_overlay(blender)
    yield from focus_window()
    note(blender, "added")
    blender.select(blender.beds()[0])
    note(blender, "selected")
    middle = on_the_screen(blender, 0.0, 0.0)
    yield from levels_of_detail(blender)
    for name in ("alt s", "alt s again", "alt s once more"):
        yield from done(blender, hand(to(middle), "key alt+s"))
        note(blender, name)
    blender.call(bpy.ops.digiclay.session)
    yield from blender.settle(5)
    yield from finish(blender, line(blender, (-24.0, -12.0), (24.0, -12.0)))
    note(blender, "pressed on the skin")
    blender.SEEN["bed"] = rectangle_of_the_bed(blender)
    bed = blender.beds()[0]
    bed.digiclay_display.overlay_full = True
    yield from act(blender, to(on_the_screen(blender, 24.0, -8.0), 0.3))
    note(blender, "overlay details")
    bed.digiclay_display.overlay_full = False
    for shown, kind in (("pins", "smooth"), ("skin", "membrane"), ("both", "smooth")):
        bed.digiclay_display.form, bed.digiclay_display.skin = shown, kind
        yield from act(blender, to(on_the_screen(blender, 23.0, -9.0), 0.3))
        note(blender, f"{shown} {kind}")
    yield from act(blender, "key Escape")
    note(blender, "stopped")


def levels_of_detail(blender: Any) -> Iterator[float | None]:
    """Look at the bed from farther and farther away, and come back."""
    area, _ = blender.view()
    looking = area.spaces.active.region_3d
    distance = looking.view_distance
    steps = {"near": 1.0, "between": 0.0, "far": 14.0, "between again": 0.0, "back": 1.0}
    for name, times in steps.items():
        # Between the limits: 3.5 pixels a pitch.
        looking.view_distance = distance * (times or pitch_in_pixels(blender, distance) / 3.5)
        area.tag_redraw()
        yield from blender.rounds(20)  # the pitch is measured in a drawing, and acted upon by a timer
        note(blender, name)
    looking.view_distance = distance


def pitch_in_pixels(blender: Any, distance: float) -> float:
    """Return a pitch in a view whose middle is as far away, pixels at a UI scale of 1."""
    area, region = blender.view()
    lens = float(area.spaces.active.region_3d.window_matrix[1][1])
    return 0.03 * lens * region.height / 2.0 / distance / bpy.context.preferences.system.ui_scale
