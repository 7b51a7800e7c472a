"""A new behavior is one file and one line: it runs alone and in batches, and is found where methods are."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.package_copy import copy_package, find_changes, run_python

#: A sponge gives way under a force, and swells back slowly, by a share of its way a second.
SPONGE = '''
"""Sponge: a pressed pin gives way, and swells back slowly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.control_interface import Commands, Measurement
from .device_info import DeviceInfo
from .drive import CellwiseControl, TouchParameters, check_damping, make_drive


@dataclass(frozen=True)
class Sponge(TouchParameters):
    """Damping and swelling."""

    damping: float = quantity(5.0, "force for the speed at which a pin sinks", unit="N s/m", above=0.0)
    swelling_time: float = quantity(0.3, "time constant of the swelling", unit="s", symbol="τ_w", above=0.0)


@dataclass(frozen=True, eq=False)
class SpongeControl(CellwiseControl):
    """Controller of the sponge; a cell remembers for how many periods it has been pressed."""

    parameters: Sponge

    name = "sponge"
    rows = 1

    def command(self, memory: Any, seen: Measurement) -> tuple[Any, Commands]:
        """Let pressed cells sink, and the others swell; see `Controller`."""
        known, rest = self.parameters, self.actuator.rest_height
        pressed = seen.force >= known.felt_force
        seen.own[0] = np.where(pressed, seen.own[0] + 1.0, 0.0)
        speed = np.where(pressed, -seen.force / known.damping, (rest - seen.height) / known.swelling_time)
        mode = np.where(pressed, np.int8(Mode.SPRING), np.int8(Mode.REST))
        target = np.full(seen.height.shape, rest)
        return memory, Commands(target, mode, self.drive.command(speed, seen.force))


def build(parameters: Sponge, device: DeviceInfo) -> SpongeControl:
    """Build the sponge's controller for a device."""
    check_damping(parameters.damping, device.cell, device.period)
    drive = make_drive(parameters, device.cell, device.period)
    return SpongeControl(parameters, device.cell.actuator, drive)
'''
#: What runs in the copy: three runs alone and in one batch; prints the largest differences.
SESSION = """
import json, sys, tomllib
import numpy as np
from digiclay.core.batch.packing import make_batch
from digiclay.core.batch.run_together import run_together
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session.run_scene import run
from digiclay.settings.groups import METHOD_GROUPS

def scene(*settings):
    return load(find("tap"), [Setting(*one.split("=")) for one in settings])

times = ("0.1", "0.3", "0.9")
scenes = [scene("control.method=sponge", f"control.swelling_time={one}") for one in times]
alone = [run(one).history["height"] for one in scenes]
batch = {number: result.history["height"].copy() for number, result in run_together(scenes)}
text = format_scene(scenes[1])
print(json.dumps({
    "batch": max(float(np.abs(batch[i] - alone[i]).max()) for i in range(3)),
    "apart": float(np.abs(alone[0] - alone[-1]).max()),
    "joined": type(make_batch([assemble(one) for one in scenes]).controller).__name__,
    "in file": 'method = "sponge"' in text and resolve(tomllib.loads(text)) == scenes[1],
    "panel": "swelling_time" in METHOD_GROUPS["sponge"].__annotations__,
}))
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a copy of the package with the sponge's file, and its row in the list of methods."""
    package = copy_package(tmp_path)
    control = package / "addon" / "digiclay" / "core" / "control"
    (control / "sponge.py").write_text(SPONGE.lstrip(), encoding="utf-8")
    methods = (control / "methods.py").read_text(encoding="utf-8")
    start = "METHODS: dict[str, Method] = {\n"
    row = '    "sponge": Method("control.sponge", "Sponge", recovers=True),\n'
    assert start in methods
    (control / "methods.py").write_text(methods.replace(start, start + row), encoding="utf-8")
    return package


def test_a_new_behavior_is_one_file_and_one_line(copy: Path) -> None:
    assert find_changes(copy) == ["methods.py", "sponge.py"]
    found = json.loads(run_python(copy, "-c", SESSION))
    # Sums in another order: a last bit here and there.
    assert found.pop("batch") < 1e-12
    assert found.pop("apart") > 1e-5
    # All runs of a batch in one call, not one after the other.
    assert found == {"joined": "SpongeControl", "in file": True, "panel": True}
    described = run_python(
        copy, "-m", "digiclay", "describe", "tap", "--parameters", "--set", "control.method=sponge"
    )
    assert "control.swelling_time = " in described
