"""Features of a formed surface: bosses and creases, found, measured and named."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..base.arrays import Faces, Floats, Indices, find_first_largest, settle
from ..base.quantity import Parameters, quantity
from ..model.layout import list_steps
from .crest_network import find_stretch, measure_run
from .crests import Crest, Ridge, find_ridges, measure_in_space
from .regions import Region, cut, divide, label_components, list_edges
from .skins import SurfaceGrid

#: Least share of a crest that is near the straight line of its ridge, and largest share below the
#: line.
KEEPS, BELOW = 0.4, 0.1
#: A point is below the line when it is lower by this share of the line's height.
SLACK = 0.1
#: A mound rises above the ridge by this share of the ridge's height at least.
RISES = 0.3
#: A mound's foot is where it has risen by this share of its rise.
FOOT = 0.15
#: A mound extends at most this many half widths of its ridge to each side of its top.
COMPACT = 4.0
#: A peak where two ridges cross is no mound if it extends at most this many half widths to each
#: side.
CROSSING = 1.5
#: Points of a crest from which the line of its ridge is found.
POINTS = 40
#: Pairs of a position and a point of a core that are compared at once.
CHUNK = 1 << 21


def find_parts(ridge: Ridge, least: float) -> tuple[Ridge, ...]:
    """Return the parts of a ridge: itself, and the mounds on it that rise by `least`, m, or more."""
    crests, cores = [], []
    mounds: list[tuple[Floats, float]] = []
    for crest in ridge.crests:
        bare, stretches = _strip_mounds(crest, least)
        crests.append(bare)
        on_ridge = np.ones(len(crest.points), bool)
        for first, last in stretches:
            here = slice(first, last + 1)
            on_ridge[here] = False
            top = first + int(np.argmax(crest.off[here]))
            if first > 0 and last < len(crest.points) - 1:
                top = (first + last) // 2
            middle = crest.points[top, :2]
            away = float(np.hypot(*(crest.points[[first, last], :2] - middle).T).max())
            if all(np.hypot(*(middle - other)) > max(away, radius) for other, radius in mounds):
                mounds.append((middle, away))
        cores.append(crest.points[on_ridge, :2])
    if not mounds:
        return (ridge,)
    on_discs = [Ridge((), middle[None], away + ridge.half) for middle, away in mounds]
    return (Ridge(tuple(crests), np.concatenate(cores), ridge.half), *on_discs)


def measure_distances(position: Floats, every: list[Ridge]) -> Floats:
    """Return the distances (parts, k) of positions (k, 2) from each part, less half its width, m."""
    away = np.empty((len(every), len(position)))
    for number, part in enumerate(every):
        rows = max(1, CHUNK // len(part.core))
        for start in range(0, len(position), rows):
            x, y = np.moveaxis(position[start : start + rows, None] - part.core, -1, 0)
            away[number, start : start + rows] = np.hypot(x, y).min(axis=1) - part.half
    return away


def _strip_mounds(crest: Crest, least: float) -> tuple[Crest, list[tuple[int, int]]]:
    """Return a crest without the mounds on it, and the first and last point of each mound."""
    run = measure_run(crest.points[:, :2])
    line = _line(run, crest.off, crest.closed)
    if line is None:
        return crest, []
    excess = crest.off - line
    mounds: list[tuple[int, int]] = []
    untried = excess > 0.0
    while untried.any():
        top = int(np.argmax(np.where(untried, excess, -np.inf)))
        if excess[top] < max(RISES * line[top], least):
            break
        first, last = find_stretch(excess > FOOT * excess[top], top)
        untried[first : last + 1] = False
        if max(run[last] - run[top], run[top] - run[first]) > COMPACT * crest.half:
            continue
        inner = first > 0 and last < len(run) - 1
        if crest.crossed and inner and run[last] - run[first] <= 2.0 * CROSSING * crest.half:
            continue
        mounds.append((first, last))
    left = run[-1] - sum(run[last] - run[first] for first, last in mounds)
    if not mounds or left < 2.0 * crest.half:
        return crest, []
    points, off = crest.points.copy(), crest.off.copy()
    # The surface of a boss has risen, that of a crease sunk.
    sign = 1.0 if np.polyfit(crest.off, crest.points[:, 2], 1)[0] > 0.0 else -1.0
    on_ridge = np.ones(len(run), bool)
    for first, last in mounds:
        mound = slice(first, last + 1)
        points[mound, 2] -= sign * excess[mound]
        off[mound] = line[mound]
        top = first + int(np.argmax(crest.off[mound]))
        if last == len(run) - 1:
            on_ridge[top + 1 :] = False
        elif first == 0:
            on_ridge[:top] = False
    return replace(crest, points=points[on_ridge], off=off[on_ridge]), mounds


def _line(run: Floats, off: Floats, closed: bool) -> Floats | None:
    """Return the heights of the ridge along a crest: the straight line that most of it follows."""
    sample = np.unique(np.linspace(0, len(run) - 1, POINTS).astype(int))
    at, height = run[sample], off[sample]
    i, j = np.array(list(combinations(range(len(sample)), 2))).reshape(-1, 2).T
    far = at[j] - at[i] >= at[-1] / 4.0
    i, j = i[far], j[far]
    if not len(i):
        return None
    slope = np.zeros(len(i)) if closed else (height[j] - height[i]) / (at[j] - at[i])
    lines = height[i, None] + slope[:, None] * (at - at[i, None])
    rest = height - lines
    below = np.mean(rest < -SLACK * np.abs(lines), axis=1)
    keeps = np.quantile(np.abs(rest), KEEPS, axis=1)
    allowed = (below <= BELOW) & (lines.min(axis=1) > 0.0)
    if not allowed.any():
        return None
    best = int(np.argmin(np.where(allowed, keeps, np.inf)))
    return height[i[best]] + slope[best] * (run - at[i[best]])


@dataclass(frozen=True, eq=False, repr=False)
class Finding(Parameters):
    """Criteria of a feature."""

    threshold: float = quantity(
        0.5e-3, "least distance of a feature from the former surface", unit="m", at_least=1e-6
    )
    smallest: int = quantity(3, "least number of pins of a feature", at_least=1)


#: Names of a feature's form, by its kind: with one crest, without a crest, and without but flat.
FORMS = {"boss": ("ridge", "mound", "plateau"), "crease": ("valley", "hollow", "basin")}
#: A top is flat when, of the pins above half its height, more than half are above this share of it.
FLAT = 0.9
#: Saddles and mounds below this many thresholds are ignored.
DEEP = 2.0
#: Gap between the bodies of two parts of a boss or crease and their common border, in pitches: with
#: a common wall, a welded file would use its edges four times. Slicers close so narrow a gap.
GAP = 0.005


@dataclass(frozen=True, eq=False)
class Feature:
    """Boss or crease: region of the skin beyond the threshold from the former surface."""

    kind: str
    number: int
    """1 is the largest of its kind."""
    pins: Indices
    """(k,): The pins in it, ascending."""
    region: Region
    """The part of the skin."""
    apart: Region
    """The same without a narrow strip along the border to the feature it was divided from."""
    extreme: float
    """Largest height of a boss, or depth of a crease, off the former surface, m."""
    crests: tuple[Floats, ...]
    """(p, 3): Lines along its top, or its bottom, m; the longest first. The last point of a closed one is its
    first."""
    flat: bool
    """Whether most of its top is level."""

    @property
    def form(self) -> str:
        """Form: ridge, mound, plateau; valley, hollow, basin; ring; or several of them."""
        line, top, plain = FORMS[self.kind]
        if not self.crests:
            return plain if self.flat else top
        if len(self.crests) > 1:
            return f"{len(self.crests)} {line}s"
        return "ring" if np.array_equal(self.crests[0][0], self.crests[0][-1]) else line

    @property
    def name(self) -> str:
        """Name in files and in Blender."""
        return f"{self.kind}_{self.number}"

    @property
    def area(self) -> float:
        """Area in plan, m²."""
        return self.region.area

    @property
    def volume(self) -> float:
        """Volume between the surface now and before, m³."""
        return self.region.volume

    @property
    def crest_length(self) -> float:
        """Length of all crest lines, in space, m."""
        return float(sum(measure_in_space(line) for line in self.crests))

    def figures(self) -> dict[str, object]:
        """Return its figures for a list, in SI units."""
        return {
            "name": self.name,
            "kind": self.kind,
            "form": self.form,
            "pins": self.pins.tolist(),
            "area": self.area,
            "height" if self.kind == "boss" else "depth": self.extreme,
            "volume": self.volume,
            "crest_length": self.crest_length,
            "crests": [line.tolist() for line in self.crests],
        }


def find(grid: SurfaceGrid, finding: Finding | None = None) -> list[Feature]:
    """Return the features of a skin: bosses, then creases, the largest of each first."""
    # Points are in one region if triangles of the skin join them: bosses that only touch at the
    # threshold are two. The parts beside a saddle, and a mound on a ridge, are features of their
    # own.
    finding, features = finding or Finding(), []
    list_steps(grid.formed.shift / grid.formed.pitch)  # refuses rows without neighbors
    for kind, sign in (("boss", 1.0), ("crease", -1.0)):
        unordered = _find_kind(grid, finding, kind, sign)
        ordered = sorted(unordered, key=lambda feature: -settle(feature.volume * 1e9))
        features += [replace(feature, number=number) for number, feature in enumerate(ordered, 1)]
    return features


def _find_kind(grid: SurfaceGrid, finding: Finding, kind: str, sign: float) -> Iterator[Feature]:
    """Yield the features of a kind, not yet numbered."""
    off = settle(sign * grid.raised)
    inside = off > finding.threshold
    faces = grid.faces[inside[grid.faces].any(axis=1)]
    edges = list_edges(faces)
    label = label_components(len(off), edges[inside[edges].all(axis=1)])
    # All corners of a triangle that are inside are joined by it, and so have one label.
    of_face = np.where(inside[faces], label[faces], -1).max(axis=1)
    at_pins = settle(sign * grid.formed.raised)
    pins = _by_label(np.where(inside[grid.pins], label[grid.pins], -1))
    for name, block in _by_label(of_face).items():
        in_block = pins.get(name, np.empty(0, np.int64))
        if len(in_block) < finding.smallest:
            continue
        region = cut(grid.position, grid.former, off, faces[block], finding.threshold)
        least = DEEP * finding.threshold
        ridges = find_ridges(grid.formed, in_block, at_pins, least)
        parts = [part for ridge in ridges for part in find_parts(ridge, least)]
        for part, of_part, piece, apart in _divide(grid, parts, in_block, region, finding.smallest):
            lines = tuple(crest.points for crest in part.crests)
            height = at_pins[of_part]
            upper = height[height >= 0.5 * height.max()]
            flat = bool(np.mean(upper >= FLAT * height.max()) > 0.5)
            yield Feature(kind, 0, of_part, piece, apart, float(piece.off.max()), lines, flat)


def _divide(
    grid: SurfaceGrid, every: list[Ridge], pins: Indices, region: Region, smallest: int
) -> Iterator[tuple[Ridge, Indices, Region, Region]]:
    """Yield each part that has enough pins, its pins, its piece of a region, and the piece less its gaps."""
    position = grid.formed.position[pins]
    while len(every) > 1:
        owner = find_first_largest(-measure_distances(position, every))
        count = np.bincount(owner, minlength=len(every))
        if count.min() >= smallest:
            break
        del every[int(np.argmin(count))]
    rest: Region | None = region
    others: Region | None = region
    while len(every) > 1 and rest is not None:
        piece, rest = divide(rest, _nearer(rest, every))
        undivided = others or region
        gap = GAP * grid.formed.pitch
        apart, others = divide(undivided, _nearer(undivided, every), gap)
        if piece is not None:
            yield every[-1], pins[owner == len(every) - 1], piece, apart or piece
        every = every[:-1]
    if rest is not None:
        yield every[0], pins if rest is region else pins[owner == 0], rest, others or rest


def _nearer(region: Region, every: list[Ridge]) -> Floats:
    """Return by how much the points of a region are nearer to the last part than to the others, (k,), m."""
    away = measure_distances(region.position, every)
    return away[:-1].min(axis=0) - away[-1]


def _by_label(label: Faces) -> dict[int, Indices]:
    """Return the indices of each label from 0 on, ascending."""
    order = np.argsort(label, kind="stable")
    names, starts = np.unique(label[order], return_index=True)
    # Without labels there is one empty group.
    groups = zip(names.tolist(), np.split(order, starts[1:]), strict=False)
    return {name: group for name, group in groups if name >= 0}


def make_table(features: list[Feature]) -> list[tuple[str, ...]]:
    """Return a table to be read: a head, and a row of texts per feature, in mm."""
    head = (
        "feature",
        "form",
        "pins",
        "area, mm²",
        "height or depth, mm",
        "crest, mm",
        "volume, mm³",
    )
    rows = [
        (
            feature.name,
            feature.form,
            str(len(feature.pins)),
            f"{feature.area * 1e6:.1f}",
            f"{feature.extreme * 1e3:.2f}",
            f"{feature.crest_length * 1e3:.1f}",
            f"{feature.volume * 1e9:.0f}",
        )
        for feature in features
    ]
    return [head, *rows]


def summarize(features: list[Feature]) -> str:
    """Return the numbers of bosses and creases in words."""
    parts = []
    for kind, plural in (("boss", "bosses"), ("crease", "creases")):
        count = sum(feature.kind == kind for feature in features)
        parts.append(f"{count} {kind if count == 1 else plural}")
    return " and ".join(parts)
