"""``digiclay describe``: what it says a pin can do, against pins that do it."""

from __future__ import annotations

import re

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.layout import Layout

from tests.assemble import AWAY, one_cell, record, scripted


def described(capsys: pytest.CaptureFixture[str], *settings: str) -> dict[str, str]:
    """Return the lines of the section on pins, by what they are about."""
    assert main(["describe", "slow_press", *(part for one in settings for part in ("--set", one))]) == 0
    section = capsys.readouterr().out.split("\nThe pins\n")[1].split("\n\n")[0]
    joined = re.sub(r"\n {6,}", " ", section)
    return {line[:12].strip(): line[12:].strip() for line in joined.splitlines()}


def numbers(text: str) -> list[float]:
    """Return the numbers of a line."""
    return [float(found) for found in re.findall(r"-?\d+(?:\.\d+)?", text)]


#: Reservoirs that are not alike, so that up and down are told apart.
UNLIKE = ("supply.high=0.4 bar", "supply.low=-0.6 bar", "layout.rows=12", "layout.columns=10")


def test_speeds_hold_forces_and_refilling_are_those_of_a_pin_with_its_valve_wide_open(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said, moved = described(capsys, *UNLIKE), []
    for command in (1.0, -1.0):
        one = one_cell(supply=Supply(0.4e5, -0.6e5), control=scripted(lambda time, x, y, k=command: k))
        height = record(one, AWAY, 60).height[:, 0]
        # The valve is open after five of its time constants; then the pin goes at one speed.
        moved.append(1e3 * abs(height[60] - height[20]) / (40 * one.period))
    # Three digits are written.
    up, down = numbers(said["free speed"])
    assert [up, down] == pytest.approx(moved, rel=5e-3)
    forces = [pressure * Actuator().area for pressure in (0.4e5, 0.6e5)]
    assert numbers(said["hold force"]) == pytest.approx(forces, rel=5e-3)
    filled, emptied, volume = numbers(said["refill"])
    # 100 mm of stroke; three digits each.
    assert [filled * up, emptied * down] == pytest.approx([100.0, 100.0], rel=1e-2)
    assert volume == pytest.approx(120 * np.pi * 100.0 * 1e-3, rel=5e-3)


def test_a_reservoir_that_cannot_lower_a_pin_never_empties_the_bed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = described(capsys, "supply.low=0")
    assert ", 0 mm/s down" in said["free speed"]
    assert "floor: never" in said["refill"]


def test_every_parameter_is_listed_with_its_value_and_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["describe", "tap", "--parameters", "--set", "layout.pitch=3.5 mm"]) == 0
    text = capsys.readouterr().out
    parts = {"layout": Layout, "actuator": Actuator, "control": VirtualMaster}
    names = [f"{section}.{name} = " for section, part in parts.items() for name in list_quantities(part)]
    assert [name for name in names if name not in text] == []
    assert "layout.pitch = 0.0035 m\n    distance of neighboring cells in a row; above 0; P\n" in text
