"""Code of a control method of one's own, as text: from a file, or from an installed package."""

from __future__ import annotations

import hashlib
import importlib.util
import re
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import NamedTuple

from ..core.base.errors import MethodError

#: The group of entry points by which installed packages offer methods.
GROUP = "digiclay.methods"
#: Bytes of the largest file that is read as code.
LARGEST = 1_000_000


class MethodSource(NamedTuple):
    """Origin of a method's code, and the code: all that another process needs to have it too.

    Attributes
    ----------
    label : str
        For messages: ``mine.py:Mine``, or the name of an installed method.
    file : str
        As tracebacks have it.
    attribute : str
        Name of the class.
    text : str
        The code; empty for that of an installed package, which is imported.
    package : str
        Name and version of the installed package; empty for a file.
    module : str
        To import; empty for a file.
    digest : str
        SHA-256 of the code: methods of one digest are the same.
    """

    label: str
    file: str
    attribute: str
    text: str
    package: str
    module: str
    digest: str


def is_file_word(word: str) -> bool:
    """Return whether a word of the command line names a file of code."""
    return ":" in word or word.endswith(".py")


def read_source(word: str) -> MethodSource | None:
    """Return the code that a word of the command line names; None where no package offers such a method.

    `word`: ``path/to/mine.py:Mine``, or the name of an installed method. Raises MethodError: in one line:
    file and rule.
    """
    return _read_file_word(word) if is_file_word(word) else find_installed(word)


def _read_file_word(word: str) -> MethodSource:
    """Read a file named with its class."""
    name, colon, attribute = word.rpartition(":")
    if not colon or name == "" or not re.fullmatch(r"[^\W\d]\w*", attribute):
        example = f"{Path(word).name.partition(':')[0] or 'mine.py'}:Mine"
        raise MethodError(f"{word} must be a file and a class in it, such as {example}.")
    return read_file(Path(name), attribute)


def read_file(path: Path, attribute: str) -> MethodSource:
    """Return the code of a file. `attribute`: class in it. Raises MethodError."""
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
    """Return the code of an installed method, without importing it; None where no package offers it.

    `name`: of the entry point. Raises MethodError when several packages offer it.
    """
    found: dict[str, EntryPoint] = {point.value: point for point in entry_points(group=GROUP, name=name)}
    if not found:
        return None
    if len(found) > 1:
        owners = ", ".join(sorted(found))
        raise MethodError(f"The method {name} must be offered by one installed package (got {owners}).")
    (point,) = found.values()
    owner = f"{point.dist.name} {point.dist.version}" if point.dist else point.module
    try:
        spec = importlib.util.find_spec(point.module)
        file = (spec and spec.origin) or ""
        digest = hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except (ImportError, OSError, ValueError) as error:
        raise MethodError(f"The method {name} of {owner} cannot be imported: {error}.") from None
    return MethodSource(name, file, point.attr, "", owner, point.module, digest)
