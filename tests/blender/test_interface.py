"""Panels, Online Manual and translations."""

import re
import sys
import webbrowser
from fnmatch import fnmatchcase
from pathlib import PurePosixPath, PureWindowsPath

import bpy
import digiclay
import pytest
from digiclay import manual_map, panels, translations, ui_text
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.schema import SECTIONS, import_parameters
from digiclay.panels.base import CATEGORY
from digiclay.panels.display import Display
from digiclay.panels.parameters import in_use
from digiclay.roles import bed_of, fingertip_of
from digiclay.settings.declared import LABELS, title
from digiclay.settings.groups import CLASSES
from digiclay.ui_text import localize

from tests.blender.at_hand import activate, new_bed

#: Sections drawn by a panel of another kind: a shape is chosen rather than typed.
ELSEWHERE = {"shape"}


@pytest.fixture
def bed(extension):
    return new_bed(rows=6, columns=6)


def panel(name):
    return getattr(bpy.types, f"DIGICLAY_PT_{name}")


def test_the_panels_are_about_the_bed_that_the_active_object_belongs_to(bed):
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    assert bed_of(bpy.context) == bpy.context.object
    cube = bpy.data.objects["Cube"]
    cube.parent = fingertip_of(bed)
    for part in (bed, *bed.children_recursive):
        activate(part)
        assert bed_of(bpy.context) == bed
    assert len(bed.children_recursive) == 3  # fingertip, its ellipsoid, the cube
    assert not panel("start").poll(bpy.context)
    assert panel("device").poll(bpy.context)


@pytest.mark.parametrize("active", ["Cube", None])
def test_without_a_bed_there_is_only_the_panel_that_offers_one(active, bed):
    activate(bpy.data.objects[active] if active else None)
    shown = [
        kind.bl_idname
        for kind in panels.CLASSES
        if hasattr(kind, "bl_category") and kind.poll(bpy.context)
    ]
    assert shown == ["DIGICLAY_PT_start"]


@pytest.mark.usefixtures("extension")
def test_every_part_of_a_scene_has_a_panel():
    names = [name for name in SECTIONS if name not in ELSEWHERE]
    assert [name for name in names if not hasattr(bpy.types, f"DIGICLAY_PT_part_{name}")] == []


def test_the_tab_shows_what_a_sculptor_needs_and_keeps_what_a_researcher_needs_closed():
    drawn = [kind for kind in panels.CLASSES if issubclass(kind, bpy.types.Panel)]
    # Opens from the header of the tool.
    drawn = [kind for kind in drawn if kind.bl_region_type != "HEADER"]
    places = {(kind.bl_space_type, kind.bl_region_type, kind.bl_category) for kind in drawn}
    assert places == {("VIEW_3D", "UI", CATEGORY)}
    orders = [(kind.bl_parent_id, kind.bl_order) for kind in drawn]
    assert len(set(orders)) == len(orders)
    tree = {}
    for kind in sorted(drawn, key=lambda kind: kind.bl_order):
        tree.setdefault(kind.bl_parent_id.removeprefix("DIGICLAY_PT_"), []).append(kind.bl_label)
    assert tree[""] == ["Digital Clay", "Session", "Show", "Export", "Laboratory"]
    assert (tree["session"], tree["export"]) == (["Shapes", "Takes", "Pressers"], ["Features"])
    assert tree["laboratory"] == ["View Details", "Fingertip", "Device", "Control"]
    opened = {kind.bl_label for kind in drawn if "DEFAULT_CLOSED" not in kind.bl_options}
    assert opened == {"Digital Clay", "Session", "Show", "Export"}


@pytest.mark.parametrize("method", METHODS)
def test_a_blister_is_shown_where_the_method_forms_one(method, bed):
    bed.digiclay.method = method
    assert panel("part_blister").poll(bpy.context) == (METHODS[method].blister is not None)


@pytest.mark.parametrize(
    "switch, grayed",
    [
        ("fingertip", {"fingertip", "contact", "relaxation"}),
        ("control", {"control", "blister"}),
        ("delay", {"delay"}),
    ],
)
def test_what_is_left_out_is_grayed_with_what_belongs_to_it(switch, grayed, bed):
    settings = bed.digiclay
    used = {name for name in SECTIONS if in_use(settings, name)}
    setattr(settings, f"use_{switch}", False)
    assert used - {name for name in SECTIONS if in_use(settings, name)} == grayed


#: A program that a test has Blender take for the browser: it writes down the address it is given.
WRITE = "import sys; open(sys.argv[1], 'a').write(sys.argv[2] + '\\n')"


def look_up(name):
    url = bpy.types.WM_OT_doc_view_manual._lookup_rna_url(name, verbose=False)
    return url


def operators():
    """Return the extension's operators as Blender looks them up."""
    kinds = [getattr(bpy.types, name) for name in dir(bpy.types) if "_OT_" in name]
    ours = [kind for kind in kinds if kind.__module__.startswith("digiclay.")]
    return [f"bpy.ops.{kind.bl_idname}" for kind in ours]


def settings():
    """Return the properties of the extension's groups as Blender looks them up."""
    kinds = (*CLASSES, Display)
    pairs = [
        (kind.bl_rna.identifier, known.identifier)
        for kind in kinds
        for known in kind.bl_rna.properties
    ]
    return [f"bpy.types.{kind}.{name}" for kind, name in pairs if name not in ("rna_type", "name")]


@pytest.fixture
def opened(tmp_path, monkeypatch):
    file = tmp_path / "opened.txt"
    monkeypatch.setattr(webbrowser, "_browsers", {})
    monkeypatch.setattr(webbrowser, "_tryorder", [])
    program = webbrowser.GenericBrowser([sys.executable, "-S", "-c", WRITE, str(file), "%s"])
    webbrowser.register("writer", None, program, preferred=True)
    return file


@pytest.mark.usefixtures("extension")
def test_every_operator_and_setting_leads_to_a_section_that_exists():
    # The ends of an address that exist: the page's beginning and its headings.
    page = manual_map.PAGE.read_text("utf-8")
    anchors = {"", *(f"#{one}" for one in re.findall(r'<h\d id="([^"]+)"', page))}
    address = manual_map.PAGE.as_uri()
    names = [*operators(), *settings()]
    assert (len(operators()) > 40, len(settings()) > 150) == (True, True)
    found = {name: look_up(name) for name in names}
    first = {
        next(p for p, _ in manual_map.ENTRIES if fnmatchcase(name.lower(), p)) for name in names
    }
    assert [pattern for pattern, _ in manual_map.ENTRIES if pattern not in first] == [], (
        "without use"
    )
    assert {
        name: url for name, url in found.items() if url.removeprefix(address) not in anchors
    } == {}
    # The rest of Blender keeps its own manual.
    for name in (
        "ops.mesh.primitive_cube_add",
        "types.Object.location",
        "types.DisplaySafeAreas.title",
    ):
        assert not (look_up(f"bpy.{name}") or "").startswith("file:")


@pytest.mark.usefixtures("extension")
@pytest.mark.parametrize(
    "button, anchor",
    [
        ("digiclay.take_record", "#takes"),
        ("DIGICLAY_OT_press.depth", "#brushes"),
        ("MESH_OT_digital_clay_add.rows", "#first-ridge"),
        ("DIGICLAY_PG_valve.orifice_diameter", "#panels"),
        ("Display.skin", "#display"),
    ],
)
def test_online_manual_opens_the_section_of_a_button(button, anchor, opened):
    assert bpy.ops.wm.doc_view_manual(doc_id=button) == {"FINISHED"}
    assert opened.read_text().splitlines() == [manual_map.PAGE.as_uri() + anchor]
    assert manual_map.PAGE.is_file()


def test_the_entries_come_with_the_extension_and_go_with_it():
    before = list(bpy.utils.manual_map())
    digiclay.register()
    assert list(bpy.utils.manual_map()) == [manual_map.manual_map(), *before]
    digiclay.unregister()
    assert list(bpy.utils.manual_map()) == before
    assert manual_map.manual_map() not in before


@pytest.mark.parametrize(
    "page, address",
    [
        (
            PureWindowsPath("D:/Eigene Dateien/Ton#1/g.html"),
            "file:///D:/Eigene%20Dateien/Ton%231/g.html",
        ),
        (PureWindowsPath("//server/share/guide.html"), "file://server/share/guide.html"),
        (PurePosixPath("/opt/é?/guide.html"), "file:///opt/%C3%A9%3F/guide.html"),
    ],
)
def test_the_address_is_right_whatever_the_folder_is_called(page, address):
    assert manual_map.locate_manual(page) == address


@pytest.mark.parametrize(
    "text, german",
    [
        ("Bore (mm)", "Bohrung (mm)"),
        (
            "Inner diameter of the cylinder; symbol D_a; above 0 mm; by default 2 mm",
            "Innendurchmesser des Zylinders; Formelzeichen D_a; über 0 mm; voreingestellt 2 mm",
        ),
        ("Nobody has written this", None),
        ("Nobody has written this; above 0 mm", None),
        ("Dead time; with an addition", None),
    ],
)
def test_units_symbols_and_bounds_are_kept(text, german):
    assert translations.translate(text, "de") == german


def test_methods_laws_sections_and_parameters_have_german_labels():
    names = {*METHODS, *SECTIONS}
    for section in SECTIONS:
        for method in METHODS:
            for name, known in list_quantities(import_parameters(section, method)).items():
                names |= {name, *known.choices}
    labels = {title(name) for name in names}.union(LABELS.values())
    lacking = sorted(labels - translations._catalog("de")["labels"].keys())
    assert lacking == [], "addon/digiclay/translations/de.toml, [labels], needs each"


def test_a_label_is_found_among_operators_and_elsewhere_and_a_brush_has_the_name_of_what_it_does():
    entries = translations.make_entries({"Take Back a Gesture", "Nobody has written this"}, "de")
    wanted = "Geste zurücknehmen"
    assert entries == {
        ("*", "Take Back a Gesture"): wanted,
        ("Operator", "Take Back a Gesture"): wanted,
        ("Brush", "Take Back a Gesture"): wanted,
    }
    entries = translations.make_entries({"Smooth"}, "de")
    assert (entries["*", "Smooth"], entries["Brush", "Smooth"]) == ("Glatt", "Glätten")


@pytest.mark.usefixtures("extension")
def test_values_come_into_their_places_in_the_language_of_the_interface():
    # Blender's module has no languages: its window shows them (tests/window).
    ui_text.set_translator(lambda text, context: translations.translate(text, "de") or text)
    try:
        assert localize("Simulated: {:.1f} s", 1.25) == "Simuliert: 1.2 s"
        assert localize("Nobody has written this {}", 1) == "Nobody has written this 1"
        ui_text.set_translator()
        assert localize("waiting") == "waiting"
    finally:
        ui_text.set_translator(bpy.app.translations.pgettext_iface)
    assert localize("Simulated: {:.1f} s", 1.25) == "Simulated: 1.2 s"
