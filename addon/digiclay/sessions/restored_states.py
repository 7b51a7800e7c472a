"""What sessions take up of snapshots: state, fingertips, base. No Blender."""

from dataclasses import replace
from typing import NamedTuple

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


def fit_base(base: Floats | None, state: State) -> Floats:
    """Return the base (n,), m, of a state: a stored one, or the surface where that has other pins."""
    surface = state.row(0)
    return surface if base is None or base.size != surface.size else base


class Restored(NamedTuple):
    """State to continue from, what of the stored one could not be taken up, and whether nothing could."""

    state: State
    lost: str = ""
    refused: bool = False


def load_state(system: System, stored: bytes | None) -> Restored:
    """Return the state of a snapshot; None: at rest."""
    if stored is None:
        return Restored(begin(system))
    # The state of other parts has heights at least; what has none is of no use.
    refused = ""
    for read, words in ((snapshot.load, ""), (snapshot.transfer_heights, CHANGED)):
        try:
            return Restored(read(system, stored), words and localize(words))
        except StateError as error:
            refused = localize("The bed begins at rest. {}", error)
    return Restored(begin(system), refused, refused=True)


def change_fingers(
    scene: Scene, system: System, stored: bytes | None, was: Numbers, numbers: Numbers
) -> bytes | None:
    """Return a snapshot with the state of each fingertip moved to the place of its number in a system."""
    if stored is None:
        return stored
    bodies = len(scene.bodies)
    try:
        had = snapshot.count_fingers(stored) - len(was)
        if was == numbers and had == bodies:
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
