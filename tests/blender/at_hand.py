"""What a user does to beds with Blender's own operators, and what the scene has after it."""

import tempfile
from pathlib import Path

import bpy
import numpy as np
from digiclay import operators
from digiclay.compat import strips
from digiclay.device import part_watch
from digiclay.overlay.picture import choose_colors
from digiclay.overlay.sections import lay_out
from digiclay.roles import BALL, FINGER, HOUSING, OWNED, ROLE, fingertip_of, is_bed

#: Names of all operators.
OPERATORS = [kind.bl_idname for kind in operators.CLASSES if issubclass(kind, bpy.types.Operator)]
#: Files with a bed each, by how it was added.
FILES = tempfile.TemporaryDirectory(prefix="digiclay-beds-")


def open_bed(name, add):
    """Open the factory file with a bed that `add` adds the first time: a tenth of the time that takes."""
    path = Path(FILES.name, f"{name}.blend")
    if not path.exists():
        bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)
        add()
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    bpy.ops.wm.read_homefile(filepath=str(path))
    return beds()[0]


def new_bed(**options):
    """Open the factory file with a bed of the Add menu in it, active."""
    name = "-".join(f"{value}" for value in ("bed", *options.values()))
    return open_bed(name, lambda: bpy.ops.mesh.digital_clay_add(**options))


def read_picture(path):
    """Read a picture with Blender itself, (height, width, 3) sRGB in [0, 1], the lower row first."""
    image = bpy.data.images.load(str(path.resolve()))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], image.channels)
    bpy.data.images.remove(image)
    return pixels[:, :, :3]


def film_strip(scene, path):
    """Put a film into the sequencer of a scene; return its strip and how many frames it has."""
    strip = strips(scene).new_movie("film", str(path), channel=1, frame_start=1)
    # From 5.2 on.
    return strip, int(strip.duration if hasattr(strip, "duration") else strip.frame_final_duration)


def in_the_view():
    """Return the override of the context with the main region of the 3D view."""
    (window,) = bpy.context.window_manager.windows
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def push_step(name):
    """Push an undo step."""
    bpy.ops.ed.undo_push(message=name)


def done(step):
    """End a user's action as Blender does: an undo step, an evaluation, and what waits for those."""
    push_step(step)
    looked()


def looked():
    bpy.context.view_layer.update()
    part_watch.settle()
    bpy.context.view_layer.update()


def undone():
    """Undo one step, as the user counts them."""
    bpy.ops.ed.undo()
    looked()


def redone():
    bpy.ops.ed.redo()
    looked()


def add_alone():
    """Add a small bed to a scene without any other object."""
    bpy.data.batch_remove(bpy.data.objects)
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)


def added(x=0.0):
    """Add a small bed, its fingertip somewhere; the first one by a file: a tenth of the time."""
    if bpy.data.objects:
        bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    else:
        open_bed("alone", add_alone)
    bed = bpy.context.object
    bed.location.x = x
    fingertip_of(bed).location.x += 0.05
    done("Add")
    return bed


def activate(thing):
    """Make an object, or None, the active one."""
    bpy.context.view_layer.objects.active = thing


def select(*things):
    """Select objects alone, the last one active."""
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
        activate(thing)


def duplicate(*things, linked=False):
    """Duplicate objects as a user does; return the active copy."""
    select(*things)
    bpy.ops.object.duplicate(linked=linked)
    done("Duplicate")
    return bpy.context.object


def delete(*things):
    select(*things)
    bpy.ops.object.delete()
    done("Delete")


def fetch(file, name, how):
    """Append an object of a file, or link it and make it local, as a user does."""
    source = {"directory": str(file / "Object") + "/", "filename": name}
    if how == "link":
        bpy.ops.wm.link(**source)
        done("Link")
        assert (len(bpy.context.scene.objects), housings()) == (1, 1)
        select(bpy.context.scene.objects[0])
        bpy.ops.object.make_local(type="ALL")
        done("Make Local")
    else:
        bpy.ops.wm.append(**source)


def read_overlay(readings):
    """Return the texts of the overlay with these readings."""
    colors = choose_colors((0.1, 0.1, 0.1), (0.9, 0.9, 0.9))
    return [words.text for words in lay_out(readings, colors, (0.0, 0.0, 900.0, 900.0), 1.0).words]


def save_and_open(file):
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.open_mainfile(filepath=str(file))


def beds():
    return [thing for thing in bpy.context.scene.objects if is_bed(thing)]


def whole(*found):
    """Tell whether the scene has these beds, each with a fingertip of its own, and nothing else."""
    tips = [fingertip_of(bed) for bed in found]
    balls = [tip[BALL] for tip in tips if tip is not None]
    parts = {*found, *tips, *balls}
    of_balls = [ball.parent for ball in balls] == tips
    return len(parts) == 3 * len(found) and of_balls and set(bpy.context.scene.objects) == parts


def evaluate(bed):
    """Return the mesh that Blender draws a bed as."""
    return bed.evaluated_get(bpy.context.evaluated_depsgraph_get()).data


def instances(bed):
    """Give the instances that Blender draws for a bed, pins and arrows; each until the next is asked for."""
    for item in bpy.context.evaluated_depsgraph_get().object_instances:
        if item.is_instance and item.parent.original == bed:
            yield item


def inventory():
    """Name everything in the open file, but the slots Blender shows its results in."""
    slots = {"Render Result", "Viewer Node"}
    kinds = {name: getattr(bpy.data, name) for name in dir(bpy.data)}
    found = {
        name: kind
        for name, kind in kinds.items()
        if isinstance(kind, bpy.types.bpy_prop_collection)
    }
    return {name: sorted({item.name for item in kind} - slots) for name, kind in found.items()}


def housings():
    graph = bpy.context.evaluated_depsgraph_get()
    drawn = (item.object for item in graph.object_instances if not item.is_instance)
    meshes = (thing.data for thing in drawn if thing.type == "MESH")
    return sum(
        one is not None and one.get(ROLE) == "housing" for mesh in meshes for one in mesh.materials
    )


def older(bed):
    """Make a bed what it was in older files: its housing an object, nothing held by properties."""
    tree = bed.modifiers[0].node_group
    case = tree.nodes["Housing"].inputs["Object"].default_value.copy()
    case[ROLE], case.parent = HOUSING, bed
    bpy.context.collection.objects.link(case)
    (last,) = (one for one in tree.nodes if one.bl_idname == "NodeGroupOutput")
    ends = [link.from_socket for link in last.inputs[0].links[0].from_node.inputs[0].links]
    tree.links.new(next(end for end in ends if end.node.name != "Housing"), last.inputs[0])
    tree.nodes.remove(tree.nodes["Housing"])
    tree.nodes["Sources"].name = "Collection Info"
    tip = fingertip_of(bed)
    ball, tip.instance_collection = tip[BALL], None
    for thing, names in ((bed, [FINGER]), (tip, [BALL, OWNED]), (ball, [OWNED])):
        for name in names:
            del thing[name]
