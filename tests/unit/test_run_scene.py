"""A session from scene to results, and the folder they are written to."""

from __future__ import annotations

import json
import os
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.files.run_folder import MARK, check_folder, write_folder
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import Result, run, save

WAY = [{"time": t, "position": [0, 0, z]} for t, z in ((0, 0.041), (0.1, 0.038), (0.2, 0.041))]
SMALL = {"radius": 6e-3, "edge_radius": 9e-3, "flat_radius": 3e-3}
TABLE: dict[str, Any] = {
    "layout": {"rows": 3, "columns": 4}, "blister": SMALL, "trajectory": {"waypoints": WAY},
}  # fmt: skip


def scene(**sections: Any) -> Scene:
    """Return a short press on a small bed."""
    return resolve({**TABLE, **sections}, "press")


@pytest.fixture(scope="module")
def result() -> Result:
    """Return a session run once."""
    return run(scene())


def test_a_history_has_the_arrays_and_shapes_it_is_known_by(result: Result) -> None:
    cells = dict.fromkeys(("height", "force", "command", "mode"), (41, 12))
    assert {name: array.shape for name, array in result.history.items()} == {
        "time": (41,), **cells, "fingertip": (41, 7), "total_force": (41,), "position": (12, 2),
        "beyond_a_finger": (41,),  # only in a run that leaves the range of the contact law
    }  # fmt: skip
    assert result.history["mode"].dtype == np.int8
    wanted = scene().section("trajectory").trajectory().poses(result.history["time"])
    assert np.array_equal(result.history["fingertip"], wanted)
    assert result.metrics["max_total_force"] == result.history["total_force"].max() > 0.01
    assert [name for name in result.metrics["units"] if name not in result.metrics] == []


def test_the_same_scene_gives_the_same_history_bit_for_bit_or_less_of_it(result: Result) -> None:
    told: list[tuple[int, int]] = []
    again = run(scene(), progress=lambda done, total: told.append((done, total))).history
    assert [name for name in again if not np.array_equal(again[name], result.history[name])] == []
    assert told == [(done, 40) for done in range(1, 41)]
    thinned = run(scene(recorder={"every": 4})).history
    assert np.array_equal(thinned["height"], result.history["height"][::4])
    assert run(scene(recorder="absent")).history == {}
    assert run(scene(fingertip="absent")).summary().endswith("real time), no contact")


def test_without_control_no_valve_opens_and_there_is_no_force_to_deviate_from() -> None:
    done = run(scene(control="absent"))
    assert (done.metrics["rfd"], done.metrics["set_point"]) == (None, None)
    assert np.ptp(done.history["height"]) == 0.0


def test_the_summary_is_one_line_with_times_and_rfd(result: Result) -> None:
    made = Result(
        result.scene, result.history, 40, 0.05, {**result.metrics, "rfd": 0.0612, "beyond_a_finger": ""}
    )
    made.metrics.update(simulated=26.0, real_time_factor=21.6, rfd_jnd_least=0.567, rfd_jnd_most=1.02)
    made = Result(made.scene, made.history, 40, 1.204, made.metrics)
    assert made.summary() == "26.0 s simulated in 1.2 s (21.6 x real time), RFD 0.061 N (0.57 to 1 JND)"


def stopped_after(count: int) -> Result:
    """Run a session that is asked to stop after some periods."""
    asked = iter(range(1, 1000))
    return run(scene(), stopped=lambda: next(asked) == count)


def test_a_stopped_session_keeps_what_was_computed_and_is_marked_incomplete(result: Result) -> None:
    cut = stopped_after(10)
    assert np.array_equal(cut.history["height"], result.history["height"][:11])
    assert (cut.incomplete, cut.metrics["incomplete"]) == (True, True)
    assert not stopped_after(40).incomplete  # with its last period


def test_a_session_that_cannot_fit_in_memory_is_refused() -> None:
    # 20 million cells over a year at 200 Hz: 3e18 bytes fit nowhere.
    endless = scene(layout={"rows": 4000, "columns": 5000}, simulation={"duration": 1e6})
    with pytest.raises(ParameterError, match="free memory"):
        run(endless)


def test_a_saved_run_has_scene_metrics_and_history(result: Result, tmp_path: Path) -> None:
    save(result, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["history.npz", "metrics.json", "scene.toml"]
    assert resolve(tomllib.loads((tmp_path / "scene.toml").read_text(encoding="utf-8"))) == result.scene
    assert json.loads((tmp_path / "metrics.json").read_text(encoding="utf-8")) == result.metrics


def fill(folder: Path, word: str) -> None:
    """Make a folder look like a run's."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).write_text(word, encoding="utf-8")


def test_a_folder_appears_with_all_that_was_written_and_not_before_nor_after_a_failure(tmp_path):
    with pytest.raises(ZeroDivisionError), write_folder(tmp_path / "a" / "b", overwrite=False) as staged:
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


def test_an_older_run_is_replaced_when_asked_and_stays_when_the_new_one_fails(tmp_path: Path) -> None:
    def words() -> list[tuple[str, str]]:
        return [(path.name, path.read_text(encoding="utf-8")) for path in tmp_path.glob("*/*")]

    fill(tmp_path / "run", "old")
    with pytest.raises(ZeroDivisionError), write_folder(tmp_path / "run", overwrite=True):
        raise ZeroDivisionError
    assert words() == [(MARK, "old")]
    with write_folder(tmp_path / "run", overwrite=True) as staged:
        fill(staged, "new")
    assert words() == [(MARK, "new")]


@pytest.mark.parametrize(
    ("there", "out", "overwrite", "message"),
    [
        (f"run/{MARK}", "run", False, r"is not empty: .* --overwrite"),
        ("thesis.doc", ".", True, "holds other things than a run"),
        ("run", "run", True, "is a file"),
        ("file", "file/run", False, "cannot be made"),
    ],
)
def test_a_folder_that_could_not_be_used_is_refused_before_any_work(tmp_path, there, out, overwrite, message):
    (tmp_path / there).parent.mkdir(exist_ok=True)
    (tmp_path / there).touch()
    with pytest.raises(OutputError, match=message):
        check_folder(tmp_path / out, overwrite=overwrite)


@pytest.fixture
def locked() -> Iterator[Path]:
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


def test_a_folder_without_leave_to_write_is_told_before_any_work(locked: Path) -> None:
    with pytest.raises(OutputError, match="cannot be written to"):
        check_folder(locked / "run", overwrite=False)
