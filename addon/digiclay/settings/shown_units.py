"""Conversion between SI and display units: mm, ms, bar."""

import math
import re
from decimal import Decimal

#: The unit shown for an SI unit, and the power of ten between them: 1 m is 10³ mm.
SHOWN: dict[str, tuple[str, int]] = {
    "m": ("mm", 3),
    "s": ("ms", 3),
    "Pa": ("bar", -5),
    "m/s": ("mm/s", 3),
    "m/s2": ("m/s²", 0),
    "1/m": ("1/mm", -3),
    "m3": ("mm³", 9),
    "m2/s": ("mm²/s", 6),
    "kg/m3": ("kg/m³", 0),
    "N s/m": ("N·s/m", 0),
    "kg": ("g", 3),
}
#: A time whose default is as long as this is shown in s, s.
LONG = 1.0
#: Significant digits of a number Blender has kept in 32 bits.
DIGITS = 7

_MEASURED = re.compile(r"(?<![\w.])([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?) (m/s|m2/s|1/m|m|Pa)(?![\w/])")


def unit_of(unit: str, default: object) -> tuple[str, int]:
    """Return the unit a parameter is shown in, and its power of ten per SI unit."""
    if unit == "s" and isinstance(default, float) and (default == 0.0 or default >= LONG):
        return "s", 0
    return SHOWN.get(unit, (unit, 0))


def to_shown(value: float, power: int) -> float:
    """Return an SI value in the unit it is shown in, free of the noise of a product: 0.003 m is 3 mm."""
    return float(Decimal(repr(value)).scaleb(power))


def to_si(value: float, power: int) -> float:
    """Return the SI value of a number kept by Blender in 32 bits."""
    # The number is taken at the seven digits it was meant with: 0.3 mm, kept as 0.300000012, is
    # 0.0003 m. Whatever is not finite is handed on, for the part's own rules to refuse.
    if not math.isfinite(value):
        return value
    return float(Decimal(f"{value:.{DIGITS}g}").scaleb(-power))


def convert_units(text: str) -> str:
    """Return a message with its lengths, speeds and pressures in the units a person reads."""

    def converted(match: re.Match[str]) -> str:
        name, power = SHOWN[match[2]]
        return f"{to_shown(float(match[1]), power):g} {name}"

    return _MEASURED.sub(converted, text)
