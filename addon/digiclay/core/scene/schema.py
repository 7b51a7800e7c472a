"""Scene: all parameters of a session as one valid value."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from ..control.methods import ControlParameters, find_method, list_methods
from ..files.tables import Described, refuse_unknown
from ..model.control_interface import SetPoint
from ..model.fingertip import require_one
from ..model.laws import LAWS, import_part, law_parameters, select_law
from ..model.trajectory import Path, Trajectory

if TYPE_CHECKING:  # a part that is left out is never imported, see `import_part`
    from ..control.blister import Blister
    from ..model.actuator import Actuator, Supply
    from ..model.conduit import Conduit
    from ..model.contact import Contact
    from ..model.delay import Delay
    from ..model.fingertip import Fingertip
    from ..model.lag import ValveLag
    from ..model.layout import Layout
    from ..model.matrix_drive import DriveParameters
    from ..model.relaxation import Relaxation
    from ..model.sensors import Sensing
    from ..model.valve import Fluid, Valve
    from ..model.yielding_hand import Hand
    from ..shapes.body import Body
    from ..shapes.request import Shape
    from .recorder import Recorder

#: Parts of a scene: module and class. That of the control depends on its method, see
#: `find_method`, those of valve and contact on their laws, see `LAWS`.
PARTS: dict[str, tuple[str, str]] = {
    "layout": ("model.layout", "Layout"),
    "actuator": ("model.actuator", "Actuator"),
    "supply": ("model.actuator", "Supply"),
    "fluid": ("model.valve", "Fluid"),
    "conduit": ("model.conduit", "Conduit"),
    "valve_lag": ("model.lag", "ValveLag"),
    "delay": ("model.delay", "Delay"),
    "drive": ("model.matrix_drive", "DriveParameters"),
    "fingertip": ("model.fingertip", "Fingertip"),
    "relaxation": ("model.relaxation", "Relaxation"),
    "hand": ("model.yielding_hand", "Hand"),
    "sensors": ("model.sensors", "Sensing"),
    "blister": ("control.blister", "Blister"),
    "shape": ("shapes.request", "Shape"),
    "simulation": ("scene.schema", "Simulation"),
    "recorder": ("scene.recorder", "Recorder"),
}
#: Sections of a scene that are parts, in the order of a scene file.
SECTIONS = (
    "layout",
    "actuator",
    "supply",
    "fluid",
    "valve",
    "conduit",
    "valve_lag",
    "delay",
    "drive",
    "fingertip",
    "contact",
    "relaxation",
    "hand",
    "sensors",
    "control",
    "blister",
    "shape",
    "simulation",
    "recorder",
)
#: Sections that cannot be absent by themselves; all other parts are optional.
REQUIRED = ("layout", "actuator", "supply", "fluid", "valve", "contact", "blister", "simulation")
OPTIONAL = tuple(name for name in SECTIONS if name not in REQUIRED)
#: Sections of a finger.
FINGER_SECTIONS = ("fingertip", "contact", "relaxation", "hand", "trajectory")
#: Optional parts that a scene has only if it names them.
UNASKED = ("drive", "hand", "sensors", "shape")
#: Parts of which a file that is written says nothing if they are absent: older versions read it.
LATER = ("drive", "hand")
#: Parts that are omitted together with another one.
NEEDS = {
    "contact": "fingertip",
    "relaxation": "fingertip",
    "hand": "fingertip",
    "blister": "control",
}
#: Parameters of a body: module and class.
BODY = ("shapes.body", "Body")
#: Steppers: module and class.
STEPPERS: dict[str, tuple[str, str]] = {
    "bernoulli": ("steppers.bernoulli", "BernoulliExponential"),
    "richardson": ("steppers.richardson", "Richardson"),
    "adaptive": ("steppers.adaptive", "Adaptive"),
    "euler": ("steppers.explicit", "Euler"),
    "heun": ("steppers.explicit", "Heun"),
    "runge_kutta_4": ("steppers.explicit", "RungeKutta4"),
}
#: Most physics steps in a control period, and most queued control periods of a valve.
MOST_STEPS = 1000
#: Most physics steps in a control period of steppers that divide each step: their plans grow with
#: the square, to a gigabyte.
MOST_CUT = {"adaptive": 10, "richardson": 500}

#: Names of the classes of what a section may hold; those of the control depend on its method.
KINDS: dict[str, tuple[str, ...]] = {
    section: (*names, "None") if section in (*OPTIONAL, *NEEDS) else names
    for section, names in {
        **{section: (name,) for section, (_, name) in PARTS.items()},
        **{section: tuple(name for _, name in laws.values()) for section, laws in LAWS.items()},
        "trajectory": ("Path",),
    }.items()
}


def import_parameters(section: str, method: str) -> type[Parameters]:
    """Import the class of a section's parameters; `method`: the control method."""
    if section in LAWS:
        return law_parameters(section)
    if section == "control":
        return find_method(method).import_parameters()
    return import_part(*(BODY if section == "body" else PARTS[section]))


@dataclass(frozen=True, eq=False, repr=False)
class Simulation(Parameters):
    """Periods, steps and duration of the simulation."""

    control_period: float = quantity(
        5e-3, "time between two commands", unit="s", symbol="T_c", above=0.0
    )
    physics_step: float = quantity(5e-3, "longest physics step", unit="s", symbol="h", above=0.0)
    stepper: str = quantity("bernoulli", "method of integration", choices=tuple(STEPPERS))
    tolerance: float = quantity(
        1e-6,
        "error of the heights allowed to the adaptive stepper",
        unit="m",
        symbol="ε",
        at_least=1e-7,
    )
    duration: float = quantity(
        0.0, "simulated time; 0: duration of the trajectory", unit="s", at_least=0.0, at_most=1e6
    )

    def check(self) -> None:
        """Refuse too many physics steps in a control period."""
        most = MOST_CUT.get(self.stepper, MOST_STEPS)
        if self.steps > most:
            rule = f"must be at least a {most}th of simulation.control_period, {self.control_period:g} s"
            rule += f", with the stepper {self.stepper}" if most < MOST_STEPS else ""
            raise ParameterError("simulation", "physics_step", rule, f"{self.physics_step:g} s")

    @property
    def steps(self) -> int:
        """Physics steps of a control period, of equal length."""
        return max(1, math.ceil(self.control_period / self.physics_step * (1.0 - 1e-9)))

    def refined(self, parts: int) -> Simulation:
        """Return the same with every physics step divided into equal parts."""
        return replace(self, physics_step=self.control_period / (self.steps * parts))


@lru_cache(maxsize=64)
def _set_duration(simulation: Simulation, duration: float) -> Simulation:
    """Return a simulation with a duration; the points of a sweep share one."""
    return replace(simulation, duration=duration)


@dataclass(frozen=True)
class Finger:
    """A finger: its tip, contact law and relaxation of the pulp, its path, and the hand that holds it.

    Without a fingertip it touches nothing, but its path is recorded, and determines the duration.
    Without a hand its path is prescribed.
    """

    fingertip: Fingertip | None
    contact: Contact | None
    relaxation: Relaxation | None
    trajectory: Path
    hand: Hand | None = None


@dataclass(frozen=True)
class Presser:
    """Body that presses the pins, and the path of its mesh's origin."""

    body: Body
    trajectory: Path


@dataclass(frozen=True, repr=False)
class Scene(Described):
    """Complete definition of a session; equal scenes give equal sessions, bit for bit.

    A part that is None is omitted: it costs nothing, and its module is not imported. Raises
    ParameterError when parts are not compatible; its owner is the section's name.
    """

    layout: Layout
    actuator: Actuator
    supply: Supply
    fluid: Fluid
    valve: Valve
    conduit: Conduit | None
    valve_lag: ValveLag | None
    delay: Delay | None
    control: ControlParameters | None
    blister: Blister | None
    simulation: Simulation
    recorder: Recorder | None
    fingers: tuple[Finger, ...]
    name: str = ""
    description: str = ""
    preset: str = "paper"
    method: str = "virtual_master"
    sensors: Sensing | None = None
    shape: Shape | None = None
    bodies: tuple[Presser, ...] = ()
    drive: DriveParameters | None = None

    def __post_init__(self) -> None:
        self._refuse_wrong_parts()
        if self.layout.pitch < self.actuator.bore:
            rule = (
                f"must be at least actuator.bore, {self.actuator.bore:g} m: cylinders would overlap"
            )
            raise ParameterError("layout", "pitch", rule, f"{self.layout.pitch:g} m")
        plan = self.layout
        longer_side = max(plan.columns * plan.pitch, plan.rows * plan.row_spacing)
        if self.blister and 2.0 * self.blister.radius > longer_side * (1.0 + 1e-9):
            rule = f"must be at most half the bed's longer side, {longer_side / 2:g} m"
            hint = "Make all lengths of [blister] smaller, or take a method without one, as shape_display."
            raise ParameterError("blister", "radius", rule, f"{self.blister.radius:g} m", hint)
        if self.bodies:
            self._refuse_beside_bodies()
        if getattr(self.valve, "law", "") == "motor":
            self._refuse_beside_motors()
        lasts = self.lasting
        if self.simulation.duration == 0.0:
            if lasts == 0.0:
                rule = "must be above 0 s where no finger has a path with a duration"
                raise ParameterError("simulation", "duration", rule, "0 s")
            object.__setattr__(self, "simulation", _set_duration(self.simulation, lasts))
        longest = MOST_STEPS * self.simulation.control_period
        if self.delay and self.delay.dead_time > longest:
            rule = f"must be at most {MOST_STEPS} control periods, {longest:g} s"
            raise ParameterError("delay", "dead_time", rule, f"{self.delay.dead_time:g} s")
        if self.drive:
            self.drive.check_device(plan, self.simulation.control_period, self.dead_time)
            if self.drive.line_lag:
                self._refuse_beside_gates()
            if self.drive.kind == "servo" and self.control and find_method(self.method).by_speed:
                rule = (
                    f"must be matrix: control.method = {self.method} commands no heights to servos"
                )
                raise ParameterError("drive", "kind", rule, "servo")

    def _refuse_beside_bodies(self) -> None:
        """Refuse what cannot be where bodies press."""
        if self.control and find_method(self.method).blister is not None:
            rule = f"must be left out: the method {self.method} follows a fingertip, not a surface"
            hint = "Set control.method to plastic, elastic, viscous, push_pull or force_display."
            raise ParameterError("body", "", rule, f"{len(self.bodies)} of them", hint)
        if any(self.list_parts("hand")):
            rule = "must be left out beside [[body]], where paths are prescribed"
            raise ParameterError("hand", "", rule, "a hand")

    def _refuse_beside_gates(self) -> None:
        """Refuse what is not simulated with gates of lines and columns."""
        sensing = self.sensors
        wrong = {
            "finger: must be one": len(self.fingers) != 1,
            "body: must be absent": bool(self.bodies),
            "hand: must be absent": any(self.list_parts("hand")),
            "valve_lag: must be given": self.valve_lag is None,
            "valve.law: must be orifice": getattr(self.valve, "law", "orifice") != "orifice",
            "sensors.observer: must be none": bool(sensing and sensing.observer == "valve"),
            "simulation.stepper: must be bernoulli or richardson": self.simulation.stepper
            not in ("bernoulli", "richardson"),
        }
        for rule, broken in wrong.items():
            if broken:
                name, rule = rule.split(": ")
                value = f"{self.drive.line_lag:g} s" if self.drive else ""
                raise ParameterError(name, "", f"{rule} with drive.line_lag", value)

    def _refuse_beside_motors(self) -> None:
        """Refuse what motors do not have, and a force that is no pressure on a pin."""
        if self.conduit:
            rule = "must be absent with valve.law = motor: a motor has no fluid"
            raise ParameterError("conduit", "", rule, "a conduit", 'Set conduit = "absent".')
        for section in ("supply", "fluid"):
            part = getattr(self, section)
            if part != type(part)():
                rule = (
                    "must be left out with valve.law = motor, which has neither pressure nor fluid"
                )
                raise ParameterError(section, "", rule, str(part))
        force, most = select_law("valve", self.valve).stall_force, 1e10 * self.actuator.area
        if force > most:
            rule = f"must be at most {most:.3g} N on this actuator.bore"
            raise ParameterError("valve", "stall_force", rule, f"{force:g} N")

    def _refuse_wrong_parts(self) -> None:
        """Refuse parts that are not of the classes of their sections, or not of the control method.

        By the names of the classes: the file of a method of one's own may have been run again
        since.
        """
        if not all(isinstance(finger, Finger) for finger in self.fingers):
            raise ParameterError("fingers", "", "must be a tuple of Finger", str(self.fingers))
        kinds = KINDS
        if self.control is not None:
            row = find_method(self.method)
            blister = "None" if row.blister is None else "Blister"
            kinds = {**KINDS, "control": (row.parameters,), "blister": (blister,)}
        for section, names in kinds.items():
            for part in self.list_parts(section):
                name = "None" if part is None else type(part).__name__
                if name not in names:
                    method = (
                        f" with the method {self.method}"
                        if section in ("control", "blister")
                        else ""
                    )
                    raise ParameterError(section, "", f"must be {' or '.join(names)}{method}", name)

    def describe(self) -> dict[str, str]:
        """Return what matters most of it, by name."""
        bed, time, control = self.layout, self.simulation, self.method if self.control else "absent"
        if wanted := self.set_point:
            control += f", set point {wanted.force:g} N{' per cell' if wanted.per_cell else ''}"
        if self.method not in list_methods():
            control = f"{self.method}, which is not loaded"
        absent = [name for name in OPTIONAL if name != "control" and None in self.list_parts(name)]
        return {
            "bed": f"{bed.rows} x {bed.columns} pins, {bed.pitch * 1e3:g} mm apart, {bed.arrangement}",
            "method": control,
            "fingers": ", ".join([str(len(self.fingers)), *self._describe_hands()]),
            **({"bodies": str(len(self.bodies))} if self.bodies else {}),
            "time": f"{time.duration:g} s, {self.periods} periods of {time.control_period * 1e3:g} ms",
            "absent": ", ".join(absent) or "nothing",
        }

    @property
    def dead_time(self) -> float:
        """Dead time between controller and valves, s."""
        return self.delay.dead_time if self.delay else 0.0

    @property
    def lasting(self) -> float:
        """Duration of the longest path, s."""
        movers: tuple[Finger | Presser, ...] = (*self.fingers, *self.bodies)
        return max((each.trajectory.trajectory().duration for each in movers), default=0.0)

    @property
    def ceiling(self) -> float:
        """Height above which bodies meet no pin, m."""
        return self.actuator.stroke + max((each.body.cap for each in self.bodies), default=0.0)

    def _describe_hands(self) -> list[str]:
        """Return the hands of the fingers, each once."""
        hands = dict.fromkeys(filter(None, self.list_parts("hand")))
        return [
            f"on a hand of {hand.mass * 1e3:g} g, {hand.damping:g} N s/m and {hand.stiffness:g} N/m"
            for hand in hands
        ]

    @property
    def periods(self) -> int:
        """Control periods of the whole session; the last one may end after its duration."""
        return max(1, math.ceil(self.simulation.duration / self.simulation.control_period - 1e-9))

    @property
    def cells(self) -> int:
        """Number of cells."""
        return self.layout.rows * self.layout.columns

    def trajectories(self) -> tuple[Trajectory, ...]:
        """Return the trajectories of the fingers."""
        return tuple(finger.trajectory.trajectory() for finger in self.fingers)

    def list_parts(self, name: str) -> tuple[Any, ...]:
        """Return the content of a section, of each finger if it is theirs; None for an omitted part."""
        owners = self.fingers if name in FINGER_SECTIONS else (self,)
        return tuple(getattr(owner, name, None) for owner in owners)

    def section(self, name: str) -> Any:
        """Return the content of a section of a scene with one finger; None for an omitted part."""
        return require_one(self.list_parts(name))

    def with_sections(self, **parts: Any) -> Scene:
        """Return the scene with other parts, by the names of sections; those of a finger in all fingers."""
        refuse_unknown("", parts, [*vars(self), *FINGER_SECTIONS])
        of_finger = {name: parts.pop(name) for name in FINGER_SECTIONS if name in parts}
        fingers = tuple(replace(finger, **of_finger) for finger in self.fingers)
        return replace(self, fingers=fingers, **parts)

    def with_fingers(self, count: int) -> Scene:
        """Return the scene with at least `count` fingers: its own, and further ones like the first."""
        more = max(0, count - len(self.fingers))
        return replace(self, fingers=(*self.fingers, *self.fingers[:1] * more)) if more else self

    @property
    def set_point(self) -> SetPoint | None:
        """Set point of the control; None without one."""
        return self.control.set_point if self.control else None
