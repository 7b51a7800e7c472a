"""What the tests inside Blender share: the extension enabled and taken back, and an empty file."""

import bpy
import digiclay
import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.session import live_session
from digiclay.device import part_watch
from digiclay.device.instant import Instant
from digiclay.live import handlers
from digiclay.sessions import running

from tests.blender.at_hand import done


def enable(on):
    """Enable the extension, or take it back, unless it is so already."""
    if on != hasattr(bpy.types.Object, "digiclay"):
        (digiclay.register if on else digiclay.unregister)()


@pytest.fixture(scope="module", autouse=True)
def factory_settings():
    """Start every file of tests from Blender's own preferences and add-ons.

    What stays registered after the last one crashes or hangs Blender at its exit.
    """
    bpy.ops.wm.read_factory_settings(use_empty=False)
    yield
    enable(False)


@pytest.fixture(autouse=True)
def factory_file(request):
    """Start every test from Blender's factory file, with a cube, and with the extension where it asks for it.

    Preferences and the extension stay within a file of tests: each takes twice as long as the file.
    """
    enable("extension" in request.fixturenames)
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)


@pytest.fixture(autouse=True)
def quick_machine(monkeypatch):
    """Leave out no control period: what a test forms must not depend on who else uses the machine."""
    monkeypatch.setattr(live_session, "SHARE", 1e9)
    monkeypatch.setattr(live_session, "RELEASED_SHARE", 1e9)


@pytest.fixture
def extension(factory_file):
    """End all sessions of a test, with which the extension is enabled, and its messages."""
    yield
    handlers.end_all("ended with its test")
    running.TABLE.selected.clear()
    running.set_message("")


@pytest.fixture
def formed():
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
def watched(extension):
    """Look after beds as in a window, in an empty scene; take all back."""
    part_watch.watch()
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    done("Empty")
    yield
    part_watch.unregister()
