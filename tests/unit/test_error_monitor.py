"""The reference solution beside a live session: what it finds, and when it is integrated."""

from __future__ import annotations

from itertools import cycle, islice
from typing import Any

import numpy as np
import pytest
from digiclay.core.engine.simulation import begin
from digiclay.core.engine.state import State
from digiclay.core.model.fingertip import LEVEL
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session import accuracy, recent_trace, snapshot
from digiclay.core.session.accuracy import PAUSE, SPREAD, STRETCH, Errors
from digiclay.core.session.live_session import interpolate_path, simulate_path
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SCENE = resolve({"layout": {"rows": 11, "columns": 11}})
SYSTEM = assemble(SCENE)


def pose(x: float = 0.0, z: float = 0.05) -> Floats:
    """Return a level finger's pose, m, as that of the only one."""
    return np.array([[x, 0.0, z, *LEVEL]])


def watched(scene: Scene, finger: Floats) -> tuple[State, list[Errors]]:
    """Follow a path with a monitor; return the last state and the errors it finds."""
    system, monitor, found = assemble(scene), accuracy.start(scene), []
    assert monitor is not None
    start = begin(system)
    monitor = accuracy.begin_stretch(monitor, start)
    for index, state in enumerate(simulate_path(system, start, finger)):
        monitor = accuracy.note(monitor, state, finger[index : index + 2])
        monitor, errors = accuracy.catch_up(monitor, state, 1)
        found += [errors] if errors else []
    return state, found


def stepped(step: str) -> Scene:
    """Return the scene with a physics step."""
    return resolve({"layout": {"rows": 11, "columns": 11}, "simulation": {"physics_step": step}})


def go_on(finger: Floats) -> Floats:
    """Return a finger's path that moves on, quite differently, while the reference lags behind."""
    return np.concatenate([finger, interpolate_path(pose(z=0.039), pose(z=0.05), STRETCH * (SPREAD - 1) - 1)])


@pytest.mark.parametrize("ticks", [(3, 3, 4), (1,), (2, 1), (9,)])
def test_no_tick_has_more_of_the_reference_than_a_share_of_its_periods(
    ticks: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[int] = []
    repeat = accuracy.repeat_period

    def counted(*arguments: Any) -> State:
        done.append(tick)
        return repeat(*arguments)

    monkeypatch.setattr(accuracy, "repeat_period", counted)
    monitor, start = accuracy.start(SCENE), begin(SYSTEM)
    assert monitor is not None
    finger = interpolate_path(pose(), pose(z=0.038), STRETCH + PAUSE)
    monitor, counts = accuracy.begin_stretch(monitor, start), cycle(ticks)
    states = enumerate(simulate_path(SYSTEM, start, finger))
    sizes: list[int] = []
    while (period := sum(sizes)) < STRETCH + PAUSE - max(ticks):
        tick = len(sizes)
        sizes.append(next(counts))
        for period, state in islice(states, sizes[-1]):
            monitor = accuracy.note(monitor, state, finger[period : period + 2])
        monitor, _ = accuracy.catch_up(monitor, state, sizes[-1])
    assert len(done) == STRETCH
    for tick, size in enumerate(sizes):
        assert done.count(tick) <= max(1, size // SPREAD)
        # A tick of more periods than the one before takes the longest already.
        assert not (tick and size > sizes[tick - 1] and done.count(tick))
        assert SPREAD * sum(number <= tick for number in done) <= sum(sizes[: tick + 1])


def test_the_monitor_finds_the_error_of_a_stretch_and_a_finer_step_has_smaller_ones() -> None:
    # The truth: the same periods at a twentieth of the step. The commands differ by what the errors
    # before them changed, so it is no more than the right size that is asked for.
    finger = interpolate_path(pose(z=0.0395), pose(0.004, 0.0375), STRETCH)
    (_, (found,)), (_, (fine, *_)) = (watched(stepped(step), go_on(finger)) for step in ("1 ms", "0.25 ms"))
    ends = []
    for step in ("0.05 ms", "1 ms"):
        system = assemble(stepped(step))
        *_, state = simulate_path(system, begin(system), finger)
        ends.append(state.row(0))
    error = np.abs(ends[0] - ends[1]).max()
    assert 0.3 * error < found.height < 3.0 * error
    assert error > 1e-9
    # Second order: a quarter of the step has a sixteenth of the error, contact events aside.
    assert fine.height < found.height / 8
    assert fine.force < found.force / 8


def test_a_monitor_follows_for_a_stretch_now_and_then_and_leaves_the_session_alone() -> None:
    count = 2 * (STRETCH + PAUSE) + STRETCH * SPREAD
    finger = interpolate_path(pose(z=0.0395), pose(0.004, 0.0375), count)
    *_, alone = simulate_path(SYSTEM, begin(SYSTEM), finger)
    state, found = watched(SCENE, finger)
    assert len(found) == 3
    assert snapshot.dump(SYSTEM, state) == snapshot.dump(SYSTEM, alone)
    assert recent_trace.measure_total_force(SYSTEM, state) > 0.0
    # A step that cannot be halved has no monitor.
    table = {"simulation": {"control_period": "1 s", "physics_step": "1 ms"}, "control": "absent"}
    assert accuracy.start(resolve(table)) is None
