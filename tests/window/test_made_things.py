"""Things made by recorded strokes of the Press tool are what was intended."""

from __future__ import annotations

import pytest

from benchmarks.intended import THINGS
from benchmarks.made import make


@pytest.mark.parametrize("name", THINGS)
def test_a_thing_made_by_recorded_strokes_is_what_was_intended(name: str) -> None:
    made = make(name)
    assert made.bed == made.own_bed == "design"
    assert made.correlation >= 0.9
    # A relief of another height would correlate as well.
    assert 0.75 <= made.slope <= 1.25
