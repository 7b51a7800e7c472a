"""Control methods of a scene: one row a method, one module each; and those of one's own, added by name.

What a scene, a panel or a comparison has to know of a method it finds here, by `find_method`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from ..base.errors import ParameterError
from ..base.quantity import Parameters, find_nearest_name
from ..files.tables import show_value
from ..model.control_interface import SetPoint
from ..model.laws import import_part


class Pace(NamedTuple):
    """How fast a method can be led by a fingertip; the default suits any."""

    drag: float = 2.0
    """Fastest drag of a blister raised or leveled, in its radii a second."""
    push: float = 20.0 / 3.0
    """Fastest drag of a fingertip that presses a valley, in radii of the blister a second."""
    fastest: float = 0.1
    """Fastest drag whatever the blister, m/s."""
    ready: bool = False
    """Whether pins ahead stand so that they come to any height in time at that speed."""
    press: float = 20e-3
    """Fastest press, m/s: a faster one runs into pins whose valves have not opened yet."""
    lift: float = 0.7
    """Fastest rise, as a share of the speed of a pin without load."""
    gain: float = 1.0
    """Time to gain that speed, s: at once, it leaves the pins behind, whose valves have not opened yet."""


@dataclass(frozen=True, eq=False, repr=False)
class ControlParameters(Parameters):
    """Base of the parameters of all control methods."""

    @property
    def set_point(self) -> SetPoint | None:
        """Set point; None for a method without one."""
        return None

    @property
    def pace(self) -> Pace:
        """How fast a fingertip may lead the method."""
        return Pace()


@dataclass(frozen=True, eq=False)
class Method:
    """Module of a control method, and its requirements."""

    module: str
    """Within the core; holds a function ``build(parameters, device)``."""
    parameters: str
    """Class of its parameters there."""
    blister: Mapping[str, float] | None = None
    """Its defaults for the blister where they differ; None: it forms no blister."""
    recovers: bool = False
    """Whether its cells go back to the height they had at rest."""
    by_set: bool = False
    """Whether its orders for a cell depend on which other cells are active; see `System.by_set`."""
    batched: bool = True
    """Whether a batch of its runs takes less time than they take one by one."""
    digest: str = ""
    """Identifies the code of a method that is no part of this package; empty: it is."""

    def import_parameters(self) -> type[ControlParameters]:
        """Import the class of its parameters."""
        kind: type[ControlParameters] = import_part(self.module, self.parameters)
        return kind

    def build(self, parameters: Any, device: Any) -> Any:
        """Return its controller for a `DeviceInfo`, or raise a ParameterError that says what does not fit."""
        return import_part(self.module, "build")(parameters, device)

    def describe(self) -> str:
        """Return what it does, in the first line of its class, where it has one of its own."""
        kind = self.import_parameters()
        line = (kind.__doc__ or "").strip().partition("\n")[0].removesuffix(".")
        return "" if line.startswith(f"{kind.__name__}(") else line


#: A .blend keeps a method's place in this table: new ones are added at its end.
METHODS: dict[str, Method] = {
    "virtual_master": Method("control.virtual_master", "VirtualMaster", {}),
    "cell_states": Method(
        "control.cell_states", "CellStates", {"radius": 12e-3, "edge_radius": 15.5e-3, "flat_radius": 3e-3}
    ),
    "elastic": Method("control.behaviors", "Elastic", recovers=True),
    "plastic": Method("control.behaviors", "Plastic"),
    "viscous": Method("control.behaviors", "Viscous", recovers=True, by_set=True),
    "push_pull": Method("control.push_pull", "PushPull", by_set=True),
    "force_display": Method("control.displays", "ForceDisplay", recovers=True),
    "shape_display": Method("control.displays", "ShapeDisplay"),
    "hybrid": Method("control.hybrid", "Hybrid", {}, batched=False),
}

#: What has been added to this process, see `add_method`; a .blend keeps the names of these.
_ADDED: dict[str, Method] = {}
#: Where an unknown method may come from.
HINT = (
    "A method of your own must be loaded: by --method path/to/mine.py:Mine, in Python by "
    "digiclay.scene(..., {'control.method': Mine}), in Blender by the preferences."
)


def add_method(name: str, method: Method) -> None:
    """Add a method to this process or exchange it; ParameterError when a built-in one has its name."""
    if name in METHODS:
        raise ParameterError("control", "method", "must not have the name of a built-in method", repr(name))
    _ADDED[name] = method


def remove_method(name: str) -> None:
    """Remove an added method."""
    _ADDED.pop(name, None)


def list_added() -> dict[str, Method]:
    """Return the methods of one's own that are known to this process, by name."""
    return dict(_ADDED)


def list_methods() -> dict[str, Method]:
    """Return all methods, the built-in ones first, by name."""
    return METHODS | _ADDED


def find_method(name: Any, field: str = "control.method") -> Method:
    """Return a method by its name, or raise a ParameterError about the field, with the remedy."""
    methods = list_methods()
    if isinstance(name, str) and name in methods:
        return methods[name]
    owner, _, last = field.rpartition(".")
    close = find_nearest_name(name, list(methods), alike=0.7) if isinstance(name, str) else ""
    hint = f"Did you mean {close}?" if close else HINT
    rule = f"must be one of {', '.join(methods)}"
    raise ParameterError(owner or last, last if owner else "", rule, show_value(name), hint)
