"""Played by `driver`: draws the tab in German and English, and measures what its rows need and have."""

import blf
import bpy

from tests.window import driver as blender

#: Languages and scales.
LOOKS = (("de_DE", 1.0), ("de_DE", 1.5), ("en_US", 1.0))
#: Panels that are unfolded one after another, and sections of them.
PANELS = {
    "DIGICLAY_PT_session": "",
    "DIGICLAY_PT_shapes": "",
    "DIGICLAY_PT_takes": "",
    "DIGICLAY_PT_pressers": "",
    "DIGICLAY_PT_show": "",
    "DIGICLAY_PT_display": "",
    "DIGICLAY_PT_features": "",
    "DIGICLAY_PT_laboratory": "fingertip",
    "DIGICLAY_PT_device": "layout actuator supply fluid valve conduit valve_lag delay contact relaxation",
    "DIGICLAY_PT_control": "control blister sensors simulation recorder",
}
LIVE = ("DIGICLAY_PT_session", "DIGICLAY_PT_takes", "DIGICLAY_PT_laboratory")
#: At a scale of 1, pixels: an icon with the margins of its button, the margins of a label of a
#: property, and what tabs and margins take of a sidebar.
ICON, MARGIN, TABS = 26.0, 6.0, 55.0
#: Share of a row that the label of a property has.
LABEL = 0.4


def find_need(part, scale, margin=ICON):
    """Return the width that a part of a layout needs at least, pixels, and the longest text in it."""
    if "items" not in part:
        text = part["draw_string"]
        return (blf.dimensions(0, text)[0] + margin * scale if text else 0.0), text
    if part["type"] == "LAYOUT_SPLIT":
        needs = [find_need(item, scale, MARGIN) for item in part["items"]]
        shares = (LABEL, 1.0 - LABEL)
        needs = [(need / share, text) for (need, text), share in zip(needs, shares, strict=True)]
        return max(needs)
    needs = [find_need(item, scale, margin) for item in part["items"]] or [(0.0, "")]
    longest = max(needs)
    return (sum(need for need, _ in needs), longest[1]) if part["type"] == "LAYOUT_ROW" else longest


def list_texts(part):
    """Return all texts in a part of a layout."""
    if "items" not in part:
        return [part["draw_string"]]
    return [text for item in part["items"] for text in list_texts(item)]


def script():
    """Unfold each panel, then those of a session that records; look at all of the overlay."""
    yield from blender.empty_scene()
    preferences = bpy.context.preferences
    preferences.view.language = "de_DE"
    drawn = blender.SEEN["drawn"] = {}

    def measure(panel, context):
        scale = preferences.system.ui_scale
        points = preferences.ui_styles[0].widget.points
        blf.size(0, points * scale)
        (root,) = panel.layout.introspect()
        need, text = find_need(root, scale)
        if preferences.view.language == "de_DE":
            blender.SEEN["texts"] = sorted({*blender.SEEN.get("texts", ()), *list_texts(root)})
        drawn[f"{type(panel).__name__}, {scale}: {text}"] = (
            need,
            context.region.width - TABS * scale,
        )

    for kind in blender.part("panels").CLASSES:
        if issubclass(kind, bpy.types.Panel):
            kind.append(measure)
    yield from unfold("DIGICLAY_PT_start", "")
    yield from blender.add_bed(bed="paper")
    bpy.ops.mesh.primitive_cube_add(location=(0.0, 0.0, 3.0))
    bpy.context.object.name = "Cube"  # a word that Blender translates
    yield None
    blender.call(bpy.ops.digiclay.add_presser)
    for language, scale in LOOKS:
        preferences.view.language, preferences.view.ui_scale = language, scale
        for root, sections in PANELS.items():
            yield from unfold(root, sections)
    preferences.view.language, preferences.view.ui_scale = LOOKS[0]
    blender.bed().digiclay_display.overlay_full = True
    yield from blender.start()
    blender.call(bpy.ops.digiclay.take_record)
    for root in LIVE:
        yield from unfold(root, "")
    yield from blender.open_sidebar()
    blender.part("overlay.views").follow()  # which went with the panels
    blender.shot("german_overlay")


def unfold(root, sections):
    """Draw a panel, with some sections, in a tab of its own."""
    with blender.unfolded("german", root, *sections.split()) as tab:
        yield from blender.open_sidebar(tab)
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
