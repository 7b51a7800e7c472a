"""Every operator on a bed in every state: it does its work, or says in one line why it does not."""

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.compat import read_stored
from digiclay.core.base.errors import DigiclayError
from digiclay.exchange import formed_bed
from digiclay.exchange.formed_bed import FORMER
from digiclay.live import tick
from digiclay.operators.pin_view import pick_pins
from digiclay.recorded import takes
from digiclay.roles import fingertip_of, is_bed
from digiclay.sessions import running
from digiclay.settings import own_presets, properties

from tests.blender.at_hand import OPERATORS, activate, beds, done, in_the_view, new_bed, select

#: What an operator does: it adds a bed, or reads data or pins of one, or changes its settings and
#: parts, or forms and displays something with its pins.
ADDS, DATA, PINS, CHANGES, FORMS = "adds", "data", "pins", "changes", "forms"
#: Every operator that works without a hand and without a session, how it is called, and what it
#: does.
CALLS = {
    "mesh.digital_clay_add": ({"rows": 4, "columns": 4}, ADDS),
    "digiclay.add_sample": ({"sample": "session:tap", "take": False}, ADDS),
    "digiclay.open_scene": ({"filepath": "tap.toml", "take": False}, ADDS),
    "digiclay.take_export": ({"filepath": "take.toml"}, DATA),
    "digiclay.preset_save": ({"name": "Another"}, DATA),
    "mesh.digital_clay_make": ({}, PINS, ADDS),
    "export_mesh.digital_clay": ({"filepath": "bed.stl"}, PINS),
    "export_anim.digital_clay": ({"filepath": "bed.glb", "file_format": "glb"}, PINS),
    "digiclay.find_features": ({}, PINS),
    "digiclay.rebuild": ({}, CHANGES),
    "digiclay.forget_surface": ({}, CHANGES),
    "digiclay.clear_pins": ({}, CHANGES),
    "digiclay.skin_toggle": ({}, CHANGES),
    "digiclay.preset_apply": ({"preset": "viscous"}, CHANGES),
    "digiclay.preset_parts": ({"filepath": "fitted.toml"}, CHANGES),
    "digiclay.preset_remove": ({}, CHANGES),
    "digiclay.shape_remove": ({}, CHANGES),
    "digiclay.take_remove": ({}, CHANGES),
    "digiclay.bake_free": ({}, CHANGES),
    "digiclay.add_fingertip": ({}, FORMS),
    "digiclay.add_hand": ({}, FORMS),
    "digiclay.add_presser": ({}, FORMS),
    "digiclay.keep_surface": ({}, FORMS),
    "digiclay.press_scale": ({"scalar": 1.5}, FORMS),
    "digiclay.press_finger": ({"kind": "palm"}, FORMS),
    "digiclay.session_reset": ({}, FORMS),
    "digiclay.shape_from_object": ({}, FORMS),
    "digiclay.shape_from_file": ({"filepath": "ramp.npy"}, FORMS),
    "digiclay.shape_sample": ({"sample": "dome"}, FORMS),
    "digiclay.shape_keep": ({}, FORMS),
    "digiclay.play_strokes": ({"filepath": "strokes.toml"}, FORMS),
    "digiclay.take_replay": ({}, FORMS),
    "digiclay.bake": ({"last": 3}, FORMS),
}
WRITTEN = "take.toml", "bed.stl", "bed.glb"
#: What needs a bed that plays a bake, which nothing else is called on.
BAKED = {"digiclay.bake_free"}
#: What needs a hand, a view, a session, or the folder of a run.
ELSEWHERE = {
    "import_scene.digital_clay_run",
    "digiclay.pick_pins",
    "digiclay.methods_reload",
    "digiclay.remove_presser",
    "digiclay.press",
    "digiclay.press_size",
    "digiclay.press_depth",
    "digiclay.press_strength",
    "digiclay.press_brush",
    "digiclay.press_brush_save",
    "digiclay.press_base",
    "digiclay.press_center",
    "digiclay.press_curves",
    "digiclay.press_keys",
    "digiclay.press_locks",
    "digiclay.press_locks_area",
    "digiclay.press_locks_height",
    "digiclay.press_shape",
    "digiclay.press_line",
    "digiclay.session",
    "digiclay.session_go_on",
    "digiclay.finish_strokes",
    "digiclay.session_escape",
    "digiclay.leave_mode",
    "digiclay.session_pause",
    "digiclay.session_step",
    "digiclay.session_stop",
    "digiclay.session_rewind",
    "digiclay.follow_server",
    "digiclay.leave_server",
    "digiclay.take_record",
    "digiclay.take_keep",
}


def link(bed):
    """Link the bed of the open file into an empty one, with all that belongs to it."""
    path = bpy.data.filepath
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)
    with bpy.data.libraries.load(path, link=True) as (there, here):
        here.objects = [name for name in there.objects if name.startswith(("Digital", "Fingertip"))]
    for thing in here.objects:
        if thing.type == "EMPTY" or is_bed(thing):
            bpy.context.collection.objects.link(thing)
    return next(thing for thing in here.objects if is_bed(thing))


def override(bed):
    select(link(bed))
    bpy.ops.object.make_override_library()
    bpy.context.object.data.override_create(remap_local_usages=True)
    return bpy.context.object


def half_local(bed):
    return link(bed).make_local()


def damage(bed):
    """Delete the last row of pins: the others are a bed of fewer rows."""
    select(bed)
    for vertex in bed.data.vertices:
        vertex.select = vertex.index >= 20
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.delete(type="VERT")
    bpy.ops.object.mode_set(mode="OBJECT")
    return bed


def edit(bed):
    select(bed)
    bpy.ops.object.mode_set(mode="EDIT")
    return bed


def mirror(bed):
    bed.scale = (-1.0, 1.0, 1.0)
    return bed


def hide(bed):
    bed.hide_set(True)
    return bed


def put(bed, name):
    """Put the bed with its parts into a new collection alone; return that, in the view layer."""
    collection = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(collection)
    for thing in (bed, fingertip_of(bed)):
        for former in thing.users_collection:
            former.objects.unlink(thing)
        collection.objects.link(thing)
    return bpy.context.view_layer.layer_collection.children[name]


def exclude(bed):
    put(bed, "Excluded").exclude = True
    return bed


def exclude_one(bed):
    """Have the bed stand in a collection that is excluded as well, the first of its two."""
    layer = put(bed, "A")
    for thing in (bed, fingertip_of(bed)):
        bpy.context.scene.collection.objects.link(thing)
    layer.exclude = True
    return bed


def hide_collection(bed):
    """Hide the collection that what is added goes into, with its eye."""
    layer = put(bed, "Hidden")
    bpy.context.view_layer.active_layer_collection = layer
    layer.hide_viewport = True
    bpy.context.view_layer.active_layer_collection = layer
    return bed


def leave_scene(bed):
    bpy.context.window.scene = bpy.data.scenes.new("Another")
    return bed


def keep(bed):
    return bed


SESSION = "a session"
EVERY = {SESSION: ({}, FORMS), **CALLS}
#: Operators of each use: what they need of a state is one rule per use, which other states have
#: every operator follow.
SOME = (
    SESSION,
    "mesh.digital_clay_add",
    "mesh.digital_clay_make",
    "digiclay.take_export",
    "export_mesh.digital_clay",
    "digiclay.skin_toggle",
    "digiclay.keep_surface",
)
#: States of a bed: what brings it there, what can be done with it then, while all else is refused,
#: and the operators that are called.
STATES = {
    "plain": (keep, {ADDS, DATA, PINS, CHANGES, FORMS}, EVERY),
    "linked": (link, {ADDS, DATA, PINS}, EVERY),
    "overridden, with its mesh": (override, {ADDS, DATA, PINS}, SOME),
    "linked, the object made local alone": (half_local, {ADDS, DATA, PINS}, SOME),
    "mirrored": (mirror, {ADDS, DATA, CHANGES}, EVERY),
    "pins deleted": (damage, {ADDS, DATA, CHANGES}, SOME),
    "its collection excluded": (exclude, {ADDS, DATA}, EVERY),
    "one of its collections excluded": (exclude_one, {ADDS, DATA, PINS, CHANGES, FORMS}, SOME),
    "its collection hidden, and active": (
        hide_collection,
        {DATA, PINS, CHANGES, FORMS},
        (*SOME, "digiclay.add_sample", "digiclay.open_scene"),
    ),
    "hidden": (hide, {ADDS, DATA, PINS, CHANGES, FORMS}, EVERY),
    "in another scene": (leave_scene, {ADDS, DATA}, SOME),
    "edited": (edit, set(), EVERY),
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files with a small bed that has all that operators look for, plain and baked, and what they read."""
    return tmp_path_factory.mktemp("beds")


@pytest.fixture
def folder(extension, files, monkeypatch):
    """The folder of the files, made by the first test that asks."""
    monkeypatch.chdir(files)
    if not (files / "bed.blend").exists():
        make_files(files)
    return files


def make_files(folder):
    bed = new_bed(rows=5, columns=5)
    (folder / "strokes.toml").write_text(
        '[[stroke]]\nbrush = "lock"\nmoves = [[0, 0, 0], [0.1, 0.002, 0]]\n'
    )
    np.save(folder / "ramp.npy", np.linspace(0.0, 1.0, 25).reshape(5, 5))
    (folder / "fitted.toml").write_text("[contact]\nstiffness = 330.0\n")
    scene = properties.scene_of(bed)
    short = replace(scene, simulation=replace(scene.simulation, duration=0.1))
    takes.add(bed, takes.simulate(short), "Press")
    bpy.ops.digiclay.take_export(filepath=str(folder / "tap.toml"))
    formed_bed.set_reference(bed)
    bpy.ops.digiclay.shape_sample(sample="wave")
    pick_pins(bed, [1, 2])
    bed.digiclay.own_preset = "Own"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "bed.blend"))
    bpy.ops.digiclay.bake(last=3)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "baked.blend"))


def file_of(name):
    """Return the file that an operator is called in."""
    return "baked.blend" if name in BAKED else "bed.blend"


def prepare(name, state):
    """Open the file that an operator is called in, and bring its bed into a state; return the bed."""
    bpy.ops.wm.open_mainfile(filepath=str(Path(file_of(name)).resolve()))
    for file in WRITTEN:
        Path(file).unlink(missing_ok=True)
    own_presets.path("Another").unlink(missing_ok=True)
    own_presets.save("Own", properties.read_scene(beds()[0]))
    bed = STATES[state][0](beds()[0])
    bpy.context.view_layer.update()
    cube = bpy.context.view_layer.objects.get("Cube")
    if cube is not None and bed.mode == "OBJECT":  # what a shape is made of
        cube.select_set(True)
    return bed


def call(bed, name):
    """Call an operator on a bed as the view would; return what it says against it, and the result."""
    area, _, own = name.partition(".")
    # A bed that the view layer does not have cannot be active: a script can still pass it.
    with in_the_view(), bpy.context.temp_override(object=bed, active_object=bed):
        try:
            return "", getattr(getattr(bpy.ops, area), own)(**CALLS[name][0])
        except RuntimeError as error:
            return str(error).partition(".poll() ")[2] or str(error), None


def start(bed):
    """Start a session of a bed, as the operator does in a window, and stop it."""
    try:
        tick.start(bpy.context, bed)
    except DigiclayError as error:
        return str(error), None
    assert tick.stop(bed.session_uid) == ""
    return "", {"FINISHED"}


def read_attributes(mesh):
    """Return the values of the numbers that a mesh has for its pins."""
    found = {}
    for name in {"position", FORMER, *bridge.ATTRIBUTES} & set(mesh.attributes.keys()):
        of = np.int32 if name == "mode" else np.float32
        values = np.empty(len(mesh.vertices) * (3 if name == "position" else 1), of)
        mesh.attributes[name].data.foreach_get("vector" if name == "position" else "value", values)
        found[name] = values.tobytes()
    return found


def observe():
    """Return all that an operator can change: objects, their properties and settings, pins, bakes, files."""
    found = {}
    for thing in bpy.data.objects:
        values = [one.to_dict() if hasattr(one, "to_dict") else one for one in thing.values()]
        groups = [repr(read_stored(thing, name)) for name in ("digiclay", "digiclay_display")]
        pins = read_attributes(thing.data) if is_bed(thing) and thing.mode == "OBJECT" else {}
        found[thing.name_full] = repr(values), groups, pins, thing.modifiers.keys(), thing.library
    folders = (Path(), own_presets.folder())
    kept = {
        file: file.read_bytes()
        for one in folders
        for file in one.glob("*")
        if ".blend" not in file.name
    }
    return {**found, "files": kept, "sessions": running.list_sessions()}


@pytest.mark.parametrize("state", STATES)
def test_an_operator_works_or_says_in_a_line_why_it_does_not(folder, state, capfd):
    wrong, opened = [], ""
    _, allowed, called = STATES[state]
    for name in called:
        _, *uses = EVERY[name]
        if opened != file_of(name):  # or something has changed since
            bed, opened = prepare(name, state), file_of(name)
            before = observe()
        said, result = start(bed) if name == SESSION else call(bed, name)
        changed = observe() != before
        if set(uses) <= allowed:
            right = result == {"FINISHED"} and changed
        else:
            one_line = 0 < len(said.strip()) <= 400 and "\n" not in said.strip()
            right = (
                result is None and one_line and "context is incorrect" not in said and not changed
            )
        if not right:
            wrong.append((name, result, changed, said))
        opened = "" if changed else opened
    assert wrong == []
    assert "Traceback" not in "".join(capfd.readouterr())


def test_the_table_has_every_operator():
    assert CALLS.keys() | ELSEWHERE == {*OPERATORS}
    assert not CALLS.keys() & ELSEWHERE


def apply_scale(*scale):
    def applied(bed):
        bed.scale = scale
        bpy.ops.object.transform_apply(location=False, rotation=False)

    return applied


def apply_turn(bed):
    bed.rotation_euler.z = 0.5
    bpy.ops.object.transform_apply()


def join(active):
    def joined(bed):
        select(bpy.data.objects["Cube"], bed)
        activate(active(bed))
        bpy.ops.object.join()

    return joined


def in_edit_mode(work):
    def worked(bed):
        for vertex in bed.data.vertices:
            vertex.select = vertex.index < 10
        bpy.ops.object.mode_set(mode="EDIT")
        work()
        bpy.ops.object.mode_set(mode="OBJECT")

    return worked


def make_single(bed):
    bpy.ops.object.duplicate(linked=True)
    select(bed)
    bpy.ops.object.make_single_user(object=True, obdata=True)


def convert(target):
    return lambda _: bpy.ops.object.convert(target=target)


def shuffle():
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.sort_elements(type="RANDOMIZE", elements={"VERT"}, seed=3)


def reverse_some():
    """Exchange the pins between the first and the last of a row."""
    bed = bpy.context.object
    bpy.ops.object.mode_set(mode="OBJECT")
    first, last = bed.data.vertices[11].co.copy(), bed.data.vertices[13].co.copy()
    bed.data.vertices[11].co, bed.data.vertices[13].co = last, first
    bpy.ops.object.mode_set(mode="EDIT")


def move_one():
    bpy.ops.object.mode_set(mode="OBJECT")
    for vertex in bpy.context.object.data.vertices:
        vertex.select = vertex.index == 12
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.transform.translate(value=(0.01, 0.0, 0.0))


LAYOUT = "The pins differ from the parameters of Layout: press Rebuild"
ROWS = "pins, in rows along x"
NOT_PINS = "mesh is no longer that of its pins: undo that"
COUNT = "pins now instead of 25: undo that"
#: What Blender's own verbs make of a bed, which are selected then, and what is said against a
#: session and a bake of each bed, and against its export as it is drawn; nothing: they are right.
VERBS = {
    "joined with a cube": (join(lambda bed: bed), NOT_PINS, NOT_PINS),
    "scale applied": (apply_scale(2.0, 2.0, 2.0), LAYOUT, ""),
    "stretch applied": (apply_scale(2.0, 1.0, 1.0), LAYOUT, ""),
    "mirror applied": (apply_scale(-1.0, 1.0, 1.0), LAYOUT, ""),
    "height applied": (apply_scale(1.0, 1.0, 2.0), "", ""),
    "turn applied": (apply_turn, LAYOUT, ROWS),
    "converted to a mesh": (convert("MESH"), NOT_PINS, NOT_PINS),
    "converted to a curve, which it cannot be": (convert("CURVE"), "", ""),
    "modifier applied": (lambda bed: bpy.ops.object.modifier_apply(modifier=bed.modifiers[0].name),
                         NOT_PINS, NOT_PINS),
    "pins separated": (in_edit_mode(lambda: bpy.ops.mesh.separate(type="SELECTED")), COUNT, COUNT),
    "pins duplicated": (in_edit_mode(bpy.ops.mesh.duplicate), COUNT, COUNT),
    "pins in another order": (in_edit_mode(shuffle), LAYOUT, "must fill rows of 2 pins"),
    "pins of a row in another order": (in_edit_mode(reverse_some), LAYOUT, "must order the pins row by row"),
    "a pin moved aside": (in_edit_mode(move_one), LAYOUT, ""),
    "duplicated, linked": (lambda _: bpy.ops.object.duplicate(linked=True), "", ""),
    "made a single user": (make_single, "", ""),
    "instances made real": (lambda _: bpy.ops.object.duplicates_make_real(), "", ""),
    "instances made real, with parents": (
        lambda _: bpy.ops.object.duplicates_make_real(use_base_parent=True, use_hierarchy=True), "", "",
    ),
    "given a shape key": (lambda _: bpy.ops.object.shape_key_add(), NOT_PINS, NOT_PINS),
    "joined into a cube": (join(lambda _: bpy.data.objects["Cube"]), "no bed", "no bed"),
}  # fmt: skip


@pytest.mark.parametrize("verb", VERBS)
def test_what_blenders_own_verbs_make_of_a_bed_is_formed_right_or_refused_with_its_cause(
    folder, verb
):
    work, of_session, of_export = VERBS[verb]
    bed = prepare(SESSION, "plain")
    drawn = read_attributes(bed.data)
    if of_session == "":
        assert [call_on(bed, name) for name in (SESSION, "digiclay.bake")] == ["", ""]
        formed = read_attributes(bed.data)
        bed = prepare(SESSION, "plain")
    select(bed)
    work(bed)
    done(verb)
    assert (beds() == []) == (of_session == "no bed")
    for each in beds():
        if of_session == "":
            drawn_now = read_attributes(each.data)
            assert drawn_now == drawn or verb == "height applied"
        said = {
            name: call_on(each, name)
            for name in (SESSION, "export_mesh.digital_clay", "digiclay.bake")
        }
        for name, message in said.items():
            wanted = of_export if name.startswith("export") else of_session
            assert bool(message) == bool(wanted), name
            assert wanted in message, name
            assert "\n" not in message.strip(), name
            assert len(message) <= 400, name
        if of_session == "":
            assert read_attributes(each.data) == formed


def call_on(bed, name):
    """Return what is said against a session or an operator of a bed that is selected alone."""
    select(bed)
    return (start(bed) if name == SESSION else call(bed, name))[0]
