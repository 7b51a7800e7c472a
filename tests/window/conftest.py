"""Fixture of all window tests."""

import pytest

from tests.window.blender_window import Seen, played


@pytest.fixture(scope="module")
def seen(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """What the script of a file has seen, played once; `PLAYED` there is its name and how it is played."""
    return played(out=tmp_path_factory.mktemp("window"), **request.module.PLAYED)
