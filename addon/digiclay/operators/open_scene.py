"""Scene files, samples and recorded runs as beds: menus, file dialogs, drop into the 3D view."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from .. import bridge
from ..compat import bpy
from ..core.model.trajectory import sample_poses
from ..core.scene.scene_source import find, list_samples, load
from ..core.scene.schema import Scene
from ..core.scene.toml_table import resolve
from ..core.shapes.request import Shape
from ..core.shapes.source_file import list_shapes
from ..core.studies.job_table import embed_heights
from ..device.instant import find_ellipsoid, pick_pose, read
from ..exchange import shape_show
from ..panels.base import menu
from ..recorded import takes
from ..roles import fingertip_of
from ..settings.declared import choice, flag, integer, title
from ..ui_text import localize
from .action import Action, FileAction
from .add_bed import Placed, add, add_shown
from .poll_messages import inside_edit


class ImportRun(Placed, FileAction, bpy.types.Operator):
    """Show one instant of a Digital Clay run as a bed of pins"""

    bl_idname = "import_scene.digital_clay_run"
    bl_label = "Import Digital Clay Run"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_PRESET"})
    filter_glob: bpy.props.StringProperty(default="*.npz", options={"HIDDEN"})
    row: integer("Row", "Recorded row to show: 0 is the first, -1 the last", default=-1)

    def perform(self, context: Any) -> None:
        """Read the run and build the bed at the 3D cursor."""
        path = Path(bpy.path.abspath(self.filepath))
        instant, scene = read(path, self.row), load(path.with_name("scene.toml"))
        self.place(context, add_shown(context, scene, instant))


class AddSceneAction(Placed, Action):
    """Mixin of operators that add the bed of a scene, as Add > Mesh > Digital Clay does."""

    bl_options = {"REGISTER", "UNDO"}
    needs = (inside_edit,)

    take: flag(
        "Simulate as a Take", "Simulate the session of the scene and keep it as a take, for replay or bake",
        default=True,
    )  # fmt: skip

    def add_scene(self, context: Any, scene: Scene) -> None:
        """Add the bed of a scene, its fingertip where its path begins."""
        scene = embed_heights(scene)
        taken = takes.simulate(scene) if self.take else None
        bed = add(context, scene)
        bed.name = scene.name
        start = pick_pose(sample_poses(scene.trajectories(), takes.START)[0])
        bridge.place_fingertip(fingertip_of(bed), start, find_ellipsoid(scene))
        words = f"{scene.name}: {scene.description.strip()}" if scene.description else scene.name
        if taken is not None:
            takes.add(bed, taken, scene.name)
            words += localize(" Its session is the take {!r}.", scene.name)
        elif self.take:
            words += localize(" Its session is too long to be simulated here: use 'digiclay run'.")
        self.report({"INFO"}, words)
        self.place(context, bed)


class OpenScene(AddSceneAction, FileAction, bpy.types.Operator):
    """Add the bed of a Digital Clay scene file"""

    bl_idname = "digiclay.open_scene"
    bl_label = "Open Digital Clay Scene"

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    def invoke(self, context: Any, event: Any) -> set[str]:
        """Open the file browser, unless a file was dropped."""
        return self.execute(context) if self.filepath else super().invoke(context, event)

    def perform(self, context: Any) -> None:
        self.add_scene(context, load(Path(bpy.path.abspath(self.filepath))))


class AddSample(AddSceneAction, bpy.types.Operator):
    """Add a bed with a sample session or shape of Digital Clay"""

    bl_idname = "digiclay.add_sample"
    bl_label = "Digital Clay Sample"

    sample: choice(
        "Sample", items=[
            *((f"session:{name}", title(name), "A session") for name in list_samples()),
            *((f"shape:{name}", title(name), "A shape on a bed of 25 × 25 pins") for name in list_shapes()),
        ],
    )  # fmt: skip

    def perform(self, context: Any) -> None:
        kind, _, name = self.sample.partition(":")
        if kind == "session":
            self.add_scene(context, load(find(name)))
            return
        bed = add(context, resolve({}, name))
        bed.name = title(name)
        context.view_layer.update()
        laid, _ = shape_show.show_file(bed, replace(Shape(), file=name))
        self.report({"INFO"}, laid.describe())
        self.place(context, bed)


def _list_samples(layout: Any, kind: str, names: Iterable[str]) -> None:
    """Draw an entry for each sample of a kind."""
    for name in names:
        layout.operator(AddSample.bl_idname, text=title(name)).sample = f"{kind}:{name}"


@menu("DIGICLAY_MT_session_samples", "Sessions")
def session_samples(entries: Any, context: Any) -> None:
    """Sample sessions of Digital Clay"""
    _list_samples(entries.layout, "session", list_samples())


@menu("DIGICLAY_MT_shape_samples", "Shapes")
def shape_samples(entries: Any, context: Any) -> None:
    """Sample shapes of Digital Clay, displayed on a bed"""
    _list_samples(entries.layout, "shape", list_shapes())


@menu("DIGICLAY_MT_samples", "Digital Clay Samples")
def samples(entries: Any, context: Any) -> None:
    """Sample sessions and shapes of Digital Clay"""
    entries.layout.menu(session_samples.bl_idname, icon="CON_TRACKTO")
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
    def poll_drop(cls, context: Any) -> bool:
        """Only a 3D view can take a bed."""
        return context.area is not None and context.area.type == "VIEW_3D"


def samples_entry(parent: Any, context: Any) -> None:
    """Draw the submenu in Add > Mesh."""
    parent.layout.menu(samples.bl_idname, icon="MESH_GRID")


def import_entry(parent: Any, context: Any) -> None:
    """Draw the entries in File > Import."""
    parent.layout.operator(ImportRun.bl_idname, text="Digital Clay run (.npz)")
    parent.layout.operator(OpenScene.bl_idname, text="Digital Clay scene (.toml)")
