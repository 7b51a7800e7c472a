"""The pulp: exponential spring (equation 11), and its relaxation (10, 12 to 14) against the convolution."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from digiclay.core.model.contact import LARGEST_EXPONENT, Contact
from digiclay.core.model.fingertip import LEVEL, Fingertip
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.model.relaxation import Relaxation
from scipy.integrate import quad

from tests.assemble import Motion, one_cell, record, under

TIMES, WEIGHTS = (4e-3, 70e-3, 1.4), (0.08, 0.62, 0.20, 0.10)


def test_tension_begins_at_the_offset_follows_the_exponential_and_stiffness_grows_with_it() -> None:
    contact, depth = Contact(), np.array([0.3e-3, 1e-3, 2.4e-3])
    expected = [250.0 / 2000.0 * (math.exp(2000.0 * x) - 1.0) for x in depth]
    assert contact.tension(depth) == pytest.approx(expected, rel=1e-13)  # rounding
    # T = b x (1 + m x/2): at 1 nm the second term is 1e-6.
    assert contact.tension(np.array([1e-9])) / 1e-9 == pytest.approx(250.0, rel=2e-6)
    assert Contact(offset=0.5e-3).tension(np.array([-1.0, 0.0, 0.4e-3, 0.5e-3])).tolist() == [0.0] * 4
    # T' = b + m T, by a central difference: truncation (m dx)²/6, 7e-9; rounding 1e-10.
    dx = 1e-7
    low, here, high = contact.tension(np.array([1e-3 - dx, 1e-3, 1e-3 + dx]))
    assert (high - low) / (2 * dx) == pytest.approx(250.0 + 2000.0 * here, rel=1e-7)


def test_tension_stays_finite_at_any_depth_and_is_cut_beyond_all_physical_ones() -> None:
    most = Contact().tension(np.array([1.0, 1e6]))
    assert np.isfinite(most * most).all()  # sums of squares tell whether all is finite
    assert LARGEST_EXPONENT / Contact().exponent > 0.1  # more than a stroke


@pytest.mark.parametrize(("arrangement", "share"), [("aligned", 0.34), ("hexagonal", 0.29)])
def test_the_cells_together_carry_what_a_flat_plate_does(arrangement: str, share: float) -> None:
    # The share f_d was fitted for this: 0.34 on the square grid, 0.29 on the hexagonal one. One constant
    # cannot match all depths: a quarter from 1 to 2.4 mm, averaged over where the finger stands.
    contact, bed = Contact(share=share), make_grid(Layout(rows=15, columns=15, arrangement=arrangement))
    offsets = np.stack(np.meshgrid(np.arange(6), np.arange(6)), axis=-1).reshape(-1, 2) * 0.5e-3
    for depth in (1e-3, 1.5e-3, 2e-3, 2.4e-3):
        poses = np.array([[x, y, -depth, *LEVEL] for x, y in offsets])
        carried = share * contact.tension(-under(Fingertip().outline(poses), bed.x, bed.y)).sum(axis=1)
        assert carried.mean() == pytest.approx(float(contact.tension(np.array([depth]))[0]), rel=0.25)


def reduced(time: float) -> float:
    """Return G(t) as equation 12 is written."""
    decays = (c * math.exp(-time / t) for c, t in zip(WEIGHTS[1:], TIMES, strict=True))
    return (WEIGHTS[0] + sum(decays)) / sum(WEIGHTS)


def convolved(depth: Callable[[float], float], speed: Callable[[float], float], time: float) -> float:
    """Return the force by equation 10: G convolved with dT/dt = (b + m T) dx/dt, by adaptive quadrature."""

    def integrand(tau: float) -> float:
        x = depth(tau)
        return reduced(time - tau) * 250.0 * math.exp(2000.0 * x) * speed(tau) if x > 0.0 else 0.0

    # G falls by 0.62 within 4 ms of the end: that stretch gets its own panels.
    points = [time - s for s in (3e-3, 12e-3, 40e-3) if s < time]
    return quad(integrand, 0.0, time, points=points or None, epsabs=1e-12, epsrel=1e-11, limit=400)[0]


def filtered(own: np.ndarray, first: float, last: float, step: float) -> np.ndarray:
    """Return the filters after a step in which the tension goes linearly from `first` to `last`."""
    return Relaxation().propagator(step) @ np.array([*own, first, 0.5 * (first + last), last])


def test_relaxation_is_the_sum_of_equation_12_from_one_to_what_stays() -> None:
    times = np.array([0.0, 1e-3, 5e-3, 0.1, 1.0, 100.0])
    assert Relaxation().reduced(times) == pytest.approx([reduced(t) for t in times], rel=1e-14)  # rounding
    assert Relaxation().reduced(times[[0, -1]]) == pytest.approx([1.0, 0.08], abs=1e-15)


@pytest.mark.parametrize("slope", [0.0, 3.0])
@pytest.mark.parametrize(("step", "count"), [(1e-4, 500), (1e-3, 200), (20e-3, 10), (50e-3, 4)])
def test_a_constant_and_a_linear_tension_are_filtered_exactly(step: float, count: int, slope: float) -> None:
    own, start = np.zeros(3), 0.0 if slope else 1.7
    for i in range(count):
        own = filtered(own, start + slope * i * step, start + slope * (i + 1) * step, step)
    time = count * step
    expected = start * reduced(time) + slope * quad(reduced, 0.0, time, epsabs=1e-13, epsrel=1e-13)[0]
    # 500 steps of rounding stay below 1e-10.
    assert start + slope * time - Relaxation().relaxed(own) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize(
    ("stepper", "step", "tolerance"), [("bernoulli", 1e-4, 1e-4), ("runge_kutta_4", 5e-4, 1e-6)]
)
@pytest.mark.parametrize(
    ("depth", "speed"),
    [
        (lambda t: 20e-3 * t, lambda t: 20e-3),
        (lambda t: 1e-3 * (1.0 - math.cos(40.0 * t)), lambda t: 40e-3 * math.sin(40.0 * t)),
    ],
    ids=["ramp", "sine"],
)
def test_filters_agree_with_the_convolution(depth, speed, stepper, step, tolerance):
    # A locked pin that the finger presses; the errors of the frozen and linear parts are of order 2 and 4.
    system = one_cell(contact=Contact(share=1.0), stepper=stepper, step=step)
    force = record(system, Motion(lambda times: 40e-3 - np.array([depth(t) for t in times])), 16).force
    for count in (4, 16):
        expected = convolved(depth, speed, count * system.period)
        assert expected > 0.05
        assert force[count, 0] == pytest.approx(expected, rel=tolerance)


def test_a_pulp_one_of_whose_filters_is_cut_in_two_is_the_same() -> None:
    halves = Relaxation((TIMES[0], *TIMES), (WEIGHTS[0], 0.5 * WEIGHTS[1], 0.5 * WEIGHTS[1], *WEIGHTS[2:]))
    motion = Motion(lambda times: 40e-3 - 20e-3 * times)
    whole, cut = (record(one_cell(relaxation=pulp), motion, 20).force for pulp in (Relaxation(), halves))
    assert whole.max() > 0.05
    assert cut == pytest.approx(whole, rel=1e-12)  # rounding


def test_without_contact_the_pulp_decays_like_a_step_without_tension() -> None:
    aged, stepped = np.array([[0.3], [0.2], [0.1]]), np.array([0.3, 0.2, 0.1])
    Relaxation().age(aged, np.full(1, 7e-3))
    for _ in range(7):
        stepped = filtered(stepped, 0.0, 0.0, 1e-3)
    assert aged[:, 0] == pytest.approx(stepped, rel=1e-13)  # rounding


@pytest.mark.parametrize("step", [1e-6, 1e-3, 5e-3, 50e-3])
def test_the_force_lost_over_a_step_is_its_mean_for_a_linear_tension(step: float) -> None:
    own, first, last = np.array([0.3, 0.2, 0.1]), 2.0, 1.2

    def lost_at(time: float) -> float:
        now = first + (last - first) * time / step
        return float(Relaxation().relaxed(filtered(own, first, now, time)))

    weights, share = Relaxation().mean_loss_map(step)
    foreseen = weights @ [*own, first] + share * 0.5 * (first + last)
    # Rounding: what a filter gains in a step of 1 µs is a difference of numbers a million times larger.
    assert foreseen == pytest.approx(quad(lost_at, 0.0, step, epsrel=1e-12)[0] / step, rel=1e-9)


def test_what_relaxes_quicker_than_the_step_is_a_share_of_the_tension() -> None:
    # The slowest of 1 ns filters in a step of 5 ms: all but 2 in 5e6 of the tension is lost at once.
    quick = Relaxation(times=(1e-9, 1e-9, 1e-9))
    weights, share = quick.mean_loss_map(5e-3)
    assert share == pytest.approx(float(quick.shares.sum()), rel=1e-6)
    assert np.all(np.abs(weights) < 1e-6)


@pytest.mark.parametrize("duration", [40e-3, 60e-3, 100e-3])
def test_a_tap_loses_81_percent_of_its_work(duration: float) -> None:
    # A half sine of 2 mm. The weights were fitted to 81 % a tap; in 30 ms to 1 s all lose 78 to 81 %.
    depth = 2e-3 * np.sin(np.pi * np.linspace(0.0, 1.0, 251))
    own, forces = np.zeros(3), [0.0]
    for first, last in itertools.pairwise(Contact().tension(depth)):
        own = filtered(own, first, last, duration / 250)
        forces.append(max(last - float(Relaxation().relaxed(own)), 0.0))
    work = 0.5 * (np.array(forces[1:]) + forces[:-1]) * np.diff(depth)
    assert work.sum() / work[work > 0.0].sum() == pytest.approx(0.81, abs=0.03)
