"""Loading of control methods of one's own: code to a checked class, and that to the table of methods."""

from __future__ import annotations

import builtins
import copy
import copyreg
import dataclasses
import importlib
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.abc import ExecutionLoader
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from types import ModuleType
from typing import Any

from ..core.base.errors import MethodError, ParameterError
from ..core.control.guarded import Guarded, describe_failure, guard
from ..core.control.methods import METHODS, ControlParameters, Method, add_method, list_added
from .method_rules import check_class, list_classes
from .method_source import MethodSource, read_source

#: The package that this module is part of, in Blender another one than ``digiclay``.
PACKAGE = __package__.rpartition(".")[0]


@dataclass(frozen=True, kw_only=True)
class OwnRow(Method):
    """Method of one's own in the table of methods.

    Attributes
    ----------
    name : str
        In scene files.
    kind : type
        Class of its parameters, which builds the controller.
    source : MethodSource
    """

    name: str
    kind: type[ControlParameters]
    source: MethodSource

    def import_parameters(self) -> type[ControlParameters]:
        """Return the class of its parameters."""
        return self.kind

    def build(self, parameters: Any, device: Any) -> Guarded:
        """Return its controller for a device, guarded; MethodError when that cannot be built."""
        source, own = self.source, copy.deepcopy(device)  # whatever it does to it, the bed's is another
        return guard(lambda: parameters.build(own), self.name, source.label, source.file, own.period)

    def describe(self) -> str:
        """Return what it does, in the first line of its class, where it has one of its own."""
        line = (self.kind.__doc__ or "").strip().partition("\n")[0].removesuffix(".")
        return "" if line.startswith(f"{self.kind.__name__}(") else line


def load_method(word: str) -> str:
    """Load the method that a word of the command line names; return its name, or a word that names none."""
    if word in METHODS or word in list_added():
        return word
    source = read_source(word)
    if source is None:
        return word
    name = word if source.module else name_method(source.attribute)
    known = list_added().get(name)
    if isinstance(known, OwnRow):
        if known.source.digest == source.digest and known.source.attribute == source.attribute:
            return name
        other = known.source.file
        raise MethodError(f"{source.label}: the method's name {name} must be its own (also that of {other}).")
    add_source(name, source)
    return name


def name_method(attribute: str) -> str:
    """Return the name of a method in scene files by that of its class: ``SoftPad`` is soft_pad."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", attribute).lower()


def add_source(name: str, source: MethodSource) -> OwnRow:
    """Load a method's code and put it into the table of methods, in place of one of the same name."""
    if name in METHODS:
        raise MethodError(f"{source.label}: the class must not have the name of the built-in method {name}.")
    module = _import(source)
    kind = getattr(module, source.attribute, None)
    if kind is None:
        there = ", ".join(f"{source.label.partition(':')[0]}:{one.__name__}" for one in list_classes(module))
        rule = f"must have the class {source.attribute}"
        raise MethodError(f"{source.label}: the file {rule} (it has {there or 'no control method'}).")
    return add_class(name, source, kind)


def add_class(name: str, source: MethodSource, kind: Any) -> OwnRow:
    """Check the class of a method, and put it into the table of methods."""
    check_class(source.label, kind)
    blister = getattr(kind, "blister", None)
    row = OwnRow(
        module=source.module, parameters=kind.__name__, blister=None if blister is None else dict(blister),
        recovers=bool(getattr(kind, "recovers", False)), by_set=True, digest=source.digest,
        name=name, kind=kind, source=source,
    )  # fmt: skip

    def reduce(parameters: ControlParameters) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        values = {one.name: getattr(parameters, one.name) for one in dataclasses.fields(parameters)}
        return restore_parameters, (name, source, values)

    copyreg.pickle(kind, reduce)
    add_method(name, row)
    return row


def restore_parameters(name: str, source: MethodSource, values: dict[str, Any]) -> ControlParameters:
    """Return parameters that another process has pickled, with their class: its code comes along."""
    known = list_added().get(name)
    if not isinstance(known, OwnRow) or known.source[1:] != source[1:]:
        if source.module:
            here = read_source(name)
            if here is None or here.digest != source.digest:
                got = f"of {here.package}, with other code" if here else "not installed"
                rule = f"must be that of {source.package} here too"
                raise MethodError(f"The method {name} {rule} (it is {got}).")
        known = add_source(name, source)
    return known.kind(**values)


def _import(source: MethodSource) -> ModuleType:
    """Run the code of a method, and return its module."""
    if not source.module:
        return run_code(source)
    try:
        return importlib.import_module(source.module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        why = describe_failure(error, source.file)
        raise MethodError(f"{source.label}: {source.module} {why}.") from error


class MethodCode(ExecutionLoader):
    """Loader of code kept as text, which other processes have without the file; it keeps no bytecode."""

    def __init__(self, source: MethodSource) -> None:
        self.source = source

    def get_filename(self, fullname: str) -> str:
        """Return the file as tracebacks have it."""
        return self.source.file

    def get_source(self, fullname: str) -> str:
        """Return the code as text."""
        return self.source.text


def run_code(source: MethodSource) -> ModuleType:
    """Run the code of a file as a module, without its folder: it may import what is installed.

    In Blender the package has another name; for the code it is ``digiclay`` everywhere.
    """
    name, loader = f"digiclay_own_{source.digest[:16]}", MethodCode(source)
    module = module_from_spec(ModuleSpec(name, loader, origin=source.file))
    module.__file__ = source.file
    module.__dict__["__builtins__"] = {**vars(builtins), "__import__": _import_for_methods}
    sys.modules[name] = module
    try:
        loader.exec_module(module)
    except BaseException as error:
        del sys.modules[name]
        if isinstance(error, KeyboardInterrupt):
            raise
        rule = f"the code {describe_failure(error, source.file)}."
        said = str(error) if isinstance(error, ParameterError) else rule
        raise MethodError(f"{source.label.partition(':')[0]}: {said}") from error
    return module


def _import_for_methods(
    name: str, namespace: Any = None, local: Any = None, wanted: Any = (), level: int = 0
) -> Any:
    """Import for the code of a method: ``digiclay`` is this package, whatever it is called here."""
    top, _, rest = name.partition(".")
    if level or top != "digiclay" or PACKAGE == "digiclay":
        return builtins.__import__(name, namespace, local, wanted, level)
    full = f"{PACKAGE}.{rest}" if rest else PACKAGE
    module = importlib.import_module(full)
    for one in wanted or ():
        if one != "*" and not hasattr(module, one):
            importlib.import_module(f"{full}.{one}")
    return module if wanted else sys.modules[PACKAGE]
