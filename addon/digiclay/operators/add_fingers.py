"""Further fingertips of a bed, alone or as a hand."""

import numpy as np

from .. import bridge
from ..compat import Context, Menu, Object, Operator
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..device import parts, repair, view
from ..device.instant import CLEARANCE
from ..overlay.ready_view import reveal
from ..roles import BALL, FINGERS, PALM, bed_of, fingertips_of, owner_of
from ..settings import devices
from ..settings.declared import choice
from ..ui_text import localize
from .action import action
from .add_bed import select_only
from .poll_messages import cannot_form

#: Distance that new fingertips keep from others, m: the masters of nearer ones would disturb each
#: other.
APART = 18e-3
#: Fingertips of a right hand that lies relaxed, from its palm: x, y, m, thumb first; and where its
#: wrist is.
HAND = ((-30e-3, -6e-3), (-18e-3, 18e-3), (0.0, 24e-3), (18e-3, 19e-3), (30e-3, 4e-3))
WRIST = (2e-3, -70e-3)
#: How far beside the bed a place is looked for, m, and the steps.
BESIDE, STEP = 200e-3, 3e-3


@action("digiclay.add_fingertip", "Add Fingertip", cannot_form)
def add_fingertip(operator: Operator, context: Context) -> None:
    """Add another fingertip to the bed; a running session takes it up"""
    bed = bed_of(context)
    parts.find_free_number(bed)
    x, y = _find_place(bed, np.zeros((1, 2)))
    (tip,) = tips = _add(bed, np.array([[x, y, 0.0]]))
    select_only(context, tip)
    reveal(context, bed, [tip[BALL] for tip in tips])


@action(
    "digiclay.add_hand",
    "Add Hand",
    cannot_form,
    side=choice("Side", "Which hand", items=[("RIGHT", "Right", ""), ("LEFT", "Left", "")]),
)
def add_hand(operator: Operator, context: Context) -> None:
    """Add the five fingertips of a hand to the bed, on an empty that moves them as one"""
    bed = bed_of(context)
    count = len(fingertips_of(bed)) + len(HAND)
    if count > len(FINGERS):
        raise DigiclayError(localize(parts.TOO_MANY, len(FINGERS), count))
    mirror = np.array([-1.0 if operator.side == "LEFT" else 1.0, 1.0])
    places = np.array(HAND) * mirror
    away = places - np.array(WRIST) * mirror
    x, y = _find_place(bed, places)
    palm = parts.make_palm(bed)
    palm.location = np.array([x, y, _find_top(bed)]) * bridge.SCALE
    palm.location.z += 2.0 * devices.read_finger(bed.digiclay).height * bridge.SCALE
    context.view_layer.update()
    tips = _add(
        bed, np.column_stack([places + np.array([x, y]), np.arctan2(away[:, 1], away[:, 0])]), palm
    )
    select_only(context, palm)
    reveal(context, bed, [tip[BALL] for tip in tips])


def _find_place(bed: Object, places: Floats) -> Floats:
    """Return how far to move places (k, 2), m, to be apart from other fingertips: over the bed, or beside."""
    tips = fingertips_of(bed).values()
    taken = bridge.poses(bed)[:, :2] if tips else np.empty((0, 2))
    palms = {palm for tip in tips if (palm := owner_of(tip, PALM)) is not None}
    centers = [(bed.matrix_world.inverted() @ palm.matrix_world).translation[:2] for palm in palms]
    middles = np.array(centers).reshape(-1, 2) / bridge.SCALE
    reach = np.abs(bridge.read_cells(bed.data)["position"]).max(axis=0) + BESIDE
    axes = (np.arange(-int(most / STEP), int(most / STEP) + 1) * STEP for most in reach)
    moves = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    moves = moves[np.argsort((moves**2).sum(axis=1), kind="stable")]
    away = np.linalg.norm((moves[:, None] + places)[:, :, None] - taken, axis=-1).min(
        axis=(1, 2), initial=1.0
    )
    # A hand has no fingertip between those of another one.
    size = np.ptp(places, axis=0) + APART
    beside = (np.abs(moves[:, None] - middles) >= size).any(axis=2).all(axis=1) | (len(places) == 1)
    return moves[((away >= APART) & beside).argmax()]


def _find_top(bed: Object) -> float:
    """Return the height at which new fingertips stand clear of all pins, m."""
    return float(bridge.read_cells(bed.data)["height"].max()) + CLEARANCE


def _add(bed: Object, places: Floats, palm: Object | None = None) -> list[Object]:
    """Add fingertips at places and headings (k, 3), m, rad, above the pins, on a palm; return them."""
    tips, top = [], _find_top(bed)
    for x, y, heading in places:
        number = parts.find_free_number(bed)
        tip = parts.make_fingertip(bed, number, palm)
        repair.suit_fingertip(bed, number, tip)
        tip.location = (
            np.array([x, y, top + devices.read_finger(tip.digiclay).height]) * bridge.SCALE
        )
        if palm is not None:
            tip.location -= palm.location
        tip.rotation_quaternion = np.cos(heading / 2.0), 0.0, 0.0, np.sin(heading / 2.0)
        tips.append(tip)
    view.hold_parts(bed)
    return tips


def entries(menu: Menu, context: Context) -> None:
    """Draw the entries in Add > Mesh while a bed is active."""
    if bed_of(context) is not None:
        menu.layout.operator(add_fingertip.bl_idname, icon="META_BALL")
        menu.layout.operator_menu_enum(add_hand.bl_idname, "side", icon="VIEW_PAN")
