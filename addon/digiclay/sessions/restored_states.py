"""What sessions take up of snapshots: state, fingertips, base. No Blender."""

from dataclasses import replace

from ..core.base.arrays import Floats
from ..core.base.errors import ParameterError, StateError
from ..core.engine.simulation import begin
from ..core.engine.state import State
from ..core.engine.system import System
from ..core.scene.assembly import assemble
from ..core.scene.schema import Presser, Scene
from ..core.session import snapshot
from ..core.shapes.body import Body
from ..ui_text import localize

#: Message when the state of other parts is taken up.
CHANGED = "Only heights and locks were kept: the bed's parts or its method have changed"
#: Numbers of fingertips.
Numbers = tuple[int, ...]


def restore_state(
    scene: Scene,
    system: System,
    stored: bytes | None,
    was: Numbers,
    numbers: Numbers,
    base: Floats | None,
) -> tuple[State, bytes, Floats, str]:
    """Return state, snapshot, base, and what of a stored snapshot (None: at rest) could not be taken up.

    Fingertips are moved from the places of their numbers before, `was`. `base`: (n,), m, the stored one;
    the surface replaces it where that has other pins, or nothing of the state could be taken up.
    """
    stored = change_fingers(scene, system, stored, was, numbers)
    state, lost, refused = _load_state(scene, system, stored)
    surface = state.row(0)
    if base is None or refused or base.size != surface.size:
        base = surface
    return state, snapshot.dump(system, state), base, lost


def _load_state(scene: Scene, system: System, stored: bytes | None) -> tuple[State, str, bool]:
    """Return the state of a snapshot, what of it could not be taken up, and whether nothing could."""
    if stored is None:
        return begin(system), "", False
    # The state of other parts has heights at least; what has none is of no use.
    refused = ""
    for read, words in ((snapshot.load, ""), (snapshot.transfer_heights, CHANGED)):
        try:
            if not words and _lacks_fingertip(scene, stored):
                continue
            return read(system, stored), words and localize(words), False
        except StateError as error:
            refused = localize("The bed begins at rest. {}", error)
    return begin(system), refused, True


def _lacks_fingertip(scene: Scene, stored: bytes) -> bool:
    """Return whether pins of a snapshot are touched by a fingertip that a scene leaves out."""
    return scene.fingers[0].fingertip is None and snapshot.is_reached(stored)


def change_fingers(
    scene: Scene, system: System, stored: bytes | None, was: Numbers, numbers: Numbers
) -> bytes | None:
    """Return a snapshot with the state of each fingertip moved to the place of its number in a system."""
    if stored is None:
        return stored
    bodies = len(scene.bodies)
    try:
        had = snapshot.count_fingers(stored) - len(was)
        if (was == numbers and had == bodies) or _lacks_fingertip(scene, stored):
            return stored
        form = (scene.bodies or (Presser(Body(), scene.fingers[0].trajectory),))[:1]
        former = assemble(
            replace(scene, fingers=scene.fingers[:1] * len(was), bodies=form * max(had, 0))
        )
        state = snapshot.load(former, stored)
    except (StateError, ParameterError):  # what is wrong with it will be said
        return stored
    places = [was.index(number) if number in was else None for number in numbers]
    # Of bodies nothing lasts; as many are the same ones.
    places += [len(was) + body if had == bodies else None for body in range(bodies)]
    return snapshot.dump(system, snapshot.change_fingers(former, system, state, places))
