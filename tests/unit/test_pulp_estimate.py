"""The observer of the pulp: what the physics knows of tension and indentation, found again from forces."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.control.pulp_estimate import PulpEstimate
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.touch import Touch
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Floats = NDArray[np.float64]

PERIOD = 5e-3
CONTACT, RELAXATION = Contact(), Relaxation()
PULP = PulpEstimate(Touch(Fingertip(), CONTACT, RELAXATION), PERIOD, 2.0 * PERIOD, 0.0)


def history(depth: object, count: int) -> tuple[Floats, Floats]:
    """Return forces and tensions of a cell period by period, N, by SciPy, for its indentation over time."""
    rates, shares = RELAXATION.rates[:, 0], RELAXATION.shares
    times = np.arange(count + 1) * PERIOD
    tension = lambda t: CONTACT.tension(np.atleast_1d(depth(t)))  # type: ignore[operator] # noqa: E731
    found = solve_ivp(
        lambda t, z: rates * (tension(t)[0] - z),
        (0.0, times[-1]),
        np.zeros(3),
        t_eval=times,
        rtol=1e-9,
        atol=1e-12,
    )
    own = np.array([tension(t)[0] for t in times])
    return CONTACT.share * np.maximum(own - shares @ found.y, 0.0), own


def observe(forces: Floats, expected: Floats) -> Floats:
    """Return the tensions found, one a period, N."""
    pulp, found = np.zeros((4, 1)), []
    for force, guess in zip(forces[1:], expected[1:], strict=True):
        PULP.observe(pulp, np.array([force]), np.array([guess]))
        found.append(float(pulp[-1, 0]))
    return np.array(found)


def test_the_tension_of_a_press_is_found_from_its_force() -> None:
    forces, own = history(lambda t: 1.5e-3 * np.minimum(t / 0.2, 1.0), 100)
    # The tension is taken as linear within 5 ms, while it grows exponentially; a filter takes 4 ms.
    assert observe(forces, own) == pytest.approx(own[1:], rel=0.01, abs=2e-3)


def test_pulp_relieved_faster_than_it_relaxes_keeps_the_expected_tension() -> None:
    depth = lambda t: np.where(t < 0.5, 1.5e-3, 0.8e-3)  # noqa: E731
    forces, own = history(depth, 104)
    assert forces[-1] == 0.0
    assert own[-1] > 0.3
    # Expected a little too large: it is at most the tension at which there would be a force.
    assert observe(forces, own)[-1] == pytest.approx(own[-1], rel=1e-9)
    assert observe(forces, np.full(own.size, 9.0))[-1] < 2.0


def test_a_predicted_force_is_the_one_that_comes() -> None:
    depth = lambda t: 1.0e-3 + 3e-3 * (t - 0.2)  # noqa: E731
    forces, own = history(lambda t: np.maximum(depth(t), 0.0), 42)
    pulp = np.zeros((4, 1))
    for force, guess in zip(forces[1:41], own[1:41], strict=True):
        PULP.observe(pulp, np.array([force]), np.array([guess]))
    lost = PULP.predict_loss(pulp)
    found = PULP.predict_force(np.array([depth(42 * PERIOD)]), lost)
    assert found == pytest.approx(forces[42], rel=0.01)


@pytest.mark.parametrize("offset", [0.0, 0.2e-3])
def test_the_underside_is_the_contact_law_solved(offset: float) -> None:
    law, depth = Contact(offset=offset), np.array([0.3e-3, 1e-3, 2e-3])
    pulp = PulpEstimate(Touch(Fingertip(), law, RELAXATION), PERIOD, 2.0 * PERIOD, 0.0)
    under, _ = pulp.find_underside(np.full(3, 40e-3), law.tension(depth), 1e-3)
    assert under == pytest.approx(40e-3 - depth, rel=1e-12)


def test_an_underside_is_as_uncertain_as_its_force_over_the_stiffness() -> None:
    depth, step = np.array([0.5e-3, 2e-3]), 1e-8
    slope = CONTACT.share * (CONTACT.tension(depth + step) - CONTACT.tension(depth - step)) / (2.0 * step)
    _, deviation = PULP.find_underside(np.zeros(2), CONTACT.tension(depth), 1e-3)
    assert deviation == pytest.approx(1e-3 / slope, rel=1e-6)


def test_pulp_without_contact_relaxes_for_the_periods_it_was_not_looked_at() -> None:
    pulp = np.ones((4, 2))
    PULP.age(pulp, np.array([4.0, 0.0]))
    assert pulp[:3, 0] == pytest.approx(np.exp(-4.0 * PERIOD / np.array(RELAXATION.times)))
    assert (pulp[:, 1].tolist(), pulp[3, 0]) == ([1.0, 1.0, 1.0, 1.0], 0.0)
