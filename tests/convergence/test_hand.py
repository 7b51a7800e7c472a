"""Hand and pins together, by SciPy's integration of the coupled equations; the hand alone."""

import numpy as np
import pytest
from digiclay.core.model.yielding_hand import Hand, make_swing
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import run
from scipy.integrate import solve_ivp

from tests.assemble import over_middle
from tests.convergence.test_independent import flow, numbers, spline, tension, underside

#: A press of 0.7 N that ends in a quick lift, under Method I.
WAY = over_middle((0, 42e-3), (0.12, 36.5e-3), (0.2, 36e-3), (0.28, 42e-3), (0.4, 44e-3))
HANDS = {
    "as in the literature": {},
    "light and stiff": {"mass": 0.5e-3, "damping": 1.0, "stiffness": 2000.0},
    "heavy and soft": {"mass": 50e-3, "damping": 2.0, "stiffness": 100.0},
}


def made(hand, step):
    tables = {
        "layout": {"rows": 11, "columns": 11},
        "simulation": {"physics_step": step},
        "trajectory": {"waypoints": WAY},
        "hand": hand,
    }
    return run(resolve(tables))


def integrate(scene, history):
    """Return deflections (t,), m, and total forces (t,), N, of the equations under recorded commands."""
    p, hand, count = numbers(), scene.fingers[0].hand, len(history["position"])
    curve, (x, y) = spline(scene.fingers[0].trajectory.trajectory()), history["position"].T
    climb = curve.derivative()

    def press(t, rise, height, filters):
        at = curve(t) + np.array([0.0, 0.0, rise])
        pull = tension(p, height - underside(p, at, x, y))
        return pull, p.share * np.maximum(pull - p.weights @ filters, 0.0)

    def rhs(t, state, command):
        (rise, speed), rest = state[:2], state[2:].reshape(5, count)
        height, opening, filters = rest[0], rest[1], rest[2:]
        pull, force = press(t, rise, height, filters)
        drop = np.where(opening > 0.0, p.high, p.low) - force / p.area
        push = force.sum() - hand.damping * (speed - climb(t)[2]) - hand.stiffness * rise
        rates = flow(p, opening, drop) / p.area, (command - opening) / p.lag
        rows = np.concatenate([*rates, (p.rates * (pull - filters)).ravel()])
        return np.concatenate([[speed - climb(t)[2], push / hand.mass], rows])

    commands = np.concatenate([np.zeros((1, count)), history["command"][:-1]])
    state = np.zeros(2 + 5 * count)
    state[2 : 2 + count] = history["height"][0]
    rises, forces = [0.0], [0.0]
    for row, (start, end) in enumerate(zip(history["time"], history["time"][1:], strict=False)):
        for seen, *span in ((row, start, start + p.dead_time), (row + 1, start + p.dead_time, end)):
            args = (commands[seen],)
            state = solve_ivp(rhs, span, state, "DOP853", rtol=1e-7, atol=1e-9, args=args).y[:, -1]
        rest = state[2:].reshape(5, count)
        rises.append(state[0])
        forces.append(press(end, state[0], rest[0], rest[2:])[1].sum())
    return np.array(rises), np.array(forces)


@pytest.mark.parametrize("hand", HANDS.values(), ids=HANDS)
def test_path_and_force_agree_with_scipy_better_the_shorter_the_step(hand):
    far = []
    for step in (2.5e-3, 0.5e-3):
        result = made(hand, step)
        history = result.history
        rises, forces = integrate(result.scene, history)
        assert forces.max() > 0.3
        assert rises.max() > 0.3e-3
        rise = history["fingertip"][:, 2] - history["intended_height"]
        departures = np.abs([rise - rises, (history["total_force"] - forces) / forces.max()])
        far.append(departures.max(axis=1))
    coarse, fine = far
    # Second order: 25 times less; at least four times less where contact begins within a step.
    assert fine[0] < 0.25 * coarse[0]
    # 1 µm and 0.4 % of the largest force at impact, where the force rises by 0.1 N per millisecond.
    assert (fine < [2e-6, 1e-2]).all()


def swing_alone(hand, time, step, rate=0.0, climb=0.0):
    """Return rise and speed after a time, s, of a hand under a force that grows, N/s, on a path, m/s."""
    swing = make_swing([hand], step, step)
    now = swing.rest()
    for number in range(round(time / step)):
        path = climb * step * np.array([[number], [number + 0.5], [number + 1.0]])
        now, _ = swing.move(now, path, np.array([rate * step * (number + 1)]))
    return np.array([now.rise[0], now.speed[0]])


def test_a_hand_alone_swings_as_its_closed_form():
    hand, time, rate = Hand(mass=5e-3, damping=0.0, stiffness=300.0), 20e-3, 50.0
    speed = (hand.stiffness / hand.mass) ** 0.5
    wanted = time - np.sin(speed * time) / speed, 1.0 - np.cos(speed * time)
    wanted = np.array(wanted) * rate / hand.stiffness
    coarse, fine = (np.abs(swing_alone(hand, time, step, rate) - wanted) for step in (1e-3, 0.1e-3))
    # Of second order: 100 times less, and at least 50 times.
    assert (fine < 0.02 * coarse).all()
    # 0.1 % of 3.9 mm and 0.19 m/s.
    assert (fine < [4e-6, 0.4e-3]).all()


def test_a_hand_lags_behind_a_growing_force_by_its_damping_and_not_behind_its_path():
    hand, rate = Hand(), 1.0
    found = swing_alone(hand, 0.5, 5e-3, rate, climb=0.01)
    # (F - D/K dF/dt) / K after 30 time constants; a growing force and path are followed exactly.
    rise = (0.5 * rate - hand.damping / hand.stiffness * rate) / hand.stiffness
    np.testing.assert_allclose(found, [rise, 0.01 + rate / hand.stiffness], rtol=1e-9)
