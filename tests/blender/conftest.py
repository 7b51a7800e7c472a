"""What the tests inside Blender share: the extension enabled and taken back, and an empty file."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import digiclay
import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.session import live_session
from digiclay.device import unit
from digiclay.device.instant import Instant

from tests.blender.at_hand import done


@pytest.fixture(scope="module", autouse=True)
def factory_settings() -> None:
    """Start every file of tests from Blender's own preferences and add-ons."""
    bpy.ops.wm.read_factory_settings(use_empty=False)


@pytest.fixture(autouse=True)
def factory_file() -> None:
    """Start every test from Blender's factory file: a cube, a camera, a lamp.

    Preferences stay within a file of tests: to load them too takes five times as long.
    """
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)


@pytest.fixture(autouse=True)
def quick_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out no control period: what a test forms must not depend on who else uses the machine."""
    monkeypatch.setattr(live_session, "SHARE", 1e9)


@pytest.fixture
def extension() -> Iterator[None]:
    """Enable the extension and take it back: what stays registered crashes or hangs Blender at exit."""
    digiclay.register()
    yield
    digiclay.unregister()


@pytest.fixture
def formed() -> Instant:
    """A staggered bed in which every pin has a height of its own and every mode occurs."""
    layout = Layout(rows=6, columns=8, arrangement="staggered")
    bed = make_grid(layout)
    codes = np.arange(bed.count) * 5 % len(Mode)
    return Instant(
        position=bed.positions,
        height=0.03 + 0.02 * np.sin(np.arange(bed.count)),
        mode=codes,
        force=0.01 * np.arange(bed.count),
        fingertip=np.array([0.004, -0.002, 0.055, 1.0, 0.0, 0.0, 0.0]),
        pitch=layout.pitch,
    )


@pytest.fixture
def watched(factory_file: None) -> Iterator[None]:
    """Enable the extension and look after beds as in a window, in an empty scene; take all back."""
    digiclay.register()
    unit.watch()
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    done("Empty")
    yield
    unit.unregister()
    digiclay.unregister()
