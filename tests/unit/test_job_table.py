"""JOBS files: what makes a job, what is told of a mistake, and that a job's own files say it all."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError, SceneError
from digiclay.core.model.layout import make_grid
from digiclay.core.scene.scene_source import SAMPLES, load
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.session.render_settings import Film, Still, Turntable
from digiclay.core.shapes.fitting import fit_shape
from digiclay.core.studies.job_table import Outputs, make_outputs, read_jobs, read_outputs

#: More settings than a batch may have.
MANY = "\n".join(f"n{i} = {{}}" for i in range(10_001))


def jobs_file(folder: Path, said: str) -> Path:
    """Write a JOBS file."""
    path = folder / "first.toml"
    path.write_text(said, encoding="utf-8")
    return path


def test_every_scene_meets_every_method_and_every_setting(tmp_path: Path) -> None:
    said = """
    scenes = ["tap", "slow_press"]
    methods = ["virtual_master", "cell_states"]
    [settings]
    soft = { control.force_setpoint = "300 mN" }
    firm.control.force_setpoint = 0.6
    """
    made = read_jobs(jobs_file(tmp_path, said)).jobs
    axes = (("tap", "slow_press"), ("virtual_master", "cell_states"), ("soft", "firm"))
    assert [job.name for job in made] == ["-".join(words) for words in itertools.product(*axes)]
    for jobs in (made, read_jobs(SAMPLES.parent / "batches" / "first.toml").jobs):
        assert [job.error for job in jobs] == [""] * 8
    assert [(job.scene.method, job.scene.control.force_setpoint) for job in made[:4] if job.scene] == [
        ("virtual_master", 0.3), ("virtual_master", 0.6), ("cell_states", 0.3), ("cell_states", 0.6),
    ]  # fmt: skip


def test_a_scene_beside_the_jobs_file_is_found_from_any_folder(tmp_path, monkeypatch):
    (tmp_path / "Übung 1.toml").write_text("simulation.duration = 0.25", encoding="utf-8")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (job,) = read_jobs(jobs_file(tmp_path, 'scenes = ["Übung 1.toml"]')).jobs
    assert job.name == "Übung_1"
    assert job.scene is not None
    assert job.scene.simulation.duration == 0.25


def test_values_that_do_not_go_together_make_one_job_with_an_error(tmp_path: Path) -> None:
    said = 'scenes = ["tap"]\nsettings.narrow = { layout.pitch = "1 mm" }\nsettings.wide.layout.pitch = 0.004'
    narrow, wide = read_jobs(jobs_file(tmp_path, said)).jobs
    assert (narrow.scene, wide.error) == (None, "")
    assert "settings.narrow: layout.pitch must be at least actuator.bore" in narrow.error


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ("", "scenes must be a list of scenes"),
        ("scenes = []", "scenes must be a list of scenes"),
        ('scenes = "tap"', "scenes must be a list of scenes"),
        ('scenes = ["tap", 3]', "scenes must be a list of scenes"),
        ('scenes = ["tapp"]', "tapp is neither a file nor a sample .* Did you mean tap?"),
        ('scenes = ["tap"]\nmethod = ["cell_states"]', "method must be a known key .* Did you mean methods?"),
        ('scenes = ["tap"]\nmethods = []', "methods must be a list"),
        ('scenes = ["tap"]\nmethods = ["magic"]', "methods must be one of virtual_master"),
        ('scenes = ["tap", "tap"]', r"scenes must not name one thing twice \(got tap twice\)"),
        ('scenes = ["tap"]\nsettings = 3', "settings must be a section of labels"),
        ('scenes = ["tap"]\nsettings.a = 3', r"settings\.a must be a table"),
        ('scenes = ["tap"]\nsettings."../a" = {}', "settings must have labels of letters"),
        ('scenes = ["tap"]\nexport = "stl"', "export must be a list of formats"),
        ('scenes = ["tap"]\nexport = ["stl", "stl"]', "export must not name a format twice"),
        ('scenes = ["tap"]\nerrors = 1', "errors must be true or false"),
        ('scenes = ["tap"]\nfilm = true', r"film must be a section, \[film\]"),
        ('scenes = ["tap"]\n[film]\nheight = 101', r"film\.height must be an even number of pixels"),
        ('scenes = ["tap"]\n[film]\nspeed = 0', r"film\.speed must be at least 0\.001"),
        ('scenes = ["tap"]\n[film]\nspeed = nan', r"film\.speed must be a finite number"),
        ('scenes = ["tap"]\n[film]\nrate = 2.5', r"film\.rate must be a whole number"),
        ('scenes = ["tap"]\n[still]\nengine = "eevee"', r"still\.engine must be one of cycles, workbench"),
        ('scenes = ["tap"]\n[turntable]\nframes = 1', r"turntable\.frames must be at least 2"),
        ('scenes = ["tap"]\n[film]\nfps = 3', r"film\.fps must be a known key"),
        ('scenes = ["tap"', r"first\.toml, line 1: "),
        pytest.param(f'scenes = ["tap"]\n[settings]\n{MANY}', r"10000 jobs at most \(got 10001", id="many"),
    ],
)
def test_a_mistake_is_told_in_one_line(said: str, told: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=told) as caught:
        read_jobs(jobs_file(tmp_path, said))
    assert "\n" not in str(caught.value)


def test_a_jobs_own_files_say_all_there_is_to_do(tmp_path: Path) -> None:
    path, film = tmp_path / "job.toml", Film(speed=0.5, start=0.1, arrows=False)
    full = Outputs(
        ("stl", "glb"), errors=False, still=Still(engine="cycles"), turntable=Turntable(frames=4), film=film
    )
    mesh = {"kind": "features", "skin": "smooth"}
    for made in (Outputs(), make_outputs({"export": ["stl"], "mesh": mesh}), full):
        path.write_text(made.format(), encoding="utf-8")
        assert read_outputs(path) == made
    # An older file has the color under the former key.
    assert make_outputs({"still": {"colour": "force"}}).still == Still(color="force")
    with pytest.raises(ParameterError, match="colour"):
        make_outputs({"still": {"colour": "force", "color": "mode"}})


def test_a_job_needs_no_other_file_for_its_shape(tmp_path: Path) -> None:
    np.save(tmp_path / "own.npy", np.arange(25.0).reshape(5, 5))
    said = 'control = "absent"\nlayout = { rows = 5, columns = 5 }\nshape.file = "own.npy"\n'
    (tmp_path / "shaped.toml").write_text(said, encoding="utf-8")
    (job,) = read_jobs(jobs_file(tmp_path, 'scenes = ["shaped.toml"]')).jobs

    def fit(scene: Any) -> Any:
        return fit_shape(scene.shape, make_grid(scene.layout), scene.actuator).heights

    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "scene.toml").write_text(format_scene(job.scene), encoding="utf-8")
    wanted = fit(job.scene)
    (tmp_path / "own.npy").unlink()
    np.testing.assert_array_equal(fit(load(tmp_path / "far" / "scene.toml")), wanted)
    assert np.ptp(wanted) > 1e-3
