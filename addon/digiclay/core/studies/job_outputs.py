"""Outputs of a job's run: exports, stills, turntables and films; as a value, a table and a text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ..base.errors import ParameterError
from ..base.part_table import read_part, refuse_unknown, show_value
from ..base.quantity import Parameters, list_quantities
from ..base.toml_text import format_value
from ..mesh_io.export_model import Model
from ..session.render_settings import Film, Still, Turntable

#: Pictures a job can leave, by their section.
PICTURES: dict[str, type[Parameters]] = {"still": Still, "turntable": Turntable, "film": Film}
#: Those that can be drawn frame by frame after the run; each is the file of its name with ``.mp4``.
MOVING = ("turntable", "film")
#: Sections of a job.toml: what is exported, and the pictures.
SECTIONS: dict[str, type[Parameters]] = {"mesh": Model, **PICTURES}
#: The keys of a job.toml.
KEYS = ("export", "errors", *SECTIONS)
#: Keys of pictures in older files, and what they are called now.
FORMER = {"colour": "color"}


@dataclass(frozen=True)
class Outputs:
    """Outputs of a run.

    Attributes
    ----------
    export : tuple of str
        Mesh formats.
    mesh : Model
        What is made of the final surface in these formats.
    errors : bool
        Whether the run's errors are estimated, which takes twice its time.
    still, turntable, film
        Pictures, where they are wanted.
    """

    export: tuple[str, ...] = ()
    errors: bool = True
    mesh: Model = field(default_factory=Model)
    still: Still | None = None
    turntable: Turntable | None = None
    film: Film | None = None

    @property
    def needs_blender(self) -> bool:
        """Whether any of it needs Blender."""
        return any(getattr(self, section) for section in PICTURES)

    def format(self) -> str:
        """Return a job.toml that reads back as an equal value."""
        lines = ["# What 'digiclay job' on this folder makes of the run of the scene.toml beside this file."]
        lines += [f"export = {format_value(list(self.export))}", f"errors = {format_value(self.errors)}"]
        for section in SECTIONS:
            part = getattr(self, section)
            if part is None:
                continue
            lines.append(f"\n[{section}]")
            for key, known in list_quantities(part).items():
                note = f"{known.unit}: {known.doc}" if known.unit else known.doc
                lines.append(f"{key} = {format_value(getattr(part, key))}  # {note}")
        return "\n".join(lines) + "\n"


def make_outputs(table: Mapping[str, Any]) -> Outputs:
    """Read what is made of each run from a table of `KEYS`.

    Raises ParameterError: its owner is the section.
    """
    refuse_unknown("", table, KEYS)
    export = table.get("export", [])
    if not isinstance(export, list) or not all(isinstance(kind, str) for kind in export):
        raise ParameterError("export", "", 'must be a list of formats such as ["stl"]', show_value(export))
    if len(set(export)) < len(export):
        raise ParameterError("export", "", "must not name a format twice", show_value(export))
    errors = table.get("errors", True)
    if not isinstance(errors, bool):
        raise ParameterError("errors", "", "must be true or false", show_value(errors))
    parts: dict[str, Any] = {}
    for section, kind in SECTIONS.items():
        if section not in table:
            continue
        own = table[section]
        if not isinstance(own, dict):
            raise ParameterError(section, "", f"must be a section, [{section}]", show_value(own))
        named: dict[str, Any] = {}
        for key, value in own.items():
            named[key if FORMER.get(key, key) in own else FORMER[key]] = value
        parts[section] = read_part(section, kind, {}, named)
    return Outputs(tuple(export), errors, **parts)
