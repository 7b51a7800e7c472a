"""Jobs of a JOBS file: scenes × methods × settings, each self-contained.

A job's folder has ``scene.toml``, all parameters of its session, and ``job.toml``, the
outputs of the run. With that folder and this package the job can run on any machine.
"""

import itertools
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..base.errors import ParameterError, SceneError, one_line
from ..base.quantity import Parameters, list_quantities
from ..control.methods import find_method
from ..files.run_folder import find_file, find_name, list_files, make_unique_names
from ..files.tables import Record, Table, format_value, read_part, refuse_unknown, show_value
from ..mesh_io.export_model import Model
from ..model.layout import make_grid
from ..scene.scene_source import SAMPLES, Setting, find, load, read_table
from ..scene.schema import Scene
from ..session.render_settings import Film, Still, Turntable
from ..shapes.fitting import fit_shape, pack

#: Pictures of a job, by their section.
PICTURES: dict[str, type[Parameters]] = {"still": Still, "turntable": Turntable, "film": Film}
#: Those that are rendered frame by frame after the run, to a file of this name with ``.mp4``.
MOVING = ("turntable", "film")
#: Sections of a job.toml: the mesh, and the pictures.
SECTIONS: dict[str, type[Parameters]] = {"mesh": Model, **PICTURES}
#: The keys of a job.toml.
KEYS = ("export", "errors", *SECTIONS)
#: Former names of keys, and their present ones.
FORMER = {"colour": "color"}


@dataclass(frozen=True)
class Outputs:
    """Outputs of a run."""

    #: Mesh formats.
    export: tuple[str, ...] = ()
    #: Whether the run's errors are estimated, which takes twice its time.
    errors: bool = True
    #: Mesh of the final surface in these formats.
    mesh: Model = field(default_factory=Model)
    #: Pictures; None: not wanted.
    still: Still | None = None
    turntable: Turntable | None = None
    film: Film | None = None

    @property
    def needs_blender(self) -> bool:
        """Whether any of it needs Blender."""
        return any(getattr(self, section) for section in PICTURES)

    def format(self) -> str:
        """Return a job.toml that reads back as an equal value."""
        lines = [
            "# What 'digiclay job' on this folder makes of the run of the scene.toml beside this file."
        ]
        lines += [
            f"export = {format_value(list(self.export))}",
            f"errors = {format_value(self.errors)}",
        ]
        for section in SECTIONS:
            part = getattr(self, section)
            if part is None:
                continue
            lines.append(f"\n[{section}]")
            for key, declared in list_quantities(part).items():
                note = f"{declared.unit}: {declared.doc}" if declared.unit else declared.doc
                lines.append(f"{key} = {format_value(getattr(part, key))}  # {note}")
        return "\n".join(lines) + "\n"


def make_outputs(table: Table) -> Outputs:
    """Read the outputs of each run from a table of `KEYS`."""
    refuse_unknown("", table, KEYS)
    export, errors = table.get("export", []), table.get("errors", True)
    _require(_is_texts(export), "export", 'must be a list of formats such as ["stl"]', export)
    _require(len(set(export)) == len(export), "export", "must not name a format twice", export)
    _require(isinstance(errors, bool), "errors", "must be true or false", errors)
    parts: Record = {}
    for section, kind in SECTIONS.items():
        if section not in table:
            continue
        given = table[section]
        _require(isinstance(given, dict), section, f"must be a section, [{section}]", given)
        named = {key if FORMER.get(key, key) in given else FORMER[key]: given[key] for key in given}
        parts[section] = read_part(section, kind, {}, named)
    return Outputs(tuple(export), errors, **parts)


def _require(holds: object, owner: str, rule: str, value: object) -> None:
    """Refuse a value that breaks a rule."""
    if not holds:
        raise ParameterError(owner, "", rule, "none" if value is None else show_value(value))


def _is_texts(value: Any) -> bool:
    """Return whether a value is a list of texts."""
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


#: The files of a job.
SCENE, JOB = "scene.toml", "job.toml"
#: Most jobs: more are a typing error.
MOST = 10_000
#: Folder of the sample batches.
BATCHES = SAMPLES.parent / "batches"
#: Keys that define the jobs; all others define their outputs.
WHICH = ("scenes", "methods", "settings")


@dataclass(frozen=True)
class Job:
    """One scene with one control method and one setting."""

    #: Of its folder.
    name: str
    #: None if the values are not compatible; `error` has the reason.
    scene: Scene | None
    error: str = ""


@dataclass(frozen=True)
class JobSeries:
    """Jobs of a JOBS file, and their outputs."""

    name: str
    jobs: tuple[Job, ...]
    outputs: Outputs


def read_jobs(path: Path, more: Sequence[str] = ()) -> JobSeries:
    """Read a JOBS file.

    Every scene is combined with every method and every setting. A combination of incompatible
    values makes a job with an error; a value that no job can have is refused.
    """
    table = read_table(path)
    try:
        refuse_unknown("", table, (*WHICH, *KEYS))
        outputs = make_outputs({key: table[key] for key in table if key not in WHICH})
        words = _read_scenes(table)
        methods = _read_methods(table, more)
        changes = _read_settings(table)
        count = len(words) * len(methods) * len(changes)
        if count > MOST:
            raise ParameterError("scenes", "", f"must come to {MOST} jobs at most", f"{count} jobs")
        files = [find_scene(path, word) for word in words]
        for file in files:
            load(file)  # reports an error of the file itself first
        _refuse_twice("scenes", words, [os.path.abspath(file) for file in files])
        _refuse_twice("methods", methods, methods)
        parts = list(itertools.product(files, methods, changes.items()))
        named = [(find_name(file, SCENE), method, label) for file, method, (label, _) in parts]
        names = make_unique_names(["-".join(filter(None, of_job)) for of_job in named])
        jobs = tuple(_make_job(name, *part) for name, part in zip(names, parts, strict=True))
    except ParameterError as error:
        raise SceneError(f"{path}: {error}") from None
    return JobSeries(find_name(path), jobs, outputs)


def find_jobs_file(word: str) -> Path:
    """Return a JOBS file: a sample's name, or a file. Raises SceneError when there is none."""
    return find_file(word, list_files(BATCHES, ".toml"), "sample batch")


def read_outputs(path: Path) -> Outputs:
    """Read a ``job.toml``; SceneError states its error in one line."""
    try:
        return make_outputs(read_table(path))
    except ParameterError as error:
        raise SceneError(f"{path}: {error}") from None


def _read_scenes(table: Table) -> list[str]:
    """Return the scenes of the file."""
    words: Any = table.get("scenes")
    rule = 'must be a list of scenes such as ["tap", "my.toml"]'
    _require(words and _is_texts(words) and all(words), "scenes", rule, words)
    return list(words)


def _read_methods(table: Table, more: Sequence[str]) -> list[str]:
    """Return the methods for every scene; an empty one is that of the scene."""
    if "methods" not in table:
        return list(more) or [""]
    methods = table["methods"]
    rule = 'must be a list such as ["virtual_master"]'
    _require(methods and isinstance(methods, list), "methods", rule, methods)
    for method in methods:
        find_method(method, "methods")
    return [*methods, *(name for name in more if name not in methods)]


def _read_settings(table: Table) -> dict[str, list[Setting]]:
    """Return the settings by their labels; by default one that changes nothing."""
    if "settings" not in table:
        return {"": []}
    given = table["settings"]
    rule = "must be a section of labels such as soft = { control.force_gain = 2 }"
    _require(given and isinstance(given, dict), "settings", rule, given)
    settings = {}
    for label, changes in given.items():
        option, rule = f"settings.{label}", "must be a table such as { control.force_gain = 2 }"
        _require(isinstance(changes, dict), option, rule, changes)
        rule = "must have labels of letters, digits and . + -"
        _require(re.fullmatch(r"\w[\w.+-]*", label), "settings", rule, label)
        settings[label] = [
            Setting(key, format_value(value), option) for key, value in _flatten(changes)
        ]
    return settings


def _flatten(table: Table, above: str = "") -> list[tuple[str, Any]]:
    """Return the dotted keys of nested tables, and their values."""
    pairs = []
    for key, value in table.items():
        dotted = f"{above}{key}"
        pairs += _flatten(value, f"{dotted}.") if isinstance(value, dict) else [(dotted, value)]
    return pairs


def find_scene(jobs: Path, word: str) -> Path:
    """Return the file of a scene: beside the JOBS file, or as `scene_source.find`."""
    beside = jobs.parent / word
    return find(str(beside)) if os.path.exists(beside) else find(word)


def _make_job(name: str, file: Path, method: str, setting: tuple[str, list[Setting]]) -> Job:
    """Make one job."""
    chosen = [Setting("control.method", format_value(method), "methods")] if method else []
    try:
        return Job(name, embed_heights(load(file, [*chosen, *setting[1]])))
    except (SceneError, ParameterError) as error:
        return Job(name, None, one_line(error))


def embed_heights(scene: Scene) -> Scene:
    """Return a scene with the heights of its shape in it, so that it needs no other file."""
    if scene.shape is None or scene.shape.heights:
        return scene
    fitted = fit_shape(scene.shape, make_grid(scene.layout), scene.actuator)
    return replace(scene, shape=replace(scene.shape, heights=pack(fitted.heights)))


def _refuse_twice(key: str, words: Sequence[str], meant: Sequence[str]) -> None:
    """Refuse a list in which two words mean the same, which would make the same jobs twice."""
    for number, meaning in enumerate(meant):
        if meaning in meant[:number]:
            raise ParameterError(
                key, "", "must not name the same thing twice", f"{words[number]} twice"
            )
