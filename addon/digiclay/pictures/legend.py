"""Legend and force plot of a picture, on planes in front of the device."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .. import bridge
from ..bridge import linear
from ..compat import Material, Object, Scene, bpy, shader_nodes
from ..core.base.arrays import Floats
from ..core.base.modes import MEANINGS, WAITING, WAITS, Mode
from ..device import heat, palettes, primitives

Color = tuple[float, float, float]

#: sRGB of letters, and of what is less important.
INK, FADED = (0.10, 0.12, 0.15), (0.30, 0.33, 0.37)
#: Where the left edge of what is written is, in half widths.
LEFT = -0.94
#: How low the legend may reach, in half heights: below it a film has its strip.
LOWEST = -0.50
#: Sizes of letters that can still be read, pixels: ordinary ones, what must be read beside them,
#: and notes.
READ, READ_BESIDE, READ_NOTE = 11.0, 10.0, 9.0
#: What Workbench's studio light leaves of a color that looks straight at the camera, measured.
STUDIO = 0.48
#: How much farther away the next layer behind is, as a part of the distance.
LAYER = 1e-3


@dataclass(frozen=True)
class Front:
    """Plane in front of the camera, without shadow or shading."""

    #: Blender's.
    scene: Scene
    camera: Object
    #: Distance from the camera, Blender units.
    depth: float
    #: Half the picture's size there, Blender units.
    width: float
    height: float

    @classmethod
    def before(cls, scene: Scene, camera: Object, half: tuple[float, float]) -> Front:
        """Return the plane of a camera; `half` of the frame's width and height at depth 1."""
        depth = camera.data.clip_start * 20.0
        return cls(scene, camera, depth, half[0] * depth, half[1] * depth)

    @property
    def pixel(self) -> float:
        """Size of a pixel of the picture, Blender units."""
        return 2.0 * self.width / float(self.scene.render.resolution_x)

    @property
    def letter(self) -> float:
        """Size of ordinary letters; in a small picture large enough to be read, as far as it has room."""
        usual = min(0.056 * self.height, 0.040 * self.width)
        return max(usual, min(READ * self.pixel, 0.11 * self.height, 0.07 * self.width))

    @property
    def note(self) -> float:
        """Size of what explains ordinary letters."""
        return 0.70 * self.letter

    def readable(self, size: float) -> float:
        """Return a size of letters below the ordinary one, enlarged as far as it must be to be read."""
        return max(size, min(READ_BESIDE * self.pixel, self.letter))

    @property
    def explains(self) -> bool:
        """Whether notes could be read."""
        return self.note >= READ_NOTE * self.pixel

    def put(self, part: Object, x: float, y: float, color: Color, layer: float = 0) -> Object:
        """Hang an object at a place of the plane; layers with a higher number lie behind."""
        behind = 1.0 + LAYER * layer
        part.parent = self.camera
        part.location = (x * behind, y * behind, -self.depth * behind)
        part.scale = tuple(side * behind for side in part.scale)
        part.data.materials.append(flat(part.name, color))
        part.visible_shadow = part.visible_diffuse = part.visible_glossy = False
        part.display.show_shadows = False
        self.scene.collection.objects.link(part)
        return part

    def write(
        self, body: str, size: float, x: float, y: float, color: Color, align: str = "LEFT"
    ) -> Object:
        """Write a text at a place; return the object, whose `data.body` may be changed."""
        text = bpy.data.curves.new(body, "FONT")
        text.body, text.size, text.align_x = body, size, align
        return self.put(bpy.data.objects.new(body, text), x, y, color)

    def box(
        self,
        name: str,
        low: tuple[float, float],
        high: tuple[float, float],
        color: Color,
        layer: int,
    ) -> Object:
        """Fill a rectangle from its lower left to its upper right corner; its origin is the lower left."""
        width, height = high[0] - low[0], high[1] - low[1]
        corners = np.array([[0.0, 0.0, 0.0], [width, 0, 0], [width, height, 0], [0, height, 0]])
        part = bpy.data.objects.new(name, bridge.mesh(name, (corners, [(0, 1, 2, 3)])))
        return self.put(part, *low, color, layer)


class Entry(NamedTuple):
    """Entry of a legend: what pins of a color, sRGB, do."""

    name: str
    meaning: str
    color: Color


def list_entries(modes: Any, waiting: Any) -> list[Entry]:
    """Return the entries of all codes of modes in an array, and of pins that wait if any does."""
    entries = [
        Entry(mode.name.lower().replace("_", " "), MEANINGS[mode], palettes.color_of(mode))
        for mode in map(Mode, np.unique(modes).tolist())
    ]
    return [*entries, Entry("waiting", WAITS, WAITING)] if np.any(waiting) else entries


def write_mode_legend(front: Front, entries: Sequence[Entry]) -> None:
    """List modes down the picture's left side, each with a dot of its color; small pictures explain none."""
    size, small = front.letter, front.note
    turns = np.linspace(0.0, 2.0 * math.pi, 49)[:-1]
    disc = primitives.loft(
        [np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])], last=True
    )
    left, y = LEFT * front.width, 0.86 * front.height
    for name, meaning, inner in entries:
        lines = textwrap.wrap(meaning, 26) if front.explains else []
        for radius, color, layer in ((0.42, inner, 0), (0.47, FADED, 1)):
            dot = bpy.data.objects.new(name, bridge.mesh(name, disc))
            dot.scale = (radius * size,) * 3
            front.put(dot, left, y + 0.33 * size, color, layer)
        x = left + 0.95 * size
        front.write(name, size, x, y, INK)
        if lines:
            front.write("\n".join(lines), small, x, y - 1.25 * small, FADED)
            y -= (1.25 + len(lines)) * small
        y -= 1.25 * size


def write_force_legend(front: Front) -> None:
    """Draw the levels of force as a bar of colors down the picture's left side, their forces beside it."""
    size, count = front.letter, 1 + len(heat.COLORS)
    left, top = LEFT * front.width, 0.78 * front.height
    step = min(0.95 * size, (top - LOWEST * front.height) / count)
    front.write("force on a pin", size, left - 0.4 * size, top + 0.7 * size, INK)
    low = top - step * count
    edge = 0.05 * size
    front.box("edge", (left - edge, low - edge), (left + size + edge, top + edge), FADED, 1)
    for level, color in enumerate((heat.NO_FORCE, *heat.COLORS)):
        y = low + step * level
        front.box(f"level {level}", (left, y), (left + size, y + step), color, 0)
    x, small = left + 1.5 * size, front.readable(front.note)
    for level in range(0, count, 3):
        force = 1e3 * heat.TOP * level / len(heat.COLORS)
        label = (
            "none"
            if level == 0
            else f"{force:.0f} mN" + (" and more" if level == count - 1 else "")
        )
        # Level 0 is no force at all; every other ends at its force.
        front.write(label, small, x, low + step * (level + (0.3 if level == 0 else 0.75)), FADED)


def flat(name: str, color: Color) -> Material:
    """Make a material of one color that no light changes. `color` (float, float, float)."""
    material = bpy.data.materials.new(name)
    *light, alpha = linear(color)
    # What Workbench shows. It lights everything, so what it takes is given first, as far as the hue
    # allows.
    brighter = min(1.0 / STUDIO, 1.0 / max(light))
    material.diffuse_color = (*(part * brighter for part in light), alpha)
    material.roughness = 1.0
    tree = shader_nodes(material)
    emission = tree.nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = linear(color)
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return material


#: Part of the picture's height the strip takes, and what of it is left to the letters above the
#: curve.
SHARE, LETTERS = 0.20, 0.30
#: Most columns the curve is drawn with.
MOST = 600
#: sRGB: the whole session's force, what of it has been, the set point, and what lies behind; behind
#: several.
TO_COME = (0.52, 0.57, 0.64)
BEEN = (0.00, 0.45, 0.70)
ASKED = (0.84, 0.37, 0.00)
PAPER = (0.93, 0.94, 0.95)
DARK = (0.20, 0.22, 0.25)
#: Least force the strip's height stands for, N.
LEAST = 0.05


@dataclass(frozen=True)
class ForcePlot:
    """Force plot of one film: an area, or a line for each of several fingertips."""

    #: What the force is called.
    called: str
    #: Objects that change from frame to frame, the first one for each curve.
    been: Sequence[Object]
    cursor: Object
    force: Object
    time: Object
    #: (k,), where each column stands, plane units, and.
    place: Floats
    #: (f, k), from where to where it reaches.
    low: Floats
    high: Floats
    #: Time of the left edge, s, and plane units of a second.
    first: float
    per_second: float

    def show(self, time: float, force: Any) -> None:
        """Show an instant: its time, s, and the force then, N, or those (f,) of several fingertips."""
        now = (time - self.first) * self.per_second
        place = np.minimum(self.place, now)
        for been, low, high in zip(self.been, self.low, self.high, strict=True):
            # Columns still to come are drawn together at the cursor, as a face of no width.
            ends = np.where(self.place <= now, (low, high), 0.0)
            been.data.vertices.foreach_set("co", _area(place, *ends).astype(np.float32).ravel())
            been.data.update()
        behind = self.cursor.location.z / self.been[0].location.z
        self.cursor.location.x = (self.been[0].location.x + now) * behind
        forces = " to ".join(
            dict.fromkeys(f"{part:.2f}" for part in (np.min(force), np.max(force)))
        )
        self.force.data.body = f"{self.called} {forces} N"
        self.time.data.body = f"{time:.2f} s"


def draw_force_plot(
    front: Front, time: Floats, force: Floats, set_point: float | None, called: str = "total force"
) -> ForcePlot:
    """Draw the strip of a session: times (t,), s, forces (t,) and set point, N, and what they are called.

    Forces (t, f) of several fingertips have a line each, in their colors.
    """
    left, right = LEFT * front.width, -LEFT * front.width
    bottom = -0.95 * front.height
    full = 2.0 * SHARE * front.height
    rise = (1.0 - LETTERS) * full
    top = max(LEAST, 1.1 * float(force.max()), 1.4 * (set_point or 0.0))
    thick = max(0.010 * full, 0.5 * front.pixel)
    several, columns = force.ndim > 1, force.reshape(len(force), -1)
    paper, ink = (DARK, PAPER) if several else (PAPER, INK)
    # Columns, each with its largest force.
    starts = np.unique(
        np.linspace(0, len(time), min(len(time), MOST), endpoint=False).astype(np.intp)
    )
    lasts = max(float(time[-1] - time[0]), 1e-9)
    place = (time[starts] - time[0]) * ((right - left) / lasts)
    high = np.maximum.reduceat(columns, starts, axis=0).T * (rise / top)
    low = np.zeros_like(high)
    if several:  # a line that is steep reaches to the columns beside it
        beside = np.clip(np.arange(len(place)) + np.array([[-1], [0], [1]]), 0, len(place) - 1)
        low = np.maximum(high[:, beside].min(axis=1) - 3.0 * thick, 0.0)
    front.box("strip", (left, bottom), (right, bottom + rise), paper, 6)
    corners = np.arange(len(place) - 1)[:, None] * 2 + [0, 2, 3, 1]
    faces: list[tuple[int, ...]] = [tuple(face) for face in corners.tolist()]
    been = []
    for curve, ends in enumerate(zip(low, high, strict=True)):
        color, behind = palettes.finger_color(curve + 1) if several else BEEN, curve / len(high)
        for name, fill, layer in (("to come", TO_COME, 4), ("been", color, 3)):
            part = bpy.data.objects.new(name, bridge.mesh(name, (_area(place, *ends), faces)))
            area = front.put(part, left, bottom, fill, layer + behind)
        been.append(area)
    size = front.readable(0.80 * front.letter)
    above = bottom + rise + 0.35 * size
    if set_point is not None:
        at = bottom + set_point * rise / top
        front.box("set point", (left, at - thick), (right, at + thick), ASKED, 5 if several else 2)
        front.write(f"set point {set_point:.2f} N", size, 0.0, above, ASKED, "CENTER")
    cursor = front.box("cursor", (left, bottom), (left + 1.5 * thick, bottom + rise), ink, 1)
    label = front.write(called, size, left, above, INK)
    moment = front.write("time", size, right, above, FADED, "RIGHT")
    start, rate = float(time[0]), (right - left) / lasts
    return ForcePlot(called, been, cursor, label, moment, place, low, high, start, rate)


def _area(place: Floats, low: Floats, high: Floats) -> Floats:
    """Return the lower and upper end of every column, alternating, (2 k, 3)."""
    points = np.zeros((2 * len(place), 3))
    points[:, 0] = np.repeat(place, 2)
    points[::2, 1], points[1::2, 1] = low, high
    return points
