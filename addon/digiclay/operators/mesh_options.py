"""Operator properties of the formed surface: kind of mesh, features."""

from typing import Any

from ..compat import bpy
from ..core.base.errors import OutputError
from ..core.base.quantity import list_quantities
from ..core.mesh_io.export_model import KINDS, Model
from ..core.surface.features import Finding
from ..core.surface.skins import SKINS
from ..device.view import bed_of
from ..exchange import formed_bed
from .action import Action
from .poll_messages import no_surface

MODEL, FINDING = list_quantities(Model), list_quantities(Finding)


def sentence(text: str) -> str:
    """Return a text as a tooltip: with a capital letter."""
    return text[:1].upper() + text[1:]


class SurfaceAction(Action):
    """Mixin of an action on the surface of the active bed."""

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed with a surface is needed."""
        return no_surface(context)


class FindingOptions(SurfaceAction):
    """Criteria of a feature."""

    threshold: bpy.props.FloatProperty(
        name="Threshold (mm)",
        description=sentence(FINDING["threshold"].doc) + ", in mm",
        default=Finding().threshold * 1e3,
        min=0.001,
        max=100.0,
        precision=3,
        step=10,
    )
    smallest: bpy.props.IntProperty(
        name="Smallest (pins)",
        description=sentence(FINDING["smallest"].doc),
        default=Finding().smallest,
        min=1,
        max=1_000_000,
        soft_max=100,
    )

    def finding(self) -> Finding:
        """Return what counts as a feature."""
        return Finding(threshold=float(f"{self.threshold:.7g}") * 1e-3, smallest=self.smallest)


class SurfaceOptions(FindingOptions):
    """Kind of mesh and skin."""

    kind: bpy.props.EnumProperty(
        name="Mesh",
        description="Kind of mesh made of the formed surface",
        items=[(name, sentence(name), sentence(said)) for name, said in KINDS.items()],
        default=Model().kind,
    )
    skin: bpy.props.EnumProperty(
        name="Skin",
        description="Interpolation of the surface between the pins",
        items=[(name, sentence(name), sentence(said)) for name, said in SKINS.items()],
        default=Model().skin,
    )
    resolution: bpy.props.IntProperty(
        name="Points a Pitch",
        description=sentence(MODEL["resolution"].doc),
        default=0,
        min=0,
        max=64,
        soft_max=16,
    )
    base_thickness: bpy.props.FloatProperty(
        name="Base (mm)",
        description=sentence(MODEL["base_thickness"].doc) + ", in mm",
        default=Model().base_thickness * 1e3,
        min=0.01,
        max=1000.0,
        soft_max=50.0,
        precision=2,
        step=10,
    )

    def model(self, bed: Any) -> Model:
        """Return what is to be made of a bed."""
        return formed_bed.model(
            bed,
            kind=self.kind,
            skin=self.skin,
            resolution=self.resolution,
            base_thickness=float(f"{self.base_thickness:.7g}") * 1e-3,
        )

    def draw_surface(self, layout: Any) -> None:
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


def chosen_bed(context: Any) -> Any:
    """Return the bed to work on. Raises OutputError when it has gone since the operator was called."""
    bed = bed_of(context)
    if bed is None:
        raise OutputError("There is no bed any more: select one, or its fingertip.")
    return bed
