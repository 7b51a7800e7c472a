"""The errors a run reports are honest: compared with the same commands integrated all but exactly."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.accuracy import SHARE, Errors, estimate_errors, has_every_command
from digiclay.core.session.run_scene import History, run

#: Shorter than the longest session, but with a press and a lift in it.
LASTS = 0.9
#: Errors below this are rounding and the reference's own, m and N.
NOTHING = {"height": 1e-11, "force": 1e-9}
#: Every sample scene, and those that meet every method.
ALL = sorted(path.stem for path in find("tap").parent.glob("*.toml"))
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


def scene_of(name: str, stepper: str, step: float) -> Scene:
    """Return a sample scene with another stepper and step, cut to a few seconds."""
    settings = [Setting("simulation.stepper", f'"{stepper}"'), Setting("simulation.physics_step", str(step))]
    scene = load(find(name), settings)
    short = min(scene.simulation.duration, LASTS)
    return replace(scene, simulation=replace(scene.simulation, duration=short))


@cache
def judged(name: str, stepper: str, step: float) -> tuple[Errors, Errors]:
    """Return the estimated errors of a run, and the true ones."""
    scene = scene_of(name, stepper, step)
    history = run(scene).history
    assert history is not None
    estimate = estimate_errors(scene, history)
    assert estimate is not None
    return estimate, _true(scene, history)


def _true(scene: Scene, history: History) -> Errors:
    """Return the errors against Richardson's form at a tenth of the step, a quarter of those of 1 ms.

    That is a fifth, or half, of the step of the judge itself. Its error is some 1e-11 m, where the best of
    the cases has 4e-11 m.
    """
    step = 1e-3 if scene.simulation.physics_step > 1e-3 else 5e-4
    errors = estimate_errors(
        replace(scene, simulation=replace(scene.simulation, stepper="richardson", physics_step=step)), history
    )
    assert errors is not None
    # `estimate_errors` makes an estimate of the difference; here the difference is wanted.
    return Errors(errors.height / SHARE, errors.force / SHARE, errors.total_force / SHARE)


@pytest.mark.parametrize("kind", ["height", "force"])
@pytest.mark.parametrize(("name", "stepper", "step"), CASES)
def test_the_true_error_is_at_most_twice_the_estimate_and_that_no_more_than_twenty_times_it(
    name: str, stepper: str, step: float, kind: str
) -> None:
    estimate, true = (getattr(errors, kind) for errors in judged(name, stepper, step))
    assert true <= 2.0 * estimate + NOTHING[kind]
    assert estimate <= 20.0 * true + NOTHING[kind]


def test_a_run_that_was_thinned_cannot_be_estimated() -> None:
    scene = scene_of("tap", "bernoulli", 1e-3)
    assert scene.recorder is not None
    assert not has_every_command(replace(scene, recorder=replace(scene.recorder, every=2)))


def test_no_estimate_is_made_once_it_is_stopped() -> None:
    scene = scene_of("tap", "bernoulli", 1e-3)
    history = run(scene).history
    assert history is not None
    assert estimate_errors(scene, history, stopped=lambda: True) is None


def test_the_summary_tells_the_errors() -> None:
    result = run(scene_of("tap", "bernoulli", 1e-3)).with_errors(Errors(2e-6, 5e-4, 1e-3))
    assert result.summary().endswith("height error about 2 µm, force error about 0.5 mN")
