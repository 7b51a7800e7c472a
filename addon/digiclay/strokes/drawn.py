"""Strokes as they were drawn, a line of JSON each, without what is formed of them. No Blender."""

import json
from collections.abc import Callable
from dataclasses import astuple
from enum import Enum
from functools import partial
from typing import Any, TypeVar

import numpy as np

from ..core.base.errors import DigiclayError
from ..core.control.blister import Blister
from ..core.model.fingertip import Fingertip
from ..core.shapes.heightmap import make_height_map
from .falloff import Falloff
from .stroke import (
    COMBINATIONS,
    DEEPEST,
    SHALLOWEST,
    Brush,
    Combine,
    Image,
    Sample,
    Stroke,
)

Part = TypeVar("Part", Blister, Fingertip)
#: No stroke has a number as large, m or rad.
LARGEST = 1e3


def _read_limits(values: tuple[float, float]) -> tuple[float, float]:
    """Return the lowest and the highest height of a stroke; a ValueError tells that they are none."""
    low, high = map(float, values)
    if not low <= high:
        raise ValueError(values)
    return low, high


def _read_flag(value: Any) -> bool:
    """Return a flag; a ValueError tells that it is none."""
    if not isinstance(value, bool):
        raise ValueError(value)
    return value


def _read_part(kind: type[Part], values: list[Any]) -> Part:
    """Return a part of all its values; a ValueError tells that they are none."""
    return kind(**dict(zip(kind.__dataclass_fields__, values, strict=True)))


def _read_pins(values: Any) -> tuple[int, ...]:
    """Return numbers of pins; a ValueError tells that they are none."""
    pins = tuple(values)
    if not all(type(pin) is int and pin >= 0 for pin in pins):
        raise ValueError(values)
    return pins


#: Fields of a stroke that a line has where they are not those of older strokes, and their readers.
FIELDS: dict[str, Callable[[Any], Any]] = {
    "falloff": Falloff,
    "combine": Combine,
    "limits": _read_limits,
    "as_left": _read_flag,
    "finger": partial(_read_part, Fingertip),
    "blister": partial(_read_part, Blister),
    "pins": _read_pins,
}


def _write(value: Any) -> Any:
    """Return what JSON has for a value of a stroke: the word of a choice, the values of a part."""
    return value.value if isinstance(value, Enum) else astuple(value)


def dump(stroke: Stroke) -> str:
    """Return a stroke as a line whose numbers read back as the same ones."""
    samples = [astuple(sample) for sample in stroke.samples]
    stamp = stroke.stamp and (stroke.stamp.name, stroke.stamp.values.tolist())
    older, values = Stroke.__dataclass_fields__, {name: getattr(stroke, name) for name in FIELDS}
    more = {name: value for name, value in values.items() if value != older[name].default}
    parts = [
        stroke.brush,
        stroke.accumulate,
        stroke.images,
        samples,
        stamp,
        *([more] if more else []),
    ]
    return json.dumps(parts, default=_write)


def load(line: str) -> Stroke | None:
    """Return the stroke of a line, to be formed from its beginning; None for a line that is none."""
    try:
        brush, accumulate, images, samples, stamp, *rest = json.loads(line)
        more = {name: FIELDS[name](value) for name, value in dict(*rest).items()}
        path = tuple(Sample(x, y, depth, share, (a, b)) for x, y, depth, share, (a, b) in samples)
        turns = tuple(Image(*turn) for turn in images)
        sizes = np.abs(np.array([*map(np.hstack, map(astuple, path)), *turns], np.float64))
        depths = [sample.depth for sample in path]
        if not (sizes < LARGEST).all() or min(depths) < SHALLOWEST or max(depths) > DEEPEST:
            return None
        shape = None if stamp is None else make_height_map(str(stamp[0]), np.array(stamp[1]))
        stroke = Stroke(0, path, Brush(brush), turns, bool(accumulate), shape, held=False, **more)
    except (DigiclayError, ValueError, TypeError, LookupError, RecursionError):
        return None
    return stroke if stroke.combine in COMBINATIONS.get(stroke.brush, [Combine.USUAL]) else None
