"""Table of control methods, one module each, and methods of users, added by name.

Scenes, panels and comparisons find the data of a method here, by `find_method`.
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
    """Largest speeds of a fingertip that leads a method; the defaults suit any method."""

    drag: float = 2.0
    """Fastest drag of a raised or leveled blister, in radii per second."""
    push: float = 20.0 / 3.0
    """Fastest drag of a fingertip that presses a valley, in radii of the blister per second."""
    fastest: float = 0.1
    """Fastest drag of any blister, m/s."""
    ready: bool = False
    """Whether pins ahead are prepared to reach any height in time at that speed."""
    press: float = 20e-3
    """Fastest press, m/s: a faster one runs into pins whose valves have not opened yet."""
    lift: float = 0.7
    """Fastest rise, as a share of the speed of a pin without load."""
    gain: float = 1.0
    """Time of acceleration to that speed, s: a faster one leaves pins behind, with valves still shut."""


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
    """Within the core; has a function ``build(parameters, device)``."""
    parameters: str
    """Class of its parameters there."""
    blister: Mapping[str, float] | None = None
    """Differing defaults of the blister; None: it forms no blister."""
    recovers: bool = False
    """Whether its cells return to rest."""
    by_set: bool = False
    """Whether its orders for a cell depend on the active set; see `System.by_set`."""
    by_speed: bool = False
    """Whether it commands speeds of pins, and no heights that servos could follow."""
    batched: bool = True
    """Whether a batch of its runs is faster than single runs."""
    digest: str = ""
    """Identifies the code of a user's method; empty for a built-in one."""

    def import_parameters(self) -> type[ControlParameters]:
        """Import the class of its parameters."""
        return import_part(self.module, self.parameters)

    def build(self, parameters: Any, device: Any) -> Any:
        """Return its controller for a `DeviceInfo`; ParameterError if parameters do not fit it."""
        return import_part(self.module, "build")(parameters, device)

    def describe(self) -> str:
        """Return the first line of its class's documentation, if it has any."""
        kind = self.import_parameters()
        line = (kind.__doc__ or "").strip().partition("\n")[0].removesuffix(".")
        return "" if line.startswith(f"{kind.__name__}(") else line


#: A .blend stores the index of a method in this table: new ones are added at its end.
METHODS: dict[str, Method] = {
    "virtual_master": Method("control.virtual_master", "VirtualMaster", {}),
    "cell_states": Method(
        "control.cell_states",
        "CellStates",
        {"radius": 12e-3, "edge_radius": 15.5e-3, "flat_radius": 3e-3},
        by_speed=True,
    ),
    "elastic": Method("control.behaviors", "Elastic", recovers=True, by_speed=True),
    "plastic": Method("control.behaviors", "Plastic", by_speed=True),
    "viscous": Method("control.behaviors", "Viscous", recovers=True, by_set=True),
    "push_pull": Method("control.push_pull", "PushPull", by_set=True, by_speed=True),
    "force_display": Method("control.displays", "ForceDisplay", recovers=True, by_speed=True),
    "shape_display": Method("control.displays", "ShapeDisplay"),
    "hybrid": Method("control.hybrid", "Hybrid", {}, batched=False),
}

#: Methods added to this process, see `add_method`; a .blend stores their names.
_ADDED: dict[str, Method] = {}
#: Remedy for an unknown method.
HINT = (
    "A method of your own must be loaded: by --method path/to/mine.py:Mine, in Python by "
    "digiclay.scene(..., {'control.method': Mine}), in Blender by the preferences."
)


def add_method(name: str, method: Method) -> None:
    """Add or replace a method in this process; ParameterError if a built-in one has its name."""
    if name in METHODS:
        raise ParameterError(
            "control", "method", "must not have the name of a built-in method", repr(name)
        )
    _ADDED[name] = method


def remove_method(name: str) -> None:
    """Remove an added method."""
    _ADDED.pop(name, None)


def list_added() -> dict[str, Method]:
    """Return the added methods of this process, by name."""
    return dict(_ADDED)


def list_methods() -> dict[str, Method]:
    """Return all methods, the built-in ones first, by name."""
    return METHODS | _ADDED


def find_method(name: Any, field: str = "control.method") -> Method:
    """Return a method by its name; ParameterError about the field, with a remedy."""
    methods = list_methods()
    if isinstance(name, str) and name in methods:
        return methods[name]
    owner, _, last = field.rpartition(".")
    close = find_nearest_name(name, list(methods), alike=0.7) if isinstance(name, str) else ""
    hint = f"Did you mean {close}?" if close else HINT
    rule = f"must be one of {', '.join(methods)}"
    raise ParameterError(owner or last, last if owner else "", rule, show_value(name), hint)
