"""Assembly of a scene's system: a part or a null part at each interface.

Modules of optional parts are imported only where a scene has the part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from ..base.arrays import TIE, Floats
from ..base.errors import ParameterError
from ..control.methods import find_method
from ..engine.active_set import Selection
from ..engine.hand_steps import HandStep
from ..engine.state import Rows
from ..engine.system import System, make_segments
from ..model.control_interface import Controller
from ..model.delay import Delay, Queue, split_delay
from ..model.fingertip import Fingertip, require_one
from ..model.interfaces import Drive, Flow, Segment, Sensors, Stepper
from ..model.laws import import_part, select_law
from ..model.layout import Grid, make_grid
from ..model.null_parts import (
    DirectDrive,
    InstantValve,
    PerfectSensors,
    Uncontrolled,
    Unrelaxed,
)
from ..model.physics import Cell, find_speeds
from ..model.touch import Touch
from .schema import STEPPERS, Finger, Scene

if TYPE_CHECKING:
    from ..control.device_info import DeviceInfo
    from ..control.pin_division import PinDivision
    from ..engine.bodies import Undersides
    from ..engine.pairs import HandSystem

Extended = TypeVar("Extended")

#: Cells that several fingers press: module and function of the plan.
TOGETHER = ("steppers.press_together", "plan_together")


class Motion(NamedTuple):
    """Cells and stepper of a system, which depend neither on the bed, the control nor the sensors."""

    cell: Cell
    line: Queue
    """Queued commands."""
    stepper: Stepper
    plan: Any
    """Of the stepper."""
    steps: tuple[Segment, ...]
    instants: Floats
    """See `engine.system.make_segments`."""


def make_motion(scene: Scene) -> Motion:
    """Return the cells of a scene and the plan of their steps."""
    simulation = scene.simulation
    kind, period = import_part(*STEPPERS[simulation.stepper]), simulation.control_period
    stepper: Stepper = kind(simulation.tolerance) if simulation.stepper == "adaptive" else kind()
    lag = scene.valve_lag or InstantValve()
    flow = _make_flow(scene)
    cell = Cell(scene.actuator, flow, flow.source(scene.supply), lag, _make_touch(scene))
    line = split_delay(scene.delay, period) if scene.delay else Queue()
    # At the next command an opening with lag has a kink, and one without a jump.
    cut = 0.0 if stepper.bridges and cell.lag.rows else line.cut
    steps, instants = make_segments(stepper, cut, period, simulation.steps)
    return Motion(cell, line, stepper, stepper.plan(cell, line, steps), steps, instants)


def assemble(scene: Scene) -> System:
    """Return the system of a scene."""
    if scene.bodies:
        return _assemble_bodies(scene)
    if len(scene.fingers) != 1:
        return _assemble_hands(scene)
    motion, period = make_motion(scene), scene.simulation.control_period
    cell, bed = motion.cell, make_grid(scene.layout)
    controller = _make_controller(scene, bed, (cell,))
    sensors = _make_sensors(scene, cell, motion.line)
    rows = Rows(cell.rows, motion.line.length, controller.rows, sensors.rows)
    fastest = float(find_speeds(cell).rise)
    noisy = scene.sensors and scene.sensors.noisy
    latency = scene.dead_time + (scene.valve_lag.time_constant if scene.valve_lag else 0.0)
    system = System(
        grid=bed,
        cell=cell,
        sensors=sensors,
        controller=controller,
        drive=_make_drive(scene, fastest),
        stepper=motion.stepper,
        period=period,
        plan=motion.plan,
        fastest=fastest,
        selection=Selection(bed, rows, cell, period, fastest),
        instants=motion.instants,
        rows=rows,
        by_set=bool(noisy or (scene.control and find_method(scene.method).by_set)),
        latency=latency + (scene.sensors.delay * period if scene.sensors else 0.0),
        height_floor=scene.sensors.height_floor if scene.sensors else 0.0,
        hands=(),
    )

    if scene.drive and scene.drive.line_lag:
        return _add_gates(scene, motion, system)

    def plan(line: Queue, steps: tuple[Segment, ...]) -> System:
        return replace(system, plan=motion.stepper.plan(cell, line, steps))

    return replace(system, hands=_make_hand_steps(scene, motion, plan))


def _add_gates(scene: Scene, motion: Motion, system: System) -> System:
    """Return the system of a scene whose cells have gates of lines and columns in place of valves."""
    from ..engine.gated_lines import GatedDrive, GatedSelection
    from ..model.gates import Gates
    from ..model.lag import ValveLag

    drive, lag, period = scene.drive, scene.valve_lag, system.period
    assert drive
    assert lag
    queue = split_delay(Delay(scene.dead_time + drive.overlap), period)
    power = scene.valve.flow_law(scene.fluid, scene.actuator.area).power
    compliance = drive.trapped_volume / drive.bulk_modulus
    packet = compliance / float(motion.cell.flow.laminar_conductance(1.0))
    gates: Any = Gates(ValveLag(drive.line_lag), lag, queue, drive.leak, power, packet)
    cell = replace(motion.cell, lag=gates)
    plan = motion.stepper.plan(cell, motion.line, motion.steps)
    commands = 3 * max(queue.length, motion.line.length)
    rows = replace(system.rows, physics=cell.rows, queue=commands)
    shut = gates.join(np.zeros((2, 1)), np.ones(1))[0]
    flow = cell.flow.flow(shut, cell.supply.pressure(shut))
    creep = period * float(flow[0]) / cell.actuator.area
    lines: Any = system.drive
    lift = compliance / cell.actuator.area
    gated = GatedDrive(lines, cell, rows, motion.stepper, plan, system.instants.size, creep, lift)
    selection = GatedSelection(system.grid, rows, cell, period, system.fastest, gated)
    return replace(system, cell=cell, plan=plan, rows=rows, drive=gated, selection=selection)


def _make_hand_steps(
    scene: Scene, motion: Motion, plan: Callable[[Queue, tuple[Segment, ...]], System]
) -> tuple[HandStep, ...]:
    """Return the steps of a period in which fingertips give way; `plan`: makes the system of some steps."""
    if motion.cell.touch is None or not any(scene.list_parts("hand")):
        return ()
    from ..model.yielding_hand import make_swing

    steps, before = [], motion.steps[-1]
    for part in motion.steps:
        first, last = part.nodes[0], part.nodes[-1]
        nodes = tuple(node - first for node in part.nodes)
        alone = plan(motion.line.start_at(part.start), (replace(part, start=0.0, nodes=nodes),))
        alone = replace(alone, instants=motion.instants[: nodes[-1] + 1])
        swing = make_swing(scene.list_parts("hand"), part.length, before.length)
        steps.append(HandStep(alone, slice(first, last + 1), swing))
        before = part
    return tuple(steps)


def _extend(kind: type[Extended], base: Any, **parts: Any) -> Extended:
    """Return a dataclass of a more special kind than `base`, with other parts."""
    shared = {field.name: getattr(base, field.name) for field in fields(base)}
    return kind(**shared | parts)


def _assemble_bodies(scene: Scene) -> System:
    """Return the system of a scene with bodies, which press like further fingers."""
    from ..engine.bodies import BodySelection, BodySystem, GivenUndersides
    from ..model.fingers import join_touches

    bodies = [each.body for each in scene.bodies]
    # The law and the relaxation of a finger; without a mesh a fingertip touches nothing of its own.
    pressing = [
        Finger(Fingertip(), each.body.contact, each.body.relaxation, each.trajectory)
        for each in scene.bodies
    ]
    tips = any(scene.list_parts("fingertip"))
    fingers = scene.fingers if tips else tuple(pressing[:1] * len(scene.fingers))
    system = _assemble_hands(replace(scene, fingers=(*fingers, *pressing), bodies=()))
    ends = [(body.samples, body.tip_radius) for body in bodies]
    undersides: Undersides = GivenUndersides(ends, system.grid, system.instants, scene.ceiling)
    if not any(body.given for body in bodies):
        undersides = _trace_meshes(scene, system)
    touches = [cell.touch for cell in system.cells[: len(scene.fingers)] if cell.touch]
    return _extend(
        BodySystem,
        system,
        selection=_extend(BodySelection, system.selection),
        hand=join_touches(touches) if tips else None,
        undersides=undersides,
        caps=np.array([body.cap for body in bodies]),
    )


def _trace_meshes(scene: Scene, system: System) -> Undersides:
    """Return the undersides of the meshes of a scene along their paths."""
    from ..engine.bodies import MovedMesh, PathUndersides
    from ..shapes.body import read_bodies

    meshes = read_bodies(each.body for each in scene.bodies)
    moved = tuple(
        MovedMesh(
            mesh,
            each.trajectory.trajectory(),
            each.body.samples,
            each.body.tip_radius,
            each.body.travel,
        )
        for mesh, each in zip(meshes, scene.bodies, strict=True)
    )
    undersides = PathUndersides(moved, system.grid, system.instants, scene.ceiling)
    begin = undersides.find(0)
    for number, lowest in enumerate(begin.start.min(axis=1) + begin.rise[:, 0], 1):
        if lowest < 0.0:
            rule = "must begin above the floor of the bed, z = 0"
            raise ParameterError(f"body #{number}", "trajectory", rule, f"{lowest:.3g} m")
    return undersides


def _assemble_hands(scene: Scene) -> HandSystem:
    """Return the system of a scene with several fingers."""
    from ..engine.pairs import HandSelection, HandSystem
    from ..model.fingers import MOST_FINGERS, join_touches

    count = len(scene.fingers)
    if not 0 < count <= MOST_FINGERS:
        raise ParameterError("scene", "fingers", f"must be 1 to {MOST_FINGERS}", str(count))
    scene = replace(scene, fingers=_pad_relaxations(scene.fingers))
    different: dict[tuple[object, ...], Motion] = {}
    motions = []
    for finger in scene.fingers:
        parts = finger.fingertip, finger.contact, finger.relaxation
        if parts not in different:
            different[parts] = make_motion(replace(scene, fingers=(finger,)))
        motions.append(different[parts])
    first = motions[0]
    system = assemble(replace(scene, fingers=scene.fingers[:1], control=None, shape=None))
    touches = [motion.cell.touch for motion in motions if motion.cell.touch]
    if 0 < len(touches) < len(motions):
        rule = "must all have a fingertip, or none of them"
        raise ParameterError("scene", "fingers", rule, f"{len(touches)} of {len(motions)} with one")
    cell = replace(first.cell, touch=join_touches(touches) if touches else None)
    cells = tuple(motion.cell for motion in motions)
    controller = _make_controller(scene, system.grid, cells)
    rows = Rows(cell.rows, first.line.length, controller.rows, system.sensors.rows, len(cells))
    hands = _extend(
        HandSystem,
        system,
        cell=cell,
        controller=controller,
        selection=_extend(HandSelection, system.selection, rows=rows, cell=cell),
        rows=rows,
        hands=(),
        cells=cells,
        plans=(),
        press_together=None,
    )

    def plan(line: Queue, steps: tuple[Segment, ...]) -> HandSystem:
        plans = {cell: first.stepper.plan(cell, line, steps) for cell in dict.fromkeys(cells)}
        return replace(
            hands,
            plans=tuple(plans[cell] for cell in cells),
            press_together=import_part(*TOGETHER)(cells, line, steps) if touches else None,
        )

    whole = plan(first.line, first.steps)
    return replace(whole, hands=_make_hand_steps(scene, first, plan))


def _pad_relaxations(fingers: tuple[Finger, ...]) -> tuple[Finger, ...]:
    """Return fingers whose pulps have equally many filters; those that are added lose no force."""
    most = max(len(finger.relaxation.times) if finger.relaxation else 0 for finger in fingers)
    if not most:
        return fingers
    from ..model.relaxation import Relaxation

    padded = []
    for finger in fingers:
        times: tuple[float, ...] = ()
        weights: tuple[float, ...] = (1.0,)
        if finger.relaxation:
            times, weights = finger.relaxation.times, finger.relaxation.weights
        more = most - len(times)
        relaxation = Relaxation((*times, *(1.0,) * more), (*weights, *(0.0,) * more))
        padded.append(replace(finger, relaxation=relaxation))
    return tuple(padded)


def _make_flow(scene: Scene) -> Flow:
    """Return the flow law of the valve, with the conduit if there is one, or of the motor."""
    law: Any = select_law("valve", scene.valve).flow_law(scene.fluid, scene.actuator.area)
    if scene.conduit is None:
        return law
    from ..model.conduit import OrificeAndConduit

    return OrificeAndConduit(law, scene.conduit.resistance(scene.fluid))


def _make_touch(scene: Scene) -> Touch | None:
    """Return the fingertip, or None."""
    finger = require_one(scene.fingers)
    if finger.fingertip is None or finger.contact is None:
        return None
    return Touch(
        finger.fingertip, select_law("contact", finger.contact), finger.relaxation or Unrelaxed()
    )


def _make_sensors(scene: Scene, cell: Cell, line: Queue) -> Sensors:
    """Return the sensor chain of a scene."""
    sensors: Sensors = PerfectSensors()
    sensing = scene.sensors
    if sensing is None:
        return sensors
    from ..model.sensors import Delayed, Noisy, Quantized

    if sensing.noisy:
        sensors = Noisy(sensors, sensing.force_noise, sensing.height_noise, sensing.seed)
    if sensing.force_step or sensing.height_step:
        sensors = Quantized(sensors, sensing.force_step, sensing.height_step)
    if sensing.observer == "valve":
        from ..model.observer import make_valve_observer

        period = scene.simulation.control_period
        sensors = make_valve_observer(sensors, cell, line, period, sensing.motion_floor)
    if sensing.delay:
        sensors = Delayed(sensors, sensing.delay, scene.actuator.rest_height)
    return sensors


def _make_drive(scene: Scene, fastest: float) -> Drive:
    """Return the valves between the controller and the cells; `fastest`: rise without load, m/s."""
    if scene.drive is None:
        return DirectDrive()
    period = scene.simulation.control_period
    if scene.drive.kind == "servo":
        from ..model.servo_drive import make_servos

        # A pin without load loses K_s v0 T_c of its error in a control period; see `check_damping`.
        gain = scene.drive.servo_gain
        if gain * fastest * period > 1.0 + TIE:
            most = 1.0 / (fastest * period)
            rule = f"must be at most {most:.3g} 1/m at this control period, or pins would swing"
            raise ParameterError("drive", "servo_gain", rule, f"{gain:g} 1/m")
        return make_servos(scene.drive, scene.layout, period)
    from ..model.matrix_drive import make_addressing

    floor = scene.sensors.force_floor if scene.sensors else 0.0
    return make_addressing(scene.drive, scene.layout, period, floor)


def _make_controller(scene: Scene, bed: Grid, cells: tuple[Cell, ...]) -> Controller:
    """Return the control method for the cells of all fingers, after the display of a shape, if any."""
    cell, method = cells[0], find_method(scene.method)  # refuses a run whose method is not loaded
    if scene.control is None and scene.shape is None:
        return Uncontrolled()
    from ..control.device_info import DeviceInfo

    sensing = scene.sensors
    floors = (sensing.force_floor, sensing.height_floor) if sensing else (0.0, 0.0)
    device = DeviceInfo(
        bed, cell, scene.simulation.control_period, scene.blister, None, *floors, scene.dead_time
    )
    if scene.drive:
        device = replace(device, commands_wait=True, servos=scene.drive.kind == "servo")
    if scene.shape:
        from ..shapes.fitting import fit_shape

        device = replace(device, heights=fit_shape(scene.shape, bed, cell.actuator).heights)
    controller: Controller | None = None
    if scene.control:
        controller = _build_method(scene, [replace(device, cell=of_finger) for of_finger in cells])
    if scene.shape and not (controller and scene.method == "shape_display"):
        from ..control.displays import make_handover

        controller = make_handover(scene.shape, device, controller, recovers=method.recovers)
    assert controller is not None
    return controller


def _build_method(scene: Scene, devices: list[DeviceInfo]) -> Controller:
    """Return the control method for the devices of all fingers."""
    method = find_method(scene.method)
    # Equal fingers share a controller.
    different = {id(device.cell): method.build(scene.control, device) for device in devices}
    controllers: list[Controller] = [different[id(device.cell)] for device in devices]
    touches = [device.cell.touch for device in devices]
    if len(controllers) == 1 or not all(touches):
        return controllers[0]
    from ..control.following import FollowingControl
    from ..control.hands import HandInGroups, HandTogether
    from ..control.own_method import Guarded
    from ..control.servo import BatchControl
    from ..control.side_by_side import join_controllers

    inner = [each.inner if isinstance(each, Guarded) else each for each in controllers]
    following = tuple(each for each in inner if isinstance(each, FollowingControl))
    if not following:
        return controllers[0]
    tips = [touch.fingertip for touch in touches if touch]
    sizes = tuple(max(tip.length, tip.width) for tip in tips)
    heights = tuple(tip.height for tip in tips)
    felt = max(getattr(scene.control, "felt_force", 0.0), devices[0].force_floor)
    kind: type[PinDivision] = import_part("control.pin_division", following[0].division)
    division, each = kind(following, sizes, heights, felt), tuple(controllers)
    if isinstance(each[0], BatchControl):
        return HandTogether(each, division, join_controllers(controllers))
    return HandInGroups(each, division)
