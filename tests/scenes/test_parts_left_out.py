"""What a scene leaves out is not even imported, and the rest works without it."""

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
settings = [Setting(*one.split("=")) for one in sys.argv[1:]]
result = run(load(find("tap"), settings))
assert result.periods == 100
core = "digiclay.core."
print(" ".join(name.removeprefix(core) for name in sys.modules if name.startswith(core)))
"""


@cache
def imported(*settings):
    """Run a short session with some settings; return the core's modules it imported."""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", RUN, *settings],
        cwd=ADDON,
        capture_output=True,
        encoding="utf-8",
        check=False,
        timeout=TIMEOUT,
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize(
    "without, with_, modules",
    [
        (("fingertip=absent",), (), {"model.relaxation"}),
        (
            [f"{part}=absent" for part in ("conduit", "valve_lag", "delay", "relaxation", "control")], (),
            {"model.conduit", "model.lag", "model.relaxation", "control.virtual_master", "control.blister",
             "control.servo"},
        ),
        (
            (), ("simulation.stepper=heun", "sensors.delay=1", "hand.mass=5 g", "drive.sections=4"),
            {"steppers.explicit", "model.sensors", "model.yielding_hand", "model.matrix_drive"},
        ),
        (("sensors.delay=1",), ("sensors.observer=valve",), {"model.observer"}),
    ],
)  # fmt: skip
def test_what_a_scene_does_without_is_not_imported(without, with_, modules):
    assert imported(*with_) & modules == modules, "the check could not fail"
    assert imported(*without) & modules == set()
