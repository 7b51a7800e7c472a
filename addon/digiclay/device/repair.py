"""Repair of beds and their fingertips after copy, delete and hide.

Blender copies, deletes and hides the objects that are selected, not those that belong to them. Here
is found what is missing or left over then, and put right; `part_watch` decides when.
"""

from collections.abc import Iterator
from typing import NamedTuple

from .. import bridge
from ..compat import Object, ViewLayer, bpy, own_curves
from ..core.base.errors import DigiclayError
from ..core.scene.schema import Scene
from ..core.scene.toml_table import resolve
from ..roles import (
    BAKE,
    BALL,
    BED,
    ELLIPSOID,
    FINGER,
    FINGERS,
    FINGERTIP,
    HAND,
    HOUSING,
    OWNED,
    PALM,
    PIN,
    ROLE,
    ellipsoid,
    fingertips_of,
    is_bed,
    is_linked,
    is_local,
    owner_of,
)
from ..settings import devices, properties
from . import parts, view
from .instant import make_rest
from .node_tree import ARROWS, list_sources

#: Marks what was hidden along with what it belongs to: only that is shown along with it again.
HIDDEN = "digiclay_hidden"
#: Its bits: by the eye in the outliner (H), and by the switches of the object itself.
EYE, SWITCHES = 1, ((2, "hide_viewport"), (4, "hide_render"))


class Faults(NamedTuple):
    """Missing and surplus objects of a bed; not to be stored, since undo invalidates them."""

    #: Beds, and palms, that have come without fingertips of their own: copies, and beds of older
    #: files. And fingertips that were copied without their ellipsoid, which cannot be selected.
    bare: list[Object]
    #: Fingertips that were copied on their bed, or have come from another one, and that bed:
    #: further ones.
    loose: list[tuple[Object, Object]]
    #: Fingertips, palms, ellipsoids and housings whose bed or fingertip is gone.
    left: list[Object]
    #: What beds are drawn with, come into a scene with an older bed that was appended.
    strewn: list[Object]


def mark_parts() -> frozenset[int]:
    """Mark what belongs to the beds there are; return the uids of all objects that are known from now on."""
    for bed, number, tip in _tips():
        if bed.get(FINGERS[number - 1]) != tip:  # an older file
            bed[FINGER] = tip
            view.hold_parts(bed)
        ball = ellipsoid(tip)
        if ball is not None and tip.get(BALL) != ball:
            tip[BALL] = ball
        if ball is not None and not any(ball.lock_location):
            # An older file: it could not be clicked on.
            parts.lock_in_place(ball)
        cases = [child for child in bed.children if child.get(ROLE) == HOUSING]
        for part in filter(None, (tip, ball, *cases)):
            if not part.get(OWNED):
                part[OWNED] = True
    return frozenset(thing.session_uid for thing in bpy.data.objects if ROLE in thing)


def find_faults(known: frozenset[int], mended: frozenset[int] = frozenset()) -> Faults:
    """Return what is to be put right."""
    beds, tips = _standing(BED), _standing(FINGERTIP)
    # Object > Convert leaves a mesh with faces, which needs no fingertip.
    owners = [bed for bed in beds if is_bed(bed) and not bed.data.polygons] + _standing(PALM)
    bare = [each for each in owners if any(_lacking(each, known, mended))]
    bare += [tip for tip in tips if _lacks_part(tip, BALL, known, mended)]
    held = {bed.get(name) for bed in beds for name in FINGERS}
    tips_of_beds = {tip for _, _, tip in _tips()}
    # Held, but by another bed: it was given to this one.
    come = [tip for tip in tips if (tip in held) == (tip.session_uid in known - mended)]
    loose = [
        (tip, bed) for tip in come if tip not in tips_of_beds and (bed := owner_of(tip)) in beds
    ]
    mine = [thing for thing in bpy.data.objects if thing.get(OWNED) and not thing.library]
    # Deleted along with its bed a fingertip may stand nowhere, and have no user any more.
    left = [thing for thing in mine if not thing.users or (is_linked(thing) and _is_orphan(thing))]
    shown = {
        thing
        for scene in bpy.data.scenes
        for thing in scene.objects
        if thing.get(ROLE) in (PIN, BAKE)
    }
    strewn = [
        thing for thing in shown if thing.session_uid not in known - mended and not thing.library
    ]
    if strewn:  # a copy that Make Instances Real has made is the user's
        drawn = set().union(*(list_sources(tree)[1] for tree in bpy.data.node_groups))
        strewn = [thing for thing in strewn if thing in drawn or thing.get(ROLE) == BAKE]
    return Faults(bare, loose, left, strewn)


def repair(faults: Faults) -> None:
    """Put right what was found."""
    for thing in faults.strewn:
        _unlink(thing)
    for owner in faults.bare:
        if owner.get(ROLE) == FINGERTIP:
            _copy(owner, BALL)
        else:
            _complete(owner)
    for tip, bed in faults.loose:
        _adopt(tip, bed)
    _remove(faults.left)


def give_fingertip(bed: Object, scene: Scene) -> str:
    """Give a bed the fingertip it lost, or another one; return words about it, empty where it has one."""
    if fingertips_of(bed):
        return ""
    tip = bed.get(FINGER)
    if tip is not None and tip.parent == bed:  # deleted: nothing but the bed holds it any more
        _stand(bed, tip)
        return f"{bed.name} got its fingertip back"
    parts.make_fingertip(bed)
    rest = make_rest(scene)
    bridge.place_fingertips(bed, rest.fingertip, rest.finger)
    view.hold_parts(bed)
    return f"{bed.name} got a new fingertip"


def follow_visibility() -> None:
    """Have the parts of a bed hidden while it is, and an ellipsoid while its fingertip is."""
    for bed in _standing(BED):
        case = view.housing_of(bed)
        if case is not None and case.parent == bed:
            _hide_along(bed, case)
    for palm in _standing(PALM):
        if owner_of(palm) is not None:
            _hide_along(owner_of(palm), palm)
    for bed, _, tip in _tips():
        _hide_along(owner_of(tip, PALM) or bed, tip)
        ball = ellipsoid(tip)
        if ball is not None:
            _hide_along(tip, ball)


def follow_selection() -> None:
    """Have a fingertip selected where its ellipsoid is, and active: a click on the ball takes hold of it."""
    for _, _, tip in _tips():
        ball = ellipsoid(tip)
        if ball is None:
            continue
        for layer in _list_layers(tip, ball):
            # Selecting what is selected, too, would count as a change to be looked at.
            ready = tip.select_get(view_layer=layer) or not tip.visible_get(view_layer=layer)
            if ball.select_get(view_layer=layer) and not ready:
                tip.select_set(True, view_layer=layer)
            if layer.objects.active == ball:
                layer.objects.active = tip


def _standing(role: str) -> list[Object]:
    """Return the objects of this file with a role that stand in a collection."""
    every = (thing for thing in bpy.data.objects if thing.get(ROLE) == role)
    return [thing for thing in every if is_local(thing) and is_linked(thing)]


def _tips() -> Iterator[tuple[Object, int, Object]]:
    """Give the fingertips of all beds, with bed and number."""
    for bed in _standing(BED):
        yield from ((bed, number, tip) for number, tip in fingertips_of(bed).items())


def _lacking(owner: Object, known: frozenset[int], mended: frozenset[int]) -> Iterator[str]:
    """Give the properties of a bed or a palm whose fingertips it is to get."""
    tips = fingertips_of(owner)
    if not tips and owner.get(ROLE) == BED and _lacks_part(owner, FINGER, known, mended):
        yield FINGER
    for number, name in enumerate(FINGERS, 1):
        part = owner.get(name) if number not in tips else None
        if part is not None and is_linked(part) and _lacks_part(owner, name, known, mended):
            yield name


def _holder(part: Object, owner: Object) -> Object | None:
    """Return the holder of a part: its parent, or the bed of its palm unless the palm is the owner."""
    above = part.parent
    return (
        above.parent if above is not None and above.get(ROLE) == PALM and above != owner else above
    )


def _lacks_part(owner: Object, name: str, known: frozenset[int], mended: frozenset[int]) -> bool:
    """Return whether an object without a part of its own is to get one."""
    # A copy is to get one: it holds the part of its original. So is a bed that has come without
    # any. An object whose part the user has deleted or detached is not.
    part, new = owner.get(name), owner.session_uid not in known
    if part is None:
        return name == FINGER and (new or (FINGER not in owner and owner.session_uid in mended))
    holder = _holder(part, owner)
    if holder == owner:  # it stands nowhere: of a bed that was linked and made local, or deleted
        return name != BALL and new
    return new or owner.session_uid in mended


def _is_orphan(part: Object) -> bool:
    """Return whether nothing that stands has this part any more."""
    kind, names = {ELLIPSOID: (FINGERTIP, (BALL,)), PALM: (BED, (HAND,))}.get(
        part[ROLE], (BED, FINGERS)
    )
    owner = owner_of(part, kind)
    if owner is not None and is_linked(owner):
        return False
    if part.parent is not None and part.parent.get(ROLE) == PALM:  # which was deleted, or its bed
        return True
    # With its parent cleared or exchanged by hand it is still held by its bed, and stays as long as
    # that.
    return not any(
        thing.get(name) == part and is_linked(thing) for thing in bpy.data.objects for name in names
    )


def _complete(owner: Object) -> None:
    """Give a bed, or a palm, fingertips: copies of those it holds and does not own, or a new one."""
    bed, tips = owner if owner[ROLE] == BED else owner_of(owner), fingertips_of(owner)
    for number, name in enumerate(FINGERS, 1):
        tip = owner.get(name)
        if tip is None or number in tips or bed is None:
            continue
        if _holder(tip, owner) == owner:
            _stand(bed, tip)
        elif is_linked(tip) or (number == 1 and not tips):
            above = owner if owner != bed else _find_palm(bed, name)
            if owner_of(tip) is not None and tip not in fingertips_of(owner_of(tip)).values():
                tip.parent = above  # it was copied along
            else:
                _copy(owner, name, above)
                if tip.get(BALL) is not None:
                    _copy(owner[name], BALL)
            if owner == bed:
                parts.hold_fingertip(bed, number, owner[name])
            else:
                _adopt(owner.pop(name), bed)
    if owner != bed or bed is None:
        return
    try:
        scene = properties.read_scene(bed)
    except DigiclayError:  # settings that do not go together: a session will say so
        scene = resolve({})
    give_fingertip(bed, scene)
    if view.is_drawn(bed) and view.housing_of(bed) is None:
        # In an older file the housing is an object.
        view.add_modifier(bed, make_rest(scene))
    view.hold_parts(bed)


def _find_palm(bed: Object, name: str) -> Object | None:
    """Return the palm for the copy of a fingertip that a bed holds, itself copied if need be; or the bed."""
    tip = bed[name]
    palm = owner_of(tip, PALM)
    if palm is None or tip.parent != palm:
        return bed
    mine = (palm for palm in _standing(PALM) if palm.parent == bed and palm.get(name) is not None)
    copies = [copy for copy in mine if copy[name].parent == palm]
    if copies:
        return copies[0]
    return _duplicate(palm, bed, bed)


def _stand(bed: Object, tip: Object) -> None:
    """Have a fingertip, with its ellipsoid and palm, stand where its bed does."""
    for part in (tip, tip.get(BALL), owner_of(tip, PALM)):
        for collection in bed.users_collection if part is not None and not is_linked(part) else ():
            collection.objects.link(part)


def _adopt(tip: Object, bed: Object) -> None:
    """Make a fingertip that has come to a bed a further one; as many as a bed can have."""
    try:
        number = parts.find_free_number(bed)
    except DigiclayError:  # it stays as it is, and touches nothing
        return
    parts.hold_fingertip(bed, number, tip)
    if tip.name.startswith(parts.FINGERTIP_NAME):
        tip.name = parts.name_fingertip(number)
    suit_fingertip(bed, number, tip)
    view.hold_parts(bed)


def suit_fingertip(bed: Object, number: int, tip: Object) -> None:
    """Give a further fingertip the settings of the first one, unless it has its own, and its color."""
    devices.give_settings(bed, tip)
    parts.color_fingertip(tip, number, clear=bool(view.read_setting(bed, ARROWS, False)))


def _copy(owner: Object, held: str, parent: Object | None = None) -> None:
    """Give a copy of an object a copy of the part it holds, where that one is."""
    owner[held] = _duplicate(owner[held], parent or owner, owner)


def _duplicate(thing: Object, parent: Object, owner: Object) -> Object:
    """Return a copy of an object below another, its animation its own, that stands where its owner does."""
    copy = thing.copy()
    own_curves(copy)
    copy.parent = parent
    if thing.parent is None or ROLE not in thing.parent:
        # It stands on its bed as the other one on its own.
        copy.matrix_parent_inverse.identity()
        home = owner_of(thing) or parent
        copy.matrix_basis = home.matrix_world.inverted() @ thing.matrix_world
    for collection in owner.users_collection:
        collection.objects.link(copy)
    return copy


def _remove(left: list[Object]) -> None:
    """Remove parts; what is still held by another stands nowhere from then on, and can be had back."""
    for part in left:
        for child in [thing for thing in part.children if ROLE not in thing]:
            # What the user has hung on a part stays where it is.
            where = child.matrix_world.copy()
            child.parent = None
            child.matrix_world = where
        for collection in part.users_collection:
            collection.objects.unlink(part)
    # Also parts that Blender kept only because deleted objects still held them.
    bpy.data.batch_remove(
        [thing for thing in bpy.data.objects if thing.get(OWNED) and not thing.users]
    )


def _unlink(thing: Object) -> None:
    """Take what beds are drawn with out of all scenes."""
    for scene in bpy.data.scenes:
        for owner in (scene.collection, *scene.collection.children_recursive):
            for child in list(owner.children):
                if thing.name in child.objects and all(
                    part.get(ROLE) in (PIN, BAKE) for part in child.objects
                ):
                    owner.children.unlink(child)
            if thing.name in owner.objects and owner.objects[thing.name] == thing:
                owner.objects.unlink(thing)


def _hide_along(owner: Object, part: Object) -> None:
    """Hide a part in every way its owner is hidden, and show it again where it was hidden along."""
    before = now = int(part.get(HIDDEN, 0))
    both = _list_layers(owner, part)
    for layer in both:
        hidden, along = owner.hide_get(view_layer=layer), part.hide_get(view_layer=layer)
        if hidden and not along:
            now |= EYE
        if hidden != along and (hidden or before & EYE):
            part.hide_set(hidden, view_layer=layer)
    if not any(owner.hide_get(view_layer=layer) for layer in both):
        now &= ~EYE
    for bit, name in SWITCHES:
        hidden, along = getattr(owner, name), getattr(part, name)
        if hidden != along and (hidden or before & bit):
            setattr(part, name, hidden)
        now = now | bit if hidden and not along else now if hidden else now & ~bit
    if now:
        part[HIDDEN] = now
    elif before:
        del part[HIDDEN]


def _list_layers(*things: Object) -> list[ViewLayer]:
    """Return the view layers in which all of some objects stand."""
    layers = (layer for scene in bpy.data.scenes for layer in scene.view_layers)
    return [
        layer for layer in layers if all(layer.objects.get(each.name) == each for each in things)
    ]
