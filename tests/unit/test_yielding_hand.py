"""A hand that gives way: extreme values, batches, resumed sessions, several fingers, files, refusals."""

from itertools import pairwise

import numpy as np
import pytest
from digiclay.commands.describe import description
from digiclay.core.base.errors import ParameterError
from digiclay.core.batch.run_together import measure_together, run_together
from digiclay.core.control.methods import METHODS
from digiclay.core.engine.hand_steps import lower_reach, solve_force
from digiclay.core.engine.simulation import begin
from digiclay.core.files.tables import parse_tables
from digiclay.core.model.trajectory import sample_poses
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import format_scene, resolve, tabulate
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.run_scene import run
from digiclay.core.session.take import Take, from_bytes, replay, to_bytes

from tests.assemble import over_middle, refused_in_a_line, table

BED = {"layout": {"rows": 11, "columns": 11}}
WAY = {"waypoints": over_middle((0, 42e-3), (0.1, 37e-3), (0.25, 37e-3), (0.35, 44e-3))}
PRESS = {"trajectory": {"waypoints": WAY["waypoints"][:2]}}


def scene(hand=None, **tables):
    hands = {} if hand is None else {"hand": hand}
    return resolve({**BED, "trajectory": WAY, **hands, **tables})


def rise(history):
    return history["fingertip"][..., 2] - history["intended_height"]


#: What a hand without a force of its own does to a press.
@table(
    "hand, least, most",
    {
        "gives way by its force over its stiffness": ({}, 0.5e-3, 3e-3),
        "is stiff: the path is prescribed": ({"stiffness": 1e6}, 0.0, 12e-6),
        "is soft: it hardly presses": ({"stiffness": 1.0}, 2e-3, 5e-3),
        "has no mass": ({"mass": 1e-9}, 0.5e-3, 3e-3),
        "has neither mass nor damping": ({"mass": 1e-9, "damping": 0.0}, 0.5e-3, 3e-3),
        "has a mass, stiff and undamped": (
            {"mass": 1e-6, "stiffness": 1e6, "damping": 0.0},
            0.0,
            12e-6,
        ),
        "is heavy and undamped: it falls in and springs back": (
            {"mass": 10.0, "damping": 0.0},
            1e-3,
            10e-3,
        ),
        "is damped more than it can move": ({"damping": 1e4}, 0.0, 80e-6),
    },
)
def test_a_hand_gives_way_as_its_values_say_at_any_of_them(hand, least, most):
    history = run(scene(hand)).history
    assert least <= np.abs(rise(history)).max() <= most
    # Under a force at rest the spring carries it: no value lets the force of a step swing.
    assert np.isfinite(history["total_force"]).all()


def test_a_stiff_hand_has_the_results_of_a_prescribed_path():
    held, free = run(scene({"stiffness": 1e6, "mass": 1e-6})), run(scene())
    # Of 11 N over 1e6 N/m, 11 µm, the force differs by 2 %: it grows e times in 0.5 mm.
    apart = np.abs(held.history["total_force"] - free.history["total_force"])
    assert apart.max() < 0.025 * free.history["total_force"].max()
    assert "intended_height" not in free.history


def test_runs_of_a_batch_have_the_hands_and_results_they_have_alone():
    hands = {}, {"stiffness": 800.0, "mass": 1e-3}, {"damping": 0.0}
    scenes = [scene(hand, **PRESS) for hand in hands]
    alone = [run(each).estimate_errors() for each in scenes]
    for number, result in run_together(scenes):
        # Rounding, as of every batch.
        for name in ("fingertip", "force"):
            np.testing.assert_allclose(
                result.history[name], alone[number].history[name], rtol=0, atol=1e-9
            )
    for number, result in measure_together(scenes, errors=True):
        for name in ("rfd", "contact_share", "height_error", "total_force_error"):
            assert result.metrics[name] == pytest.approx(alone[number].metrics[name], rel=1e-6)


def test_the_error_estimate_covers_that_of_the_hand():
    coarse, fine = (
        run(scene({"mass": 50e-3}, simulation={"physics_step": step})) for step in (5e-3, 0.5e-3)
    )
    apart = np.abs(coarse.history["total_force"] - fine.history["total_force"]).max()
    assert apart > 1e-2
    assert coarse.estimate_errors().metrics["total_force_error"] > 0.8 * apart


def test_a_state_that_is_stored_without_a_hand_goes_on_with_one_at_rest():
    system, bare = assemble(scene({})), assemble(scene())
    assert not snapshot.load(system, snapshot.dump(bare, begin(bare))).deflection.rise.any()


def test_a_take_is_replayed_bit_for_bit_in_ticks_of_any_length():
    made = scene({}, simulation={"physics_step": 2e-3})
    system = assemble(made)
    poses = sample_poses(made.trajectories(), np.arange(61) * system.period)

    def play(*ends):
        state = begin(system)
        for first, last in pairwise((0, *ends)):
            *_, state = simulate_path(system, state, poses[first : last + 1])
        return snapshot.dump(system, state)

    end = play(1, 2, 7, 30, 60)
    assert snapshot.load(system, end).deflection.rise[0] != 0.0
    take = from_bytes(to_bytes(Take(made, snapshot.dump(system, begin(system)), poses, end)))
    *_, state = replay(take)
    assert snapshot.dump(system, state) == end == play(60)


def test_several_fingers_have_a_hand_each_or_none():
    beside = {
        "waypoints": [
            {**point, "position": [6e-3, 0, z]}
            for point in WAY["waypoints"]
            for z in point["position"][2:]
        ]
    }
    fingers = [{"trajectory": WAY, "hand": {}}, {"trajectory": beside}]
    history = run(resolve({**BED, "finger": fingers})).history
    yielding, prescribed = np.abs(rise(history)).max(axis=0)
    assert yielding > 0.5e-3
    assert prescribed == 0.0
    # A finger alone is the first of two of which the other is away.
    away = {"waypoints": over_middle((0, 0.5), (0.35, 0.5))}
    pair = run(resolve({**BED, "finger": [fingers[0], {"trajectory": away, "hand": {}}]})).history
    alone = run(scene({})).history
    np.testing.assert_allclose(pair["fingertip"][:, 0], alone["fingertip"], rtol=0, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2])
def test_pins_are_looked_for_where_a_hand_is_below_its_path(count):
    made = resolve({**BED, "finger": [{"trajectory": WAY, "hand": {}}] * count})
    system = assemble(made)
    (finger,) = system.trace(sample_poses(made.trajectories(), system.instants)[None], 0)
    state = begin(system)
    low = state.deflection._replace(rise=np.full(count, -5e-3))
    lowered = lower_reach(system.hands, state._replace(deflection=low), finger)
    np.testing.assert_allclose(lowered.window[3], np.array(finger.window[3]) - 5e-3, rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_meets_a_hand(method):
    history = run(scene({}, control={"method": method}, **PRESS)).history
    assert np.abs(rise(history)).max() > 20e-6


@table(
    "stepper, step",
    {
        "extrapolated": ("richardson", 1e-3),
        "adaptive": ("adaptive", 2.5e-3),
        "explicit": ("runge_kutta_4", 0.25e-3),
    },
)
def test_every_stepper_moves_a_hand_alike(stepper, step):
    found = run(scene({}, **PRESS, simulation={"stepper": stepper, "physics_step": step}))
    wanted = run(scene({}, **PRESS, simulation={"physics_step": 0.5e-3})).history["total_force"]
    # The hand's own error with a step of 2.5 ms, where the force is 0.5 N.
    assert np.abs(found.history["total_force"] - wanted).max() < 0.01
    assert wanted.max() > 0.4


def test_a_file_has_the_hand_or_says_nothing_of_it():
    for made in (scene({"mass": 3e-3}), scene()):
        text = format_scene(made)
        assert ("hand" in text) == bool(made.fingers[0].hand)
        assert resolve(parse_tables(text)) == made == resolve(tabulate(made))


@table(
    "hand, words",
    {
        "no mass": ({"mass": 0}, "mass must be above 0 kg"),
        "the mass of a man": ({"mass": 80.0}, "mass must be at most 10 kg"),
        "negative damping": ({"damping": -1.0}, "damping must be at least 0 N s/m"),
        "no stiffness": ({"stiffness": 0}, "stiffness must be at least 1 N/m"),
        "the stiffness of a machine": ({"stiffness": 1e9}, "stiffness must be at most 1e\\+06 N/m"),
        "no table": ("soft", "hand must be a section"),
    },
)
def test_a_hand_that_cannot_be_is_refused(hand, words):
    with refused_in_a_line(ParameterError, words) as caught:
        scene(hand)
    assert "hand" in str(caught.value)


def test_a_hand_is_named_where_a_scene_is_described():
    made = scene({"mass": 3e-3})
    assert "3 g" in made.describe()["fingers"]
    lines = [line for line in description(made, assemble(made)) if "hand" in line]
    assert len(lines) == 1
    assert "stiffness 300 N/m" in lines[0]
    assert not any("hand" in line for line in description(scene(), assemble(scene())))


def test_a_hand_that_begins_elsewhere_begins_at_rest():
    # From 1 m above it comes down within a control period: as a fingertip that a server lets in.
    way = over_middle((0, 1.0), (0.1, 1.0), (0.1025, 39.5e-3), (0.3, 39.5e-3))
    path = {"interpolation": "linear", "waypoints": way}
    history = run(scene({"damping": 0.5}, trajectory=path)).history
    assert 0.0 < history["total_force"].max() < 0.3


@table(
    "felt",
    {
        "nothing": lambda force: np.zeros_like(force),
        "a soft pin": lambda force: 1.0 / (1.0 + force),
        "a wall": lambda force: np.exp(np.minimum(600.0, 200.0 * (1.0 - force))),
        "a pin that is only just met": lambda force: np.maximum(1e-9 - force, 0.0),
    },
)
def test_the_force_of_a_step_is_that_felt_under_it(felt):
    force = solve_force(felt, np.array([0.0, 0.5, 100.0]))
    np.testing.assert_allclose(felt(force), force, rtol=2e-6, atol=2e-8)
