"""Every test of a session has the extension enabled, a small bed to ask for, and time of its own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import digiclay
import pytest
from digiclay.live import handlers

from tests.blender.at_hand import new_bed
from tests.blender.session.live import Clock


@pytest.fixture(autouse=True)
def extension(factory_file: None) -> Iterator[None]:
    """Enable the extension, watch undo and loading as a session does, and take all back."""
    digiclay.register()
    handlers.watch()
    yield
    digiclay.unregister()


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
