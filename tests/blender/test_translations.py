"""Every label and tooltip has a translation."""

from __future__ import annotations

import bpy
import pytest
from digiclay import translations

pytestmark = pytest.mark.usefixtures("extension")


def test_every_label_and_tooltip_has_a_translation() -> None:
    texts = translations.collect_strings()
    assert len(texts) > 200
    assert sorted(text for text in texts if translations.translate(text, "de") is None) == []


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


def test_every_brush_has_a_translation_among_brushes() -> None:
    known = bpy.ops.digiclay.press.get_rna_type().properties["brush"]
    entries = translations.make_entries(translations.collect_strings(), "de")
    names = [known.name, *(item.name for item in known.enum_items)]
    assert [name for name in names if (known.translation_context, name) not in entries] == []
