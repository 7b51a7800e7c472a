"""Palettes of the modes: three sets, distinct for any color vision."""

from __future__ import annotations

from ..bridge import linear, srgb
from ..compat import bpy, shader_nodes
from ..core.base.modes import COLORS, Mode
from ..roles import ROLE

Color = tuple[float, float, float]


def _hex(code: str) -> Color:
    """Return the sRGB of a color code."""
    red, green, blue = (int(code[at : at + 2], 16) / 255 for at in (0, 2, 4))
    return red, green, blue


def _palette(*codes: str) -> dict[Mode, Color]:
    """Return color codes in the order of the modes."""
    return {mode: _hex(code) for mode, code in zip(Mode, codes, strict=True)}


DEFAULT = "okabe_ito"
#: sRGB of each mode.
PALETTES: dict[str, dict[Mode, Color]] = {
    "okabe_ito": COLORS,
    "tol_muted": _palette(
        "dddddd", "332288", "ddcc77", "88ccee", "cc6677", "882255", "aa4499", "117733", "222222"
    ),
    "brightness": _palette(
        "ffffff", "252525", "d7d7d7", "aeaeae", "888888", "000000", "656565", "454545", "151515"
    ),
}
WORDS = {
    "okabe_ito": ("Okabe and Ito", "Eight clear colors, told apart with any kind of color vision"),
    "tol_muted": ("Tol, muted", "Paul Tol's quieter set, told apart with any kind of color vision"),
    "brightness": ("Brightness", "Shades of gray, for vision or print without colors"),
}


def has_palette() -> bool:
    """Return whether the open file has materials of the modes already, which may be the user's own by now."""
    return any(_material(mode) is not None for mode in Mode)


def color_of(mode: Mode) -> Color:
    """Return the sRGB a mode has in the open file: that of its material, which may be the user's own."""
    material = _material(mode)
    return COLORS[mode] if material is None else srgb(material.diffuse_color)


def set_palette(name: str) -> None:
    """Give the materials of the modes in the open file the colors of a palette."""
    for mode, color in PALETTES[name].items():
        material = _material(mode)
        if material is None:
            continue
        material.diffuse_color = linear(color)
        for node in shader_nodes(material).nodes:
            if node.type == "BSDF_PRINCIPLED":
                node.inputs["Base Color"].default_value = linear(color)


def _material(mode: Mode) -> bpy.types.Material | None:
    """Return the material of a mode, when the file has one of its own."""
    role = mode.name.lower()
    return next((item for item in bpy.data.materials if item.get(ROLE) == role and not item.library), None)
