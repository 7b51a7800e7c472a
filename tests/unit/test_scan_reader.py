"""STL, PLY and OFF files as many programs write them, and those that would be read wrong."""

import struct

import pytest
from digiclay.core.mesh_io.mesh_reader import read

from tests.mesh_files import assert_refused, put

PLACE = [(0, 0, 0), (4, 0, 0), (4, 3, 1.5), (0, 3, 1.5), (2, 5, 0.25)]
TEXT = "".join("{} {} {}\n".format(*place) for place in PLACE)
#: A square and a triangle beside it, which are three triangles.
POLYGONS = [(0, 1, 2, 3), (3, 2, 4)]
CUT = [(0, 1, 2), (0, 2, 3), (3, 2, 4)]
ASCII = "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 5\n" + "".join(
    f"property float {axis}\n" for axis in "xyz"
)
FACES = "element face 2\nproperty list uchar int vertex_indices\nend_header\n"


def binary_ply(order, end, extra):
    """Return a PLY of doubles and lists of unlike lengths, with a number before each list or not."""
    head = ASCII.replace("ascii", f"binary_{'big' if order == '>' else 'little'}_endian").replace(
        "float", "double"
    )
    head += FACES.replace(
        "face 2", f"face 2{chr(10)}property ushort material" if extra else "face 2"
    )
    data = head.replace("\n", end).encode() + b"".join(
        struct.pack(f"{order}3d", *place) for place in PLACE
    )
    for face in POLYGONS:
        data += struct.pack(f"{order}H", 7) if extra else b""
        data += struct.pack(f"{order}B{len(face)}i", len(face), *face)
    return data


def text_stl(faces, name="a"):
    corners = (
        "".join(" vertex {} {} {}\n".format(*PLACE[corner]) for corner in face) for face in faces
    )
    loops = "".join(
        f"facet normal 0 0 1\nouter loop\n{each}endloop\nendfacet\n" for each in corners
    )
    return f"solid {name}\n{loops}endsolid {name}\n"


def binary_stl(count, behind=b"", head=b"by hand"):
    numbers = ((0.0, 0.0, 1.0, *sum((PLACE[corner] for corner in face), ())) for face in CUT)
    return (
        head.ljust(80)
        + struct.pack("<I", count)
        + b"".join(struct.pack("<12fH", *n, 0) for n in numbers)
        + behind
    )


OFF_FACES = "4 0 1 2 3\n3 3 2 4\n"


@pytest.mark.parametrize(
    "name, content",
    [
        ("text.stl", text_stl(CUT)),
        ("upper.stl", text_stl(CUT).upper()),
        ("windows.stl", text_stl(CUT).replace("\n", "\r\n")),
        ("old macintosh.stl", text_stl(CUT).replace("\n", "\r")),
        ("two solids.stl", text_stl(CUT[:1]) + text_stl(CUT[1:], "")),
        ("binary.stl", binary_stl(3)),
        ("one byte behind.stl", binary_stl(3, b"\0")),
        ("a line behind.stl", binary_stl(3, b"\r\n")),
        ("a triangle behind.stl", binary_stl(3, bytes(50))),
        ("no count.stl", binary_stl(0)),
        ("the largest count.stl", binary_stl(2**32 - 1)),
        ("called solid.stl", binary_stl(3, b"\0", b"solid part")),
        ("text.ply", ASCII + FACES + TEXT + OFF_FACES),
        ("index.ply", ASCII + FACES.replace("indices", "index") + TEXT + OFF_FACES),
        ("faces first.ply", "ply\nformat ascii 1.0\n" + FACES.replace("end_header\n", "")
         + ASCII.partition("by hand\n")[2] + "end_header\n" + OFF_FACES + TEXT),
        ("colored.ply", ASCII + "property uchar red\n" + FACES.replace("2\n", "2\nproperty int flag\n", 1)
         + TEXT.replace("\n", " 9\n") + "5 4 0 1 2 3\n5 3 3 2 4\n"),
        *((f"{order} {len(end)} {extra}.ply", binary_ply(order, end, extra) + behind)
          for order, end, extra, behind in [("<", "\n", False, b""), (">", "\n", False, b"\0"),
                                            ("<", "\r\n", True, b""), (">", "\n", True, b"")]),
        ("a.off", "OFF\n5 2 0\n" + TEXT + OFF_FACES),
        ("one line.off", "OFF 5 2 0\n" + TEXT + OFF_FACES),
        ("no word.off", "5 2 0\n" + TEXT + OFF_FACES),
        ("comments.off", "OFF # a\n\n5 2 0 # b\n" + (TEXT + OFF_FACES).replace("\n", " # c\n")),
        ("colors.off", "COFF\n5 2 0\n" + TEXT.replace("\n", " 9 9 9 1\n") + OFF_FACES.replace("\n", " 9\n")),
        ("normals.off", "NOFF\n5 2 0\n" + TEXT.replace("\n", " 0 0 1\n") + OFF_FACES),
    ],
)  # fmt: skip
def test_whatever_way_a_scan_is_written_it_is_the_same_three_triangles(tmp_path, name, content):
    found = read(put(tmp_path, name, content))
    corners = found.vertices[found.faces]
    assert sorted(corners.tolist()) == sorted(
        [list(map(float, PLACE[i])) for i in face] for face in CUT
    )


@pytest.mark.parametrize(
    "name, content, said",
    [
        ("comma.stl", text_stl(CUT).replace(".", ","), "could not convert string to float: b'1,5'"),
        ("comma.ply", (ASCII + FACES + TEXT + OFF_FACES).replace(".5", ",5"), "to float: b'1,5'"),
        ("comma.off", ("OFF\n5 2 0\n" + TEXT + OFF_FACES).replace(".", ","), "to float: b'1,5'"),
        ("picture.stl", b"\x89PNG\r\n\x1a\n" + 99 * b"\xff", r"it begins with b'\x89PNG\r\n\x1a\n'"),
        ("cloud.ply", ASCII + "end_header\n" + TEXT, "must have faces (got cloud.ply: only vertex elements)"),
        ("strips.ply", ASCII + FACES.replace("face 2", "tristrips 1") + TEXT + "3 0 1 2\n",
         "must have faces (got strips.ply: only vertex and tristrips elements)"),
        ("ends.ply", binary_ply("<", "\n", False)[:-3], "its lists end behind the file"),
        ("four.off", "4OFF\n5 2 0\n" + TEXT, "must be an OFF file that can be read (got four.off: no counts"),
        ("corner.off", "OFF\n5 1 0\n" + TEXT + "4 0 1 2\n", "a face of 4 corners without them"),
    ],
)  # fmt: skip
def test_a_scan_that_would_be_read_wrong_is_refused_with_its_cause(tmp_path, name, content, said):
    assert_refused(put(tmp_path, name, content), said)
