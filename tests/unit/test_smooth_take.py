"""A take with smooth strokes: replayed bit for bit, kept as bytes, refused where it cannot be used."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.engine.simulation import begin
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.take import Take, from_bytes, replay, to_bytes, to_scene
from digiclay.recorded.bake import simulate_frames

from tests.assemble import replayed
from tests.reliefs import heighten, make_orders, make_spike_and_ridge, stay_away

SCENE = resolve({"layout": {"rows": 11, "columns": 11}})
ORDERS = make_orders(30, -6e-3, 6e-3, 0.0, 10e-3, 10)


@cache
def smooth_take() -> Take:
    """Return the take of a stroke over a relief."""
    system = assemble(SCENE)
    state = heighten(system, make_spike_and_ridge(system.grid))
    start, poses = snapshot.dump(system, state), stay_away(len(ORDERS))
    *_, last = simulate_path(system, state, poses, ORDERS)
    return Take(SCENE, start, poses, snapshot.dump(system, last), ORDERS)


def test_a_smooth_stroke_is_replayed_bit_for_bit_and_not_without_its_orders() -> None:
    take = smooth_take()
    assert replayed(take)
    assert not replayed(replace(take, smoothing=None))


def test_bytes_bring_the_orders_back_as_version_3() -> None:
    take = smooth_take()
    data = to_bytes(take)
    assert int(np.load(io.BytesIO(data))["version"]) == 3
    back = from_bytes(data)
    assert back.smoothing is not None
    np.testing.assert_array_equal(back.smoothing, ORDERS)
    assert replayed(back)


def test_a_take_without_orders_is_written_as_version_2_that_older_versions_read() -> None:
    data = to_bytes(replace(smooth_take(), smoothing=None))
    kept = np.load(io.BytesIO(data))
    assert int(kept["version"]) == 2
    assert "smoothing" not in kept
    assert from_bytes(data).smoothing is None


@pytest.mark.parametrize(
    ("orders", "said"),
    [
        (ORDERS[1:], r"got an array of the shape \(39, 4\) of float64"),
        (np.full_like(ORDERS, np.nan), r"got row 0 is \[nan"),
        (ORDERS * [1.0, 1.0, 1.0, 2.0], r"got row 0 is \[-0.006, 0.0, 0.01, 2.0\]"),
    ],
)
def test_orders_that_are_none_are_refused_with_what_is_wrong(orders: object, said: str) -> None:
    with pytest.raises(ParameterError, match=rf"Take.smoothing must hold .* \({said}") as caught:
        replace(smooth_take(), smoothing=orders)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("smoothing", np.full(ORDERS.shape, "a"), "The take is damaged"),
        ("version", np.array(4), "its version must be at most 3"),
    ],
)
def test_orders_of_text_and_a_version_yet_to_come_are_refused(name: str, value: object, said: str) -> None:
    parts = dict(np.load(io.BytesIO(to_bytes(smooth_take()))))
    written = io.BytesIO()
    np.savez(written, **{**parts, name: value})
    with pytest.raises(OutputError, match=said):
        from_bytes(written.getvalue())


def test_a_take_with_smooth_strokes_is_no_scene_file() -> None:
    take = smooth_take()
    system = assemble(SCENE)
    with pytest.raises(OutputError, match="has strokes that smooth pins"):
        to_scene(replace(take, start=snapshot.dump(system, begin(system))), "mine")


def test_a_bake_shows_what_was_smoothed() -> None:
    take = smooth_take()
    *_, last = replay(take)
    *_, frames = simulate_frames(take, 1.0 / take.duration)
    assert not isinstance(frames, float)
    np.testing.assert_array_equal(frames.height[-1], last.row(0).astype(np.float32))
