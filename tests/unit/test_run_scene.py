"""A session from scene to results, their folder; the recorder's rows, and the memory they need."""

import os
import tempfile
import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.engine.state import Rows, make_initial_state
from digiclay.core.files.run_folder import MARK, check_folder, write_folder
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.recorder import Recorder, RunRecording, write
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.accuracy import Errors
from digiclay.core.session.finished_run import HISTORY_ARRAYS, read_run
from digiclay.core.session.memory_limit import (
    count_busy_cells,
    count_bytes_needed,
    measure_available_memory,
    refuse_what_cannot_fit,
)
from digiclay.core.session.run_scene import Result, run, save

from tests.assemble import over_middle, table

WAY = over_middle((0, 0.041), (0.1, 0.038), (0.2, 0.041))
SMALL = {"radius": 6e-3, "edge_radius": 9e-3, "flat_radius": 3e-3}
TABLE = {
    "layout": {"rows": 3, "columns": 4},
    "blister": SMALL,
    "trajectory": {"waypoints": WAY},
}


def scene(**sections):
    return resolve({**TABLE, **sections}, "press")


@pytest.fixture(scope="module")
def result():
    return run(scene())


@pytest.mark.parametrize(("fingers", "drive"), [(1, {}), (2, {}), (1, {"drive": {"sections": 2}})])
def test_the_arrays_of_a_history_are_the_declared_ones_and_are_read_again(fingers, drive, tmp_path):
    beyond = over_middle((0, 0.041), (0.1, 0.034), (0.2, 0.041))
    finger = {"trajectory": {"waypoints": beyond}}
    motion = finger if fingers == 1 else {"finger": [finger, finger]}
    done = run(resolve({"layout": TABLE["layout"], "blister": SMALL, **motion, **drive}))
    save(done, tmp_path)
    absent = {"finger_force"} if fingers == 1 else set()
    absent |= set() if drive else {"served", "waiting"}
    sizes = {"t": 41, "n": 12, "f": fingers}
    assert {name: array.shape for name, array in done.history.items()} == {
        name: tuple(
            sizes.get(axis) or int(axis)
            for axis in declared.axes.split(", ")
            if axis != "f" or fingers > 1
        )
        for name, declared in HISTORY_ARRAYS.items()
        if name not in absent and not name.startswith("body")
    }
    again = read_run(tmp_path, *HISTORY_ARRAYS).history
    assert all(np.array_equal(again[name], array) for name, array in done.history.items())


def test_bodies_in_the_history_of_a_scene_without_any_are_none_or_refused_by_their_shape(
    result, tmp_path
):
    history = result.history | {"body": np.zeros((41, 1, 7))}
    save(replace(result, history=history), tmp_path)
    with pytest.raises(OutputError, match=r"body must have the shape \(41, 0, 7\) of its scene"):
        read_run(tmp_path, "body")
    save(replace(result, history=history | {"body": np.zeros((41, 0, 7))}), tmp_path)
    assert read_run(tmp_path, "body").history["body"].shape == (41, 0, 7)


def test_a_history_follows_the_path_and_gives_the_metrics(result):
    assert result.history["mode"].dtype == np.int8
    wanted = scene().section("trajectory").trajectory().poses(result.history["time"])
    assert np.array_equal(result.history["fingertip"], wanted)
    assert result.metrics["max_total_force"] == result.history["total_force"].max() > 0.01
    assert [name for name in result.metrics["units"] if name not in result.metrics] == []


def test_the_same_scene_gives_the_same_history_bit_for_bit_or_less_of_it(result):
    told = []
    again = run(scene(), progress=lambda done, total: told.append((done, total))).history
    assert [name for name in again if not np.array_equal(again[name], result.history[name])] == []
    assert told == [(done, 40) for done in range(1, 41)]
    thinned = run(scene(recorder={"every": 4})).history
    assert np.array_equal(thinned["height"], result.history["height"][::4])
    # Pressed in between.
    assert ", no contact in the rows kept, " in run(scene(recorder={"every": 40})).summary()
    assert run(scene(recorder="absent")).history == {}
    assert (
        run(scene(fingertip="absent"))
        .summary()
        .endswith("real time), no contact, errors not estimated (not asked for)")
    )


def test_without_control_no_force_is_deviated_from_and_what_fits_into_no_memory_is_refused():
    done = run(scene(control="absent"))
    assert (done.metrics["rfd"], done.metrics["set_point"]) == (None, None)
    assert np.ptp(done.history["height"]) == 0.0
    # 10,000 cells over eleven days at 200 Hz: 5e13 bytes fit nowhere.
    endless = scene(layout={"rows": 100, "columns": 100}, simulation={"duration": 1e6})
    with pytest.raises(ParameterError, match="free memory"):
        run(endless)


def test_the_summary_is_one_line_with_times_and_rfd(result):
    made = Result(
        result.scene,
        result.history,
        40,
        0.05,
        {**result.metrics, "rfd": 0.0612, "beyond_a_finger": ""},
    )
    made.metrics.update(
        simulated=26.0, real_time_factor=21.6, rfd_jnd_least=0.567, rfd_jnd_most=1.02
    )
    made.metrics.update(run_time=1.204, height_error=1.2e-6, force_error=7e-4)
    assert made.summary() == (
        "26.0 s simulated in 1.2 s (21.6 x real time), RFD 0.061 N (0.57 to 1 JND), "
        "height error about 1.2 µm, force error about 0.7 mN"
    )
    made.metrics.update(run_time=1234.0, force_error=0.151, real_time_factor=12345.6)
    assert "in 1200 s (12300 x real time)" in made.summary()
    assert made.summary().endswith("force error about 150 mN")


@pytest.mark.parametrize(
    "changed, why",
    [
        ({"recorder": {"every": 2}}, "recorder.every = 2 leaves out commands"),
        ({"recorder": "absent"}, "recorder = 'absent' keeps no command"),
        (
            {"simulation": {"physics_step": "8 us", "duration": "5 ms", "stepper": "heun"}},
            "physics_step is too short to be halved",
        ),
    ],
)
def test_a_run_whose_errors_cannot_be_estimated_says_why(changed, why):
    known = run(scene(**changed)).estimate_errors()
    assert "height_error" not in known.metrics
    assert why in known.metrics["errors_absent"]
    assert f"errors not estimated ({known.metrics['errors_absent']})" in known.summary()


@pytest.mark.parametrize("speed, said", [(24e-3, ", lost once, 0.99 s"), (26e-3, ""), (5e-3, "")])
def test_the_summary_tells_that_a_lift_lost_the_finger_unless_no_pin_rises_so_fast(speed, said):
    way = over_middle((0.0, 0.041), (0.2, 0.037), (0.5, 0.037), (1.5, 0.037 + speed))
    path = {"waypoints": way, "interpolation": "linear"}
    done = run(scene(layout={"rows": 13, "columns": 13}, blister={}, trajectory=path))
    assert said in done.summary()
    assert ("lost" in done.summary()) == ("lost" in done.metrics) == bool(said)


@pytest.mark.parametrize(
    "order, parts", [(1, 4), (2, 2)], ids=["across a kink, in quarters", "smooth, in halves"]
)
def test_an_estimate_is_the_error_itself_where_the_reference_converges_with_an_order(order, parts):
    error = np.array([5e-6, 1e-3, 4e-3])
    assert Errors.estimate(error - error / parts**order) == pytest.approx(tuple(error), rel=1e-12)


def stopped_after(count):
    asked = iter(range(1, 1000))
    return run(scene(), stopped=lambda: next(asked) == count)


def test_a_stopped_session_keeps_what_was_computed_and_is_marked_incomplete(result):
    cut = stopped_after(10)
    assert np.array_equal(cut.history["height"], result.history["height"][:11])
    assert (cut.incomplete, cut.metrics["incomplete"]) == (True, True)
    assert not stopped_after(40).incomplete  # with its last period


def fill(folder, word):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).write_text(word, encoding="utf-8")


def test_a_folder_appears_with_all_that_was_written_and_not_before_nor_after_a_failure(tmp_path):
    with (
        pytest.raises(ZeroDivisionError),
        write_folder(tmp_path / "a" / "b", overwrite=False) as staged,
    ):
        raise ZeroDivisionError((staged / "x").touch())
    assert list(tmp_path.iterdir()) == []
    with write_folder(tmp_path / "a" / "b", overwrite=False) as staged:
        (staged / "x").touch()
        assert not (tmp_path / "a" / "b").exists()
    assert [path.name for path in (tmp_path / "a" / "b").iterdir()] == ["x"]
    (tmp_path / "empty").mkdir()
    with write_folder(tmp_path / "empty", overwrite=False) as staged:
        (staged / "x").touch()
    assert [path.name for path in (tmp_path / "empty").iterdir()] == ["x"]


def test_an_older_run_is_replaced_when_asked_and_stays_when_the_new_one_fails(tmp_path):
    def words():
        paths = (path for path in tmp_path.glob("*/*") if path.is_file())
        return [(path.name, path.read_text(encoding="utf-8")) for path in paths]

    fill(tmp_path / "run", "old")
    with pytest.raises(ZeroDivisionError), write_folder(tmp_path / "run", overwrite=True):
        raise ZeroDivisionError
    assert words() == [(MARK, "old")]
    # What is the user's stays: notes, a folder, a link that leads nowhere.
    (tmp_path / "run" / "mine").mkdir()
    for name in ("notes.md", "film.mp4", "mine/a.png", ".film.mp4.1@a.part"):
        (tmp_path / "run" / name).write_text("mine")
    (tmp_path / "run" / "link").symlink_to("nowhere")
    with write_folder(tmp_path / "run", overwrite=True) as staged:
        fill(staged, "new")
    assert sorted(words()) == [(MARK, "new"), ("notes.md", "mine")]
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names == {MARK, "notes.md", "mine", "link"}
    assert (tmp_path / "run" / "mine" / "a.png").read_text() == "mine"


@pytest.mark.parametrize(
    "there, out, overwrite, message",
    [
        (f"run/{MARK}", "run", False, r"is not empty: .* --overwrite"),
        ("thesis.doc", ".", True, "contains something other than a run"),
        ("run", "run", True, "is a file"),
        ("file", "file/run", False, "cannot be made"),
    ],
)
def test_a_folder_that_could_not_be_used_is_refused_before_any_work(
    tmp_path, there, out, overwrite, message
):
    (tmp_path / there).parent.mkdir(exist_ok=True)
    (tmp_path / there).touch()
    with pytest.raises(OutputError, match=message):
        check_folder(tmp_path / out, overwrite=overwrite)


@pytest.fixture
def locked():
    """Give a folder this process may not write to; root, who may write anywhere, is nobody meanwhile."""
    with tempfile.TemporaryDirectory() as name:
        folder, root = Path(name), os.geteuid() == 0
        folder.chmod(0o555)
        if root:
            os.seteuid(65534)
        try:
            yield folder
        finally:
            if root:
                os.seteuid(0)
            folder.chmod(0o700)


def test_a_folder_without_leave_to_write_is_told_before_any_work(locked):
    with pytest.raises(OutputError, match="cannot be written to"):
        check_folder(locked / "run", overwrite=False)


ROWS = Rows(physics=2, queue=2)
CELLS = 3


def after(start, period):
    """Return a state in which every number of the gathered cells tells the period it was made in."""
    block = np.zeros_like(start.rows)
    block[0], block[ROWS.force], block[ROWS.command] = 100 + period, 200 + period, 300 + period
    cells, mode = np.arange(CELLS), np.full(CELLS, period, np.int8)
    held = replace(start.active, cells=cells, near=CELLS, block=block, mode=mode)
    return start._replace(period=period, active=held)


def recorded(every, periods, stop=None):
    start = make_initial_state(ROWS, CELLS, 0.04, None)
    recording = RunRecording(Recorder(every), ROWS, start, periods)
    last = start
    for period in range(1, (stop or periods) + 1):
        last = after(start, period)
        recording.observe(last)
    arrays = recording.finish(last.period)
    return {
        name: (array if array.ndim == 1 else array[:, 0]).tolist() for name, array in arrays.items()
    }


@pytest.mark.parametrize(
    "session, name, wanted",
    [
        # The first row is the state before the session, any other one that at its time.
        ((1, 3), "height", [0.04, 101.0, 102.0, 103.0]),
        ((1, 3), "force", [0.0, 201.0, 202.0, 203.0]),
        # A command or a mode is in the row its period starts with; after the last row nothing is
        # commanded.
        ((1, 3), "command", [301.0, 302.0, 303.0, 0.0]),
        ((1, 3), "mode", [1, 2, 3, 3]),
        # Every second period makes a row, and so does the end.
        ((2, 5), "period", [0, 2, 4, 5]),
        ((2, 5), "command", [301.0, 303.0, 305.0, 0.0]),
        # A session cut short ends with the state it had reached, and without a command.
        ((3, 9, 4), "period", [0, 3, 4]),
        ((3, 9, 4), "command", [301.0, 304.0, 0.0]),
    ],
)
def test_a_row_is_the_state_at_its_time_and_what_was_commanded_from_then_on(session, name, wanted):
    assert recorded(*session)[name] == wanted


@pytest.mark.parametrize("every", [1, 2, 3, 4, 5, 6])
def test_there_are_as_many_rows_as_were_announced(every):
    assert len(recorded(every, 5)["period"]) == Recorder(every).rows(5)


def test_a_written_history_is_read_back_bit_for_bit_and_smaller_than_its_arrays(tmp_path):
    rng, path = np.random.default_rng(1), tmp_path / "history.npz"
    history = {
        "height": rng.normal(size=(5, 7)),
        "mode": rng.integers(0, 8, (5, 7)).astype(np.int8),
    }
    write(history, path)
    with np.load(path, allow_pickle=False) as read:
        assert [
            name for name, array in history.items() if not np.array_equal(read[name], array)
        ] == []
    heights = np.full((500, 400), 0.04)
    write({"height": heights}, path)
    # A bed at rest is the same row over and over: anything but a few per cent is not deflated.
    assert path.stat().st_size < 0.05 * heights.nbytes


def fits(recorder, cells, periods, free):
    try:
        refuse_what_cannot_fit(recorder, ROWS, cells, periods, free)
    except ParameterError:
        return False
    return True


def test_a_history_fits_to_the_byte_or_is_refused_with_the_least_thinning_that_fits():
    needed = count_bytes_needed(Recorder(1), ROWS, 1000, 100)
    assert [fits(Recorder(1), 1000, 100, free) for free in (needed - 1, needed)] == [False, True]
    with pytest.raises(ParameterError) as caught:
        refuse_what_cannot_fit(Recorder(1), ROWS, 1_000_000, 5200, 20_000_000_000)
    assert str(caught.value) == (
        "recorder.every must be at least 7 for the history to fit into 20 GB of free memory "
        "(got 1: 5201 rows of 1000000 cells are 135 GB)."
    )
    assert [fits(Recorder(every), 1_000_000, 5200, 20_000_000_000) for every in (6, 7)] == [
        False,
        True,
    ]
    with pytest.raises(
        ParameterError, match=r"^layout.rows \* columns must be few enough for 1 GB"
    ):
        refuse_what_cannot_fit(Recorder(1000), ROWS, 20_000_000, 100, 1_000_000_000)
    # Less than this could not have started the interpreter that runs the test.
    assert measure_available_memory() > 10_000_000


#: Two beds, of which the larger has so many more cells: what is taken once falls out of the
#: difference.
SIDES, MORE = (100, 150), 150**2 - 100**2


def measured_and_estimated(**changes):
    """Return bytes a cell at a session's peak: those numpy asks for, and those the estimate says."""
    taken, told = [], []
    for side in SIDES:
        press = over_middle((0.0, 0.041), (0.05, 0.038))
        bed = {"layout": {"rows": side, "columns": side}, "trajectory": {"waypoints": press}}
        scene = resolve({**bed, "simulation": {"duration": 0.05}, **changes})
        system = assemble(scene)
        told.append(
            count_bytes_needed(
                scene.recorder, system.rows, scene.cells, scene.periods, count_busy_cells(scene)
            )
        )
        tracemalloc.start()
        try:
            run(scene)
            taken.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    return (taken[1] - taken[0]) / MORE, (told[1] - told[0]) / MORE


@table(
    "changes, least, most",
    {
        # All of it is arrays whose lengths are known; of what is taken once a little depends on the
        # finger.
        "I": ({"recorder": "absent"}, 0.95, 1.05),
        "Method I": ({"recorder": "absent", "control": {"method": "cell_states"}}, 0.95, 1.05),
        # Temporary arrays are as many as numpy happens to need.
        "cells that all take": ({"recorder": "absent", "shape": {"file": "dome"}}, 0.95, 1.05),
        "rows that wait": ({"shape": {"file": "dome"}, "simulation": {"duration": 0.5}}, 0.5, 1.0),
    },
)  # fmt: skip
def test_a_cell_takes_as_many_bytes_as_is_said(changes, least, most):
    taken, told = measured_and_estimated(**changes)
    assert least * told <= taken <= most * told


def test_a_row_of_a_cell_takes_as_many_bytes_as_is_said():
    history = run(resolve({"simulation": {"duration": 0.05}})).history
    rows, cells = history["height"].shape
    kept = sum(array.nbytes for array in history.values() if array.shape == (rows, cells)) / (
        rows * cells
    )
    told = [count_bytes_needed(Recorder(), Rows(2, 2), 1000, periods) for periods in (500, 501)]
    # One byte more stands for what the metrics need, which is a truth value.
    assert (told[1] - told[0]) / 1000 == kept + 1
