"""Every test of a session has the extension enabled, a small bed to ask for, and time of its own."""

from typing import Any

import pytest
from digiclay.live import handlers

from tests.blender.at_hand import new_bed
from tests.blender.session.live import Clock


@pytest.fixture(autouse=True)
def watching(extension: None) -> None:
    """Watch undo and loading as a session does."""
    handlers.watch()


@pytest.fixture
def bed() -> Any:
    """A small bed in the open scene."""
    made = new_bed(rows=13, columns=13)
    handlers.watch()  # to open a file ends it
    return made


@pytest.fixture
def clock() -> Clock:
    """The wall's clock of a test."""
    return Clock()
