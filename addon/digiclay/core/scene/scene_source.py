"""Scene files: search by path or name, reading, overrides, errors of one line."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from ..base.errors import ParameterError, SceneError
from ..control.methods import list_methods
from ..files.run_folder import find_file, list_files
from ..files.tables import (
    LARGEST,
    ReadParts,
    Record,
    Table,
    format_value,
    parse_tables,
    refuse_unknown,
)
from .schema import FINGER_SECTIONS, SECTIONS, Scene
from .toml_table import (
    ABSENT,
    BODIES,
    FINGERS,
    FORMAT,
    UNCERTAINTY,
    keep_former_share,
    merge_one_finger,
    resolve,
    tabulate,
)

#: What a scene is made of: another one, tables as of a file, a file, the folder of a run, or a
#: sample's name.
Source = Scene | Table | str | os.PathLike[str]

#: Sections that another scene may take from a file, and what else may stand there.
PORTABLE = (*SECTIONS[1 : SECTIONS.index("control")],)
BESIDE = (FORMAT, "name", "description", UNCERTAINTY)
#: Folders of the sample scenes: sessions without bodies, and with them; displays that were built.
SAMPLES = Path(__file__).parents[2] / "sample_shapes" / "sessions"
BODY_SAMPLES, DISPLAY_SAMPLES = SAMPLES.parent / "bodies", SAMPLES.parent / "displays"
SAMPLE_FOLDERS = SAMPLES, BODY_SAMPLES, DISPLAY_SAMPLES


def list_samples() -> list[str]:
    """Return the names of the sample scenes."""
    return list(_list_sample_files())


def _list_sample_files() -> dict[str, Path]:
    """Return the files of the sample scenes, by their names."""
    files = {
        name: path
        for folder in SAMPLE_FOLDERS
        for name, path in list_files(folder, ".toml").items()
    }
    return dict(sorted(files.items()))


def find(word: str) -> Path:
    """Return the file of a scene by a sample's name, a file, or a run's folder; SceneError if absent."""
    samples = _list_sample_files()
    if word not in samples and os.path.isdir(word):
        word = os.path.join(word, "scene.toml")
    return find_file(word, samples, "sample")


class Setting(NamedTuple):
    """Change of a scene file by an option of the command line."""

    key: str
    """Section and key, ``valve.stroke``; of a finger ``finger.2.contact.law``, of all ``contact.law``."""
    value: str
    """TOML; a text needs no quotes."""
    option: str = "--set"
    """Its name in messages."""


def read_source(source: Source) -> tuple[Path | None, Table]:
    """Return the file of a scene's source, or None, and its tables."""
    if isinstance(source, Scene):
        return None, tabulate(source)
    if isinstance(source, Mapping):
        return None, source
    if not isinstance(source, (str, os.PathLike)):
        raise SceneError(f"A scene must be tables, a file or a name (got {source!r:.60}).")
    path = find(os.fspath(source))
    return path, read_table(path)


def list_changes(changes: Table, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield keys and values of changes, in nested tables or by dotted keys."""
    for key, value in changes.items():
        if isinstance(value, Mapping) and value:
            yield from list_changes(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def read_parts(path: Path) -> list[Setting]:
    """Return the parts of device and finger that a file gives, as changes of another scene.

    Its name, description and uncertainty stay behind. SceneError for any other section.
    """
    table = read_table(path)
    try:
        refuse_unknown("", table, (*PORTABLE, *BESIDE))
    except ParameterError as error:
        raise SceneError(f"{path}: {error}") from None
    parts = {name: part for name, part in table.items() if name in PORTABLE}
    return [Setting(key, write_word(value), str(path)) for key, value in list_changes(parts)]


def write_word(value: object) -> str:
    """Return a value as the word of a `Setting`; a text without quotes where these are not needed."""
    return value if isinstance(value, str) and read_value(value) == value else format_value(value)


def load(path: Path, settings: Sequence[Setting] = ()) -> Scene:
    """Read a scene file with settings; SceneError in one line: file or option, key, rule and value."""
    return make_scene(path, read_table(path), settings)


def load_recorded(path: Path) -> Scene:
    """Read the scene of a finished run, without its control if its method is not loaded.

    It keeps the method's name, by which it is refused where it would be simulated or written.
    """
    table = read_table(path)
    control = table.get("control")
    method = control.get("method") if isinstance(control, dict) else None
    if isinstance(method, str) and method.isidentifier() and method not in list_methods():
        table.pop("blister", None)
        table["control"] = ABSENT
        return replace(make_scene(path, table), method=method)
    return make_scene(path, table)


def make_scene(
    path: Path | None,
    table: Table,
    settings: Sequence[Setting] = (),
    cache: ReadParts | None = None,
) -> Scene:
    """Return a scene from the tables of its file, if any, overridden by settings; SceneError as `load`.

    A shape may be beside the file. `cache`: parts of scenes of the same file, which are not read
    again.
    """
    try:
        if path:
            table = keep_former_share(_find_beside(table, path.parent))
        merged = merge_one_finger(table)
        return resolve(_override(merged, settings), path.stem if path else "", cache)
    except ParameterError as error:
        if settings:
            make_scene(path, table)  # reports an error of the file itself first
        key = split_key(f"{error.owner}.{error.field}")
        origins = [path.name if path.parent in SAMPLE_FOLDERS else str(path)] if path else []
        origins += [setting.option for setting in settings]
        for setting in settings:
            changed = split_key(setting.key)
            if key[-len(changed) :] == changed:
                origins.append(setting.option)
        raise SceneError(": ".join([*origins[-1:], str(error)])) from None


def read_table(path: Path) -> Record:
    """Return the tables of a TOML file."""
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise SceneError(
                f"{path} must have at most {LARGEST // 1_000_000} MB (got {size / 1e6:.0f} MB)."
            )
        text = path.read_text(encoding="utf-8-sig")
        return parse_tables(text)
    except OSError as error:
        raise SceneError(f"{path} cannot be read: {error.strerror or error}.") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{path} must be UTF-8 text (byte {error.start} is not).") from None
    except RecursionError:
        raise SceneError(f"{path}: lists or tables are nested too deeply.") from None
    except ValueError as error:
        rule, _, position = str(error).partition(" (at ")
        line = re.match(r"line (\d+)", position)
        number = line[1] if line else str(max(1, len(text.splitlines())))
        raise SceneError(f"{path}, line {number}: {rule}.") from None


def _find_beside(table: Table, folder: Path) -> Table:
    """Return the table with the paths of shapes' and bodies' files beside the scene file, or below."""
    bodies = table.get(BODIES)
    if isinstance(bodies, list):
        table = {**table, BODIES: [_place_file(body, folder) for body in bodies]}
    return {**table, "shape": _place_file(table["shape"], folder)} if "shape" in table else table


def _place_file(part: Any, folder: Path) -> Any:
    """Return a table whose file, if it is in the folder, has its whole path."""
    name = part.get("file") if isinstance(part, dict) else None
    if not isinstance(name, str) or not Path(name).suffix or "\0" in name:
        return part
    file = folder / name
    return {**part, "file": str(file.resolve())} if file.is_file() else part


def _override(table: Table, settings: Sequence[Setting]) -> Record:
    """Return the tables of a scene file, overridden by settings."""
    whole = dict(table)
    for key, text, _ in settings:
        keys, value = split_key(key), read_value(text)
        if keys[0] == FINGERS and len(keys) > 1 and FINGERS not in whole:
            rule = f"must begin with {', '.join(FINGER_SECTIONS[:-1])} or {FINGER_SECTIONS[-1]}"
            raise ParameterError(key, "", f"{rule}: the scene has one fingertip", text)
        fingers = whole.get(FINGERS) if keys[0] in FINGER_SECTIONS else None
        if isinstance(fingers, list) and all(isinstance(finger, dict) for finger in fingers):
            whole[FINGERS] = [_replace(finger, keys, value) for finger in fingers]
        else:
            whole = _replace(whole, keys, value)
    return whole


def split_key(key: str) -> list[str]:
    """Return the parts of a key; ``finger #2.contact`` is ``finger.2.contact``."""
    return key.replace(" #", ".").split(".")


def _replace(table: Any, keys: Sequence[str], value: Any, above: str = "") -> Any:
    """Return a table with a value at nested keys, in a list numbers from 1 on; `above`: outer keys."""
    if not keys:
        return value
    key, *rest = keys
    below = f"{above}{key}."
    if isinstance(table, list):
        if not (key.isascii() and key.isdecimal() and 0 < int(key) <= len(table)):
            rule = f"must be a number from 1 to {len(table)} here"
            raise ParameterError(below[:-1], "", rule, repr(key))
        changed = list(table)
        changed[int(key) - 1] = _replace(table[int(key) - 1], rest, value, below)
        return changed
    former = table if isinstance(table, dict) else {}
    return {**former, key: _replace(former.get(key), rest, value, below)}


@lru_cache(maxsize=1024)
def read_value(text: str) -> Any:
    """Return the value of a setting: TOML, or else a bare text."""
    try:
        read = parse_tables(f"value = {text}")
    except (ValueError, RecursionError):
        return text.strip()
    return read["value"] if len(read) == 1 else text.strip()
