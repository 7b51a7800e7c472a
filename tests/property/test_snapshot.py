"""Whatever is done to kept bytes, they are a state or refused: nothing else happens."""

from __future__ import annotations

import numpy as np
from digiclay.core.base.errors import StateError
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.assemble import path

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
def test_bytes_that_are_cut_or_added_are_noticed(at: int, some: bytes) -> None:
    assert all(refusals(KEPT[:at] + some + KEPT[at:])) == bool(some)
    assert all(refusals(KEPT[:at])) == (at < len(KEPT))
    assert all(refusals(some))
    assert all(refusals(KEPT[:17] + some))
