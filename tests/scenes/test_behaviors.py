"""The behaviors under a finger: what each claims, over whole sessions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.scene.assembly import assemble
from digiclay.core.session.run_scene import run

from tests.assemble import followed

REST, DEAD_BAND, PERIOD = 40e-3, 10e-6, 5e-3
#: In, 5 mm deep; still until 2 s; gone within 20 ms of that.
GONE = 2.02
PRESS = ((0.0, 0, 0, 41), (1.0, 0, 0, 35), (2.0, 0, 0, 35), (2.2, 0, 0, 70), (4.2, 0, 0, 70))


def scene(method, way=PRESS, side=13, **known):
    """Return a scene on a square bed, with parameters of the method; the way in s and mm."""
    bed = {"arrangement": known.pop("arrangement", "aligned")}
    return followed(method, way, side, layout=bed, control={"method": method, **known})


@cache
def pressed(method):
    return run(scene(method))


def heights(result):
    return result.history["height"]


def at(result, time):
    return int(np.argmin(np.abs(result.history["time"] - time)))


def test_an_elastic_bed_is_felt_as_a_spring():
    result = pressed("elastic")
    row = at(result, 1.99)
    force, height = result.history["force"][row], heights(result)[row]
    # The pulp relaxes, so pins creep up, by 0.1 mm/s at the most, and for c = 5 N s/m that takes
    # 0.5 mN; the opening of a free pin does 1 - F/F_max of it, half of it at 75 mN: up to 1 mN.
    assert force == pytest.approx(20.0 * (REST - height), abs=1e-3)


def test_a_plastic_bed_stays_at_the_deepest_press_and_as_it_is_under_a_shallower_one():
    again = (*PRESS[:4], (3.2, 0, 0, 40), (3.6, 0, 0, 35.3), (3.8, 0, 0, 70), (4.8, 0, 0, 70))
    result = run(scene("plastic", again))
    deepest = heights(result)[: at(result, GONE)].min(axis=0)
    before = heights(result)[at(result, 3.0)]
    # The valve lags 3 ms: what a pin sinks in that time after its force fell below yield is no
    # press. At 12 mm/s that is 36 µm, and the dead band comes on top.
    assert np.abs(before - deepest).max() <= 46e-6
    assert np.ptp(heights(result)[at(result, 2.5) : at(result, 3.0)], axis=0).max() == 0.0
    assert result.history["total_force"][at(result, 3.0) :].max() > 0.0
    assert np.abs(heights(result)[-1] - before).max() <= DEAD_BAND


@pytest.mark.parametrize("time_constant, diffusivity", [(0.3, 10e-6), (1.0, 0.0)])
def test_a_viscous_dent_s_volume_recovers_with_its_time_constant(time_constant, diffusivity):
    result = run(scene("viscous", recovery_time=time_constant, diffusivity=diffusivity, side=17))
    first, last = at(result, 2.1), at(result, 2.1 + time_constant)
    dent = (REST - heights(result)).sum(axis=1)
    taken = result.history["time"][last] - result.history["time"][first]
    assert taken / np.log(dent[first] / dent[last]) == pytest.approx(time_constant, rel=0.05)


def test_what_spreads_in_a_viscous_bed_is_not_lost_and_one_that_has_recovered_costs_nothing():
    # Hardly any recovery: after the finger left, the commanded heights' sum stays as it is.
    system, way = _system(scene("viscous", recovery_time=1e6, side=17))
    sums = [
        (state.row(system.rows.target) - REST).sum()
        for state in periods(system, [way], begin(system), 700)
        if state.period * PERIOD >= 2.1
    ]
    # 1.4 s of 1e6 s, 1.4e-6; rounding.
    assert sums[-1] == pytest.approx(sums[0], rel=2e-6)
    assert sums[0] < -20e-3
    system, way = _system(scene("viscous", (*PRESS[:4], (6.0, 0, 0, 70)), recovery_time=0.3))
    *_, last = periods(system, [way], begin(system), 1000)
    assert last.active.cells.size == 0
    assert np.all(last.row(system.rows.target) == REST)
    assert np.abs(last.row(0) - REST).max() <= DEAD_BAND + 1e-12
    assert set(last.mode().tolist()) == {int(Mode.REST)}


def _system(made):
    return assemble(made), made.section("trajectory").trajectory()


@pytest.mark.parametrize("arrangement", ["aligned", "hexagonal"])
def test_a_larger_disc_changes_nothing_visible_in_a_viscous_bed(arrangement):
    made = scene("viscous", side=25, arrangement=arrangement)
    ends = []
    for factor in (1.0, 4.0):
        system, way = _system(made)
        wider = replace(system.controller, margin=factor * system.controller.margin)
        *_, last = periods(replace(system, controller=wider), [way], begin(system), 600)
        ends.append((last.row(0), last.row(system.rows.target)))
    (narrow, asked), (wide, asked_wide) = ends
    # Beyond the border the displacement is below a tenth of the dead band: commanded heights differ
    # by no more, heights by no more than the dead band as well.
    assert np.abs(asked - asked_wide).max() <= 0.1 * DEAD_BAND
    assert np.abs(narrow - wide).max() <= 1.1 * DEAD_BAND


def test_a_pushed_pin_gives_way_and_stays_and_one_that_is_not_stays_at_rest_while_it_listens():
    result = pressed("push_pull")
    under, left = heights(result)[at(result, 1.99)], heights(result)[-1]
    assert under.min() < REST - 3e-3
    # The finger's last push, and the ripple of a pin that is moved: 20 mm/s in 5 ms.
    assert np.abs(left - under).max() < 0.1e-3
    result = run(scene("push_pull", ((0.0, 0, 0, 40.3), (2.0, 0, 0, 40.3))))
    assert result.history["command"].any()
    # The ripple: 8 mm/s for 5 ms; and nothing that adds up over 200 cycles.
    assert np.abs(heights(result) - REST).max() < 40e-6


@pytest.mark.parametrize("field", ["wave", "ramp"])
def test_a_resting_finger_feels_the_field(field):
    result = run(scene("force_display", field=field, force=0.05, contrast=0.5))
    row = at(result, 1.99)
    force, asked = result.history["force"][row], assemble(result.scene).controller.field
    felt = force > 0.0
    assert np.count_nonzero(felt) >= 15
    # The pulp goes on relaxing, and pins creep up after it, by 0.1 mm/s at the most. For c = 5 N
    # s/m that takes 0.5 mN; a valve worked out for a free pin does 1 - F/F_max of it, half of it at
    # 75 mN: 1 mN, 2 %.
    assert force[felt] == pytest.approx(asked[felt], abs=1e-3)


AWAY = ((0.0, 0, 0, 90), (12.0, 0, 0, 90))


@cache
def displayed(refresh, shape="crater", **known):
    result = run(scene("shape_display", AWAY, 9, shape=shape, refresh=refresh, surfaces=3, **known))
    return result, assemble(result.scene).controller.heights


@pytest.mark.parametrize(
    "refresh, shape",
    [("one_time", "saddle"), ("gradual", "pyramid"), ("approximate_gradual", "file")],
)
def test_the_display_reaches_its_shape(refresh, shape, tmp_path):
    if shape == "file":
        shape = str(tmp_path / "mine.npy")
        np.save(shape, np.random.default_rng(6).uniform(30e-3, 50e-3, (9, 9)))
    result, wanted = displayed(refresh, shape)
    assert np.ptp(wanted) > 9e-3
    assert np.abs(heights(result)[-1] - wanted).max() <= DEAD_BAND + 1e-12


def moving(result):
    """Return where rows of the bed move in a period, (t - 1, rows)."""
    steps = np.abs(np.diff(heights(result), axis=0)).reshape(-1, 9, 9)
    return np.any(steps > 1e-6, axis=2)


def test_a_one_time_refresh_moves_row_by_row_and_a_gradual_one_shows_intermediate_surfaces():
    result, wanted = displayed("one_time", "saddle")
    height = heights(result).reshape(-1, 9, 9)
    settled = np.abs(height - wanted.reshape(9, 9)).max(axis=2) <= DEAD_BAND
    for row in range(8):
        starts = int(np.argmax(moving(result)[:, row + 1]))
        assert np.all(settled[starts, : row + 1]), row
    assert np.argmax(settled.all(axis=1)) > 0
    result, wanted = displayed("gradual", "pyramid")
    for share in (1 / 3, 2 / 3, 1.0):
        surface = REST + share * (wanted - REST)
        nearest = np.abs(heights(result) - surface).max(axis=1).min()
        # The first rows are on their way to the next surface before the last one has come to rest
        # in the dead band: no more than a settling time's end, a dead band more.
        assert nearest <= 2 * DEAD_BAND, share


def test_the_approximate_refresh_is_the_quickest_and_a_small_step_as_quick_as_the_hardware():
    ways = ("approximate_gradual", "one_time", "gradual")
    rows = [moving(displayed(way, "saddle")[0]) for way in ways]
    assert rows[0].sum(axis=1).max() == 9
    ends = [np.flatnonzero(row.any(axis=1))[-1] for row in rows]
    assert ends == sorted(ends)
    result, _ = displayed("approximate_gradual", "dome", amplitude=1e-3)
    # Three steps of a third of a millimeter; 50 to 100 ms each.
    end = np.flatnonzero(moving(result).any(axis=1))[-1] * PERIOD
    assert 3 * 0.05 <= end <= 3 * 0.1


def test_a_displayed_shape_holds_against_a_finger():
    way = [(0, 70), (2, 70), (2.5, 48), (3, 48), (3.5, 70), (4.5, 70)]
    result = run(
        scene("shape_display", tuple((t, 0, 0, z) for t, z in way), refresh="approximate_gradual")
    )
    wanted = assemble(result.scene).controller.heights
    assert result.history["total_force"].max() > 0.5
    assert np.abs(heights(result)[-1] - wanted).max() <= DEAD_BAND + 1e-12
