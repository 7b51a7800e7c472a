"""The operator that drives sessions ends for a moment now and then: what holds without a window."""

from __future__ import annotations

import bpy


def test_without_a_session_there_is_nothing_to_go_on_with() -> None:
    assert not bpy.ops.digiclay.session_go_on.poll()


def test_blender_lists_the_modal_operators_of_a_window() -> None:
    # The session looks them up in every version that is supported.
    assert "modal_operators" in bpy.types.Window.bl_rna.properties
