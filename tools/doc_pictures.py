"""Pictures of the docs that are drawn without a window: `python tools/doc_pictures.py NAME ...`.

CONTRIBUTING.md has the command of every picture.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from digiclay.cli import main as digiclay
from PIL import Image

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"
#: Size of the picture of a series' page, pixels.
SERIES = (1300, 1080)
#: Series of which a frame of a film is shown, and the frame: the ridge under way.
FILMED = """\
scenes = ["ridge_mound_valley"]
[film]
"""
FRAME = 300


def carry_out(*words: str | Path) -> None:
    """Carry out a command of digiclay; end with its exit code if it fails."""
    code = digiclay([str(word) for word in words])
    if code:
        sys.exit(code)


def save_jpeg(picture: Path, name: str) -> None:
    """Write a picture into the docs as a JPEG. `name`: its name there."""
    with Image.open(picture) as opened:
        opened.convert("RGB").save(PICTURES / name, quality=88, optimize=True)


def draw_pins(folder: Path) -> None:
    """Draw the bed at the last touch of the paper's session."""
    run = folder / "run"
    carry_out("run", "ridge_mound_valley", "--out", run, "--render", "--no-errors", "--quiet")
    save_jpeg(run / "pins.png", "pins.jpg")


def draw_session(folder: Path) -> None:
    """Plot heights and force of the paper's session."""
    carry_out("run", "ridge_mound_valley", "--out", folder / "run", "--plots", "--no-errors", "--quiet")
    shutil.copyfile(folder / "run" / "session.png", PICTURES / "session.png")


def draw_film(folder: Path) -> None:
    """Draw a frame of a film of the paper's session."""
    jobs, out = folder / "film.toml", folder / "film"
    jobs.write_text(FILMED, encoding="utf-8")
    carry_out("batch", jobs, "--prepare", "--out", out, "--quiet")
    (job,) = (out / "jobs").iterdir()
    carry_out("job", job, "--only", "run")
    carry_out("job", job, "--only", "film", "--frames", f"{FRAME}-{FRAME}")
    (frame,) = (out / "runs" / job.name).rglob(f"*{FRAME}.png")
    save_jpeg(frame, "film.jpg")


def draw_series(folder: Path) -> None:
    """Show the page of the sample series in Chromium; its jobs take minutes."""
    carry_out("batch", "first", "--out", folder / "first", "--quiet")
    shown = folder / "page.png"
    size = ",".join(map(str, SERIES))
    options = (
        "--headless",
        "--no-sandbox",
        "--hide-scrollbars",
        f"--window-size={size}",
        f"--screenshot={shown}",
    )
    page = (folder / "first" / "index.html").as_uri()
    subprocess.run(["chromium", *options, page], check=True, capture_output=True, timeout=300)
    save_jpeg(shown, "batch.jpg")


DRAWN: dict[str, Callable[[Path], None]] = {
    "pins.jpg": draw_pins,
    "session.png": draw_session,
    "film.jpg": draw_film,
    "batch.jpg": draw_series,
}


def main(names: list[str]) -> None:
    """Draw the named pictures."""
    if not names or set(names) - set(DRAWN):
        sys.exit(
            f"The arguments must be names of pictures: {', '.join(DRAWN)} (got {' '.join(names) or 'none'})"
        )
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            DRAWN[name](Path(folder))


if __name__ == "__main__":
    main(sys.argv[1:])
