"""Texts of the user interface with values in them, in the language of Blender. No Blender in here."""

from collections.abc import Callable


def _keep(text: str) -> str:
    """Return a text as it is."""
    return text


_translate: Callable[[str], str] = _keep


def set_translator(translate: Callable[[str], str] = _keep) -> None:
    """Set the function by which `localize` translates."""
    global _translate
    _translate = translate


def localize(text: str, *values: object) -> str:
    """Return a text in the language of the interface, with values in its places."""
    translated = _translate(text)
    return translated.format(*values) if values else translated
