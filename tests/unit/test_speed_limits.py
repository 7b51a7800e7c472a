"""The bisection on the finger's speed, on made-up limits and on the real thing."""

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.metrics.summary import find_contact_ends
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import RUN_METRICS, run, select_rows
from digiclay.core.studies.speed_limits import (
    Criterion,
    Drag,
    Follows,
    Lift,
    bisect,
    find_largest_speed,
    judge,
    track,
)


def device(method="virtual_master", **layout):
    return resolve({"control": {"method": method}, "layout": layout})


@pytest.mark.parametrize(
    "limit, low, resolution, least, most, calls",
    [
        (17.3, 2.0, 0.1, 17.2, 17.3, 11),  # to its resolution
        (11.0, 0.0, 1.25, 9.75, 11.0, 7),  # both ends, then log2(32) halvings
        (50.0, 2.0, 0.1, 40.0, 40.0, 2),  # beyond the range: its end
    ],
)
def test_the_bisection_returns_a_value_that_held(limit, low, resolution, least, most, calls):
    tried = []
    found = bisect(lambda value: bool(tried.append(value)) or value <= limit, low, 40.0, resolution)
    assert found in tried
    assert least <= found <= most
    assert len(tried) == calls
    assert bisect(lambda value: False, low, 40.0, resolution) is None  # below the range


GOOD = Follows(speed=0.015, losses=0, loss_share=0.0, lag=1e-3, rfd=0.1)


@pytest.mark.parametrize(
    "bad",
    [{"losses": 1}, {"loss_share": 0.01}, {"lag": 3.1e-3}, {"rfd": 0.21}, {"lag": float("inf")}],
)
def test_each_part_of_the_criterion_can_fail_a_finger(bad):
    assert GOOD.meets(Criterion())
    assert not replace(GOOD, **bad).meets(Criterion())


def test_a_lift_is_as_fast_as_it_says_at_its_fastest_and_a_bed_narrower_than_the_drag_is_refused():
    path, start, end = Lift().path(8e-3, 40e-3)
    moments = np.linspace(start, end, 2001)
    speed = np.gradient(path.trajectory().poses(moments)[:, 2], moments)
    assert speed.max() == pytest.approx(8e-3, rel=1e-3)  # differences over 1/2000 of the way
    with pytest.raises(
        ParameterError, match=r"^layout\.columns must make the bed at least as wide"
    ):
        track(device(columns=9), Drag(), 10e-3)


def test_a_drag_has_a_limit_and_a_finger_that_is_lost_is_counted_with_its_time():
    drag = Drag(height=6e-3, length=30e-3)
    found = find_largest_speed(device(), drag, Criterion(), low=15e-3, high=70e-3, resolution=60e-3)
    assert found == 15e-3
    # No pin rises at 40 mm/s; the finger leaves at 2 s.
    judged, done = track(device(), Lift(), 40e-3)
    assert judged.losses == done.metrics["losses"] == 1
    (lost,) = find_contact_ends(done.history["time"], done.history["total_force"])
    assert 2.0 < lost < 2.55


@pytest.fixture(scope="module")
def press():
    return run(device(rows=11, columns=11))


def test_a_run_gives_every_figure_and_its_rows_between_two_times(press):
    assert list(press.figures) == list(RUN_METRICS)
    assert press.figures["duration"] == press.metrics["duration"] > 0.0
    part = select_rows(press.history, 0.5, 1.0)
    assert (part["time"][0], part["time"][-1], len(part["height"])) == (0.5, 1.0, 101)


@pytest.mark.parametrize(
    "without, losses",
    [
        ((), 0),
        (((0.0, 0.3),), 0),  # touched before the phase
        (((0.6, 0.7),), 1),
        (((0.6, 0.61), (0.8, 0.9)), 2),
        (((0.6, 0.61), (0.63, 0.64), (0.66, 0.67)), 1),  # bounces
        (((0.4, 0.6),), 1),  # lost before, and found again
        (((0.4, 3.0),), 1),  # never found again
        (((1.1, 3.0),), 1),  # in the 0.3 s after
        (((1.4, 3.0),), 0),
    ],
)
def test_losses_of_a_phase_are_counted_from_the_record_for_every_method(press, without, losses):
    time = press.history["time"]
    force = np.ones(len(time))
    for start, end in without:
        force[(time >= start) & (time < end)] = 0.0
    done = replace(press, history=press.history | {"total_force": force})
    assert judge(done, 0.5, 1.0, 0.0).losses == losses


@pytest.mark.parametrize(
    "changed, losses",
    [
        ({"control": "absent", "layout": {"rows": 5, "columns": 5}}, None),
        ({"shape": {"file": "crater"}, "control": {"method": "elastic"}}, None),
        ({"shape": {"file": "crater"}}, 0),  # what the method counts after the shape
    ],
)
def test_only_a_method_that_counts_losses_has_some(changed, losses):
    bed = {"layout": {"rows": 11, "columns": 11}, "simulation": {"duration": 0.02}}
    assert run(resolve({**bed, **changed})).metrics["losses"] == losses
