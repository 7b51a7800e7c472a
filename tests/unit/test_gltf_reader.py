"""glTF and 3MF: what they can say, what they may not refer to, and what is made to break a reader."""

from __future__ import annotations

import base64
import json
import math
import os
import re
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
from digiclay.core.mesh_io import mesh_limits, threemf_reader
from digiclay.core.mesh_io.mesh_reader import read
from digiclay.core.mesh_io.mesh_writer import CORE, HEAD, RELATIONS, TYPES

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


def test_nodes_are_turned_shifted_and_stretched_as_trimesh_has_them(tmp_path: Path) -> None:
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
def test_strips_and_fans_are_cut_into_triangles(tmp_path: Path, mode: int, corners: list[int]) -> None:
    def change(tree: dict[str, Any]) -> None:
        data = PLACES.astype("<f4").tobytes() + np.array(corners, "<u2").tobytes()
        tree["buffers"] = [inline(data)]
        tree["bufferViews"][1]["byteLength"] = 2 * len(corners)
        tree["accessors"][1]["count"] = len(corners)
        tree["meshes"][0]["primitives"][0]["mode"] = mode

    wanted = {5: [[0, 1, 2], [1, 3, 2], [2, 3, 0]], 6: [[0, 1, 2], [0, 2, 3]]}[mode]
    np.testing.assert_array_equal(read(gltf(tmp_path, change)).faces, wanted)


def test_bytes_beside_the_gltf_are_read(tmp_path: Path) -> None:
    (tmp_path / "a folder").mkdir()
    path = gltf(tmp_path, with_uri("bytes.bin"))
    np.testing.assert_array_equal(read(path).vertices, PLACES)
    (tmp_path / "bytes.bin").rename(tmp_path / "a folder" / "bytes.bin")
    np.testing.assert_array_equal(read(gltf(tmp_path, with_uri("a%20folder/bytes.bin"))).vertices, PLACES)


@pytest.mark.parametrize(
    "uri",
    ["../bytes.bin", "/dev/zero", "sub/../../bytes.bin", "%2e%2e/bytes.bin", "..%2fbytes.bin",
     "file:///dev/zero", "http://localhost/bytes.bin", "https://localhost/b", "//host/b", "C:/bytes.bin",
     "..\\bytes.bin", "\\\\host\\b", "link.bin", "a\0b"],
)  # fmt: skip
def test_bytes_from_elsewhere_are_refused(tmp_path: Path, uri: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    path = gltf(inner, with_uri(uri))
    (tmp_path / "bytes.bin").write_bytes((inner / "bytes.bin").read_bytes())
    (inner / "link.bin").symlink_to("/dev/zero")
    with pytest.raises(ParameterError, match="must have its vertices in the file, or in a file"):
        read(path)


def test_a_pipe_beside_the_gltf_is_not_opened_and_endless_nesting_is_refused(tmp_path: Path) -> None:
    path = gltf(tmp_path, with_uri("pipe.bin"))
    os.mkfifo(tmp_path / "pipe.bin")
    with pytest.raises(ParameterError, match="must have its files beside it"):
        read(path)
    path.write_text("[" * 100_000, encoding="utf-8")
    with pytest.raises(ParameterError, match="nested too deeply"):
        read(path)


def test_the_pictures_of_a_gltf_are_not_opened(tmp_path: Path) -> None:
    def change(tree: dict[str, Any]) -> None:
        tree["images"], tree["textures"] = [{"uri": "pipe.png"}, {"uri": "../../dev/zero"}], [{"source": 0}]
        tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        tree["meshes"][0]["primitives"][0]["material"] = 0

    os.mkfifo(tmp_path / "pipe.png")
    np.testing.assert_array_equal(read(gltf(tmp_path, change)).faces, FACES)


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
    began = time.monotonic()
    with pytest.raises(ParameterError, match=re.escape(said)):
        read(gltf(tmp_path, change))
    assert time.monotonic() - began < 2.0


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
    """Return a placement of lib3mf's."""
    made = lib3mf.Transform()
    for index, row in enumerate(rows):
        made.Fields[index][:] = row
    return made


def test_components_and_items_stand_where_lib3mf_puts_them(tmp_path: Path) -> None:
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


def test_a_part_that_another_one_names_is_read(tmp_path: Path) -> None:
    # As programs that prepare prints write it: each object in a part of its own.
    path = packed(
        tmp_path / "parts.3mf",
        '<object id="1"><components><component objectid="7" p:path="/3D/one.model" '
        'transform="1 0 0 0 1 0 0 0 1 100 0 0"/></components></object>',
        '<item objectid="1"/>',
        one=f'<object id="7">{MESH}</object>',
    )
    np.testing.assert_allclose(read(path).vertices, PLACES + np.array([100.0, 0.0, 0.0]))


def test_supports_and_objects_that_are_not_built_are_left_away(tmp_path: Path) -> None:
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
def test_a_tag_of_many_megabytes_is_not_kept_waiting_for(tmp_path: Path, filler: str) -> None:
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
def test_a_damaged_zip_is_refused(tmp_path: Path, old: str, new: bytes, said: str) -> None:
    path = packed(tmp_path / "x.3mf", OBJECT, ITEM)
    path.write_bytes(re.sub(old.encode(), new, path.read_bytes()))
    with pytest.raises(ParameterError, match=said):
        read(path)


def test_more_parts_than_allowed_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threemf_reader, "MOST_PARTS", 999)
    # 111 objects, components and items make 1000 meshes.
    with pytest.raises(ParameterError, match=r"must place at most 999 meshes .got x.3mf: 1,000"):
        read(packed(tmp_path / "x.3mf", nested(3, copies=10), '<item objectid="3"/>'))
    with pytest.raises(ParameterError, match="at most 999 objects, components and items"):
        read(packed(tmp_path / "x.3mf", OBJECT, 999 * ITEM))
