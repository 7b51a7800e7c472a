"""What varies in a sweep, and how, as a line of text says it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .errors import ParameterError

__all__ = ["MOST", "Axis", "axis"]

#: More points than this are refused: a slip of the keyboard, not a sweep.
MOST = 10_000
SYNTAX = "must be KEY=START:STOP:COUNT, KEY=START:STOP:COUNT:log or KEY=A,B,C"


@dataclass(frozen=True)
class Axis:
    """One parameter that varies.

    Attributes
    ----------
    key : str
        Section and key, ``control.force_gain``.
    words : tuple of str
        Its values as a scene file would say them.
    logarithmic : bool
        Whether they are evenly spaced on a logarithmic scale.
    """

    key: str
    words: tuple[str, ...]
    logarithmic: bool = False


def axis(said: str) -> Axis:
    """Read what varies, and how: ``control.force_gain=1:10:10``.

    Raises
    ------
    ParameterError
        In one line: key, rule, value.
    """
    key, _, values = (part.strip() for part in said.partition("="))
    if not key or not values:
        raise ParameterError("--vary", "", SYNTAX, repr(said))
    owner, ends = f"--vary {key}", [part.strip() for part in values.split(":")]
    if len(ends) > 1:
        return _range(key, owner, ends, values)
    words = tuple(word.strip() for word in values.split(","))
    if not all(words):
        raise ParameterError(owner, "", "must have a value between commas", repr(values))
    if len(set(words)) < len(words):
        raise ParameterError(owner, "", "must not name a value twice", repr(values))
    return Axis(key, words)


def _range(key: str, owner: str, ends: list[str], said: str) -> Axis:
    """Read START:STOP:COUNT and its logarithmic kind."""

    def refused(rule: str) -> ParameterError:
        return ParameterError(owner, "", rule, repr(said))

    logarithmic = ends[3:] == ["log"]
    if len(ends) != 3 and not logarithmic:
        raise refused("must be START:STOP:COUNT or START:STOP:COUNT:log")
    (low, _, unit), (high, _, other) = (end.partition(" ") for end in ends[:2])
    if unit != other:
        raise refused("must have the same unit at START and STOP")
    try:
        start, stop = float(low), float(high)
    except ValueError:
        raise refused("must have a number at START and STOP") from None
    if not (math.isfinite(start) and math.isfinite(stop)) or start == stop:
        raise refused("must have two different finite numbers at START and STOP")
    if logarithmic and not (start > 0.0 and stop > 0.0):
        raise refused("must have numbers above 0 at START and STOP for a logarithmic scale")
    if not ends[2].isdecimal() or not 2 <= int(ends[2]) <= MOST:
        raise refused(f"must have a whole number from 2 to {MOST} at COUNT")
    spaced = (np.geomspace if logarithmic else np.linspace)(start, stop, int(ends[2])).tolist()
    # Twelve digits: 0.3, and not 0.30000000000000004.
    inner = [f"{value:.12g}" for value in spaced[1:-1]]
    words = [f"{number} {unit}".strip() for number in (low, *inner, high)]
    return Axis(key, tuple(words), logarithmic)
