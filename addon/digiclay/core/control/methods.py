"""Control methods of a scene: one row a method, one module each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..base.quantity import Parameters
from ..model.set_point import SetPoint

__all__ = ["METHODS", "ControlParameters", "Method"]


@dataclass(frozen=True)
class ControlParameters(Parameters):
    """Base of the parameters of all control methods."""

    @property
    def set_point(self) -> SetPoint | None:
        """Set point; None for a method without one."""
        return None


@dataclass(frozen=True)
class Method:
    """Module of a control method, and its requirements.

    Attributes
    ----------
    module : str
        Within the core; holds a function ``build(parameters, device)``.
    parameters : str
        Class of its parameters there.
    blister : mapping or None
        Its defaults for the blister where they differ; None: it forms no blister.
    recovers : bool
        Whether its cells go back to the height they had at rest.
    by_set : bool
        Whether its orders for a cell depend on which other cells are active; see `System.by_set`.
    """

    module: str
    parameters: str
    blister: Mapping[str, float] | None = field(default=None)
    recovers: bool = False
    by_set: bool = False


#: A .blend keeps a method's place in this table: new ones are added at its end.
METHODS: dict[str, Method] = {
    "virtual_master": Method("control.virtual_master", "VirtualMaster", {}),
    "cell_states": Method(
        "control.cell_states", "CellStates", {"radius": 12e-3, "edge_radius": 15.5e-3, "flat_radius": 3e-3}
    ),
    "elastic": Method("control.elastic", "Elastic", recovers=True),
    "plastic": Method("control.plastic", "Plastic"),
    "viscous": Method("control.viscous", "Viscous", recovers=True, by_set=True),
    "push_pull": Method("control.push_pull", "PushPull", by_set=True),
    "force_display": Method("control.force_display", "ForceDisplay", recovers=True),
    "shape_display": Method("control.shape_display", "ShapeDisplay"),
    "hybrid": Method("control.hybrid", "Hybrid", {}),
}
