"""Meshes from files: what formats can say, what they may not refer to, and files that are damaged."""

import base64
import json
import os
import struct

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io import mesh_limits, mesh_writer
from digiclay.core.mesh_io.mesh_reader import READERS, read
from digiclay.core.surface.formed import Body
from numpy.testing import assert_array_equal

from tests.assemble import assert_near
from tests.mesh_files import FACES, PLACES, VOLUME, assert_refused, put

KINDS = ("gltf", "stl", "stl_ascii", "obj", "ply", "ply_ascii", "off", "glb", "3mf")
PROMISE = bytes(80) + struct.pack("<I", 4_000_000)
BINARY = "ply\nformat binary_little_endian 1.0\nelement vertex 9000000000\n"


#: 320 triangles, 20 mm across.
BALL = trimesh.creation.icosphere(subdivisions=2, radius=10.0)


def written(folder, kind):
    """Write the ball in a format; 3MF by the program itself."""
    path = folder / f"ball.{kind.split('_')[0]}"
    if kind == "3mf":
        body = Body("ball", BALL.vertices * 1e-3, BALL.faces.astype(np.int32), closed=True)
        mesh_writer.write([body], path, "mm")
    elif kind == "gltf":
        for name, content in BALL.export(file_type="gltf").items():
            (folder / name).write_bytes(content)
        return folder / "model.gltf"
    elif kind == "ply_ascii":
        BALL.export(path, encoding="ascii")
    else:
        BALL.export(path, file_type=kind)
    return path


#: Meters in a file's unit, and its upward direction, where it is not a scan that tells neither.
TOLD = {"gltf": (1.0, "y"), "glb": (1.0, "y"), "obj": (None, "y"), "3mf": (1e-3, "z")}


@pytest.mark.parametrize("kind", KINDS)
def test_a_ball_has_the_same_triangles_in_every_format(tmp_path, kind):
    vertices, faces, *told = read(written(tmp_path, kind))
    # float32, or 8 digits.
    assert_near(vertices[faces], BALL.triangles, 1e-6)
    assert tuple(told) == TOLD.get(kind, (None, "z"))


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
def test_whatever_way_an_obj_is_written_it_is_the_same_square(tmp_path, text):
    back = read(put(tmp_path, "odd.obj", text))
    assert_array_equal(back.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert_array_equal(back.faces, [[0, 1, 2], [0, 2, 3]])


THREE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    "text, said",
    [
        (f"{THREE}f 1 2 4\n", "vertex 4 of 3"),
        (f"{THREE}f -1 -2 -4\n", "line 4: there is no vertex -4"),
        (f"{THREE}f 0 1 2\n", "line 4: there is no vertex 0"),
        (f"{THREE}f 1 2 x\n", "line 4: invalid literal for int()"),
        ("v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2: not enough values"),
        ("v 0 0 0\nv 1 0 0,5\nv 0 1 0\nf 1 2 3\n", "line 2: could not convert"),
        (f"{THREE}f 1 2 3{30 * '0'}\n", "line 4: "),
        (f"{THREE}f 1 2 3\nf 1 2", "the file is cut off (got odd.obj: 'f 1 2')"),
        (f"{THREE}f 1/1 2/2 3/3\nf 1/1 2/2 3/", "the file is cut off"),
        (f"{THREE}f 1 2 3\nf", "the file is cut off"),
        (f"{THREE}v 0 0 1\nf 1 2 3", "1 of 4 vertices without a face"),
    ],
)
def test_an_obj_that_makes_no_sense_is_refused(tmp_path, text, said):
    assert_refused(put(tmp_path, "odd.obj", text), said)


def test_bytes_beside_a_gltf_are_read_and_materials_and_pictures_are_not_opened(tmp_path):
    # A pipe that has no writer: reading it would wait for ever.
    os.mkfifo(tmp_path / "pipe")
    text = "mtllib pipe ../../../dev/zero\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert len(read(put(tmp_path, "odd.obj", text)).faces) == 1
    path = written(tmp_path, "ply_ascii")
    head = b"comment TextureFile pipe\nelement vertex"
    path.write_bytes(path.read_bytes().replace(b"element vertex", head))
    assert len(read(path).faces) == 320
    (tmp_path / "a folder").mkdir()
    path = gltf(tmp_path, with_uri("a%20folder/bytes.bin"))
    (tmp_path / "bytes.bin").rename(tmp_path / "a folder" / "bytes.bin")
    assert_array_equal(read(path).vertices, PLACES)


def test_every_format_that_is_read_is_tested_below():
    assert {f".{kind.partition('_')[0]}" for kind in KINDS} == READERS.keys(), (
        "KINDS, above, must name each"
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_is_cut_off_is_refused_wherever_it_is_cut(tmp_path, kind):
    path = written(tmp_path, kind)
    data, whole = path.read_bytes(), read(path)
    taken = []
    for end in np.random.default_rng(3).integers(0, len(data), 60).tolist():
        path.write_bytes(data[:end])
        try:
            back = read(path)
        except ParameterError:
            continue
        if not back.faces.size:  # refused where it becomes a shape
            continue
        same = np.array_equal(back.faces, whole.faces) and np.array_equal(
            back.vertices, whole.vertices
        )
        unused = len(back.vertices) - np.unique(back.faces).size
        if not same and not (kind == "obj" and data[:end].endswith(b"\n") and unused > 0):
            taken.append(end)
    assert taken == []


@pytest.mark.parametrize("kind", ["stl_ascii", "obj", "ply_ascii", "off", "gltf"])
def test_a_byte_order_mark_and_many_blocks_change_nothing(tmp_path, kind, monkeypatch):
    path = written(tmp_path, kind)
    plain = read(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    monkeypatch.setattr("digiclay.core.mesh_io.obj_reader.BLOCK", 100)
    marked = read(path)
    assert_array_equal(plain.vertices, marked.vertices)
    assert_array_equal(plain.faces, marked.faces)


@pytest.mark.parametrize(
    "name, content, said",
    [
        ("many.stl", PROMISE + bytes(50), "1 of its 4,000,000 triangles"),
        ("many.ply", BINARY + "property float x\nend_header\n",
         "its vertex elements take at least 36,000,000,000"),
        ("none.ply", BINARY + "end_header\n",
         "9000000000 vertex without properties"),
        ("bad.ply", "ply\nproperty float x\nend_header\n", "'property float x' in its head"),
        ("many.off", "OFF\n9000000000 9 0\n0 0 0\n", "at most 20 million triangles"),
        ("inside.stl", "solid a\nfacet normal 0 0 1\nouter loop\nendsolid a\n", "1 facets begin, 0 end"),
        ("few.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "3 of its 4 lines"),
    ],
)  # fmt: skip
def test_a_head_that_promises_more_than_there_is_is_refused(tmp_path, name, content, said):
    assert_refused(put(tmp_path, name, content), said)


def test_a_file_beyond_all_sizes_is_not_read(tmp_path):
    with (tmp_path / "hole.stl").open("wb") as file:
        file.truncate(mesh_limits.MOST_BYTES + 1)  # takes no room on the disk
    assert_refused(tmp_path / "hole.stl", "must have at most 2 GB (got hole.stl: 2 GB")


def inline(data):
    """Return a buffer that has its bytes as text."""
    return {"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}


def gltf(folder, change=lambda tree: None):
    """Write a tetrahedron as glTF with its bytes inside, after changing what it says."""
    places, corners = PLACES.astype("<f4").tobytes(), FACES.astype("<u2").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "buffers": [inline(places + corners)],
    }
    change(tree)
    (folder / "bytes.bin").write_bytes(places + corners)
    path = folder / "one.gltf"
    path.write_text(json.dumps(tree), encoding="utf-8")
    return path


def with_uri(uri):
    """Return a change that takes the bytes from elsewhere."""
    return lambda tree: tree["buffers"][0].update(uri=uri)


def test_nodes_are_turned_shifted_and_stretched_as_trimesh_has_them(tmp_path):
    parts = {
        "rotation": [0.1, -0.5, 0.7, 0.5],
        "scale": [1.0, 2.0, -3.0],
        "translation": [4.0, 5.0, 6.0],
    }
    inner = np.diag([2.0, 3.0, 0.5, 1.0])
    inner[:3, 3] = 1.0, 2.0, 3.0
    nodes = [{"mesh": 0, "children": [1], **parts}, {"mesh": 0, "matrix": inner.T.ravel().tolist()}]
    path = gltf(tmp_path, lambda tree: tree.update(nodes=nodes))
    back, judge = read(path), trimesh.load_mesh(path, process=False)
    assert_near(np.sort(back.vertices, 0), np.sort(judge.vertices, 0), 1e-6)
    # The mirrored ones turned the right way out: once stretched to 6 times, once to 3 times that.
    volume = trimesh.Trimesh(back.vertices, back.faces, process=False).volume
    assert volume == pytest.approx(24 * VOLUME, rel=1e-6)


@pytest.mark.parametrize("mode, corners", [(5, [0, 1, 2, 3, 0]), (6, [0, 1, 2, 3])])
def test_strips_and_fans_are_cut_into_triangles(tmp_path, mode, corners):
    def change(tree):
        data = PLACES.astype("<f4").tobytes() + np.array(corners, "<u2").tobytes()
        tree["buffers"] = [inline(data)]
        tree["bufferViews"][1]["byteLength"] = 2 * len(corners)
        tree["accessors"][1]["count"] = len(corners)
        tree["meshes"][0]["primitives"][0]["mode"] = mode

    wanted = {5: [[0, 1, 2], [1, 3, 2], [2, 3, 0]], 6: [[0, 1, 2], [0, 2, 3]]}[mode]
    assert_array_equal(read(gltf(tmp_path, change)).faces, wanted)


@pytest.mark.parametrize("normalized", [True, False])
def test_vertices_that_are_quantized_are_read_and_extensions_of_materials_do_not_matter(
    tmp_path, normalized
):
    whole = np.round(PLACES * 1000.0).astype("<i2")

    def change(tree):
        tree["extensionsRequired"] = [
            "KHR_mesh_quantization",
            "KHR_materials_unlit",
            "KHR_texture_basisu",
        ]
        tree["accessors"][0].update(componentType=5122, normalized=normalized)
        tree["bufferViews"][0].update(byteLength=32, byteStride=8)
        tree["bufferViews"][1].update(byteOffset=32)
        padded = np.column_stack([whole, np.zeros(4, "<i2")]).tobytes()
        tree["buffers"][0] = inline(padded + FACES.astype("<u2").tobytes())

    found = read(gltf(tmp_path, change)).vertices
    assert_near(found, whole / (32767.0 if normalized else 1.0), 1e-12)


@pytest.mark.parametrize(
    "uri",
    ["../bytes.bin", "/dev/zero", "sub/../../bytes.bin", "%2e%2e/bytes.bin", "..%2fbytes.bin",
     "file:///dev/zero", "http://localhost/bytes.bin", "https://localhost/b", "//host/b", "C:/bytes.bin",
     "..\\bytes.bin", "\\\\host\\b", "link.bin", "a\0b"],
)  # fmt: skip
def test_bytes_from_elsewhere_are_refused(tmp_path, uri):
    inner = tmp_path / "inner"
    inner.mkdir()
    path = gltf(inner, with_uri(uri))
    (tmp_path / "bytes.bin").write_bytes((inner / "bytes.bin").read_bytes())
    (inner / "link.bin").symlink_to("/dev/zero")
    assert_refused(path, "must have its vertices in the file, or in a file")


def test_a_pipe_beside_the_gltf_is_not_opened_nor_its_pictures_and_endless_nesting_is_refused(
    tmp_path,
):
    def change(tree):
        tree["images"], tree["textures"] = (
            [{"uri": "pipe.bin"}, {"uri": "../../dev/zero"}],
            [{"source": 0}],
        )
        tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        tree["meshes"][0]["primitives"][0]["material"] = 0

    os.mkfifo(tmp_path / "pipe.bin")
    assert_array_equal(read(gltf(tmp_path, change)).faces, FACES)
    path = gltf(tmp_path, with_uri("pipe.bin"))
    assert_refused(path, "must have its files beside it")
    path.write_text("[" * 100_000, encoding="utf-8")
    assert_refused(path, "nested too deeply")


def many_nodes(tree):
    """Place a mesh of 300 000 corners, three bytes and their repetition, three hundred times."""
    tree["nodes"], tree["scenes"] = [{"mesh": 0}] * 300, [{"nodes": list(range(300))}]
    tree["bufferViews"][1] = {"buffer": 1, "byteLength": 600_000}
    tree["buffers"].append(inline(bytes(600_000)))
    tree["accessors"][1]["count"] = 300_000


def changed(place, value):
    """Return a change of one entry, ``accessors.0.count``; None takes it away."""

    def change(tree):
        *parents, name = [int(word) if word.isdecimal() else word for word in place.split(".")]
        for parent in parents:
            tree = tree[parent]
        if value is None:
            del tree[name]
        else:
            tree[name] = value

    return change


def nest(tree):
    tree["nodes"].append({"children": [0, 0]})
    tree["scenes"][0]["nodes"] = [1]


PRIMITIVE = "meshes.0.primitives.0"
ALTERING = "must not need an extension that changes its vertices (got one.gltf: {})"


@pytest.mark.parametrize(
    "place, value, said",
    [
        ("accessors.0.count", 10**12, "must have at most 20 million triangles"),
        ("accessors.0.count", 5, "accessor 0 reaches beyond its view"),
        ("accessors.0.count", -1, "-1 is not a count"),
        ("accessors.0.bufferView", None, "compressed or sparse"),
        ("accessors.0.sparse", {}, "compressed or sparse"),
        ("bufferViews.0.byteStride", 0, "reaches beyond its view"),
        ("bufferViews.1.byteOffset", 50, "whole (got one.gltf: 72 bytes of 7"),
        ("buffers.0.uri", None, "buffer 0 has no bytes"),
        ("buffers.0.uri", "data:text/plain,abc", "not base64"),
        ("buffers.0.uri", "data:;base64,!!!", "bytes as text"),
        ("buffers.0.uri", "nowhere.bin", "must have its files beside it"),
        (f"{PRIMITIVE}.indices", -1, "-1 is not a count"),
        (f"{PRIMITIVE}.indices", 7, "no entry 7 in accessors"),
        ("asset.version", "1.0", "its version is 1.0"),
        ("asset", None, "'asset' is missing"),
        ("nodes", 3, "glTF 2.0 file that can be read"),
        ("nodes.0.children", [0], "node 0 stands in two places"),
        ("nodes.0.matrix", [1, 2], "cannot reshape"),
        ("nodes.0.skin", 0, "must not be bent by a skin or by weights"),
        ("nodes.0.weights", [0.0, 0.5], "must not be bent by a skin"),
        ("meshes.0.weights", [0.0, 0.5], "must not be bent by a skin"),
        ("extensionsUsed", ["EXT_mesh_gpu_instancing"], "EXT_mesh_gpu_instancing)"),
        ("extensionsUsed", ["KHR_node_visibility"], "KHR_node_visibility)"),
        *(
            ("extensionsRequired", ["KHR_materials_unlit", name], ALTERING.format(name))
            for name in ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "VENDOR_anything")
        ),
    ],
)
def test_a_gltf_that_makes_no_sense_is_refused(tmp_path, place, value, said):
    assert_refused(gltf(tmp_path, changed(place, value)), said)


@pytest.mark.parametrize(
    "change, said",
    [
        (many_nodes, "must have at most 20 million triangles (got one.gltf: 30,000,000)"),
        (nest, "node 0 stands in two places"),
    ],
)
def test_a_gltf_of_many_repetitions_is_refused(tmp_path, change, said):
    assert_refused(gltf(tmp_path, change), said)
