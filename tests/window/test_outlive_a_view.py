"""Operators that go on while views, workspaces and other operators come and go, in a real Blender window."""

from __future__ import annotations

from typing import Any

import pytest

from tests.window.blender_window import played


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Play the script once; a traceback anywhere in it ends `played`."""
    return played("outlive_a_view.py", tmp_path_factory.mktemp("outlive"), (800, 600))


def test_pins_are_picked_in_whichever_view_the_mouse_is_in(seen: dict[str, Any]) -> None:
    # Row 1 of 9 lies 9 mm before the middle; columns 2 and 6, 6 mm to either side.
    assert seen["picked"] == [9 + 2]
    assert seen["clicked in the timeline"] == [9 + 2]
    assert seen["picked elsewhere"] == [9 + 2, 9 + 6]


def test_the_keys_stand_in_the_workspace_that_is_shown_and_go_with_the_operator(seen: dict[str, Any]) -> None:
    assert seen["told in"] == ["Animation"]
    assert seen["after Enter"] == [[], []]


@pytest.mark.parametrize("area", ["VIEW_3D", "PROPERTIES"])
def test_esc_stops_a_session_that_has_stepped_aside_for_a_moment(seen: dict[str, Any], area: str) -> None:
    modal, running, after, later, token = seen[f"Esc over {area}"]
    assert (modal, running) == ([], 1)
    assert (after, later, token) == (0, [], 0)
