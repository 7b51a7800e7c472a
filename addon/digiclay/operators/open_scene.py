"""Scene files and samples as beds: from the Add menu, the file dialog, or dropped into the 3D view."""

# No postponed annotations here: Blender reads an operator's properties from them.
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.errors import DigiclayError
from ..core.fingertip import Fingertip
from ..core.scene import Scene
from ..core.scene_file import find, load, sample_names
from ..core.scene_table import resolve
from ..core.shape import Shape
from ..core.shape_file import sample_shapes
from ..device import view
from ..exchange import shape_show
from ..recorded import sample_take, takes
from ..settings.declared import title
from .add_bed import add, select_only, stand_at_cursor
from .reasons import allowed, edited

__all__ = ["MENUS", "AddSample", "OpenScene", "Samples", "SceneFiles", "SessionSamples", "ShapeSamples"]


class Opened:
    """What the operators share: a bed is added as Add > Mesh > Digital Clay does."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012

    take: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Simulate as a Take",
        description="Simulate the scene's session and keep it as a take, to be replayed or baked",
        default=True,
    )

    @classmethod
    def poll(cls, context: Any) -> bool:
        """A bed is an object: it cannot be added inside another object's edit mode."""
        return allowed(cls, edited(context, "Leave Edit Mode first: the device is an object of its own"))

    def opened(self, context: Any, scene: Scene) -> Any:
        """Add the bed of a scene, its finger where its path begins; return it."""
        scene = shape_show.embedded(scene)
        taken = sample_take.of(scene) if self.take else None
        bed = add(context, scene)
        bed.name = scene.name
        start = scene.trajectory.trajectory().poses(sample_take.START)[0]
        bridge.place_fingertip(view.fingertip_of(bed), start, scene.fingertip or Fingertip())
        stand_at_cursor(context, bed)
        select_only(context, bed)
        context.view_layer.update()
        words = f"{scene.name}: {scene.description.strip()}" if scene.description else scene.name
        if taken is not None:
            takes.keep(bed, taken, scene.name)
            words += f" Its session is the take {scene.name!r}."
        elif self.take:
            words += " Its session is too long to be simulated here: use 'digiclay run'."
        self.report({"INFO"}, words)
        return bed


class OpenScene(Opened, bpy.types.Operator):  # type: ignore[misc]
    """Add the bed a Digital Clay scene file describes"""

    bl_idname = "digiclay.open_scene"
    bl_label = "Open Digital Clay Scene"

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})  # type: ignore[valid-type]
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})  # type: ignore[valid-type]

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Ask for the file, unless one was dropped."""
        if self.filepath:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Any) -> set[str]:
        """Read the scene and build its bed at the 3D cursor."""
        try:
            self.opened(context, load(Path(bpy.path.abspath(self.filepath))))
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class AddSample(Opened, bpy.types.Operator):  # type: ignore[misc]
    """Add a bed with one of the sessions or shapes that come with Digital Clay"""

    bl_idname = "digiclay.add_sample"
    bl_label = "Digital Clay Sample"

    sample: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Sample",
        items=[
            *((f"session:{name}", title(name), "A session") for name in sample_names()),
            *((f"shape:{name}", title(name), "A shape on a bed of 25 × 25 pins") for name in sample_shapes()),
        ],
    )

    def execute(self, context: Any) -> set[str]:
        """Build the bed at the 3D cursor."""
        kind, _, name = self.sample.partition(":")
        try:
            if kind == "session":
                self.opened(context, load(find(name)))
            else:
                self._shaped(context, name)
        except DigiclayError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def _shaped(self, context: Any, name: str) -> None:
        """Add a bed that displays a shape."""
        bed = add(context, resolve({}, name))
        bed.name = title(name)
        stand_at_cursor(context, bed)
        select_only(context, bed)
        context.view_layer.update()
        laid, _ = shape_show.show_file(bed, replace(Shape(), file=name))
        self.report({"INFO"}, laid.told())


class Entries:
    """A menu of samples."""

    kind = ""

    def draw(self, context: Any) -> None:
        """Draw an entry for each."""
        for name in sample_names() if self.kind == "session" else sample_shapes():
            entry = self.layout.operator(AddSample.bl_idname, text=title(name))
            entry.sample = f"{self.kind}:{name}"


class SessionSamples(Entries, bpy.types.Menu):  # type: ignore[misc]
    """Sessions that come with Digital Clay"""

    bl_idname = "DIGICLAY_MT_session_samples"
    bl_label = "Sessions"
    kind = "session"


class ShapeSamples(Entries, bpy.types.Menu):  # type: ignore[misc]
    """Shapes that come with Digital Clay, displayed on a bed"""

    bl_idname = "DIGICLAY_MT_shape_samples"
    bl_label = "Shapes"
    kind = "shape"


class Samples(bpy.types.Menu):  # type: ignore[misc]
    """Sessions and shapes that come with Digital Clay"""

    bl_idname = "DIGICLAY_MT_samples"
    bl_label = "Digital Clay Samples"

    def draw(self, context: Any) -> None:
        """Draw the two kinds, and the file dialog."""
        self.layout.menu(SessionSamples.bl_idname, icon="CON_TRACKTO")
        self.layout.menu(ShapeSamples.bl_idname, icon="RNDCURVE")
        self.layout.separator()
        self.layout.operator_context = "INVOKE_DEFAULT"
        self.layout.operator(OpenScene.bl_idname, text="Scene File...", icon="FILE_FOLDER")


class SceneFiles(bpy.types.FileHandler):  # type: ignore[misc]
    """Lets a scene file be dropped into the 3D view."""

    bl_idname = "DIGICLAY_FH_scene"
    bl_label = "Digital Clay Scene"
    bl_import_operator = OpenScene.bl_idname
    bl_file_extensions = ".toml"

    @classmethod
    def poll_drop(cls, context: Any) -> bool:
        """Only a 3D view can take a bed."""
        return context.area is not None and context.area.type == "VIEW_3D"


def added(menu: Any, context: Any) -> None:
    """Draw the submenu in Add > Mesh."""
    menu.layout.menu(Samples.bl_idname, icon="MESH_GRID")


def imported(menu: Any, context: Any) -> None:
    """Draw the entry in File > Import."""
    menu.layout.operator(OpenScene.bl_idname, text="Digital Clay scene (.toml)")


#: Entries in Blender's own menus.
MENUS = (("VIEW3D_MT_mesh_add", added), ("TOPBAR_MT_file_import", imported))
