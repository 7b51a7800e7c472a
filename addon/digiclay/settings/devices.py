"""Device of a new bed as one valid scene; size of a bed's fingertip, and of the blister that follows it."""

from dataclasses import dataclass, replace
from typing import Any

from .. import bridge
from ..compat import Context, Object, PropertyGroup, read_stored
from ..core.base.arrays import Floats
from ..core.base.errors import DigiclayError
from ..core.base.quantity import list_quantities
from ..core.control.blister import Blister
from ..core.control.methods import ControlParameters
from ..core.control.virtual_master import VirtualMaster
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Layout
from ..core.scene.scene_source import load
from ..core.scene.schema import Finger, Scene, import_parameters
from ..core.scene.toml_table import FINGER_PARTS, PRESETS, resolve
from ..roles import FINGERTIP, ROLE, bed_of, fingertips_of, owner_of
from .declared import assign, read
from .own_presets import path
from .shown_units import SHOWN, to_si


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
    #: What it is made with unless something else is chosen.
    preset: str = "paper"
    method: str = "virtual_master"


PAPER = Layout()
BEDS = {
    "paper": Bed(
        PAPER.rows, PAPER.columns, PAPER.pitch, 1.0,
        "The bed of the paper: the fingertip is as wide as 5 pins, a fifth of the bed",
    ),
    "design": Bed(
        100, 100, 1.5e-3, 0.5,
        "10,000 pins, fingertip and blister half as large: letters and leaves can be formed",
        "design", "hybrid",
    ),
    "fine": Bed(
        150, 150, 1e-3, 1 / 3,
        "22,500 pins, fingertip and blister a third as large: for details, on a fast computer",
        "design", "hybrid",
    ),
}  # fmt: skip
#: Bed that Add makes by hand unless another is chosen: a letter can be read on it
#: (docs/gallery.md).
FIRST = "design"
#: Bed that Add makes in a script that names none, as before there were several.
UNNAMED = "paper"


#: Bore of the cylinders, as a share of the pitch, where a preset's would overlap.
BORE = 2 / 3
#: Lengths of a blister.
LENGTHS = ("radius", "edge_radius", "flat_radius", "sigma")


def make_scene(preset: str, layout: Layout, method: str, share: float = 1.0) -> Scene:
    """Return the scene of a preset, with another plan of the bed and method.

    `share`: size of the fingertip and blister of a preset of the core.
    """
    # In Method I the blister rises from each cell's own height: the paper's strokes do not cross,
    # those of a sculptor do.
    control = {"layout": {"arrangement": layout.arrangement}, "control": {"method": method}}
    if preset in PRESETS:
        scene = resolve({"preset": preset, **control})
        if isinstance(scene.control, VirtualMaster):
            scene = replace(scene, control=replace(scene.control, ground="cell"))
        return change_layout(_scale_finger(scene, share), layout)
    # A preset of the user's own has its finger's size.
    scene = load(path(preset))
    if scene.method != method:
        tip = scene.fingers[0].fingertip
        size = tip.width / Fingertip().width if tip else 1.0
        plain = _scale_finger(resolve(control), size)
        scene = replace(scene, method=method, control=plain.control, blister=plain.blister)
    return change_layout(scene, layout)


def change_layout(scene: Scene, layout: Layout) -> Scene:
    """Return a scene with another plan of the bed, and the same fingers.

    A blister too wide, or cylinders, are made to fit.
    """
    actuator, ratio = scene.actuator, layout.share / scene.layout.share
    if actuator.bore > layout.pitch:
        actuator = replace(actuator, bore=BORE * layout.pitch)
    blister = scene.blister and fit_blister(scene.blister, layout)
    fingers = tuple(_change_share(finger, ratio) for finger in scene.fingers)
    return replace(scene, layout=layout, actuator=actuator, blister=blister, fingers=fingers)


def _change_share(finger: Finger, ratio: float) -> Finger:
    """Return a finger over cells of another area. `ratio`: of their shares of its contact law."""
    if finger.contact is None or ratio == 1.0:
        return finger
    share = float(f"{finger.contact.share * ratio:.6g}")
    return replace(finger, contact=replace(finger.contact, share=share))


def change_finger(scene: Scene, before: Fingertip, finger: Fingertip) -> Scene:
    """Return a scene with another first fingertip, and with a blister in proportion to its width."""
    blister = scene.blister
    if blister is not None:
        blister = fit_blister(scale_blister(blister, finger.width / before.width), scene.layout)
    first, *others = scene.fingers
    return replace(scene, fingers=(replace(first, fingertip=finger), *others), blister=blister)


def _scale_finger(scene: Scene, share: float) -> Scene:
    """Return a scene with fingertip and blister of another size, and with forces and gains to match."""
    return replace(
        scene,
        fingers=tuple(
            replace(finger, fingertip=finger.fingertip and scale_tip(finger.fingertip, share))
            for finger in scene.fingers
        ),
        blister=scene.blister and scale_blister(scene.blister, share),
        control=scene.control and _scale_control(scene.control, share),
    )


def scale_tip(tip: Fingertip, share: float) -> Fingertip:
    """Return a fingertip of another size, in the same proportions."""
    return Fingertip(tip.length * share, tip.width * share, tip.height * share)


def _scale_control(control: ControlParameters, share: float) -> ControlParameters:
    """Return a control for a fingertip of another size, on pins of another bore, behind the same valves."""
    # The pins' areas go with the square of the size: so do all forces, and the pins' speeds with
    # its inverse. The flow goes with the square of the opening, which is the gain times the force.
    # So a gain that goes with the inverse of the size leaves the fingertip's speed at a given share
    # of the set point what it was. Heights are those of the clay, and stay. The skirt is made for
    # drags faster by as much as the pins.
    factors = {
        "N": share**2,
        "N/m": share**2,
        "N s/m": share**2,
        "1/N": 1.0 / share,
        "m2/s": share**2,
    }
    quantities = list_quantities(control)
    change = {name: factors[kind.unit] for name, kind in quantities.items() if kind.unit in factors}
    change |= {name: share for name in ("radius", "travel", "jump") if name in quantities}
    change |= {"skirt_speed": share**-2} if "skirt_speed" in quantities else {}
    return replace(
        control, **{name: getattr(control, name) * factor for name, factor in change.items()}
    )


def fit_blister(blister: Blister, layout: Layout) -> Blister:
    """Return a blister that is at most as wide as the longer side of a bed, in the same proportions."""
    widest = max(layout.columns * layout.pitch, layout.rows * layout.row_spacing) / 2
    if blister.radius <= widest:
        return blister
    return scale_blister(blister, widest / blister.radius)


def scale_blister(blister: Blister, share: float) -> Blister:
    """Return a blister of another size, in the same proportions."""
    return replace(blister, **{name: share * getattr(blister, name) for name in LENGTHS})


#: Least and largest size, m: narrower than that a fingertip falls between pins, wider than that no
#: hand is.
SMALLEST, LARGEST = 1e-3, 0.2


def read_finger(settings: PropertyGroup) -> Fingertip:
    """Return the fingertip of a bed's settings."""
    return Fingertip(**read(settings.fingertip, Fingertip, {}, "fingertip"))


def read_sizes(bed: Object) -> dict[str, Any]:
    """Return what press strokes on a bed are formed with: fingertip and blister, fields of `Stroke`."""
    blister = Blister(**read(bed.digiclay.blister, Blister, {}, "blister"))
    return {"finger": read_finger(find_first(bed)), "blister": blister}


def read_size(owner: Object) -> float:
    """Return the size of the fingertip that `find_first` finds: how wide it is, m."""
    return 2.0 * read_finger(find_first(owner)).width


def set_axis(settings: PropertyGroup, name: str, size: float) -> None:
    """Give a bed's fingertip another length, width or height, mm; the other two stay."""
    half = 0.5 * to_si(size, SHOWN["m"][1])
    resize(settings, replace(read_finger(settings), **{name: half}))


def set_size(owner: Object, size: float) -> None:
    """Make that fingertip as wide as a size, m, in the same proportions; within what a finger can have."""
    settings, share = find_first(owner), min(max(size, SMALLEST), LARGEST) / read_size(owner)
    resize(settings, scale_tip(read_finger(settings), share))


def find_first(owner: Object) -> PropertyGroup:
    """Return the settings of the fingertip that press strokes move: the first one left of a bed."""
    return owner.digiclay if owner.get(ROLE) == FINGERTIP else list_settings(owner)[0]


def list_settings(bed: Object) -> tuple[PropertyGroup, ...]:
    """Return the settings that hold the parts of each finger: the bed's of the first, the others' own."""
    tips = fingertips_of(bed).items()
    return tuple(bed.digiclay if number == 1 else tip.digiclay for number, tip in tips) or (
        bed.digiclay,
    )


def find_tip(owner: Object) -> Object | None:
    """Return the fingertip whose settings an object holds: itself, or number 1 of a bed; None without."""
    return owner if owner.get(ROLE) == FINGERTIP else fingertips_of(owner).get(1)


def find_settings(context: Context) -> tuple[int, PropertyGroup]:
    """Return number and settings of the active fingertip, or those of a bed for its first one."""
    bed: Object = bed_of(context)
    thing: Object = context.object
    tips = {tip: number for number, tip in fingertips_of(bed).items()}
    while thing not in tips and thing not in (bed, None):
        thing = thing.parent
    number = tips.get(thing, 1)
    return number, bed.digiclay if number == 1 else thing.digiclay


def give_settings(bed: Object, tip: Object) -> None:
    """Give a further fingertip the size and pulp of the first one, unless it has its own."""
    if read_stored(tip, "digiclay"):
        return
    for section in FINGER_PARTS:
        ours, further = getattr(bed.digiclay, section), getattr(tip.digiclay, section)
        for name in list_quantities(import_parameters(section, "")):
            setattr(further, name, getattr(ours, name))
    bridge.resize_fingertip(tip, read_finger(tip.digiclay))


def resize(settings: PropertyGroup, finger: Fingertip) -> None:
    """Give a fingertip another size; its lowest point stays, and a bed's blister follows, if that is on."""
    before, tip = read_finger(settings), find_tip(settings.id_data)
    bed: Object = settings.id_data if tip is None else owner_of(tip)
    lowest = _poses(bed)
    for name in ("length", "width", "height"):
        assign(settings.fingertip, Fingertip, name, getattr(finger, name))
    if tip is not None and lowest is not None:
        bridge.resize_fingertip(tip, read_finger(settings))
        bridge.move_fingertips(
            bed, lowest, [bridge.finger_of(fingertip) for fingertip in fingertips_of(bed).values()]
        )
    follows = bed.digiclay.blister_follows and finger.width != before.width
    if follows and settings == find_first(bed):
        _scale_blister(bed.digiclay, before, finger)


def _poses(bed: Object) -> Floats | None:
    """Return the poses (f, 7) of the fingertips of a bed; None where they have no meaning."""
    try:
        return bridge.poses(bed)
    except DigiclayError:
        return None


def suit_blister(settings: PropertyGroup) -> None:
    """Have the blister of a method, made for the paper's fingertip, suit that of a bed, and the bed."""
    finger = read_finger(find_first(settings.id_data))
    settings.blister_suits = 0.0
    _scale_blister(settings, Fingertip() if settings.blister_follows else finger, finger)


def _scale_blister(settings: PropertyGroup, before: Fingertip, after: Fingertip) -> None:
    """Scale the blister with the width of the fingertip, no wider than the bed."""
    # One that the bed has limited remembers the width of the fingertip that it suits, so that a
    # palm and then a fingertip again leave it as it was.
    blister = read_sizes(settings.id_data)["blister"]
    layout = Layout(**read(settings.layout, Layout, {}, "layout"))
    limited = settings.blister_suits > 0.0 and fit_blister(
        scale_blister(blister, 1.01), layout
    ).radius < 1.001 * (blister.radius)
    suited = 1e-3 * settings.blister_suits if limited else before.width
    wanted = scale_blister(blister, after.width / suited)
    fitted = fit_blister(wanted, layout)
    settings.blister_suits = (
        1e3 * after.width * fitted.radius / wanted.radius if fitted != wanted else 0.0
    )
    for name in LENGTHS:
        assign(settings.blister, Blister, name, getattr(fitted, name))
