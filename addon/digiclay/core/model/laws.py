"""Laws of a scene's valve and contact: one row per law, one module each.

A section with one law has the parameters of that law. A section with several has the parameters of
all, and `law`, which selects one: scene files, ``--set``, Blender and the nomenclature use this
class. A parameter that an earlier law of the section declares is not declared again.
"""

import importlib
from dataclasses import field as declare
from dataclasses import fields, make_dataclass
from functools import lru_cache
from typing import Any

from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity

#: By section: name of a law, its module within the core, and the class of its parameters there. The
#: first is the default. A valve law has a method ``flow_law(fluid, area)``, see `valve.Valve`; a
#: contact law is a `contact.ExponentialLaw`. Scene files have only the keys of the selected law.
LAWS: dict[str, dict[str, tuple[str, str]]] = {
    "valve": {
        "orifice": ("model.valve", "Valve"),
        "motor": ("model.motor", "Motor"),
    },
    "contact": {
        "exponential": ("model.contact", "Contact"),
    },
}
#: Base class of a section's laws besides `Parameters`, and the attributes of a law.
NEEDED: dict[str, tuple[tuple[str, str], tuple[str, ...]]] = {
    "valve": (("base.quantity", "Parameters"), ("flow_law",)),
    "contact": (("model.contact", "ExponentialLaw"), ("stiffness", "exponent", "offset", "share")),
}


def law_parameters(section: str) -> type[Parameters]:
    """Return the class of a section's parameters, those of all its laws."""
    return _merge(section, tuple(LAWS[section]))


def select_law(section: str, parameters: Any) -> Any:
    """Return the parameters of the law that a section selects."""
    law = getattr(parameters, "law", "")
    if not law:  # of the only law, or of one law alone
        return parameters
    kind = _load(section, law)
    return kind(**{field.name: getattr(parameters, field.name) for field in fields(kind)})


def _load(section: str, law: str) -> Any:
    """Import the class of a law's parameters, and refuse one with which the steppers cannot compute."""
    kind, (base, needed) = import_part(*LAWS[section][law]), NEEDED[section]
    parents = import_part(*base), Parameters
    missing = [parent.__name__ for parent in parents if not issubclass(kind, parent)]
    missing += [name for name in needed if not hasattr(kind, name)]
    if missing:
        rule = f"must derive from Parameters and {base[1]}, and have {', '.join(needed)}"
        raise ParameterError(section, law, rule, f"{kind.__name__} without {', '.join(missing)}")
    return kind


def import_part(module: str, name: str) -> Any:
    """Import a class of the core by name, when a scene needs it."""
    return getattr(importlib.import_module(f"..{module}", __package__), name)


@lru_cache
def _merge(section: str, names: tuple[str, ...]) -> type[Parameters]:
    """Return one class with the parameters of several laws."""
    first: type[Parameters] = _load(section, names[0])
    if len(names) == 1:
        return first
    declared: dict[str, Any] = {
        "law": (str, quantity(names[0], f"law of the {section}", choices=names)),
    }
    of_first = {field.name for field in fields(first)}
    for name in names[1:]:
        for field in fields(_load(section, name)):
            if field.name not in of_first:
                again = declare(default=field.default, metadata=field.metadata)
                declared.setdefault(field.name, (field.type, again))

    def check(self: Any) -> None:
        first.check(self)
        if self.law != names[0]:
            select_law(section, self)

    def list_idle(self: Any) -> frozenset[str]:
        used = {"law"} if self.law != names[0] else set()
        used |= {field.name for field in fields(_load(section, self.law))}
        return frozenset(field.name for field in fields(self)) - used

    def reduce(self: Any) -> Any:
        return _restore, (
            section,
            {field.name: getattr(self, field.name) for field in fields(self)},
        )

    namespace = {
        "check": check,
        "list_idle": list_idle,
        "__reduce__": reduce,
        "__doc__": first.__doc__,
    }
    namespace["__module__"] = __name__
    parts = [(name, kind, field) for name, (kind, field) in declared.items()]
    return make_dataclass(first.__name__, parts, bases=(first,), frozen=True, namespace=namespace)


def _restore(section: str, values: dict[str, Any]) -> Parameters:
    """Return parameters from a pickle."""
    return law_parameters(section)(**values)
