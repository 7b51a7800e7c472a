"""Shapes and maps of heights laid onto beds: plan, height, what is clipped or refused; sizes of pictures."""

import re
import struct
import zlib
from typing import Any

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.model.actuator import Actuator
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.shapes import heightmap
from digiclay.core.shapes.fitting import Fitted, fit_given, fit_relief, pack, unpack
from digiclay.core.shapes.heightmap import average_blocks, make_height_map, read_pixels, read_size
from digiclay.core.shapes.mesh_relief import make_shape_mesh
from digiclay.core.shapes.request import Placement, Shape
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

REST, STROKE = Actuator().rest_height, Actuator().stroke
BED = make_grid(Layout(13, 25, 3e-3))
#: Heights of up to 0.1 m in 64 bits, after a few sums.
ROUNDING = 1e-12


def mesh(solid: trimesh.Trimesh) -> Any:
    return make_shape_mesh("solid.stl", solid.vertices, solid.faces, "z", 1e-3)


def laid(what: Any, bed: Any = BED, **known: Any) -> Fitted:
    return fit_relief(Shape(**known), what, bed, Actuator())


def box(wide: float, deep: float, high: float) -> Any:
    solid = trimesh.creation.box((wide, deep, high))
    solid.apply_translation((70.0, -30.0, high / 2))  # wherever it stands, it is centered
    return mesh(solid)


def table(cells: Fitted) -> np.ndarray:
    """Return heights above rest, mm, row by row."""
    return np.round((cells.heights.reshape(13, 25) - REST) * 1e3, 9)


@pytest.mark.parametrize(
    ("size", "known", "rows", "columns"),
    [
        # 39 mm are the shorter side; a square box takes 13 x 13 cells.
        pytest.param((10, 10, 5), {}, range(13), range(6, 19), id="contained it keeps its proportions"),
        # Pins 3 mm apart within +- 15.25 mm and +- 6.25 mm.
        pytest.param((30.5, 12.5, 5), {"fit": "actual"}, range(4, 9), range(7, 18), id="in its own size"),
        # 5 mm wide about (9, -6) mm: one pin, and none of its neighbors 3 mm away.
        pytest.param(
            (10, 10, 5), {"fit": "actual", "scale": 0.5, "x": 9e-3, "y": -6e-3}, [4], [15], id="scaled, moved"
        ),
    ],
)
def test_a_fit_says_where_the_shape_lies_in_plan(size, known, rows, columns):
    raised = table(laid(box(*size), **known)) > 0
    assert np.argwhere(raised).tolist() == [[row, column] for row in rows for column in columns]


BALL = trimesh.creation.icosphere(radius=10.0)
SLOPE = make_height_map("x.npy", np.linspace(0.0, 7e-3, 12).reshape(3, 4), 1.0)


@pytest.mark.parametrize(
    ("what", "known", "low", "high"),
    [
        (mesh(BALL), {"rise": 15e-3, "foot": 2e-3}, 42e-3, 57e-3),
        (mesh(BALL), {"rise": 4e-3, "foot": 2e-3}, 42e-3, 46e-3),
        (mesh(BALL), {"rise": -12e-3, "foot": 2e-3}, 30e-3, 42e-3),
        (mesh(BALL), {"relief": "stroke"}, REST, STROKE),
        (box(10, 10, 5), {"relief": "true"}, REST, 59.5e-3),  # 10 mm become 39 mm, 5 mm become 19.5 mm
        (SLOPE, {"relief": "true", "fit": "stretch"}, REST, 47e-3),
    ],
)
def test_the_relief_goes_from_the_foot_over_the_rise_to_the_strokes_end_or_is_true(what, known, low, high):
    cells = laid(what, **known)
    assert (cells.heights.min(), cells.heights.max()) == pytest.approx((low, high), abs=ROUNDING)
    assert cells.too_low + cells.too_high == 0


def test_placed_a_shape_stands_where_it_says_and_heights_of_a_scene_as_they_are():
    solid = trimesh.creation.box((12.5, 12.5, 10.0))
    solid.apply_translation((9.0, -6.0, 48.0))
    raised = table(laid(mesh(solid), fit="placed"))
    assert set(np.unique(raised).tolist()) == {0.0, 13.0}  # its top is at 53 mm, the bed at 40 mm
    row, column = np.nonzero(raised)
    assert (row.min(), row.max(), column.min(), column.max()) == (2, 6, 13, 17)
    heights = np.linspace(-1e-3, 0.11, BED.count)
    # 32 bits: half of 2^-24 of 0.1 m at most.
    assert np.abs(unpack(pack(heights), BED) - heights).max() <= 4e-9
    cells = fit_given(Shape(file="Suzanne", heights=pack(heights)), BED, Actuator())
    assert np.abs(cells.heights - np.clip(heights, 0.0, STROKE)).max() <= 4e-9
    assert cells.too_low == np.count_nonzero(heights < -1e-9) > 0
    assert cells.describe().startswith("Suzanne: heights from 0.0 to 100.0 mm")


def test_what_leaves_the_stroke_is_clipped_and_counted_and_overhangs_are_told():
    row = np.linspace(0.0, 1.0, 25)
    cells = laid(make_height_map("ramp.png", np.tile(row, (13, 1))), fit="stretch", foot=-50e-3, rise=120e-3)
    wanted = REST - 50e-3 + 120e-3 * row
    assert cells.too_low == 13 * np.count_nonzero(wanted < -1e-9) > 0
    assert cells.too_high == 13 * np.count_nonzero(wanted > STROKE + 1e-9) > 0
    assert cells.heights.min() == 0.0
    assert cells.heights.max() == STROKE
    assert cells.describe() == (
        "ramp.png: heights from 0.0 to 100.0 mm, covers all cells, "
        f"{cells.too_low + cells.too_high} cells clipped ({cells.too_low} at the floor, "
        f"{cells.too_high} at the stroke's end)"
    )
    ring = trimesh.creation.torus(10.0, 3.0)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    cells = laid(mesh(ring))
    assert cells.overhanging > 0
    assert cells.describe() == (
        f"solid.stl: heights from 40.0 to 55.0 mm, covers {cells.covered} of 325 cells, no cell clipped, "
        f"overhangs under the top at {cells.overhanging} cells"
    )


@pytest.mark.parametrize("fit", ["stretch", "cover"])
@pytest.mark.parametrize("arrangement", ["aligned", "staggered", "hexagonal"])
def test_a_bed_is_covered_by_a_stretched_picture(arrangement, fit):
    bed = make_grid(Layout(7, 9, 3e-3, arrangement))
    cells = laid(make_height_map("gray.png", np.full((4, 4), 99)), bed, fit=fit)
    assert cells.covered == bed.count
    assert np.all(cells.heights == REST)  # level as the picture


PICTURE, ARRAY = make_height_map("x.png", np.eye(3)), make_height_map("x.npy", np.eye(3), 1.0)
LINE = make_shape_mesh(
    "l.stl", np.array([[0.0, 0, 0], [9, 0, 0], [4, 0, 5]]), np.array([[0, 1, 2]]), "z", 1e-3
)
BESIDE = (
    "shape.x, y must leave the shape over the bed (got solid.stl: no pin lies under it). Set shape.fit to"
)


@pytest.mark.parametrize(
    ("what", "known", "said"),
    [
        (box(10, 10, 5), {"fit": "actual", "x": 1.0}, BESIDE),
        (box(10, 10, 5), {"fit": "placed"}, BESIDE),
        (PICTURE, {"fit": "actual"}, "its pixels have no length (got 'actual' for x.png)"),
        (ARRAY, {"fit": "placed"}, "its pixels have no length (got 'placed' for x.npy)"),
        (PICTURE, {"relief": "true"}, "its values are no lengths (got 'true' for x.png)"),
        (LINE, {}, "must be wider than a line or a point, seen from above (got l.stl: 9 x 0)"),
    ],
)
def test_what_cannot_be_laid_onto_the_bed_is_refused(what, known, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        laid(what, **known)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rubbish!", "must be heights packed as text (got 'rubbish!')"),
        ("AAAA", "must be heights packed as text (got 'AAAA')"),
        (pack(np.arange(325.0))[:40], "must be heights packed as text"),
        (pack(np.ones(7)), "must hold the heights of the bed's 13 x 25 cells (got 7 heights)"),
        (pack(np.ones(10**6)), "of the bed's 13 x 25 cells (got more than 325 heights)"),
        (pack(np.where(np.arange(325) == 9, np.nan, 1.0)), "must be finite numbers (got nan at cell 9)"),
    ],
)
def test_a_text_that_holds_other_heights_is_refused(text, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        unpack(text, BED)


PITCH = 3e-3


def middle(rows: int, columns: int, factor: float) -> Placement:
    """Return where a map lies whose middle is the bed's."""
    return Placement(factor, factor, -columns / 2 * factor, -rows / 2 * factor)


ROW, COLUMN = np.indices((72, 72))
PIXELS = np.random.default_rng(2).uniform(0.0, 1.0, (5, 7))


@pytest.mark.parametrize(
    ("values", "rows", "columns", "pixel", "wanted"),
    [
        pytest.param(PIXELS, 5, 7, PITCH, lambda x, y: PIXELS.ravel(), id="a pixel for every pin is its own"),
        pytest.param(
            (2.0 * ROW - COLUMN)[:20, :30], 9, 13, 2.1e-3,
            lambda x, y: 2.0 * (y / 2.1e-3 + 9.5) - (x / 2.1e-3 + 14.5), id="between pixels a plane is one",
        ),
        # Eight by eight pixels to a pin, one of them white.
        pytest.param(
            (ROW % 8 == 1) & (COLUMN % 8 == 6), 9, 9, PITCH / 8, lambda x, y: np.full(x.size, 1 / 64),
            id="a fine map is averaged over the square of a pin",
        ),
        pytest.param(
            np.ones((3, 3)), 9, 9, PITCH,
            lambda x, y: np.where(np.maximum(np.abs(x), np.abs(y)) < 4e-3, 1.0, np.nan),
            id="pins beside the map are not covered",
        ),
    ],
)  # fmt: skip
def test_a_map_gives_each_pin_the_mean_over_its_square(values, rows, columns, pixel, wanted):
    bed = make_grid(Layout(rows, columns, PITCH))
    found, known = make_height_map("x", values).tops(bed, middle(*values.shape, pixel)), wanted(bed.x, bed.y)
    np.testing.assert_array_equal(found.covered, np.isfinite(known))
    assert np.abs(found.value - known)[found.covered].max() < 1e-10  # rounding of numbers up to 60


@given(
    st.integers(2, 40), st.integers(2, 40), st.integers(1, 9), st.integers(1, 200), st.integers(0, 2**32 - 1)
)
def test_means_keep_the_sum(rows, columns, block, chunk, seed):
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
def test_what_is_no_map_is_refused(values, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        make_height_map("odd.npy", values)


@pytest.mark.parametrize(("bits", "kind"), [(8, np.uint8), (16, np.uint16)])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_a_picture_is_read_as_it_was_written(tmp_path, bits, kind, ending):
    values = np.random.default_rng(bits).integers(0, 2**bits, (11, 7)).astype(kind)
    path = tmp_path / f"grün und weiß.{ending}"
    Image.fromarray(values).save(path)
    assert np.array_equal(read_pixels(path), np.flipud(values))
    # By its brightness, where it is colored: red weighs 0.299 of 255, as in the television standard.
    Image.fromarray(np.array([[[255] * 3] * 2, [[0] * 3, [255, 0, 0]]], np.uint8)).save(path)
    assert read_pixels(path).tolist() == [[0, 76], [255, 255]]


def test_a_picture_of_a_hundred_megapixels_is_taken_and_one_of_more_refused_before_it_is_read(tmp_path):
    path = tmp_path / "large.png"
    Image.new("L", (10_000, 10_000), 7).save(path, compress_level=1)
    found = make_height_map(path.name, read_pixels(path))
    assert found.pixels == (10_000, 10_000)
    assert found.values.size <= heightmap.KEPT
    assert np.all(found.values == 7.0)
    # A head that says 15 000 x 10 000 pixels, and no pixels at all; Pillow itself would open it.
    path = tmp_path / "huge.png"
    Image.new("L", (2, 2)).save(path)
    data = bytearray(path.read_bytes())
    data[16:24] = (15_000).to_bytes(4, "big") + (10_000).to_bytes(4, "big")
    data[29:33] = zlib.crc32(bytes(data[12:29])).to_bytes(4, "big")
    path.write_bytes(bytes(data))
    with pytest.raises(ParameterError, match="must have at most 128 million pixels"):
        read_pixels(path)


def exr(width: int, height: int) -> bytes:
    window = struct.pack("<4i", -5, 3, width - 6, height + 2)
    return b"\x76\x2f\x31\x01\x02\0\0\0dataWindow\0box2i\0" + struct.pack("<I", 16) + window


def hdr(width: int, height: int) -> bytes:
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
        assert read_size(tmp_path / "a.png") is None, content
