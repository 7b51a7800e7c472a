"""Formed surface as mesh objects, as a mesh file, and as a list of features."""

from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from .. import bridge
from ..compat import Context, Event, Menu, Object, Operator, UILayout, bpy
from ..core.base.errors import OutputError
from ..core.base.quantity import list_quantities
from ..core.mesh_io.export_model import KINDS, Model, find_features, make_bodies
from ..core.mesh_io.mesh_writer import FORMATS, UNITS, find_suffix, write
from ..core.mesh_io.obj_reader import AXES, find_forward
from ..core.surface.features import Finding, summarize
from ..core.surface.skins import SKINS
from ..exchange import formed_bed
from ..panels.base import menu
from ..panels.shape_exchange import LISTED
from ..roles import bed_of
from ..settings.declared import choice, flag, integer
from ..settings.shown_units import to_si
from ..ui_text import localize
from .action import Action, Needs, Result, action, inform, millimeters
from .add_bed import select_only
from .poll_messages import cannot_change, cannot_form, from_rest, no_collection, no_surface

MODEL, FINDING = list_quantities(Model), list_quantities(Finding)
#: Space between the bed and what is put beside it, in widths of the bed.
GAP = 0.35
#: Which place beside its bed a mesh has that was made here, 0: none; what is made next has another
#: one.
MADE = "digiclay_made"


def sentence(text: str) -> str:
    """Return a text as a tooltip: with a capital letter."""
    return text[:1].upper() + text[1:]


def list_items(words: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Return names and their meanings as items of a choice."""
    return [(name, sentence(name), sentence(meaning)) for name, meaning in words.items()]


class FindingOptions(Action):
    """Criteria of a feature."""

    needs: Needs = (no_surface,)

    threshold: millimeters(
        "Threshold",
        Finding().threshold,
        sentence(FINDING["threshold"].doc) + ", in mm",
        min=0.001,
        max=100.0,
        precision=3,
    )
    smallest: integer(
        "Smallest (pins)",
        sentence(FINDING["smallest"].doc),
        default=Finding().smallest,
        min=1,
        max=1_000_000,
        soft_max=100,
    )

    def finding(self) -> Finding:
        """Return what counts as a feature."""
        return Finding(threshold=to_si(self.threshold, 3), smallest=self.smallest)


class SurfaceOptions(FindingOptions):
    """Kind of mesh and skin."""

    kind: choice(
        "Mesh",
        "Kind of mesh made of the formed surface",
        items=list_items(KINDS),
        default=Model().kind,
    )
    skin: choice(
        "Skin",
        "Interpolation of the surface between the pins",
        items=list_items(SKINS),
        default=Model().skin,
    )
    resolution: integer(
        "Points per Pitch", sentence(MODEL["resolution"].doc), default=0, min=0, max=64, soft_max=16
    )
    base_thickness: millimeters(
        "Base",
        Model().base_thickness,
        sentence(MODEL["base_thickness"].doc) + ", in mm",
        min=0.01,
        max=1000.0,
        soft_max=50.0,
    )

    def model(self, bed: Object) -> Model:
        """Return what is to be made of a bed."""
        base = to_si(self.base_thickness, 3)
        return formed_bed.model(
            bed, kind=self.kind, skin=self.skin, resolution=self.resolution, base_thickness=base
        )

    def draw_surface(self, layout: UILayout) -> None:
        """Draw the properties; those without effect on what is made are grayed out."""
        layout.prop(self, "kind")
        column = layout.column()
        column.active = self.kind != "pins"
        column.prop(self, "skin")
        column.prop(self, "resolution")
        row = layout.row()
        row.active = self.kind in ("solid", "pins")
        row.prop(self, "base_thickness")
        column = layout.column(heading="Features")
        column.prop(self, "threshold")
        column.prop(self, "smallest")


def chosen_bed(context: Context) -> Object:
    """Return the bed to work on, or refuse where it has gone since the operator was called."""
    bed = bed_of(context)
    if bed is None:
        raise OutputError("There is no bed any more: select one, or its fingertip.")
    return bed


class MakeMesh(SurfaceOptions, Operator):
    """Make a mesh object of the formed surface of the active bed, with its features as vertex groups"""

    bl_idname = "mesh.digital_clay_make"
    bl_label = "Make Mesh"
    bl_options = {"REGISTER", "UNDO"}
    needs = no_surface, no_collection

    beside: flag(
        "Beside the Bed", "Place the mesh beside the bed instead of on its surface", default=True
    )

    def draw(self, context: Context) -> None:
        self.layout.use_property_split = True
        self.draw_surface(self.layout)
        self.layout.prop(self, "beside")

    def perform(self, context: Context) -> None:
        bed = chosen_bed(context)
        formed = formed_bed.read_formed(bed)
        bodies = make_bodies(formed, self.model(bed), self.finding())
        taken = {int(thing.get(MADE, 0)) for thing in context.scene.objects}
        place = next(number for number in count(1) if number not in taken) if self.beside else 0
        step = (1.0 + GAP) * float(np.ptp(formed.position[:, 0])) * bridge.SCALE
        where = bed.matrix_world.copy()
        where.translation = where @ type(where.translation)((place * step, 0.0, 0.0))
        things = []
        for body in bodies:
            name = f"{bed.name} {body.name if self.kind == 'features' else self.kind}"
            new = formed_bed.make_object(body, name, smooth=self.kind != "pins")
            new[MADE] = place
            context.collection.objects.link(new)
            new.matrix_world = where
            things.append(new)
        select_only(context, things[0])
        for new in things[1:]:
            new.select_set(True)
        groups = bodies[0].groups
        words = localize(" with vertex groups {}", ", ".join(groups)) if groups else ""
        inform(self, "Made {}{}", ", ".join(new.name for new in things), words)


@action("digiclay.find_features", "List Features", no_surface, bases=(FindingOptions,))
def list_features(operator: Operator, context: Context) -> None:
    """Find the bosses and creases of the active bed and list them in the panel"""
    bed = chosen_bed(context)
    features = find_features(formed_bed.read_formed(bed), formed_bed.model(bed), operator.finding())
    lines = [summarize(features)]
    for feature in features:
        extreme = f"{feature.extreme * 1e3:.1f} mm {'high' if feature.kind == 'boss' else 'deep'}"
        crest = f", crest {feature.crest_length * 1e3:.0f} mm" if feature.crests else ""
        area, volume = feature.area * 1e6, feature.volume * 1e9
        lines.append(f"{feature.name}: {extreme}{crest}, {feature.form}")
        lines.append(f"    {area:.0f} mm², {volume:.0f} mm³, {len(feature.pins)} pins")
    bed[LISTED] = "\n".join(lines)
    operator.report({"INFO"}, lines[0])


@action("digiclay.keep_surface", "Measure from Here", cannot_form, no_surface)
def keep_surface(operator: Operator, context: Context) -> None:
    """Measure features from the current surface"""
    formed_bed.set_reference(chosen_bed(context))


@action("digiclay.forget_surface", "Measure from Rest", cannot_change, from_rest)
def forget_surface(operator: Operator, context: Context) -> None:
    """Measure features from the bed at rest again"""
    formed_bed.clear_reference(chosen_bed(context))


#: Entries of the menu: words, icon, and the properties they stand for.
ENTRIES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("Solid for printing (.3mf)", "MESH_CUBE", {"kind": "solid", "file_format": "3mf"}),
    (
        "Solid, smooth (.stl)",
        "MESH_ICOSPHERE",
        {"kind": "solid", "skin": "smooth", "file_format": "stl"},
    ),
    ("Pins, stepped (.stl)", "SORTSIZE", {"kind": "pins", "file_format": "stl"}),
    (
        "Surface with its features as groups (.obj)",
        "SURFACE_DATA",
        {"kind": "surface", "file_format": "obj"},
    ),
    (
        "Surface with force and mode (.ply)",
        "POINTCLOUD_DATA",
        {"kind": "surface", "file_format": "ply"},
    ),
    (
        "Bosses and creases, one file each (.stl)",
        "MOD_BOOLEAN",
        {"kind": "features", "file_format": "stl", "separate": True},
    ),
    (
        "Solid for the web (.glb)",
        "WORLD",
        {"kind": "solid", "skin": "smooth", "file_format": "glb"},
    ),
)

#: Unit of a file.
UNIT = choice(
    "Unit",
    "Length unit of the file; a GLB is always in meters",
    items=[(name, name, f"Lengths in {name}") for name in UNITS],
    default="mm",
)
#: Axes under the names of Blender's own exporter.
AXIS_NAMES = {name.upper().replace("-", "NEGATIVE_"): name for name in AXES}
AXIS_ITEMS = [(key, name.upper(), "") for key, name in AXIS_NAMES.items()]


class ExportMesh(SurfaceOptions, Operator):
    """Write the formed surface of the active bed as a mesh file"""

    bl_idname = "export_mesh.digital_clay"
    bl_label = "Export Digital Clay"
    bl_options = {"PRESET"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_PRESET"})
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_PRESET"})
    filter_glob: bpy.props.StringProperty(
        default=";".join(f"*{find_suffix(kind)}" for kind in FORMATS),
        options={"HIDDEN", "SKIP_PRESET"},
    )
    file_format: choice(
        "Format",
        "Format of the file",
        items=[
            (name, name.upper().replace("_", " "), sentence(kind.meaning))
            for name, kind in FORMATS.items()
        ],
        default="stl",
    )
    unit: UNIT
    forward_axis: choice(
        "Forward Axis", "Forward axis of an OBJ", items=AXIS_ITEMS, default="NEGATIVE_Z"
    )
    up_axis: choice(
        "Up Axis", "Upward axis of an OBJ; slicers expect Z", items=AXIS_ITEMS, default="Y"
    )
    separate: flag(
        "One File per Feature", "Write each feature into a file of its own", default=False
    )

    def invoke(self, context: Context, event: Event) -> Result:
        """Open the file browser, with the name of the bed."""
        folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path.home()
        name = bpy.path.clean_name(bed_of(context).name)
        self.filepath = str(folder / f"{name}{find_suffix(self.file_format)}")
        self.shown = self.file_format
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, context: Context) -> bool:
        """Keep name and format equal: the last change sets the other."""
        if self.file_format == self.shown:
            self.file_format = _format_of(self.filepath) or self.file_format
        self.shown = self.file_format
        forward = next(key for key, name in AXIS_NAMES.items() if name == self._axes()[1])
        wanted = str(self._file())
        changed: bool = wanted != self.filepath or forward != self.forward_axis
        self.forward_axis = forward
        self.filepath = wanted
        return changed

    def draw(self, context: Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(self, "file_format")
        row = layout.row()
        row.active = self.file_format != "glb"
        row.prop(self, "unit", expand=True)
        if self.file_format == "obj":
            layout.prop(self, "forward_axis")
            layout.prop(self, "up_axis")
        self.draw_surface(layout)
        row = layout.row()
        row.active = self.kind == "features"
        row.prop(self, "separate")

    def perform(self, context: Context) -> None:
        """Write the file, or the files; without a format, the extension of the name determines it."""
        if not self.properties.is_property_set("file_format"):
            self.file_format = _format_of(self.filepath) or self.file_format
        target = self._file()
        bed = chosen_bed(context)
        every = make_bodies(formed_bed.read_formed(bed), self.model(bed), self.finding())
        files = [(target, every)]
        if self.separate and self.kind == "features":
            ending = find_suffix(self.file_format)
            stem = target.name.removesuffix(ending)
            files = [(target.with_name(f"{stem}_{body.name}{ending}"), [body]) for body in every]
        for path, bodies in files:
            write(bodies, path, self.unit, self.file_format, *self._axes())
        many = len(files) > 1
        names = localize("{} files beside {}", len(files), target) if many else str(files[0][0])
        inform(self, "Written: {}", names)

    def _axes(self) -> tuple[str, str]:
        """Return the upward and the forward axis of an OBJ; the latter gives way where both are the same."""
        up, forward = AXIS_NAMES[self.up_axis], AXIS_NAMES[self.forward_axis]
        return up, find_forward(up) if up[-1] == forward[-1] else forward

    def _file(self) -> Path:
        """Return the file with the ending of its format, in place of that of another format."""
        path = Path(bpy.path.abspath(self.filepath or "digital_clay"))
        current = _format_of(path.name)
        other = find_suffix(current) if current else ""
        if current == self.file_format:
            return path
        return path.with_name(
            path.name[: len(path.name) - len(other)] + find_suffix(self.file_format)
        )


def _format_of(name: str) -> str:
    """Return the format of a name's extension, the longest that fits; empty without one."""
    fitting = [kind for kind in FORMATS if name.lower().endswith(find_suffix(kind))]
    return max(fitting, key=lambda kind: len(find_suffix(kind)), default="")


@menu("DIGICLAY_MT_export", "Digital Clay")
def exports(entries: Menu, context: Context) -> None:
    """Frequent exports, and a dialog for all others"""
    entries.layout.operator_context = "INVOKE_DEFAULT"
    for words, icon, options in ENTRIES:
        export = entries.layout.operator(ExportMesh.bl_idname, text=words, icon=icon)
        for name, value in {"skin": "bilinear", "separate": False, **options}.items():
            setattr(export, name, value)
    entries.layout.separator()
    entries.layout.operator(ExportMesh.bl_idname, text="Other ...")
    entries.layout.operator(
        "export_anim.digital_clay", text="Animation ...", icon="RENDER_ANIMATION"
    )


def entry(parent: Menu, context: Context) -> None:
    """Draw the entry in File > Export."""
    parent.layout.menu(exports.bl_idname, icon="MESH_GRID")
