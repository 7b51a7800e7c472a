"""Ranges of varied parameters: their text form, and values at a share of a range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from digiclay.core.base.errors import ParameterError
from digiclay.core.base.quantity import UNITS, Parameters, list_quantities
from digiclay.core.scene.scene_source import Setting, load
from digiclay.core.scene.schema import Scene

SYNTAX = "must be KEY=LOW:HIGH, KEY=LOW:HIGH:log or KEY=A,B,C"
#: Digits of a value: 0.3, and not 0.30000000000000004.
DIGITS = 12


@dataclass(frozen=True)
class Range:
    """Range of one varied parameter.

    Attributes
    ----------
    key : str
        Section and key, ``control.force_gain``.
    low, high : float
        Ends, in `unit`.
    unit : str
        As written behind the numbers; empty: SI.
    logarithmic : bool
        Whether equal shares are equal ratios.
    words : tuple of str
        Choices in place of a range.
    whole : bool
        Whether values are whole numbers.
    si : str
        SI unit of the parameter.
    factor : float
        From `unit` to it.
    """

    key: str
    low: float = 0.0
    high: float = 1.0
    unit: str = ""
    logarithmic: bool = False
    words: tuple[str, ...] = ()
    whole: bool = False
    si: str = ""
    factor: float = 1.0

    def find_word(self, share: float) -> str:
        """Return the value at a share from 0 to 1 of the range, as a scene file would say it."""
        if self.words:
            return self.words[min(int(share * len(self.words)), len(self.words) - 1)]
        high = self.high + 1.0 if self.whole else self.high
        if self.logarithmic:
            value = self.low * (high / self.low) ** share
        else:
            value = self.low + share * (high - self.low)
        if self.whole:
            return str(min(math.floor(value), int(self.high)))
        value = float(f"{value:.{DIGITS}g}")
        return f"{min(max(value, self.low), self.high)!r} {self.unit}".strip()

    def convert(self, word: str) -> float | str:
        """Return a value of the range in SI; a choice as it is."""
        if self.words or self.whole:
            return int(word) if self.whole else word
        return float(word.partition(" ")[0]) * self.factor

    def __str__(self) -> str:
        if self.words:
            return ", ".join(self.words)
        scale = ", log" if self.logarithmic else ""
        return f"{self.low:.{DIGITS}g} to {self.high:.{DIGITS}g} {self.unit}".strip() + scale


def read_range(said: str) -> Range:
    """Read a varied parameter and its range: ``control.force_gain=0.5:8:log``.

    Raises ParameterError: in one line: key, rule, value.
    """
    key, _, values = (part.strip() for part in said.partition("="))
    if not key or not values:
        raise ParameterError("--vary", "", SYNTAX, repr(said))

    def refusal(rule: str) -> ParameterError:
        return ParameterError(f"--vary {key}", "", rule, repr(values))

    ends = [part.strip() for part in values.split(":")]
    if len(ends) == 1:
        words = tuple(word.strip() for word in values.split(","))
        if not all(words) or len(set(words)) < max(len(words), 2):
            raise refusal("must be LOW:HIGH, LOW:HIGH:log or at least two different values A,B")
        return Range(key, words=words)
    logarithmic = ends[2:] == ["log"]
    if len(ends) != 2 and not logarithmic:
        raise refusal("must be LOW:HIGH or LOW:HIGH:log, without a count")
    (low, _, unit), (high, _, other) = (end.partition(" ") for end in ends[:2])
    if unit.strip() != other.strip():
        raise refusal("must have the same unit at LOW and HIGH")
    try:
        start, stop = float(low), float(high)
    except ValueError:
        raise refusal("must have a number at LOW and HIGH") from None
    if not (math.isfinite(start) and math.isfinite(stop)):
        raise refusal("must have finite numbers at LOW and HIGH")
    if not start < stop:
        raise refusal("must have LOW below HIGH")
    if logarithmic and not start > 0.0:
        raise refusal("must have numbers above 0 at LOW and HIGH for a logarithmic scale")
    return Range(key, start, stop, unit.strip(), logarithmic)


def fit_ranges(ranges: Sequence[Range], path: Path, settings: Sequence[Setting]) -> list[Range]:
    """Return ranges as the scene's parameters have them: whole numbers, and units.

    `path`: the scene's file; `settings`: what is changed of it at every point. Raises ParameterError,
    SceneError: in one line, where a parameter is unknown, given twice, or cannot have the ends of its range.
    """
    scene = load(path, settings)
    keys = [one.key for one in ranges]
    for key in keys:
        if keys.count(key) > 1:
            raise ParameterError(f"--vary {key}", "", "must be given once", f"{keys.count(key)} times")
        for setting in settings:
            if setting.key == key:
                raise ParameterError(
                    f"--vary {key}", "", f"must not be given to {setting.option} as well", key
                )
    return [_fit(one, scene, path, settings) for one in ranges]


def _fit(one: Range, scene: Scene, path: Path, settings: Sequence[Setting]) -> Range:
    """Return a range as the scene's parameter has it."""
    section, _, name = one.key.partition(".")
    part = scene.section(section) if name else None
    known = list_quantities(part).get(name) if isinstance(part, Parameters) else None
    if known is None or one.words:  # an unknown key, or a word: the scene file's own rules tell
        for word in one.words or (one.find_word(0.0),):
            load(path, [*settings, Setting(one.key, word, "--vary")])
        return one
    factor, measured = UNITS.get(one.unit, (0.0, "")) if one.unit else (1.0, known.unit)
    value = getattr(part, name)
    whole = isinstance(value, int) and not isinstance(value, bool)
    for end in (one.low, one.high):
        rule = known.broken_rule(end * factor)
        if measured != known.unit:
            rule = f"must be in {known.unit or 'no unit'} or a multiple of it"
        elif whole and end != int(end):
            rule = "must have whole numbers at LOW and HIGH"
        elif not isinstance(value, (int, float)) or isinstance(value, bool):
            rule = "must have words as its values: A,B"
        if rule:
            raise ParameterError(f"--vary {one.key}", "", rule, f"{end:g} {one.unit}".strip())
    return replace(one, whole=whole, si=known.unit, factor=factor)
