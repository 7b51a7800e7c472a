"""Mesh objects that press a bed, as a hand, a face or a ball."""

from collections.abc import Iterable

from ..compat import Context, Menu, Modifier, Object, Operator
from ..core.base.errors import DigiclayError
from ..core.control.methods import find_method
from ..device.pressers import read_cage
from ..live.beds import Use, find_obstacle
from ..roles import bed_of, is_bed, list_meshes, list_pressers, press, press_no_longer
from ..settings.declared import text
from ..settings.groups import method_of
from ..ui_text import localize
from .action import action
from .poll_messages import cannot_change, no_mesh, no_presser

#: Method of a bed that a mesh is to press, in place of one that follows a fingertip.
METHOD = "plastic"
#: Modifiers that only make a mesh finer: a session reads the mesh without them.
FINER = {"SUBSURF", "MULTIRES"}
#: Property of a presser with the names of those that were turned off for it, line by line.
COARSENED = "digiclay_coarsened"


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
    finer = [modifier for mesh in meshes for modifier in list_finer(mesh)]
    show(finer, False)
    try:
        for mesh in meshes:
            read_cage(context, bed, mesh)
    except DigiclayError:
        show(finer, True)
        raise
    for mesh in meshes:
        press(bed, mesh)
        if names := [modifier.name for modifier in finer if modifier.id_data == mesh]:
            mesh[COARSENED] = "\n".join(names)
    settings, words = bed.digiclay, [count_pressers(bed)]
    if finer:
        words.append(localize("Subdivision is off in the viewport"))
    if settings.use_control and find_method(method_of(settings)).blister is not None:
        settings.method = METHOD
        words.append(localize("The bed is now plastic: its method followed a fingertip"))
    operator.report({"INFO"}, ". ".join(words))


def list_finer(mesh: Object) -> list[Modifier]:
    """Return the modifiers that make a mesh object finer in the viewport; those of other files are left."""
    every = () if mesh.library else mesh.modifiers
    return [each for each in every if each.type in FINER and each.show_viewport]


def show(modifiers: Iterable[Modifier], on: bool) -> None:
    """Turn modifiers on or off in the viewport."""
    for modifier in modifiers:
        modifier.show_viewport = on


def count_pressers(bed: Object) -> str:
    """Return the text of how many meshes press a bed."""
    return localize("Meshes that press {}: {}", bed.name, len(list_pressers(bed)))


@action(
    "digiclay.remove_presser",
    "Remove Presser",
    cannot_change,
    no_presser,
    presser=text("Presser", "Name of the mesh object; empty: all of the bed"),
)
def remove_presser(operator: Operator, context: Context) -> None:
    """Make a mesh press the bed no longer; it stays where it is"""
    bed = bed_of(context)
    for presser in list_pressers(bed):
        if operator.presser in ("", presser.name):
            press_no_longer(bed, presser)
            names = presser.pop(COARSENED, "").split("\n")
            show((each for each in presser.modifiers if each.name in names), True)
    if bed_of(context) is None:  # so that its panels stay
        context.view_layer.objects.active = bed
    operator.report({"INFO"}, count_pressers(bed))


def entry(menu: Menu, context: Context) -> None:
    """Draw the entry in the menu Object."""
    menu.layout.operator(add_presser.bl_idname, icon="MOD_MESHDEFORM")
