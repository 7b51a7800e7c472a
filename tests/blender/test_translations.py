"""Translations of labels and tooltips; a missing entry is English."""

from __future__ import annotations

import bpy
import pytest
from digiclay import translations, ui_text
from digiclay.ui_text import localize

pytestmark = pytest.mark.usefixtures("extension")


@pytest.mark.parametrize(
    ("text", "german"),
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
def test_units_symbols_and_bounds_are_kept(text: str, german: str | None) -> None:
    assert translations.translate(text, "de") == german


def test_a_label_is_found_among_operators_and_elsewhere() -> None:
    entries = translations.make_entries({"Take Back a Gesture", "Nobody has written this"}, "de")
    wanted = "Geste zurücknehmen"
    assert entries == {("*", "Take Back a Gesture"): wanted, ("Operator", "Take Back a Gesture"): wanted}


def test_a_brush_has_the_name_of_what_it_does_where_other_things_are_smooth() -> None:
    entries = translations.make_entries({"Smooth"}, "de")
    assert (entries["*", "Smooth"], entries["Brush", "Smooth"]) == ("Glatt", "Glätten")


def test_values_come_into_their_places_in_the_language_of_the_interface() -> None:
    # Blender's module has no languages: its window shows them (tests/window).
    ui_text.set_translator(lambda text: translations.translate(text, "de") or text)
    try:
        assert localize("Simulated: {:.1f} s", 1.25) == "Simuliert: 1.2 s"
        assert localize("Nobody has written this {}", 1) == "Nobody has written this 1"
        ui_text.set_translator()
        assert localize("waiting") == "waiting"
    finally:
        ui_text.set_translator(bpy.app.translations.pgettext_iface)
    assert localize("Simulated: {:.1f} s", 1.25) == "Simulated: 1.2 s"
