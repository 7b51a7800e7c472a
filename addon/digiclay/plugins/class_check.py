"""Check of a class that is to be a control method of one's own."""

import dataclasses
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, NoReturn

from ..core.base.errors import MethodError, ParameterError
from ..core.base.quantity import Quantity
from ..core.control.blister import Blister
from ..core.control.methods import ControlParameters
from ..core.control.own_method import MOST_ROWS, OwnMethod, describe_failure
from ..core.model.control_interface import SetPoint

#: Names that are no parameters: in the section [control] of a scene file, among a method's
#: functions, and among those of Blender's properties.
TAKEN = (
    "method",
    "begin",
    "blister",
    "build",
    "check",
    "command",
    "locate",
    "recovers",
    "rows",
    "set_point",
    "bl_rna",
    "get",
    "id_data",
    "items",
    "keys",
    "name",
    "pop",
    "rna_type",
    "values",
)
Refuse = Callable[..., NoReturn]
#: Types of a parameter's default.
KINDS = (bool, int, float, str, tuple)


def list_classes(module: ModuleType) -> list[type]:
    """Return the control methods that a module defines itself."""
    kinds = [kind for kind in vars(module).values() if isinstance(kind, type)]
    return [
        k for k in kinds if issubclass(k, ControlParameters) and k.__module__ == module.__name__
    ]


def check_class(label: str, kind: Any) -> None:
    """Refuse a class that is no control method."""

    def refuse(rule: str, got: object = "") -> NoReturn:
        raise MethodError(f"{label}: {rule}{f' (got {got})' if got != '' else ''}.")

    if not isinstance(kind, type) or not issubclass(kind, ControlParameters):
        what = kind.__name__ if isinstance(kind, type) else type(kind).__name__
        refuse("the class must derive from digiclay.Method", what)
    for field in dataclasses.fields(kind):
        _check_field(field, refuse)
    build, command = (getattr(kind, name, None) for name in ("build", "command"))
    if not callable(build):
        refuse("the class must have a function build(self, device), or derive from OwnMethod")
    if build is OwnMethod.build and command is OwnMethod.command:
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


def _check_field(field: dataclasses.Field[Any], refuse: Refuse) -> None:
    """Refuse a field that is no declared parameter."""
    declared = field.metadata.get("quantity")
    if not isinstance(declared, Quantity):
        refuse(f"the field {field.name} must be declared with quantity(default, meaning, unit=...)")
    if field.name in TAKEN or field.name.startswith("_"):
        refuse(
            f"a field must not begin with an underscore, nor be called {', '.join(TAKEN)}",
            field.name,
        )
    if not isinstance(field.default, KINDS):
        kinds = ", ".join(kind.__name__ for kind in KINDS)
        refuse(f"the default of {field.name} must be a {kinds}", type(field.default).__name__)
    if not declared.doc.strip():
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
