"""Device of a new bed: preset, layout, method and size of the fingertip as one valid scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..core.base.quantity import list_quantities
from ..core.control.virtual_master import VirtualMaster
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Layout
from ..core.scene.scene_source import load
from ..core.scene.schema import Finger, Scene
from ..core.scene.toml_table import PRESETS, resolve
from .own_presets import path

if TYPE_CHECKING:
    from ..core.control.blister import Blister
    from ..core.control.methods import ControlParameters


@dataclass(frozen=True)
class Bed:
    """Size of a bed, and what it is for."""

    rows: int
    columns: int
    #: m.
    pitch: float
    #: Size of fingertip and blister, as a share of the paper's.
    share: float
    use: str


PAPER = Layout()
BEDS = {
    "paper": Bed(
        PAPER.rows, PAPER.columns, PAPER.pitch, 1.0,
        "The bed of the paper: the fingertip is as wide as 5 pins, a fifth of the bed",
    ),
    "design": Bed(
        100, 100, 1.5e-3, 0.5,
        "10,000 pins, fingertip and blister half as large: letters and leaves can be formed",
    ),
    "fine": Bed(
        150, 150, 1e-3, 1 / 3,
        "22,500 pins, fingertip and blister a third as large: for details, on a fast computer",
    ),
}  # fmt: skip
#: Bed that Add makes by hand unless another is chosen: a letter can be read on it (docs/gallery.md).
FIRST = "design"
#: Bed that Add makes in a script that names none, as before there were several.
UNNAMED = "paper"


#: Bore of the cylinders, as a share of the pitch, where a preset's would overlap.
BORE = 2 / 3
#: Lengths of a blister.
LENGTHS = ("radius", "edge_radius", "flat_radius", "sigma")


def make_scene(preset: str, layout: Layout, method: str, share: float = 1.0) -> Scene:
    """Return the scene of a preset, with another plan of the bed, method and size of the fingertip."""
    # In Method I the blister rises from each cell's own height: the paper's strokes do not cross, those of a
    # sculptor do.
    control = {"layout": {"arrangement": layout.arrangement}, "control": {"method": method}}
    if preset in PRESETS:
        scene = resolve({"preset": preset, **control})
        if isinstance(scene.control, VirtualMaster):
            scene = replace(scene, control=replace(scene.control, ground="cell"))
        return change_layout(_scale_finger(scene, share), layout)
    scene = load(path(preset))
    if scene.method != method:
        plain = resolve(control)
        scene = replace(scene, method=method, control=plain.control, blister=plain.blister)
    return change_layout(_scale_finger(scene, share), layout)


def change_layout(scene: Scene, layout: Layout) -> Scene:
    """Return a scene with another plan of the bed; a blister too wide, or cylinders, are made to fit."""
    actuator = scene.actuator
    if actuator.bore > layout.pitch:
        actuator = replace(actuator, bore=BORE * layout.pitch)
    blister = scene.blister and fit_blister(scene.blister, layout)
    return replace(scene, layout=layout, actuator=actuator, blister=blister)


def change_finger(scene: Scene, before: Fingertip, finger: Fingertip) -> Scene:
    """Return a scene with another fingertip, and with a blister in proportion to its width."""
    blister = scene.blister
    if blister is not None:
        blister = fit_blister(scale_blister(blister, finger.width / before.width), scene.layout)
    fingers = tuple(replace(one, fingertip=finger) for one in scene.fingers)
    return replace(scene, fingers=fingers, blister=blister)


def _scale_finger(scene: Scene, share: float) -> Scene:
    """Return a scene with fingertip and blister of another size, and with forces and gains to match."""
    return replace(
        scene,
        fingers=tuple(_scale_tip(finger, share) for finger in scene.fingers),
        blister=scene.blister and scale_blister(scene.blister, share),
        control=scene.control and _scale_control(scene.control, share),
    )


def _scale_tip(finger: Finger, share: float) -> Finger:
    """Return a fingertip with a tip of another size, of the same pulp."""
    # As many pins as before are under it, and each has a smaller area: its share of the law of a flat plate
    # goes with the square of the size.
    tip, contact = finger.fingertip, finger.contact
    if tip is not None:
        tip = replace(tip, length=tip.length * share, width=tip.width * share, height=tip.height * share)
    if contact is not None:
        contact = replace(contact, share=contact.share * share**2)
    return replace(finger, fingertip=tip, contact=contact)


def _scale_control(control: ControlParameters, share: float) -> ControlParameters:
    """Return a control for a fingertip of another size, on pins of another bore, behind the same valves."""
    # The pins' areas go with the square of the size: so do all forces, and the pins' speeds with its inverse.
    # The flow goes with the square of the opening, which is the gain times the force. So a gain that goes
    # with the inverse of the size leaves the fingertip's speed at a given share of the set point what it was.
    # Heights are those of the clay, and stay.
    factors = {"N": share**2, "N/m": share**2, "N s/m": share**2, "1/N": 1.0 / share, "m2/s": share**2}
    quantities = list_quantities(control)
    change = {name: factors[kind.unit] for name, kind in quantities.items() if kind.unit in factors}
    change |= {name: share for name in ("radius", "travel", "jump") if name in quantities}
    return replace(control, **{name: getattr(control, name) * factor for name, factor in change.items()})


def fit_blister(blister: Blister, layout: Layout) -> Blister:
    """Return a blister that is at most as wide as the longer side of a bed, in the same proportions."""
    widest = max(layout.columns * layout.pitch, layout.rows * layout.row_spacing) / 2
    if blister.radius <= widest:
        return blister
    return scale_blister(blister, widest / blister.radius)


def scale_blister(blister: Blister, share: float) -> Blister:
    """Return a blister of another size, in the same proportions."""
    return replace(blister, **{name: share * getattr(blister, name) for name in LENGTHS})
