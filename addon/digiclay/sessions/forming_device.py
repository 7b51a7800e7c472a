"""What forms the strokes of a session. No Blender."""

from dataclasses import replace

from ..core.scene.schema import Scene
from ..device.instant import find_ellipsoid
from ..strokes.nominal import Device
from ..strokes.stroke import Stroke
from ..strokes.tracking import find_blister
from .running import Running


def find_device(running: Running) -> Device:
    """Return what forms the strokes of a session."""
    scene, system = running.scene, running.system
    shares, actuator = running.state.shares(), system.cell.actuator
    parts = system.grid, find_ellipsoid(scene), find_blister(scene), actuator.stroke
    locks = shares if shares.any() else None
    return Device(*parts, locks, actuator.rest_height, running.base)


def suit_scene(scene: Scene, stroke: Stroke) -> Scene:
    """Return a scene with fingertip and blister of a stroke."""
    first, *others = scene.fingers
    if stroke.finger is None or first.fingertip is None:
        return scene
    blister = scene.blister and (stroke.blister or scene.blister)
    fingers = replace(first, fingertip=stroke.finger), *others
    return replace(scene, fingers=fingers, blister=blister)


def is_resized(former: Scene, scene: Scene) -> bool:
    """Return whether a scene differs from a former one in nothing that strokes do not carry."""
    sizes = Stroke(0, (), finger=scene.fingers[0].fingertip, blister=scene.blister)
    return suit_scene(former, sizes) == scene
