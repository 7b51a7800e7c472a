"""Kinds of mesh: what is made of a formed surface, with values of vertices and groups of faces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from digiclay.core.base.errors import OutputError, ParameterError
from digiclay.core.mesh_io import mesh_reader
from digiclay.core.mesh_io.export_model import KINDS, Model, make_bodies
from digiclay.core.mesh_io.mesh_writer import FORMATS, find_suffix, write
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.surface.features import Finding
from digiclay.core.surface.formed import NO_PIN, Body, Formed, make_formed

from tests.prisms import compute_volume, prism_volume

ARRANGEMENTS = ("aligned", "staggered", "hexagonal")


def formed(arrangement: str = "aligned") -> Formed:
    """A boss, a crease, level ground between them; every pin with a force and a mode of its own."""
    place = make_grid(Layout(rows=12, columns=14, arrangement=arrangement)).positions
    x, y = place.T * 1e3
    raised = 5.0 * np.exp(-((x + 9) ** 2 + y**2) / 20.0) - 4.0 * np.exp(-((x - 9) ** 2 + y**2) / 20.0)
    force, mode = np.arange(168) / 100.0, np.arange(168) % 8
    return Formed.of(place, 0.04 + raised * 1e-3, 0.04, force, mode)


def mesh(body: Body) -> trimesh.Trimesh:
    return trimesh.Trimesh(body.vertices, body.faces, process=False)


#: Pins have no skin; between shifted rows each skin has rules of its own.
KINDS_AND_SKINS = [("pins", "bilinear")] + [
    (kind, skin) for kind in KINDS if kind != "pins" for skin in ("bilinear", "smooth", "membrane")
]


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize(("kind", "skin"), KINDS_AND_SKINS)
def test_every_kind_is_consistent_and_all_but_the_skin_are_watertight(kind, skin, arrangement):
    for body in make_bodies(formed(arrangement), Model(kind=kind, skin=skin), Finding()):
        made = mesh(body)
        assert made.is_watertight == body.closed == (kind != "surface")
        assert made.is_winding_consistent
        if body.closed:
            assert made.volume > 0.0
            assert compute_volume(body) == pytest.approx(made.volume, rel=1e-9)


def touching(arrangement: str, seed: int) -> Formed:
    """Ridges with mounds on them, up and down, turned and beside the middle."""
    place = make_grid(Layout(rows=26, columns=25, arrangement=arrangement)).positions
    random = np.random.default_rng(seed)
    turn, (x, y) = random.uniform(0.0, 2.0 * np.pi), (place * 1e3 + random.uniform(-4.0, 4.0, 2)).T
    along, aside = np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x
    raised = np.zeros(len(place))
    for sign in (1.0, -1.0):
        off = np.hypot(np.clip(np.abs(along) - 16.0, 0.0, None), aside - sign * 12.0)
        ridge = 12.0 * np.clip(1.0 - (off / 7.0) ** 2, 0.0, None)
        mound = 24.0 * np.clip(1.0 - np.hypot(along - 14.0, aside - sign * 12.0) ** 2 / 81.0, 0.0, None)
        raised += sign * np.maximum(ridge, mound)
    return Formed.of(place, 0.04 + raised * 1e-3, 0.04, 0.0, 0)


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
@pytest.mark.parametrize(("kind", "skin"), [pair for pair in KINDS_AND_SKINS if pair[0] != "surface"])
def test_a_file_is_watertight_after_its_vertices_are_welded(tmp_path, kind, skin, arrangement):
    made = make_bodies(touching(arrangement, 1), Model(kind=kind, skin=skin, resolution=2))
    assert len(made) == (4 if kind == "features" else 1)
    for name in FORMATS if (skin, arrangement) == ("bilinear", "aligned") else ("stl",):
        path = write(made, tmp_path / f"welded{find_suffix(name)}", kind=name)
        read = mesh_reader.read(path)
        welded = trimesh.Trimesh(read.vertices.astype(np.float32), read.faces, process=False)
        welded.merge_vertices()
        _, counts = np.unique(welded.edges_sorted, axis=0, return_counts=True)
        assert set(counts) == {2}, name


@pytest.mark.parametrize("arrangement", ARRANGEMENTS)
def test_the_solid_of_the_bilinear_skin_has_the_volume_of_its_prisms(arrangement):
    bed = formed(arrangement)
    (body,) = make_bodies(bed, Model())
    known = prism_volume(bed.position, bed.height, bed.rows, bed.columns)
    assert compute_volume(body) == pytest.approx(known, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_every_vertex_knows_height_force_and_mode_and_the_base_that_it_belongs_to_no_pin(kind):
    bed = formed()
    for body in make_bodies(bed, Model(kind=kind)):
        height, force, mode = body.values.values()
        assert tuple(body.values) == ("height", "force", "mode")
        np.testing.assert_array_equal(height, body.vertices[:, 2])
        assert set(np.unique(mode)) <= {NO_PIN, *range(8)}
        assert 0.0 <= force.min() <= force.max() <= bed.force.max()
        if kind != "features":  # pin tops first
            np.testing.assert_array_equal([force[:168], mode[:168]], [bed.force, bed.mode])
        if kind in ("solid", "pins"):
            np.testing.assert_array_equal(mode == NO_PIN, height == height.min())


def test_all_of_a_pins_top_has_the_values_of_that_pin():
    place, steps = formed().position, np.random.default_rng(4).permutation(168)
    (body,) = make_bodies(Formed.of(place, 0.04 + 1e-4 * steps, 0.04, steps / 100.0, 0), Model(kind="pins"))
    over = body.values["mode"] != NO_PIN
    assert over.sum() > 4 * 168
    # Each height is that of one pin, and its force is a hundredth of the steps it is up.
    up = np.rint((body.vertices[over, 2] - 0.04) / 1e-4)
    np.testing.assert_allclose(body.values["force"][over], up / 100.0, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("kind", "parts"), [("surface", 1), ("solid", 3), ("pins", 1)])
def test_each_feature_is_a_group_of_faces_over_its_pins(kind, parts):
    bed = formed()
    (body,) = make_bodies(bed, Model(kind=kind, resolution=parts), Finding())
    assert body.groups == ("boss_1", "crease_1")
    assert len(body.group) == len(body.faces)
    middle = body.vertices[body.faces].mean(axis=1)
    for number, x in ((1, -9e-3), (2, 9e-3)):
        mine = middle[body.group == number]
        assert len(mine) > 20
        assert np.linalg.norm(mine[:, :2] - (x, 0.0), axis=1).max() < 12e-3


def test_features_are_bodies_of_their_own_name_and_groups_only_after_a_search():
    assert [body.name for body in make_bodies(formed(), Model(kind="features"))] == ["boss_1", "crease_1"]
    (body,) = make_bodies(formed(), Model())
    assert (body.groups, body.group.size) == ((), 0)


def test_a_surface_without_features_says_what_was_looked_for():
    place = formed().position
    with pytest.raises(OutputError, match=r"no feature of at least 3 pins more than 0\.5 mm off the former"):
        make_bodies(Formed.of(place, np.full(168, 0.04), 0.04, 0.0, 0), Model(kind="features"))


def test_a_skin_of_too_many_points_is_refused_before_it_is_made():
    place = make_grid(Layout(rows=400, columns=400)).positions
    bed = Formed.of(place, np.full(160_000, 0.04), 0.04, 0.0, 0)
    with pytest.raises(ParameterError, match=r"^Model\.resolution must be low enough for 50 million points"):
        make_bodies(bed, Model(resolution=40))


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"kind": "cloud"}, "kind must be one of solid, surface, pins, features"),
        ({"skin": "silk"}, "skin must be one of bilinear, smooth, membrane"),
        ({"resolution": -1}, "resolution must be at least 0"),
        ({"resolution": 65}, "resolution must be at most 64"),
        ({"base_thickness": 0.0}, "base_thickness must be above 0 m"),
        ({"base_thickness": np.nan}, "base_thickness must be a finite number"),
        ({"cap": -1.0}, "cap must be above 0 m"),
    ],
)
def test_a_model_that_makes_no_sense_is_refused(told, said):
    with pytest.raises(ParameterError, match=f"^Model\\.{said}"):
        Model(**told)


def history() -> dict[str, np.ndarray]:
    bed = formed()
    rows = {"height": [np.full(168, 0.04), bed.height], "force": [bed.force] * 2, "mode": [bed.mode] * 2}
    return {"position": bed.position} | {name: np.stack(both) for name, both in rows.items()}


def test_the_former_surface_is_a_row_or_one_height_that_the_history_has():
    np.testing.assert_allclose(make_formed(history(), -1, 0).raised, formed().raised)
    np.testing.assert_allclose(make_formed(history(), -1, 0.035).raised, formed().raised + 0.005, atol=1e-15)
    assert not make_formed(history(), 1, 1).raised.any()
    said = r"^The history has 2 rows, 0 to 1 \(got -?\d as (row|former)\)\.$"
    for row, former in ((2, 0), (-3, 0), (0, 2), (0, -3)):
        with pytest.raises(OutputError, match=said):
            make_formed(history(), row, former)


@pytest.mark.parametrize(("name", "bad"), [("height", np.nan), ("former", np.inf), ("force", np.nan)])
def test_values_that_are_not_finite_are_refused_by_cell(name, bad):
    known = {"height": np.full(168, 0.04), "former": 0.04, "force": 0.0, "mode": 0}
    known[name] = np.where(np.arange(168) == 7, bad, 0.04)
    with pytest.raises(ParameterError, match=rf"^Surface\.{name} must be finite \(got {bad} at cell 7\)"):
        Formed.of(formed().position, **known)
