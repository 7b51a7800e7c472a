"""Fixture of all window tests."""

import pytest

from tests.window.blender_window import played


@pytest.fixture(scope="module")
def seen(request, tmp_path_factory):
    """What the script of a file has seen, played once; `PLAYED` there is its name and how it is played."""
    return played(out=tmp_path_factory.mktemp("window"), **request.module.PLAYED)
