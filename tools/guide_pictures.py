"""Pictures of the guide, from screenshots of window tests: see make guide-pictures."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
#: The area of the 3D view in a window of 1100 x 720: left, top, right and bottom, pixels.
VIEW = (0, 28, 910, 646)


def main(folder: Path) -> None:
    """Write the 3D view in each screenshot of the guide that a folder has as a JPEG."""
    shots = sorted(folder.glob("guide_*.png"))
    if not shots:
        sys.exit(f"{folder} must have screenshots named guide_*.png (got none): run tests/window first")
    for shot in shots:
        with Image.open(shot) as picture:
            picture.convert("RGB").crop(VIEW).save(PICTURES / f"{shot.stem}.jpg", quality=85, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
