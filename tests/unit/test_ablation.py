"""Parts of Method III left out: each makes another controller, and what is no part is one line."""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.control.hybrid import HybridControl
from digiclay.core.model.trajectory import Path, Waypoint
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene
from digiclay.core.scene.toml_table import resolve

from benchmarks.ablation import PARAMETERS, PUT_TOGETHER, carry_out
from benchmarks.wrong_models import run_controller

#: A press of a small bed, a lift, and a drag of 9 mm in 0.2 s.
SMALL = {
    "layout": {"rows": 11, "columns": 11}, "control": {"method": "hybrid"}, "sensors": {"force_noise": 2e-3},
}  # fmt: skip


def press(**control: float) -> Scene:
    """Return a press, a lift and a drag on a small bed with Method III."""
    scene = resolve({**SMALL, "control": {"method": "hybrid", **control}})
    drag = (0.0, -4.5, 40.5), (0.15, -4.5, 38.0), (0.8, -4.5, 46.0), (1.0, 4.5, 46.0)
    points = tuple(Waypoint(time=t, position=(1e-3 * x, 0.0, 1e-3 * z)) for t, x, z in drag)
    lasting = replace(scene.simulation, duration=drag[-1][0])
    return scene.with_sections(trajectory=Path("linear", points), simulation=lasting)


@pytest.fixture(scope="module")
def whole() -> tuple[Scene, dict[str, float | None]]:
    """The scene, and its figures with all parts."""
    scene = press()
    controller = assemble(scene).controller
    assert controller
    return scene, run_controller(scene, controller)


@pytest.mark.parametrize("part", PUT_TOGETHER)
def test_a_controller_without_a_part_differs_from_the_whole(
    part: str, whole: tuple[Scene, dict[str, float | None]]
) -> None:
    scene, figures = whole
    controller = assemble(scene).controller
    assert isinstance(controller, HybridControl)
    found = run_controller(scene, PUT_TOGETHER[part](controller))
    assert found["rfd"] is not None
    assert np.isfinite(found["rfd"])
    # More than rounding: a part that is still there gives the same to some ten digits.
    assert found["rfd"] != pytest.approx(figures["rfd"], rel=1e-6)


def test_the_parameters_that_leave_a_part_out_are_accepted() -> None:
    for values in PARAMETERS.values():
        assert press(**{name: float(value) for name, value in values.items()}).method == "hybrid"


def test_what_is_no_part_is_refused_in_one_line() -> None:
    with pytest.raises(ParameterError, match="--part must be one of nothing, skirt"):
        carry_out(argparse.Namespace(part="skrit", quick=True, quiet=True, out=None))
