"""Every test of a session has the extension enabled, a small bed to ask for, and time of its own."""

import pytest
from digiclay.core.session import live_session
from digiclay.live import handlers

from tests.blender.at_hand import new_bed
from tests.blender.session.balls import add_ball
from tests.blender.session.live import Clock


@pytest.fixture(autouse=True)
def watching(extension):
    """Watch undo and loading as a session does."""
    handlers.watch()


@pytest.fixture
def bed():
    """A small bed in the open scene."""
    made = new_bed(rows=13, columns=13)
    handlers.watch()  # to open a file ends it
    return made


@pytest.fixture
def ball(bed):
    """A ball over the bed, which presses it."""
    return add_ball()


@pytest.fixture
def clock():
    """The wall's clock of a test."""
    return Clock()


@pytest.fixture(params=[0.0, 1e9], ids=["a period a tick", "a stroke a tick"])
def machine(request, monkeypatch):
    """Run a test on the slowest machine and on the fastest: time for strokes, s, in a tick."""
    monkeypatch.setattr(live_session, "find_spare", lambda *given: request.param)
