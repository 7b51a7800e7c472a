"""Height maps: means over the squares of pins; pictures and grids as other programs write them."""

import re
import struct
import zlib

import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.shapes import heightmap
from digiclay.core.shapes.heightmap import (
    average_blocks,
    make_height_map,
    read_grid,
    read_head,
    read_pixels,
)
from digiclay.core.shapes.request import Placement
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from tests import pictures
from tests.assemble import assert_near, table

PITCH = 3e-3


def middle(rows, columns, factor):
    """Return where a map lies whose middle is the bed's."""
    return Placement(factor, factor, -columns / 2 * factor, -rows / 2 * factor)


ROW, COLUMN = np.indices((72, 72))
PIXELS = np.random.default_rng(2).uniform(0.0, 1.0, (5, 7))


@table(
    "values, rows, columns, pixel, wanted",
    {
        "a pixel for every pin is its own": (PIXELS, 5, 7, PITCH, lambda x, y: PIXELS.ravel()),
        "between pixels a plane is one": (
            (2.0 * ROW - COLUMN)[:20, :30],
            9,
            13,
            2.1e-3,
            lambda x, y: 2.0 * (y / 2.1e-3 + 9.5) - (x / 2.1e-3 + 14.5),
        ),
        # Eight by eight pixels to a pin, one of them white.
        "a fine map is averaged over the square of a pin": (
            (ROW % 8 == 1) & (COLUMN % 8 == 6),
            9,
            9,
            PITCH / 8,
            lambda x, y: np.full(x.size, 1 / 64),
        ),
        "pins beside the map are not covered": (
            np.ones((3, 3)),
            9,
            9,
            PITCH,
            lambda x, y: np.where(np.maximum(np.abs(x), np.abs(y)) < 4e-3, 1.0, np.nan),
        ),
    },
)
def test_a_map_gives_each_pin_the_mean_over_its_square(values, rows, columns, pixel, wanted):
    bed = make_grid(Layout(rows, columns, PITCH))
    found = make_height_map("x", values).tops(bed, middle(*values.shape, pixel))
    known = wanted(bed.x, bed.y)
    np.testing.assert_array_equal(found.covered, np.isfinite(known))
    # Rounding of numbers up to 60.
    assert_near(found.value[found.covered], known[found.covered], 1e-10)


@given(st.integers(2, 40), st.integers(2, 40), st.integers(1, 9), st.integers(1, 200))
def test_means_keep_the_sum(rows, columns, block, chunk):
    values = np.random.default_rng(block).uniform(-1.0, 1.0, (rows, columns))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(heightmap, "CHUNK", chunk)
        means = average_blocks(values, block)
    tall = np.diff([*range(0, rows, block), rows])
    wide = np.diff([*range(0, columns, block), columns])
    assert means.shape == (len(tall), len(wide))
    assert np.sum(means * tall[:, None] * wide) == pytest.approx(values.sum(), abs=1e-9)


@pytest.mark.parametrize(
    "values, said",
    [
        (np.zeros((1, 9)), "at least 2 x 2 heights (got odd.npy: 1 x 9)"),
        (np.zeros(9), "at least 2 x 2 heights (got odd.npy: 9)"),
        (np.zeros((2, 2, 3)), "at least 2 x 2 heights (got odd.npy: 2 x 2 x 3)"),
        (np.zeros(()), "at least 2 x 2 heights (got odd.npy: a single number)"),
        (np.array([["a", "b"], ["c", "d"]]), "hold numbers (got odd.npy: <U1)"),
        (np.zeros((2, 2), complex), "hold numbers (got odd.npy: complex128)"),
        (
            np.array([[0.0, 1.0], [np.nan, 2.0]]),
            "numbers only, of at most 1e+60 (got odd.npy: nan at 1, 0)",
        ),
        (np.array([[0.0, 1.0], [2.0, -1e308]]), "of at most 1e+60 (got odd.npy: -1e+308 at 1, 1)"),
    ],
)
def test_what_is_no_map_is_refused(values, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        make_height_map("odd.npy", values)


@pytest.mark.parametrize("bits, kind", [(8, np.uint8), (16, np.uint16)])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_a_picture_is_read_as_it_was_written(tmp_path, bits, kind, ending):
    values = np.random.default_rng(bits).integers(0, 2**bits, (11, 7)).astype(kind)
    path = tmp_path / f"grün und weiß.{ending}"
    Image.fromarray(values).save(path)
    assert np.array_equal(read_pixels(path), np.flipud(values))
    # By its brightness, where it is colored: red weighs 0.299 of 255, as in the television
    # standard.
    Image.fromarray(np.array([[[255] * 3] * 2, [[0] * 3, [255, 0, 0]]], np.uint8)).save(path)
    assert_near(read_pixels(path), [[0, 76.245], [255, 255]], 1e-4)  # 24 bits of 255


@pytest.mark.parametrize("name", [*pictures.READ, *pictures.OUTSIDE])
def test_every_kind_of_picture_is_read_in_all_its_bits_and_what_is_clear_is_black(name):
    step = pictures.STEPS[{**pictures.READ, **pictures.OUTSIDE}[name]]
    assert pictures.measure_error(name, read_pixels(pictures.FOLDER / name)) <= step


@pytest.mark.parametrize("mode", ["P", "L", "RGB", "1"])
def test_a_color_that_is_clear_by_itself_is_black_and_nothing_is_warned_of(tmp_path, mode, recwarn):
    levels = Image.fromarray(np.array([[255, 0], [0, 255]], np.uint8))
    clear = {"P": bytes([255] * 255 + [0]), "L": 255, "RGB": (255, 255, 255), "1": 1}[mode]
    levels.convert(mode).save(tmp_path / "a.png", transparency=clear)
    assert not read_pixels(tmp_path / "a.png").any()
    assert not recwarn.list


@pytest.mark.parametrize("bits, kind", [(1, 0), (2, 0), (4, 0), (8, 0), (16, 0), (8, 2), (16, 2)])
def test_a_color_of_any_bits_that_is_clear_is_black(tmp_path, bits, kind):
    # Two rows of the color that is clear, white, and half of it, as the standard has them.
    half, white, channels = 2 ** (bits - 1), 2**bits - 1, kind + 1
    row = "0" * 8 + 2 * "".join(f"{level:0{bits}b}" * channels for level in (white, half))
    row = row.ljust(8 * -(-len(row) // 8), "0")
    data = bytes(int((2 * row)[at : at + 8], 2) for at in range(0, 2 * len(row), 8))
    chunks = {
        b"IHDR": struct.pack(">IIBBBBB", 4, 2, bits, kind, 0, 0, 0),
        b"tRNS": struct.pack(f">{channels}H", *[white] * channels),
        b"IDAT": zlib.compress(data),
        b"IEND": b"",
    }
    (tmp_path / "a.png").write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + b"".join(
            struct.pack(">I", len(part)) + name + part + struct.pack(">I", zlib.crc32(name + part))
            for name, part in chunks.items()
        )
    )
    shown = read_pixels(tmp_path / "a.png") / (1 if bits == 1 else 65535 if bits == 16 else 255)
    assert_near(shown, [[0, half / white * (bits > 1)] * 2] * 2, 1e-7)


@pytest.mark.parametrize(
    "name, said",
    [
        ("rgb16_planes.tif", "if these have more than 8 bits (got {}: separate planes)"),
        ("gray16_white_is_zero.tif", "if these have more than 8 bits (got {}: 0 is white)"),
        ("gray_alpha16.tif", "(got {}: a TIFF of 2 channels of 16 bits, unknown to Pillow)"),
        ("rgb_float32.tif", "(got {}: a TIFF of 3 channels of 32 bits, unknown to Pillow)"),
        ("cmyk16.tif", "(got {}: CMYK of 16 bits)"),
    ],
)
def test_a_kind_of_picture_that_would_be_read_wrong_is_refused_with_its_cause(name, said):
    path = pictures.FOLDER / name
    with pytest.raises(ParameterError, match=re.escape(said.format(path))):
        read_pixels(path)


@pytest.mark.parametrize("orientation", pictures.STORED)
@pytest.mark.parametrize("ending", ["jpg", "png", "tif"])
def test_a_picture_stands_as_its_exif_data_say(tmp_path, ending, orientation):
    path = tmp_path / f"a.{ending}"
    pictures.write_turned(path, orientation)
    seen = read_pixels(path)[::-1][4::8, 4::8] / 20
    assert_near(seen, pictures.UPRIGHT, 0.2)  # what a JPEG leaves


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("kind, absent", pictures.NO_DATA)
def test_what_a_geotiff_has_no_data_of_is_no_part_of_the_shape(tmp_path, kind, absent, big):
    known = pictures.write_geotiff(tmp_path / "dem.tif", kind, absent, big=big)
    read = read_pixels(tmp_path / "dem.tif")
    assert np.array_equal(np.ma.getmaskarray(read), np.tile(np.arange(12) < 6, (10, 1)))
    assert np.array_equal(read[:, 6:], known[::-1, 6:])


ESRI = "ncols 4\nnrows 3\nxllcorner 5e5\nyllcorner 5.3e6\ncellsize 20\nNODATA_value -9999\n"
NORTH_UP = "1 2 3 4\n5 -9999 7 8\n9 10 11 12\n"
KNOWN = np.ma.masked_equal([[9, 10, 11, 12], [5, -9999, 7, 8], [1, 2, 3, 4]], -9999)


@pytest.mark.parametrize(
    "name, text, known",
    [
        ("a.asc", ESRI + NORTH_UP, KNOWN),
        ("a.asc", "\ufeff" + (ESRI + NORTH_UP).replace("\n", "\r\n").replace(" ", "\t"), KNOWN),
        ("a.asc", ESRI.upper().replace("NODATA_VALUE -9999\n", "") + NORTH_UP, KNOWN),
        ("a.asc", (ESRI + NORTH_UP).replace("cellsize 20", "dx 20\ndy 20"), KNOWN),
        ("a.ASC", ESRI + "1 2\n3 4\n5 -9999\n7 8\n9 10\n11 12", KNOWN),
        ("a.txt", "# in m\n1 2.5 3e0\n4 5 6", [[1, 2.5, 3], [4, 5, 6]]),
        # As Octave saves a matrix; as numpy does, with a header.
        ("a.txt", "# Created by Octave 8.4.0, Mon\n# rows: 2\n 1 2\n 3 4\n", [[1, 2], [3, 4]]),
        ("a.csv", "# in m; north is up\n1,2\n3,4\n", [[1, 2], [3, 4]]),
        ("a.csv", "1, 2.5, 3\n4, 5, 6\n\n", [[1, 2.5, 3], [4, 5, 6]]),
        ("a.csv", "1;2,5;3\n4;5;6\n", [[1, 2.5, 3], [4, 5, 6]]),
        ("a.txt", "1\t2,5\t3\n4\t5\t6\n", [[1, 2.5, 3], [4, 5, 6]]),
    ],
)
def test_a_grid_of_numbers_is_read_as_its_program_writes_it(tmp_path, name, text, known):
    (tmp_path / name).write_text(text, encoding="utf-8", newline="")
    read = read_grid(tmp_path / name)
    known = np.ma.array(known)
    assert np.array_equal(read.values, np.ma.filled(known, 0.0))
    assert (read.share is None) == (np.ma.count_masked(known) == 0)
    assert read.length == (20.0 if name.lower() == "a.asc" else None)


@pytest.mark.parametrize(
    "name, text, said",
    [
        ("a.asc", NORTH_UP, "(got a.asc: no 'nrows' in its head, as an Esri ASCII grid has it)"),
        (
            "a.asc",
            ESRI + NORTH_UP[8:],
            "(got a.asc: cannot reshape array of size 8 into shape (3,4))",
        ),
        (
            "a.asc",
            (ESRI + NORTH_UP).replace("cellsize 20", "dx 20\ndy 30"),
            "(got a.asc: its cells are 20 x 30, not square)",
        ),
        ("a.txt", "", "(got a.txt: loadtxt: input contained no data"),
        ("a.txt", "1 2\n3", "(got a.txt: the number of columns changed from 2 to 1 at row 2)"),
        (
            "a.csv",
            "x,y\n1,2\n",
            "(got a.csv: could not convert string 'x' to float64 at row 0, column 1.)",
        ),
        ("a.csv", "1,,2\n1,2,3\n", "could not convert string '' to float64 at row 0, column 2.)"),
        (
            "a.csv",
            "1 2\n3 nan\n",
            "must hold finite numbers only, of at most 1e+60 (got a.csv: nan at 1, 1)",
        ),
        (
            "a.txt",
            "1 2 3\n" * 100,
            "must be a grid of heights, not a list of points (got a.txt: 100 rows of 3",
        ),
    ],
)
def test_a_text_that_is_no_grid_is_refused_with_its_row(tmp_path, name, text, said):
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=re.escape(said)):
        read_grid(tmp_path / name)


def test_a_large_picture_is_taken_in_means_and_one_of_too_many_pixels_refused_before_it_is_read(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 60)  # of more Pillow warns
    monkeypatch.setattr(heightmap, "MOST_VALUES", 30)
    path = tmp_path / "large.png"
    Image.new("L", (10, 10), 7).save(path)
    found = make_height_map(path.name, read_pixels(path))
    assert found.pixels == (10, 10)
    np.testing.assert_array_equal(found.values, np.full((5, 5), 7.0))
    # A head that says 15 000 x 10 000 pixels, and no pixels at all; Pillow itself would open it.
    path = tmp_path / "huge.png"
    Image.new("L", (2, 2)).save(path)
    data = bytearray(path.read_bytes())
    data[16:24] = (15_000).to_bytes(4, "big") + (10_000).to_bytes(4, "big")
    data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    path.write_bytes(bytes(data))
    with pytest.raises(ParameterError, match="must have at most 128 million pixels"):
        read_pixels(path)


def exr(width, height):
    window = struct.pack("<4i", -5, 3, width - 6, height + 2)
    return b"\x76\x2f\x31\x01\x02\0\0\0dataWindow\0box2i\0" + struct.pack("<I", 16) + window


def hdr(width, height):
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.bmp", "a.tif"])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_the_size_is_the_one_pillow_finds_and_that_of_pictures_only_blender_reads(
    tmp_path, name, mode
):
    Image.new(mode, (37, 21)).save(tmp_path / name)
    assert read_head(tmp_path / name).size == (37, 21)
    # A JPEG with other segments before its size.
    Image.new("RGB", (37, 21)).save(
        tmp_path / "b.jpg", exif=b"Exif\0\0" + bytes(60_000), progressive=True
    )
    (tmp_path / "b.exr").write_bytes(exr(37, 21))
    (tmp_path / "b.hdr").write_bytes(hdr(37, 21))
    assert {read_head(tmp_path / f"b.{kind}").size for kind in ("jpg", "exr", "hdr")} == {(37, 21)}


PNG = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x63\0\0\0\x63\x08\0\0\0\0"


@pytest.mark.parametrize(
    "name, content, said",
    [
        ("half.png", PNG, r"must be a picture that can be read \(got .*half\.png: "),
        ("absent.exr", b"", "Blender itself reads EXR"),
        ("huge.exr", exr(2**31 - 1, 40_000), "must have at most 128 million pixels"),
        ("huge.hdr", hdr(10**18 - 1, 10**18 - 1), "must have at most 128 million pixels"),
        # Pillow hands PostScript over to another program: no ending opens a file of another kind.
        (
            "a.png",
            b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n",
            "not a picture, or cut off",
        ),
    ],
)
def test_what_is_no_picture_or_a_huge_one_is_refused(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ParameterError, match=said):
        read_pixels(tmp_path / name)


def test_a_head_that_does_not_tell_is_no_error(tmp_path):
    heads = [
        b"",
        b"GIF89a",
        b"\x89PNG\r\n\x1a\n",
        b"\xff\xd8\xff",
        b"II*\0\xff\xff\xff\x7f",
        b"\x76\x2f\x31\x01",
    ]
    for content in (*heads, b"#?RADIANCE\n", b"BM"):
        (tmp_path / "a.png").write_bytes(content)
        assert read_head(tmp_path / "a.png").size is None, content
