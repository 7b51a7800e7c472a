"""A take, also of smooth strokes: replayed bit for bit, simulated more finely, written as scene and bytes."""

import io
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.control.orders import Orders, Verb, repeat_order
from digiclay.core.engine.simulation import begin
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.model.layout import Layout
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.take import Take, from_bytes, refine, replay, to_bytes, to_scene
from digiclay.recorded.bake import simulate_frames
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from tests.assemble import record, refused_in_a_line, replayed, sample
from tests.reliefs import heighten, make_orders, make_spike_and_ridge, stay_away

Floats = NDArray[np.float64]
COUNT = 160


def scene():
    return replace(sample("slow_press"), layout=Layout(rows=12, columns=12))


def gesture(count=COUNT):
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
def taken(again=False):
    """Live through the gesture, or through it again on what it formed; return system, take and last state."""
    system = assemble(scene())
    state = taken()[2] if again else begin(system)
    first, poses = snapshot.dump(system, state), gesture()
    *_, last = simulate_path(system, state.copy(), poses)
    return system, Take(scene(), first, poses, snapshot.dump(system, last)), last


def difference(take, parts):
    """Return how far a take's heights are from those at a finer physics step, at most, m."""
    both = zip(replay(take), replay(take, refine(take.scene, parts)), strict=True)
    return max(float(np.abs(one.row(0) - other.row(0)).max()) for one, other in both)


def test_a_replay_from_rest_or_a_formed_bed_ends_in_the_same_state_bit_for_bit():
    _, take, _ = taken()
    assert replayed(take)
    assert replayed(taken(True)[1])
    assert [state.period for state in replay(take)] == list(range(1, COUNT + 1))
    poses = take.poses.copy()
    poses[COUNT // 2, 0, 2] += 1e-9  # another path does not pass for the take
    assert not replayed(replace(take, poses=poses))


def test_bytes_bring_a_take_and_its_orders_back_and_damaged_ones_are_refused_in_one_line():
    _, take, _ = taken()
    data = to_bytes(take)
    back = from_bytes(data)
    assert np.array_equal(back.poses, take.poses)
    assert (back.scene, back.start, back.end) == (take.scene, take.start, take.end)
    for harmed in (data[:-50], b"", b"no take"):
        with pytest.raises(OutputError, match="The take is damaged"):
            from_bytes(harmed)
    data, plain = to_bytes(ordered_take()), to_bytes(replace(ordered_take(), orders=None))
    assert [int(np.load(io.BytesIO(one))["version"]) for one in (data, plain)] == [4, 2]
    assert "orders" not in np.load(io.BytesIO(plain))  # older versions read it
    back = from_bytes(data)
    assert_array_equal(back.orders.rows, ORDERS.rows)
    assert_array_equal(back.orders.surfaces, (SURFACE,))
    assert (replayed(back), replayed(from_bytes(plain))) == (True, False)


def test_a_finer_step_moves_heights_by_less_than_the_integrations_error():
    # 1 ms steps leave about 1 µm; a difference of nothing at all would mean that nothing was
    # refined.
    _, take, _ = taken()
    assert 0.0 < difference(take, 4) < 5e-6
    assert difference(take, 1) == 0.0
    for parts in (0, -1, 65):
        with pytest.raises(ParameterError, match="must be from 1 to 64"):
            refine(scene(), parts)


def test_a_take_as_a_scene_file_runs_to_the_same_heights(tmp_path):
    system, take, last = taken()
    made = to_scene(take, "my take")
    # The finger was read every 6th period, and goes straight in between: only turning points are
    # waypoints.
    assert len(made.section("trajectory").waypoints) <= COUNT // 6 + 2
    (tmp_path / "my take.toml").write_text(format_scene(made), encoding="utf-8")
    read = load(tmp_path / "my take.toml")
    assert (read.periods, read.cells) == (COUNT, system.grid.count)
    # A take begun on a bed that has waited at rest is a scene too.
    *_, waited = simulate_path(
        system, begin(system), np.tile([0.0, 0.0, 46e-3, *LEVEL], (30, 1, 1))
    )
    late = to_scene(replace(take, start=snapshot.dump(system, waited)), "late")
    for scene in (read, late):
        done = record(assemble(scene), scene.section("trajectory").trajectory(), scene.periods)
        # The path is the same but for rounding, 1e-17 m, which stiff contact enlarges a
        # thousandfold.
        assert np.abs(done.height[-1] - last.row(0)).max() < 1e-12
    with pytest.raises(
        OutputError, match=r"begins on a bed that is formed already.*reset the session"
    ):
        to_scene(taken(True)[1], "late")


@pytest.mark.parametrize(
    "poses, rule",
    [
        (np.zeros((1, 1, 7)), "must have at least one control period"),
        (np.zeros((3, 1, 6)), "must have at least one control period"),
        (np.zeros((3, 0, 7)), "of 1 x 7 numbers, one pose per finger"),
        (np.full((3, 1, 7), np.nan), "must be finite numbers"),
    ],
)
def test_a_path_that_is_none_is_refused(poses, rule):
    with pytest.raises(ParameterError, match=rule):
        Take(scene(), b"", poses, b"")


SCENE = resolve({"layout": {"rows": 11, "columns": 11}})
SURFACE = np.where(np.arange(121) % 3 == 0, np.nan, 42e-3)


def every_order():
    smooth, average = (
        make_orders(12, -6e-3, 6e-3, 0.0, 10e-3, 0, verb).rows for verb in Verb if verb < 2
    )
    others = [
        repeat_order(4, verb, 3e-3, 0.0, 5e-3, 2.0) for verb in (Verb.LOCK, Verb.ERASE, Verb.INVERT)
    ]
    free = repeat_order(1, Verb.UNLOCK, radius=1.0)
    return Orders(
        np.concatenate([smooth, average, *others, free, repeat_order(30, Verb.PLACE)]), (SURFACE,)
    )


ORDERS = every_order()


@cache
def ordered_take():
    system = assemble(SCENE)
    state = heighten(system, make_spike_and_ridge(system.grid))
    start, poses = snapshot.dump(system, state), stay_away(len(ORDERS))
    *_, last = simulate_path(system, state, poses, ORDERS)
    return Take(SCENE, start, poses, snapshot.dump(system, last), ORDERS)


def change_file(take, **parts):
    """Return the bytes of a take with other arrays; None: left out."""
    written, arrays = io.BytesIO(), {**np.load(io.BytesIO(to_bytes(take))), **parts}
    np.savez(written, **{name: array for name, array in arrays.items() if array is not None})
    return written.getvalue()


def test_a_take_of_version_3_whose_orders_have_no_verb_is_replayed_bit_for_bit():
    rows = make_orders(30, -6e-3, 6e-3, 0.0, 10e-3, 10).rows
    system, take = assemble(SCENE), replace(ordered_take(), poses=stay_away(len(rows)), orders=None)
    *_, last = simulate_path(system, snapshot.load(system, take.start), take.poses, Orders(rows))
    take = replace(take, end=snapshot.dump(system, last))
    old = change_file(take, version=np.array(3), smoothing=np.ascontiguousarray(rows[:, :4]))
    assert replayed(from_bytes(old))
    assert not replayed(take)


def rows_with(at, **columns):
    rows = ORDERS.rows.copy()
    for name, value in columns.items():
        rows[at, ("x", "y", "radius", "strength", "verb").index(name)] = value
    return rows


@pytest.mark.parametrize(
    "parts, said",
    [
        ({"orders": np.full(ORDERS.rows.shape, "a")}, "damaged and cannot be read"),
        ({"orders": ORDERS.rows[1:]}, "got an array of the shape"),
        ({"orders": ORDERS.rows[:, :4]}, "got an array of the shape"),
        ({"orders": rows_with(-1, x=1.0)}, "got row .* is .1.0"),
        ({"orders": rows_with(-1, x=-1.0)}, "got row .* is .-1.0"),
        ({"orders": rows_with(2, y=np.nan)}, "got row 2 is .*nan"),
        ({"orders": rows_with(2, verb=7.0)}, "got row 2 is"),
        ({"surfaces": np.full((1, 120), 0.04)}, "got surface 0 is an array of the shape .120,."),
        ({"surfaces": np.full((1, 121), np.inf)}, "got surface 0 has the height inf m"),
        ({"surfaces": np.full((1, 121), 1.0)}, "got surface 0 has the height 1 m"),
        ({"surfaces": np.full((1, 121), -0.01)}, "got surface 0 has the height -0.01 m"),
        ({"surfaces": np.full((1, 121), "a")}, "got surface 0 is an array of .* of <U1"),
        ({"surfaces": np.array(0.04)}, "damaged and cannot be read"),
        ({"surfaces": np.empty((0, 121))}, "got row"),
        ({"surfaces": None}, "damaged and cannot be read"),
        ({"version": np.array(7)}, "its version must be at most 6"),
    ],
)
def test_hostile_orders_and_a_version_yet_to_come_are_refused_in_one_line(parts, said):
    with refused_in_a_line(OutputError, said):
        from_bytes(change_file(ordered_take(), **parts))


def test_a_take_with_smooth_strokes_is_no_scene_file_and_a_bake_shows_what_was_smoothed():
    take = ordered_take()
    system = assemble(SCENE)
    with pytest.raises(OutputError, match="has strokes in which the valves drive pins"):
        to_scene(replace(take, start=snapshot.dump(system, begin(system))), "mine")
    take = ordered_take()
    *_, last = replay(take)
    *_, frames = simulate_frames(take, 1.0 / take.duration)
    assert_array_equal(frames.height[-1], last.row(0).astype(np.float32))
