"""Flow (equations 3 to 8): the valve's two branches, a conduit in series, and the reservoirs."""

import math

import numpy as np
import pytest
from digiclay.core.model.conduit import Conduit, OrificeAndConduit
from digiclay.core.model.physics import compute_rates
from digiclay.core.model.valve import Fluid, Valve, make_orifice
from scipy.integrate import quad

from tests.assemble import one_cell

OPENINGS = np.array([0.05, 0.2, 0.5, 0.8, 1.0])
#: A wide valve and a thin fluid: the flow of a free cell is turbulent.
WIDE = Valve(orifice_diameter=0.8e-3)
THIN = Fluid(density=760.0, viscosity=0.65e-6)
BOTH = pytest.mark.parametrize("valve, fluid", [(Valve(), Fluid()), (WIDE, THIN)])
#: For the wide valve, the thin fluid and a narrow conduit: both branches, and drops of like size.
MESH, DROPS = (
    grid.ravel() for grid in np.meshgrid([0.03, 0.2, 0.6, 1.0], np.geomspace(10.0, 1e6, 9))
)
#: Relative errors of some ten products; steps of 2e-13 of a drop to either side move the flow by
#: 4e-13.
ROUNDING = 1e-12


def critical(valve, fluid, opening):
    """Return ΔP_crit of equation 6, as corrected, from its exact constant 32e12/81."""
    top = 32e12 / 81.0 * fluid.density * fluid.viscosity**2 * valve.stroke**2
    return top / (math.pi**2 * opening**2 * valve.orifice_diameter**4)


@BOTH
def test_the_branches_meet_at_the_critical_drop(valve, fluid):
    law, drop = make_orifice(valve, fluid), critical(valve, fluid, OPENINGS)
    # Re* = sqrt(Q/(ν h_v)) = 200 is the same as Q = 4e4 ν h_v, whatever the opening.
    meeting = pytest.approx(np.full(5, 4e4 * fluid.viscosity * valve.stroke), rel=ROUNDING)
    for side in (1.0 - 2e-13, 1.0, 1.0 + 2e-13):
        assert law.flow(OPENINGS, drop * side) == meeting
    assert law.laminar * OPENINGS**2 * drop == meeting
    assert law.turbulent * OPENINGS * np.sqrt(drop) == meeting
    assert law.knee == pytest.approx(critical(valve, fluid, 1.0), rel=ROUNDING)
    # The default one stays laminar between the reservoirs.
    assert (law.knee > 1e5) == (valve == Valve())
    # Below, the flow is proportional to the drop; above it grows with its root.
    for one, other in ((0.9, 0.3), (18.0, 2.0)):
        share = law.flow(OPENINGS, one * drop) / law.flow(OPENINGS, other * drop)
        assert share == pytest.approx(3.0, rel=ROUNDING)


def test_with_the_opening_as_gap_all_openings_turn_turbulent_at_one_drop():
    valve = Valve(orifice_diameter=0.8e-3, gap="opening")
    law = make_orifice(valve, THIN)
    sides = (1.0 - 2e-13, 1.0, 1.0 + 2e-13)
    below, at, above = (law.flow(OPENINGS, np.full(5, law.knee * side)) for side in sides)
    assert np.sqrt(at / (THIN.viscosity * valve.stroke * OPENINGS)) == pytest.approx(
        200.0, rel=ROUNDING
    )
    assert np.abs(above / below - 1.0).max() < ROUNDING
    laminar = law.flow(OPENINGS, np.full(5, 0.1 * law.knee)) / OPENINGS
    assert laminar == pytest.approx(laminar[-1], rel=ROUNDING)
    # Fully open the gap makes no difference.
    drop = np.array([1e3, 1e5, 1e7])
    assert np.array_equal(
        law.flow(np.ones(3), drop), make_orifice(WIDE, THIN).flow(np.ones(3), drop)
    )


def series(gap="stroke"):
    conduit = Conduit(length=10e-3, diameter=0.3e-3)
    return OrificeAndConduit(
        make_orifice(Valve(orifice_diameter=0.8e-3, gap=gap), THIN), conduit.resistance(THIN)
    )


@pytest.mark.parametrize(
    "law",
    [make_orifice(Valve(), Fluid()), make_orifice(WIDE, THIN), series(), series("opening")],
    ids=["default", "wide", "series", "series by opening"],
)
def test_flow_has_the_sign_of_the_drop_alone_and_is_none_without_opening_or_drop(law):
    flow = law.flow(MESH, DROPS)
    assert np.array_equal(law.flow(MESH, -DROPS), -flow)
    assert np.array_equal(law.flow(-MESH, DROPS), flow)
    assert np.array_equal(law.conductance(MESH, DROPS) * DROPS, flow)
    assert not law.flow(np.zeros(5), np.array([-1e9, -1.0, 0.0, 1.0, 1e9])).any()
    assert not law.flow(MESH, np.zeros(MESH.size)).any()


@pytest.mark.parametrize("gap, power", [("stroke", 2), ("opening", 1)])
def test_the_drops_of_valve_and_conduit_add_up(gap, power):
    law = series(gap)
    flow = law.flow(MESH, DROPS)
    # The drop over the valve alone is the inverse of each branch, told apart by Re* (Q = 4e4 ν h).
    turbulent = flow >= 4e4 * THIN.viscosity * 30e-6 * (MESH if power == 1 else 1.0)
    laminar = flow / (law.valve.laminar * MESH**power)
    ours = np.where(turbulent, (flow / (law.valve.turbulent * MESH)) ** 2, laminar)
    # Solved without cancellation.
    assert ours + law.resistance * flow == pytest.approx(DROPS, rel=1e-12)
    assert 5 < turbulent.sum() < turbulent.size - 5
    assert (law.resistance * flow / DROPS).max() > 0.3, "the conduit hardly counts"
    assert np.all(flow < law.valve.flow(MESH, DROPS))


def test_the_resistance_is_that_of_a_parabolic_profile_and_behind_a_wide_valve_it_is_all():
    fluid, conduit = Fluid(), Conduit()
    edge, gradient = conduit.diameter / 2.0, 1e5 / conduit.length

    def ring(r):
        return gradient * (edge**2 - r**2) / (4.0 * fluid.dynamic_viscosity) * 2.0 * math.pi * r

    # The integrand is a cubic: quadrature is exact but for rounding.
    assert conduit.resistance(fluid) == pytest.approx(1e5 / quad(ring, 0.0, edge)[0], rel=1e-12)
    valve = make_orifice(WIDE, THIN)
    without = OrificeAndConduit(valve, 0.0)
    # Rounding.
    assert without.flow(MESH, DROPS) == pytest.approx(valve.flow(MESH, DROPS), rel=1e-14)
    wide = OrificeAndConduit(
        make_orifice(Valve(orifice_diameter=0.2), Fluid()), Conduit().resistance(Fluid())
    )
    # 200 mm against 0.8 mm: the valve's resistance is (1/250)^4 of the conduit's, some 1e-9.
    drop = np.array([1e2, 1e4, 1e5])
    assert wide.flow(np.ones(3), drop) * wide.resistance == pytest.approx(drop, rel=1e-6)


def test_the_drop_between_reservoir_and_load_moves_the_pin():
    cell = one_cell(valve_lag=None, relaxation=None).cell
    contact, lift = cell.touch.contact, 0.5e5 * np.pi * 1e-6  # P_s A_a = 0.157 N

    def speed_under(force, opening):
        depth = (
            np.log1p(force / contact.share * contact.exponent / contact.stiffness)
            / contact.exponent
        )
        y, under = np.array([[50e-3]]), np.array([50e-3 - depth])
        return float(compute_rates(cell, y, under, np.array([opening]))[0, 0])

    assert speed_under(1.5 * lift, 1.0) < 0.0
    # Twice the balance force turns ΔP = P_s - F/A_a into its opposite; the laminar flow with it.
    # Rounding.
    assert speed_under(2.0 * lift, 1.0) == pytest.approx(-speed_under(0.0, 1.0), rel=1e-9)
    # Rounding of ΔP: 1e-16 of 0.5 bar, against the free speed of 24 mm/s.
    assert abs(speed_under(lift, 1.0)) < 1e-12
    assert speed_under(0.1, -1.0) < speed_under(0.0, -1.0) < 0.0
    assert speed_under(1e3, 0.0) == 0.0
