"""Runs in a stack come to what they come to alone, and what befalls one of them is its own affair."""

from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import DivergenceError, ParameterError
from digiclay.core.batch.play import begin_play, play_all
from digiclay.core.batch.run_together import measure_together, run_together
from digiclay.core.batch.structure import describe_structure
from digiclay.core.control.methods import METHODS
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.metrics.metric_table import METRICS
from digiclay.core.scene.assembly import assemble
from digiclay.core.session.accuracy import estimate_errors, make_reference
from digiclay.core.session.run_scene import run

from tests.assemble import STACKABLE, followed, moved, sample

#: Sums in another order: a last bit here and there. Heights are centimeters, forces tenths of a
#: newton.
HEIGHT, FORCE = 1e-12, 1e-10
#: So many times as much of Method III: its estimates end at the 11th digit, which a last bit may
#: change.
ESTIMATED = 100.0
#: The same of figures: lags are rounded to 1e-12 m; forces, by their unit, as above; a volume adds
#: up some hundred heights, each over 1e-5 m².
RELATIVE, ABSOLUTE, OTHERS = 1e-9, {"N": FORCE, "m3": 1e-15}, 1e-12
#: An estimate is the difference of two integrations under the same commands. Alone and in a stack
#: both end in other last bits (sums in another order), some 1e-17 m and 1e-14 N, of heights of 4 cm
#: and forces of 0.4 N.
NOTHING = {"height": 1e-15, "force": 1e-12, "total_force": 1e-12}


def together(scenes):
    assert len({describe_structure(one) for one in scenes}) == 1
    done = {}
    for number, result in run_together(scenes):
        history = getattr(result, "history", None)
        if history:  # valid until the next result is asked for
            result = replace(result, history={name: rows.copy() for name, rows in history.items()})
        done[number] = result
    return [done[number] for number in range(len(scenes))]


def judged(scenes, *, errors=False):
    done = dict(measure_together(scenes, errors=errors))
    return [done[number] for number in range(len(scenes))]


def assert_figures(found, alone):
    for name in (*METRICS, "losses", "control_periods", "incomplete"):
        value, unit = alone.metrics[name], alone.metrics["units"].get(name, "1")
        assert found.metrics["units"].get(name, "1") == unit
        tolerance = ABSOLUTE.get(unit, OTHERS)
        expected = value if value is None else pytest.approx(value, rel=RELATIVE, abs=tolerance)
        assert found.metrics[name] == expected, name


def assert_as_alone(found, alone):
    assert found.history.keys() == alone.history.keys()
    for name, values in alone.history.items():
        tolerance = HEIGHT if name == "height" else FORCE
        tolerance *= ESTIMATED if alone.scene.method == "hybrid" else 1.0
        np.testing.assert_allclose(
            found.history[name], values, rtol=0, atol=tolerance, err_msg=name
        )
    assert_figures(found, alone)


def assert_estimated_as_alone(found, scene, alone):
    errors = estimate_errors(scene, alone.history)
    assert errors.height > 1e-12  # there is something to estimate
    for name, value in errors._asdict().items():
        expected = pytest.approx(value, rel=RELATIVE, abs=NOTHING[name])
        assert found.metrics[f"{name}_error"] == expected, name


def assert_all_as_alone(scenes, *, judge=False, errors=False):
    results = together(scenes)
    evaluated = judged(scenes, errors=errors) if judge or errors else results
    if errors:
        assert len({describe_structure(make_reference(one)) for one in scenes}) == 1
    for found, measured, scene in zip(results, evaluated, scenes, strict=True):
        alone = run(scene)
        assert_as_alone(found, alone)
        assert_figures(measured, alone)
        if errors:
            assert_estimated_as_alone(measured, scene, alone)
    return results


@pytest.mark.parametrize("method", METHODS)
def test_runs_with_fingers_ends_and_devices_of_their_own_come_to_what_they_come_to_alone(method):
    scenes = []
    for i in range(2):
        device = f"valve.stroke={25 + 5 * i}e-6", f"actuator.rest_height={40 - 0.2 * i}e-3"
        known = sample(STACKABLE[method], f"control.method={method}", *device)
        scenes.append(moved(known, 0.7e-3 * i, -0.2e-3 * i, 0.5 + 0.05 * i, 0.3))
    assert_all_as_alone(scenes, errors=True)


@pytest.mark.parametrize("method", ["virtual_master", "viscous", "shape_display"])
def test_a_batch_has_no_more_active_cells_than_one_of_its_runs_alone(method):
    # Its margin is narrower, since it makes its set anew for all runs as soon as one needs it.
    settings = f"control.method={method}", "recorder=absent", "simulation.duration=0.4"
    scene = sample(STACKABLE[method], *settings)
    system, count = assemble(scene), 4
    states = periods(system, scene.trajectories(), begin(system), scene.periods)
    alone = [(len(state.active.cells), state.active.near) for state in states]
    play = begin_play(dict.fromkeys(range(count), scene), dict.fromkeys(range(count), system))
    plays = play_all(play, dict.fromkeys(range(count), scene.periods), None)
    batch = [(len(now.play.state.active.cells), now.play.state.active.near) for now in plays]
    active, near = np.sum(alone, axis=0)
    assert active > 0
    assert (np.sum(batch, axis=0) <= (active, near)).all()


CHANGES = {
    "all at once": "control.force_gain=2|8 control.position_gain=200|800 control.loss_time=0.01|0.1"
    " control.travel=1e-3|4e-3 blister.radius=12e-3|16e-3 fingertip.length=8e-3|12e-3"
    " contact.stiffness=150|400 relaxation.times=[2e-3,0.1,1.0]|[4e-3,0.07,1.4]"
    " actuator.bore=1.8e-3|2e-3 actuator.rest_height=39.8e-3|40e-3 supply.high=0.4e5|0.6e5"
    " valve.stroke=25e-6|40e-6 valve_lag.time_constant=1e-3|3e-3 delay.dead_time=1e-3|1.2e-3"
    " fluid.viscosity=1e-6|3e-6",
    "gaussian": "blister.sigma=6e-3|9e-3 blister.profile=gaussian|gaussian",
    "the load makes the flow turbulent": "actuator.bore=0.2e-3|0.3e-3",
    "the flow is turbulent": "fluid.viscosity=1.6e-9|2e-9",
    "sensors": "sensors.height_step=5e-6|20e-6 sensors.force_step=5e-6|20e-6",
    "period": "simulation.control_period=4.4e-3|4.8e-3",
}


@pytest.mark.parametrize("changes", CHANGES.values(), ids=CHANGES)
def test_runs_with_parameters_of_their_own_come_to_what_they_come_to_alone(changes):
    pairs = [one.split("=") for one in changes.split()]
    settings = [[f"{key}={value}" for value in values.split("|")] for key, values in pairs]
    scenes = [sample("tap", "simulation.duration=0.3", *one) for one in zip(*settings, strict=True)]
    assert_all_as_alone(scenes, errors=True)


@pytest.mark.parametrize(
    "name, keys, settings, errors",
    [
        ("elastic_press", {"stiffness": (10, 40), "settling_time": (20e-3, 40e-3)}, ("duration=0.5",), False),
        ("plastic_press", {"yield_force": (0.02, 0.05), "damping": (5, 8)}, ("duration=0.5",), False),
        *(
            ("tap", {"force_gain": (3, 5)}, (f"stepper={by}", f"physics_step={step}", "duration=0.2"), wrong)
            for by, step, wrong in (
                ("richardson", "5e-4", True), ("adaptive", "5e-3", False), ("runge_kutta_4", "1e-3", True),
            )
        ),
        ("tap", {"force_gain": (3, 5)}, ("duration=5e-3",), False),  # a single period
    ],
)  # fmt: skip
def test_behaviors_and_steppers_do_what_they_do_alone(name, keys, settings, *, errors):
    own = ([f"control.{key}={values[run]}" for key, values in keys.items()] for run in (0, 1))
    simulated = [f"simulation.{one}" for one in settings]
    assert_all_as_alone([sample(name, *simulated, *one) for one in own], judge=True, errors=errors)


@pytest.mark.parametrize(
    "name, key, values, settings",
    [
        ("tap", "control.force_gain", (3, 5), ("layout.arrangement=hexagonal",)),
        ("slow_press", "control.force_gain", (3, 5), ("recorder.every=7", "simulation.duration=0.503")),
        # Forces that are read add up to the set point, but for rounding.
        ("slow_press", "actuator.bore", (1.7e-3, 1.8e-3), ("sensors.force_step=0.01", "layout.rows=12")),
        # The cells are chosen anew every 32 periods or sooner: most of their sets have no row of
        # their own.
        ("plastic_press", "contact.exponent", (2e3, 1990), ("recorder.every=99", "simulation.duration=0.9")),
        ("tap", "actuator.rest_height", (0.01, 0.02), ("simulation.duration=0.1",)),  # nothing is touched
        ("tap", "actuator.bore", (1.8e-3, 2e-3), ("valve_lag=absent", "relaxation=absent", "conduit=absent")),
    ],
)  # fmt: skip
def test_what_is_recorded_and_judged_of_a_run_is_that_of_the_run_alone(name, key, values, settings):
    pace = 0.3 if name == "plastic_press" else 1.0
    known = (sample(name, *settings, f"{key}={value}") for value in values)
    assert_all_as_alone([moved(one, 0.0, 0.0, pace=pace) for one in known], judge=True)


def test_every_metric_of_a_ridge_is_that_of_the_run_alone():
    way = (
        (0, -14, 0, 41.5),
        (0.3, -14, 0, 37),
        (0.6, -14, 0, 37),
        (1.8, 14, 0, 37),
        (2.1, 14, 0, 37),
    )
    scenes = [
        followed("", way, control={"method": "virtual_master", "force_gain": gain})
        for gain in (3, 5)
    ]
    for found in assert_all_as_alone(scenes, judge=True):
        assert None not in (found.metrics[name] for name in METRICS)


def test_pins_on_end_stops_and_relaxed_pulp_come_to_what_they_come_to_alone():
    method = ("control.method=elastic", "control.stiffness=5")
    low = [sample("tap", f"actuator.rest_height={rest}", *method) for rest in ("1e-3", "1.5e-3")]
    for found in assert_all_as_alone([moved(one, 0.0, -40e-3) for one in low], errors=True):
        pressed = found.history["force"] > 0.0
        assert found.history["height"][pressed].min() == 0.0
    heights = {0.0: 41, 0.2: 38, 0.3: 60, 0.5: 60, 0.7: 38, 0.9: 60}
    way = [(time, 0, 0, height) for time, height in heights.items()]
    twice = followed("plastic", way, 25)
    assert_all_as_alone([twice, moved(twice, 1e-3, -0.5e-3)])


@pytest.mark.parametrize(
    "name, settings, lasting",
    [
        ("tap", ("control=absent", "fingertip=absent"), 0.1),
        ("dome_peaked", ("layout.rows=11", "layout.columns=11"), 1.4),
    ],
    ids=["without a finger or a controller", "from a shape"],
)
def test_a_bed_that_stands_still_or_shapes_itself_does_so_as_alone(name, settings, lasting):
    known = sample(name, *settings)
    assert_all_as_alone([moved(known, 0.7e-3 * i, -0.5e-3 * i, lasting, 0.5) for i in range(2)])


def test_a_run_that_diverges_ends_in_its_own_error_and_the_others_go_on():
    # Steps far too long for Euler; only the middle one's finger gets to the bed.
    long = "simulation.control_period=50e-3", "simulation.physics_step=50e-3"
    known = sample("slow_press", "simulation.stepper=euler", "simulation.duration=2.0", *long)
    scenes = [moved(known, 0.0, 20e-3), known, moved(known, 1e-3, 20e-3)]
    said = r"^At [\d.]+ s the height of cell \d+ became inf\. Use a shorter"
    with pytest.raises(DivergenceError, match=said) as error:
        run(scenes[1])
    found, measured = together(scenes), judged(scenes)
    assert isinstance(measured[1], DivergenceError)
    assert (type(found[1]), str(found[1])) == (DivergenceError, str(error.value))
    for other in (0, 2):
        alone = run(scenes[other])
        assert_as_alone(found[other], alone)
        assert_figures(measured[other], alone)


def test_a_run_that_cannot_fit_in_memory_is_told_and_the_others_go_on():
    known = sample("tap")
    endless = replace(known, simulation=replace(known.simulation, duration=1e6))
    found = together([endless, known])
    assert isinstance(found[0], ParameterError)
    assert str(found[0]).startswith("recorder.every must be at least")
    assert_as_alone(found[1], run(known))


def test_a_stack_without_recorder_has_no_history_shares_its_time_and_can_be_stopped():
    scenes = [sample("tap", f"control.force_gain={gain}", "recorder=absent") for gain in (3, 5)]
    first, second = together(scenes)
    assert (first.history, second.history) == ({}, {})
    assert first.run_time == second.run_time > 0.0
    assert list(run_together(scenes, stopped=lambda: True)) == []


@pytest.mark.parametrize(
    "every, errors", [(1, False), (2, True)], ids=["not asked for", "no commands"]
)
def test_without_all_commands_or_unasked_a_run_is_judged_without_errors_or_history(every, errors):
    (only,) = judged(
        [sample("tap", f"recorder.every={every}", "simulation.duration=0.05")], errors=errors
    )
    assert only.history == {}
    assert "height_error" not in only.metrics


@pytest.mark.parametrize(
    "setting",
    [
        "sensors.delay=1",
        "layout.rows=21",
        "delay=absent",
        "simulation.physics_step=2e-3",
        "blister.profile=gaussian",
        "fluid.viscosity=1.6e-9",  # the flow is turbulent
        "valve_lag=absent",
        "control.method=cell_states",
        "simulation.control_period=10 ms",
    ],
)
def test_scenes_of_another_structure_do_not_stand_together(setting):
    scenes = [sample("tap"), sample("tap", setting)]
    assert describe_structure(scenes[1]) != describe_structure(scenes[0])
    for together in (run_together, measure_together):
        with pytest.raises(ParameterError, match=r"\(got number 1 unlike number 0\)"):
            next(together(scenes))


#: Noise of three runs: of force, of height, and its seed.
NOISES = (("1e-3", "5e-6", "1"), ("2e-3", "2e-6", "2"), ("0.5e-3", "20e-6", str(2**62 + 1)))


def noisy(name, *settings):
    noises = (
        (f"sensors.force_noise={force}", f"sensors.height_noise={height}", f"sensors.seed={seed}")
        for force, height, seed in NOISES
    )
    return [sample(name, *settings, *noise) for noise in noises]


@pytest.mark.parametrize("method", ["virtual_master", "cell_states", "plastic"])
def test_runs_with_noise_of_their_own_come_to_what_they_come_to_alone(method):
    scenes = noisy(STACKABLE[method], f"control.method={method}")
    # Fingers that come down elsewhere, up to far apart, and differently far: other cells, and not
    # as many.
    ways = ((-8e-3, 0.0, 0.5), (0.0, -0.2e-3, 0.45), (2e-3, -0.4e-3, 0.4))
    assert_all_as_alone([moved(noise, *way, 0.3) for noise, way in zip(scenes, ways, strict=True)])


@pytest.mark.parametrize(
    "method, sensors, noise",
    [
        ("virtual_master", ("height_step=20e-6", "force_step=1e-3"), True),
        ("cell_states", ("delay=2", "height_step=5e-6"), True),
        ("elastic", ("delay=1",), False),
        ("virtual_master", ("observer=valve", "height_step=1e-6"), False),
        ("cell_states", ("observer=valve", "height_step=1e-6"), False),
    ],
)
def test_readings_that_are_rounded_late_or_estimated_are_those_of_the_run_alone(
    method, sensors, *, noise
):
    settings = [f"control.method={method}", *(f"sensors.{one}" for one in sensors)]
    known = noisy("slow_press", *settings) if noise else [sample("slow_press", *settings)] * 3
    assert_all_as_alone(
        [moved(one, 0.7e-3 * i, -1e-3 * i, 0.25, 0.3) for i, one in enumerate(known)]
    )
