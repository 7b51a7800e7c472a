"""Strokes as they were drawn, a line of JSON each, without what is formed of them. No Blender."""

import json
from dataclasses import astuple

import numpy as np

from ..core.base.errors import DigiclayError
from ..core.shapes.heightmap import make_height_map
from .falloff import Falloff
from .stroke import DEEPEST, SHALLOWEST, Brush, Image, Sample, Stroke

#: No stroke has a number as large, m or rad.
LARGEST = 1e3


def dump(stroke: Stroke) -> str:
    """Return a stroke as a line whose numbers read back as the same ones."""
    samples = [astuple(sample) for sample in stroke.samples]
    stamp = stroke.stamp and (stroke.stamp.name, stroke.stamp.values.tolist())
    # What differs from strokes of older files.
    more = {} if stroke.falloff is Falloff.DEVICE else {"falloff": stroke.falloff.value}
    first = [stroke.brush.value, stroke.accumulate, stroke.images, samples, stamp]
    return json.dumps([*first, more] if more else first)


def load(line: str) -> Stroke | None:
    """Return the stroke of a line, to be formed from its beginning; None for a line that is none."""
    try:
        brush, accumulate, images, samples, stamp, *more = json.loads(line)
        falloff = Falloff(dict(*more).get("falloff", Falloff.DEVICE))
        path = tuple(Sample(x, y, depth, share, (a, b)) for x, y, depth, share, (a, b) in samples)
        turns = tuple(Image(*turn) for turn in images)
        sizes = np.abs(np.array([*map(np.hstack, map(astuple, path)), *turns], np.float64))
        depths = [sample.depth for sample in path]
        if not (sizes < LARGEST).all() or min(depths) < SHALLOWEST or max(depths) > DEEPEST:
            return None
        shape = None if stamp is None else make_height_map(str(stamp[0]), np.array(stamp[1]))
        return Stroke(0, path, Brush(brush), turns, bool(accumulate), shape, falloff, held=False)
    except (DigiclayError, ValueError, TypeError, IndexError, RecursionError):
        return None
