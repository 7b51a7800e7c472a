"""Things made by recorded strokes of the Press tool are what was intended, even, alike, and soon formed."""

import pytest

from benchmarks.alike import list_differences, list_reliefs
from benchmarks.intended import THINGS
from benchmarks.made import make

TIMES = {"r_lowered": 6.0, "r_raised": 7.0, "spiral": 7.0, "ring": 5.0, "leaf": 12.0, "lines": 15.0}


@pytest.mark.parametrize("name", THINGS)
def test_a_thing_made_by_recorded_strokes_is_what_was_intended(name: str) -> None:
    made = make(name)
    assert made.bed == made.own_bed == "design"
    assert made.correlation >= 0.96
    # A relief of another height would correlate as well.
    assert 0.95 <= made.slope <= 1.05
    assert made.played.time <= TIMES.get(name, 20.0)
    assert made.played.force <= 1.0


def test_strokes_are_even_along_their_paths_and_leave_no_spikes() -> None:
    for case in list_reliefs():
        assert case["rms"] <= 0.1e-3, case
        assert case["most"] <= 0.3e-3, case
        assert case["spike"] <= 0.2e-3, case


def test_what_is_drawn_alike_comes_out_alike() -> None:
    for case in list_differences():
        # The band of the valves is half a micrometer, on either side.
        assert case["difference"] <= 1.0e-6, case
