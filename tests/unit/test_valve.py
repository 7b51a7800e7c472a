"""The valve's two branches (equations 3 to 7), from the conditions they were made from."""

from __future__ import annotations

import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.valve import Fluid, Orifice, Valve, make_orifice

OPENINGS = np.array([0.05, 0.2, 0.5, 0.8, 1.0])
#: A wide valve and a thin fluid: the flow of a free cell is turbulent.
WIDE = Valve(orifice_diameter=0.8e-3)
THIN = Fluid(density=760.0, viscosity=0.65e-6)


def critical(valve: Valve, fluid: Fluid, opening: np.ndarray) -> np.ndarray:
    """Return ΔP_crit of equation 6, as corrected, from its exact constant 32e12/81."""
    top = 32e12 / 81.0 * fluid.density * fluid.viscosity**2 * valve.stroke**2
    return top / (math.pi**2 * opening**2 * valve.orifice_diameter**4)


def coefficient(valve: Valve, fluid: Fluid, flow: np.ndarray, drop: np.ndarray) -> np.ndarray:
    """Return C_q by its definition, equation 3."""
    return 4.0 * flow / (math.pi * valve.orifice_diameter**2) * np.sqrt(fluid.density / (2.0 * drop))


@pytest.fixture(params=[(Valve(), Fluid()), (WIDE, THIN)], ids=["default", "wide"])
def parts(request: pytest.FixtureRequest) -> tuple[Valve, Fluid, Orifice]:
    """A valve, a fluid and the law they make."""
    valve, fluid = request.param
    return valve, fluid, make_orifice(valve, fluid)


def test_flow_is_continuous_where_the_branches_meet(parts: tuple[Valve, Fluid, Orifice]) -> None:
    valve, fluid, law = parts
    drop = critical(valve, fluid, OPENINGS)
    # The steps of 2e-13 to either side move Q itself by 4e-13 of its value at most; rounding adds 1e-15.
    below, above = law.flow(OPENINGS, drop * (1.0 - 2e-13)), law.flow(OPENINGS, drop * (1.0 + 2e-13))
    assert np.abs(above / below - 1.0).max() < 1e-12


def test_both_branches_give_the_same_flow_at_the_critical_drop(parts: tuple[Valve, Fluid, Orifice]) -> None:
    valve, fluid, law = parts
    drop = critical(valve, fluid, OPENINGS)
    laminar, turbulent = law.laminar * OPENINGS**2 * drop, law.turbulent * OPENINGS * np.sqrt(drop)
    assert np.abs(laminar / turbulent - 1.0).max() < 1e-12  # rounding of some ten products


def test_below_the_critical_drop_the_flow_is_proportional_to_the_drop(
    parts: tuple[Valve, Fluid, Orifice],
) -> None:
    valve, fluid, law = parts
    drop = critical(valve, fluid, OPENINGS)
    part = law.flow(OPENINGS, 0.9 * drop) / law.flow(OPENINGS, 0.3 * drop)
    assert part == pytest.approx(3.0, rel=1e-12)  # rounding


def test_above_the_critical_drop_the_flow_grows_with_its_root(parts: tuple[Valve, Fluid, Orifice]) -> None:
    valve, fluid, law = parts
    drop = critical(valve, fluid, OPENINGS)
    part = law.flow(OPENINGS, 18.0 * drop) / law.flow(OPENINGS, 2.0 * drop)
    assert part == pytest.approx(3.0, rel=1e-12)  # rounding


def test_the_default_valve_stays_laminar_between_the_reservoirs() -> None:
    assert make_orifice(Valve(), Fluid()).knee > 1e5


def test_a_wide_valve_with_a_thin_fluid_is_turbulent_at_supply_pressure() -> None:
    assert make_orifice(WIDE, THIN).knee < 0.5e5


def test_the_knee_is_the_critical_drop_of_the_open_valve(parts: tuple[Valve, Fluid, Orifice]) -> None:
    valve, fluid, law = parts
    assert law.knee == pytest.approx(float(critical(valve, fluid, np.array(1.0))), rel=1e-12)  # rounding


def test_laminar_flow_has_the_printed_constant(parts: tuple[Valve, Fluid, Orifice]) -> None:
    valve, fluid, law = parts
    top = math.pi**2 * valve.orifice_diameter**4
    constant = top / (law.laminar * fluid.viscosity * valve.stroke * fluid.density)
    assert constant == pytest.approx(9.877e6, rel=5e-3)  # printed to two digits as 9.9e6, to four by us


def test_turbulent_flow_has_the_printed_constant(parts: tuple[Valve, Fluid, Orifice]) -> None:
    valve, fluid, law = parts
    constant = math.pi * valve.orifice_diameter**2 * math.sqrt(2.0 / fluid.density) / law.turbulent
    assert constant == pytest.approx(22.2, rel=5e-3)  # two digits


def test_the_critical_drop_has_the_printed_constant(parts: tuple[Valve, Fluid, Orifice]) -> None:
    valve, fluid, law = parts
    bottom = fluid.density * fluid.viscosity**2 * valve.stroke**2
    constant = law.knee * math.pi**2 * valve.orifice_diameter**4 / bottom
    assert constant == pytest.approx(3.95e11, rel=5e-3)  # two digits


def test_the_branches_meet_at_the_same_flow_whatever_the_opening(parts: tuple[Valve, Fluid, Orifice]) -> None:
    # Re* = sqrt(Q/(ν h_v)) = 200 is the same as Q = 4e4 ν h_v.
    valve, fluid, law = parts
    flow = law.flow(OPENINGS, critical(valve, fluid, OPENINGS))
    assert flow == pytest.approx(4e4 * fluid.viscosity * valve.stroke, rel=1e-12)  # rounding


def test_the_turbulent_discharge_coefficient_is_the_slope_times_the_opening(
    parts: tuple[Valve, Fluid, Orifice],
) -> None:
    valve, fluid, law = parts
    drop = 5.0 * critical(valve, fluid, OPENINGS)
    c_q = coefficient(valve, fluid, law.flow(OPENINGS, drop), drop)
    assert c_q == pytest.approx(0.18 * OPENINGS, rel=1e-12)  # rounding


def test_the_laminar_discharge_coefficient_falls_with_the_reynolds_number(
    parts: tuple[Valve, Fluid, Orifice],
) -> None:
    valve, fluid, law = parts
    drop = 0.2 * critical(valve, fluid, OPENINGS)
    flow = law.flow(OPENINGS, drop)
    reynolds = np.sqrt(flow / (fluid.viscosity * valve.stroke))
    assert reynolds.max() < 200.0
    c_q = coefficient(valve, fluid, flow, drop)
    assert c_q == pytest.approx(0.18 * OPENINGS * reynolds / 200.0, rel=1e-12)  # rounding


def test_with_the_opening_as_gap_laminar_flow_is_linear_in_the_opening() -> None:
    law = make_orifice(Valve(gap="opening"), Fluid())
    flow = law.flow(OPENINGS, np.full(OPENINGS.size, 1e4))
    assert flow / OPENINGS == pytest.approx(flow[-1], rel=1e-12)  # rounding


def test_with_the_opening_as_gap_the_critical_drop_is_the_same_for_all_openings() -> None:
    valve = Valve(orifice_diameter=0.8e-3, gap="opening")
    law = make_orifice(valve, THIN)
    drop = np.full(OPENINGS.size, law.knee)
    reynolds = np.sqrt(law.flow(OPENINGS, drop) / (THIN.viscosity * valve.stroke * OPENINGS))
    assert reynolds == pytest.approx(200.0, rel=1e-12)  # rounding


def test_with_the_opening_as_gap_flow_is_continuous_too() -> None:
    law = make_orifice(Valve(gap="opening"), THIN)
    below, above = (law.flow(OPENINGS, np.full(5, law.knee * side)) for side in (1.0 - 2e-13, 1.0 + 2e-13))
    assert np.abs(above / below - 1.0).max() < 1e-12  # as above


def test_both_gaps_agree_on_the_fully_open_valve() -> None:
    drop = np.array([1e3, 1e5, 1e7])
    flows = [make_orifice(Valve(gap=gap), Fluid()).flow(np.ones(3), drop) for gap in ("stroke", "opening")]
    assert np.array_equal(*flows)


def test_flow_reverses_with_the_drop(parts: tuple[Valve, Fluid, Orifice]) -> None:
    _, _, law = parts
    drop = np.geomspace(1.0, 1e7, 5)
    assert np.array_equal(law.flow(OPENINGS, -drop), -law.flow(OPENINGS, drop))


def test_the_sign_of_the_opening_does_not_set_the_direction(parts: tuple[Valve, Fluid, Orifice]) -> None:
    _, _, law = parts
    drop = np.geomspace(1.0, 1e7, 5)
    assert np.array_equal(law.flow(-OPENINGS, drop), law.flow(OPENINGS, drop))


def test_a_shut_valve_passes_nothing(parts: tuple[Valve, Fluid, Orifice]) -> None:
    _, _, law = parts
    drop = np.array([-1e9, -1.0, 0.0, 1.0, 1e9])
    assert np.array_equal(law.flow(np.zeros(5), drop), np.zeros(5))


def test_no_drop_gives_no_flow(parts: tuple[Valve, Fluid, Orifice]) -> None:
    _, _, law = parts
    assert np.array_equal(law.flow(OPENINGS, np.zeros(5)), np.zeros(5))


def test_an_orifice_below_zero_is_refused_in_one_line() -> None:
    with pytest.raises(
        ParameterError, match=r"^Valve\.orifice_diameter must be above 0 m \(got -0\.0003 m\)\.$"
    ):
        Valve(orifice_diameter=-0.3e-3)


def test_an_unknown_gap_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ParameterError, match=r"^Valve\.gap must be one of stroke, opening \(got 'slit'\)\.$"):
        Valve(gap="slit")
