"""Meshes from files: what formats can say, what they may not refer to, and files that are damaged."""

import base64
import json
import math
import os
import re
import struct
import time
import zipfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import lib3mf
import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io import mesh_limits, mesh_writer, threemf_reader
from digiclay.core.mesh_io.mesh_reader import read
from digiclay.core.mesh_io.mesh_writer import CORE, HEAD, RELATIONS, TYPES
from digiclay.core.surface.formed import Body

KINDS = ("gltf", "stl", "stl_ascii", "obj", "ply", "ply_ascii", "off", "glb", "3mf")
PROMISE = bytes(80) + struct.pack("<I", 4_000_000)
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
    (folder / "odd.obj").write_bytes(text.encode())
    return folder / "odd.obj"


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
    back = read(obj(tmp_path, text))
    np.testing.assert_array_equal(back.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(back.faces, [[0, 1, 2], [0, 2, 3]])


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
        (f"{THREE}f 1 2 3{30 * '0'}\n", "line 4: "),
        (f"{THREE}f 1 2 3\nf 1 2", "the file is cut off (got odd.obj: 'f 1 2')"),
        (f"{THREE}f 1/1 2/2 3/3\nf 1/1 2/2 3/", "the file is cut off"),
        (f"{THREE}f 1 2 3\nf", "the file is cut off"),
        (f"{THREE}v 0 0 1\nf 1 2 3", "1 of 4 vertices without a face"),
    ],
)
def test_an_obj_that_makes_no_sense_is_refused(tmp_path, text, said):
    with pytest.raises(ParameterError, match=re.escape(said)):
        read(obj(tmp_path, text))


def test_bytes_beside_a_gltf_are_read_and_materials_and_pictures_are_not_opened(tmp_path):
    # A pipe that has no writer: reading it would wait for ever.
    os.mkfifo(tmp_path / "pipe")
    text = "mtllib pipe ../../../dev/zero\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert len(read(obj(tmp_path, text)).faces) == 1
    path = written(tmp_path, "ply_ascii")
    head = b"comment TextureFile pipe\nelement vertex"
    path.write_bytes(path.read_bytes().replace(b"element vertex", head))
    assert len(read(path).faces) == 320
    (tmp_path / "a folder").mkdir()
    path = gltf(tmp_path, with_uri("a%20folder/bytes.bin"))
    (tmp_path / "bytes.bin").rename(tmp_path / "a folder" / "bytes.bin")
    np.testing.assert_array_equal(read(path).vertices, PLACES)


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
        same = np.array_equal(back.faces, whole.faces) and np.array_equal(back.vertices, whole.vertices)
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
    np.testing.assert_array_equal(plain.vertices, marked.vertices)
    np.testing.assert_array_equal(plain.faces, marked.faces)


@pytest.mark.parametrize(
    ("name", "content", "said"),
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
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ParameterError, match=re.escape(said)):
        read(tmp_path / name)


def test_a_file_beyond_all_sizes_is_not_read(tmp_path):
    with (tmp_path / "hole.stl").open("wb") as file:
        file.truncate(mesh_limits.MOST_BYTES + 1)  # takes no room on the disk
    with pytest.raises(ParameterError, match=r"must have at most 2 GB .got hole.stl: 2 GB"):
        read(tmp_path / "hole.stl")


#: A tetrahedron without symmetry: its volume's sign tells a turn from a reflection.
PLACES = np.array([[0.0, 0, 0], [5, 0, 0], [0, 7, 0], [0, 0, 11]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def inline(data: bytes) -> dict[str, Any]:
    """Return a buffer that has its bytes as text."""
    return {"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}


def gltf(folder: Path, change: Callable[[dict[str, Any]], None] = lambda tree: None) -> Path:
    """Write a tetrahedron as glTF with its bytes inside, after changing what it says."""
    places, corners = PLACES.astype("<f4").tobytes(), FACES.astype("<u2").tobytes()
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 24}],
        "buffers": [inline(places + corners)],
    }
    change(tree)
    (folder / "bytes.bin").write_bytes(places + corners)
    path = folder / "one.gltf"
    path.write_text(json.dumps(tree), encoding="utf-8")
    return path


def with_uri(uri: str) -> Callable[[dict[str, Any]], None]:
    """Return a change that takes the bytes from elsewhere."""
    return lambda tree: tree["buffers"][0].update(uri=uri)


def test_nodes_are_turned_shifted_and_stretched_as_trimesh_has_them(tmp_path):
    parts = {"rotation": [0.1, -0.5, 0.7, 0.5], "scale": [1.0, 2.0, -3.0], "translation": [4.0, 5.0, 6.0]}
    inner = np.diag([2.0, 3.0, 0.5, 1.0])
    inner[:3, 3] = 1.0, 2.0, 3.0
    nodes = [{"mesh": 0, "children": [1], **parts}, {"mesh": 0, "matrix": inner.T.ravel().tolist()}]
    path = gltf(tmp_path, lambda tree: tree.update(nodes=nodes))
    back, judge = read(path), trimesh.load_mesh(path, process=False)
    np.testing.assert_allclose(np.sort(back.vertices, 0), np.sort(judge.vertices, 0), rtol=0.0, atol=1e-6)
    # The mirrored ones turned the right way out: once stretched to 6 times, once to 3 times that.
    volume = trimesh.Trimesh(back.vertices, back.faces, process=False).volume
    assert volume == pytest.approx(24 * 5 * 7 * 11 / 6, rel=1e-6)


@pytest.mark.parametrize(("mode", "corners"), [(5, [0, 1, 2, 3, 0]), (6, [0, 1, 2, 3])])
def test_strips_and_fans_are_cut_into_triangles(tmp_path, mode, corners):
    def change(tree: dict[str, Any]) -> None:
        data = PLACES.astype("<f4").tobytes() + np.array(corners, "<u2").tobytes()
        tree["buffers"] = [inline(data)]
        tree["bufferViews"][1]["byteLength"] = 2 * len(corners)
        tree["accessors"][1]["count"] = len(corners)
        tree["meshes"][0]["primitives"][0]["mode"] = mode

    wanted = {5: [[0, 1, 2], [1, 3, 2], [2, 3, 0]], 6: [[0, 1, 2], [0, 2, 3]]}[mode]
    np.testing.assert_array_equal(read(gltf(tmp_path, change)).faces, wanted)


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
    with pytest.raises(ParameterError, match="must have its vertices in the file, or in a file"):
        read(path)


def test_a_pipe_beside_the_gltf_is_not_opened_nor_its_pictures_and_endless_nesting_is_refused(tmp_path):
    def change(tree: dict[str, Any]) -> None:
        tree["images"], tree["textures"] = [{"uri": "pipe.bin"}, {"uri": "../../dev/zero"}], [{"source": 0}]
        tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        tree["meshes"][0]["primitives"][0]["material"] = 0

    os.mkfifo(tmp_path / "pipe.bin")
    np.testing.assert_array_equal(read(gltf(tmp_path, change)).faces, FACES)
    path = gltf(tmp_path, with_uri("pipe.bin"))
    with pytest.raises(ParameterError, match="must have its files beside it"):
        read(path)
    path.write_text("[" * 100_000, encoding="utf-8")
    with pytest.raises(ParameterError, match="nested too deeply"):
        read(path)


def many_nodes(tree: dict[str, Any]) -> None:
    """Place a mesh of 30 000 corners, three bytes and their repetition, three thousand times."""
    tree["nodes"], tree["scenes"] = [{"mesh": 0}] * 3003, [{"nodes": list(range(3003))}]
    tree["bufferViews"][1] = {"buffer": 1, "byteLength": 60_000}
    tree["buffers"].append(inline(bytes(60_000)))
    tree["accessors"][1]["count"] = 30_000


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (many_nodes, "must have at most 20 million triangles (got one.gltf: 30,030,000)"),
        (lambda tree: tree["nodes"].append({"children": [0, 0]}) or tree["scenes"][0].update(nodes=[1]),
         "node 0 stands in two places"),
        (lambda tree: tree["nodes"][0].update(children=[0]), "node 0 stands in two places"),
        (lambda tree: tree["accessors"][0].update(count=10**12), "must have at most 20 million triangles"),
        (lambda tree: tree["accessors"][0].update(count=5), "accessor 0 reaches beyond its view"),
        (lambda tree: tree["accessors"][0].update(count=-1), "-1 is no count"),
        (lambda tree: tree["bufferViews"][0].update(byteStride=0), "reaches beyond its view"),
        (lambda tree: tree["bufferViews"][1].update(byteOffset=50), "whole (got one.gltf: 72 bytes of 7"),
        (lambda tree: tree["accessors"][0].pop("bufferView"), "compressed or sparse"),
        (lambda tree: tree["accessors"][0].update(sparse={}), "compressed or sparse"),
        (lambda tree: tree["buffers"][0].pop("uri"), "buffer 0 has no bytes"),
        (lambda tree: tree["meshes"][0]["primitives"][0].update(indices=-1), "-1 is no count"),
        (lambda tree: tree["meshes"][0]["primitives"][0].update(indices=7), "no entry 7 in accessors"),
        (lambda tree: tree["asset"].update(version="1.0"), "its version is 1.0"),
        (lambda tree: tree.pop("asset"), "'asset' is missing"),
        (lambda tree: tree.update(nodes=3), "glTF 2.0 file that can be read"),
        (lambda tree: tree["nodes"][0].update(matrix=[1, 2]), "cannot reshape"),
        (with_uri("data:text/plain,abc"), "not base64"),
        (with_uri("data:;base64,!!!"), "bytes as text"),
        (with_uri("nowhere.bin"), "must have its files beside it"),
    ],
)  # fmt: skip
def test_a_gltf_that_makes_no_sense_is_refused(tmp_path, change, said):
    began = time.process_time()  # of this process alone: a busy machine takes longer
    with pytest.raises(ParameterError, match=re.escape(said)):
        read(gltf(tmp_path, change))
    assert time.process_time() - began < 2.0


PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
MESH = (
    "<mesh><vertices>"
    + "".join('<vertex x="{:g}" y="{:g}" z="{:g}"/>'.format(*row) for row in PLACES)
    + "</vertices><triangles>"
    + "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in FACES)
    + "</triangles></mesh>"
)


def packed(path: Path, resources: str, build: str, head: str = "", **parts: str) -> Path:
    """Write a 3MF of a model's resources and build, and of further parts."""
    model = f'{HEAD}{head}<model unit="millimeter" xmlns="{CORE}" xmlns:p="{PRODUCTION}">'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", TYPES)
        archive.writestr("_rels/.rels", RELATIONS)
        archive.writestr(
            "3D/3dmodel.model", f"{model}<resources>{resources}</resources><build>{build}</build></model>"
        )
        for name, text in parts.items():
            archive.writestr(f"3D/{name}.model", f"{model}<resources>{text}</resources><build/></model>")
    return path


def placement(*rows: tuple[float, float, float]) -> lib3mf.Transform:
    made = lib3mf.Transform()
    for index, row in enumerate(rows):
        made.Fields[index][:] = row
    return made


def test_components_and_items_stand_where_lib3mf_puts_them(tmp_path):
    wrapper = lib3mf.Wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(lib3mf.ModelUnit.Inch)
    mesh = model.AddMeshObject()
    for place in PLACES:
        position = lib3mf.Position()
        position.Coordinates[:] = place
        mesh.AddVertex(position)
    for face in FACES:
        triangle = lib3mf.Triangle()
        triangle.Indices[:] = face.tolist()
        mesh.AddTriangle(triangle)
    inner, outer = model.AddComponentsObject(), model.AddComponentsObject()
    c, s = math.cos(0.5), math.sin(0.5)
    inner.AddComponent(mesh, placement((c, s, 0), (-s, c, 0), (0, 0, 2), (1, 2, 3)))
    inner.AddComponent(mesh, wrapper.GetIdentityTransform())
    outer.AddComponent(inner, placement((1, 0, 0), (0, c, s), (0, -s, c), (0, 40, 0)))
    mirror = placement((-1, 0, 0), (0, 1, 0), (0, 0, 1), (10, 0, 0))
    model.AddBuildItem(outer, mirror)
    model.AddBuildItem(mesh, placement((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 50)))
    path = tmp_path / "placed.3mf"
    model.QueryWriter("3mf").WriteToFile(str(path))

    judge = wrapper.CreateModel()
    judge.QueryReader("3mf").ReadFromFile(str(path))
    objects = judge.MergeToModel().GetMeshObjects()
    points = []
    while objects.MoveNext():
        points += [list(one.Coordinates) for one in objects.GetCurrentMeshObject().GetVertices()]
    back = read(path)
    assert back.length == 25.4e-3
    # lib3mf has 32-bit numbers.
    np.testing.assert_allclose(np.sort(back.vertices, 0), np.sort(np.array(points), 0), rtol=0.0, atol=1e-5)
    # Three times as it is, once stretched to double, the mirrored ones turned the right way out again.
    volume = trimesh.Trimesh(back.vertices, back.faces, process=False).volume
    assert volume == pytest.approx(4 * 5 * 7 * 11 / 6, rel=1e-5)


def test_a_part_that_another_one_names_is_read_and_supports_and_what_is_not_built_are_left_away(tmp_path):
    # As programs that prepare prints write it: each object in a part of its own.
    path = packed(
        tmp_path / "parts.3mf",
        '<object id="1"><components><component objectid="7" p:path="/3D/one.model" '
        'transform="1 0 0 0 1 0 0 0 1 100 0 0"/></components></object>',
        '<item objectid="1"/>',
        one=f'<object id="7">{MESH}</object>',
    )
    np.testing.assert_allclose(read(path).vertices, PLACES + np.array([100.0, 0.0, 0.0]))
    kinds = enumerate(("model", "support", "solidsupport", "model"), 1)
    resources = "".join(f'<object id="{number}" type="{kind}">{MESH}</object>' for number, kind in kinds)
    build = "".join(f'<item objectid="{number}"/>' for number in (1, 2, 3))
    assert len(read(packed(tmp_path / "some.3mf", resources, build)).faces) == 4


def nested(levels: int, copies: int = 1) -> str:
    """Return objects each of which is some of the one before."""
    text = f'<object id="0">{MESH}</object>'
    for level in range(levels):
        inside = copies * f'<component objectid="{level}"/>'
        text += f'<object id="{level + 1}"><components>{inside}</components></object>'
    return text


LAUGHS = "".join(f'<!ENTITY {name} "{10 * f"&{other};"}">' for other, name in pairwise("abcdefghij"))
ENTITIES = f'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">{LAUGHS}]>'
OBJECT = f'<object id="1">{MESH}</object>'
OWN = '<components><component objectid="1"/></components>'
ITEM = '<item objectid="1"/>'


@pytest.mark.parametrize(
    ("resources", "build", "head", "said"),
    [
        (OBJECT, ITEM, ENTITIES, "must not have a document type"),
        (OBJECT, ITEM, '<!DOCTYPE x SYSTEM "file:///dev/zero">', "must not have a document type"),
        (nested(60, copies=10), '<item objectid="60"/>', "", "triangles (got x.3mf: more than 10^15)"),
        (nested(2000), '<item objectid="2000"/>', "", "components at most 64 deep"),
        # The same chain, whose lower half is measured before its upper one.
        (nested(100), '<item objectid="50"/><item objectid="100"/>', "", "components at most 64 deep"),
        (OBJECT.replace(MESH, OWN), ITEM, "", "components at most 64 deep, and none in itself"),
        (OBJECT, '<item objectid="2"/>', "", "no object 2 in 3D/3dmodel.model"),
        (OBJECT.replace('v3="3"', 'v3="4"'), ITEM, "", "corners are among its vertices (got x.3mf: corner 4"),
        (OBJECT.replace('v3="3"', 'v3="-1"'), ITEM, "", "corners are among its vertices"),
        (OBJECT.replace('x="5"', 'x="five"'), ITEM, "", "could not convert string to float"),
        (OBJECT.replace('x="5"', ""), ITEM, "", "a vertex without 'x'"),
        (OBJECT.replace('v3="3"', 'v3="1' + 30 * "0" + '"'), ITEM, "", "3MF file that can be read"),
        (OBJECT, '<item objectid="1" transform="1 0 0"/>', "", "a transform of 3 numbers"),
        (OBJECT[:-9], ITEM, "", "mismatched tag"),
        (OBJECT.replace(MESH, OWN.replace("/>", ' p:path="/3D/no.model"/>')), ITEM, "", "named '3D/no.mod"),
    ],
)  # fmt: skip
def test_what_would_break_a_reader_is_refused(tmp_path, resources, build, head, said):
    with pytest.raises(ParameterError, match=re.escape(said)) as caught:
        read(packed(tmp_path / "x.3mf", resources, build, head))
    assert "\n" not in str(caught.value)


def test_a_zip_that_unpacks_to_more_than_is_allowed_is_not_unpacked(tmp_path, monkeypatch):
    path = packed(tmp_path / "bomb.3mf", OBJECT + 3_000_000 * " ", ITEM)
    assert path.stat().st_size < 20_000
    read(path)
    monkeypatch.setattr(mesh_limits, "MOST_BYTES", 2_000_000)
    with pytest.raises(ParameterError, match=r"at most 0.002 GB unpacked .got bomb.3mf: 3D/3dmodel"):
        read(path)
    # The limit is checked against the directory; a directory that lies must not get past it.
    with zipfile.ZipFile(path) as archive:
        size = archive.getinfo("3D/3dmodel.model").file_size
    path.write_bytes(path.read_bytes().replace(size.to_bytes(4, "little"), (2000).to_bytes(4, "little")))
    with pytest.raises(ParameterError, match="3MF file that can be read"):
        read(path)


@pytest.mark.parametrize("filler", ["<metadata name='{}'>", "<!--{}-->"])
def test_a_tag_of_many_megabytes_is_not_kept_waiting_for(tmp_path, filler):
    path = packed(tmp_path / "tag.3mf", filler.format(8_000_000 * "a") + OBJECT, ITEM)
    with pytest.raises(ParameterError, match="must have tags of at most 4 MB"):
        read(path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (r"(?s)(.{300}).*", rb"\1", "not a zip"),
        ("(?s).*", b"", "not a zip"),
        ("3dmodel.model", b"3dmodel.other", "3MF file that can be read"),
        ("_rels/.rels", b"_rels/.rals", "no item named '_rels/.rels'"),
    ],
)
def test_a_damaged_zip_is_refused(tmp_path, old, new, said):
    path = packed(tmp_path / "x.3mf", OBJECT, ITEM)
    path.write_bytes(re.sub(old.encode(), new, path.read_bytes()))
    with pytest.raises(ParameterError, match=said):
        read(path)


def test_more_parts_than_allowed_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(threemf_reader, "MOST_PARTS", 999)
    # 111 objects, components and items make 1000 meshes.
    with pytest.raises(ParameterError, match=r"must place at most 999 meshes .got x.3mf: 1,000"):
        read(packed(tmp_path / "x.3mf", nested(3, copies=10), '<item objectid="3"/>'))
    with pytest.raises(ParameterError, match="at most 999 objects, components and items"):
        read(packed(tmp_path / "x.3mf", OBJECT, 999 * ITEM))
