"""Texts of the user interface with values in them, in the language of Blender. No Blender in here."""

from __future__ import annotations

from collections.abc import Callable


def _keep(text: str) -> str:
    """Return a text as it is."""
    return text


_translate: Callable[[str], str] = _keep


def set_translator(translate: Callable[[str], str] = _keep) -> None:
    """Set the function by which `localize` translates.

    `translate`: from a text in English to one in the language of the interface; English when left out.
    """
    global _translate
    _translate = translate


def localize(text: str, *values: object) -> str:
    """Return a text in the language of the interface, with values in its places.

    `text`: English, with places as for `str.format`; the section *messages* of the catalogs has it.
    """
    translated = _translate(text)
    return translated.format(*values) if values else translated
