"""List of a bed's features, and selection of the former surface."""

from typing import Any

from ..compat import bpy
from ..core.mesh_io.export_model import find_features
from ..core.surface.features import summarize
from ..exchange import formed_bed
from ..panels.shape_exchange import LISTED
from .mesh_options import FindingOptions, SurfaceAction, chosen_bed
from .poll_messages import no_surface


class FindFeatures(FindingOptions, bpy.types.Operator):
    """Find the bosses and creases of the active bed and list them in the panel"""

    bl_idname = "digiclay.find_features"
    bl_label = "List Features"
    bl_options = {"REGISTER", "UNDO"}

    def perform(self, context: Any) -> None:
        """Find them."""
        bed = chosen_bed(context)
        found = find_features(formed_bed.read_formed(bed), formed_bed.model(bed), self.finding())
        lines = [summarize(found)]
        for one in found:
            extreme = f"{one.extreme * 1e3:.1f} mm {'high' if one.kind == 'boss' else 'deep'}"
            crest = f", crest {one.crest_length * 1e3:.0f} mm" if one.crests else ""
            lines.append(f"{one.name}: {extreme}{crest}, {one.form}")
            lines.append(f"    {one.area * 1e6:.0f} mm², {one.volume * 1e9:.0f} mm³, {len(one.pins)} pins")
        bed[LISTED] = "\n".join(lines)
        self.report({"INFO"}, lines[0])


class KeepSurface(SurfaceAction, bpy.types.Operator):
    """Measure features from the current surface"""

    bl_idname = "digiclay.keep_surface"
    bl_label = "Measure from Here"
    bl_options = {"REGISTER", "UNDO"}

    def perform(self, context: Any) -> None:
        """Keep the surface."""
        formed_bed.set_reference(chosen_bed(context))


class ForgetSurface(SurfaceAction, bpy.types.Operator):
    """Measure features from the bed at rest again"""

    bl_idname = "digiclay.forget_surface"
    bl_label = "Measure from Rest"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed is needed whose surface was kept."""
        return no_surface(context) or _from_rest(context)

    def perform(self, context: Any) -> None:
        """Forget the surface."""
        formed_bed.clear_reference(chosen_bed(context))


def _from_rest(context: Any) -> str:
    """No surface was kept to measure features from."""
    kept = formed_bed.has_reference(chosen_bed(context))
    return "" if kept else "Features are measured from the bed at rest already"
