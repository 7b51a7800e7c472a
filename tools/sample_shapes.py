"""Write the sample shapes: `python tools/sample_shapes.py`; with `--picture` also the page that shows them.

Each is made from a formula in `shape_maps.py` or `shape_solids.py`; nobody else's data is in them.
"""

from __future__ import annotations

import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
SHAPES = ROOT / "addon" / "digiclay" / "sample_shapes" / "shapes"
PICTURE = ROOT / "docs" / "pictures" / "shapes.jpg"
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "addon")]

import shape_maps  # noqa: E402
import shape_solids  # noqa: E402
from digiclay.core.base.arrays import Floats  # noqa: E402

#: Pictures: name, bits a pixel, pixels a side.
PICTURES = (
    ("braille", 8, 160),
    ("crater", 8, 96),
    ("face", 16, 128),
    ("heart", 8, 96),
    ("letters", 8, 128),
    ("spiral", 8, 128),
    ("terrain", 16, 96),
)
#: Arrays of heights: name, heights a side, height, m.
ARRAYS = (("ripple", 49, 12e-3), ("saddle", 33, 16e-3), ("wave", 33, 10e-3))
#: Meshes: name, format.
MESHES = (("dome", "stl"), ("gear", "stl"), ("grip", "obj"), ("knot", "ply"), ("pyramid", "obj"))


def mapped(name: str, side: int) -> Floats:
    """Return a formula's values from 0 to 1, the lowest row first."""
    formula: Callable[[Floats, Floats], Floats] = getattr(shape_maps, name)
    return shape_maps.between_0_and_1(formula(*shape_maps.square(side)))


def png(values: Floats, bits: int) -> bytes:
    """Return a gray picture of values from 0 to 1, the highest row first as in every picture."""
    levels = np.rint(np.flipud(values) * (2**bits - 1)).astype(">u2" if bits == 16 else "u1")
    lines = b"".join(b"\0" + line.tobytes() for line in levels)

    def chunk(name: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        )

    head = struct.pack(">IIBBBBB", levels.shape[1], levels.shape[0], bits, 0, 0, 0, 0)
    parts = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(lines, 9)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def write(folder: Path) -> list[Path]:
    """Write every sample shape into a folder; return the files."""
    import trimesh

    written = []
    for name, bits, side in PICTURES:
        written.append(folder / f"{name}.png")
        written[-1].write_bytes(png(mapped(name, side), bits))
    for name, side, height in ARRAYS:
        written.append(folder / f"{name}.npy")
        np.save(written[-1], (mapped(name, side) * height).astype(np.float32))
    for name, kind in MESHES:
        vertices, faces = getattr(shape_solids, name)()
        written.append(folder / f"{name}.{kind}")
        solid = trimesh.Trimesh(vertices, faces, process=False)
        options = {"include_normals": False, "header": "z up", "digits": 3} if kind == "obj" else {}
        solid.export(written[-1], **options)
    return written


def picture(path: Path) -> None:
    """Draw every sample shape as a bed of 49 x 49 pins shows it."""
    import matplotlib.pyplot as plt
    from digiclay.core.model.actuator import Actuator
    from digiclay.core.model.layout import Layout, make_grid
    from digiclay.core.shapes.request import Shape
    from digiclay.core.shapes.source_file import fit_shape, list_shapes
    from matplotlib.colors import LightSource

    bed = make_grid(Layout(rows=49, columns=49, pitch=2e-3))
    x, y = (values.reshape(49, 49) * 1e3 for values in (bed.x, bed.y))
    names = list_shapes()
    figure, axes = plt.subplots(
        3, 5, figsize=(15, 9.4), subplot_kw={"projection": "3d", "computed_zorder": False}
    )
    light = LightSource(azdeg=305, altdeg=38)
    for axis in axes.ravel():
        axis.set_axis_off()
    for axis, name in zip(axes.ravel(), names, strict=False):
        z = fit_shape(Shape(file=name, rise=16e-3), bed, Actuator()).heights.reshape(49, 49) * 1e3
        shade = light.shade(z, plt.get_cmap("cividis"), vert_exag=1.0, dx=2.0, dy=-2.0, blend_mode="soft")
        axis.plot_surface(x, y, z, facecolors=shade, rstride=1, cstride=1, linewidth=0, antialiased=False)
        axis.set_box_aspect((98, 98, 16), zoom=1.22)
        axis.view_init(elev=44, azim=-62)
        axis.set_title(name, y=0.86, fontsize=15)
    figure.subplots_adjust(left=0, right=1, bottom=0, top=0.98, wspace=0, hspace=0)
    figure.savefig(path, dpi=80, pil_kwargs={"quality": 85})


if __name__ == "__main__":
    SHAPES.mkdir(parents=True, exist_ok=True)
    for file in write(SHAPES):
        print(f"{file.relative_to(ROOT)}: {file.stat().st_size / 1000:.1f} kB")
    if "--picture" in sys.argv[1:]:
        picture(PICTURE)
