"""Palettes of the modes: three sets, distinct for any color vision."""

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


#: sRGB of the skin; and the share of a mode's color in its tint.
CLAY, SHARE = (0.76, 0.70, 0.63), 0.2
#: Modes over which the skin is plain clay: nothing moves these pins.
PLAIN = (Mode.REST, Mode.HOLD)
#: Beginning of the roles of the skin's materials over pins of the other modes.
TINTED = "skin_"
#: sRGB of fingertips by number, again from the first on after the last: no two alike for any color
#: vision.
FINGERS: tuple[Color, ...] = tuple(
    _hex(code)
    for code in (
        "ea9580",
        "9500ff",
        "d4d400",
        "aaeaff",
        "aa4055",
        "2a6aaa",
        "ffffaa",
        "9580ea",
        "aa8000",
        "6abfd4",
    )
)
DEFAULT = "okabe_ito"
#: sRGB of each mode.
PALETTES: dict[str, dict[Mode, Color]] = {
    "okabe_ito": COLORS,
    "tol_muted": _palette(
        "dddddd", "332288", "ddcc77", "88ccee", "cc6677", "882255", "aa4499", "117733", "222222"
    ),
    "brightness": _palette(
        "ffffff", "3b3b3b", "dbdbdb", "b9b9b9", "979797", "000000", "777777", "585858", "212121"
    ),
}
WORDS = {
    "okabe_ito": ("Okabe and Ito", "Clear colors, told apart with any kind of color vision"),
    "tol_muted": ("Tol, muted", "Paul Tol's quieter set, told apart with any kind of color vision"),
    "brightness": ("Brightness", "Shades of gray, for vision or print without colors"),
}


def finger_color(number: int) -> Color:
    """Return the color of a fingertip by its number, from 1 on."""
    return FINGERS[(number - 1) % len(FINGERS)]


def has_palette() -> bool:
    """Return whether the open file has materials of the modes already, which may be the user's own by now."""
    return any(_material(mode) is not None for mode in Mode)


def color_of(mode: Mode) -> Color:
    """Return the sRGB a mode has in the open file: that of its material, which may be the user's own."""
    material = _material(mode)
    return COLORS[mode] if material is None else srgb(material.diffuse_color)


def mix_tint(color: Color) -> Color:
    """Return the color of the skin with a tint of another."""
    red, green, blue = (
        clay + SHARE * (other - clay) for clay, other in zip(CLAY, color, strict=True)
    )
    return red, green, blue


def set_palette(name: str) -> None:
    """Give the materials of the modes, and of the skin, in the open file the colors of a palette."""
    for mode, color in PALETTES[name].items():
        _recolor(_material(mode), color)
        _recolor(_material(mode, TINTED), mix_tint(color))


def _recolor(material: bpy.types.Material | None, color: Color) -> None:
    """Give a material, where there is one, a color."""
    if material is not None:
        material.diffuse_color = linear(color)
        for node in shader_nodes(material).nodes:
            if node.type == "BSDF_PRINCIPLED":
                node.inputs["Base Color"].default_value = linear(color)


def _material(mode: Mode, of: str = "") -> bpy.types.Material | None:
    """Return the material of a mode, or of the skin over it, when the file has one of its own."""
    role = of + mode.name.lower()
    return next(
        (item for item in bpy.data.materials if item.get(ROLE) == role and not item.library), None
    )
