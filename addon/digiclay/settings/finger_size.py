"""Size of a bed's fingertip, and of the blister that follows it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from .. import bridge
from ..core.base.errors import DigiclayError
from ..core.control.blister import Blister
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Layout
from ..roles import fingertip_of
from .declared import assign, read
from .devices import LENGTHS, fit_blister, scale_blister
from .shown_units import SHOWN, to_si

#: Least and largest size, m: narrower than that a fingertip falls between pins, wider than that no hand is.
SMALLEST, LARGEST = 1e-3, 0.2


def read_finger(settings: Any) -> Fingertip:
    """Return the fingertip of a bed's settings."""
    return Fingertip(**read(settings.fingertip, Fingertip, {}, "fingertip"))


def read_size(settings: Any) -> float:
    """Return the size of the fingertip of a bed's settings: how wide it is, m."""
    return 2.0 * read_finger(settings).width


def set_axis(settings: Any, name: str, size: float) -> None:
    """Give a bed's fingertip another length, width or height, mm; the other two stay."""
    half = 0.5 * to_si(size, SHOWN["m"][1])
    resize(settings, replace(read_finger(settings), **{name: half}))


def set_size(settings: Any, size: float) -> None:
    """Make a bed's fingertip as wide as a size, m, in the same proportions; within what a finger can have."""
    finger = read_finger(settings)
    share = min(max(size, SMALLEST), LARGEST) / (2.0 * finger.width)
    resize(settings, Fingertip(finger.length * share, finger.width * share, finger.height * share))


def resize(settings: Any, finger: Fingertip) -> None:
    """Give a bed's fingertip another size; its lowest point stays, its blister follows, if that is on."""
    before, tip = read_finger(settings), fingertip_of(settings.id_data)
    lowest = _pose(tip)
    for name in ("length", "width", "height"):
        assign(settings.fingertip, Fingertip, name, getattr(finger, name))
    if tip is not None and lowest is not None:
        bridge.place_fingertip(tip, lowest, read_finger(settings))
    if settings.blister_follows and finger.width != before.width:
        _scale_blister(settings, before, finger)


def _pose(tip: Any) -> Any | None:
    """Return the pose of a fingertip; None where there is none, or it has no meaning."""
    try:
        return None if tip is None or tip.parent is None else bridge.pose(tip)
    except DigiclayError:
        return None


def _scale_blister(settings: Any, before: Fingertip, after: Fingertip) -> None:
    """Scale the blister with the width of the fingertip, no wider than the bed."""
    # One that the bed has limited remembers the width of the fingertip that it suits, so that a palm and then
    # a fingertip again leave it as it was.
    blister = Blister(**read(settings.blister, Blister, {}, "blister"))
    layout = Layout(**read(settings.layout, Layout, {}, "layout"))
    limited = settings.blister_suits > 0.0 and fit_blister(
        scale_blister(blister, 1.01), layout
    ).radius < 1.001 * (blister.radius)
    suited = 1e-3 * settings.blister_suits if limited else before.width
    wanted = scale_blister(blister, after.width / suited)
    fitted = fit_blister(wanted, layout)
    settings.blister_suits = 1e3 * after.width * fitted.radius / wanted.radius if fitted != wanted else 0.0
    for name in LENGTHS:
        assign(settings.blister, Blister, name, getattr(fitted, name))
