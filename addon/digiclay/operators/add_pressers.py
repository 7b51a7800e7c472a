"""Mesh objects that press a bed, as a hand, a face or a ball."""

from ..compat import Context, Menu, Object, Operator
from ..core.base.errors import DigiclayError
from ..core.control.methods import find_method
from ..device.pressers import read_cage
from ..live.beds import Use, find_obstacle
from ..roles import PRESSES, bed_of, is_bed, is_local, list_meshes, list_pressers
from ..settings.declared import text
from ..settings.groups import method_of
from ..ui_text import localize
from .action import action, inform
from .poll_messages import cannot_change, no_mesh, no_presser

#: Method of a bed that a mesh is to press, in place of one that follows a fingertip.
METHOD = "plastic"
#: Modifiers that only make a mesh finer: a session reads the mesh without them.
FINER = {"SUBSURF", "MULTIRES"}


def find_pressed(context: Context) -> Object:
    """Return the bed to be pressed: active, selected, or the only one; DigiclayError without."""
    candidates = [bed_of(context)], context.selected_objects, context.scene.objects
    beds = next(filter(None, ([*filter(is_bed, things)] for things in candidates)), [])
    if len(beds) != 1:
        rule = "Select one bed along with the meshes that are to press it (got {})"
        raise DigiclayError(localize(rule, len(beds)))
    obstacle = find_obstacle(context, beds[0], Use.FORM)
    if obstacle:
        raise DigiclayError(obstacle)
    return beds[0]


@action("digiclay.add_presser", "Add Presser", no_mesh)
def add_presser(operator: Operator, context: Context) -> None:
    """Make the selected meshes press the bed, however they are moved or deformed"""
    bed, meshes = find_pressed(context), list_meshes(context)
    for mesh in meshes:
        if not is_local(mesh):
            raise DigiclayError(localize("{} is linked: make it local first", mesh.name))
        read_cage(context, bed, mesh)
    for mesh in meshes:
        mesh[PRESSES] = bed
        for modifier in mesh.modifiers:
            if modifier.type in FINER:
                modifier.show_viewport = False
    settings = bed.digiclay
    if settings.use_control and find_method(method_of(settings)).blister is not None:
        settings.method = METHOD
        inform(operator, "The bed is now plastic: its method followed a fingertip")
    inform(operator, "{} pressed by {} meshes", bed.name, len(list_pressers(bed)))


@action(
    "digiclay.remove_presser",
    "Remove Presser",
    cannot_change,
    no_presser,
    presser=text("Presser", "Name of the mesh object; empty: all of the bed"),
)
def remove_presser(operator: Operator, context: Context) -> None:
    """Make a mesh press the bed no longer; it stays as it is"""
    for presser in list_pressers(bed_of(context)):
        if operator.presser in ("", presser.name):
            del presser[PRESSES]


def entry(menu: Menu, context: Context) -> None:
    """Draw the entry in the menu Object."""
    menu.layout.operator(add_presser.bl_idname, icon="MOD_MESHDEFORM")
