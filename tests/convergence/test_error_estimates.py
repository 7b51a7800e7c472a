"""The errors a run reports are honest, and the adaptive stepper keeps within its tolerance."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from digiclay.core.base.errors import DivergenceError
from digiclay.core.model.valve import Fluid, Valve
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import SAMPLES
from digiclay.core.scene.schema import STEPPERS, Simulation
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.accuracy import (
    FINER,
    SHARE,
    Errors,
    estimate_errors,
    explain_absence,
    reference_settings,
)
from digiclay.core.session.run_scene import run

from tests.assemble import AWAY, beginning, one_cell, record, scripted
from tests.convergence import test_independent

#: Shorter than the longest session, but with a press and a lift in it.
LASTS = 0.6
#: Errors below this are rounding and the reference's own, m and N.
NOTHING = {"height": 1e-11, "force": 1e-9}
#: Every sample scene, and those that meet every method.
ALL = sorted(path.stem for path in SAMPLES.glob("*.toml"))
SCENES = ("ridge_mound_valley", "tap")
METHODS = [
    ("bernoulli", 1e-3),
    ("richardson", 5e-3),
    ("richardson", 1e-3),
    ("adaptive", 5e-3),
    ("euler", 5e-3),
    ("heun", 5e-3),
    ("runge_kutta_4", 5e-3),
]
CASES = [
    *((name, "bernoulli", 5e-3) for name in ALL),
    *((name, stepper, step) for name in SCENES for stepper, step in METHODS),
]


@cache
def judged(name, stepper, step):
    """Return the estimated errors of a run, and the true ones.

    The true ones are those against Richardson's form at a tenth of the step, a quarter of those of
    1 ms. That is a fifth, or half, of the step of the judge itself. Its error is some 1e-11 m,
    where the best of the cases has 4e-11 m.
    """
    scene = beginning(name, LASTS, stepper, step)
    history = run(scene).history
    finer = replace(
        scene.simulation, stepper="richardson", physics_step=1e-3 if step > 1e-3 else 5e-4
    )
    estimate, true = (
        estimate_errors(one, history) for one in (scene, replace(scene, simulation=finer))
    )
    # `estimate_errors` makes an estimate of the difference; here the difference is wanted.
    return estimate, Errors(true.height / SHARE, true.force / SHARE, true.total_force / SHARE)


@pytest.mark.parametrize("name, stepper, step", CASES)
def test_the_true_error_is_at_most_twice_the_estimate_and_that_no_more_than_twenty_times_it(
    name, stepper, step
):
    for kind, nothing in NOTHING.items():
        estimate, true = (getattr(errors, kind) for errors in judged(name, stepper, step))
        assert true <= 2.0 * estimate + nothing, kind
        assert estimate <= 20.0 * true + nothing, kind


@pytest.mark.parametrize(
    "stepper, period, step, by, finer",
    [
        ("bernoulli", 5e-3, 5e-3, "bernoulli", 1.25e-3),  # a quarter
        ("heun", 5e-3, 1e-3, "bernoulli", 0.25e-3),  # another method, not judged by itself
        ("bernoulli", 20e-3, 20e-3, "bernoulli", 1.25e-3),  # short enough for the valve's lag
        ("bernoulli", 5e-3, 5e-3 / 400, "bernoulli", 5e-3 / 800),  # as many as a period may have
        ("bernoulli", 10.0, 10.0, "bernoulli", 10e-3),
        ("richardson", 5e-3, 5e-3, "richardson", 1.25e-3),  # more accurate than the others
        ("richardson", 5e-3, 5e-3 / 200, "richardson", 5e-3 / 400),  # as many as it may have
        ("adaptive", 5e-3, 5e-3, "richardson", 0.625e-3),
        ("adaptive", 5e-3, 0.5e-3, "richardson", 0.0625e-3),
    ],
)
def test_a_reference_has_shorter_steps(stepper, period, step, by, finer):
    judge = reference_settings(
        Simulation(control_period=period, physics_step=step, stepper=stepper)
    )
    assert (judge.stepper, judge.physics_step) == (by, pytest.approx(finer))


def test_no_estimate_is_made_of_a_thinned_run_or_once_it_is_stopped_and_a_summary_tells_it():
    scene = beginning("tap", LASTS, "bernoulli", 1e-3)
    assert explain_absence(replace(scene, recorder=replace(scene.recorder, every=2)))
    result = run(scene)
    assert estimate_errors(scene, result.history, stopped=lambda: True) is None
    said = result.with_errors(Errors(2e-6, 5e-4, 1e-3)).summary()
    assert said.endswith("height error about 2 µm, force error about 0.5 mN")


#: How long scenes last, s: a press and a drag or two.
DRAWN = 0.1
#: Scenes of each stepper; the adaptive one takes about a second per scene.
COUNTS = dict.fromkeys(STEPPERS, 100) | {"adaptive": 25}
#: A conduit that is not turbulent, and one that is, in a share of the scenes.
TURBULENT = {
    "valve": {"orifice_diameter": 0.8e-3},
    "fluid": {"density": 760.0, "viscosity": 0.65e-6},
}


def draw_path(random):
    """Return a random press, and drags after it, of a turned fingertip."""
    x, y = random.uniform(-8e-3, 8e-3, 2)
    down, time = random.uniform(0.034, 0.038), random.uniform(0.04, 0.07)
    turn = np.array([1.0, 0.0, 0.0, 0.0]) + 0.15 * random.normal(size=4)
    points = [(0.0, x, y, 0.0405), (time, x, y, down)]
    while time < DRAWN:
        time += random.uniform(0.03, 0.08)
        x, y = np.clip(np.array([x, y]) + random.uniform(-3e-3, 3e-3, 2), -12e-3, 12e-3)
        points.append((time, x, y, points[-1][3] + random.uniform(-1e-3, 2e-3)))
    return {
        "interpolation": str(random.choice(["linear", "smooth"])),
        "waypoints": [
            {
                "time": t,
                "position": [*map(float, place)],
                "orientation": (turn / np.linalg.norm(turn)).tolist(),
            }
            for t, *place in points
        ],
    }


def draw_scene(random, stepper):
    """Return a random scene of one to three fingers, with any method that forms."""
    fingers = [{"trajectory": draw_path(random)} for _ in range(random.choice([1, 1, 1, 1, 2, 3]))]
    step = float(random.choice([5e-3, 5e-3, 2.5e-3]))
    tolerance = {"tolerance": 10.0 ** random.uniform(-7.0, -5.0)} if stepper == "adaptive" else {}
    return resolve(
        {
            "layout": {"rows": 11, "columns": 11},
            "finger": fingers,
            "recorder": {},
            "control": {"method": str(random.choice(FORMING))},
            "simulation": {
                "physics_step": step,
                "duration": DRAWN,
                "stepper": stepper,
                **tolerance,
            },
            **(TURBULENT if random.random() < 0.1 else {}),
        }
    )


#: Steppers that may leave their regions of stability.
EXPLICIT = ("euler", "heun", "runge_kutta_4")
FORMING = ("virtual_master", "cell_states", "hybrid", "elastic", "plastic", "viscous")


@pytest.mark.parametrize("stepper", STEPPERS)
def test_an_estimate_covers_the_truth_in_95_of_100_scenes(stepper):
    random, missed, refused = np.random.default_rng(38), [], 0
    for number in range(COUNTS[stepper]):
        scene = draw_scene(random, stepper)
        try:
            history = run(scene).history
        except DivergenceError:
            refused += 1
            continue
        # Its reference has a quarter of the step: 0.125 ms, or 0.5 ms where errors are much larger.
        exact = replace(
            scene.simulation,
            stepper="richardson",
            physics_step=0.5e-3 if stepper in FINER else 2e-3,
        )
        found, true = (
            estimate_errors(one, history) for one in (scene, replace(scene, simulation=exact))
        )
        truth = (error / SHARE for error in true)
        missed += list_uncovered(number, found, truth, NOTHING)
    assert len({number for number, *_ in missed}) <= 0.05 * (COUNTS[stepper] - refused), missed
    # An explicit method that has left its region of stability says so, and has no result to be
    # judged.
    assert refused <= (0.1 * COUNTS[stepper] if stepper in EXPLICIT else 0)


def list_uncovered(number, found, truth, nothing):
    """Return the errors of a scene, with its number, that are above their estimates."""
    return [
        (number, kind, estimate, error)
        for kind, estimate, error in zip(Errors._fields, found, truth, strict=False)
        if kind in nothing and error > estimate + nothing[kind]
    ]


def draw_level_scene(random, stepper):
    """Return a random scene of a level finger on a smooth path, which `test_independent` integrates."""
    path = draw_path(random)
    waypoints = [{name: way[name] for name in ("time", "position")} for way in path["waypoints"]]
    return resolve(
        {
            "layout": {"rows": 10, "columns": 10},
            "trajectory": {"waypoints": waypoints},
            "recorder": {},
            "control": {"method": str(random.choice(FORMING))},
            "simulation": {"duration": DRAWN, "stepper": stepper},
        }
    )


#: Errors of SciPy's integration itself, m and N.
TOLERATED = {"height": 1e-8, "force": 1e-6}
#: Scenes of each stepper that it integrates.
FEW = 2


@pytest.mark.parametrize("stepper", ["bernoulli", "richardson", *EXPLICIT])
def test_an_estimate_covers_the_errors_that_scipy_finds(stepper):
    random, missed = np.random.default_rng(39), []
    for number in range(FEW):
        scene = draw_level_scene(random, stepper)
        try:
            history = run(scene).history
        except DivergenceError:
            continue
        path = scene.section("trajectory").trajectory()
        exact = test_independent.integrate(
            test_independent.numbers(),
            test_independent.spline(path),
            assemble(scene),
            SimpleNamespace(**history),
        )
        own = history["height"], history["force"]
        truth = (float(np.abs(one - other).max()) for one, other in zip(own, exact, strict=True))
        missed += list_uncovered(number, estimate_errors(scene, history)[:2], truth, TOLERATED)
    assert missed == []


#: Heights of the fingertip above the bed's floor, mm, and their times, s, in a run with steps of 20
#: ms.
WAYS = {
    "presses and stays": ([(0.0, 41.0), (0.1, 38.5), (0.4, 38.5)], False),
    "taps within steps": (
        [(0.0, 41.0), (0.1, 38.5), (0.205, 41.0), (0.212, 37.6), (0.219, 41.0), (0.4, 41.0)],
        True,
    ),
}


@pytest.mark.parametrize("name", WAYS)
def test_an_estimate_that_cannot_see_a_contact_within_a_step_says_so(name):
    points, unseen = WAYS[name]
    path = [{"time": time, "position": [0.7e-3, 0.4e-3, 1e-3 * z]} for time, z in points]
    times = {"control_period": 20e-3, "physics_step": 20e-3, "duration": 0.4}
    bed = {"layout": {"rows": 13, "columns": 13}, "simulation": times, "recorder": {}}
    result = run(resolve({**bed, "trajectory": {"interpolation": "linear", "waypoints": path}}))
    known = result.estimate_errors()
    assert ("shorter simulation.physics_step" in known.summary()) == unseen


@pytest.mark.parametrize("tolerance", [1e-5, 1e-6, 1e-7])
@pytest.mark.parametrize("name", [*SCENES, "slow_press"])
def test_the_adaptive_stepper_keeps_the_heights_within_its_tolerance(name, tolerance):
    scene = beginning(name, LASTS, "adaptive", 5e-3, f"simulation.tolerance={tolerance}")
    # The reference is Richardson's extrapolation at half of 1 ms. Another half changes the errors
    # by 2e-11 m.
    exact = replace(
        scene, simulation=replace(scene.simulation, stepper="richardson", physics_step=1e-3)
    )
    assert estimate_errors(exact, run(scene).history).height <= tolerance


def test_a_free_pin_keeps_within_the_tolerance_over_many_commands():
    # The errors of a pin that nothing presses add up: 60 reversals of a valve that is turbulent in
    # between.
    script = scripted(lambda t, x, y: (1.0, -0.6, 0.8, -1.0, 0.3, -0.2)[round(t / 20e-3) % 6])
    parts = {"valve": Valve(orifice_diameter=0.8e-3), "fluid": Fluid(760.0, 0.65e-6)}
    known = {"control": script, "period": 20e-3, "dead_time": 0.0, **parts}
    exact, found = (
        record(one_cell(stepper=name, step=step, **known), AWAY, 60).height
        for name, step in (("bernoulli", 0.1e-3), ("adaptive", 20e-3))
    )
    assert np.ptp(found) > 1e-3
    assert np.abs(found - exact).max() <= one_cell(stepper="adaptive").stepper.tolerance
