"""A take, also of smooth strokes: replayed bit for bit, simulated more finely, written as scene and bytes."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.engine.simulation import begin
from digiclay.core.engine.state import State
from digiclay.core.engine.system import System
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.take import Take, from_bytes, refine, replay, to_bytes, to_scene
from digiclay.recorded.bake import simulate_frames
from numpy.typing import NDArray

from tests.assemble import record, replayed, sample
from tests.reliefs import heighten, make_orders, make_spike_and_ridge, stay_away

Floats = NDArray[np.float64]
#: Control periods of the take.
COUNT = 160


def scene() -> Scene:
    """Return a bed of 12 x 12 pins under Method I."""
    return replace(sample("slow_press"), layout=Layout(rows=12, columns=12))


def gesture(count: int = COUNT) -> Floats:
    """Return the poses of a finger that presses 4 mm, drags 6 mm and turns, read every 6th period."""
    read = np.arange(0, count + 6, 6)
    part = read / count
    poses = np.zeros((read.size, 7))
    poses[:, 0] = 6e-3 * np.clip(2.0 * part - 1.0, 0.0, 1.0)
    poses[:, 2] = 42e-3 - 6e-3 * np.clip(2.0 * part, 0.0, 1.0)
    poses[:, 3:] = LEVEL
    poses[:, 4] = 0.1 * part
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    at = np.arange(count + 1)
    return np.column_stack([np.interp(at, read, column) for column in poses.T])[:, None]


@cache
def taken(again: bool = False) -> tuple[System, Take, State]:
    """Live through the gesture, or through it again on what it formed; return system, take and last state."""
    system = assemble(scene())
    state = taken()[2] if again else begin(system)
    first, poses = snapshot.dump(system, state), gesture()
    *_, last = simulate_path(system, state.copy(), poses)
    return system, Take(scene(), first, poses, snapshot.dump(system, last)), last


def difference(take: Take, parts: int) -> float:
    """Return how far a take's heights are from those at a finer physics step, at most, m."""
    both = zip(replay(take), replay(take, refine(take.scene, parts)), strict=True)
    return max(float(np.abs(one.row(0) - other.row(0)).max()) for one, other in both)


def test_a_replay_from_rest_or_a_formed_bed_ends_in_the_same_state_bit_for_bit() -> None:
    _, take, _ = taken()
    assert replayed(take)
    assert replayed(taken(True)[1])
    assert [state.period for state in replay(take)] == list(range(1, COUNT + 1))
    poses = take.poses.copy()
    poses[COUNT // 2, 0, 2] += 1e-9  # another path does not pass for the take
    assert not replayed(replace(take, poses=poses))


def test_bytes_bring_a_take_back_as_it_was_and_damaged_ones_are_refused_in_one_line() -> None:
    _, take, _ = taken()
    data = to_bytes(take)
    back = from_bytes(data)
    assert np.array_equal(back.poses, take.poses)
    assert (back.scene, back.start, back.end) == (take.scene, take.start, take.end)
    for harmed in (data[:-50], b"", b"no take"):
        with pytest.raises(OutputError, match="The take is damaged"):
            from_bytes(harmed)


def test_a_finer_step_moves_heights_by_less_than_the_integrations_error() -> None:
    # 1 ms steps leave about 1 µm; a difference of nothing at all would mean that nothing was refined.
    _, take, _ = taken()
    assert 0.0 < difference(take, 4) < 5e-6
    assert difference(take, 1) == 0.0
    for parts in (0, -1, 65):
        with pytest.raises(ParameterError, match="must be from 1 to 64"):
            refine(scene(), parts)


def test_a_take_as_a_scene_file_runs_to_the_same_heights(tmp_path: Path) -> None:
    system, take, last = taken()
    made = to_scene(take, "my take")
    # The finger was read every 6th period, and goes straight in between: only turning points are waypoints.
    assert len(made.section("trajectory").waypoints) <= COUNT // 6 + 2
    (tmp_path / "my take.toml").write_text(format_scene(made), encoding="utf-8")
    read = load(tmp_path / "my take.toml")
    assert (read.periods, read.cells) == (COUNT, system.grid.count)
    # A take begun on a bed that has waited at rest is a scene too.
    *_, waited = simulate_path(system, begin(system), np.tile([0.0, 0.0, 46e-3, *LEVEL], (30, 1, 1)))
    late = to_scene(replace(take, start=snapshot.dump(system, waited)), "late")
    for scene in (read, late):
        done = record(assemble(scene), scene.section("trajectory").trajectory(), scene.periods)
        # The path is the same but for rounding, 1e-17 m, which stiff contact enlarges a thousandfold.
        assert np.abs(done.height[-1] - last.row(0)).max() < 1e-12
    with pytest.raises(OutputError, match=r"begins on a bed that is formed already.*reset the session"):
        to_scene(taken(True)[1], "late")


@pytest.mark.parametrize(
    ("poses", "rule"),
    [
        (np.zeros((1, 1, 7)), "must hold one control period at least"),
        (np.zeros((3, 1, 6)), "must hold one control period at least"),
        (np.zeros((3, 2, 7)), "of 1 x 7 numbers, a pose a finger"),
        (np.full((3, 1, 7), np.nan), "must be finite numbers"),
    ],
)
def test_a_path_that_is_none_is_refused(poses: Floats, rule: str) -> None:
    with pytest.raises(ParameterError, match=rule):
        Take(scene(), b"", poses, b"")


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


def test_bytes_bring_smooth_strokes_back_as_version_3_and_a_take_without_is_version_2() -> None:
    data, plain = to_bytes(smooth_take()), to_bytes(replace(smooth_take(), smoothing=None))
    assert [int(np.load(io.BytesIO(one))["version"]) for one in (data, plain)] == [3, 2]
    assert "smoothing" not in np.load(io.BytesIO(plain))  # older versions read it
    back = from_bytes(data)
    assert back.smoothing is not None
    np.testing.assert_array_equal(back.smoothing, ORDERS)
    assert (replayed(back), replayed(from_bytes(plain))) == (True, False)
    with pytest.raises(ParameterError, match=r"Take.smoothing must hold .* \(got row 0 is \[nan"):
        replace(back, smoothing=np.full_like(ORDERS, np.nan))


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
