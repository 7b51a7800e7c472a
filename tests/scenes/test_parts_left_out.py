"""What a scene leaves out is not even imported, and the rest works without it."""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from tests.timeouts import TIMEOUT

ADDON = Path(__file__).parents[2] / "addon"

RUN = """
import sys
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.session.run_scene import run
settings = [Setting(name, "absent") for name in sys.argv[1:]]
result = run(load(find("tap"), settings))
assert result.periods == 100
core = "digiclay.core."
print(" ".join(name.removeprefix(core) for name in sys.modules if name.startswith(core)))
"""


@cache
def imported(*absent: str) -> set[str]:
    """Run a short session without some parts; return the core's modules it imported."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", RUN, *absent],
        cwd=ADDON, capture_output=True, text=True, check=False, timeout=TIMEOUT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize(
    ("part", "modules"),
    [
        ("conduit", {"model.conduit"}),
        ("valve_lag", {"model.lag"}),
        ("relaxation", {"model.relaxation"}),
        ("fingertip", {"model.relaxation"}),
        ("control", {"control.virtual_master", "control.blister", "control.servo"}),
    ],
)
def test_a_part_left_out_is_not_imported(part: str, modules: set[str]) -> None:
    assert imported() & modules == modules, "the check could not fail"
    assert imported(part) & modules == set()


def test_a_stepper_that_is_not_asked_for_is_not_imported() -> None:
    assert "steppers.explicit" not in imported()


def test_all_parts_can_be_left_out_together() -> None:
    everything = ("conduit", "valve_lag", "delay", "fingertip", "relaxation", "control", "recorder")
    modules = {"model.conduit", "model.lag", "model.relaxation", "control.virtual_master"}
    assert imported() & modules == modules, "the check could not fail"
    assert imported(*everything) & modules == set()
