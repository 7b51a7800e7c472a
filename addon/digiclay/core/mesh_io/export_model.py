"""Bodies of a formed surface for export: skin, solid, pins, or features."""

from dataclasses import dataclass, replace

import numpy as np

from ..base.arrays import Faces, Floats, Indices
from ..base.errors import OutputError, ParameterError
from ..base.quantity import Parameters, quantity
from ..surface.features import Feature, Finding, find
from ..surface.formed import BASE_THICKNESS, NO_PIN, Body, Formed, make_solid
from ..surface.pins_solid import make_pins_solid
from ..surface.skins import SKINS, SurfaceGrid, fit_skin

#: Kinds of mesh, by name, with their lines in the help.
KINDS: dict[str, str] = {
    "solid": "the skin with a base and walls, watertight",
    "surface": "the skin alone, open",
    "pins": "the stepped bed as one printable body, watertight",
    "features": "each boss as a body, each crease as the body that fills it",
}
#: Default points per pitch of a skin that is not straight between the pins.
CURVED = 4
#: Most points of a skin: a few GB of memory, and more than other programs read.
MOST_POINTS = 50_000_000


@dataclass(frozen=True, eq=False, repr=False)
class Model(Parameters):
    """Selection of bodies of a formed surface."""

    kind: str = quantity("solid", "kind of mesh", choices=tuple(KINDS))
    skin: str = quantity("bilinear", "skin between the pins; pins have none", choices=tuple(SKINS))
    resolution: int = quantity(
        0,
        f"points per pitch; 0 is 1 for the bilinear skin and {CURVED} for the others",
        at_least=0,
        at_most=64,
    )
    base_thickness: float = quantity(
        BASE_THICKNESS,
        "material under the lowest point of solid and pins",
        unit="m",
        above=0.0,
        at_most=1.0,
    )
    cap: float = quantity(
        1e-3,
        "radius of a pin's flat end, on which the membrane lies",
        unit="m",
        above=0.0,
        at_most=1.0,
    )

    @property
    def parts(self) -> int:
        """Points per pitch."""
        return self.resolution or (1 if self.skin == "bilinear" else CURVED)


def make_skin_grid(formed: Formed, model: Model) -> SurfaceGrid:
    """Return the skin of a model."""
    points = model.parts**2 * len(formed.height)
    if points > MOST_POINTS:
        rule = f"must be low enough for {MOST_POINTS // 1_000_000} million points on this bed"
        value = f"{model.parts}: {points / 1e6:.3g} million points"
        raise ParameterError("Model", "resolution", rule, value)
    return fit_skin(formed, model.skin, model.parts, model.cap)


def find_features(formed: Formed, model: Model, finding: Finding) -> list[Feature]:
    """Return the features of the skin of a model."""
    return find(make_skin_grid(formed, model), finding)


def make_bodies(formed: Formed, model: Model, finding: Finding | None = None) -> list[Body]:
    """Return the bodies of a model, in m."""
    skin = make_skin_grid(formed, model)
    if model.kind == "features":
        features = find(skin, finding)
        if not features:
            criteria = finding or Finding()
            wanted = f"at least {criteria.smallest} pins more than {criteria.threshold * 1e3:g} mm"
            raise OutputError(
                f"There is no feature of {wanted} off the former surface: lower the threshold or the "
                "smallest number of pins."
            )
        bodies = []
        for feature in features:
            body = make_feature_solid(feature)
            nearest = formed.nearest(body.vertices[:, :2])
            bodies.append(replace(body, values=_of_pins(formed, body.vertices, nearest)))
        return bodies
    features = find(skin, finding) if finding else []
    names = tuple(feature.name for feature in features)
    label = np.zeros(len(formed.height), np.int32)
    for number, feature in enumerate(features, 1):
        label[feature.pins] = number
    if model.kind == "pins":
        return [_pins(formed, model, names, label)]
    return [_skin(skin, model, names, label)]


def _skin(grid: SurfaceGrid, model: Model, names: tuple[str, ...], label: Faces) -> Body:
    """Return the skin, or the solid under it; a triangle belongs to the feature of any of its corners."""
    closed = model.kind != "surface"
    if not closed:
        vertices, faces = np.column_stack([grid.position, grid.height]), grid.faces
        values = grid.values()
    else:
        shape = grid.rows, grid.columns
        vertices, faces = make_solid(grid.position, grid.height, *shape, model.base_thickness)
        values = grid.values_with_base(vertices[-1, 2])
    group, vertex_group = np.empty((2, 0), np.int32)
    if names:
        group, vertex_group = np.zeros(len(faces), np.int32), np.zeros(len(vertices), np.int32)
        over = faces[: 2 * (grid.rows - 1) * (grid.columns - 1)]
        vertex_group[: len(grid.height)] = grid.nearest(label)
        group[: len(over)] = vertex_group[over].max(axis=1)
    return Body("clay", vertices, faces, values, names, group, vertex_group, closed)


def _pins(formed: Formed, model: Model, names: tuple[str, ...], label: Faces) -> Body:
    """Return the stepped bed; walls and undersides belong to the feature of their pin."""
    vertices, faces, pin = make_pins_solid(formed, model.base_thickness)
    owner = np.full(len(vertices), NO_PIN)
    # Every vertex above the base is a corner or the middle of a pin's top, whose triangles begin
    # with the middle.
    tops = faces[:, 0] < len(formed.height)
    owner[faces[tops]] = pin[tops, None]
    group, vertex_group = np.empty((2, 0), np.int32)
    if names:
        group, vertex_group = label[pin], np.where(owner >= 0, label[owner], 0).astype(np.int32)
    return Body(
        "pins", vertices, faces, _of_pins(formed, vertices, owner), names, group, vertex_group
    )


def _of_pins(formed: Formed, vertices: Floats, owner: Indices) -> dict[str, Floats]:
    """Return height, force and mode at vertices, each of one pin or none."""
    pinned = owner >= 0
    return {
        "height": vertices[:, 2].copy(),
        "force": np.where(pinned, formed.force[owner], 0.0),
        "mode": np.where(pinned, formed.mode[owner], NO_PIN).astype(np.float64),
    }


def make_feature_solid(feature: Feature) -> Body:
    """Return the closed body between the surface now and before: a boss, or the filling of a crease."""
    region = feature.apart
    count = len(region.position)
    now = region.former + (region.off if feature.kind == "boss" else -region.off)
    over, under = np.maximum(now, region.former), np.minimum(now, region.former)
    vertices = np.column_stack([np.tile(region.position, (2, 1)), np.append(over, under)])
    # Walls are as high as the threshold: booleans of other programs fail at an edge without height.
    start, end = region.outline().T
    walls = [[start, start + count, end + count], [start, end + count, end]]
    sides = [np.stack(corners, axis=1) for corners in walls]
    faces = np.concatenate([region.faces, region.faces[:, ::-1] + count, *sides]).astype(np.int32)
    return Body(feature.name, vertices, faces)
