"""Features of a formed surface: bosses and creases, found, measured and named."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..base.arrays import Faces, Floats, Indices, find_first_largest, settle
from ..base.quantity import Parameters, quantity
from ..model.layout import list_steps
from .crest_network import find_stretch, measure_run
from .crests import Crest, Ridge, find_ridges
from .regions import Region, cut, divide, label_components
from .skins import SurfaceGrid

#: Share of a crest that keeps to the straight line of its ridge, at least, and share that may lie below.
KEEPS, BELOW = 0.4, 0.1
#: What counts as below, as a share of the line's height.
SLACK = 0.1
#: A mound rises above the ridge by this share of the ridge's height at least.
RISES = 0.3
#: A mound's foot is where it has risen by this share of its rise.
FOOT = 0.15
#: A mound is so many half widths of its ridge long at most, on each side of its top.
COMPACT = 4.0
#: The peak where two ridges cross is so many half widths long, and no mound.
CROSSING = 1.5
#: Points of a crest that are looked at for the line of its ridge.
POINTS = 40
#: Pairs of a place and a point of a core that are compared at once.
CHUNK = 1 << 21


def find_parts(ridge: Ridge, least: float) -> tuple[Ridge, ...]:
    """Return the parts of a ridge: itself, and the mounds on it that rise by `least`, m, or more."""
    crests, cores = [], []
    mounds: list[tuple[Floats, float]] = []
    for crest in ridge.crests:
        bare, ways = _strip_branches(crest, least)
        crests.append(bare)
        on_ridge = np.ones(len(crest.points), bool)
        for first, last in ways:
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


def measure_distances(places: Floats, every: list[Ridge]) -> Floats:
    """Return how far places (k, 2) are from each part, less half its width, m, shape (parts, k)."""
    away = np.empty((len(every), len(places)))
    for number, part in enumerate(every):
        rows = max(1, CHUNK // len(part.core))
        for start in range(0, len(places), rows):
            x, y = np.moveaxis(places[start : start + rows, None] - part.core, -1, 0)
            away[number, start : start + rows] = np.hypot(x, y).min(axis=1) - part.half
    return away


def _strip_branches(crest: Crest, least: float) -> tuple[Crest, list[tuple[int, int]]]:
    """Return a crest without the mounds on it, and the first and last points of each of them."""
    run = measure_run(crest.points[:, :2])
    line = _line(run, crest.off, crest.closed)
    if line is None:
        return crest, []
    excess = crest.off - line
    ways: list[tuple[int, int]] = []
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
        ways.append((first, last))
    left = run[-1] - sum(run[last] - run[first] for first, last in ways)
    if not ways or left < 2.0 * crest.half:
        return crest, []
    points, off = crest.points.copy(), crest.off.copy()
    # Which way the surface has risen: up for a boss, down for a crease.
    sign = 1.0 if np.polyfit(crest.off, crest.points[:, 2], 1)[0] > 0.0 else -1.0
    kept = np.ones(len(run), bool)
    for first, last in ways:
        here = slice(first, last + 1)
        points[here, 2] -= sign * excess[here]
        off[here] = line[here]
        top = first + int(np.argmax(crest.off[here]))
        if last == len(run) - 1:
            kept[top + 1 :] = False
        elif first == 0:
            kept[:top] = False
    return replace(crest, points=points[kept], off=off[kept]), ways


def _line(run: Floats, off: Floats, closed: bool) -> Floats | None:
    """Return the heights of the ridge along a crest: a straight line most of it keeps to, from below."""
    some = np.unique(np.linspace(0, len(run) - 1, POINTS).astype(int))
    at, height = run[some], off[some]
    pairs = np.array([(i, j) for i, j in combinations(range(len(some)), 2) if at[j] - at[i] >= at[-1] / 4.0])
    if not len(pairs):
        return None
    i, j = pairs.T
    slope = np.zeros(len(i)) if closed else (height[j] - height[i]) / (at[j] - at[i])
    lines = height[i, None] + slope[:, None] * (at - at[i, None])
    rest = height - lines
    below = np.mean(rest < -SLACK * np.abs(lines), axis=1)
    keeps = np.quantile(np.abs(rest), KEEPS, axis=1)
    allowed = (below <= BELOW) & (lines.min(axis=1) > 0.0)
    if not allowed.any():
        return None
    best = int(np.argmin(np.where(allowed, keeps, np.inf)))
    return np.asarray(height[i[best]] + slope[best] * (run - at[i[best]]))


@dataclass(frozen=True, eq=False, repr=False)
class Finding(Parameters):
    """Criteria of a feature."""

    threshold: float = quantity(
        0.5e-3, "how far off its former place a point must be to belong to a feature", unit="m", at_least=1e-6
    )
    smallest: int = quantity(3, "pins a feature has at least", at_least=1)


#: What a person calls a feature, by its kind: with one crest, without, and without but flat.
FORMS = {"boss": ("ridge", "mound", "plateau"), "crease": ("valley", "hollow", "basin")}
#: A top is flat when more than half of what is above half its height is above this share of it.
FLAT = 0.9
#: Saddles and mounds count from so many thresholds on.
DEEP = 2.0
#: Bodies of two parts of a boss or crease keep this share of a pitch from their common border, each: with a
#: common wall a welded file would use its edges four times. Slicers close so narrow a gap.
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
    """The same, without a narrow strip beside the feature it is divided from."""
    extreme: float
    """Largest height of a boss, or depth of a crease, off the former surface, m."""
    crests: tuple[Floats, ...]
    """(p, 3): The lines along its top, or its bottom, m; the longest first. A closed one ends where it
    begins."""
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
        return float(sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in self.crests))

    def figures(self) -> dict[str, object]:
        """Return what is listed of it, in SI units."""
        return {
            "name": self.name, "kind": self.kind, "form": self.form, "pins": self.pins.tolist(),
            "area": self.area,
            "height" if self.kind == "boss" else "depth": self.extreme, "volume": self.volume,
            "crest_length": self.crest_length, "crests": [line.tolist() for line in self.crests],
        }  # fmt: skip


def find(grid: SurfaceGrid, finding: Finding | None = None) -> list[Feature]:
    """Return the features of a skin: bosses, then creases, the largest of each first."""
    # Points belong together that the skin's triangles join: two bosses that only touch at the threshold are
    # two. What a saddle parts, and a mound that stands on a ridge, is a feature by itself.
    finding, features = finding or Finding(), []
    list_steps(grid.formed.shift / grid.formed.pitch)  # refuses rows that have no neighbors
    for kind, sign in (("boss", 1.0), ("crease", -1.0)):
        some = sorted(_of_kind(grid, finding, kind, sign), key=lambda feature: -settle(feature.volume * 1e9))
        features += [replace(feature, number=number) for number, feature in enumerate(some, 1)]
    return features


def _of_kind(grid: SurfaceGrid, finding: Finding, kind: str, sign: float) -> Iterator[Feature]:
    """Give the features of one kind, not yet numbered."""
    off = settle(sign * grid.raised)
    inside = off > finding.threshold
    faces = grid.faces[inside[grid.faces].any(axis=1)]
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    label = label_components(len(off), edges[inside[edges].all(axis=1)])
    # All corners of a triangle that are inside are joined by it, and so have one label.
    of_face = np.where(inside[faces], label[faces], -1).max(axis=1)
    at_pins = settle(sign * grid.formed.raised)
    pins = _by_label(np.where(inside[grid.pins], label[grid.pins], -1))
    for name, block in _by_label(of_face).items():
        own_pins = pins.get(name, np.empty(0, np.int64))
        if len(own_pins) < finding.smallest:
            continue
        region = cut(grid.position, grid.former, off, faces[block], finding.threshold)
        least = DEEP * finding.threshold
        whole = find_ridges(grid.formed, own_pins, at_pins, least)
        every = [part for ridge in whole for part in find_parts(ridge, least)]
        for part, own, piece, apart in _shared_out(grid, every, own_pins, region, finding.smallest):
            lines = tuple(crest.points for crest in part.crests)
            high = at_pins[own]
            flat = np.mean(high[high >= 0.5 * high.max()] >= FLAT * high.max()) > 0.5
            yield Feature(kind, 0, own, piece, apart, float(piece.off.max()), lines, bool(flat))


def _shared_out(
    grid: SurfaceGrid, every: list[Ridge], pins: Indices, region: Region, smallest: int
) -> Iterator[tuple[Ridge, Indices, Region, Region]]:
    """Give each part with pins enough its pins, its piece of a region, and this apart from the others."""
    place = grid.formed.position[pins]
    while len(every) > 1:
        owner = find_first_largest(-measure_distances(place, every))
        count = np.bincount(owner, minlength=len(every))
        if count.min() >= smallest:
            break
        del every[int(np.argmin(count))]
    rest: Region | None = region
    others: Region | None = region
    while len(every) > 1 and rest is not None:
        piece, rest = divide(rest, _nearer(rest, every))
        apart, others = divide(others or region, _nearer(others or region, every), GAP * grid.formed.pitch)
        if piece is not None:
            yield every[-1], pins[owner == len(every) - 1], piece, apart or piece
        every = every[:-1]
    if rest is not None:
        yield every[0], pins if rest is region else pins[owner == 0], rest, others or rest


def _nearer(region: Region, every: list[Ridge]) -> Floats:
    """Return how much nearer the points of a region are to the last part than to the others, m, (k,)."""
    away = measure_distances(region.position, every)
    return np.asarray(away[:-1].min(axis=0) - away[-1])


def _by_label(label: Faces) -> dict[int, Indices]:
    """Return for each label from 0 on where it stands, ascending."""
    order = np.argsort(label, kind="stable")
    names, starts = np.unique(label[order], return_index=True)
    places = zip(names.tolist(), np.split(order, starts[1:]), strict=False)  # without labels, one of none
    return {name: some for name, some in places if name >= 0}


def make_table(features: list[Feature]) -> list[tuple[str, ...]]:
    """Return a table for a person: a head, and a row of texts a feature, in mm."""
    head = ("feature", "form", "pins", "area, mm²", "height or depth, mm", "crest, mm", "volume, mm³")
    rows = [
        (
            one.name, one.form, str(len(one.pins)), f"{one.area * 1e6:.1f}", f"{one.extreme * 1e3:.2f}",
            f"{one.crest_length * 1e3:.1f}", f"{one.volume * 1e9:.0f}",
        )
        for one in features
    ]  # fmt: skip
    return [head, *rows]


def summarize(features: list[Feature]) -> str:
    """Return how many there are in a few words."""
    kinds = (("boss", "bosses"), ("crease", "creases"))
    counts = [(sum(feature.kind == kind for feature in features), kind, plural) for kind, plural in kinds]
    return " and ".join(f"{count} {kind if count == 1 else plural}" for count, kind, plural in counts)
