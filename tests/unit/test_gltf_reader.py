"""glTF files: what they can say, what they may not refer to, and what is made to break a reader."""

from __future__ import annotations

import base64
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io.mesh_reader import read

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


def with_uri(uri: str) -> Callable[[dict[str, Any]], None]:
    """Return a change that takes the bytes from elsewhere."""
    return lambda tree: tree["buffers"][0].update(uri=uri)


def test_nodes_stand_where_trimesh_puts_them(tmp_path: Path) -> None:
    turn = trimesh.transformations.quaternion_from_euler(0.3, 0.5, -0.8)
    scene = trimesh.Scene()
    tetrahedron = trimesh.Trimesh(PLACES, FACES, process=False)
    inner = trimesh.transformations.quaternion_matrix(turn)
    inner[:3, 3] = 1.0, 2.0, 3.0
    scene.add_geometry(tetrahedron, node_name="a", transform=inner)
    scene.add_geometry(
        tetrahedron, node_name="b", parent_node_name="a", transform=np.diag([2.0, 3.0, 0.5, 1.0])
    )
    path = tmp_path / "nodes.glb"
    scene.export(path)
    judge = trimesh.load_mesh(path, process=False)
    back = read(path)
    np.testing.assert_allclose(np.sort(back.vertices, 0), np.sort(judge.vertices, 0), rtol=0.0, atol=1e-6)
    moved = trimesh.Trimesh(back.vertices, back.faces, process=False)
    assert moved.volume == pytest.approx(judge.volume, rel=1e-6)


def test_a_node_is_turned_shifted_and_stretched_as_trimesh_has_it(tmp_path: Path) -> None:
    parts = {"rotation": [0.1, -0.5, 0.7, 0.5], "scale": [1.0, 2.0, -3.0], "translation": [4.0, 5.0, 6.0]}
    path = gltf(tmp_path, lambda tree: tree["nodes"][0].update(parts))
    back, judge = read(path), trimesh.load_mesh(path, process=False)
    np.testing.assert_allclose(back.vertices, judge.vertices, rtol=0.0, atol=1e-6)
    assert trimesh.Trimesh(back.vertices, back.faces, process=False).volume > 0.0


@pytest.mark.parametrize(("mode", "corners"), [(5, [0, 1, 2, 3, 0]), (6, [0, 1, 2, 3])])
def test_strips_and_fans_are_cut_into_triangles(tmp_path: Path, mode: int, corners: list[int]) -> None:
    def change(tree: dict[str, Any]) -> None:
        data = PLACES.astype("<f4").tobytes() + np.array(corners, "<u2").tobytes()
        tree["buffers"] = [
            {"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}
        ]
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
    ["../bytes.bin", "../../../../dev/zero", "/dev/zero", "sub/../../bytes.bin", "%2e%2e/bytes.bin",
     "..%2fbytes.bin",
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


def test_a_pipe_or_a_device_beside_the_gltf_is_not_opened(tmp_path: Path) -> None:
    path = gltf(tmp_path, with_uri("pipe.bin"))
    os.mkfifo(tmp_path / "pipe.bin")
    with pytest.raises(ParameterError, match="must have its files beside it"):
        read(path)


def test_the_pictures_of_a_gltf_are_not_opened(tmp_path: Path) -> None:
    def change(tree: dict[str, Any]) -> None:
        tree["images"], tree["textures"] = [{"uri": "pipe.png"}, {"uri": "../../dev/zero"}], [{"source": 0}]
        tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
        tree["meshes"][0]["primitives"][0]["material"] = 0

    os.mkfifo(tmp_path / "pipe.png")
    np.testing.assert_array_equal(read(gltf(tmp_path, change)).faces, FACES)


def many_nodes(tree: dict[str, Any]) -> None:
    """Place a mesh of 30 000 corners, three bytes and their repetition, a thousand times."""
    tree["nodes"], tree["scenes"] = [{"mesh": 0} for _ in range(1001)], [{"nodes": list(range(1001))}]
    data = bytes(60_000)
    tree["bufferViews"][1] = {"buffer": 1, "byteLength": len(data)}
    tree["buffers"].append(
        {"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}
    )
    tree["accessors"][1]["count"] = 30_000
    tree["nodes"] *= 3
    tree["scenes"][0]["nodes"] = list(range(3003))


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
def test_a_gltf_that_makes_no_sense_is_refused(
    tmp_path: Path, change: Callable[[dict[str, Any]], None], said: str
) -> None:
    began = time.monotonic()
    with pytest.raises(ParameterError) as caught:
        read(gltf(tmp_path, change))
    assert said in str(caught.value)
    assert time.monotonic() - began < 2.0


def test_a_gltf_nested_without_end_is_refused(tmp_path: Path) -> None:
    (tmp_path / "deep.gltf").write_text("[" * 100_000, encoding="utf-8")
    with pytest.raises(ParameterError, match="nested too deeply"):
        read(tmp_path / "deep.gltf")
