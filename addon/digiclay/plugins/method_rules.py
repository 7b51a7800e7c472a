"""Rules of the class of a control method of one's own; each broken one is a line with the class."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, NoReturn

from ..core.base.errors import MethodError, ParameterError
from ..core.base.quantity import Quantity
from ..core.control.blister import Blister
from ..core.control.guarded import MOST_ROWS, describe_failure
from ..core.control.methods import ControlParameters
from ..core.control.own_method import OwnMethod
from ..core.model.set_point import SetPoint

#: Names that are no parameters: in the section [control] of a scene file, among a method's functions, and
#: among those of Blender's properties.
TAKEN = (
    "method", "begin", "blister", "build", "check", "command", "locate", "recovers", "rows", "set_point",
    "bl_rna", "get", "id_data", "items", "keys", "name", "pop", "rna_type", "values",
)  # fmt: skip
Refuse = Callable[..., NoReturn]
#: Types of a parameter's default.
KINDS = (bool, int, float, str, tuple)


def list_classes(module: ModuleType) -> list[type]:
    """Return the control methods that a module defines itself."""
    return [
        one
        for one in vars(module).values()
        if isinstance(one, type) and issubclass(one, ControlParameters) and one.__module__ == module.__name__
    ]


def check_class(label: str, kind: Any) -> None:
    """Refuse a class that is no control method."""

    def refuse(rule: str, got: object = "") -> NoReturn:
        raise MethodError(f"{label}: {rule}{f' (got {got})' if got != '' else ''}.")

    if not isinstance(kind, type) or not issubclass(kind, ControlParameters):
        what = kind.__name__ if isinstance(kind, type) else type(kind).__name__
        refuse("the class must derive from OwnMethod of digiclay.core.control.own_method", what)
    params = vars(kind).get("__dataclass_params__")
    if params is None or not params.frozen:
        refuse("the class must be decorated with @dataclass(frozen=True)")
    for field in dataclasses.fields(kind):
        _check_field(field, refuse)
    if not callable(getattr(kind, "build", None)):
        refuse("the class must have a function build(self, device), or derive from OwnMethod")
    if _owner(kind, "build") is OwnMethod and _owner(kind, "command") is OwnMethod:
        refuse("the class must have a function command(self, memory, cells, device)")
    _check_settings(kind, refuse)
    try:
        asked = getattr(kind(), "set_point", None)
        if not (asked is None or isinstance(asked, SetPoint)):
            refuse("set_point must be a SetPoint or None", type(asked).__name__)
    except ParameterError as error:
        name = f"the default of {error.field}" if error.field else "the class"
        refuse(f"{name} {error.rule}", error.value)
    except (MethodError, KeyboardInterrupt):
        raise
    except BaseException as error:
        refuse(f"the class {describe_failure(error, '')}")


def _owner(kind: type, name: str) -> type | None:
    """Return the class that defines a function of a class."""
    return next((one for one in kind.__mro__ if name in vars(one)), None)


def _check_field(field: dataclasses.Field[Any], refuse: Refuse) -> None:
    """Refuse a field that is no declared parameter."""
    known = field.metadata.get("quantity")
    if not isinstance(known, Quantity):
        refuse(f"the field {field.name} must be declared with quantity(default, meaning, unit=...)")
    if field.name in TAKEN or field.name.startswith("_"):
        refuse(f"a field must not begin with an underscore, nor be called {', '.join(TAKEN)}", field.name)
    if not isinstance(field.default, KINDS):
        kinds = ", ".join(kind.__name__ for kind in KINDS)
        refuse(f"the default of {field.name} must be a {kinds}", type(field.default).__name__)
    if not known.doc.strip():
        refuse(f"the meaning of {field.name} must be given")


def _check_settings(kind: type, refuse: Refuse) -> None:
    """Refuse settings of the class, which are no fields, that are none."""
    rows = getattr(kind, "rows", 0)
    if isinstance(rows, int) and not 0 <= rows <= MOST_ROWS:
        refuse(f"rows must be from 0 to {MOST_ROWS}", rows)
    blister = getattr(kind, "blister", None)
    if blister is None:
        return
    if not isinstance(blister, Mapping):
        refuse("blister must be None or a dictionary of defaults", type(blister).__name__)
    try:
        Blister(**blister)
    except (TypeError, ParameterError) as error:
        refuse(f"blister must hold values of the section [blister]: {error}".rstrip("."))
