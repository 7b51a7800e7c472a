"""Beds that are added: at rest, by scene files, samples, recorded runs; Rebuild: a bed by its settings."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import bridge, preferences
from ..compat import Context, Event, Menu, NodeTree, Object, Operator, UILayout, bpy
from ..compat import Scene as Timeline
from ..core.control.methods import METHODS
from ..core.files.run_folder import list_files
from ..core.files.tables import Record
from ..core.model.layout import ARRANGEMENTS, Layout
from ..core.model.trajectory import sample_poses
from ..core.scene.assembly import assemble
from ..core.scene.scene_source import DISPLAY_SAMPLES, SAMPLES, find, load
from ..core.scene.schema import Scene
from ..core.scene.toml_table import resolve
from ..core.session.plate import list_cautions
from ..core.shapes.body import read_bodies
from ..core.shapes.fitting import list_shapes
from ..core.shapes.request import Shape
from ..core.studies.job_table import embed_heights
from ..device import palettes, repair, view
from ..device.instant import Instant, find_ellipsoids, make_rest, read
from ..device.node_tree import list_sources
from ..device.pressers import make_presser
from ..exchange import shape_show
from ..live import beds
from ..overlay.ready_view import find_view, frame, light
from ..panels.base import menu
from ..press.aim import find_free_place
from ..recorded import takes
from ..recorded.bake import read_rate
from ..roles import HOUSING, ROLE, bed_of, fingertips_of
from ..sessions import running
from ..settings import own_presets, properties
from ..settings.declared import choice, flag, integer, number, title
from ..settings.devices import BEDS, FIRST, UNNAMED, make_scene
from ..settings.groups import PRESET_ITEMS, method_items
from ..settings.shown_units import to_si
from ..ui_text import localize
from .action import Action, FileAction, Result, action, file_of, inform, millimeters
from .poll_messages import baked, cannot_change, edited, inside_edit, no_collection, session_runs

DEFAULT = Layout()
#: Sample scenes of the extension: those with bodies are opened by their files.
SESSIONS, DISPLAYS = (list(list_files(folder, ".toml")) for folder in (SAMPLES, DISPLAY_SAMPLES))
#: Beyond this a bed is a matter of scene files: the redo panel would stall on every change.
MOST = 400
#: Blender stores no reference to the texts of a list that is made on demand: this one does.
OFFERED: list[tuple[str, str, str]] = []


def offered(operator: Operator, context: Context) -> list[tuple[str, str, str]]:
    """Return the core's presets and the user's own."""
    own = [(name, name, "A preset of your own") for name in own_presets.names()]
    OFFERED[:] = PRESET_ITEMS + own
    return OFFERED


def plan(name: str) -> Record:
    """Return what a bed of `BEDS` sets in the operator: its plan, and what it is made with."""
    bed = BEDS[name]
    size = {"rows": bed.rows, "columns": bed.columns, "pitch": bed.pitch * 1e3}
    return {**size, "method": bed.method, "preset": bed.preset}


def take_bed(operator: Operator, context: Context) -> None:
    """Set the plan of the chosen bed."""
    for name, value in plan(operator.bed).items():
        setattr(operator, name, value)


#: Length of a millimeter of a bed of scale 1, Blender units.
MILLIMETER = 1e-3 * bridge.SCALE


def find_scale(context: Context) -> float:
    """Return the scale of a new bed: 1, or where a Blender unit is no meter that of its true size."""
    units = context.scene.unit_settings
    if units.system == "NONE" or units.scale_length == 1.0:
        return 1.0
    # A scene's unit has 32 bits.
    return float(f"{1.0 / (bridge.SCALE * units.scale_length):.6g}")


class Placed:
    """Mixin of an operator that adds a bed: at the 3D cursor, or where it is seen."""

    report: Callable[[Result, str], None]
    properties: Any
    execute: Callable[[Context], Result]

    location: bpy.props.FloatVectorProperty(
        name="Location",
        description="Middle of the underside of the housing; by default the 3D cursor, unless what is there "
        "hides the bed",
        subtype="TRANSLATION",
        options={"SKIP_SAVE", "SKIP_PRESET"},
    )
    scale: number(
        "Scale",
        "Scale of the bed's object; by default the bed has ten times its size, and in a scene of a unit "
        "scale other than 1 its true size",
        default=1.0,
        min=1e-5,
        soft_min=0.1,
        soft_max=1000.0,
        max=1e6,
        options={"SKIP_SAVE", "SKIP_PRESET"},
    )
    millimeter: number(
        "1 mm of the Device",
        "Length of a millimeter of the device in the scene, by the scale",
        subtype="DISTANCE",
        precision=5,
        options={"SKIP_SAVE", "SKIP_PRESET"},
        get=lambda operator: operator.scale * MILLIMETER,
    )

    def invoke(self, context: Context, event: Event) -> Result:
        """Add the bed, and show all of it."""
        done: Result = self.execute(context)
        if done == {"FINISHED"}:
            frame(context, bed_of(context))
            light(context)
        return done

    def place(self, context: Context, bed: Object) -> None:
        """Put the bed there, active; in a window it is not selected, since each pin would have an outline."""
        shown, words = find_view(context), ""
        if not self.properties.is_property_set("scale"):
            self.scale = find_scale(context)
        bed.scale = (self.scale,) * 3
        if not self.properties.is_property_set("location"):
            self.location = context.scene.cursor.location
            if shown is not None:
                with context.temp_override(window=context.window, area=shown[0], region=shown[1]):
                    self.location, words = find_free_place(bpy.context, bed)
        bed.location = self.location
        bed.location.z -= view.underside(bed) * bed.scale.z
        select_only(context, bed)
        bed.select_set(shown is None)
        if words:
            self.report({"INFO"}, words)
        for caution in list_cautions(properties.read_scene(bed)):
            self.report({"WARNING"}, caution)
        running.set_message(words, bed.session_uid)


class AddBed(Placed, Action, Operator):
    """Add a Digital Clay device: a bed of pins that a fingertip forms"""

    bl_idname = "mesh.digital_clay_add"
    bl_label = "Digital Clay"
    bl_options = {"REGISTER", "UNDO", "PRESET"}
    needs = inside_edit, no_collection

    bed: choice(
        "Bed",
        "Number and distance of the pins, and size of fingertip and blister",
        items=[(name, title(name), bed.use) for name, bed in BEDS.items()],
        default=UNNAMED,
        update=take_bed,
    )
    rows: integer("Rows", "Number of rows of pins", default=DEFAULT.rows, min=1, max=MOST)
    columns: integer("Columns", "Number of pins in a row", default=DEFAULT.columns, min=1, max=MOST)
    pitch: millimeters(
        "Pitch",
        DEFAULT.pitch,
        "Distance between neighboring pins in a row, in mm",
        min=0.5,
        soft_max=20.0,
        max=1000.0,
    )
    arrangement: choice(
        "Arrangement",
        "Offset of neighboring rows",
        items=[(name, title(name), kind.meaning) for name, kind in ARRANGEMENTS.items()],
        default=DEFAULT.arrangement,
    )
    method: choice(
        "Method", "Control method of the cells", items=method_items(), default=next(iter(METHODS))
    )
    preset: choice(
        "Preset", "Fluid, valves and all other parameters of a custom preset", items=offered
    )

    def invoke(self, context: Context, event: Event) -> Result:
        """Add the bed to design on unless another is chosen."""
        if not self.properties.is_property_set("bed"):
            is_set = self.properties.is_property_set
            given = {name: getattr(self, name) for name in plan(FIRST) if is_set(name)}
            self.bed = FIRST
            for name, value in given.items():
                setattr(self, name, value)
        return super().invoke(context, event)

    def perform(self, context: Context) -> None:
        for name, value in plan(self.bed).items():
            if not self.properties.is_property_set(name):  # called by a script
                setattr(self, name, value)
        layout = Layout(
            rows=self.rows,
            columns=self.columns,
            pitch=to_si(self.pitch, 3),
            arrangement=self.arrangement,
        )
        bed = add(context, make_scene(self.preset, layout, self.method, BEDS[self.bed].share))
        self.place(context, bed)


@action(
    "digiclay.rebuild",
    "Rebuild",
    cannot_change,
    session_runs.reworded("Stop the session first: its pins cannot be exchanged"),
    baked.reworded("Free the bake in the Takes panel first: it moves the present pins"),
    edited.reworded("Leave Edit Mode first"),
)
def rebuild_bed(operator: Operator, context: Context) -> None:
    """Make pins and housing from the settings; the formed surface is lost, the fingertip stays"""
    layout = rebuild(bed_of(context)).layout
    inform(operator, "The bed has {} x {} pins now", layout.rows, layout.columns)


def add(context: Context, scene: Scene) -> Object:
    """Add the device of a scene, at rest, in the context's collection; return its bed."""
    return add_shown(context, scene, make_rest(scene))


def add_shown(context: Context, scene: Scene, instant: Instant) -> Object:
    """Add the device of a scene as it is at an instant, in the context's collection; return its bed."""
    colored = palettes.has_palette()
    bed = view.build(instant, context.collection, lowest=0.0)
    if not colored:
        palettes.set_palette(preferences.get(context).palette)
    properties.write_scene(bed, scene)
    return bed


def select_only(context: Context, bed: Object) -> None:
    """Leave a new object selected and active, as Blender's own Add operators do."""
    for other in context.selected_objects:
        other.select_set(False)
    bed.select_set(True)
    context.view_layer.objects.active = bed


def rebuild(bed: Object) -> Scene:
    """Make a bed anew, at rest, by its settings; its place, fingertip and children stay."""
    scene = properties.read_scene(bed)
    instant = make_rest(scene)
    mesh, drawing = bed.data, view.find_modifier(bed)
    bed.data = view.make_cells(instant)
    # The modifier stays, and with it the bed's colors; only its node tree is another.
    tree = drawing and drawing.node_group
    view.add_modifier(bed, instant)
    if tree is not None:
        _discard(tree)
    repair.give_fingertip(bed, scene)
    for tip, finger in zip(fingertips_of(bed).values(), instant.finger, strict=False):
        bridge.resize_fingertip(tip, finger)
    view.hold_parts(bed)
    _remove(child for child in bed.children if child.get(ROLE) == HOUSING)
    if not mesh.users:
        bpy.data.meshes.remove(mesh)
    beds.clear(bed)  # the state of a session is of no use to other pins
    return scene


def _discard(tree: NodeTree) -> None:
    """Remove the nodes that drew pins, with the pins; a copy of the bed may still be drawn by them."""
    if tree.users:
        return
    collections, objects = list_sources(tree)
    bpy.data.batch_remove([tree, *collections])
    _remove(objects)


def _remove(objects: Iterable[Object]) -> None:
    """Remove objects, and the meshes only they have."""
    objects = list(objects)
    meshes = {thing.data for thing in objects if thing.type == "MESH"}
    bpy.data.batch_remove(objects)
    bpy.data.batch_remove([mesh for mesh in meshes if not mesh.users])


def entry(menu: Menu, context: Context) -> None:
    """Draw the entry in Add > Mesh."""
    menu.layout.operator(AddBed.bl_idname, icon="MESH_GRID")


@action(
    "import_scene.digital_clay_run",
    "Import Digital Clay Run",
    no_collection,
    bases=(FileAction, Placed),
    options=("REGISTER", "UNDO", "PRESET"),
    **file_of("*.npz", "SKIP_PRESET"),
    row=integer("Row", "Recorded row to show: 0 is the first, -1 the last", default=-1),
)
def import_run(operator: Operator, context: Context) -> None:
    """Show one instant of a Digital Clay run as a bed of pins"""
    path = Path(bpy.path.abspath(operator.filepath))
    instant, scene = read(path, operator.row), load(path.with_name("scene.toml"))
    operator.place(context, add_shown(context, scene, instant))


class AddSceneAction(Placed, Action):
    """Mixin of operators that add the bed of a scene, as Add > Mesh > Digital Clay does."""

    bl_options = {"REGISTER", "UNDO"}
    needs = inside_edit, no_collection

    take: flag(
        "Simulate as a Take",
        "Simulate the session of the scene and keep it as a take, for replay or bake",
        default=True,
    )

    def add_scene(self, context: Context, scene: Scene) -> None:
        """Add the bed of a scene, its fingertips where their paths begin."""
        if scene.bodies:  # what they cannot be or do is refused before anything is made
            assemble(scene)
            read_rate(context.scene)
        scene = embed_heights(scene)
        taken = takes.simulate(scene) if self.take else None
        bed = add(context, scene)
        bed.name = scene.name
        start = sample_poses(scene.trajectories(), takes.START)[0]
        bridge.place_fingertips(bed, start, find_ellipsoids(scene))
        if scene.bodies:
            add_bodies(context.scene, bed, scene)
        words = f"{scene.name}: {scene.description.strip()}" if scene.description else scene.name
        if taken is not None:
            takes.add(bed, taken, scene.name)
            words += localize(" Its session is the take {!r}.", scene.name)
        elif self.take:
            words += localize(" Its session is too long to be simulated here: use 'digiclay run'.")
        self.report({"INFO"}, words)
        self.place(context, bed)


def add_bodies(timeline: Timeline, bed: Object, scene: Scene) -> None:
    """Add the bodies of a scene over its bed, their paths keyed from the first frame on, which is shown."""
    first, rate = timeline.frame_start, read_rate(timeline)
    meshes = read_bodies(replace(each.body, scale=1.0) for each in scene.bodies)
    for row, (each, mesh) in enumerate(zip(scene.bodies, meshes, strict=True), 1):
        name = " ".join(("Body", str(row), title(Path(each.body.file).stem))).rstrip()
        make_presser(bed, name, each, mesh, first, rate)
    timeline.frame_end = max(timeline.frame_end, first + math.ceil(scene.lasting * rate))
    timeline.frame_set(first)
    if not any(scene.list_parts("fingertip")):
        for tip in fingertips_of(bed).values():
            tip.hide_viewport = tip.hide_render = True
        repair.follow_visibility()


class OpenScene(AddSceneAction, FileAction, Operator):
    """Add the bed of a Digital Clay scene file"""

    bl_idname = "digiclay.open_scene"
    bl_label = "Open Digital Clay Scene"

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    def invoke(self, context: Context, event: Event) -> Result:
        """Open the file browser, unless a file was dropped."""
        return (Placed if self.filepath else FileAction).invoke(self, context, event)

    def perform(self, context: Context) -> None:
        self.add_scene(context, load(Path(bpy.path.abspath(self.filepath))))


@action(
    "digiclay.add_sample",
    "Digital Clay Sample",
    inside_edit,
    no_collection,
    bases=(AddSceneAction,),
    sample=choice(
        "Sample",
        items=[
            *((f"session:{name}", title(name), "A session") for name in SESSIONS),
            *((f"display:{name}", title(name), "A display") for name in DISPLAYS),
            *(
                (f"shape:{name}", title(name), "A shape on a bed of 25 × 25 pins")
                for name in list_shapes()
            ),
        ],
    ),
)
def add_sample(operator: Operator, context: Context) -> None:
    """Add a bed with a sample session, display or shape of Digital Clay"""
    kind, _, name = operator.sample.partition(":")
    if kind != "shape":
        operator.add_scene(context, load(find(name)))
        return
    bed = add(context, resolve({}, name))
    bed.name = title(name)
    context.view_layer.update()
    laid, _ = shape_show.show_file(bed, replace(Shape(), file=name))
    operator.report({"INFO"}, laid.describe())
    operator.place(context, bed)


def _list_samples(layout: UILayout, kind: str, names: Iterable[str]) -> None:
    """Draw an entry for each sample of a kind."""
    for name in names:
        layout.operator(add_sample.bl_idname, text=title(name)).sample = f"{kind}:{name}"


@menu("DIGICLAY_MT_session_samples", "Sessions")
def session_samples(entries: Menu, context: Context) -> None:
    """Sample sessions of Digital Clay"""
    _list_samples(entries.layout, "session", SESSIONS)


@menu("DIGICLAY_MT_display_samples", "Displays")
def display_samples(entries: Menu, context: Context) -> None:
    """Pin displays, built or planned; those with pins 7 mm apart show shapes, but cannot be sculpted"""
    _list_samples(entries.layout, "display", DISPLAYS)


@menu("DIGICLAY_MT_shape_samples", "Shapes")
def shape_samples(entries: Menu, context: Context) -> None:
    """Sample shapes of Digital Clay, displayed on a bed"""
    _list_samples(entries.layout, "shape", list_shapes())


@menu("DIGICLAY_MT_samples", "Digital Clay Samples")
def samples(entries: Menu, context: Context) -> None:
    """Sample sessions, displays and shapes of Digital Clay"""
    entries.layout.menu(session_samples.bl_idname, icon="CON_TRACKTO")
    entries.layout.menu(display_samples.bl_idname, icon="MESH_GRID")
    entries.layout.menu(shape_samples.bl_idname, icon="RNDCURVE")
    entries.layout.separator()
    entries.layout.operator_context = "INVOKE_DEFAULT"
    entries.layout.operator(OpenScene.bl_idname, text="Scene File...", icon="FILE_FOLDER")


class SceneFiles(bpy.types.FileHandler):
    """Drop of a scene file into the 3D view."""

    bl_idname = "DIGICLAY_FH_scene"
    bl_label = "Digital Clay Scene"
    bl_import_operator = OpenScene.bl_idname
    bl_file_extensions = ".toml"

    @classmethod
    def poll_drop(cls, context: Context) -> bool:
        """Only a 3D view can take a bed."""
        return context.area is not None and context.area.type == "VIEW_3D"


def samples_entry(parent: Menu, context: Context) -> None:
    """Draw the submenu in Add > Mesh."""
    parent.layout.menu(samples.bl_idname, icon="MESH_GRID")


def import_entry(parent: Menu, context: Context) -> None:
    """Draw the entries in File > Import."""
    parent.layout.operator(import_run.bl_idname, text="Digital Clay run (.npz)")
    parent.layout.operator(OpenScene.bl_idname, text="Digital Clay scene (.toml)")
