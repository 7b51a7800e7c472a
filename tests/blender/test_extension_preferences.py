"""Preferences: colors that can be told apart, worn by the beds of a file; defaults where there are none."""

from __future__ import annotations

import itertools

import bpy
import digiclay
import numpy as np
import pytest
from digiclay import preferences
from digiclay.bridge import linear
from digiclay.core.base.modes import Mode
from digiclay.device import palettes
from digiclay.device.parts import ROLE

#: What is left of linear light to people without one kind of cone (Machado, Oliveira and Fernandes 2009).
VISION = {
    "all cones": np.eye(3),
    "no red cones": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no green cones": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "no blue cones": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
#: From linear light to CIE XYZ, white at 1.
XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
) / np.array([[0.95047], [1.0], [1.08883]])


def lab(light: np.ndarray) -> np.ndarray:
    """Return CIE L*a*b* of linear light."""
    x, y, z = (np.cbrt(v) if v > 216 / 24389 else (24389 / 27 * v + 16) / 116 for v in XYZ @ light)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def mode_color(mode: Mode) -> tuple[float, ...]:
    """Return the linear color the pins of a mode have in the viewport."""
    (material,) = (item for item in bpy.data.materials if item.get(ROLE) == mode.name.lower())
    return tuple(material.diffuse_color)


@pytest.mark.parametrize("vision", VISION)
@pytest.mark.parametrize("name", palettes.PALETTES)
def test_any_two_modes_look_different_with_any_color_vision(name: str, vision: str) -> None:
    seen = [
        lab(np.clip(VISION[vision] @ linear(color)[:3], 0.0, 1.0))
        for color in palettes.PALETTES[name].values()
    ]
    # A difference of 2.3 is just noticeable side by side; 10 is told apart at a glance.
    assert min(np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)) > 10.0


@pytest.mark.usefixtures("extension")
def test_a_palette_recolors_the_beds_of_the_file() -> None:
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    palettes.set_palette("tol_muted")
    for mode, color in palettes.PALETTES["tol_muted"].items():
        # float32 numbers up to 1.
        np.testing.assert_allclose(mode_color(mode), linear(color), rtol=0, atol=1e-6)


@pytest.mark.usefixtures("extension")
def test_a_second_bed_leaves_colors_the_user_has_changed() -> None:
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    (material,) = (item for item in bpy.data.materials if item.get(ROLE) == "rest")
    material.diffuse_color = (1.0, 0.0, 0.0, 1.0)
    bpy.ops.mesh.digital_clay_add(rows=4, columns=4)
    assert mode_color(Mode.REST) == (1.0, 0.0, 0.0, 1.0)


def test_a_palette_in_a_file_without_a_bed_does_nothing() -> None:
    before = len(bpy.data.materials)
    palettes.set_palette("brightness")
    assert (palettes.has_palette(), len(bpy.data.materials)) == (False, before)


@pytest.mark.usefixtures("extension")
def test_where_the_package_is_not_enabled_the_preferences_are_the_defaults_of_the_properties() -> None:
    assert preferences.get(bpy.context) == preferences.Choices()
    shown = preferences.Preferences.bl_rna.properties
    for name, value in vars(preferences.Choices()).items():
        assert shown[name].default == value


def test_what_fails_to_register_leaves_nothing_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    from digiclay import panels

    def refuse() -> None:
        raise RuntimeError("refused")

    monkeypatch.setattr(panels, "register", refuse)
    with pytest.raises(RuntimeError, match="refused"):
        digiclay.register()
    assert not hasattr(bpy.types.Object, "digiclay")
    assert "MESH_OT_digital_clay_add" not in dir(bpy.types)
