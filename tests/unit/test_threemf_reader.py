"""3MF files: objects, components and items, extensions, and what would break a reader."""

import math
import re
import zipfile
from itertools import pairwise

import lib3mf
import numpy as np
import pytest
import trimesh
from digiclay.core.mesh_io import mesh_limits, threemf_reader
from digiclay.core.mesh_io.mesh_reader import read
from digiclay.core.mesh_io.mesh_writer import CORE, HEAD, RELATIONS, TYPES

from tests.assemble import assert_near
from tests.mesh_files import FACES, PLACES, VOLUME, assert_refused

PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
MESH = (
    "<mesh><vertices>"
    + "".join('<vertex x="{:g}" y="{:g}" z="{:g}"/>'.format(*row) for row in PLACES)
    + "</vertices><triangles>"
    + "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in FACES)
    + "</triangles></mesh>"
)
OBJECT = f'<object id="1">{MESH}</object>'


def packed(path, resources, build, head="", unit="millimeter", **parts):
    """Write a 3MF of a model's resources and build, and of further parts."""
    model = f'{HEAD}{head}<model unit="{unit}" xmlns="{CORE}" xmlns:p="{PRODUCTION}">'
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", TYPES)
        archive.writestr("_rels/.rels", RELATIONS)
        archive.writestr(
            "3D/3dmodel.model",
            f"{model}<resources>{resources}</resources><build>{build}</build></model>",
        )
        for name, text in parts.items():
            archive.writestr(
                f"3D/{name}.model", f"{model}<resources>{text}</resources><build/></model>"
            )
    return path


def placed(number, *rows, kind="component"):
    """Return a component or an item: an object at a placement, its rows (4, 3)."""
    transform = " ".join(f"{value:.9g}" for row in rows for value in row)
    return f'<{kind} objectid="{number}" transform="{transform}"/>'


def test_components_and_items_stand_where_lib3mf_puts_them(tmp_path):
    c, s = math.cos(0.5), math.sin(0.5)
    inner = placed(1, (c, s, 0), (-s, c, 0), (0, 0, 2), (1, 2, 3)) + '<component objectid="1"/>'
    outer = placed(2, (1, 0, 0), (0, c, s), (0, -s, c), (0, 40, 0))
    objects = "".join(
        f'<object id="{number}"><components>{inside}</components></object>'
        for number, inside in ((2, inner), (3, outer))
    )
    mirrored = placed(3, (-1, 0, 0), (0, 1, 0), (0, 0, 1), (10, 0, 0), kind="item")
    above = placed(1, (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 50), kind="item")
    path = packed(tmp_path / "placed.3mf", OBJECT + objects, mirrored + above, unit="inch")
    judge = lib3mf.Wrapper().CreateModel()
    judge.QueryReader("3mf").ReadFromFile(str(path))
    objects = judge.MergeToModel().GetMeshObjects()
    points = []
    while objects.MoveNext():
        points += [list(one.Coordinates) for one in objects.GetCurrentMeshObject().GetVertices()]
    back = read(path)
    assert back.length == 25.4e-3
    # lib3mf has 32-bit numbers.
    assert_near(np.sort(back.vertices, 0), np.sort(np.array(points), 0), 1e-5)
    # Three times as it is, once stretched to double, the mirrored ones turned the right way out
    # again.
    volume = trimesh.Trimesh(back.vertices, back.faces, process=False).volume
    assert volume == pytest.approx(4 * VOLUME, rel=1e-5)


def test_a_part_that_another_one_names_is_read_and_supports_and_what_is_not_built_are_left_away(
    tmp_path,
):
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
    resources = "".join(
        f'<object id="{number}" type="{kind}">{MESH}</object>' for number, kind in kinds
    )
    build = "".join(f'<item objectid="{number}"/>' for number in (1, 2, 3))
    assert len(read(packed(tmp_path / "some.3mf", resources, build)).faces) == 4


def nested(levels, copies=1):
    """Return objects each of which is some of the one before."""
    text = f'<object id="0">{MESH}</object>'
    for level in range(levels):
        inside = copies * f'<component objectid="{level}"/>'
        text += f'<object id="{level + 1}"><components>{inside}</components></object>'
    return text


LAUGHS = "".join(
    f'<!ENTITY {name} "{10 * f"&{other};"}">' for other, name in pairwise("abcdefghij")
)
ENTITIES = f'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">{LAUGHS}]>'
OWN = '<components><component objectid="1"/></components>'
ITEM = '<item objectid="1"/>'


@pytest.mark.parametrize(
    "resources, build, head, said",
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
    assert_refused(packed(tmp_path / "x.3mf", resources, build, head), said)


@pytest.mark.parametrize("prefixes, taken", [("p", True), ("p b", False), ("unheard", False)])
def test_a_3mf_that_needs_an_extension_is_refused_with_its_name(tmp_path, prefixes, taken):
    beams = "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"
    path = packed(tmp_path / "x.3mf", OBJECT, ITEM)
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    needs = f'<model xmlns:b="{beams}" requiredextensions="{prefixes}" '.encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data.replace(b"<model ", needs))
    if taken:
        assert len(read(path).faces) == len(FACES)
        return
    assert_refused(path, f"model: needs {beams if 'b' in prefixes else prefixes}"[:90])


def test_a_zip_that_unpacks_to_more_than_is_allowed_is_not_unpacked(tmp_path, monkeypatch):
    path = packed(tmp_path / "bomb.3mf", OBJECT + 3_000_000 * " ", ITEM)
    assert path.stat().st_size < 20_000
    read(path)
    monkeypatch.setattr(mesh_limits, "MOST_BYTES", 2_000_000)
    assert_refused(path, "at most 0.002 GB unpacked (got bomb.3mf: 3D/3dmodel")
    # The limit is checked against the directory; a directory that lies must not get past it.
    with zipfile.ZipFile(path) as archive:
        size = archive.getinfo("3D/3dmodel.model").file_size
    path.write_bytes(
        path.read_bytes().replace(size.to_bytes(4, "little"), (2000).to_bytes(4, "little"))
    )
    assert_refused(path, "3MF file that can be read")


@pytest.mark.parametrize("filler", ["<metadata name='{}'>", "<!--{}-->"])
def test_a_tag_of_many_megabytes_is_not_kept_waiting_for(tmp_path, filler):
    path = packed(tmp_path / "tag.3mf", filler.format(8_000_000 * "a") + OBJECT, ITEM)
    assert_refused(path, "must have tags of at most 4 MB")


@pytest.mark.parametrize(
    "old, new, said",
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
    assert_refused(path, said)


def test_more_parts_than_allowed_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(threemf_reader, "MOST_PARTS", 999)
    # 111 objects, components and items make 1000 meshes.
    path = packed(tmp_path / "x.3mf", nested(3, copies=10), '<item objectid="3"/>')
    assert_refused(path, "must place at most 999 meshes (got x.3mf: 1,000")
    path = packed(tmp_path / "x.3mf", OBJECT, 999 * ITEM)
    assert_refused(path, "at most 999 objects, components and items")
