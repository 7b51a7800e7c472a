"""The conduit in series with the valve (equation 8)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.model.conduit import Conduit, OrificeAndConduit, connect_in_series
from digiclay.core.model.valve import Fluid, Valve, make_orifice
from scipy.integrate import quad

THIN = Fluid(density=760.0, viscosity=0.65e-6)
NARROW = Conduit(length=10e-3, diameter=0.3e-3)
OPENINGS, DROPS = (grid.ravel() for grid in np.meshgrid([0.03, 0.2, 0.6, 1.0], np.geomspace(10.0, 1e6, 9)))


def series(gap: str = "stroke") -> OrificeAndConduit:
    """A wide valve, a thin fluid and a narrow conduit: both branches, and drops of like size."""
    return connect_in_series(make_orifice(Valve(orifice_diameter=0.8e-3, gap=gap), THIN), NARROW, THIN)


def valve_drop(law: OrificeAndConduit, flow: np.ndarray, opening: np.ndarray, power: int) -> np.ndarray:
    """Return the drop over the valve alone: the inverse of each branch, told apart by Re* (Q = 4e4 ν h)."""
    gap = 30e-6 * (opening if power == 1 else 1.0)
    laminar = flow / (law.valve.laminar * opening**power)
    turbulent = (flow / (law.valve.turbulent * opening)) ** 2
    return np.where(flow < 4e4 * THIN.viscosity * gap, laminar, turbulent)


def test_the_resistance_is_that_of_a_parabolic_profile() -> None:
    fluid, conduit = Fluid(), Conduit()
    edge, gradient = conduit.diameter / 2.0, 1e5 / conduit.length

    def ring(r: float) -> float:
        return gradient * (edge**2 - r**2) / (4.0 * fluid.dynamic_viscosity) * 2.0 * math.pi * r

    # The integrand is a cubic: quadrature is exact but for rounding.
    assert conduit.resistance(fluid) == pytest.approx(1e5 / quad(ring, 0.0, edge)[0], rel=1e-12)


@pytest.mark.parametrize(("gap", "power"), [("stroke", 2), ("opening", 1)])
def test_the_drops_of_valve_and_conduit_add_up(gap: str, power: int) -> None:
    law = series(gap)
    flow = law.flow(OPENINGS, DROPS)
    total = valve_drop(law, flow, OPENINGS, power) + law.resistance * flow
    assert total == pytest.approx(DROPS, rel=1e-12)  # rounding: the quadratic is solved without cancellation


def test_the_drops_were_added_up_in_both_branches() -> None:
    flow = series().flow(OPENINGS, DROPS)
    turbulent = flow > 4e4 * THIN.viscosity * 30e-6
    assert 5 < turbulent.sum() < turbulent.size - 5


def test_the_conduits_share_of_the_drop_is_exercised() -> None:
    law = series()
    share = law.resistance * law.flow(OPENINGS, DROPS) / DROPS
    assert share.max() > 0.3


def test_flow_through_both_is_continuous_where_the_valve_turns_turbulent() -> None:
    law = series()
    opening = np.array([0.3, 0.6, 1.0])
    knee = 4e4 * THIN.viscosity * 30e-6
    drop = valve_drop(law, np.full(3, knee), opening, 2) + law.resistance * knee
    below, above = law.flow(opening, drop * (1.0 - 2e-13)), law.flow(opening, drop * (1.0 + 2e-13))
    assert np.abs(above / below - 1.0).max() < 1e-12  # Q itself moves by 4e-13


def test_behind_a_wide_open_valve_the_flow_is_hagen_and_poiseuilles() -> None:
    wide = connect_in_series(make_orifice(Valve(orifice_diameter=0.2), Fluid()), Conduit(), Fluid())
    # 200 mm against 0.8 mm: the valve's resistance is (1/250)^4 of the conduit's, some 1e-9.
    drop = np.array([1e2, 1e4, 1e5])
    assert wide.flow(np.ones(3), drop) * wide.resistance == pytest.approx(drop, rel=1e-6)


def test_without_length_the_conduit_changes_nothing() -> None:
    valve = make_orifice(Valve(orifice_diameter=0.8e-3), THIN)
    both = connect_in_series(valve, Conduit(length=0.0), THIN)
    assert both.flow(OPENINGS, DROPS) == pytest.approx(valve.flow(OPENINGS, DROPS), rel=1e-14)  # rounding


def test_the_conduit_never_adds_flow() -> None:
    valve = make_orifice(Valve(orifice_diameter=0.8e-3), THIN)
    assert np.all(series().flow(OPENINGS, DROPS) < valve.flow(OPENINGS, DROPS))


def test_flow_through_both_reverses_with_the_drop() -> None:
    assert np.array_equal(series().flow(OPENINGS, -DROPS), -series().flow(OPENINGS, DROPS))


def test_a_shut_valve_shuts_the_conduit() -> None:
    assert np.array_equal(series().flow(np.zeros(3), np.array([-1e6, 0.0, 1e6])), np.zeros(3))


def test_no_drop_gives_no_flow_through_both() -> None:
    assert np.array_equal(series().flow(np.array([0.0, 0.5, 1.0]), np.zeros(3)), np.zeros(3))


def test_conductance_times_drop_is_the_flow() -> None:
    law = series()
    assert np.array_equal(law.conductance(OPENINGS, DROPS) * DROPS, law.flow(OPENINGS, DROPS))
