"""Beds put together part by part for tests: every part at its default unless a test names another."""

from collections.abc import Callable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.base.modes import Mode
from digiclay.core.control.blister import Blister
from digiclay.core.control.travel import Heading
from digiclay.core.control.virtual_master import Master, Phase, VirtualMaster
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.engine.state import State
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.conduit import Conduit
from digiclay.core.model.contact import Contact
from digiclay.core.model.control_interface import Commands
from digiclay.core.model.delay import Delay
from digiclay.core.model.fingertip import LEVEL, Fingertip, compute_forms, compute_underside
from digiclay.core.model.lag import ValveLag
from digiclay.core.model.layout import Layout
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.trajectory import Path, make_level
from digiclay.core.model.valve import Fluid, Valve
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Finger, Scene, Simulation
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.take import play
from numpy.typing import NDArray


def table(columns, rows):
    """Give a test each row of a table; the sentence before a row names it."""
    return pytest.mark.parametrize(columns, list(rows.values()), ids=list(rows))


def assert_near(found, wanted, apart):
    """Assert that numbers are no farther from those wanted than this, each."""
    np.testing.assert_allclose(found, wanted, rtol=0, atol=apart)


@contextmanager
def refused_in_a_line(error, words=None):
    """Assert that what is done here is refused, in one line that has some words (a pattern)."""
    with pytest.raises(error, match=words) as caught:
        yield caught
    assert "\n" not in str(caught.value)


def path(*waypoints, interpolation="smooth"):
    """Return the path of a level finger through waypoints (time in s, then x, y, z in mm)."""
    table = np.array(waypoints, float)
    return make_level(table[:, 0], table[:, 1:] * 1e-3, interpolation)


def over_middle(*points):
    """Return waypoints, as a scene file has them, of a finger over the middle: time in s, height in m."""
    return [{"time": time, "position": [0, 0, height]} for time, height in points]


#: A finger nobody meets.
AWAY = path((0.0, 0.0, 0.0, 500.0))


@dataclass(frozen=True)
class Motion:
    """A level finger that moves over the origin as a function of time says, m."""

    height: Callable[[Floats], Floats]

    def poses(self, times):
        """Return poses (k, 7)."""
        poses = np.tile([0.0, 0.0, 0.0, *LEVEL], (times.size, 1))
        poses[:, 2] = self.height(times)
        return poses


def fitting(layout):
    """Return the default blister, made smaller where it would be wider than the bed."""
    share = min(1.0, max(layout.columns * layout.pitch, layout.rows * layout.row_spacing) / 30e-3)
    usual = Blister()
    return Blister(usual.radius * share, usual.edge_radius * share, usual.flat_radius * share)


def make_system(
    layout=None,
    *,
    stepper="bernoulli",
    period=5e-3,
    step=1e-3,
    dead_time=1e-3,
    control=None,
    blister=None,
    others=(),
    **parts,
):
    """Return a bed; parts that are None are left out, and without `control` every valve stays shut.

    `others`: what further fingers have unlike the first. `control` is the parameters of Method I,
    or a function that makes a controller for a control period.
    """
    master = control if isinstance(control, VirtualMaster) else None
    given = {
        "actuator": Actuator(),
        "supply": Supply(),
        "fluid": Fluid(),
        "valve": Valve(),
        "conduit": Conduit(),
        "valve_lag": ValveLag(),
    }
    finger = {"fingertip": Fingertip(), "contact": Contact(), "relaxation": Relaxation()}
    assert parts.keys() <= given.keys() | finger.keys(), f"no such part among {parts.keys()}"
    fingers = (Finger(trajectory=Path.press(40e-3), **finger),)
    bed = layout or Layout()
    scene = Scene(
        **given,
        layout=bed,
        delay=Delay(dead_time),
        control=master,
        blister=(blister or fitting(bed)) if master else None,
        simulation=Simulation(period, step, stepper),
        recorder=None,
        fingers=fingers,
    )
    scene = scene.with_sections(**parts)
    more = (replace(scene.fingers[0], **own) for own in others)
    system = assemble(replace(scene, fingers=(*scene.fingers, *more)))
    return replace(system, controller=control(period)) if callable(control) else system


@dataclass(frozen=True)
class Scripted:
    """A controller without feedback: the command of every cell is a function of time and place."""

    script: Callable[[float, Floats, Floats], Any]
    period: float

    rows = 0

    def begin(self):
        """Return the number of periods done."""
        return 0

    def locate(self, memory, touched):
        """Ask for the whole bed."""
        return memory, (0.0, 0.0, 1.0)

    def command(self, memory, seen):
        """Command what the script says."""
        _, x, y, *_ = seen.quadratic_basis
        command = np.broadcast_to(self.script(memory * self.period, x, y), x.shape).astype(float)
        return memory + 1, Commands(
            seen.target.copy(), np.full(x.size, Mode.HOLD, np.int8), command
        )


def scripted(script):
    """Return a scripted controller for `make_system`; `script` takes time, x and y."""
    return lambda period: Scripted(script, period)


@dataclass(frozen=True)
class Record:
    """A session row by row, as ``history.npz`` has it, with all state rows besides."""

    time: Floats
    height: Floats
    force: Floats
    command: Floats
    mode: NDArray[np.int8]
    rows: Floats
    memory: list[Any]
    last: State


def whole(state):
    """Return all rows of all cells, (r, n)."""
    return np.array([state.row(index) for index in range(len(state.rows))])


def record(
    system,
    trajectory,
    count,
    state=None,
):
    """Simulate `count` control periods, of a finger or several; row 0 is the state handed in."""
    fingers = trajectory if isinstance(trajectory, Sequence) else [trajectory]
    state = state.copy() if state else begin(system)
    rows, modes, memory = [whole(state)], [], []
    for state in periods(system, fingers, state, count):  # noqa: B020
        rows.append(whole(state))
        modes.append(state.mode())
        memory.append(state.memory)
    kept = np.array(rows)
    command = np.concatenate([kept[1:, system.rows.command], np.zeros((1, system.grid.count))])
    time = np.arange(count + 1) * system.period
    mode = np.array([*modes, state.mode()])
    return Record(time, kept[:, 0], kept[:, system.rows.force], command, mode, kept, memory, state)


def replayed(take):
    """Tell whether a take played again ends in the very same state, bit for bit."""
    *_, (system, last) = play(take)
    return snapshot.dump(system, last) == take.end


def make_basis(x, y):
    """Return rows 1, x, y, x², x y, y² of some places."""
    return np.array([np.ones(x.size), x, y, x * x, x * y, y * y])


def under(outline, x, y):
    """Return the finger's underside, (k, n), m, for outlines (k, 10)."""
    return compute_underside(*compute_forms(outline), make_basis(x, y))


def one_cell(**parts):
    """Return a bed of a single cell at the origin."""
    return make_system(Layout(rows=1, columns=1), **parts)


def master(*toward, **known):
    """Return a master that shapes at the bed's center, 5 mm above it, and travels some way or none."""
    start = Master(Phase.SHAPING, height=45e-3, reference=40e-3, edge=40e-3)
    return start._replace(heading=Heading(0.0, 0.0, *toward), **known)


#: A sample of each method that stands in stacks.
STACKABLE = {
    "virtual_master": "ridge_mound_valley",
    "cell_states": "ridge_mound_valley",
    "hybrid": "slow_press",
    "elastic": "elastic_press",
    "plastic": "plastic_press",
    "viscous": "viscous_press",
    "push_pull": "push_pull",
    "force_display": "force_display",
    "shape_display": "shape_display",
}


def sample(name, *settings):
    """Return a sample scene with some settings, ``key=value``."""
    return load(find(name), [Setting(*setting.split("=")) for setting in settings])


def followed(method, way, cells=15, **sections):
    """Return a scene of a square bed whose fingertip goes through places (time in s, then x, y, z in mm)."""
    points = [{"time": t, "position": [x * 1e-3, y * 1e-3, z * 1e-3]} for t, x, y, z in way]
    layout = {"rows": cells, "columns": cells, **sections.pop("layout", {})}
    trajectory = {"waypoints": points, **sections.pop("trajectory", {})}
    return resolve(
        {"layout": layout, "control": {"method": method}, "trajectory": trajectory, **sections}
    )


def beginning(name, lasting, stepper, step, *settings):
    """Return at most the first seconds of a sample scene, with a stepper and a physics step, s."""
    stepped = (f"simulation.stepper={stepper}", f"simulation.physics_step={step}")
    scene = sample(name, *stepped, *settings)
    duration = min(scene.simulation.duration, lasting)
    return replace(scene, simulation=replace(scene.simulation, duration=duration))


def moved(known, x, z, lasting=None, pace=1.0):
    """Return a scene of the same way elsewhere, m, in a share of its time, that lasts so long, s."""
    points = tuple(
        replace(point, time=point.time * pace, position=tuple(np.add(point.position, (x, 0.0, z))))
        for point in known.section("trajectory").waypoints
    )
    simulation = replace(known.simulation, duration=lasting or known.simulation.duration)
    return known.with_sections(
        trajectory=replace(known.section("trajectory"), waypoints=points), simulation=simulation
    )


def assert_goes_on(made, before, after):
    """Assert that a session goes on from a state kept after some control periods as if it had not stopped."""
    system, paths = assemble(made), made.trajectories()
    *_, half = periods(system, paths, begin(system), before)
    data = snapshot.dump(system, half)
    *_, end = periods(system, paths, half, after)
    *_, again = periods(system, paths, snapshot.load(system, data), after)
    assert snapshot.dump(system, again) == snapshot.dump(system, end)
