"""What forms the strokes of a session. No Blender."""

from ..core.base.modes import Mode
from ..device.instant import find_ellipsoid
from ..strokes.nominal import Device
from ..strokes.tracking import find_blister
from .running import Running


def find_device(running: Running) -> Device:
    """Return what forms the strokes of a session."""
    scene, system = running.scene, running.system
    locked, actuator = running.state.mode() == Mode.LOCKED, system.cell.actuator
    parts = system.grid, find_ellipsoid(scene), find_blister(scene), actuator.stroke
    mask = locked if locked.any() else None
    return Device(*parts, mask, actuator.rest_height, running.base)
