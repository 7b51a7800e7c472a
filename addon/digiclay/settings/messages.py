"""Parameter errors in the terms of the panels: labels and display units."""

from __future__ import annotations

import re

from ..core.base.errors import ParameterError
from ..core.base.quantity import list_quantities
from ..core.control.methods import list_methods
from ..core.scene.schema import SECTIONS, import_parameters
from .declared import title
from .shown_units import convert_units

_NAME = re.compile(rf"\b({'|'.join(SECTIONS)})\.(\w+)")


def relabel(error: ParameterError) -> ParameterError:
    """Return an error of the core with its owner, field, rule and value as the panels show them.

    ``layout.pitch must be at least actuator.bore, 0.002 m (got 0.001 m)`` becomes
    ``Layout: Pitch must be at least Actuator: Bore, 2 mm (got 1 mm)``.
    """

    def labeled(found: re.Match[str]) -> str:
        return f"{title(found[1])}: {title(found[2])}" if found[2] in _known(found[1]) else found[0]

    owner, field = error.owner, title(error.field)
    if owner in SECTIONS:
        owner = f"{title(owner)}: {field}" if field else title(owner)
        field = ""
    rule = convert_units(_NAME.sub(labeled, error.rule))
    return ParameterError(owner, field, rule, convert_units(error.value), error.hint)


def _known(section: str) -> set[str]:
    """Return the names of a section's parameters."""
    methods = list_methods() if section == "control" else ("virtual_master",)
    return {name for method in methods for name in list_quantities(import_parameters(section, method))}
