"""``digiclay form``: mesh, clay, finger, mesh in one command; and what it says when it cannot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from digiclay.cli import main
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.fingertip import Fingertip
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.forming import (
    compute_display_time,
    find_display,
    find_summit,
    find_touch_height,
    make_forming_scene,
)
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.toml_table import resolve
from digiclay.core.session.run_scene import run
from digiclay.core.shapes.fitting import fit_shape
from digiclay.core.shapes.request import Shape

SMALL = ["--set", "layout.rows=13", "--set", "layout.columns=13"]
BED = make_grid(Layout(13, 13))


def form(folder: Path, word: str, *options: str) -> Path:
    """Form a shape on a bed of 13 x 13 cells; return its folder."""
    out = folder / "out"
    assert main(["form", word, "--out", str(out), "--overwrite", *SMALL, *options]) == 0
    return out


def read(out: Path) -> dict[str, np.ndarray]:
    """Return a run's history."""
    with np.load(out / "history.npz") as stored:
        return dict(stored)


def test_a_mesh_goes_in_is_formed_and_comes_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "Größe 1.stl"
    trimesh.creation.icosphere(subdivisions=3, radius=10.0).export(source)
    out = form(tmp_path, str(source), "--export", "stl,glb")
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "Größe 1.stl: heights from 40.0 to 52.0 mm, covers 137 of 169 cells, no cell clipped"
    assert said[1].startswith("displayed to within ")
    assert said[2].startswith("formed: ")
    assert said[-1] == f"written to {out}"
    before, after = (trimesh.load_mesh(out / name) for name in ("displayed/surface.stl", "surface.stl"))
    assert before.is_watertight
    assert after.is_watertight
    assert (out / "surface.glb").is_file()
    # The finger draws a peak of some mm out of the top: 6 mm above where it touched, less its own give.
    assert after.bounds[1, 2] - before.bounds[1, 2] > 4.0
    judged = json.loads((out / "metrics.json").read_text(encoding="utf-8"))
    assert judged["display_error"] <= 10.1e-6
    assert judged["raised_volume"] > 1e-7
    assert judged["shape_covered"] == 137


def test_without_a_touch_the_shape_comes_out_as_it_went_in(tmp_path: Path) -> None:
    height = read(form(tmp_path, "face", "--finger", "away"))["height"][-1]
    wanted = fit_shape(Shape(file="face", rise=12e-3), BED, Actuator()).heights
    # The dead band of the pins' height control.
    assert np.abs(height - wanted).max() <= 10e-6 + 4e-9


def test_the_finger_comes_when_the_shape_stands_and_the_folder_alone_repeats_the_run(tmp_path, capsys):
    source = tmp_path / "shape.npy"
    np.save(source, np.eye(4))
    out = form(tmp_path, str(source), "--finger", "press")
    assert float(capsys.readouterr().out.split("displayed to within ")[1].split(" µm")[0]) <= 10.0
    assert read(out)["total_force"].max() > 0.1
    source.unlink()
    again = run(load(out / "scene.toml")).history
    assert again
    assert np.array_equal(again["height"], read(out)["height"])


@pytest.mark.parametrize(
    ("refresh", "preset"), [("one_time", "viscous"), ("gradual", "paper"), ("approximate_gradual", "fast")]
)
def test_a_shape_stands_by_the_time_it_is_said_to(refresh: str, preset: str) -> None:
    table = {
        "layout": {"rows": 9, "columns": 9},
        "control": {"method": "plastic"},
        "preset": preset,
        "shape": {"file": "ripple", "rise": 30e-3, "foot": -10e-3, "refresh": refresh, "surfaces": 3},
    }
    bare = resolve(table)
    system = assemble(bare)
    display = find_display(system)
    assert display
    ready = compute_display_time(display)
    scene = make_forming_scene(bare, system, "away")
    height = run(scene).history["height"]
    stands = np.abs(height - display.heights).max(axis=1) <= 10e-6 + 1e-12
    # Within the time, and not after a small part of it: nobody waits for nothing.
    assert stands[round(ready / 5e-3)]
    assert not stands[round(0.2 * ready / 5e-3)]


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (7.3e-3, -2.1e-3)])
def test_the_finger_touches_the_highest_part_nearest_to_the_middle_at_the_height_it_is_said_to(x, y):
    top = np.full(169, 40e-3)
    top[[0, 60, 84]] = 50e-3, 49.9e-3, 41e-3
    assert find_summit(BED, top) == (float(BED.x[60]), float(BED.y[60]))
    heights = fit_shape(Shape(file="crater"), BED, Actuator()).heights
    touch = find_touch_height(BED, heights, Fingertip(), x, y)
    finger = Fingertip()
    # The ellipsoid by its own equation, as far out as it reaches.
    square = ((BED.x - x) / finger.length) ** 2 + ((BED.y - y) / finger.width) ** 2
    under = touch + finger.height * (1.0 - np.sqrt(np.maximum(1.0 - square, 0.0)))
    near = square < 0.9
    assert np.min((under - heights)[near]) == pytest.approx(0.0, abs=1e-12)
