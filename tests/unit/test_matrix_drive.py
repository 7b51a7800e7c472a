"""A matrix drive: which lines it addresses, what their cells command, and what it leaves as it is."""

import digiclay
import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError, StateError
from digiclay.core.batch.run_together import run_together
from digiclay.core.control.methods import METHODS
from digiclay.core.control.orders import place
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.control_interface import Commands, Measurement
from digiclay.core.model.layout import Layout
from digiclay.core.model.matrix_drive import POLICIES, DriveParameters, make_addressing
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session import snapshot
from digiclay.core.session.live_session import simulate_path
from digiclay.core.session.run_scene import run
from digiclay.core.session.take import Take, from_bytes, replay, to_bytes
from digiclay.core.shapes.body import pack_mesh

from tests.assemble import assert_goes_on, over_middle, refused_in_a_line, table
from tests.own_methods import Mine, forgotten

BED = {"layout": {"rows": 11, "columns": 13}}
WAY = {"waypoints": over_middle((0, 42e-3), (0.1, 37e-3), (0.25, 37e-3), (0.5, 46e-3))}
ASIDE = {
    "waypoints": [
        {**point, "position": [9e-3, 0, point["position"][2]]} for point in WAY["waypoints"]
    ]
}
BOX = trimesh.creation.box((12e-3, 12e-3, 4e-3))


def scene(drive=None, **tables):
    drives = {} if drive is None else {"drive": drive}
    return resolve({**BED, "trajectory": WAY, **drives, **tables})


@pytest.mark.parametrize("method", METHODS)
def test_as_many_sections_as_lines_are_a_valve_per_cell_bit_for_bit(method):
    drives = None, {"sections": 11, "slot": 0.02}, {"sections": 13, "axis": "columns"}
    direct, *driven = (run(scene(drive, control={"method": method})).history for drive in drives)
    for history in driven:
        assert history.keys() - direct.keys() == {"served", "waiting"}
        assert history["served"][:-1].all()
        assert not history["waiting"].any()
        for name, values in direct.items():
            assert history[name].tobytes() == values.tobytes(), name


def serve(drive, command, force=(), state=None, period=0):
    """Return state and acting commands of a bed, from a table of commands."""
    command = np.array(command, float)
    layout = Layout(*command.shape)
    matrix = make_addressing(DriveParameters(**drive), layout, 5e-3, 0.0)
    size, none = command.size, np.zeros(command.size)
    pressing = none if not len(force) else np.array(force, float).ravel()
    seen = Measurement(
        np.zeros((6, size)), none, pressing, none, none, np.zeros((0, size)), np.arange(size)
    )
    orders = Commands(none, none, command.ravel())
    state, acting = matrix.serve(state or matrix.begin(), period, seen, orders)
    return state, acting.command.reshape(command.shape)


#: Lines, as rows of commands, that are addressed first; two sets of two lines.
ROWS = [[0.0, 0.1], [0.3, 0.0], [0.2, 0.2], [-0.2, 0.2]]


@table(
    "drive, force, lines",
    {
        "the largest sums of commands of each set": ({"policy": "largest"}, (), [[2, 3]]),
        "lines under the fingertip count five times": (
            {"policy": "pressed"},
            [[0, 1], [1, 0], [0, 0], [0, 0]],
            [[0, 1]],
        ),
        "who needs it, in turn": ({"policy": "needed"}, (), [[0, 1], [2, 3], [0, 1]]),
        "all in turn": ({"policy": "round_robin"}, (), [[0, 1], [2, 3], [0, 1]]),
        "each until it has arrived": ({"policy": "one_time"}, (), [[0, 1], [0, 1]]),
        "they stay for a slot": ({"policy": "needed", "slot": 10e-3}, (), [[0, 1], [0, 1], [2, 3]]),
        "of one set": ({"policy": "largest", "sections": 1}, (), [[2]]),
    },
)
def test_lines_are_addressed_by_policy(drive, force, lines):
    state = None
    for period, wanted in enumerate(lines):
        state, acting = serve({"sections": 2, **drive}, ROWS, force, state, period)
        assert state.served.nonzero()[0].tolist() == wanted
        np.testing.assert_array_equal(acting[wanted], np.array(ROWS)[wanted])
        assert not np.delete(acting, wanted, axis=0).any()
        assert state.last[wanted].tolist() == [period] * len(wanted)
        # Who waits has a command, and it does not act.
        assert state.waiting.tolist() == np.flatnonzero(np.ravel(ROWS) != acting.ravel()).tolist()


@table(
    "rows, acting",
    {
        "alike: both act in full": ([[1, 0, -0.5]] * 2, [[1, 0, -0.5]] * 2),
        "the nearest to 0 of each column": (
            [[1, 0.5, -0.5], [0.6, 1, -1]],
            [[0.6, 0.5, -0.5]] * 2,
        ),
        "no column moves a pin that rests": ([[1, 1, 1], [1, 1, 0]], [[1, 1, 0]] * 2),
        "together they would get less done": ([[1, 1, 0], [0, 0, 0.5]], [[1, 1, 0], [0, 0, 0]]),
        "no column moves a pin away from its height": (
            [[1, 1, 0.2], [1, 1, -0.2]],
            [[1, 1, 0]] * 2,
        ),
    },
)
def test_lines_that_share_command_what_they_have_in_common(rows, acting):
    _, found = serve({"sections": 1, "share": True}, rows)
    np.testing.assert_array_equal(found, acting)
    # Columns are lines as well as rows are.
    _, found = serve({"sections": 1, "share": True, "axis": "columns"}, np.transpose(rows))
    np.testing.assert_array_equal(found.T, acting)


@pytest.mark.parametrize("policy", POLICIES)
def test_no_line_waits_for_ever(policy):
    # A pin that is served arrives after some slots; the others wait until then.
    command, state = np.full((6, 3), 1.0), None
    for period in range(40):
        state, acting = serve({"sections": 2, "policy": policy}, command, (), state, period)
        command = np.maximum(command - 0.25 * acting, 0.0) * (command > 0.1)
    assert not command.any()


@table(
    "drive, words",
    {
        "more sections than rows": (
            {"sections": 12},
            "must be at most the number of layout.rows, 11",
        ),
        "more than columns": ({"sections": 14, "axis": "columns"}, "layout.columns, 13"),
        "a slot below the control period": (
            {"slot": 2e-3},
            "slot must be a whole number of control",
        ),
        "a slot of one and a half": ({"slot": 7.5e-3}, "slot must be a whole number of control"),
        "a share of lines": ({"share": 0.5}, "share must be true or false"),
    },
)
def test_a_drive_that_cannot_be_is_refused(drive, words):
    with refused_in_a_line(ParameterError, words) as caught:
        scene(drive)
    assert "drive" in str(caught.value)


def test_a_slot_is_at_least_the_dead_time():
    with refused_in_a_line(ParameterError, "drive.slot must be at least delay.dead_time, 0.006 s"):
        scene({}, delay={"dead_time": 6e-3})
    assert scene({"slot": 10e-3}, delay={"dead_time": 6e-3}).drive.slot == 10e-3


def test_a_file_without_a_drive_says_nothing_of_one():
    assert "drive" not in format_scene(scene())
    written = format_scene(scene({"sections": 3}))
    assert "[drive]" in written
    assert scene({"sections": 3}).drive.count_valves(scene().layout) == 11 + 3 * 13


@pytest.mark.parametrize("method", ["virtual_master", "elastic", "force_display"])
def test_pins_that_wait_for_their_lines_arrive(method):
    # One set: most lines wait, also after sets of active cells end, and after the finger has left.
    made = scene({"sections": 1}, control={"method": method}, simulation={"duration": 6.0})
    system = assemble(made)
    *_, state = periods(system, made.trajectories(), begin(system), made.periods)
    apart = np.abs(state.row(0) - state.row(system.rows.target)) > made.control.dead_band
    # Method I approaches like 1/t: its pins are still on their way.
    assert np.isin(np.flatnonzero(apart), state.active.cells).all()
    assert apart.any() == (method == "virtual_master") == bool(state.addressing.waiting.size)


def test_the_error_is_that_of_the_commands_that_acted():
    result = run(scene({"sections": 2, "policy": "round_robin"}, control={"method": "elastic"}))
    assert result.estimate_errors().metrics["height_error"] < 0.15e-3


#: Beds on which a drive serves: sections of the scene.
BEDS = {
    "of Method III": {"control": {"method": "hybrid"}},
    "of a behavior": {"control": {"method": "viscous"}},
    "that shows a shape, then forms": {"shape": {"file": "ripple", "rise": "2 mm"}},
    "with sensors": {"sensors": {"delay": 1, "force_noise": "1 mN"}},
    "of shifted rows": {"layout": {"rows": 11, "columns": 13, "arrangement": "hexagonal"}},
    "under a hand that gives way": {"hand": {}},
    "under a body": {
        "control": {"method": "plastic"},
        "trajectory": None,
        "body": [{"mesh": pack_mesh(BOX.vertices, BOX.faces), "trajectory": WAY}],
    },
    "under two fingers": {
        "trajectory": None,
        "finger": [{"trajectory": WAY}, {"trajectory": ASIDE}],
    },
}
DRIVE = {"sections": 3, "slot": 15e-3, "share": True}


@pytest.mark.parametrize("tables", BEDS.values(), ids=BEDS)
def test_a_bed_is_driven_goes_on_from_a_kept_state_and_knows_its_error(tables):
    tables = {key: part for key, part in {"trajectory": WAY, **tables}.items() if part is not None}
    made = resolve({**BED, **tables, "drive": DRIVE})
    assert_goes_on(made, 40, 30)  # in mid-slot
    result = run(made)
    served, command = result.history["served"], result.history["command"]
    assert served.shape == command.shape
    assert not command[~served].any()
    system = assemble(made)
    states = periods(system, made.trajectories(), begin(system), made.periods)
    waiting = [state.waiting() for state in states]
    np.testing.assert_array_equal(result.history["waiting"], [*waiting, waiting[0] & False])
    error = result.estimate_errors().metrics["height_error"]
    assert error < 0.2e-3  # commands that did not act would leave millimeters


def test_a_state_of_a_bed_without_a_drive_goes_on_with_one_and_of_other_lines_is_refused():
    bare, driven = assemble(scene()), assemble(scene({"axis": "columns"}))
    state = snapshot.load(driven, snapshot.dump(bare, begin(bare)))
    assert state.addressing.served.tolist() == [True] * 4 + [False] * 9
    rows = assemble(scene({"axis": "rows"}))
    with refused_in_a_line(StateError, "lines of the drive as the bed now, 11 .got 13"):
        snapshot.load(rows, snapshot.dump(driven, state))


@pytest.mark.parametrize("other", [{"axis": "columns"}, {"sections": 2}], ids=str)
@pytest.mark.parametrize("gates", [{}, {"line_lag": "1 ms"}], ids=str)
def test_in_mid_slot_a_state_of_other_sets_of_lines_addresses_the_first_of_its_own(other, gates):
    square, drive = {"rows": 11, "columns": 11}, {"sections": 3, "slot": 15e-3, **gates}
    rows, others = (assemble(scene(given, layout=square)) for given in (drive, {**drive, **other}))
    paths = scene(drive, layout=square).trajectories()
    *_, half = periods(rows, paths, begin(rows), 40)
    data = snapshot.dump(rows, half)
    assert snapshot.load(rows, data).addressing.served.tolist() == half.addressing.served.tolist()
    former = snapshot.load(others, data)
    assert np.flatnonzero(former.addressing.served).tolist() == [*range(others.drive.sets[1])]
    for state in periods(others, paths, former, 20):
        served = np.flatnonzero(state.addressing.served)
        assert np.unique(served % others.drive.sets[1]).size == served.size


def test_orders_to_the_valves_pass_the_drive_and_a_take_is_replayed_bit_for_bit():
    made = scene({"sections": 1})
    system, count = assemble(made), 400
    raised = np.full(143, np.nan)
    raised[30:80] = 43e-3
    poses = np.tile([0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0], (count + 1, 1, 1))
    start = snapshot.dump(system, begin(system))
    seen = 0
    for state in simulate_path(system, begin(system), poses, place(count, raised)):
        moved = np.flatnonzero(state.row(system.rows.command))
        line, _ = made.drive.locate(made.layout, moved)
        assert state.addressing.served[line].all()
        seen = max(seen, np.unique(line).size)
    assert seen == 1
    end = snapshot.dump(system, state)
    take = from_bytes(to_bytes(Take(made, start, poses, end, place(count, raised))))
    *_, state = replay(take)
    assert snapshot.dump(system, state) == end
    assert np.nanmax(np.abs(state.row(0) - raised)) < 1e-6


def test_a_batch_with_a_drive_is_refused_and_its_runs_are_run_alone():
    with refused_in_a_line(ParameterError, "must have no drive: run them alone"):
        list(run_together([scene({}), scene({"sections": 3})][:1]))


def test_a_method_of_ones_own_is_driven_unchanged():
    with forgotten():
        tables = {**BED, "trajectory": WAY, "drive": {"sections": 2}}
        result = run(digiclay.scene(tables, {"control.method": Mine}))
    command, served = result.history["command"], result.history["served"]
    assert command.any()
    assert not command[~served].any()
