"""Meshes that come to press a bed, and cease to: refused, of other files, with Subdivision, without a bed."""

import bpy
import numpy as np
import pytest
from digiclay.device.pressers import read_cage
from digiclay.press.tool import name_hider
from digiclay.roles import bed_of, list_pressers

from tests.blender.at_hand import delete, looked, save_and_open, select
from tests.blender.session.balls import place, sphere
from tests.blender.session.live import exact, only_bed, started


def test_subdivision_is_off_while_a_mesh_presses_and_on_in_renders(bed, ball, clock):
    bpy.ops.digiclay.remove_presser(presser="Ball")
    assert list_pressers(bed) == []
    assert bed_of(bpy.context) == bed  # its panels stay
    select(ball)
    finer = ball.modifiers.new("Finer", "SUBSURF")
    finer.levels = 6  # beyond the number of triangles that can press
    off = ball.modifiers.new("Off", "MULTIRES")
    off.show_viewport = False
    bpy.ops.digiclay.add_presser()
    assert (finer.show_viewport, finer.show_render) == (False, True)
    looked()
    assert len(read_cage(bpy.context, bed, ball).mesh.triangles) == len(ball.data.polygons)
    bpy.ops.digiclay.add_presser()
    bpy.ops.digiclay.remove_presser()
    assert (finer.show_viewport, off.show_viewport) == (True, False)


def test_a_refused_mesh_and_those_selected_with_it_stay_as_they_are(bed, ball):
    bpy.ops.digiclay.remove_presser()
    finer = ball.modifiers.new("Finer", "SUBSURF")
    bpy.ops.mesh.primitive_plane_add(location=ball.location, rotation=(0.3, 0.2, 0.1))
    select(ball, bpy.context.object)
    with pytest.raises(RuntimeError, match=r"Plane\.mesh must have a thickness"):
        bpy.ops.digiclay.add_presser()
    assert (finer.show_viewport, list_pressers(bed)) == (True, [])


def test_an_armature_that_moves_a_mesh_shows_the_panels_of_its_bed(bed, ball):
    bpy.ops.object.armature_add(location=ball.location)
    armature = bpy.context.object
    assert bed_of(bpy.context) is None
    ball.modifiers.new("Armature", "ARMATURE").object = armature
    bpy.ops.object.mode_set(mode="POSE")
    assert bed_of(bpy.context) == bed


def test_a_mesh_that_presses_is_not_told_to_hide_the_bed(bed, ball):
    assert name_hider(bed, bpy.data.objects["Cube"]) == "Cube hides the bed"
    assert name_hider(bed, ball) == ""


def test_without_its_bed_a_presser_is_a_mesh_like_any_other_and_may_press_the_next(bed, ball):
    delete(bed)
    select(ball)
    assert bed_of(bpy.context) is None
    with pytest.raises(RuntimeError, match=r"Select one bed .*\(got 0\)"):
        bpy.ops.digiclay.add_presser()
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    other = bpy.context.object
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    select(ball)
    with pytest.raises(RuntimeError, match=r"Select one bed .*\(got 2\)"):
        bpy.ops.digiclay.add_presser()
    select(other, ball)
    bpy.ops.digiclay.add_presser()
    assert list_pressers(other) == [ball]
    select(ball)
    assert bed_of(bpy.context) == other


@pytest.mark.parametrize("override", [False, True])
def test_a_mesh_of_another_file_presses_and_is_kept(bed, ball, clock, tmp_path, override):
    bpy.ops.digiclay.remove_presser()
    place(ball, 36e-3)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "ball.blend"), copy=True)
    ball.name = "Another"
    with bpy.data.libraries.load(str(tmp_path / "ball.blend"), link=True) as (_, here):
        here.objects = ["Ball"]
    (linked,) = here.objects
    bpy.context.collection.objects.link(linked)
    if override:
        linked = linked.override_create(remap_local_usages=True)
    select(linked)
    bpy.ops.digiclay.add_presser()
    save_and_open(tmp_path / "bed.blend")
    bed = only_bed()
    (presser,) = list_pressers(bed)
    assert presser.name == "Ball"
    select(presser)
    assert bed_of(bpy.context) == bed
    started(bed)
    clock.tick(20)
    assert np.abs(exact(bed) - sphere(bed)).max() < 0.1e-3
    bpy.ops.digiclay.remove_presser(presser="Ball")
    assert (list_pressers(bed), bed_of(bpy.context)) == ([], bed)
