"""Tracking of a fingertip by a device's blister: what a press stroke that raises has to keep to. No Blender.

Methods I, II and III hold the force under the fingertip: once it has been pressed in, pins that
feel it rise with it. So clay is raised by a light press and a rise that the pins can follow, and it
is leveled by a finger that goes along at one height.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..core.base.arrays import Floats
from ..core.control.blister import Blister
from ..core.control.cell_states import CellStates
from ..core.control.hybrid_parameters import Hybrid
from ..core.control.virtual_master import VirtualMaster
from ..core.engine.system import System
from ..core.model.fingertip import Fingertip
from ..core.model.layout import Layout
from ..core.model.relaxation import Relaxation
from ..core.model.touch import Touch
from ..core.scene.schema import Scene
from ..device.instant import find_ellipsoid

#: How long a pin is under a fingertip that drags, s: some 4 mm at 14 mm/s. The pulp relaxes
#: meanwhile.
CONTACT_TIME = 0.3
#: How far beyond the depth that starts a blister the first press goes, m.
MARGIN = 0.5e-3
#: Fastest press, as a share of the speed of pins without load, and greatest acceleration of a
#: fingertip up and down, m/s²: at 5 m/s² pins of the bed "design" lose it where a press ends.
PRESS, SUDDEN = 0.5, 2.0
#: Force, in set points, above which a fingertip near another one waits, on even ground or pressing:
#: alone 2.2 at most. Without that, one whose pins the other has taken runs into clay. Method II
#: holds each pin's force.
HARD = 2.5
#: Changes of height less than this share of the blister's radius are none.
NEAREST = 1e-9
#: Samples across a fingertip, and halvings, in the search for its sink.
SAMPLES, HALVINGS = 41, 40


@dataclass(frozen=True)
class Tracking:
    """Limits within which the blister of a device follows a fingertip."""

    #: How far the fingertip's lowest point lies below the pins' tops while they hold its force, m.
    sink: float
    #: Depth of a press that starts a blister, m.
    press: float
    #: Speed at which pins rise without load, m/s.
    speed: float
    #: Speed at which a fingertip can rise with the blister under it, m/s, and how fast it may gain
    #: speed upwards, or lose it at the end of a press, m/s².
    lift: float
    gain: float
    #: Fastest press, m/s.
    sink_speed: float
    #: Fastest drags, m/s, of a blister, see `limit_drag`, and of a fingertip that presses a valley.
    drag: float
    push: float
    #: Steepest slope of the blister's profile per height, 1/m.
    slope: float
    #: Of the blister, m.
    radius: float
    #: Highest place of a pin's top, m.
    highest: float
    #: How long the method looks for a fingertip that has left, s.
    search: float
    #: Force above which a fingertip that is near another one waits, N.
    hard: float
    #: Whether pins ahead stand so that they come to any height in time.
    ready: bool = False

    def reach(self, time: float) -> float:
        """Return how far from a fingertip its blister may come in a time, s, m."""
        return self.radius + max(self.drag, self.push) * time

    def limit_drag(self, change: float, *, pressed: bool) -> float:
        """Return the fastest drag, m/s, where pins ahead are to come to heights `change` away, m."""
        fastest = self.push if pressed else self.drag
        return (
            fastest if self.ready else min(fastest, self.speed / max(self.slope * change, NEAREST))
        )


def find_blister(scene: Scene) -> Blister | None:
    """Return the blister that follows the fingertip of a scene; None where its method has none."""
    follows = isinstance(scene.control, VirtualMaster | CellStates | Hybrid)
    return scene.blister if follows and all(finger.fingertip for finger in scene.fingers) else None


def find_tracking(scene: Scene, system: System) -> Tracking | None:
    """Return how the blister of a scene follows a fingertip; None where its method has no blister."""
    control, touch, blister = scene.control, system.cell.touch, find_blister(scene)
    if (
        not isinstance(control, VirtualMaster | CellStates | Hybrid)
        or touch is None
        or blister is None
    ):
        return None
    asked = control.force_setpoint
    # Method II holds a force on every pin, so that they take on its form; the others hold their
    # sum.
    if isinstance(control, CellStates):
        sink, trigger = _find_sink(touch, np.zeros(1), 1.0, asked), control.spring_trigger
        hard, search = math.inf, 0.0
    else:
        gap, share = _sample_underside(find_ellipsoid(scene), system.grid.layout)
        sink, trigger = _find_sink(touch, gap, share, asked), asked
        hard, search = HARD * asked, control.loss_time
    # Before a blister starts the pins give way like springs; Method III follows from the first
    # touch on. A valve that feels no force opens by gain times set point; the flow goes with the
    # square of that.
    spring, opening = 0.0, 1.0
    if not isinstance(control, Hybrid):
        spring = trigger / control.spring_stiffness
        opening = min(1.0, control.force_gain * asked)
    press = sink + spring + MARGIN
    speed, pace = float(system.fastest), control.pace
    lift, slope = pace.lift * speed * opening**2, _find_slope(blister)
    drag, push = (min(pace.fastest, radii * blister.radius) for radii in (pace.drag, pace.push))
    gain, down = min(lift / pace.gain, SUDDEN), min(pace.press, PRESS * speed)
    return Tracking(
        sink,
        press,
        speed,
        lift,
        gain,
        down,
        drag,
        push,
        slope,
        blister.radius,
        system.cell.actuator.stroke,
        search,
        hard,
        pace.ready,
    )


def _find_slope(blister: Blister) -> float:
    """Return the steepest slope of a blister's profile, 1/m."""
    distance = np.linspace(0.0, blister.radius, 201)
    return float(-np.diff(blister.evaluate_profile(distance)).min() / distance[1])


def _sample_underside(finger: Fingertip, layout: Layout) -> tuple[Floats, float]:
    """Return heights of a level finger's underside over its lowest point, m, and pins per height."""
    x = np.linspace(-finger.length, finger.length, SAMPLES)
    y = np.linspace(-finger.width, finger.width, SAMPLES)
    square = (x[:, None] / finger.length) ** 2 + (y / finger.width) ** 2
    gap = finger.height * (1.0 - np.sqrt(1.0 - square[square < 1.0]))
    return gap, float(x[1] - x[0]) * float(y[1] - y[0]) / (layout.pitch * layout.row_spacing)


def _find_sink(touch: Touch, gap: Floats, share: float, force: float) -> float:
    """Return how deep a fingertip, its underside given by `gap` (k,), m, lies in flat pins under a force."""
    pulp = touch.pulp
    remaining = float(pulp.reduced(np.array(CONTACT_TIME))) if isinstance(pulp, Relaxation) else 1.0
    low, high = 0.0, touch.fingertip.height
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        tension = touch.contact.tension(middle - gap)
        enough = remaining * share * touch.contact.share * float(tension.sum()) >= force
        low, high = (low, middle) if enough else (middle, high)
    return high
