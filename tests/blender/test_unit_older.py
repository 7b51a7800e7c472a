"""Beds of older files, whose housing is an object: they open as they are, and are one with their parts."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest
from digiclay.device import view

from tests.blender.at_hand import added, beds, done, housings, looked, older, select, undone, whole

pytestmark = pytest.mark.usefixtures("watched")


def test_a_bed_of_an_older_file_stays_as_it_is_and_is_one_all_the_same(tmp_path: Path) -> None:
    older(added())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "older.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "older.blend"))
    looked()
    (bed,) = beds()
    assert len(bpy.context.scene.objects) == 4
    assert housings() == 1
    bed.hide_set(True)
    done("Hide")
    assert not [thing for thing in bpy.context.scene.objects if thing.visible_get()]
    bed.hide_set(False)
    done("Show")
    select(bed)
    done("Select")
    bpy.ops.object.duplicate()
    done("Duplicate")
    copy = bpy.context.object
    assert len(bpy.context.scene.objects) == 7
    assert housings() == 2
    assert view.color_source(copy) == "mode"
    select(bed)
    bpy.ops.object.delete()
    done("Delete")
    assert whole(copy)


def test_a_bed_appended_from_an_older_file_is_made_whole_and_its_helpers_put_away(tmp_path: Path) -> None:
    bed = added()
    older(bed)
    name = bed.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "older.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    looked()
    done("Empty")
    bpy.ops.wm.append(directory=str(tmp_path / "older.blend" / "Object") + "/", filename=name)
    assert len(bpy.context.scene.objects) == 1 + 26
    done("Append")
    assert whole(*beds())
    assert housings() == 1
    undone()
    assert len(bpy.context.scene.objects) == 0
