"""Maps of heights: means, places between pixels, pictures, their sizes by their heads, and what is none."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.shapes import heightmap
from digiclay.core.shapes.heightmap import average_blocks, make_height_map, read_pixels, read_size
from digiclay.core.shapes.request import Placement
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

PITCH = 3e-3


def middle(rows: int, columns: int, factor: float) -> Placement:
    """Return where a map lies whose middle is the bed's."""
    return Placement(factor, factor, -columns / 2 * factor, -rows / 2 * factor)


def test_a_map_with_a_pixel_for_every_pin_gives_every_pin_its_pixel() -> None:
    values = np.random.default_rng(2).uniform(0.0, 1.0, (5, 7))
    found = make_height_map("x", values).tops(make_grid(Layout(5, 7, PITCH)), middle(5, 7, PITCH))
    assert np.abs(found.value - values.ravel()).max() < 1e-12  # places between 0 and 7, rounded
    assert found.covered.all()


def test_a_plane_stays_a_plane_between_the_pixels() -> None:
    row, column = np.mgrid[0:20, 0:30]
    found = make_height_map("x", 2.0 * row - column).tops(
        make_grid(Layout(9, 13, PITCH)), middle(20, 30, 2.1e-3)
    )
    bed = make_grid(Layout(9, 13, PITCH))
    wanted = 2.0 * (bed.y / 2.1e-3 + 9.5) - (bed.x / 2.1e-3 + 14.5)
    assert np.abs(found.value - wanted).max() < 1e-10  # rounding of numbers up to 60


def test_a_fine_map_is_averaged_over_the_square_of_a_pin() -> None:
    # Eight by eight pixels to a pin, one of them white: every pin sees their mean.
    row, column = np.indices((72, 72)) % 8
    found = make_height_map("x", (row == 1) & (column == 6)).tops(
        make_grid(Layout(9, 9, PITCH)), middle(72, 72, PITCH / 8)
    )
    assert np.abs(found.value - 1 / 64).max() < 1e-12


def test_pins_beside_the_map_are_not_covered() -> None:
    found = make_height_map("x", np.ones((3, 3))).tops(make_grid(Layout(9, 9, PITCH)), middle(3, 3, PITCH))
    np.testing.assert_array_equal(np.argwhere(found.covered.reshape(9, 9)), np.argwhere(np.ones((3, 3))) + 3)


@given(
    st.integers(2, 40), st.integers(2, 40), st.integers(1, 9), st.integers(1, 200), st.integers(0, 2**32 - 1)
)
def test_means_keep_the_sum(rows: int, columns: int, block: int, chunk: int, seed: int) -> None:
    values = np.random.default_rng(seed).uniform(-1.0, 1.0, (rows, columns))
    kept = heightmap.CHUNK
    try:
        heightmap.CHUNK = chunk
        means = average_blocks(values, block)
    finally:
        heightmap.CHUNK = kept
    tall = np.diff([*range(0, rows, block), rows])
    wide = np.diff([*range(0, columns, block), columns])
    assert means.shape == (len(tall), len(wide))
    assert np.sum(means * tall[:, None] * wide) == pytest.approx(values.sum(), abs=1e-9)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.zeros((1, 1)), "at least 2 x 2 heights (got odd.npy: 1 x 1)"),
        (np.zeros((1, 9)), "at least 2 x 2 heights (got odd.npy: 1 x 9)"),
        (np.zeros(9), "at least 2 x 2 heights (got odd.npy: 9)"),
        (np.zeros((2, 2, 3)), "at least 2 x 2 heights (got odd.npy: 2 x 2 x 3)"),
        (np.zeros(()), "at least 2 x 2 heights (got odd.npy: a single number)"),
        (np.array([["a", "b"], ["c", "d"]]), "hold numbers (got odd.npy: <U1)"),
        (np.zeros((2, 2), complex), "hold numbers (got odd.npy: complex128)"),
        (np.array([[0.0, 1.0], [np.nan, 2.0]]), "finite numbers only (got odd.npy: nan at 1, 0)"),
        (np.array([[0.0, np.inf], [1.0, 2.0]]), "finite numbers only (got odd.npy: inf at 0, 1)"),
    ],
)
def test_what_is_no_map_is_refused(values: np.ndarray, said: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(said)):
        make_height_map("odd.npy", values)


# Pictures


@pytest.mark.parametrize(("bits", "kind"), [(8, np.uint8), (16, np.uint16)])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_a_picture_is_read_as_it_was_written(tmp_path: Path, bits: int, kind: type, ending: str) -> None:
    values = np.random.default_rng(bits).integers(0, 2**bits, (11, 7)).astype(kind)
    path = tmp_path / f"grün und weiß.{ending}"
    Image.fromarray(values).save(path)
    assert np.array_equal(read_pixels(path), np.flipud(values))
    # By its brightness, where it is colored: red weighs 0.299 of 255, as in the television standard.
    Image.fromarray(np.array([[[255] * 3] * 2, [[0] * 3, [255, 0, 0]]], np.uint8)).save(path)
    assert read_pixels(path).tolist() == [[0, 76], [255, 255]]


def test_a_picture_of_a_hundred_megapixels_is_taken(tmp_path: Path) -> None:
    path = tmp_path / "large.png"
    Image.new("L", (10_000, 10_000), 7).save(path, compress_level=1)
    found = make_height_map(path.name, read_pixels(path))
    assert found.pixels == (10_000, 10_000)
    assert found.values.size <= heightmap.KEPT
    assert np.all(found.values == 7.0)


def test_a_picture_of_more_is_refused_before_it_is_read(tmp_path: Path) -> None:
    # A head that says 15 000 x 10 000 pixels, and no pixels at all; Pillow itself would open it.
    path = tmp_path / "huge.png"
    Image.new("L", (2, 2)).save(path)
    data = bytearray(path.read_bytes())
    data[16:24] = (15_000).to_bytes(4, "big") + (10_000).to_bytes(4, "big")
    import zlib

    data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    path.write_bytes(bytes(data))
    with pytest.raises(ParameterError, match="must have at most 128 million pixels"):
        read_pixels(path)


def exr(width: int, height: int) -> bytes:
    """Return the head of an EXR."""
    window = struct.pack("<4i", -5, 3, width - 6, height + 2)
    return b"\x76\x2f\x31\x01\x02\0\0\0dataWindow\0box2i\0" + struct.pack("<I", 16) + window


def hdr(width: int, height: int) -> bytes:
    """Return the head of an HDR."""
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.bmp", "a.tif"])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_the_size_is_the_one_pillow_finds_and_that_of_pictures_only_blender_reads(tmp_path, name, mode):
    Image.new(mode, (37, 21)).save(tmp_path / name)
    assert read_size(tmp_path / name) == (37, 21)
    # A JPEG with other segments before its size.
    Image.new("RGB", (37, 21)).save(tmp_path / "b.jpg", exif=b"Exif\0\0" + bytes(60_000), progressive=True)
    (tmp_path / "b.exr").write_bytes(exr(37, 21))
    (tmp_path / "b.hdr").write_bytes(hdr(37, 21))
    assert {read_size(tmp_path / f"b.{kind}") for kind in ("jpg", "exr", "hdr")} == {(37, 21)}


PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x63\0\0\0\x63\x08\0\0\0\0"


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("half.png", PNG, r"must be a picture that can be read \(got .*half\.png: "),
        ("absent.exr", b"", "Blender itself reads EXR"),
        ("huge.exr", exr(2**31 - 1, 40_000), "must have at most 128 million pixels"),
        ("huge.hdr", hdr(10**18 - 1, 10**18 - 1), "must have at most 128 million pixels"),
        # Pillow hands PostScript over to another program: no ending opens a file of another kind.
        ("a.png", b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n", "not a picture, or cut off"),
    ],
)
def test_what_is_no_picture_or_a_huge_one_is_refused(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ParameterError, match=said):
        read_pixels(tmp_path / name)


@pytest.mark.parametrize(
    "content",
    [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"II*\0\xff\xff\xff\x7f", b"\x76\x2f\x31\x01",
     b"#?RADIANCE\n", b"BM"],
)  # fmt: skip
def test_a_head_that_does_not_tell_is_no_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.png").write_bytes(content)
    assert read_size(tmp_path / "a.png") is None
