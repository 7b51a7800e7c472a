"""File > Export > Digital Clay: the formed surface of a bed as a mesh file."""

from pathlib import Path
from typing import Any

from ..compat import bpy
from ..core.mesh_io.export_model import make_bodies
from ..core.mesh_io.mesh_writer import FORMATS, UNITS, find_suffix, write
from ..core.mesh_io.obj_reader import AXES, find_forward
from ..device.view import bed_of
from ..exchange import formed_bed
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
    file_format: bpy.props.EnumProperty(
        name="Format",
        description="Format of the file",
        items=[(name, name.upper().replace("_", " "), sentence(said)) for name, said in FORMATS.items()],
        default="stl",
    )
    unit: bpy.props.EnumProperty(
        name="Unit",
        description="Length unit of the file; a GLB is always in meters",
        items=[(name, name, f"Lengths in {name}") for name in UNITS],
        default="mm",
    )
    forward_axis: bpy.props.EnumProperty(
        name="Forward Axis", description="Forward axis of an OBJ", items=AXIS_ITEMS, default="NEGATIVE_Z"
    )
    up_axis: bpy.props.EnumProperty(
        name="Up Axis", description="Upward axis of an OBJ; slicers expect Z", items=AXIS_ITEMS, default="Y"
    )
    separate: bpy.props.BoolProperty(
        name="A File Each", description="Write each feature into a file of its own", default=False
    )

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
            self.file_format = _told_by(self.filepath) or self.file_format
        self.shown = self.file_format
        forward = next(key for key, name in AXIS_NAMES.items() if name == self._axes()[1])
        wanted = str(self._file())
        changed: bool = wanted != self.filepath or forward != self.forward_axis
        self.forward_axis = forward
        self.filepath = wanted
        return changed

    def draw(self, context: Any) -> None:
        """Draw the options beside the file browser."""
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
            self.file_format = _told_by(self.filepath) or self.file_format
        target = self._file()
        bed = chosen_bed(context)
        made = make_bodies(formed_bed.read_formed(bed), self.model(bed), self.finding())
        files = [(target, made)]
        if self.separate and self.kind == "features":
            ending = find_suffix(self.file_format)
            stem = target.name.removesuffix(ending)
            files = [(target.with_name(f"{stem}_{body.name}{ending}"), [body]) for body in made]
        for path, some in files:
            write(some, path, self.unit, self.file_format, *self._axes())
        told = localize("{} files beside {}", len(files), target) if len(files) > 1 else str(files[0][0])
        self.report({"INFO"}, localize("Written: {}", told))

    def _axes(self) -> tuple[str, str]:
        """Return the upward and the forward axis of an OBJ; the latter gives way where both are the same."""
        up, forward = AXIS_NAMES[self.up_axis], AXIS_NAMES[self.forward_axis]
        return up, find_forward(up) if up[-1] == forward[-1] else forward

    def _file(self) -> Path:
        """Return the file with the ending of its format, in place of that of another format."""
        path = Path(bpy.path.abspath(self.filepath or "digital_clay"))
        ending = find_suffix(self.file_format)
        if path.name.lower().endswith(ending) and not (ending == ".stl" and _is_text(path)):
            return path
        told = _told_by(path.name)
        other = find_suffix(told) if told else ""
        return path.with_name(path.name[: len(path.name) - len(other)] + ending)


def _told_by(name: str) -> str:
    """Return the format of a name's extension; empty without one."""
    by_length = sorted(FORMATS, key=lambda one: len(find_suffix(one)), reverse=True)
    return next((one for one in by_length if name.lower().endswith(find_suffix(one))), "")


def _is_text(path: Path) -> bool:
    """Return whether a name is that of an STL as text, which ends like that of a binary one."""
    return path.name.lower().endswith(find_suffix("stl_ascii"))


class ExportMenu(bpy.types.Menu):
    """Frequent exports, and a dialog for all others"""

    bl_idname = "DIGICLAY_MT_export"
    bl_label = "Digital Clay"

    def draw(self, context: Any) -> None:
        """Draw an entry for each."""
        self.layout.operator_context = "INVOKE_DEFAULT"
        for words, icon, told in ENTRIES:
            entry = self.layout.operator(ExportMesh.bl_idname, text=words, icon=icon)
            for name, value in {"skin": "bilinear", "separate": False, **told}.items():
                setattr(entry, name, value)
        self.layout.separator()
        self.layout.operator(ExportMesh.bl_idname, text="Other ...")


def entry(menu: Any, context: Any) -> None:
    """Draw the entry in File > Export. `menu` bpy.types.Menu; `context` bpy.types.Context."""
    menu.layout.menu(ExportMenu.bl_idname, icon="MESH_GRID")
