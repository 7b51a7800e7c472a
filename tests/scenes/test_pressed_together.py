"""Pins that several fingertips press: by the law of each, as SciPy has them; bounded where they are stiff."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from digiclay.core.engine.simulation import advance, begin
from digiclay.core.model.fingertip import compute_forms, compute_underside
from digiclay.core.model.layout import Layout
from digiclay.core.model.touch import compute_force
from digiclay.core.scene.assembly import assemble
from digiclay.core.session.accuracy import Replay
from scipy.integrate import solve_ivp

from tests.assemble import assert_near, table
from tests.scenes.test_hands import FINGER, LONG, PAPER, PERIOD, REST, SOFT, press, scene


def replaying(fingers, commands, **parts):
    """Return a bed under fingers that plays commands, (t, n)."""
    system = assemble(scene(None, *fingers, **parts))
    return replace(system, controller=Replay(system.grid, commands))


def test_a_finger_presses_as_its_law_says_in_the_period_in_which_another_one_lands():
    system = replaying((FINGER, SOFT), np.full((60, 2500), 0.4))
    poses, touch = press(system, [(-3e-3, 1e-3), (3e-3, -1e-3)], (0.0, 0.0), 60), system.cell.touch
    poses[:30, :, 1, 2] += 30e-3  # it lands within a period, 3 mm deep
    state, rows, together = begin(system), system.rows.pressing, 0
    for finger, at_end in zip(system.trace(poses, 0), poses[:, -1], strict=True):
        state = advance(system, state, finger)
        active, near, first = state.active, state.active.near, system.cell.pulp_rows.start
        pressing = active.block[rows, :near]
        for own, pose, force in zip(touch.each, at_end, pressing, strict=True):
            forms = compute_forms(own.fingertip.outline(pose[None]))
            (under,) = compute_underside(*forms, active.quadratic_basis[:, :near])
            filters = active.block[first : first + own.pulp.rows, :near]
            lawful = compute_force(own, active.block[0, :near], under, filters)
            np.testing.assert_allclose(force, lawful, rtol=1e-9, atol=1e-12)  # rounding
            first += own.pulp.rows
        together += np.count_nonzero((pressing > 0.0).all(axis=0))
    assert together > 100


#: A bore of 0.2 mm, and an orifice of 2 mm: a pin rises at meters a second.
NARROW = {"actuator": replace(PAPER.actuator, bore=0.2e-3)}
WIDE = {"valve": replace(PAPER.valve, orifice_diameter=2e-3)}


def pose_at(x, y, z, turn=0.0):
    """Return poses (..., 7) of a fingertip at places, m, turned about the vertical, rad."""
    x, y, z, half = np.broadcast_arrays(x, y, z, turn / 2)
    return np.stack([x, y, z, np.cos(half), 0 * x, 0 * x, np.sin(half)], axis=-1)


def slide(finger, apart):
    """Return the poses at times, s, of one of two fingertips so far apart, m, that press, rock and slide."""

    def poses(times):
        depth = 1.9e-3 * np.sin(np.minimum(16.0 * times, np.pi / 2)) + finger * 0.3e-3 * np.sin(
            20.0 * times
        )
        x = (finger - 0.5) * apart + 4e-3 * np.sin(9.0 * times)
        return pose_at(x, (0.5e-3, 1.8e-3)[finger], REST + 0.6e-3 - depth, 0.3 * (finger + 1))

    return poses


def rock(finger):
    """Return the poses at times, s, of a fingertip that presses while the other one yields, and so on."""
    x, y = ((-2.2e-3, 0.5e-3), (2.4e-3, -1.1e-3), (0.4e-3, 3.1e-3))[finger]

    def poses(times):
        part = np.minimum(1.0, times / 0.06)
        depth = 1.6e-3 + 0.5e-3 * np.sin(2.0 * np.pi * times / 0.06 + np.pi * finger)
        return pose_at(x, y, REST + 0.6e-3 - part**2 * (3.0 - 2.0 * part) * depth)

    return poses


def play(system, poses):
    """Return heights and forces, (t, n), and how often the first two fingers press each cell, (n,)."""
    state, rows, pressed = begin(system), [], np.zeros(system.grid.count)
    for finger in system.trace(poses, 0):
        state = advance(system, state, finger)
        rows.append((state.row(0), state.row(system.rows.force)))
        own = np.array([state.row(row) for row in range(system.rows.count)[system.rows.pressing]])
        pressed += (own[:2] > 0.0).all(axis=0)
    return *np.array(rows).swapaxes(0, 1), pressed


def at_times(system, ways, periods):
    """Return poses (t, p, f, 7) of fingertips with these ways."""
    times = np.arange(periods)[:, None] * PERIOD + system.instants
    return np.stack([way(times) for way in ways], axis=2)


def integrate(system, cell, commands, ways):
    """Return height and force, (t,), of a cell by SciPy."""
    touches, parts, lag, dead = system.cell.touch.each, system.cell, 2e-3, 1e-3
    x, y = system.grid.x[cell], system.grid.y[cell]
    basis = np.array([[1.0, x, y, x * x, x * y, y * y]]).T
    # Between two of these, 25 µs apart, an underside is straight to within 1 nm.
    moments = np.linspace(0.0, len(commands) * PERIOD, 200 * len(commands) + 1)
    forms = [
        compute_forms(touch.fingertip.outline(way(moments)))
        for touch, way in zip(touches, ways, strict=True)
    ]
    undersides = [compute_underside(*form, basis).ravel() for form in forms]

    def press_at(time, height, filters):
        forces, rates, first = [], [], 0
        for touch, underside in zip(touches, undersides, strict=True):
            law, own = touch.contact, filters[first : first + touch.pulp.rows]
            depth = max(height - np.interp(time, moments, underside), 0.0)
            tension = law.stiffness / law.exponent * np.expm1(law.exponent * depth)
            forces.append(law.share * max(tension - float(touch.pulp.shares @ own), 0.0))
            rates.append(touch.pulp.rates[:, 0] * (tension - own))
            first += touch.pulp.rows
        return forces, rates

    def change(time, state, command):
        forces, rates = press_at(time, state[0], state[2:])
        drop = parts.supply.pressure(state[1:2]) - sum(forces) / parts.actuator.area
        speed = parts.flow.flow(state[1:2], drop)[0] / parts.actuator.area
        return np.concatenate([[speed, (command - state[1]) / lag], *rates])

    state = np.zeros(2 + sum(touch.pulp.rows for touch in touches))
    state[0], before, rows = REST, 0.0, []
    for period, command in enumerate(commands[:, cell]):
        start = period * PERIOD
        for a, b, given in ((start, start + dead, before), (start + dead, start + PERIOD, command)):
            solved = solve_ivp(
                change, (a, b), state, "LSODA", args=(given,), rtol=1e-7, atol=1e-12, max_step=1e-3
            )
            state = solved.y[:, -1]
        before = command
        forces, _ = press_at(start + PERIOD, state[0], state[2:])
        rows.append((state[0], sum(forces)))
    return np.array(rows).T


SLACK = replace(FINGER, contact=replace(FINGER.contact, exponent=1000.0, stiffness=300.0))
STEEP = replace(FINGER, contact=replace(FINGER.contact, exponent=2e4))
ELASTIC = replace(FINGER, relaxation=None)
#: Pins a side; largest command, and for how many periods each lasts; periods.
SLIDE, LOCKED, QUICK = (15, 0.3, 1, 45), (1, 0.0, 1, 30), (5, 0.5, 5, 30)
#: In how many periods two fingers press the pin, at least; largest errors, m and N.
CASES = {
    # What is asked for: 3 µm and 3 mN.
    "7 mm apart": (SLIDE, {}, partial(slide, apart=7e-3), (FINGER, FINGER), (10, 3e-6, 3e-3)),
    "another exponent": (SLIDE, {}, partial(slide, apart=6e-3), (FINGER, SOFT), (10, 3e-6, 3e-3)),
    "another size and relaxation": (
        SLIDE,
        {},
        partial(slide, apart=7e-3),
        (FINGER, LONG),
        (10, 3e-6, 3e-3),
    ),
    "one elastic": (SLIDE, {}, partial(slide, apart=6e-3), (FINGER, ELASTIC), (10, 3e-6, 3e-3)),
    # 0.17 and 0.33 mN; 0.6 by the trapezoidal rule, 0.7 in one part, 1.1 without the bend of
    # the way, 0.35 if a finger may be pressed harder than alone, 1.7 where another m is not of
    # equal slope.
    "locked": (LOCKED, {}, rock, (FINGER, FINGER), (10, 0.0, 0.3e-3)),
    "locked, a slack one": (LOCKED, {}, rock, (FINGER, SLACK), (10, 0.0, 0.4e-3)),
    # Measured 34, 96, 42 and 25 µm, and 2, 1, 18 and 17 mN: bounded, not accurate
    # (docs/stability.md).
    "bore 0.2 mm": (QUICK, NARROW, rock, (FINGER, FINGER), (1, 0.1e-3, 5e-3)),
    "bore 0.2 mm, three unlike": (QUICK, NARROW, rock, (FINGER, SOFT, LONG), (0, 0.2e-3, 5e-3)),
    "orifice 2 mm, three unlike": (QUICK, WIDE, rock, (FINGER, SOFT, LONG), (5, 0.1e-3, 50e-3)),
}


@table("bed, parts, motion, fingers, bounds", CASES)
def test_a_pin_that_several_fingers_press_agrees_with_scipy(bed, parts, motion, fingers, bounds):
    (side, largest, lasting, periods), (together, apart, force_apart) = bed, bounds
    commands = np.random.default_rng(3).uniform(-largest, largest, (periods // lasting, side**2))
    commands = commands.repeat(lasting, axis=0)
    system = replaying(fingers, commands, layout=Layout(side, side), **parts)
    ways = [motion(finger) for finger in range(len(fingers))]
    heights, forces, pressed = play(system, at_times(system, ways, periods))
    # The pin that two press longest; of several, the one that is pressed longest.
    cell = np.lexsort(((forces > 0.0).sum(axis=0), pressed))[-1]
    assert pressed[cell] >= together
    assert (forces[:, cell] > 0.0).sum() >= 10
    height, force = integrate(system, cell, commands, ways)
    assert_near(heights[:, cell], height, apart)
    assert_near(forces[:, cell], force, force_apart)


@pytest.mark.parametrize(
    "fingers, parts, seed",
    [
        ((FINGER,) * 2, NARROW, 0),
        ((FINGER,) * 3, WIDE, 3),
        ((FINGER, STEEP, SOFT), NARROW, 3),
        ((FINGER, STEEP, SOFT), WIDE, 0),
    ],
)
def test_a_pin_that_rises_into_several_fingertips_is_pressed_at_most_as_by_each_alone(
    fingers, parts, seed
):
    random, layout = np.random.default_rng(seed), Layout(rows=5, columns=5)
    commands = random.uniform(-1.0, 1.0, (6, 25)).repeat(10, axis=0)
    turn, shift = random.uniform(0.0, 2.0 * np.pi), random.uniform(-1.5e-3, 1.5e-3, 2)
    across, along = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    middles = [
        x * across + y * along + shift for x, y in ((-4e-3, 0.7e-3), (3.5e-3, -1e-3), (1e-3, 4e-3))
    ]
    system = replaying(fingers, commands, layout=layout, **parts)
    poses = press(system, [(x, y) for x, y in middles[: len(fingers)]], (0.0, 0.0), 60)
    _, forces, _ = play(system, poses)
    alone = [
        play(replaying((own,), commands, layout=layout, **parts), poses[:, :, [i]])[1].max()
        for i, own in enumerate(fingers)
    ]
    # None is pressed harder than alone, so together they press as many times as hard at most: 1.3
    # times here, 2.25 among hundreds; 1e52 where a finger that a pin meets within half a step is
    # not seen.
    assert forces.max() <= len(fingers) * max(alone)


@pytest.mark.parametrize("count", [2, 3])
def test_a_finger_that_comes_or_goes_within_a_step_takes_no_pin_lower_than_one_that_stays(count):
    system = replaying((FINGER,) * count, np.zeros((1, 1)), layout=Layout(1, 1))
    random = np.random.default_rng(0)
    assert system.press_together is not None
    pins = 500
    fingers, heights = np.arange(count).repeat(pins).reshape(count, pins), np.full(pins, REST)
    valves, filters = np.tile(random.uniform(-1.0, 1.0, pins), (3, 1)), np.zeros((3, count, pins))
    # The first presses; each of the others does at the first one or two instants of the step, or
    # the last.
    pressed = random.uniform(0.2e-3, 2e-3, (count, pins))
    away = random.choice([2e-3, 47e-3, 1.0], (count, pins))
    last, goes = random.integers(1, 3, (count, pins)), random.integers(0, 2, (count, pins)) == 1
    presses = np.array([(goes == (instant < last)) for instant in range(3)])
    presses[:, 0] = True
    under = REST + np.where(presses, -pressed, away)
    stays = np.broadcast_to(REST - pressed, under.shape)
    jumped, held = (
        system.press_together(heights, valves, filters, one, fingers)[0] for one in (under, stays)
    )
    # Rounding; 80 µm lower where a parabola through three instants is followed below the lowest of
    # them.
    assert (jumped >= held - 1e-9).all()
