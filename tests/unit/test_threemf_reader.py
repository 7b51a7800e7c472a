"""3MF files read without a library: units, placements, components, and what is made to break a reader."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import lib3mf
import numpy as np
import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.mesh_io import mesh_limits, mesh_writer, threemf_reader
from digiclay.core.mesh_io.mesh_reader import read
from digiclay.core.mesh_io.mesh_writer import CORE, HEAD, RELATIONS, TYPES
from digiclay.core.surface.formed import Body

#: A tetrahedron without symmetry: its volume's sign tells a turn from a reflection.
PLACES = np.array([[0.0, 0, 0], [5, 0, 0], [0, 7, 0], [0, 0, 11]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
MESH = (
    "<mesh><vertices>"
    + "".join('<vertex x="{:g}" y="{:g}" z="{:g}"/>'.format(*row) for row in PLACES)
    + "</vertices><triangles>"
    + "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in FACES)
    + "</triangles></mesh>"
)


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Return the volume a closed mesh encloses, negative when it is turned inside out."""
    one, two, three = (vertices[faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", one, np.cross(two, three)) / 6.0)


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
        for column, value in enumerate(row):
            made.Fields[index][column] = value
    return made


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_the_3mf_that_is_written_is_read_back(tmp_path: Path, unit: str) -> None:
    body = Body("tetrahedron", PLACES * 1e-3, FACES.astype(np.int32), closed=True)
    mesh_writer.write([body], tmp_path / "own.3mf", unit)
    back = read(tmp_path / "own.3mf")
    assert back.length == {"mm": 1e-3, "m": 1.0}[unit]
    np.testing.assert_allclose(back.vertices * back.length, PLACES * 1e-3, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(back.faces, FACES)


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
    assert volume(back.vertices, back.faces) == pytest.approx(4 * 5 * 7 * 11 / 6, rel=1e-5)


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
    resources = "".join(
        f'<object id="{number}" type="{kind}">{MESH}</object>'
        for number, kind in enumerate(("model", "support", "solidsupport", "model"), 1)
    )
    path = packed(
        tmp_path / "some.3mf", resources, '<item objectid="1"/><item objectid="2"/><item objectid="3"/>'
    )
    assert len(read(path).faces) == 4


def cube_of(levels: int) -> str:
    """Return objects each of which is ten of the one before."""
    text = f'<object id="0">{MESH}</object>'
    for level in range(levels):
        ten = 10 * f'<component objectid="{level}"/>'
        text += f'<object id="{level + 1}"><components>{ten}</components></object>'
    return text


def chain_of(length: int) -> str:
    """Return objects each of which is the one before."""
    text = f'<object id="0">{MESH}</object>'
    for level in range(length):
        text += f'<object id="{level + 1}"><components><component objectid="{level}"/></components></object>'
    return text


LAUGHS = "".join(f'<!ENTITY {name} "{10 * f"&{other};"}">' for other, name in pairwise("abcdefghij"))
ENTITIES = f'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">{LAUGHS}]>'
OBJECT = f'<object id="1">{MESH}</object>'
ITEM = '<item objectid="1"/>'


@pytest.mark.parametrize(
    ("resources", "build", "head", "said"),
    [
        (OBJECT, ITEM, ENTITIES, "must not have a document type"),
        (OBJECT, ITEM, '<!DOCTYPE x SYSTEM "file:///dev/zero">', "must not have a document type"),
        (cube_of(60), '<item objectid="60"/>', "", "20 million triangles (got x.3mf: more than 10^15)"),
        (chain_of(2000), '<item objectid="2000"/>', "", "components at most 64 deep"),
        # The same chain, whose lower half is measured before its upper one.
        (chain_of(100), '<item objectid="50"/><item objectid="100"/>', "", "components at most 64 deep"),
        (
            '<object id="1"><components><component objectid="1"/></components></object>',
            ITEM, "", "components at most 64 deep, and none in itself",
        ),
        (OBJECT, '<item objectid="2"/>', "", "no object 2 in 3D/3dmodel.model"),
        (OBJECT.replace('v3="3"', 'v3="4"'), ITEM, "", "corners are among its vertices (got x.3mf: corner 4"),
        (OBJECT.replace('v3="3"', 'v3="-1"'), ITEM, "", "corners are among its vertices"),
        (OBJECT.replace('x="5"', 'x="five"'), ITEM, "", "could not convert string to float"),
        (OBJECT.replace('x="5"', ""), ITEM, "", "a vertex without 'x'"),
        (OBJECT.replace('v3="3"', 'v3="1' + 30 * "0" + '"'), ITEM, "", "3MF file that can be read"),
        (OBJECT, '<item objectid="1" transform="1 0 0"/>', "", "a transform of 3 numbers"),
        (OBJECT[:-9], ITEM, "", "mismatched tag"),
        (
            '<object id="1"><components><component objectid="1" p:path="/3D/no.model"/></components>'
            "</object>",
            ITEM, "", "no item named '3D/no.model'",
        ),
    ],
)  # fmt: skip
def test_what_would_break_a_reader_is_refused(
    tmp_path: Path, resources: str, build: str, head: str, said: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        read(packed(tmp_path / "x.3mf", resources, build, head))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_zip_that_unpacks_to_more_than_is_allowed_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = packed(tmp_path / "bomb.3mf", OBJECT + 3_000_000 * " ", ITEM)
    assert path.stat().st_size < 20_000
    read(path)
    monkeypatch.setattr(mesh_limits, "MOST_BYTES", 2_000_000)
    with pytest.raises(ParameterError, match=r"at most 0.002 GB unpacked .got bomb.3mf: 3D/3dmodel"):
        read(path)


def test_a_zip_gives_no_more_than_its_directory_says(tmp_path: Path) -> None:
    # The limit is checked against the directory; a directory that lies must not get past it.
    path = packed(tmp_path / "liar.3mf", OBJECT + 3_000_000 * " ", ITEM)
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
    ("spoil", "said"),
    [
        (lambda data: data[: len(data) // 2], "not a zip"),
        (lambda data: b"", "not a zip"),
        (lambda data: data.replace(b"3dmodel.model", b"3dmodel.other"), "3MF file that can be read"),
        (lambda data: data.replace(b"_rels/.rels", b"_rels/.rals"), "no item named '_rels/.rels'"),
    ],
)
def test_a_damaged_zip_is_refused(tmp_path: Path, spoil: Callable[[bytes], bytes], said: str) -> None:
    path = packed(tmp_path / "x.3mf", OBJECT, ITEM)
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(ParameterError) as caught:
        read(path)
    assert said in str(caught.value)


def test_more_parts_than_allowed_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threemf_reader, "MOST_PARTS", 999)
    # 111 objects, components and items make 1000 meshes.
    with pytest.raises(ParameterError, match=r"must place at most 999 meshes .got x.3mf: 1,000"):
        read(packed(tmp_path / "x.3mf", cube_of(3), '<item objectid="3"/>'))
    with pytest.raises(ParameterError, match="at most 999 objects, components and items"):
        read(packed(tmp_path / "x.3mf", OBJECT, 999 * ITEM))
