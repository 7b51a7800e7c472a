"""Control methods of one's own: code found, loaded, checked, entered in the table, copied beside runs.

Blender offers all methods of a folder of files (`load_folder`); one mistake hides no other method.
"""

import builtins
import copy
import copyreg
import dataclasses
import hashlib
import importlib
import importlib.util
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.abc import ExecutionLoader
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from uuid import uuid4

from ..core.base.errors import MethodError, ParameterError
from ..core.control.methods import (
    METHODS,
    ControlParameters,
    Method,
    add_method,
    list_added,
    list_methods,
)
from ..core.control.own_method import Guarded, describe_failure, guard
from ..core.files.run_folder import write_whole
from ..core.files.tables import Record
from ..core.scene.schema import Scene
from .class_check import check_class, list_classes

#: The group of entry points by which installed packages offer methods.
GROUP = "digiclay.methods"
#: Bytes of the largest file that is read as code.
LARGEST = 1_000_000


class MethodSource(NamedTuple):
    """Origin of a method's code, and the code: all that another process needs to have it too."""

    label: str
    file: str
    """For messages, ``mine.py:Mine`` or the name of an installed method; as tracebacks have it."""
    attribute: str
    text: str
    """Name of the class; the code, empty for that of an installed package, which is imported, and of a class
    that is in memory alone."""
    package: str
    module: str
    """Name and version of the installed package, and what to import; empty for a file."""
    digest: str
    """SHA-256 of the code: methods of one digest are the same; of a class in memory a new number."""


def is_file_word(word: str) -> bool:
    """Return whether a word of the command line names a file of code."""
    return ":" in word or word.endswith(".py")


def read_source(word: str) -> MethodSource | None:
    """Return the code of ``path/to/mine.py:Mine``, or of an installed method; None where there is none."""
    if not is_file_word(word):
        return find_installed(word)
    name, colon, attribute = word.rpartition(":")
    if not colon or name == "" or not re.fullmatch(r"[^\W\d]\w*", attribute):
        example = f"{Path(word).name.partition(':')[0] or 'mine.py'}:Mine"
        raise MethodError(f"{word} must be a file and a class in it, such as {example}.")
    return read_file(Path(name), attribute)


def read_file(path: Path, attribute: str) -> MethodSource:
    """Return the code of a file with a class, or raise MethodError."""
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise MethodError(f"{path} cannot be read as a control method: {why}.") from None
    if len(data) > LARGEST:
        raise MethodError(
            f"{path} must have at most {LARGEST // 1_000_000} MB of code (got {len(data) / 1e6:.3g})."
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MethodError(f"{path} must be UTF-8 text (byte {error.start} is not).") from None
    label = f"{path.name}:{attribute}" if attribute else path.name
    return MethodSource(label, str(path), attribute, text, "", "", hashlib.sha256(data).hexdigest())


def find_installed(name: str) -> MethodSource | None:
    """Return the code of an entry point, without importing it; None without one, MethodError of several."""
    from importlib.metadata import entry_points

    points = {point.value: point for point in entry_points(group=GROUP, name=name)}
    if not points:
        return None
    if len(points) > 1:
        owners = ", ".join(sorted(points))
        raise MethodError(
            f"The method {name} must be offered by one installed package (got {owners})."
        )
    (point,) = points.values()
    owner = f"{point.dist.name} {point.dist.version}" if point.dist else point.module
    try:
        spec = importlib.util.find_spec(point.module)
        file = (spec and spec.origin) or ""
        digest = hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except (ImportError, OSError, ValueError) as error:
        raise MethodError(f"The method {name} of {owner} cannot be imported: {error}.") from None
    return MethodSource(name, file, point.attr, "", owner, point.module, digest)


#: The package that this module is part of, in Blender another one than ``digiclay``.
PACKAGE = __package__.rpartition(".")[0]


@dataclass(frozen=True, kw_only=True)
class OwnRow(Method):
    """Method of one's own: the class of its parameters, which builds it."""

    kind: type[ControlParameters]
    source: MethodSource

    def import_parameters(self) -> type[ControlParameters]:
        """Return the class of its parameters."""
        return self.kind

    def build(self, parameters: Any, device: Any) -> Guarded:
        """Return its controller for a device, guarded; MethodError when that cannot be built."""
        # Whatever it does to it, the bed's is another.
        source = self.source
        info = copy.deepcopy(device)
        return guard(lambda: parameters.build(info), source.label, source.file, info.period)


#: Code of the classes of methods, of those too that others of their names have replaced.
_SOURCES: dict[type, MethodSource] = {}


def load_method(word: str | type) -> str:
    """Load the method that a word of the command line names, or a class; return its name.

    A word that names none is returned as it is.
    """
    if isinstance(word, type):
        return load_class(word)
    if word in METHODS or word in list_added():
        return word
    source = read_source(word)
    if source is None:
        return word
    name = word if source.module else name_method(source.attribute)
    row = list_added().get(name)
    if isinstance(row, OwnRow):
        if row.source.digest == source.digest and row.source.attribute == source.attribute:
            return name
        other = row.source.file
        if other != source.file:
            rule = f"the method's name {name} must be unique (also that of {other or 'a class in memory'})"
            raise MethodError(f"{source.label}: {rule}.")
    add_source(name, source)
    return name


def load_class(kind: type) -> str:
    """Enter a class of this process, such as one of a notebook, into the table; return its method's name.

    A later class replaces one of the same name, so that a cell of a notebook can be run again.
    """
    name = name_method(kind.__name__)
    row = list_methods().get(name)
    if row and row.import_parameters() is kind:
        return name
    if row and not (isinstance(row, OwnRow) and is_in_memory(row.source)):
        raise MethodError(
            f"{kind.__name__}: the name {name} must be unique (another method has it)."
        )
    # What its functions refer to can change: no two classes are known to be the same.
    add_class(name, MethodSource(kind.__name__, "", kind.__name__, "", "", "", uuid4().hex), kind)
    return name


def is_in_memory(source: MethodSource) -> bool:
    """Return whether a method has neither a file nor a package, but its class alone."""
    return not (source.text or source.module)


def name_method(attribute: str) -> str:
    """Return the name of a method in scene files by that of its class: ``SoftPad`` is soft_pad."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", attribute).lower()


def add_source(name: str, source: MethodSource) -> OwnRow:
    """Load a method's code and put it into the table of methods, in place of one of the same name."""
    if name in METHODS:
        raise MethodError(
            f"{source.label}: the class must not have the name of the built-in method {name}."
        )
    module = _import(source)
    kind = getattr(module, source.attribute, None)
    if kind is None:
        there = ", ".join(
            f"{source.label.partition(':')[0]}:{kind.__name__}" for kind in list_classes(module)
        )
        rule = f"must have the class {source.attribute}"
        raise MethodError(
            f"{source.label}: the file {rule} (it has {there or 'no control method'})."
        )
    return add_class(name, source, kind)


def add_class(name: str, source: MethodSource, kind: Any) -> OwnRow:
    """Check the class of a method, and put it into the table of methods."""
    is_method = isinstance(kind, type) and issubclass(kind, ControlParameters)
    if is_method and "__dataclass_params__" not in vars(kind):
        try:
            kind = dataclass(frozen=True, eq=False, repr=False)(kind)
        except TypeError as error:
            raise MethodError(f"{source.label}: {error}.") from None
    check_class(source.label, kind)
    blister = getattr(kind, "blister", None)
    row = OwnRow(
        module=source.module,
        parameters=kind.__name__,
        blister=None if blister is None else dict(blister),
        recovers=bool(getattr(kind, "recovers", False)),
        by_set=True,
        digest=source.digest,
        kind=kind,
        source=source,
    )

    def reduce(parameters: ControlParameters) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        values = {
            field.name: getattr(parameters, field.name) for field in dataclasses.fields(parameters)
        }
        return restore_parameters, (name, source, values)

    copyreg.pickle(kind, reduce)
    _SOURCES[kind] = source
    add_method(name, row)
    return row


def restore_parameters(name: str, source: MethodSource, values: Record) -> ControlParameters:
    """Return parameters that another process has pickled, with their class: its code comes along."""
    row = list_added().get(name)
    if not isinstance(row, OwnRow) or row.source[1:] != source[1:]:
        if is_in_memory(source):
            rule = "must be in a file for other processes, by its name file.py:" + source.attribute
            raise MethodError(f"{source.label}: the class {rule}.")
        if source.module:
            here = read_source(name)
            if here is None or here.digest != source.digest:
                got = f"of {here.package}, with other code" if here else "not installed"
                rule = f"must be that of {source.package} here too"
                raise MethodError(f"The method {name} {rule} (it is {got}).")
        row = add_source(name, source)
    return row.kind(**values)


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
        reason = str(error) if isinstance(error, ParameterError) else rule
        raise MethodError(f"{source.label.partition(':')[0]}: {reason}") from error
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
    for attribute in wanted or ():
        if attribute != "*" and not hasattr(module, attribute):
            importlib.import_module(f"{full}.{attribute}")
    return module if wanted else sys.modules[PACKAGE]


#: The file of a method's code beside a scene file.
CODE = "method.py"


def find_code(scene: Scene) -> MethodSource | None:
    """Return the code of a scene's method; None for a built-in one, or without control."""
    return _SOURCES.get(type(scene.control))


def refuse_former(scene: Scene) -> None:
    """Refuse to change a scene whose method is of another class than the one loaded last under its name."""
    row = list_added().get(scene.method)
    if (
        isinstance(row, OwnRow)
        and scene.control is not None
        and type(scene.control) is not row.kind
    ):
        rule = "must be of the code that was loaded last under its name"
        raise MethodError(f"The scene's method {scene.method} {rule}: make the scene again.")


def describe_origin(scene: Scene) -> dict[str, str]:
    """Return what metrics.json keeps of the origin of a method of one's own; nothing for a built-in one."""
    source = find_code(scene)
    if source is None:
        return {}
    kind = "in memory" if is_in_memory(source) else "sha256"
    return {"method": f"{source.package or source.label} {kind}:{source.digest}"}


def write_code(scene: Scene, folder: Path) -> None:
    """Write the code of a scene's method, where it is a file of one's own; else remove a former one."""
    source = find_code(scene)
    if source is not None and source.text:
        write_whole(folder / CODE, source.text.encode())
    else:
        (folder / CODE).unlink(missing_ok=True)


def find_word(scene: Scene) -> str:
    """Return what --method takes for a scene's method beside its code; empty for a built-in one."""
    source = find_code(scene)
    if source is None:
        return ""
    return scene.method if source.module else f"{CODE}:{source.attribute}"


def resolve_word(word: str, folder: Path) -> str:
    """Return a word of --method from the working folder, where it names a file of another folder."""
    return str(folder / word) if (folder / word.rpartition(":")[0]).is_file() else word


class FolderMethods(NamedTuple):
    """Names of a folder's methods that are loaded now, and why others are not, in one line each."""

    names: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()


def load_folder(folder: Path) -> FolderMethods:
    """Run the files of a folder, in the order of their names, and add their control methods."""
    if not folder.is_dir():
        return FolderMethods(refused=(f"{folder} must be a folder.",))
    names: list[str] = []
    refused: list[str] = []
    for path in sorted(folder.glob("*.py")):
        try:
            names += _load_file(path, refused)
        except MethodError as error:
            refused.append(str(error))
    return FolderMethods(tuple(names), tuple(refused))


def _load_file(path: Path, refused: list[str]) -> list[str]:
    """Add the methods of a file, and return their names; `refused` grows by those that are none."""
    source = read_file(path, "")
    classes = list_classes(run_code(source))
    if not classes:
        refused.append(f"{path.name}: the file must have a class derived from OwnMethod.")
    names: list[str] = []
    for kind in classes:
        name = name_method(kind.__name__)
        label = f"{path.name}:{kind.__name__}"
        try:
            if name in list_added():
                raise MethodError(
                    f"{label}: the method's name {name} must be unique in this folder."
                )
            add_class(name, source._replace(label=label, attribute=kind.__name__), kind)
        except MethodError as error:
            refused.append(str(error))
        else:
            names.append(name)
    return names
