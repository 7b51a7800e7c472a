"""Meshes from files: what the formats can say, what they may not refer to, and files that are cut off."""

from __future__ import annotations

import os
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io import mesh_limits, mesh_writer
from digiclay.core.mesh_io.mesh_reader import read
from digiclay.core.surface.formed import Body

KINDS = ("gltf", "stl", "stl_ascii", "obj", "ply", "ply_ascii", "off", "glb", "3mf")
HEAD = bytes(80) + struct.pack("<I", 4_000_000_000)
BINARY = "ply\nformat binary_little_endian 1.0\nelement vertex 9000000000\n"


def written(folder: Path, kind: str) -> Path:
    """Write a ball of 320 triangles, 20 mm across, in a format; 3MF by the program itself."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=10.0)
    path = folder / f"ball.{kind.split('_')[0]}"
    if kind == "3mf":
        mesh_writer.write(
            [Body("ball", ball.vertices * 1e-3, ball.faces.astype(np.int32), closed=True)], path, "mm"
        )
    elif kind == "gltf":
        for name, content in ball.export(file_type="gltf").items():
            (folder / name).write_bytes(content)
        return folder / "model.gltf"
    elif kind == "ply_ascii":
        ball.export(path, encoding="ascii")
    else:
        ball.export(path, file_type=kind)
    return path


def obj(folder: Path, text: str) -> Path:
    """Write an OBJ."""
    (folder / "odd.obj").write_bytes(text.encode())
    return folder / "odd.obj"


# OBJ


@pytest.mark.parametrize(
    "text",
    [
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\n",
        "v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1/1/1 2/2/2 3/3/3\r\nf 1//1 3//3 4//4\r\n",
        "v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 3\rf 1 3 4\r",
        "mtllib a.mtl\n\tv 0 0 0 1\nv  1 0 0 1\nv 1 1 0 1\nv 0 1 0 1\nvn 0 0 1\ns 1\nf 1 2 3 \\\n 4",
        "v 0 0 0 0.5 0.5 0.5\nv 1 0 0 1 0 0\nv 1 1 0 0 1 0\nv 0 1 0 0 0 1\nf 1/1 2/2 3/3 4/4 # a square",
        "\ufeffv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
    ],
)  # fmt: skip
def test_whatever_way_an_obj_is_written_it_is_the_same_square(tmp_path: Path, text: str) -> None:
    back = read(obj(tmp_path, text))
    np.testing.assert_array_equal(back.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(back.faces, [[0, 1, 2], [0, 2, 3]])


def test_an_obj_of_many_blocks_is_read_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = read(written(tmp_path, "obj"))
    monkeypatch.setattr("digiclay.core.mesh_io.obj_reader.BLOCK", 100)
    parts = read(tmp_path / "ball.obj")
    np.testing.assert_array_equal(whole.vertices, parts.vertices)
    np.testing.assert_array_equal(whole.faces, parts.faces)


THREE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{THREE}f 1 2 9\n", "vertex 9 of 3"),
        (f"{THREE}f -1 -2 -9\n", "line 4: there is no vertex -9"),
        (f"{THREE}f 0 1 2\n", "line 4: there is no vertex 0"),
        (f"{THREE}f 1 2 x\n", "line 4: invalid literal for int()"),
        ("v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2: not enough values"),
        ("v 0 0 0\nv 1 0 0,5\nv 0 1 0\nf 1 2 3\n", "line 2: could not convert"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3" + 30 * "0" + "\n", "line 4: "),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2", "the file is cut off (got odd.obj: 'f 1 2')"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/2 3/3\nf 1/1 2/2 3/", "the file is cut off"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf", "the file is cut off"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3", "1 of 4 vertices without a face"),
    ],
)
def test_an_obj_that_makes_no_sense_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(said)):
        read(obj(tmp_path, text))


def test_the_materials_of_an_obj_and_the_picture_of_a_ply_are_not_opened(tmp_path: Path) -> None:
    # A pipe that has no writer: reading it would wait for ever.
    os.mkfifo(tmp_path / "pipe")
    text = "mtllib pipe ../../../dev/zero\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert len(read(obj(tmp_path, text)).faces) == 1
    path = written(tmp_path, "ply_ascii")
    head = b"comment TextureFile pipe\nelement vertex"
    path.write_bytes(path.read_bytes().replace(b"element vertex", head))
    assert len(read(path).faces) == 320


# What is cut off, and what begins with a byte order mark


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_is_cut_off_is_refused_wherever_it_is_cut(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, kind)
    data, whole = path.read_bytes(), read(path)
    taken = []
    for end in np.random.default_rng(3).integers(0, len(data), 60).tolist():
        path.write_bytes(data[:end])
        try:
            back = read(path)
        except (ParameterError, ValueError, KeyError, TypeError, IndexError, AttributeError):
            continue
        if not back.faces.size:  # refused where it becomes a shape
            continue
        same = np.array_equal(back.faces, whole.faces) and np.array_equal(back.vertices, whole.vertices)
        unused = len(back.vertices) - np.unique(back.faces).size
        if not same and not (kind == "obj" and data[:end].endswith(b"\n") and unused > 0):
            taken.append(end)
    assert taken == []


@pytest.mark.parametrize("kind", ["stl_ascii", "obj", "ply_ascii", "off", "gltf"])
def test_a_byte_order_mark_changes_nothing(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, kind)
    plain = read(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    marked = read(path)
    np.testing.assert_array_equal(plain.vertices, marked.vertices)
    np.testing.assert_array_equal(plain.faces, marked.faces)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("many.stl", HEAD + bytes(50), "1 of its 4,000,000,000 triangles"),
        ("many.ply", BINARY + "property float x\nend_header\n",
         "its elements take at least 36,000,000,000"),
        ("none.ply", BINARY + "end_header\n",
         "9000000000 vertex without properties"),
        ("bad.ply", "ply\nproperty float x\nend_header\n", "'property float x' in its head"),
        ("many.off", "OFF\n9000000000 9 0\n0 0 0\n", "at most 20 million triangles"),
        ("inside.stl", "solid a\nfacet normal 0 0 1\nouter loop\nendsolid a\n", "1 facets begin, 0 end"),
        ("few.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "3 of its 4 lines"),
    ],
)  # fmt: skip
def test_a_head_that_promises_more_than_there_is_is_refused(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ParameterError, match=re.escape(said)):
        read(tmp_path / name)


def test_a_file_beyond_all_sizes_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "hole.stl").open("wb") as file:
        file.truncate(mesh_limits.MOST_BYTES + 1)  # takes no room on the disk
    with pytest.raises(ParameterError, match=r"must have at most 2 GB .got hole.stl: 2 GB"):
        read(tmp_path / "hole.stl")
