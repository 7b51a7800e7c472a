"""Size, depth and strength of the Press tool."""

from typing import Any

import numpy as np

from ..compat import bpy
from ..core.model.fingertip import Fingertip
from ..core.surface.pointing import find_contact_outline
from ..live.stroke import DEEPEST, SHALLOWEST, Brush
from ..press import aim, brush
from ..settings import finger_size
from ..ui_text import localize
from .action import Action
from .radial import AdjustMixin, no_bed

#: Change of the depth, m, and of the strength, for a pixel at a UI scale of 1.
DEPTH_PIXEL, STRENGTH_PIXEL = 0.05e-3, 0.005


class AdjustSize(AdjustMixin, bpy.types.Operator):
    """Set the size of the fingertip: move the mouse sideways, or type a width"""

    bl_idname = "digiclay.press_size"
    bl_label = "Fingertip Size"
    bl_options = {"UNDO", "BLOCKING"}
    low, high, snap = finger_size.SMALLEST, finger_size.LARGEST, 1e-3

    def read(self, bed: Any, settings: Any) -> float:
        """Return the width of the fingertip, m."""
        return finger_size.read_size(bed.digiclay)

    def write(self, bed: Any, settings: Any, value: float) -> None:
        """Scale the fingertip; its blister follows."""
        finger_size.set_size(bed.digiclay, value)

    def rate(self, context: Any, bed: Any) -> float:
        """Return m a pixel at which the outline's side keeps up with the mouse."""
        points = self.center + 1e-3 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        middle, along, across = aim.project(context, bed, points)[:, 0]
        # Half the width on the screen of a circle of 1 mm about the place.
        pixels = float(np.hypot(along - middle, across - middle))
        return 2e-3 / pixels if np.isfinite(pixels) and pixels > 0.0 else 0.0

    def say(self, value: float) -> str:
        """Return the width in mm."""
        return localize("Size {:.2f} mm", 1e3 * value)

    def outlines(self, finger: Fingertip, turn: Any, depth: float, value: float) -> list[Any]:
        """Return the widest section of the finger, and what of it touches."""
        share = value / (2.0 * finger.width)
        scaled = Fingertip(finger.length * share, finger.width * share, finger.height * share)
        return [find_contact_outline(scaled, turn, np.inf), find_contact_outline(scaled, turn, depth)]


class AdjustDepth(AdjustMixin, bpy.types.Operator):
    """Set the depth, or the height of Raise: move the mouse sideways, or type it"""

    bl_idname = "digiclay.press_depth"
    bl_label = "Press Depth"
    bl_options = {"BLOCKING"}
    low, high, snap = SHALLOWEST, DEEPEST, 0.5e-3

    def read(self, bed: Any, settings: Any) -> float:
        """Return the depth, or height, of the tool's brush, m."""
        self.amount = brush.amount_name(Brush(settings.brush))
        return 1e-3 * float(getattr(settings, self.amount))

    def write(self, bed: Any, settings: Any, value: float) -> None:
        """Set the depth, or height, of the tool's brush."""
        setattr(settings, brush.amount_name(Brush(settings.brush)), 1e3 * value)

    def rate(self, context: Any, bed: Any) -> float:
        """Return m a pixel."""
        return DEPTH_PIXEL / float(context.preferences.system.ui_scale)

    def say(self, value: float) -> str:
        """Return the depth, or height, in mm."""
        return f"{self.amount.title()} {1e3 * value:.2f} mm"

    def outlines(self, finger: Fingertip, turn: Any, depth: float, value: float) -> list[Any]:
        """Return what of the finger touches at the depth."""
        return [find_contact_outline(finger, turn, value)]


class AdjustStrength(AdjustMixin, bpy.types.Operator):
    """Set the share of the depth that a stroke reaches: move the mouse sideways, or type it: 0.5, or 50 %"""

    bl_idname = "digiclay.press_strength"
    bl_label = "Press Strength"
    bl_options = {"BLOCKING"}
    low, high, snap = 0.01, 1.0, 0.1

    def read(self, bed: Any, settings: Any) -> float:
        """Return the tool's strength."""
        return float(settings.strength)

    def write(self, bed: Any, settings: Any, value: float) -> None:
        """Set the tool's strength."""
        settings.strength = value

    def parse(self, text: str) -> float:
        """Return the share typed: a number of per cent has their sign, or is above 1."""
        value = float(bpy.utils.units.to_value("NONE", "NONE", text.rstrip("% ")))
        return value / 100.0 if "%" in text or value > 1.0 else value

    def rate(self, context: Any, bed: Any) -> float:
        """Return the share a pixel."""
        return STRENGTH_PIXEL / float(context.preferences.system.ui_scale)

    def say(self, value: float) -> str:
        """Return the strength in per cent."""
        return localize("Strength {:.0f} %", 100.0 * value)

    def outlines(self, finger: Fingertip, turn: Any, depth: float, value: float) -> list[Any]:
        """Return what of the finger touches at the whole depth, and at the share of it."""
        return [find_contact_outline(finger, turn, depth), find_contact_outline(finger, turn, depth * value)]


class ScaleSize(Action, bpy.types.Operator):
    """Scale the fingertip; its blister follows"""

    bl_idname = "digiclay.press_scale"
    bl_label = "Scale Fingertip"
    bl_options = {"REGISTER", "UNDO"}

    scalar: bpy.props.FloatProperty(
        name="Factor", description="Factor of the size", default=1.1, min=0.1, max=10.0
    )

    @classmethod
    def poll_message(cls, context: Any) -> str:
        """A bed with a fingertip is needed."""
        return no_bed(context)

    def perform(self, context: Any) -> None:
        """Scale it."""
        bed: Any = brush.bed_in_use(context)
        settings = bed.digiclay
        finger_size.set_size(settings, finger_size.read_size(settings) * self.scalar)
