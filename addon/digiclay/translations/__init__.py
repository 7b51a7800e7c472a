"""Translations of labels and tooltips: a catalog a language, registered with Blender."""

import inspect
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from .. import operators, panels, preferences, ui_text
from ..compat import bpy, bpy_struct
from ..core.scene.toml_table import PRESETS
from ..panels import display
from ..press.brush import CONTEXT as BRUSH
from ..press.tool import PressTool
from ..settings import groups
from ..settings.declared import title

#: Beginning of the names of the extension's modules.
EXTENSION = __package__.rpartition(".")[0]
#: Languages that have a catalog.
LANGUAGES = ("de",)
#: Contexts in which Blender looks up a text: labels of operators and of brushes have their own.
CONTEXTS = ("*", "Operator", BRUSH)


@cache
def _catalog(language: str) -> dict[str, dict[str, str]]:
    """Read the catalog of a language: sections of texts with their translations."""
    path = Path(__file__).with_name(f"{language}.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


@cache
def translate(text: str, language: str) -> str | None:
    """Return the translation of a label or a tooltip, or None where the catalog has none."""
    # A unit in brackets, and what a tooltip adds of a parameter, stay what they are.
    catalog = _catalog(language)
    for section in ("labels", "tooltips", "parameters", "messages"):
        if text in catalog[section]:
            return catalog[section][text]
    label, bracket, unit = text.rpartition(" (")
    if bracket and label in catalog["labels"]:
        return f"{catalog['labels'][label]} ({unit}"
    parts = text.split("; ")
    for count in range(len(parts) - 1, 0, -1):
        meaning = catalog["parameters"].get("; ".join(parts[:count]))
        details = [_translate_detail(part, catalog["details"]) for part in parts[count:]]
        if meaning is not None and None not in details:
            return "; ".join([meaning, *filter(None, details)])
    return None


def _translate_detail(part: str, words: dict[str, str]) -> str | None:
    """Return the translation of a part such as ``at least 3 mm``."""
    word = next((word for word in words if part.startswith(f"{word} ")), None)
    return None if word is None else words[word] + part[len(word) :]


def collect_strings() -> set[str]:
    """Return labels and tooltips of all that is registered: of classes, their properties and enum items."""
    owners = (
        *operators.CLASSES,
        *panels.CLASSES,
        *groups.CLASSES,
        preferences.Preferences,
        display.Display,
    )
    texts = {title(name) for name in PRESETS} | {PressTool.bl_label}
    for owner in owners:
        texts.add(getattr(owner, "bl_label", ""))
        if issubclass(owner, bpy.types.Operator):
            texts.add(inspect.cleandoc(owner.__doc__ or ""))
        texts.update(_property_strings(owner))
    return texts - {""}


def _property_strings(owner: type[bpy_struct]) -> Iterator[str]:
    """Yield labels and tooltips of the properties that a class or a mixin of it declares, and shows."""
    if issubclass(owner, bpy.types.Menu | bpy.types.Panel):
        # Annotations of these are Blender's own.
        return
    kinds = [kind for kind in owner.__mro__ if kind.__module__.startswith(EXTENSION)]
    declared = {name for kind in kinds for name in inspect.get_annotations(kind)}
    described: bpy_struct | None = getattr(owner, "bl_rna", None)
    if issubclass(owner, bpy.types.Operator):  # its class does not list them
        area, _, name = owner.bl_idname.partition(".")
        described = getattr(getattr(bpy.ops, area), name).get_rna_type()
    for shown in described.properties if described is not None else ():
        if (
            shown.identifier not in declared
            or shown.identifier.startswith(("bl_", "menu_"))
            or shown.is_hidden
        ):
            continue
        yield from (shown.name, shown.description)
        for item in shown.enum_items if shown.type == "ENUM" else ():
            yield from (item.name, item.description)


def make_entries(texts: Iterable[str], language: str) -> dict[tuple[str, str], str]:
    """Return the entries that Blender takes, by context and text. `language`: one of `LANGUAGES`."""
    translated = {text: translate(text, language) for text in texts}
    shown = _catalog(language)["brushes"].items()
    brushes = {(BRUSH, text): words for text, words in shown if text in translated}
    labels = {text: words for text, words in translated.items() if words}
    entries = {(context, text): words for text, words in labels.items() for context in CONTEXTS}
    return entries | brushes


def register() -> None:
    """Register the catalogs; Blender names a language alone, or with a country."""
    texts = collect_strings().union(*(_catalog(language)["messages"] for language in LANGUAGES))
    catalogs: dict[str, dict[tuple[str, str], str]] = {}
    for language in LANGUAGES:
        entries = make_entries(texts, language)
        catalogs |= dict.fromkeys((language, f"{language}_{language.upper()}"), entries)
    bpy.app.translations.register(__package__, catalogs)
    ui_text.set_translator(bpy.app.translations.pgettext_iface)


def unregister() -> None:
    """Undo `register`."""
    ui_text.set_translator()
    bpy.app.translations.unregister(__package__)
