"""Measurements of a scene's device: single periods, force on a held bed, speed and step of a pin."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats, Modes
from ..base.errors import ParameterError
from ..base.quantity import Parameters, quantity
from ..engine.simulation import begin, periods
from ..model.fingertip import LEVEL, compute_forms, compute_underside
from ..model.layout import Layout, make_grid
from ..model.physics import Speeds, find_contact_force, find_speeds
from ..model.trajectory import Path, Waypoint
from ..scene.assembly import assemble, make_motion
from ..scene.schema import Finger, Scene
from .accuracy import Replay, reference_settings


class Step(NamedTuple):
    """Session at the end of a control period; its arrays are its own."""

    time: float
    """s."""
    height: Floats
    """(n,): Pin tops, m, row by row."""
    force: Floats
    """(n,): Force on each pin, N."""
    finger_forces: Floats
    """(f,): Total force on each finger, N."""
    mode: Modes
    """(n,): Control mode of each pin, see `Mode`."""


def steps(scene: Scene) -> Iterator[Step]:
    """Simulate a scene control period by control period.

    Parameters
    ----------
    scene : Scene
        From `scene`.

    Returns
    -------
    iterator of Step
        One for each control period, in its order: ``time``, s; ``height`` (n,), m; ``force`` (n,),
        N; ``finger_forces`` (f,), N; ``mode`` (n,).

    Raises
    ------
    DigiclayError
        When the scene is none, or the integration leaves the finite numbers.
    """
    system = assemble(require_scene(scene))

    def play() -> Iterator[Step]:
        for state in periods(system, scene.trajectories(), begin(system), scene.periods):
            height, force = state.row(0), state.row(system.rows.force)
            yield Step(
                state.period * system.period, height, force, state.finger_forces(), state.mode()
            )

    return play()


def require_scene(scene: object) -> Scene:
    """Return a scene, or refuse what is none."""
    if not isinstance(scene, Scene):
        rule = "must be a Scene, as digiclay.scene returns it"
        raise ParameterError("scene", "", rule, repr(scene))
    return scene


def force(scene: Scene, pose: ArrayLike) -> Floats:
    """Return the force of a finger on each pin of a bed whose pins are held at their rest height.

    It is the elastic force of the first instant, ``F = f_d (b / m) (exp(m (δ - x0)) - 1)`` of the
    indentation δ (equation 11); held on, it falls as ``G(t) F`` (equation 12, with the scene's
    ``relaxation``).

    Parameters
    ----------
    scene : Scene
        With one finger. Control, valves and paths have no effect.
    pose : array_like, (3,) or (7,)
        Lowest point of the finger, m, and its quaternion w, x, y, z; without one the finger is
        level.

    Returns
    -------
    ndarray, (n,)
        Force on each pin, N, row by row; their sum is the force on the finger.

    Raises
    ------
    DigiclayError
        Without a fingertip or with several; for a pose of other than 3 or 7 finite numbers; for a
        finger deeper in the bed than half its thickness. The law was measured up to 2 N and 3 mm.
    """
    cell, bed = make_motion(require_scene(scene)).cell, make_grid(scene.layout)
    if cell.touch is None:
        raise ParameterError("fingertip", "", "must be given to press a bed", "absent")
    numbers = np.ravel(pose).tolist()
    point = Waypoint(position=numbers[:3], orientation=numbers[3:] or LEVEL)
    pose = Path("linear", (point,)).trajectory().poses(np.zeros(1))
    forms = compute_forms(cell.touch.fingertip.outline(pose))
    under = compute_underside(*forms, bed.compute_basis(np.arange(bed.count)))[0]
    depth, thickness = scene.actuator.rest_height - float(under.min()), cell.touch.fingertip.height
    if depth > thickness:
        raise ParameterError(
            "force", "pose", f"must press at most {thickness:g} m deep", f"{depth:g} m"
        )
    state = np.zeros((cell.rows, bed.count))
    state[0] = scene.actuator.rest_height
    return find_contact_force(cell, state, under)


def free_speed(scene: Scene) -> Speeds:
    """Return the speeds of a pin without load behind a fully open valve.

    They are ``q / A_a`` (equation 1) of the flow q at the opening K = -1 or 1 under the pressure of
    its reservoir (equations 6 and 7), with the conduit, if the scene has one.

    Parameters
    ----------
    scene : Scene
        Supply, fluid, valve, conduit and actuator count.

    Returns
    -------
    Speeds
        ``fall``, at most 0, and ``rise``, at least 0, m/s.

    Raises
    ------
    DigiclayError
        When the scene is none.
    """
    return find_speeds(make_motion(replace(require_scene(scene), fingers=scene.fingers[:1])).cell)


class Response(NamedTuple):
    """Response of a pin to a step of its valve command."""

    time: Floats
    """(t,): Since the command, s."""
    height: Floats
    """(t,): Pin top, m."""


@dataclass(frozen=True, eq=False, repr=False)
class ValveStep(Parameters):
    """Step of a valve command, and the time for which it is held."""

    command: float = quantity(1.0, "valve command", symbol="K_com", at_least=-1.0, at_most=1.0)
    duration: float = quantity(0.1, "duration", unit="s", above=0.0, at_most=100.0)


def step_response(scene: Scene, command: float, duration: float = 0.1) -> Response:
    """Return how a pin without load rises or falls after a step of its valve command.

    After the dead time t_d the opening follows ``τ_v dK/dt + K = K_com`` (equation 9), and the
    height ``dH/dt = q(K) / A_a`` (equations 1, 6 and 7), up to the end stops. It is integrated as a
    run, with at least four steps in each of the run's.

    Parameters
    ----------
    scene : Scene
        Actuator, supply, fluid, valve, conduit, valve lag, delay and control period count.
    command : float
        Valve command K_com from -1 (down) to 1 (up).
    duration : float
        Time for which it is held, s, at most 100 s.

    Returns
    -------
    Response
        ``time`` (t,), s, one value for each control period from 0 on, and ``height`` (t,), m.

    Raises
    ------
    DigiclayError
        When the scene is none, or command or duration is out of range.
    """
    step = ValveStep(command=command, duration=duration)
    nothing = Finger(None, None, None, Path(waypoints=(Waypoint(),)))
    simulation = reference_settings(
        replace(require_scene(scene).simulation, duration=step.duration)
    )
    single = Layout(rows=1, columns=1, pitch=scene.layout.pitch)
    absent = ("control", "blister", "shape", "sensors", "recorder", "drive")
    parts: Any = dict.fromkeys(absent)
    pin = replace(scene, layout=single, fingers=(nothing,), simulation=simulation, **parts)
    commands = np.full((pin.periods, 1), step.command)
    system = assemble(pin)
    system = replace(system, controller=Replay(system.grid, commands))
    states = periods(system, pin.trajectories(), begin(system), pin.periods)
    heights = [scene.actuator.rest_height, *(float(state.row(0)[0]) for state in states)]
    return Response(np.arange(len(heights)) * system.period, np.array(heights))
