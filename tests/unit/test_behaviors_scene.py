"""The behaviors in scene files: named, written back, and refused in one line what cannot be."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.methods import METHODS
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import format_scene, resolve

BEHAVIORS = ("elastic", "plastic", "viscous", "push_pull", "force_display", "shape_display")


def build(method: str, **known: Any) -> Any:
    """Return a behavior, put together for a bed of 5 x 5 cells."""
    return assemble(
        resolve({"layout": {"rows": 5, "columns": 5}, "control": {"method": method, **known}})
    ).controller


@pytest.mark.parametrize("method", BEHAVIORS)
def test_a_scene_names_the_behavior(method: str) -> None:
    assert build(method).name == method


@pytest.mark.parametrize("method", BEHAVIORS)
def test_a_behavior_forms_no_blister(method: str) -> None:
    assert METHODS[method].blister is None


@pytest.mark.parametrize("method", BEHAVIORS)
def test_a_scene_with_the_behavior_reads_back_equal(method: str) -> None:
    scene = resolve({"control": {"method": method}})
    assert resolve(tomllib.loads(format_scene(scene))) == scene


WRONG = [
    ("elastic", {"stiffness": 0}, "control.stiffness must be above 0 N/m (got 0 N/m)."),
    ("plastic", {"yield_force": -0.1}, "control.yield_force must be above 0 N (got -0.1 N)."),
    (
        "plastic",
        {"yield_force": 1e-3},
        "control.yield_force must be at least felt_force, 0.005 N (got 0.001 N).",
    ),
    (
        "force_display",
        {"field": "ramp", "contrast": 0.95},
        "control.contrast must keep the field at or above control.felt_force, 0.005 N "
        "(got 0.0025 N at its smallest).",
    ),
    (
        "viscous",
        {"recovery": 1.0},
        "control.recovery must be a known key (got 1.0). Did you mean control.recovery_time?",
    ),
    (
        "push_pull",
        {"following_speed": 1e-3},
        "control.following_speed must be at least listening_speed, 0.008 m/s (got 0.001 m/s).",
    ),
    (
        "push_pull",
        {"threshold": 20e-6},
        "control.threshold must be above a listening pin's own way in a control period, 4e-05 m "
        "(got 2e-05 m).",
    ),
    (
        "force_display",
        {"field": "ramp", "force": 0.12},
        "control.force must keep the field below what a pin can press, 0.157 N (got 0.18 N at its largest).",
    ),
    (
        "shape_display",
        {"shape": "hat"},
        "control.shape must be one of dome, saddle, wave, ripple, crater, pyramid, ramp, flat, "
        "or a file .npy (got 'hat').",
    ),
    (
        "shape_display",
        {"refresh": "at_once"},
        "control.refresh must be one of one_time, gradual, approximate_gradual (got 'at_once').",
    ),
    (
        "shape_display",
        {"amplitude": 70e-3},
        "control.amplitude must keep the shape between 0 and the stroke, 0.1 m "
        "(got heights from 0.04 m to 0.11 m).",
    ),
    (
        "elastic",
        {"settling_time": 5e-3},
        "control.settling_time must be at least two control periods, 0.01 s (got 0.005 s).",
    ),
    (
        "elastic",
        {"damping": 1.0},
        "control.damping must be at least 2.1 N s/m at this control period, or the pin would swing "
        "(got 1 N s/m).",
    ),
    (
        "shape_display",
        {"shape": "nowhere.npy"},
        "control.shape must be a file that can be read (got nowhere.npy: No such file or directory).",
    ),
]


@pytest.mark.parametrize(("method", "given", "line"), WRONG)
def test_a_bad_parameter_is_refused_in_one_line(method: str, given: dict[str, Any], line: str) -> None:
    with pytest.raises(ParameterError) as caught:
        build(method, **given)
    assert str(caught.value) == line


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.zeros((4, 5)), "must hold an array of the bed's 5 x 5 cells (got {}: 4 x 5)."),
        (np.full((5, 5), 0.2), "must hold values from 0 to 0.1 m (got {}: 0.2 m)."),
        (np.full((5, 5), np.nan), "must hold values from 0 to 0.1 m (got {}: nan m)."),
        (np.array([["a"] * 5] * 5), "must be a file that holds one array of numbers (got {})."),
    ],
)
def test_a_file_that_does_not_fit_the_bed_is_refused(tmp_path: Path, array: Any, said: str) -> None:
    path = tmp_path / "mine.npy"
    np.save(path, array)
    with pytest.raises(ParameterError) as caught:
        build("shape_display", shape=str(path))
    assert str(caught.value) == "control.shape " + said.format(path)
