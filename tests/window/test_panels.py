"""Panels in a real Blender window: all unfolded, with a control method of one's own, and an export."""

import zipfile

PLAYED = {"script": "look_at_panels.py"}
#: What Blender prints when a panel's draw fails, or asks for a property or a value there is not.
COMPLAINTS = (
    "rna_uiItemR",
    "property not found",
    "AttributeError",
    "unknown operator",
    "current value",
    "not found in",
)


def test_every_panel_is_drawn_unfolded_without_a_complaint_and_a_bed_beside_it(seen):
    pictures = (
        "start all device device_rest laboratory details takes control control_rest stale own"
    )
    others = "panels_own_missing panels_preferences export_features export_meshes export_browser"
    assert set(seen["colors"]) == {f"panels_{name}" for name in pictures.split()} | set(
        others.split()
    )
    assert [word for word in COMPLAINTS if word in seen["output"]] == []
    # Shaded pins have thousands of colors.
    assert 500 < seen["colors"]["panels_start"] < seen["colors"]["panels_all"]


def test_rebuild_tells_what_does_not_go_together_and_then_rebuilds(seen):
    assert "Pitch must be at least Actuator: Bore, 2 mm" in seen["rebuild refused"]
    assert (seen["rebuilt"], seen["pins"]) == (["FINISHED"], 500)


def test_the_panel_lists_what_was_formed_and_the_made_meshes_have_it_as_vertex_groups(seen):
    lines = seen["listed"].splitlines()
    assert lines[0] == "1 boss and 1 crease"
    assert lines[1].startswith("boss_1: 14.0 mm high, crest ")
    assert lines[3].startswith("crease_1: 9.0 mm deep")
    assert seen["groups"] == ["boss_1", "crease_1"]
    assert seen["undone"] == 2  # the two bodies, in one step


def test_the_file_browser_writes_the_file_with_the_ending_of_its_format(seen):
    assert seen["files"] == ["für später.3mf"]
    assert zipfile.ZipFile(seen["folder"] / seen["files"][0]).testzip() is None
