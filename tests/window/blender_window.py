"""Plays a script in a real Blender window, and returns what it saw."""

import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np

BLENDER = os.environ.get("DIGICLAY_BLENDER_WINDOW", "")
#: The words of a command for a Blender that draws on the display of its environment.
ON_DISPLAY = shlex.split(os.environ.get("DIGICLAY_BLENDER_DISPLAY", ""))
HERE = Path(__file__).parent
ADDON = HERE.parents[1] / "addon" / "digiclay"
#: A run takes two minutes under a virtual screen with software GL, and has taken more than eight on
#: a busy machine; beyond this it hangs, s.
LIMIT = 1200
#: Pins at rest, and how far a pin is down at least that a finger of 4 mm depth has passed, mm.
REST, FORMED = 40.0, 1.0


def bed(seen, name):
    """Return the heights of a step, mm, rows by columns."""
    return np.array(seen[name]["bed"])


def up(seen, name):
    """Return how far the pins are up in a step, mm."""
    return bed(seen, name) - REST


def down(seen, name):
    """Return how far the pins are down in a step, mm."""
    return REST - bed(seen, name)


def played(script, out, size=(1280, 800), by_hand=False, display=""):
    """Play a script of this folder in a Blender with the extension; return what it saw and its "output".

    Events come from the script, or `by_hand` from outside: Blender takes one of the two. The folder
    is empty at first. Software GL draws a window of a small size, pixels, much quicker; `display`
    is that of a screen.
    """
    installed = out / "extensions" / "user_default" / "digiclay"
    shutil.copytree(ADDON, installed, ignore=shutil.ignore_patterns("__pycache__", ".*"))
    # `timeout` ends Blender with SIGTERM, so that a launcher can take its children along.
    command = ["timeout", "--kill-after=10", str(LIMIT), *(ON_DISPLAY if display else [BLENDER])]
    command += ["--factory-startup", "--python-exit-code", "3"]
    command += [] if by_hand else ["--enable-event-simulate"]
    command += ["--window-geometry", "0", "0", str(size[0]), str(size[1])]
    start = f"import sys; sys.path[:0] = [{str(HERE.parents[1])!r}]"
    start += f"; from tests.window import driver; driver.main({script.removesuffix('.py')!r})"
    command += ["--python-expr", start, "--", str(out)]
    # A launcher that makes a screen for Blender makes it as large as the window.
    screen = {"BLENDER_WINDOW_SCREEN": f"{size[0]}x{size[1]}x24"}
    screen |= {"DISPLAY": display} if display else {}
    environment = os.environ | screen | {"BLENDER_USER_EXTENSIONS": str(out / "extensions")}
    done = subprocess.run(command, env=environment, capture_output=True, encoding="utf-8")
    kept = os.environ.get("DIGICLAY_SCREENSHOTS")
    if kept:
        Path(kept).mkdir(parents=True, exist_ok=True)
        for picture in out.glob("*.png"):
            shutil.copy(picture, kept)
    said = f"{done.stdout[-6000:]}\n{done.stderr[-6000:]}"
    assert (out / "seen.json").is_file(), (
        f"Blender ended with {done.returncode} and no result:\n{said}"
    )
    result = json.loads((out / "seen.json").read_text())
    assert "error" not in result, f"{result['error']}\n{said}"
    assert "Traceback" not in said, said
    # A blank screen has one color, a window without a bed hundreds.
    assert [name for name, count in result.get("colors", {}).items() if count < 100] == []
    assert done.returncode == 0, f"Blender ended with {done.returncode}:\n{said}"
    return result | {"output": done.stdout + done.stderr, "folder": out}
