"""The size of a picture from its head: as Pillow has it, and refused before anything is unpacked."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.shapes.heightmap import read_pixels, read_size
from PIL import Image


def exr(width: int, height: int) -> bytes:
    """Return the head of an EXR."""
    window = struct.pack("<4i", -5, 3, width - 6, height + 2)
    return b"\x76\x2f\x31\x01\x02\0\0\0dataWindow\0box2i\0" + struct.pack("<I", 16) + window


def hdr(width: int, height: int) -> bytes:
    """Return the head of an HDR."""
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.bmp", "a.tif"])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_the_size_is_the_one_pillow_finds(tmp_path: Path, name: str, mode: str) -> None:
    Image.new(mode, (37, 21)).save(tmp_path / name)
    assert read_size(tmp_path / name) == (37, 21)


def test_a_jpeg_with_other_segments_before_its_size_is_measured(tmp_path: Path) -> None:
    Image.new("RGB", (37, 21)).save(tmp_path / "a.jpg", exif=b"Exif\0\0" + bytes(60_000), progressive=True)
    assert read_size(tmp_path / "a.jpg") == (37, 21)


@pytest.mark.parametrize(("name", "head"), [("a.exr", exr(37, 21)), ("a.hdr", hdr(37, 21))])
def test_pictures_only_blender_reads_are_measured(tmp_path: Path, name: str, head: bytes) -> None:
    (tmp_path / name).write_bytes(head)
    assert read_size(tmp_path / name) == (37, 21)


@pytest.mark.parametrize(
    "content",
    [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"II*\0\xff\xff\xff\x7f", b"\x76\x2f\x31\x01",
     b"#?RADIANCE\n", b"BM"],
)  # fmt: skip
def test_a_head_that_does_not_tell_is_no_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.png").write_bytes(content)
    assert read_size(tmp_path / "a.png") is None


@pytest.mark.parametrize(
    ("name", "head"), [("a.exr", exr(2**31 - 1, 40_000)), ("a.hdr", hdr(10**18 - 1, 10**18 - 1))]
)
def test_a_picture_of_huge_dimensions_is_refused_by_its_head(tmp_path: Path, name: str, head: bytes) -> None:
    (tmp_path / name).write_bytes(head)
    with pytest.raises(ParameterError, match="must have at most 128 million pixels"):
        read_pixels(tmp_path / name)


def test_a_file_of_another_kind_is_not_opened_by_its_ending(tmp_path: Path) -> None:
    # Pillow hands PostScript over to another program.
    (tmp_path / "a.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\n")
    with pytest.raises(ParameterError, match="not a picture, or cut off"):
        read_pixels(tmp_path / "a.png")
