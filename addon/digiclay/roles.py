"""Roles of Blender's objects: which is a bed, a fingertip of it, the ellipsoid in that, or another part."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .core.model.fingers import MOST_FINGERS

if TYPE_CHECKING:
    from bpy.types import Context, Object

#: Property that holds an object's role.
ROLE = "digiclay_role"
#: A housing is an object of its own in older files only. A pin is whatever the bed's nodes draw,
#: and a bake holds baked pins: both stand in no scene.
BED = "bed"
FINGERTIP = "fingertip"
ELLIPSOID = "ellipsoid"
HOUSING = "housing"
PIN = "pin"
BAKE = "bake"
#: The empty between a bed and the fingertips of a hand, which moves them as one.
PALM = "palm"
#: Properties by which a bed holds its fingertip, and that its ellipsoid: what is held is appended
#: along.
FINGER, BALL = "digiclay_fingertip", "digiclay_ellipsoid"
#: Property by which a fingertip holds its palm, so that one that is deleted is still known.
HAND = "digiclay_hand"
#: Those by which beds and palms hold their fingertips, by number, from 1 on.
FINGERS = (FINGER, *(f"{FINGER}_{number}" for number in range(2, MOST_FINGERS + 1)))
#: Property by which a mesh object that presses a bed holds that bed; and that by which the bed holds
#: those of other files, in which nothing can be stored.
PRESSES, PRESSED_BY = "digiclay_presses", "digiclay_pressed_by"
#: Marks what was seen to belong to a bed: only that can be left behind by one. What older files
#: have lying about without a bed stays.
OWNED = "digiclay_owned"


def is_bed(thing: Object) -> bool:
    """Return whether an object is a bed of this extension."""
    return thing is not None and thing.get(ROLE) == BED and thing.type == "MESH"


def bed_of(context: Context) -> Any:
    """Return the bed the active object is or belongs to, be it fingertip, housing or a part; None without."""
    thing = getattr(context, "object", None)
    while thing is not None and not is_bed(thing):
        thing = find_whole(thing)
    return thing


def find_whole(part: Object) -> Object | None:
    """Return what an object is a part of: its parent, or the bed of a fingertip or palm, or of a presser."""
    pressed = _find_pressed(part)
    if pressed is not None and is_linked(pressed):
        return pressed
    return owner_of(part) if part.get(ROLE) in (FINGERTIP, PALM) else part.parent


def _find_pressed(thing: Object) -> Object | None:
    """Return the bed that an object presses, or of an armature that which a mesh presses that it moves."""
    if thing.type == "ARMATURE":
        pairs = ((bed, mesh) for bed in _list_beds(thing) for mesh in list_pressers(bed))
        return next((bed for bed, mesh in pairs if mesh.find_armature() == thing), None)
    if thing.type != "MESH" or is_local(thing):
        return thing.get(PRESSES)
    return next((bed for bed in _list_beds(thing) if thing in _list_held(bed)), None)


def _list_beds(thing: Object) -> list[Object]:
    """Return the beds in the scenes of an object."""
    # To look for a property takes a hundredth of the time of reading it where there is none.
    return [other for other in _list_beside(thing) if ROLE in other and is_bed(other)]


def _list_beside(thing: Object) -> list[Object]:
    """Return the objects of all scenes in which an object stands."""
    return [other for scene in thing.users_scene for other in scene.objects]


def _list_held(bed: Object) -> list[Object]:
    """Return the mesh objects of other files that press a bed."""
    return list(bed.get(PRESSED_BY, {}).values())


def press(bed: Object, presser: Object) -> None:
    """Have a mesh object press a bed."""
    if is_local(presser):
        presser[PRESSES] = bed
    elif presser not in _list_held(bed):
        _hold(bed, [*_list_held(bed), presser])


def press_no_longer(bed: Object, presser: Object) -> None:
    """Have a mesh object press a bed no longer."""
    presser.pop(PRESSES, None)
    _hold(bed, [held for held in _list_held(bed) if held != presser])


def _hold(bed: Object, pressers: list[Object]) -> None:
    """Have a bed hold mesh objects of other files."""
    bed[PRESSED_BY] = {str(number): presser for number, presser in enumerate(pressers)}


def is_edited(context: Context) -> bool:
    """Return whether the active object, or the bed it belongs to, is being edited, painted or posed."""
    bed = bed_of(context)
    return context.mode != "OBJECT" or (bed is not None and bed.mode != "OBJECT")


def is_local(thing: Object) -> bool:
    """Return whether an object is of this file alone: neither linked, nor a library override of what is."""
    return thing.library is None and thing.override_library is None


def is_linked(thing: Object) -> bool:
    """Return whether an object stands in any collection: what is deleted but held by a property does not."""
    return bool(thing.users_collection)


def fingertips_of(bed: Object) -> dict[int, Object]:
    """Return the fingertips that belong to a bed, by number; not those that the user has deleted."""
    # To look for a property takes less time than to read it; older files have no first one.
    held = ((number, name) for number, name in enumerate(FINGERS, 1) if name in bed or number == 1)
    parts = ((number, _part(bed, name, FINGERTIP)) for number, name in held)
    return {number: part for number, part in parts if part is not None}


def fingertip_of(bed: Object) -> Object | None:
    """Return the first fingertip that belongs to a bed, or None when the user has deleted all of them."""
    return next(iter(fingertips_of(bed).values()), None)


def list_meshes(context: Context) -> list[Object]:
    """Return the selected mesh objects that are no parts of a bed."""
    return [
        thing for thing in context.selected_objects if thing.type == "MESH" and ROLE not in thing
    ]


def list_pressers(bed: Object) -> list[Object]:
    """Return the mesh objects that press a bed and stand in a scene with it, by name."""
    things = _list_beside(bed)
    pressing = [thing for thing in things if PRESSES in thing and thing[PRESSES] == bed]
    pressing += [thing for thing in _list_held(bed) if thing in things]
    meshes = {thing for thing in pressing if thing.type == "MESH"}
    return sorted(meshes, key=lambda presser: presser.name)


def ellipsoid(tip: Object) -> Object | None:
    """Return the ellipsoid of a fingertip, or None when the user has deleted it."""
    return _part(tip, BALL, ELLIPSOID)


def owner_of(part: Object, role: str = BED) -> Object | None:
    """Return the nearest object of a role above one; None without, or if a palm between is deleted.

    A fingertip or palm that hangs on something else, or nothing, is still the bed's that holds it.
    """
    above = part.parent
    while above is not None and above.get(ROLE) != role:
        if above.get(ROLE) == PALM and not is_linked(above):
            return None
        above = above.parent
    if above is not None or role != BED:
        return above
    # A palm is held by its fingertips, and a copy of a fingertip by the one that has its ellipsoid.
    ball = part.get(BALL)
    family = {part, ball and ball.parent, *(part.get(name) for name in FINGERS)} - {None}
    held = [bed for bed in _list_beds(part) if family & {bed.get(name) for name in FINGERS}]
    # A copy of the bed holds it as well, until it gets one of its own.
    return min(held, key=lambda bed: bed.session_uid, default=None)


def _part(owner: Object, name: str, role: str) -> Object | None:
    """Return the part that an object holds as a property, if it still is below it and in a collection."""
    part = owner.get(name)
    if name in (FINGER, BALL) and name not in owner:  # older files do not have it as a property
        part = next((child for child in owner.children if child.get(ROLE) == role), None)
    return (
        part
        if part is not None and owner_of(part, owner[ROLE]) == owner and is_linked(part)
        else None
    )
