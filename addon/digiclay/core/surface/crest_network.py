"""Network of a skeleton: branches between ends and junctions, and the crests they form.

A branch that does not reach out of the flank it stands on is none. At a junction the branches go on into each
other where they do so straightest: a cross is two lines, and the third branch of a T ends at the other two.
Where two lines run together for a short way, as in an eight of two circles, both take that way.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import combinations, permutations

import numpy as np

from ..base.arrays import Flags, Floats, Indices, settle
from .regions import label_components

#: From so many half widths to so many from a junction a branch shows where it goes.
SHOWS = (1.0, 3.0)


@dataclass(eq=False)
class Branch:
    """Nodes at both ends, and the points between them."""

    nodes: list[int]
    points: Floats

    @property
    def length(self) -> float:
        """In plan, m."""
        return float(settle(measure_length(self.points)))


#: A branch's end: its number, and 0 for the first point or 1 for the last.
End = tuple[int, int]
#: Which end of a branch continues in which, and the points in between.
Joints = dict[End, tuple[End, Floats]]


@dataclass(eq=False)
class Network:
    """Nodes and branches, modified in place and discarded afterwards."""

    position: list[Floats]
    half: list[float]
    branches: dict[int, Branch] = field(default_factory=dict)

    def ends(self, node: int) -> list[End]:
        """Return the ends of branches at a node."""
        return [(k, e) for k, one in self.branches.items() for e in (0, 1) if one.nodes[e] == node]

    def away(self, end: End) -> Floats:
        """Return the points of a branch from one of its ends on."""
        points = self.branches[end[0]].points
        return points if end[1] == 0 else points[::-1]

    def path(self, end: End) -> Floats:
        """Return the unit vector in which a branch leaves its node."""
        points, half = self.away(end), self.half[self.branches[end[0]].nodes[end[1]]]
        run = measure_run(points)
        near, far = min(SHOWS[0] * half, run[-1] / 2.0), min(SHOWS[1] * half, run[-1])
        start, stop = place_along(np.array([near, far]), run, points)
        return np.asarray((stop - start) / max(float(np.hypot(*(stop - start))), 1e-12))


def read_network(beside: Indices, pins: Indices, position: Floats, half: Floats) -> Network:
    """Return the network of a skeleton: pins with three neighbors or more are junctions."""
    wide = dict(zip(pins.tolist(), half.tolist(), strict=True))
    around = _neighbors(beside, pins)
    cluster: dict[int, int] = {}
    network = Network([], [])
    for pin in around:
        if pin in cluster or len(around[pin]) == 2:
            continue
        group, waiting = {pin}, [pin]
        while len(around[pin]) > 2 and waiting:
            more = [n for n in around[waiting.pop()] if len(around[n]) > 2 and n not in group]
            group.update(more)
            waiting += more
        cluster |= dict.fromkeys(group, len(network.position))
        _add_node(network, position[sorted(group)], [wide[member] for member in group])
    seen: set[tuple[int, int]] = set()

    def walk(start: int, step: int) -> list[int]:
        path = [start, step]
        while path[-1] not in cluster and path[-1] != start:
            path.append(next(n for n in around[path[-1]] if n != path[-2]))
        seen.update(((path[0], path[1]), (path[-1], path[-2])))
        seen.update((inner, -1) for inner in path[1:-1])
        return path

    def add(path: list[int], nodes: list[int]) -> None:
        points = position[path]
        points[0], points[-1] = network.position[nodes[0]], network.position[nodes[1]]
        network.branches[len(network.branches)] = Branch(nodes, points)

    for pin, node in list(cluster.items()):
        for step in around[pin]:
            if cluster.get(step) != node and (pin, step) not in seen:
                path = walk(pin, step)
                add(path, [node, cluster[path[-1]]])
    for pin in around:
        if pin not in cluster and (pin, -1) not in seen:  # a ring by itself
            node = _add_node(network, position[[pin]], [wide[pin]])
            add(walk(pin, around[pin][0]), [node, node])
            seen.add((pin, -1))
    return network


def _neighbors(beside: Indices, pins: Indices) -> dict[int, list[int]]:
    """Return for each pin of a skeleton those it is joined to: corners only where no side leads there."""
    there = np.isin(beside[pins], pins)
    if there.shape[1] == 8:
        there[:, 1::2] &= ~(there[:, ::2] | np.roll(there[:, ::2], -1, axis=1))
    rows = zip(pins.tolist(), beside[pins], there, strict=True)
    return {pin: row[joined].tolist() for pin, row, joined in rows}


def _add_node(network: Network, places: Floats, half: list[float]) -> int:
    """Add a node in the middle of some places."""
    network.position.append(places.mean(axis=0))
    network.half.append(max(half))
    return len(network.position) - 1


def measure_length(points: Floats) -> float:
    """Return the length of a line in plan, m."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def measure_run(points: Floats) -> Floats:
    """Return how far along a line (m, 2) in plan its points are, (m,), m."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def place_along(at: Floats, run: Floats, points: Floats) -> Floats:
    """Return the places at some distances (k,), m, along a line whose points are at `run`, (k, 2)."""
    return np.column_stack([np.interp(at, run, axis) for axis in points.T])


#: A free branch is shorter than this many half widths when it is only the flank.
FLANK = 1.5
#: Lines are parted where they are lower than this share of the lower one.
SADDLE = 0.5
#: Branches continue in each other when the cosine between their ways is above this: 66 degrees.
STRAIGHT = 0.4
#: Two lines run together for this many widths at most, and turn into the common way by so much at most in the
#: mean, rad: those of an X by 43 degrees, the uprights of an H by 70. Loops on both sides, as in an eight of
#: two circles, may turn by 75.
TOGETHER, TURN, TURN_OF_LOOPS = 4.0, np.radians(60.0), np.radians(75.0)
#: Branches that turn by more than this sine continue in each other by an arc.
BENT = 0.35
#: A line runs straight through a junction, from so many half widths before it to as many after it.
THROUGH = 1.5


@dataclass(frozen=True, eq=False)
class Chain:
    """Line from pin to pin."""

    points: Floats
    """(m, 2): m; the first again at the end of a closed one."""
    closed: bool
    joined: tuple[bool, bool]
    """Whether the first and the last point are at a junction with another line."""
    nodes: frozenset[int]
    """Junctions with other lines that it runs through, or ends at."""


def find_chains(
    beside: Indices,
    pins: Indices,
    position: Floats,
    half: Floats,
    pitch: float,
    off: Callable[[Floats], Floats],
) -> list[Chain]:
    """Return the lines of a skeleton's pins (s,); `half` (s,), m, is half the feature's width there."""
    network = read_network(beside, pins, position, half)
    _open_low_loops(network, off)
    _merge(network)
    _open_small_loops(network)
    _prune(network, pitch)
    junctions = frozenset(node for node in range(len(network.position)) if len(network.ends(node)) > 2)
    return list(_assembled(network, _joints(network), junctions))


def reaches_out(points: Floats, half: float, pitch: float) -> bool:
    """Return whether a free branch is longer than the flank of the line it stands on."""
    return measure_length(points) > FLANK * half + 0.5 * pitch


def _merge(network: Network) -> None:
    """Make one junction of two that are no further apart than half the feature's width."""

    def is_short(branch: Branch) -> bool:
        one, two = branch.nodes
        junctions = one != two and min(len(network.ends(one)), len(network.ends(two))) > 2
        return junctions and branch.length <= max(network.half[one], network.half[two])

    while short := [number for number, branch in network.branches.items() if is_short(branch)]:
        one, two = network.branches.pop(short[0]).nodes
        network.position[one] = 0.5 * (network.position[one] + network.position[two])
        network.half[one] = max(network.half[one], network.half[two])
        for branch in network.branches.values():
            for end in (0, 1):
                if branch.nodes[end] in (one, two):
                    branch.nodes[end] = one
                    branch.points = branch.points.copy()
                    branch.points[-end] = network.position[one]


def _open_low_loops(network: Network, off: Callable[[Floats], Floats]) -> None:
    """Cut a loop where its line is lower than half of what is on both sides: it is not closed there."""
    for number, branch in list(network.branches.items()):
        height = off(branch.points)
        before, after = np.maximum.accumulate(height), np.maximum.accumulate(height[::-1])[::-1]
        low = int(np.argmin(height / np.maximum(np.minimum(before, after), 1e-12)))
        bank = float(min(before[low], after[low]))
        if height[low] >= SADDLE * bank or len(network.ends(branch.nodes[0])) < 3:
            continue
        others = [b.nodes for k, b in network.branches.items() if k != number]
        joined = label_components(len(network.position), np.array(others, np.int32).reshape(-1, 2))
        if joined[branch.nodes[0]] == joined[branch.nodes[1]]:
            first, last = find_stretch(height < SADDLE * bank, low)
            del network.branches[number]
            parts = (branch.points[:first], branch.points[:last:-1])
            for node, part in zip(branch.nodes, parts, strict=True):
                if len(part) > 1:
                    free = _add_node(network, part[-1:], [0.0])
                    network.branches[max(network.branches, default=0) + 1] = Branch([node, free], part)


def find_stretch(there: Flags, at: int) -> tuple[int, int]:
    """Return the first and the last of the places about one that all are `there`."""
    out = np.flatnonzero(~there)
    before, after = out[out < at], out[out > at]
    return int(before[-1]) + 1 if len(before) else 0, int(after[0]) - 1 if len(after) else len(there) - 1


def _open_small_loops(network: Network) -> None:
    """Remove branches that close a loop smaller than its line is wide."""
    for number, branch in list(network.branches.items()):
        one, two = branch.nodes
        others = [b.length for k, b in network.branches.items() if k != number and set(b.nodes) == {one, two}]
        about = 2.0 * np.pi * max(network.half[one], network.half[two])
        if any(length + branch.length < about for length in ([0.0] if one == two else others)):
            del network.branches[number]


def _prune(network: Network, pitch: float) -> None:
    """Take off free branches that are only the flank, the shortest first."""
    while True:
        _join_through(network)
        short = []
        for number, branch in network.branches.items():
            for free, node in (branch.nodes, branch.nodes[::-1]):
                if len(network.ends(free)) == 1 and len(network.ends(node)) > 2:
                    beyond = np.stack([_foot(network, number, node), network.position[free]])
                    lines = (branch.points, beyond)
                    if not all(reaches_out(line, network.half[node], pitch) for line in lines):
                        short.append((branch.length, number))
        if not short:
            return
        del network.branches[min(short)[1]]


def _foot(network: Network, number: int, node: int) -> Floats:
    """Return where a free branch begins, (2,): its junction, or the corner of the two others there."""
    others = [end for end in network.ends(node) if end[0] != number]
    met = _meeting(network, others[0], others[1]) if len(others) == 2 else None
    return network.position[node] if met is None else met


def _join_through(network: Network) -> None:
    """Make one branch of two that meet where no other does."""
    for node in range(len(network.position)):
        ends = network.ends(node)
        if len(ends) == 2 and ends[0][0] != ends[1][0]:
            one, two = ends
            points = np.concatenate([network.away(one)[::-1], network.away(two)[1:]])
            nodes = [network.branches[k].nodes[1 - e] for k, e in ends]
            del network.branches[two[0]]
            network.branches[one[0]] = Branch(nodes, points)


def _joints(network: Network) -> Joints:
    """Return which end of a branch continues in which, and the points in between."""
    joints: Joints = {}
    nothing = np.empty((0, 2))
    for number in list(network.branches):
        _share(network, number, joints)
    for node in range(len(network.position)):
        ends = [end for end in network.ends(node) if end not in joints]
        if len(ends) == 2 and len(network.ends(node)) == 2:
            joints[ends[0]], joints[ends[1]] = (ends[1], nothing), (ends[0], nothing)
            continue
        ways = {end: network.path(end) for end in ends}
        pairs = sorted((float(settle(ways[a] @ ways[b])), a, b) for a, b in combinations(ends, 2))
        for cosine, a, b in pairs:
            if cosine < -STRAIGHT and a not in joints and b not in joints:
                between = _round(network, a, b)
                joints[a], joints[b] = (b, between), (a, between)
    return joints


def _round(network: Network, one: End, two: End) -> Floats:
    """Return the point of the arc by which two branches go on into each other, (1, 2); none if straight."""
    met = _meeting(network, one, two)
    if met is None:
        return np.empty((0, 2))
    # Half as far out as the tangents meet: exact for a flat arc.
    return (0.25 * (_begin(network, one) + _begin(network, two)) + 0.5 * met)[None]


def _begin(network: Network, end: End) -> Floats:
    """Return where a branch comes out of its junction, (2,)."""
    return np.asarray(_without_nodes(network, end, {end: (end, np.empty((0, 2)))})[0])


def _meeting(network: Network, one: End, two: End) -> Floats | None:
    """Return where two branches would meet if they went straight on to their junction and beyond, (2,)."""
    sides = np.column_stack([network.path(one), -network.path(two)])
    if abs(np.linalg.det(sides)) < BENT:
        return None
    first = _begin(network, one)
    away = np.linalg.solve(sides, _begin(network, two) - first)
    return first + away[0] * sides[:, 0] if away.max() < 0.0 else None


def _share(network: Network, number: int, joints: Joints) -> None:
    """Let two lines run together along a branch when two at each of its ends go on into it."""
    branch = network.branches[number]
    one, two = branch.nodes
    if one == two or branch.length > TOGETHER * 2.0 * max(network.half[one], network.half[two]):
        return
    sides = [[end for end in network.ends(node) if end[0] != number] for node in (one, two)]
    if [len(side) for side in sides] != [2, 2] or any(end in joints for side in sides for end in side):
        return
    ways = np.array([[network.path(end) for end in side] for side in sides])
    along = network.position[two] - network.position[one]
    cosines_along = np.array([ways[0] @ -along, ways[1] @ along]) / max(float(np.hypot(*along)), 1e-12)
    most = TURN_OF_LOOPS if len({end[0] for side in sides for end in side}) == 2 else TURN
    if np.arccos(np.clip(cosines_along, -1.0, 1.0)).mean() > most:
        return
    order = min(permutations((0, 1)), key=lambda pair: float(np.sum(ways[0] * ways[1][list(pair)])))
    # A way that is shorter than wide is a crossing, which each line passes straight.
    crossing = branch.length <= 2.0 * max(network.half[one], network.half[two])
    way = branch.points[:0] if crossing else branch.points
    for k in (0, 1):
        a, b = sides[0][k], sides[1][order[k]]
        joints[a], joints[b] = (b, way), (a, way[::-1])
    del network.branches[number]


def _assembled(network: Network, joints: Joints, junctions: frozenset[int]) -> Iterable[Chain]:
    """Give the lines that the branches make."""
    free = [(k, e) for k in network.branches for e in (0, 1) if (k, e) not in joints]
    used: set[int] = set()
    for start in [*free, *((k, 0) for k in network.branches)]:
        if start[0] in used:
            continue
        parts, end, nodes = [], start, set[int]()
        while True:
            used.add(end[0])
            nodes.update(network.branches[end[0]].nodes)
            parts.append(_without_nodes(network, end, joints))
            last = (end[0], 1 - end[1])
            if last not in joints or joints[last][0][0] in used:
                break
            end, between = joints[last]
            parts.append(between)
        closed = start in joints
        if closed:
            parts += [joints[last][1], parts[0][:1]]
        joined = [len(network.ends(network.branches[k].nodes[e])) > 1 for k, e in (start, last)]
        yield Chain(np.concatenate(parts), closed, (joined[0], joined[1]), junctions & nodes)


def _without_nodes(network: Network, end: End, joints: Joints) -> Floats:
    """Return the points of a branch from one end on, without those in the junctions it runs through."""
    points, branch = network.away(end), network.branches[end[0]]
    kept = np.ones(len(points), bool)
    for k in (0, 1):
        node = branch.nodes[k]
        if (end[0], k) in joints and len(network.ends(node)) > 2:
            kept &= np.hypot(*(points - network.position[node]).T) > THROUGH * network.half[node]
    middle = len(points) // 2
    kept[middle] |= not kept.any()
    return np.asarray(points[kept])
