"""Axes of OBJ files, which name none: those of Blender unless a comment or an option says otherwise."""

from __future__ import annotations

import re

import numpy as np

from ..base.arrays import Floats
from ..base.errors import ParameterError

AXES = ("x", "y", "z", "-x", "-y", "-z")
#: Upward axis of Blender's exporter and importer; the forward one to it is -z.
UP = "y"
#: Forward axes, the bed's y, where they are not y: x stays x if it can.
FORWARD = {"y": "-z", "-y": "z", "-z": "-y"}
COMMENT = re.compile(rb"^#[^\n]*?(?<![\w-])(-?[xyz]) up\b(?:, (-?[xyz]) forward)?", re.MULTILINE)
#: Comments are looked for in so many bytes.
HEAD = 4096


def find_forward(up: str) -> str:
    """Return the usual forward axis of an upward one."""
    return FORWARD.get(up, "y")


def make_axes(up: str, forward: str = "") -> Floats:
    """Return the bed's x, y and z in a file's axes, (3, 3): its vertices times it are those of the file."""
    forward = forward or find_forward(up)
    for name, value in (("up", up), ("forward", forward)):
        if value not in AXES:
            raise ParameterError("Export", name, f"must be one of {', '.join(AXES)}", repr(value))
    ahead, above = (
        np.eye(3)[AXES.index(one) % 3] * (-1.0 if one[0] == "-" else 1.0) for one in (forward, up)
    )
    if forward[-1] == up[-1]:
        raise ParameterError("Export", "forward", f"must be another axis than up, {up}", forward)
    return np.stack([np.cross(ahead, above), ahead, above])


def find_axes(data: bytes) -> tuple[str, str]:
    """Return the upward and the forward axis that a comment of an OBJ file tells, such as ``# z up``."""
    found = COMMENT.search(data[:HEAD])
    up, forward = (b"", b"") if found is None else (found[1], found[2] or b"")
    return up.decode() or UP, forward.decode()
