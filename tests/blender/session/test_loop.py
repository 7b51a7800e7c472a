"""The operator that drives sessions: what holds of it without a window."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import bpy
from digiclay.live import tick
from digiclay.operators.session_loop import LoopMixin
from digiclay.sessions import running

from tests.blender.session.live import started


def test_a_fault_in_the_modal_part_ends_the_sessions_in_order(bed: Any, monkeypatch: Any) -> None:
    class Drive(LoopMixin):
        token, newer, report = 0, frozenset(), staticmethod(lambda level, words: said.append(words))

    said: list[str] = []
    started(bed)
    monkeypatch.setattr(tick, "tick", lambda context, now: {}["now"])
    assert Drive().modal(bpy.context, SimpleNamespace(type="TIMER", value="NOTHING")) == {"CANCELLED"}
    assert running.list_sessions() == ()
    assert said == ["Fault of the extension: KeyError: 'now'"]
    assert running.last_message() == f"The session of Digital Clay ended: {said[0]}"


def test_without_a_session_there_is_nothing_to_go_on_with() -> None:
    assert not bpy.ops.digiclay.session_go_on.poll()


def test_blender_lists_the_modal_operators_of_a_window() -> None:
    # The session looks them up in every version that is supported.
    assert "modal_operators" in bpy.types.Window.bl_rna.properties
