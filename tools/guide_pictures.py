"""Pictures of the guide, from the screenshots of its first page's script: see make guide-pictures."""

from __future__ import annotations

import sys
from pathlib import Path

from PIL import Image

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"


def main(folder: Path) -> None:
    """Write each screenshot of the guide that a folder has as a JPEG."""
    shots = sorted(folder.glob("guide_*.png"))
    if not shots:
        sys.exit(f"{folder} must have screenshots named guide_*.png (got none): run tests/window first")
    for shot in shots:
        with Image.open(shot) as picture:
            picture.convert("RGB").save(PICTURES / f"{shot.stem}.jpg", quality=85, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
