"""Pictures that ImageMagick wrote of known numbers, and their brightness; see samples/README.md."""

from pathlib import Path

import numpy as np
from PIL import Image, TiffImagePlugin

FOLDER = Path(__file__).parent / "samples" / "pictures"
RAMP = (1000.0 + 5003.0 * np.arange(12)).reshape(3, 4)
COLORS = [RAMP, RAMP[::-1, ::-1] // 2, RAMP.T.reshape(3, 4)]
#: Clear on the left, half clear beside it.
ALPHA = np.tile([0.0, 32768 / 65535, 1.0, 1.0], (3, 1))
#: Least difference of brightness that files of a depth keep, of 65535. Colors of CMYK and of a JPEG
#: are rounded several times.
STEPS = {"16": 1.0, "32": 1.0, "64": 1.0, "4": 65535 / 15, "8": 65535 / 255, "k": 4 * 65535 / 255}
READ = {
    "gray16.png": "16",
    "gray16_interlaced.png": "16",
    "gray4.png": "4",
    "palette.png": "8",
    "gray_alpha8.png": "8",
    "gray_alpha16.png": "16",
    "gray_alpha16_interlaced.png": "16",
    "rgb16.png": "16",
    "rgb16_interlaced.png": "16",
    "rgba8.png": "8",
    "rgba16.png": "16",
    "rgb16_deflated.tif": "16",
    "rgb16_tiled.tif": "16",
    "rgba16_big_endian.tif": "16",
    "rgba16_associated.tif": "16",
    "gray32.tif": "32",
    "gray_float64.tif": "64",
    "rgb8_planes.tif": "8",
    "cmyk8.tif": "k",
    "cmyk.jpg": "k",
}
#: Read outside Blender only, and in Blender only.
OUTSIDE = {"gray16.pgm": "16", "gray16_text.pgm": "16"}
BLENDER = {
    "rgb16_planes.tif": "16",
    "gray_alpha16.tif": "16",
    "rgb_float32.tif": "16",
    "cmyk16.tif": "16",
}


def find_brightness(name):
    """Return the brightness of a picture, of 65535, the upper row first; what is clear is black."""
    weights = (1.0, 0.0, 0.0) if name.startswith(("gray", "palette")) else (0.299, 0.587, 0.114)
    bright = sum(weight * channel for weight, channel in zip(weights, COLORS, strict=True))
    return np.asarray(bright * (ALPHA if "alpha" in name or "rgba" in name else 1.0))


def measure_error(name, read):
    """Return the largest error of a picture as read, the lowest row first and of any scale, of 65535."""
    known = find_brightness(name)
    found = np.asarray(read, np.float64)[::-1]
    assert found.shape == known.shape
    return float(np.abs(found * (known.max() / found.max()) - known).max())


#: A letter, and how the pixels of each orientation lie in the file.
UPRIGHT = np.array([[9, 9, 9, 9], [9, 1, 1, 1], [9, 9, 9, 1], [9, 1, 1, 1], [9, 1, 1, 1]])
STORED = {
    1: UPRIGHT, 2: UPRIGHT[:, ::-1], 3: UPRIGHT[::-1, ::-1], 4: UPRIGHT[::-1],
    5: UPRIGHT.T, 6: np.rot90(UPRIGHT), 7: UPRIGHT[::-1, ::-1].T, 8: np.rot90(UPRIGHT, -1),
}  # fmt: skip


def write_turned(path, orientation):
    """Write the letter as a camera does that was held so."""
    pixels = np.kron(STORED[orientation] * 20, np.ones((8, 8))).astype(np.uint8)
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(pixels).save(path, exif=exif, quality=100)


def write_geotiff(path, kind, absent, *, big=False):
    """Write a slope from -40 to 900 m whose left half has no data, as GDAL marks it; return the heights."""
    heights = np.tile(np.linspace(-40.0, 900.0, 12), (10, 1)).astype(kind)
    heights[:, :6] = float(absent)
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags[42113], tags.tagtype[42113] = absent, 2
    tags[339], tags.tagtype[339] = {"f": 3, "i": 2, "u": 1}[kind[0]], 3
    mode = {"f4": "F", "i2": "I;16", "u2": "I;16", "i4": "I"}[kind]
    Image.frombytes(mode, (12, 10), heights.tobytes()).save(path, tiffinfo=tags, big_tiff=big)
    assert path.read_bytes()[2] == 42 + big
    return heights


NO_DATA = [
    ("f4", "-9999"),
    ("f4", "nan"),
    ("f4", "-3.4028234663852886e+38"),
    ("i2", "-32768"),
    ("i2", "0"),
    ("u2", "65535"),
    ("i4", "-2147483648"),
]
