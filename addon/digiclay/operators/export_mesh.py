"""File > Export > Digital Clay: the formed surface of a bed as a mesh file."""

from pathlib import Path
from typing import Any

from ..compat import bpy
from ..core.mesh_io.export_model import make_bodies
from ..core.mesh_io.mesh_writer import FORMATS, UNITS, find_suffix, write
from ..core.mesh_io.obj_reader import AXES, find_forward
from ..exchange import formed_bed
from ..panels.base import menu
from ..roles import bed_of
from ..settings.declared import choice, flag
from ..ui_text import localize
from .make_mesh import SurfaceOptions, chosen_bed, sentence

#: Entries of the menu: words, icon, and the properties they stand for.
ENTRIES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("Solid for printing (.3mf)", "MESH_CUBE", {"kind": "solid", "file_format": "3mf"}),
    ("Solid, smooth (.stl)", "MESH_ICOSPHERE", {"kind": "solid", "skin": "smooth", "file_format": "stl"}),
    ("Pins, stepped (.stl)", "SORTSIZE", {"kind": "pins", "file_format": "stl"}),
    ("Surface with its features as groups (.obj)", "SURFACE_DATA", {"kind": "surface", "file_format": "obj"}),
    ("Surface with force and mode (.ply)", "POINTCLOUD_DATA", {"kind": "surface", "file_format": "ply"}),
    ("Bosses and creases, a file each (.stl)", "MOD_BOOLEAN",
     {"kind": "features", "file_format": "stl", "separate": True}),
    ("Solid for the web (.glb)", "WORLD", {"kind": "solid", "skin": "smooth", "file_format": "glb"}),
)  # fmt: skip

#: Axes under the names of Blender's own exporter.
AXIS_NAMES = {name.upper().replace("-", "NEGATIVE_"): name for name in AXES}
AXIS_ITEMS = [(key, name.upper(), "") for key, name in AXIS_NAMES.items()]


class ExportMesh(SurfaceOptions, bpy.types.Operator):
    """Write the formed surface of the active bed as a mesh file"""

    bl_idname = "export_mesh.digital_clay"
    bl_label = "Export Digital Clay"
    bl_options = {"PRESET"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_PRESET"})
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN", "SKIP_PRESET"})
    filter_glob: bpy.props.StringProperty(
        default="*.stl;*.obj;*.ply;*.glb;*.3mf", options={"HIDDEN", "SKIP_PRESET"}
    )
    file_format: choice(
        "Format", "Format of the file",
        items=[(name, name.upper().replace("_", " "), sentence(words)) for name, words in FORMATS.items()],
        default="stl",
    )  # fmt: skip
    unit: choice(
        "Unit", "Length unit of the file; a GLB is always in meters",
        items=[(name, name, f"Lengths in {name}") for name in UNITS], default="mm",
    )  # fmt: skip
    forward_axis: choice("Forward Axis", "Forward axis of an OBJ", items=AXIS_ITEMS, default="NEGATIVE_Z")
    up_axis: choice("Up Axis", "Upward axis of an OBJ; slicers expect Z", items=AXIS_ITEMS, default="Y")
    separate: flag("A File Each", "Write each feature into a file of its own", default=False)

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the file browser, with the name of the bed."""
        folder = Path(bpy.data.filepath).parent if bpy.data.filepath else Path.home()
        name = bpy.path.clean_name(bed_of(context).name)
        self.filepath = str(folder / f"{name}{find_suffix(self.file_format)}")
        self.shown = self.file_format
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, context: Any) -> bool:
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

    def draw(self, context: Any) -> None:
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

    def perform(self, context: Any) -> None:
        """Write the file, or the files; without a format, the extension of the name determines it."""
        if not self.properties.is_property_set("file_format"):
            self.file_format = _format_of(self.filepath) or self.file_format
        target = self._file()
        bed = chosen_bed(context)
        made = make_bodies(formed_bed.read_formed(bed), self.model(bed), self.finding())
        files = [(target, made)]
        if self.separate and self.kind == "features":
            ending = find_suffix(self.file_format)
            stem = target.name.removesuffix(ending)
            files = [(target.with_name(f"{stem}_{body.name}{ending}"), [body]) for body in made]
        for path, bodies in files:
            write(bodies, path, self.unit, self.file_format, *self._axes())
        many = len(files) > 1
        names = localize("{} files beside {}", len(files), target) if many else str(files[0][0])
        self.report({"INFO"}, localize("Written: {}", names))

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
        return path.with_name(path.name[: len(path.name) - len(other)] + find_suffix(self.file_format))


def _format_of(name: str) -> str:
    """Return the format of a name's extension, the longest that fits; empty without one."""
    fitting = [kind for kind in FORMATS if name.lower().endswith(find_suffix(kind))]
    return max(fitting, key=lambda kind: len(find_suffix(kind)), default="")


@menu("DIGICLAY_MT_export", "Digital Clay")
def exports(entries: Any, context: Any) -> None:
    """Frequent exports, and a dialog for all others"""
    entries.layout.operator_context = "INVOKE_DEFAULT"
    for words, icon, options in ENTRIES:
        export = entries.layout.operator(ExportMesh.bl_idname, text=words, icon=icon)
        for name, value in {"skin": "bilinear", "separate": False, **options}.items():
            setattr(export, name, value)
    entries.layout.separator()
    entries.layout.operator(ExportMesh.bl_idname, text="Other ...")


def entry(parent: Any, context: Any) -> None:
    """Draw the entry in File > Export."""
    parent.layout.menu(exports.bl_idname, icon="MESH_GRID")
