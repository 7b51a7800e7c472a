"""Texts of the user interface with values in them, in the language of Blender. No Blender in here."""

from collections.abc import Callable


def _keep(text: str, context: str | None) -> str:
    """Return a text as it is."""
    return text


#: Translates a text in a context; None: Blender's default one.
Translator = Callable[[str, str | None], str]
_translate: Translator = _keep


def set_translator(translate: Translator = _keep) -> None:
    """Set the function by which `localize` translates."""
    global _translate
    _translate = translate


def localize(text: str, *values: object, context: str | None = None) -> str:
    """Return a text of a context in the language of the interface, with values in its places."""
    translated = _translate(text, context)
    return translated.format(*values) if values else translated
