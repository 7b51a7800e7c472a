"""The extension in a real Blender window, used by simulated key presses and mouse moves."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BLENDER = os.environ.get("DIGICLAY_BLENDER_WINDOW", "")
HERE = Path(__file__).parent
ADDON = HERE.parents[1] / "addon" / "digiclay"
#: A run takes 20 s under a virtual screen with software GL; beyond this it hangs.
LIMIT = 180

pytestmark = pytest.mark.skipif(
    not BLENDER, reason="DIGICLAY_BLENDER_WINDOW does not name a Blender with a window"
)


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Run the session once; return what stood in the scene after each of its steps."""
    out = tmp_path_factory.mktemp("window")
    installed = out / "extensions" / "user_default" / "digiclay"
    shutil.copytree(ADDON, installed, ignore=shutil.ignore_patterns("__pycache__", ".*"))
    # `timeout` ends Blender with SIGTERM, so that a launcher can take its children along.
    command = [
        "timeout",
        "--kill-after=10",
        str(LIMIT),
        BLENDER,
        "--factory-startup",
        "--enable-event-simulate",
    ]
    command += ["--python-exit-code", "3", "--python", str(HERE / "drag_the_fingertip.py"), "--", str(out)]
    environment = os.environ | {"BLENDER_USER_EXTENSIONS": str(out / "extensions")}
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    said = f"{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    assert (out / "seen.json").is_file(), f"Blender ended with {done.returncode} and no result:\n{said}"
    result: dict[str, Any] = json.loads((out / "seen.json").read_text())
    assert "error" not in result, result["error"]
    assert done.returncode == 0, f"Blender ended with {done.returncode}:\n{said}"
    kept = os.environ.get("DIGICLAY_SCREENSHOTS")
    if kept:
        Path(kept).mkdir(parents=True, exist_ok=True)
        shutil.copy(out / "dragged.png", kept)
    return result


def test_the_add_menu_adds_one_bed_with_all_its_pins(seen: dict[str, Any]) -> None:
    assert (seen["added"]["beds"], seen["added"]["pins drawn"]) == (1, 625)


def test_dragging_moves_the_fingertip_and_nothing_else(seen: dict[str, Any]) -> None:
    added, dragged = seen["added"], seen["dragged"]
    moved = np.linalg.norm(np.subtract(dragged["pose"][:3], added["pose"][:3]))
    assert moved > 0.005  # 120 pixels across a bed of 75 mm that fills the view
    assert dragged["pose"][3:] == added["pose"][3:]
    assert dragged["heights"] == added["heights"]


def test_one_undo_takes_back_the_drag(seen: dict[str, Any]) -> None:
    assert seen["undone"]["pose"] == seen["added"]["pose"]


def test_redo_brings_the_drag_back(seen: dict[str, Any]) -> None:
    assert seen["redone"] == seen["dragged"]


def test_undoing_everything_takes_the_bed_away(seen: dict[str, Any]) -> None:
    assert seen["all undone"] == {"beds": 0}


def test_the_screenshot_shows_more_than_an_empty_window(seen: dict[str, Any]) -> None:
    # Shaded pins and a shaded fingertip have thousands of colours, a blank screen has one.
    assert seen["colours"] > 500
