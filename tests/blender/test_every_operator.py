"""Every operator with odd things active, in every mode: it is refused or does its work, and never fails."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest
from digiclay import operators
from digiclay.live import tick
from digiclay.press import tool

from tests.blender.odd import ODD
from tests.blender.session.live import Clock

OPERATORS = [kind for kind in operators.CLASSES if issubclass(kind, bpy.types.Operator)]
#: Settings with which long work takes less time.
QUICK: dict[str, dict[str, Any]] = {"digiclay.bake": {"last": 3}, "digiclay.add_sample": {"take": False}}


@pytest.fixture
def file(extension: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A file with a small bed, active, beside Blender's cube: it loads quicker than a bed is made."""
    monkeypatch.chdir(tmp_path)  # for what is exported
    monkeypatch.setenv("HOME", str(tmp_path))
    bpy.ops.mesh.digital_clay_add(rows=5, columns=5)
    tool.take_up(bpy.context)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "bed.blend"))
    return bpy.data.filepath


def prepare(file: str, odd: str, live: bool) -> Any:
    """Load the file, with a session on its bed, and do what is odd; return what tells that it was undone."""
    bpy.ops.wm.open_mainfile(filepath=file)
    if live:
        tick.start(bpy.context, bpy.context.object)
    ODD[odd](bpy.context.object)
    Clock().tick(2)
    return state()


def state() -> Any:
    """Return what is active, in which mode, and among how many objects."""
    return getattr(bpy.context.object, "name", ""), bpy.context.mode, len(bpy.data.objects)


def calls() -> Iterator[tuple[Any, str, dict[str, Any]]]:
    """Give every operator, how to call it, and its settings; once more with either value of what has two."""
    for kind in OPERATORS:
        area, _, name = kind.bl_idname.partition(".")
        operator, quick = getattr(getattr(bpy.ops, area), name), QUICK.get(kind.bl_idname, {})
        how = "EXEC_DEFAULT" if hasattr(kind, "execute") else "INVOKE_DEFAULT"
        yield operator, how, quick
        for known in operator.get_rna_type().properties:
            if known.type == "ENUM" and len(known.enum_items) == 2:
                for item in known.enum_items:
                    yield operator, how, {**quick, known.identifier: item.identifier}


def call(operator: Any, how: str, settings: dict[str, Any]) -> str:
    """Call an operator as the 3D view would, where it does not decline; return what it says of an error."""
    (window,) = bpy.context.window_manager.windows
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        try:
            if operator.poll():
                operator(how, **settings)
        except RuntimeError as error:
            return str(error)
    return ""


@pytest.mark.parametrize("live", [False, True])
@pytest.mark.parametrize("odd", ODD)
def test_no_operator_fails(file: str, odd: str, live: bool, capfd: pytest.CaptureFixture[str]) -> None:
    before, said = prepare(file, odd, live), []
    for operator, how, settings in calls():
        said.append((operator.idname(), settings, call(operator, how, settings)))
        if state() != before:
            before = prepare(file, odd, live)
    assert [words for words in said if "Traceback" in words[2]] == []
    assert "Traceback" not in "".join(capfd.readouterr())  # of a poll, for instance
