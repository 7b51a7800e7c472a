"""A run that presses harder or deeper than a finger is says so, and one that does not says nothing."""

from __future__ import annotations

import numpy as np
import pytest
from digiclay.core.engine.simulation import begin
from digiclay.core.model import touch
from digiclay.core.model.contact import Contact
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.touch import MOST_FORCE, MOST_INDENTATION, describe_excess, find_indentations
from digiclay.core.model.trajectory import Path, Waypoint
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.recent_trace import exceeds_law
from digiclay.core.session.run_scene import Result, run
from digiclay.overlay.sections import force_message

from tests.assemble import sample, under


def pressed(depth: float, tilt: float = 0.0, x: float = 0.0, **parts: object) -> Result:
    """Return a run whose finger, tilted, rad, comes down at x to `depth` below the tops within 0.1 s, m."""
    points = ((0.0, 41e-3), (0.1, 40e-3 - depth), (0.15, 40e-3 - depth))
    turn = (np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0)
    way = Path("linear", tuple(Waypoint(time, (x, 0.0, z), turn) for time, z in points))
    known: Scene = sample("tap", "simulation.duration=0.15")
    return run(known.with_sections(trajectory=way, **{"control": None, "blister": None, **parts}))


@pytest.fixture(scope="module")
def shallow() -> Result:
    """Return a run within what a finger is."""
    return pressed(1.5e-3)


def test_a_finger_driven_through_the_bed_is_remarked_in_the_summary_line_and_no_other(shallow):
    assert (shallow.metrics["beyond_a_finger"], "contact law" in shallow.summary()) == ("", False)
    through = pressed(60e-3)  # all valves are shut
    said = through.metrics["beyond_a_finger"]
    assert said.startswith("the contact law does not hold: ")
    assert said.endswith("e+51 N (fingers were measured up to 2 N), 60 mm deep (up to 3 mm)")
    assert through.summary().endswith(f"; {said}")
    # Only what is beyond is named.
    most = (MOST_FORCE, MOST_INDENTATION)
    given = (most, (1.001 * MOST_FORCE, most[1]), (most[0], 1.001 * most[1]), (476.0, 4e-3), (None, None))
    assert [describe_excess(*values).count("up to") for values in given] == [0, 1, 1, 2, 0]


@pytest.mark.parametrize(
    ("depth", "tilt", "x", "stiffness"),
    [
        (1.5e-3, 0, 0, 250), (3.5e-3, 0, 0, 250),
        # By depth alone: above a pin, between pins, and tilted.
        (3.5e-3, 0, 0, 0.01), (3.2e-3, 0, 1.5e-3, 0.01), (2.9e-3, 0.6, 0, 0.01), (4e-3, 0.6, 0, 0.01),
    ],
)  # fmt: skip
def test_rows_and_live_states_beyond_the_law_are_marked(depth, tilt, x, stiffness, monkeypatch):
    monkeypatch.setattr(touch, "ROWS", 1)
    result = pressed(depth, tilt, x, contact=Contact(stiffness=stiffness))
    history, system = result.history, assemble(result.scene)
    unders = under(Fingertip().outline(history["fingertip"]), *history["position"].T)
    depths = (history["height"] - unders).max(axis=1, where=history["force"] > 0.0, initial=0.0)
    told = result.metrics["max_indentation"], result.metrics["units"]["max_indentation"]
    assert told == (pytest.approx(depths.max(), rel=1e-12), "m")
    # No valve is open, and the underside is an ellipse of 10 and 8 mm.
    assert depths.max() == pytest.approx(depth - 8e-3 * (1.0 - np.sqrt(1.0 - (x / 10e-3) ** 2)), rel=1e-9)
    wanted = (history["total_force"] > MOST_FORCE) | (depths > MOST_INDENTATION)
    assert wanted.any() == (depth > MOST_INDENTATION) == ("beyond_a_finger" in history)
    np.testing.assert_array_equal(history.get("beyond_a_finger", wanted), wanted)
    states = simulate_path(system, begin(system), history["fingertip"][:, None])
    live = [exceeds_law(system, *one) for one in zip(states, history["fingertip"][1:], strict=True)]
    assert live == wanted[1:].tolist()


def test_a_pin_that_is_not_felt_does_not_count(shallow: Result) -> None:
    # Beyond the rim of a finger that is lifted: no force, whatever the heights.
    assert shallow.history is not None
    free = {**shallow.history, "force": np.zeros_like(shallow.history["force"])}
    assert find_indentations(Fingertip(), free).max() == 0.0


def test_the_overlay_says_when_no_finger_presses_so_hard() -> None:
    assert [force_message(force) for force in (0.7, 2.0, 2.5, 476.0, 1e66)] == [
        "0.70 N", "2.00 N", "2.5 N: beyond 2 N", "476 N: no finger", "1e+66 N: no finger",
    ]  # fmt: skip
    assert force_message(0.7, beyond=True) == "0.70 N: beyond 3 mm"
