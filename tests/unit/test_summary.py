"""Metrics on signals whose answer is known without a computer; units of touch."""

import json
import math

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.metrics.metric_table import METRICS
from digiclay.core.metrics.signals import (
    compute_weights,
)
from digiclay.core.metrics.summary import (
    BORDER,
    SPATIAL_RESOLUTION,
    compute_cell_area,
    compute_contact_loss_share,
    compute_metrics,
    compute_rfd,
    find_weber_fractions,
    measure_lag,
    measure_ridge_errors,
    measure_surface_under,
    measure_touchdown,
    perceive,
    split_fingers,
    sum_cells,
    take_worst,
)
from digiclay.core.model.control_interface import SetPoint
from digiclay.core.model.layout import Layout, make_grid
from numpy.testing import assert_allclose, assert_array_equal

from tests.assemble import table

TIME = np.linspace(0.0, 10.0, 2001)
#: Rounding of sums over 2001 rows.
ROUNDING = 1e-12
#: Asked of all cells together, and of each that follows: 9 of them in `history`.
WHOLE, EACH = SetPoint(0.4), SetPoint(0.04, per_cell=True)


def history(total, time=TIME):
    """A bed of 3 x 3 pins, all force on the middle one, the finger 2 mm beside it."""
    force = np.zeros((len(time), 9))
    force[:, 4] = total
    fingertip = np.tile([0.002, 0.0, 0.04, 1.0, 0.0, 0.0, 0.0], (len(time), 1))
    height = np.full((len(time), 9), 0.04)
    height[-1, :3] = 0.043, 0.039, 0.041
    mode = np.full((len(time), 9), Mode.FORCE_FOLLOW, dtype=np.int8)
    position = make_grid(Layout(rows=3, columns=3)).positions
    return {"time": time, "height": height, "force": force, "command": np.zeros_like(force), "mode": mode,
            "fingertip": fingertip, "total_force": total, "position": position}  # fmt: skip


def measure(*given):
    """Return the metrics of such a history, for a force asked of all cells."""
    return compute_metrics(history(*given), WHOLE)


@table(
    "total, wanted",
    {
        "a force at its set point": (np.full(2001, 0.4), 0.0),
        # 0.43 - 0.4 loses two digits.
        "a constant offset": (np.full(2001, 0.43), pytest.approx(0.03, rel=1e-10)),
        # The trapezium rule is exact for sin² over whole periods.
        "a sine": (
            0.4 + 0.1 * np.sin(2.0 * np.pi * TIME),
            pytest.approx(0.1 / np.sqrt(2.0), rel=ROUNDING),
        ),
        "the time without contact is left out": (
            np.where((TIME > 2.0) & (TIME < 6.0), 0.43, 0.0),
            pytest.approx(0.03, rel=1e-10),
        ),
        # Which rounding decides: in a batch it may be another.
        "so is a finger that touches as deep as its place is rounded": (
            np.where((TIME > 2.0) & (TIME < 6.0), 0.43, 1e-16),
            pytest.approx(0.03, rel=1e-10),
        ),
    },
)
def test_the_rfd_is_the_rms_deviation_in_contact(total, wanted):
    assert compute_rfd(TIME, total, 0.4) == wanted


def test_the_rfd_weighs_rows_by_their_time_and_by_session_and_shaping():
    # A force of 0.5 for 1 s in 101 rows and of 0.4 for 9 s in 10: rows counted alike would give
    # 0.095.
    time = np.concatenate([np.linspace(0.0, 1.0, 101), np.arange(2.0, 11.0)])
    total = np.where(time <= 1.0, 0.5, 0.4)
    # The row at 1 s stands for half a second after it as well: 1.5 s in all.
    assert compute_rfd(time, total, 0.4) == pytest.approx(0.1 * np.sqrt(1.5 / 10.0), rel=1e-9)
    uneven = np.array([0.0, 0.1, 0.5, 2.0, 2.5])
    assert compute_weights(uneven).sum() == pytest.approx(2.5, rel=ROUNDING)
    # 4 s of 0 and 6 s of 0.4; the trapezium rule smears each of the two jumps over half a row of
    # 2001.
    found = measure(np.where((TIME > 2.0) & (TIME < 6.0), 0.0, 0.4))
    assert (found["rfd"], found["rfd_session"]) == (
        0.0,
        pytest.approx(0.4 * np.sqrt(0.4), rel=1e-3),
    )
    case = history(np.where(TIME < 5.0, 0.2, 0.4))
    case["mode"][TIME < 5.0] = Mode.SPRING  # touching down is no shaping
    found = compute_metrics(case, WHOLE)
    assert found["rfd_shaping"] == 0.0 < 0.1 < found["rfd"]
    # The deviation from the mean leaves out a constant offset.
    found = measure(0.5 + 0.1 * np.sin(2.0 * np.pi * TIME))
    assert found["force_deviation"] == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-6)


def test_a_force_asked_of_each_cell_is_judged_by_how_many_follow_in_that_row():
    # 9 cells follow in the first half, 4 in the second: 0.36 and 0.16 N are asked for.
    early = TIME < 5.0
    case = history(np.where(early, 0.36, 0.16))
    case["mode"][~early, :5] = Mode.SPRING
    found = compute_metrics(case, EACH)
    assert found["rfd"] == found["rfd_shaping"] == pytest.approx(0.0, abs=ROUNDING)
    # The middle row, 1 of 2000 intervals, belongs to the second half.
    assert found["set_point"] == pytest.approx(0.5 * (0.36 + 0.16), abs=1e-4)
    case["total_force"] = case["total_force"] + 0.05
    assert compute_metrics(case, EACH)["rfd"] == pytest.approx(0.05, rel=1e-10)
    # Rows in which no cell follows ask for nothing.
    case = history(np.where(early, 0.2, 0.36))
    case["mode"][early] = Mode.SPRING
    found = compute_metrics(case, EACH)
    assert found["rfd"] == found["rfd_session"] == pytest.approx(0.0, abs=ROUNDING)
    case["mode"][:] = Mode.SPRING
    found = compute_metrics(case, EACH)
    names = ("set_point", "rfd", "rfd_session", "force_overshoot", "settling_time")
    assert [found[name] for name in names] == [None] * 5


def test_without_a_set_point_there_is_none_and_no_deviation_from_it():
    case = history(np.full(2001, 0.4))
    with_one, without = compute_metrics(case, WHOLE), compute_metrics(case, None)
    assert {name for name in METRICS if with_one[name] is not None and without[name] is None} == {
        "set_point", "rfd", "rfd_shaping", "rfd_session", "force_overshoot", "settling_time",
        "rfd_jnd_least", "rfd_jnd_most",
    }  # fmt: skip


def test_shaping_wants_contact_and_a_follower_and_a_loss_is_a_gap_between_two_contacts():
    case = history(np.array([0.4, 0.4, 0.0]), np.arange(3.0))
    case["mode"][:] = Mode.REST
    case["mode"][:, 4] = Mode.FORCE_FOLLOW, Mode.SPRING, Mode.FORCE_FOLLOW
    assert_array_equal(sum_cells(case).shaping, [True, False, False])
    touching = ((TIME >= 2.0) & (TIME <= 4.0)) | ((TIME >= 5.0) & (TIME <= 7.0))
    # 1 s of 5; the gap is 199 rows of 5 ms, and the ends of the window 2 half rows more.
    assert compute_contact_loss_share(TIME, 0.4 * touching) == pytest.approx(0.2, abs=2e-3)
    # A row a second: one between two others stands for 1 s, the first and the last for half of it.
    for force, share in (
        ([1, 0, 0, 1], 2 / 3),
        ([0, 1, 0, 1, 1], 2 / 7),
        ([0, 1, 1, 0], 0.0),
        ([1], 0.0),
    ):
        found = compute_contact_loss_share(np.arange(len(force)), np.array(force))
        assert found == pytest.approx(share, rel=ROUNDING)


#: 9 pins of 9 mm² raised by 3 and 1 mm and sunk by 1 mm; differences of heights lose three digits.
FOUND = {
    "lag_mean": 0.002, "lag_max": 0.002, "max_cell_force": 0.5, "max_total_force": 0.5, "lowest": 0.039,
    "highest": 0.043, "height_range": 0.004, "raised_volume": 4e-3 * 9e-6, "sunk_volume": 1e-3 * 9e-6,
    "duration": 10.0,
}  # fmt: skip


def test_the_summary_has_lag_extremes_volumes_and_share_of_contact():
    found = measure(np.linspace(0.0, 0.5, 2001))
    assert {name: found[name] for name in FOUND} == pytest.approx(FOUND, rel=1e-9)
    found = measure(np.where(TIME < 2.5, 0.4, 0.0))
    assert found["contact_share"] == pytest.approx(0.25, abs=5e-4)  # one row of 2001
    assert found["contact_loss_share"] == 0.0  # lifted at the end


@pytest.mark.parametrize(
    "layout, square_millimeters",
    [
        (Layout(rows=4, columns=3), 9.0),
        (Layout(rows=4, columns=3, arrangement="staggered"), 9.0),
        (Layout(rows=4, columns=3, arrangement="hexagonal"), 9.0 * np.sqrt(0.75)),
        (Layout(rows=1, columns=3), 9.0),
        (Layout(rows=3, columns=1), 9.0),
    ],
)
def test_a_cell_stands_for_pitch_times_row_spacing(layout, square_millimeters):
    assert compute_cell_area(make_grid(layout).positions) == pytest.approx(
        square_millimeters * 1e-6, rel=1e-9
    )


def test_a_session_without_contact_has_no_rfd_lag_or_loss():
    found = measure(np.zeros(2001))
    nothing = {name for name, value in found.items() if value is None}
    assert nothing == {
        "rfd", "rfd_shaping", "contact_loss_share", "lag_mean", "lag_max", "force_deviation",
        "force_oscillation", "force_overshoot", "settling_time", "height_deviation", "ridge_offset",
        "ridge_error", "ridge_unevenness", "rfd_jnd_least", "rfd_jnd_most", "ridge_unevenness_touch",
    }, "a metric that needs contact belongs in this list"  # fmt: skip
    assert found["contact_share"] == 0.0


def test_the_first_touch_overshoots_by_its_peak_and_settles_within_a_tenth_of_the_set_point():
    touched_twice = np.array([0.0, 0.0, 0.3, 0.5, 0.0, 0.9])
    assert measure_touchdown(np.arange(6.0), touched_twice, np.full(6, 0.4)) == (
        pytest.approx(0.25),
        None,
    )
    total = np.where(TIME < 1.0, 0.0, 0.4 + 0.1 * np.exp(-(TIME - 1.0)))
    found = measure(total)
    assert found["force_overshoot"] == pytest.approx(0.25, rel=1e-6)
    # 0.1 exp(-t) falls below 0.04 at ln 2.5 = 0.916 s; a row is 5 ms, and the row before counts as
    # well.
    assert found["settling_time"] == pytest.approx(np.log(2.5), abs=0.011)
    # Asked of each cell, of which none follows before 2 s; a quarter too much then, falling as
    # above.
    case = history(np.where(TIME < 1.0, 0.0, 0.36 * (1.0 + 0.25 * np.exp(-(TIME - 2.0)))))
    case["mode"][TIME < 2.0] = Mode.SPRING
    found = compute_metrics(case, EACH)
    assert found["force_overshoot"] == pytest.approx(0.25, rel=1e-6)
    assert found["settling_time"] == pytest.approx(1.0 + np.log(2.5), abs=0.011)


def test_the_summary_is_json_and_has_every_key_at_extremes_as_well():
    case = history(np.full(2001, 0.4))
    found = compute_metrics(case, WHOLE)
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert found.keys() == METRICS.keys()
    one = measure(np.array([0.5]), np.array([0.0]))
    assert (one["rfd"], one["duration"]) == (pytest.approx(0.1, rel=1e-10), 0.0)
    # A single pin has no area to form a volume over.
    single = {
        name: value[:, :1] if value.shape[1:] == (9,) else value for name, value in case.items()
    }
    assert compute_metrics({**single, "position": np.zeros((1, 2))}, WHOLE)["raised_volume"] is None
    # Forces that give a lag beyond all numbers give none and no warning.
    far = {
        **history(np.full(2001, 1e-300)),
        "force": case["force"],
        "position": case["position"] + 1.0,
    }
    assert compute_metrics(far, WHOLE)["lag_max"] is None
    case["height"][-1, 0] = np.nan
    assert compute_metrics(case, WHOLE)["height_range"] is None
    nothing = {name: value if name == "position" else value[:0] for name, value in case.items()}
    with pytest.raises(
        ParameterError, match=r"^History\.time must have at least one row \(got none\)\.$"
    ):
        compute_metrics(nothing, WHOLE)


@pytest.mark.parametrize(
    "force, fractions",
    [
        # Gueorguiev and others 2022; Pang, Tan and Durlach 1991 have 7 % from 2.5 to 10 N.
        *((force, (0.07, 0.10)) for force in (0.5, 0.76, 2.5, 10.0)),
        *((force, (0.15, 0.27)) for force in (0.01, 0.4, math.nextafter(BORDER, 0.0))),
    ],
)
def test_a_jnd_is_7_to_10_percent_from_half_a_newton_on_and_15_to_27_below(force, fractions):
    assert find_weber_fractions(force) == fractions


def test_deviations_are_counted_in_units_of_touch():
    assert list(perceive(0.15 * 0.4, 0.4, None).values())[:2] == pytest.approx([15 / 27, 1.0])
    assert list(perceive(0.10 * 2.5, 2.5, None).values())[:2] == pytest.approx([1.0, 10 / 7])
    # Van Boven and Johnson 1994: 0.94 mm at the finger.
    assert pytest.approx(0.94e-3) == SPATIAL_RESOLUTION
    assert perceive(None, None, 0.47e-3)["ridge_unevenness_touch"] == pytest.approx(0.5)
    assert set(perceive(0.1, None, None).values()) == {None}


@pytest.mark.parametrize(
    "values, said",
    [
        ((-0.1, 0.4, 0.0), "Perception.deviation must be at least 0 N"),
        ((math.nan, 0.4, 0.0), "Perception.deviation must be at least 0 N"),
        ((0.1, 0.0, 0.0), "Perception.force must be above 0 N"),
        ((0.1, math.nan, 0.0), "Perception.force must be above 0 N"),
        ((0.1, math.inf, 0.0), "Perception.force must be above 0 N"),
        ((0.1, 0.4, math.inf), "Perception.unevenness must be at least 0 m"),
    ],
)
def test_what_is_no_deviation_is_refused(values, said):
    with pytest.raises(ParameterError, match=said):
        perceive(*values)


#: 21 pins 3 mm apart on a slanting line; the finger goes over all of them in 201 rows, 50 mm up.
LINE, ALONG = np.linspace(-30e-3, 30e-3, 21), (0.6, 0.8)
PLACE, TIP = np.outer(LINE, ALONG), np.zeros((201, 7))
TIP[:, :2], TIP[:, 2], TIP[:, 3] = np.outer(np.linspace(-30e-3, 30e-3, 201), ALONG), 50e-3, 1.0
ALL = np.ones(201, dtype=bool)


def errors(final, rows=ALL, tip=TIP):
    return measure_ridge_errors(PLACE, final, tip, rows, 11e-3) * 1e3


def test_a_ridge_has_its_height_over_the_path_at_each_pin():
    assert_array_equal(errors(np.full(21, 50e-3)), 0.0)
    assert_allclose(errors(np.full(21, 51.5e-3)), 1.5, rtol=1e-12)
    climbing = TIP.copy()
    climbing[:, 2] += 0.1 * np.linspace(-30e-3, 30e-3, 201)
    # The finger is nearest for 3 mm of its way and 1.5 mm past the pin when it was so last: 0.15 mm
    # higher.
    assert_allclose(errors(50e-3 + 0.1 * LINE, tip=climbing), -0.15, atol=0.031)
    # 2001 rows are looked at in eight parts alike.
    fine = np.repeat(TIP, 10, axis=0)
    assert_array_equal(errors(np.full(21, 51e-3), np.ones(2010, dtype=bool), fine).size, 17)


def test_pins_the_finger_did_not_go_on_from_no_travel_no_rows_and_what_follows_a_loss_do_not_count():
    # Of the 21 pins the last four are less than 11 mm before the end of the way.
    final = np.where(LINE > 18.5e-3, 90e-3, 50e-3)
    found = errors(final)
    assert (len(found), found.max()) == (17, 0.0)
    # With 12 mm, as if none is given, the last of them is on the border.
    assert len(measure_ridge_errors(PLACE, final, TIP, ALL)) in (16, 17)
    still = np.tile(TIP[100], (50, 1))
    assert measure_ridge_errors(PLACE, np.full(21, 60e-3), still, np.ones(50, dtype=bool)).size == 0
    assert errors(np.full(21, 50e-3), rows=~ALL).size == 0
    # Shaping stops in the middle, and goes on 12 mm later.
    rows = ALL.copy()
    rows[100:140] = False
    counted = measure_ridge_errors(PLACE, np.arange(21.0), TIP, rows, 11e-3) + 50e-3
    # Of pins 0 to 10, passed before, 11 mm of way must follow before the middle: up to pin 6, at
    # -12 mm.
    assert [int(pin) for pin in np.rint(counted) if pin < 10] == list(range(7))


#: Two rows of two cells, at (1, 2) and (4, 6) mm.
HISTORY = {
    "height": np.array([[50e-3, 52e-3], [51e-3, 53e-3]]),
    "force": np.array([[0.0, 0.0], [0.3, 0.1]]),
    "mode": np.array([[Mode.REST, Mode.SPRING], [Mode.FORCE_FOLLOW, Mode.REST]]),
    "total_force": np.array([0.0, 0.4]),
    "position": np.array([[1e-3, 2e-3], [4e-3, 6e-3]]),
}


def test_the_surface_counts_cells_by_force_and_the_lag_is_that_of_their_centroid():
    # 0.3 N at 51 mm and 0.1 N at 53 mm: 51.5 mm, over a finger at 50 mm.
    assert measure_surface_under(sum_cells(HISTORY), TIP[:2]) * 1e3 == pytest.approx(
        [1.5], rel=1e-9
    )
    nothing = {**HISTORY, "force": np.zeros((2, 2)), "total_force": np.zeros(2)}
    assert measure_surface_under(sum_cells(nothing), TIP[:2]).size == 0
    place = np.array([[0.0, 0.0], [0.004, 0.0]])
    fingertip = np.tile([0.001, 0.004, 0.05, 1.0, 0.0, 0.0, 0.0], (3, 1))
    force = np.array([[0.1, 0.3], [0.0, 0.0], [0.4, 0.0]])
    # Centroids (3, 0) and (0, 0) mm from (1, 4) mm: √(4+16) and √(1+16); the row without force is
    # left out.
    case = {"position": place, "force": force, "total_force": force.sum(axis=1)}
    sums = sum_cells({**case, "height": np.zeros_like(force), "mode": np.zeros_like(force)})
    assert_allclose(measure_lag(sums, fingertip), np.sqrt([20.0, 17.0]) * 1e-3, rtol=ROUNDING)


def of_two(places, force, own):
    """Return a bed of 1 x 5 pins under two fingers on its row; forces by pin and of each finger, N."""
    position = make_grid(Layout(rows=1, columns=5)).positions
    one = history(TIME * 0.0) | {"position": position}
    for name in ("height", "force", "command", "mode"):
        one[name] = np.zeros((len(TIME), 5), one[name].dtype)
    for cell, value in force.items():
        one["force"][:, cell] = value
    one["fingertip"] = np.tile([0.0, 0.0, 0.04, 1.0, 0.0, 0.0, 0.0], (len(TIME), 2, 1))
    one["fingertip"][:, :, 0] = places
    one["finger_force"] = np.tile(own, (len(TIME), 1))
    return one | {"total_force": one["finger_force"].sum(axis=1)}


@pytest.mark.parametrize(
    "places, force, own, lags",
    [
        ((-6e-3, 6e-3), {0: 0.3, 4: 0.1}, (0.3, 0.1), (0.0, 0.0)),  # apart
        # The middle pin is of both.
        (
            (-3e-3, 3e-3),
            {1: 0.2, 2: 0.2, 3: 0.2},
            (0.3, 0.3),
            (1.5e-3, 1.5e-3),
        ),
        ((0.0, 0.0), {2: 0.6}, (0.4, 0.2), (0.0, 0.0)),  # in one place
        # All that one presses is nearer to the other.
        (
            (3e-3, 4e-3),
            {3: 0.3},
            (0.2, 0.1),
            (0.0, 1e-3),
        ),
        ((3e-3, 4e-3), {3: 0.3}, (0.3, 0.0), (0.0, None)),  # and it presses nothing
        ((-6e-3, 6e-3), {}, (0.0, 0.0), (None, None)),  # none does
    ],
)
def test_a_pin_counts_for_the_nearest_of_two_fingers_whose_forces_stay_as_they_are(
    places, force, own, lags
):
    for mirror in (1, -1):
        given = of_two(places, force, own)
        given["fingertip"][:, :, 0] *= mirror
        given["force"] = given["force"][:, ::mirror]
        each = [compute_metrics(one, None) for one in split_fingers(given)]
        # Rounding.
        assert [one["max_total_force"] for one in each] == pytest.approx(own, abs=1e-15)
        assert [one["lag_mean"] for one in each] == [
            lag and pytest.approx(lag, abs=1e-12) for lag in lags
        ]


def test_of_two_fingers_the_lower_one_presses_a_pin_between_them_that_stands_low():
    # The second pin is 5 and 8 mm from them.
    given = of_two((-5e-3, 8e-3), {1: 0.1, 2: 0.2, 4: 0.3}, (0.1, 0.5))
    given["fingertip"][:, 1, 2] = 35e-3
    given["height"] += [0.0, 41e-3, 40e-3, 0.0, 36e-3]
    mine, lower = split_fingers(given)
    assert_allclose(mine["force"][0], [0.0, 0.1, 0.0, 0.0, 0.0])
    assert_allclose(lower["force"][0], [0.0, 0.0, 0.2, 0.0, 0.3])


@pytest.mark.parametrize(
    "name, each, worst",
    [
        ("rfd", (0.1, 0.3, None), 0.3),
        ("rfd", (None, None, None), None),
        ("contact_share", (0.9, 0.0, 0.5), 0.0),
        ("ridge_offset", (1e-4, -3e-3, 2e-4), -3e-3),
        ("settling_time", (0.2, 0.4, 0.3), 0.4),
        ("settling_time", (0.2, None, 0.3), None),
    ],
)
def test_the_worst_of_several_fingers_is_told(name, each, worst):
    assert take_worst([{name: value} for value in each]) == {name: worst}
