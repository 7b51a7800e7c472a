"""From a scene to the system that simulates it: each place gets its part, or a stand-in that does nothing."""

from __future__ import annotations

import numpy as np

from .layout import grid
from .physics import Cell
from .places import Controller, Flow, Stepper
from .scene import STEPPERS, Scene, part
from .simulation import System, segments
from .state import Rows
from .touch import Touch

__all__ = ["assemble"]


def assemble(scene: Scene) -> System:
    """Build the system of a scene, importing only the parts it has."""
    stepper: Stepper = part(*STEPPERS[scene.simulation.stepper])()
    period = scene.simulation.control_period
    cell = _cell(scene)
    line = _line(scene)
    cut, instants = segments(stepper, line, period, scene.simulation.physics_step)
    return System(
        grid=grid(scene.layout),
        cell=cell,
        queue=line,
        sensors=part("absent", "PerfectSensors")(),
        controller=_controller(scene, cell),
        stepper=stepper,
        period=period,
        segments=cut,
        longest_rise=period * _fastest(cell),
        instants=instants,
        rows=Rows(cell.rows, line.length),
    )
