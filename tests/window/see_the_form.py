"""Looks at a bed as a designer does: pins and skin, from near and far, at rest and pressed by a hand."""

import bpy
import numpy as np
from mathutils import Vector

from tests.window import driver as blender
from tests.window.hand_strokes import (
    act,
    add_bed,
    done,
    finish,
    focus_window,
    hand,
    line,
    on_the_screen,
    to,
)


def count_orange(name):
    red, green, blue = np.moveaxis(read_shot(name), -1, 0)
    return int(((red > 0.85) & (green > 0.45) & (green < 0.75) & (blue < 0.35)).sum())


def read_shot(name):
    """Return the pixels of the 3D view in a picture, (height, width, 3), the lower row first."""
    _, region = blender.view()
    pixels = blender.read_shot(name)
    return pixels[region.y : region.y + region.height, region.x : region.x + region.width, :3]


def add_by_hand(name, add=bpy.ops.mesh.digital_clay_add, **chosen):
    """Add a bed as its menu entry does, beside or on what the factory file has; note how it is seen."""
    area, region = blender.view()
    for thing in [blender.bed(), blender.fingertip()] if blender.beds() else []:
        bpy.data.objects.remove(thing)
    blender.call(add, "INVOKE_DEFAULT", **chosen)
    room = blender.part("overlay.views").find_free_room(area, region)
    blender.SEEN[name] = {"bed": rectangle_of_the_bed(), "room": room}


def see_at_once():
    """Add beds from the default perspective and from above, with the sidebar closed and open; press lines."""
    area, region = blender.view()
    looking = area.spaces.active.region_3d
    before = {name: getattr(looking, name) for name in ("view_perspective", "view_distance")}
    turned = looking.view_rotation.copy()
    add_by_hand("a sample", bpy.ops.digiclay.add_sample, sample="session:two_hands_bowl")
    for side in ("USER", "TOP"):
        if side == "TOP":
            blender.call(bpy.ops.view3d.view_axis, type=side)
            yield from blender.rounds(20)
            blender.SEEN["turned"] = [rectangle_of_the_bed(), region.width, region.height]
        for is_open in (False, True):
            area.spaces.active.show_region_ui = is_open
            yield from blender.rounds(20)
            add_by_hand(f"{side} {is_open}")
    note("added by hand")
    draw_lines(10, 3.0)
    blender.shot("ten lines")
    blender.SEEN["lit"] = measure_lines(10, "ten lines")
    shading, display = area.spaces.active.shading, blender.bed().digiclay_display
    blender.SEEN["shading"] = [shading.light, shading.show_cavity]
    shading.light, shading.show_cavity, display.form = "STUDIO", False, "pins"
    blender.shot("ten lines as pins")
    blender.SEEN["as pins"] = measure_lines(10, "ten lines as pins")
    blender.part("overlay.ready_view").light(bpy.context)
    blender.SEEN["the user's"] = shading.light
    area.spaces.active.show_region_ui = False
    looking.view_rotation = turned
    for name, value in before.items():
        setattr(looking, name, value)


def draw_lines(count, depth):
    """Put the pins where a fingertip of 8 mm would leave them after lines of 100 mm, of a depth in mm."""
    bed, bridge = blender.bed(), blender.part("bridge")
    place = bridge.read_cells(bed.data)["position"]
    x, y = 1e3 * place.T
    aside = np.abs(y[:, None] - lines_at(count)).min(axis=1)
    away = np.hypot(np.maximum(np.abs(x) - 50.0, 0.0), aside)
    under = np.minimum(4.0 - depth - np.sqrt(np.maximum(16.0 - away**2, 0.0)), 0.0)
    height = np.where(away < 4.0, 40.0 + under, 40.0)
    bridge.write_cells(
        bed.data, place, 1e-3 * height, mode=np.where(height < 40.0, 1, 0).astype(np.int8)
    )


def lines_at(count):
    return 12.0 * (np.arange(count) - (count - 1) / 2)


def measure_lines(count, name):
    """Return by how much the luminance differs about each line, as the mean along it over a pitch."""
    shown, (_, region) = read_shot(name) @ [0.2126, 0.7152, 0.0722], blender.view()
    left, right = (blender.on_the_bed(x, 0.0)[0] - region.x for x in (-40.0, -10.0))
    rows = [blender.on_the_bed(0.0, y)[1] - region.y for y in (-1.0, 0.5)]
    profile = np.convolve(shown[:, left:right].mean(axis=1), np.ones(rows[1] - rows[0]), "same")
    profile /= rows[1] - rows[0]
    ends = [
        [blender.on_the_bed(0.0, y + d)[1] - region.y for d in (-6.0, 6.0)] for y in lines_at(count)
    ]
    return [float(np.ptp(profile[low:high])) for low, high in ends]


def rectangle_of_the_bed():
    bed = blender.bed()
    corners = np.array(
        [blender.pixel(bed.matrix_world @ Vector(corner)) for corner in bed.bound_box]
    )
    _, region = blender.view()
    corners -= (region.x, region.y)
    return [float(value) for value in (*corners.min(axis=0), *corners.max(axis=0))]


def count_covered():
    """Return how many pins of the bed the overlay covers."""
    (bed, *_), (_, region) = blender.beds(), blender.view()
    places = np.array([blender.pixel(bed.matrix_world @ pin.co) for pin in bed.data.vertices])
    low, high = np.add(np.reshape(blender.SEEN["overlay"], (2, 2)), (region.x, region.y))
    return int(((low < places) & (places < high)).all(axis=1).sum())


def note(name):
    form, bed = blender.part("device.view"), blender.bed()
    blender.shot(name)
    blender.SEEN[name] = {
        "form": bed.digiclay_display.form,
        "skin": form.is_skin_shown(bed),
        "far": form.is_far(bed),
        "orange": count_orange(name),
        "selected": [thing.name for thing in bpy.context.selected_objects],
        "lowest": float(blender.part("bridge").read_cells(bed.data)["height"].min()),
    }


def watch_overlay():
    module = blender.part("overlay.draw")
    draw = module.draw

    def noted(picture, width, height):
        if picture.boxes:
            box = picture.boxes[0]
            blender.SEEN["overlay"] = [box.x, box.y, box.x + box.width, box.y + box.height]
        elif picture.lines:
            blender.SEEN["text"] = [words.text for words in picture.words]
        draw(picture, width, height)

    module.draw = noted


def script():
    yield from see_at_once()
    add_bed()
    watch_overlay()
    yield from focus_window()
    blender.select(blender.bed())
    note("selected")
    middle = on_the_screen(0.0, 0.0)
    yield from levels_of_detail()
    # The key is one of the tool's.
    blender.choose_tool()
    for name in ("alt s", "alt s again"):
        yield from done(hand(to(middle), "key alt+s"))
        note(name)
    blender.call(bpy.ops.digiclay.session)
    yield from blender.settle(5)
    yield from finish(line((-24.0, -12.0), (24.0, -12.0)))
    note("pressed on the skin")
    blender.SEEN["bed"] = rectangle_of_the_bed()
    preferences, texts = bpy.context.preferences.addons[blender.EXTENSION].preferences, []
    for place, is_on in ((20.0, True), (16.0, False)):
        preferences.show_cursor_text = is_on
        yield from act(to(on_the_screen(place, -4.0), 0.3))
        texts.append(blender.SEEN["text"])
    preferences.show_cursor_text, blender.SEEN["texts"] = True, texts
    bed = blender.bed()
    yield from blender.open_sidebar()
    looking, covered = blender.view()[0].spaces.active.region_3d, []
    before = looking.view_distance, looking.view_location.copy()
    bed.digiclay_display.overlay_full = True
    for _ in range(2):  # and with a session that finds them there
        yield from act(to(on_the_screen(24.0, -8.0), 0.3))
        covered.append(count_covered())
        blender.call(bpy.ops.digiclay.session_stop)
        looking.view_distance, looking.view_location = before
        looking.update()
        blender.call(bpy.ops.digiclay.session)
    yield from blender.settle()
    note("overlay details")
    blender.SEEN["covered"] = covered
    bed.digiclay_display.overlay_full = False
    blender.view()[0].spaces.active.show_region_ui = False
    for shown, kind in (("pins", "smooth"), ("skin", "membrane"), ("both", "smooth")):
        bed.digiclay_display.form, bed.digiclay_display.skin = shown, kind
        yield from act(to(on_the_screen(23.0, -9.0), 0.3))
        note(f"{shown} {kind}")
    yield from act("key Escape")
    note("stopped")


def levels_of_detail():
    area, _ = blender.view()
    looking = area.spaces.active.region_3d
    distance = looking.view_distance
    steps = {"near": 1.0, "between": 0.0, "far": 14.0, "between again": 0.0, "back": 1.0}
    for name, times in steps.items():
        # Between the limits: 9 pixels a pitch.
        looking.view_distance = distance * (times or pitch_in_pixels(distance) / 9.0)
        area.tag_redraw()
        # The pitch is measured in a drawing, and acted upon by a timer.
        yield from blender.rounds(20)
        note(name)
    looking.view_distance = distance


def pitch_in_pixels(distance):
    """Return a pitch in a view whose middle is as far away, pixels at a UI scale of 1."""
    area, region = blender.view()
    lens = float(area.spaces.active.region_3d.window_matrix[1][1])
    return 0.03 * lens * region.height / 2.0 / distance / bpy.context.preferences.system.ui_scale
