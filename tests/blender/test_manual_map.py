"""*Online Manual* and F1: operators and settings of the extension lead to sections of the shipped guide."""

from __future__ import annotations

import re
import sys
import webbrowser
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath, PureWindowsPath

import bpy
import digiclay
import pytest
from digiclay import manual_map
from digiclay.panels.display import Display
from digiclay.settings.groups import CLASSES

#: A program that a test has Blender take for the browser: it writes down the address it is given.
WRITE = "import sys; open(sys.argv[1], 'a').write(sys.argv[2] + '\\n')"


def look_up(name: str) -> str:
    """Return the address that Blender finds for a name."""
    url: str = bpy.types.WM_OT_doc_view_manual._lookup_rna_url(name, verbose=False)
    return url


def operators() -> list[str]:
    """Return the extension's operators as Blender looks them up."""
    kinds = [getattr(bpy.types, name) for name in dir(bpy.types) if "_OT_" in name]
    ours = [kind for kind in kinds if kind.__module__.startswith("digiclay.")]
    return [f"bpy.ops.{kind.bl_idname}" for kind in ours]


def settings() -> list[str]:
    """Return the properties of the extension's groups as Blender looks them up."""
    kinds = (*CLASSES, Display)
    pairs = [(kind.bl_rna.identifier, known.identifier) for kind in kinds for known in kind.bl_rna.properties]
    return [f"bpy.types.{kind}.{name}" for kind, name in pairs if name not in ("rna_type", "name")]


@pytest.fixture
def anchors() -> set[str]:
    """The ends of an address that exist: the page's beginning and its headings."""
    return {"", *(f"#{one}" for one in re.findall(r'<h\d id="([^"]+)"', manual_map.PAGE.read_text("utf-8")))}


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file with the addresses that Blender has opened."""
    file = tmp_path / "opened.txt"
    monkeypatch.setattr(webbrowser, "_browsers", {})
    monkeypatch.setattr(webbrowser, "_tryorder", [])
    program = webbrowser.GenericBrowser([sys.executable, "-S", "-c", WRITE, str(file), "%s"])
    webbrowser.register("writer", None, program, preferred=True)
    return file


@pytest.mark.usefixtures("extension")
def test_every_operator_and_setting_leads_to_a_section_that_exists(anchors: set[str]) -> None:
    address = manual_map.PAGE.as_uri()
    names = [*operators(), *settings()]
    assert (len(operators()) > 40, len(settings()) > 150) == (True, True)
    found = {name: look_up(name) for name in names}
    first = {next(p for p, _ in manual_map.ENTRIES if fnmatchcase(name.lower(), p)) for name in names}
    assert [pattern for pattern, _ in manual_map.ENTRIES if pattern not in first] == [], "without use"
    assert {name: url for name, url in found.items() if url.removeprefix(address) not in anchors} == {}


@pytest.mark.usefixtures("extension")
def test_the_rest_of_blender_keeps_its_own_manual() -> None:
    for name in (
        "bpy.ops.mesh.primitive_cube_add",
        "bpy.types.Object.location",
        "bpy.types.DisplaySafeAreas.title",
    ):
        assert not (look_up(name) or "").startswith("file:")


@pytest.mark.usefixtures("extension")
@pytest.mark.parametrize(
    ("button", "anchor"),
    [
        ("digiclay.take_record", "#takes"),
        ("DIGICLAY_OT_press.depth", "#brushes"),
        ("MESH_OT_digital_clay_add.rows", "#first-ridge"),
        ("DIGICLAY_PG_valve.orifice_diameter", "#panels"),
        ("Display.skin", "#display"),
    ],
)
def test_online_manual_opens_the_section_of_a_button(button: str, anchor: str, opened: Path) -> None:
    assert bpy.ops.wm.doc_view_manual(doc_id=button) == {"FINISHED"}
    assert opened.read_text().splitlines() == [manual_map.PAGE.as_uri() + anchor]
    assert manual_map.PAGE.is_file()


def test_the_entries_come_with_the_extension_and_go_with_it() -> None:
    before = list(bpy.utils.manual_map())
    digiclay.register()
    assert list(bpy.utils.manual_map()) == [manual_map.manual_map(), *before]
    digiclay.unregister()
    assert list(bpy.utils.manual_map()) == before
    assert manual_map.manual_map() not in before


@pytest.mark.parametrize(
    ("page", "address"),
    [
        (
            PureWindowsPath("D:/Eigene Dateien/Ton#1/guide.html"),
            "file:///D:/Eigene%20Dateien/Ton%231/guide.html",
        ),
        (PureWindowsPath("//server/share/guide.html"), "file://server/share/guide.html"),
        (PurePosixPath("/opt/é?/guide.html"), "file:///opt/%C3%A9%3F/guide.html"),
    ],
)
def test_the_address_is_right_whatever_the_folder_is_called(page: PureWindowsPath, address: str) -> None:
    assert manual_map.locate_manual(page) == address
