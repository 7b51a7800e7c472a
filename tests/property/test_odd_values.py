"""Odd scenes, states, takes, runs and bytes are taken or refused; `tools/fuzz.py` tries many more."""

import numpy as np
import pytest
from digiclay.core.base.errors import DigiclayError, SceneError, StateError
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.assemble import path
from tools import fuzz


@pytest.mark.parametrize(("kind", "count"), [("scenes", 120), ("states", 250), ("takes", 150), ("runs", 150)])
def test_what_is_odd_is_taken_or_refused(kind: str, count: int) -> None:
    told = [fuzz.failure(kind, 7, number) for number in range(count)]
    assert {number: said for number, said in enumerate(told) if said} == {}
    # Neither is everything refused, nor is everything taken: the cases reach beyond the first check.
    assert 0.05 * count < told.count("") < 0.95 * count


def test_a_failure_is_told_with_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(fuzz.CASES, "states", lambda chance: [][0])
    assert "IndexError in test_odd_values.py:" in fuzz.failure("states", 0, 0)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("layout.rows", "1" + 400 * "0", "rows must be a finite number (got a whole number of 401 digits)"),
        ("layout.rows", "1" + 300 * "0", "rows must be at most 10000 (got a whole number of 301 digits)"),
        ("layout.rows", "0x" + 900 * "f", "finite number (got a whole number of 1084 digits)"),
        ("valve.discharge_slope", "5e-324", "slope must be at least 1e-09 (got 4.94066e-324)"),
        ("simulation.control_period", "1e300", "simulation.control_period must be at most 1e+06 s"),
        ("supply.low", "-1e300", "supply.low must be at least -1e+10 Pa"),
        ("relaxation.times", "[1e300, 1, 1]", "relaxation.times must be at most 1e+06 s"),
        ("recorder.every", "1" + 30 * "0", "at most 1e+09 (got a whole number of 31 digits)"),
    ],
)  # fmt: skip
def test_a_number_beyond_all_devices_is_refused_with_its_bound(key: str, value: str, said: str) -> None:
    with pytest.raises(SceneError) as caught:
        load(find("slow_press"), [Setting(key, value)])
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        # 1000 steps of the adaptive stepper, each cut into 128, would make a plan of terabytes.
        ("bernoulli 4e-6", "must be at least a 1000th of simulation.control_period, 0.005 s (got"),
        ("adaptive 4e-4", "a 10th of simulation.control_period, 0.005 s, with the stepper adaptive"),
        ("richardson 9e-6", "a 500th of simulation.control_period, 0.005 s, with the stepper rich"),
        ("", "must increase from waypoint to waypoint by at least 1e-09 s"),
    ],
)  # fmt: skip
def test_steps_whose_plan_would_fill_the_memory_and_waypoints_at_one_time_are_refused(settings, said):
    points = [{"time": time, "position": [0, 0, 0.046]} for time in (0.0, 5e-324, 1.0)]
    stepper, _, step = settings.partition(" ")
    simulation = {"simulation": {"stepper": stepper, "physics_step": float(step or 1.0)}}
    with pytest.raises(DigiclayError) as caught:
        resolve(simulation if settings else {"trajectory": {"waypoints": points}})
    assert said in str(caught.value)


SYSTEM = assemble(resolve({"layout": {"rows": 6, "columns": 10}}))
*_, LAST = periods(SYSTEM, [path((0, 0, 0, 42), (0.2, 0, 0, 37))], begin(SYSTEM), 50)
KEPT = snapshot.dump(SYSTEM, LAST)


def refusals(data: bytes) -> list[str]:
    """Take up bytes both ways; return why each is refused, all that may go wrong, "" if it is not."""
    told = []
    for take_up in (snapshot.load, snapshot.transfer_heights):
        refused = ""
        try:
            state = take_up(SYSTEM, data)
        except StateError as error:
            refused = str(error)
        assert "\n" not in refused
        assert refused or np.isfinite(state.row(0)).all()
        told.append(refused)
    return told


#: In the header most bytes have a meaning of their own.
places = st.one_of(st.integers(0, len(KEPT) - 12), st.integers(0, 700), st.integers(0, 700))


@settings(max_examples=200)
@given(places, st.binary(max_size=12))
def test_bytes_that_are_changed_are_noticed_or_make_another_state(at: int, some: bytes) -> None:
    data = KEPT[:at] + some + KEPT[at + len(some) :]
    told = refusals(data)
    assert data != KEPT or told == ["", ""]


@given(st.integers(0, len(KEPT)), st.binary(max_size=40))
@example(len(KEPT), b"\0")
@example(len(KEPT) - 8, b"")
def test_bytes_that_are_cut_or_added_are_noticed(at: int, some: bytes) -> None:
    assert all(refusals(KEPT[:at] + some + KEPT[at:])) == bool(some)
    assert all(refusals(KEPT[:at])) == (at < len(KEPT))
    assert all(refusals(some))
    assert all(refusals(KEPT[:17] + some))
