"""Network of a skeleton: branches between ends and junctions, and the crests they form.

A branch that ends within the flank of the line it starts from is removed. At a junction, the two
branches that continue each other most nearly straight become one line: a cross is two lines, and
the third branch of a T ends at the other two. A short stretch that two lines share, as in an eight
of two circles, belongs to both.
"""

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations, permutations

import numpy as np

from ..base.arrays import Flags, Floats, Indices, settle
from .regions import label_components

#: Distances from a junction, in half widths, between which the direction of a branch is measured.
SHOWS = (1.0, 3.0)


@dataclass(eq=False)
class Branch:
    """Nodes at both ends, and the points between them."""

    nodes: list[int]
    points: Floats

    @property
    def length(self) -> float:
        """In plan, m."""
        return float(settle(measure_run(self.points)[-1]))


#: A branch's end: its number, and 0 for the first point or 1 for the last.
End = tuple[int, int]
#: The end of another branch in which an end continues, and the points between them.
Joints = dict[End, tuple[End, Floats]]


@dataclass(eq=False)
class Network:
    """Nodes and branches, modified in place and discarded afterwards."""

    position: list[Floats]
    half: list[float]
    branches: dict[int, Branch] = field(default_factory=dict)

    def ends(self, node: int) -> list[End]:
        """Return the ends of branches at a node."""
        return [
            (number, end)
            for number, branch in self.branches.items()
            for end in (0, 1)
            if branch.nodes[end] == node
        ]

    def widest(self, branch: Branch) -> float:
        """Return the larger half width at the ends of a branch, m."""
        return max(self.half[node] for node in branch.nodes)

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
        return normalize(stop - start)


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
    """Return the neighbors of each pin of a skeleton; diagonal ones only if no common neighbor joins them."""
    there = np.isin(beside[pins], pins)
    if there.shape[1] == 8:
        there[:, 1::2] &= ~(there[:, ::2] | np.roll(there[:, ::2], -1, axis=1))
    rows = zip(pins.tolist(), beside[pins], there, strict=True)
    return {pin: row[joined].tolist() for pin, row, joined in rows}


def _add_node(network: Network, points: Floats, half: list[float]) -> int:
    """Add a node at the mean of points (k, 2), as wide as the widest, and return its number."""
    network.position.append(points.mean(axis=0))
    network.half.append(max(half))
    return len(network.position) - 1


def normalize(vector: Floats) -> Floats:
    """Return the unit vector along a vector (2,)."""
    return vector / max(float(np.hypot(*vector)), 1e-12)


def measure_run(points: Floats) -> Floats:
    """Return the distance of each point of a line (m, 2) from its start, along it in plan, (m,), m."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def place_along(at: Floats, run: Floats, points: Floats) -> Floats:
    """Return the points (k, 2) at distances (k,), m, along a line whose own points are at `run`, m."""
    return np.column_stack([np.interp(at, run, axis) for axis in points.T])


#: A free branch shorter than this many half widths is only the flank.
FLANK = 1.5
#: A saddle divides a line where it is lower than this share of the lower of the two tops beside it.
SADDLE = 0.5
#: Branches continue each other when the cosine of the angle between them is above this: 66 degrees.
STRAIGHT = 0.4
#: Longest stretch that two lines may share, in widths, and largest mean turn into it, rad: the
#: lines of an X turn by 43 degrees, the uprights of an H by 70. Loops on both sides, as in an eight
#: of two circles, may turn by 75.
TOGETHER, TURN, TURN_OF_LOOPS = 4.0, np.radians(60.0), np.radians(75.0)
#: Branches whose directions differ by more than this sine are joined by an arc.
BENT = 0.35
#: A line runs straight through a junction, from this many half widths before it to as many after
#: it.
THROUGH = 1.5


@dataclass(frozen=True, eq=False)
class Chain:
    """Line from pin to pin along a skeleton."""

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
    """Return the lines of a skeleton's pins (s,); `half` (s,): half the feature's width there, m."""
    network = read_network(beside, pins, position, half)
    _open_low_loops(network, off)
    _merge(network)
    _open_small_loops(network)
    _prune(network, pitch)
    junctions = frozenset(
        node for node in range(len(network.position)) if len(network.ends(node)) > 2
    )
    return list(_assembled(network, _joints(network), junctions))


def reaches_out(points: Floats, half: float, pitch: float) -> bool:
    """Return whether a free branch is longer than the flank of the line it stands on."""
    return bool(measure_run(points)[-1] > FLANK * half + 0.5 * pitch)


def _merge(network: Network) -> None:
    """Merge two junctions that are no further apart than half the feature's width."""

    def is_short(branch: Branch) -> bool:
        first, second = branch.nodes
        junctions = first != second and min(len(network.ends(node)) for node in branch.nodes) > 2
        return junctions and branch.length <= network.widest(branch)

    while short := [branch for branch in network.branches.items() if is_short(branch[1])]:
        number, branch = short[0]
        del network.branches[number]
        node, removed = branch.nodes
        network.position[node] = 0.5 * (network.position[node] + network.position[removed])
        network.half[node] = network.widest(branch)
        for branch in network.branches.values():
            for end in (0, 1):
                if branch.nodes[end] in (node, removed):
                    branch.nodes[end] = node
                    branch.points = branch.points.copy()
                    branch.points[-end] = network.position[node]


def _open_low_loops(network: Network, off: Callable[[Floats], Floats]) -> None:
    """Open each loop whose line falls below half the height on both sides."""
    for number, branch in list(network.branches.items()):
        height = off(branch.points)
        banks = find_banks(height)
        low = int(np.argmin(height / np.maximum(banks, 1e-12)))
        limit = SADDLE * banks[low]
        if height[low] >= limit or len(network.ends(branch.nodes[0])) < 3:
            continue
        others = [b.nodes for k, b in network.branches.items() if k != number]
        joined = label_components(len(network.position), np.array(others, np.int32).reshape(-1, 2))
        if joined[branch.nodes[0]] == joined[branch.nodes[1]]:
            first, last = find_stretch(height < limit, low)
            del network.branches[number]
            parts = (branch.points[:first], branch.points[:last:-1])
            for node, part in zip(branch.nodes, parts, strict=True):
                if len(part) > 1:
                    free = _add_node(network, part[-1:], [0.0])
                    network.branches[max(network.branches, default=0) + 1] = Branch(
                        [node, free], part
                    )


def find_banks(height: Floats) -> Floats:
    """Return at each point of a line (m,) the lower of the highest points before and after it."""
    before, after = np.maximum.accumulate(height), np.maximum.accumulate(height[::-1])[::-1]
    return np.minimum(before, after)


def find_stretch(inside: Flags, at: int) -> tuple[int, int]:
    """Return the first and the last index of the stretch around index `at` in which all are `inside`."""
    outside = np.flatnonzero(~inside)
    before, after = outside[outside < at], outside[outside > at]
    return int(before.max(initial=-1)) + 1, int(after.min(initial=len(inside))) - 1


def _open_small_loops(network: Network) -> None:
    """Remove branches that close a loop smaller than its line is wide."""
    for number, branch in list(network.branches.items()):
        nodes = set(branch.nodes)
        others = [
            b.length for k, b in network.branches.items() if k != number and set(b.nodes) == nodes
        ]
        around = 2.0 * np.pi * network.widest(branch)
        if any(
            length + branch.length < around for length in ([0.0] if len(nodes) == 1 else others)
        ):
            del network.branches[number]


def _prune(network: Network, pitch: float) -> None:
    """Remove free branches that are only the flank, the shortest first."""
    while True:
        _join_through(network)
        short = []
        for number, branch in network.branches.items():
            for free, node in (branch.nodes, branch.nodes[::-1]):
                if len(network.ends(free)) == 1 and len(network.ends(node)) > 2:
                    straight = np.stack([_foot(network, number, node), network.position[free]])
                    lines = (branch.points, straight)
                    if not all(reaches_out(line, network.half[node], pitch) for line in lines):
                        short.append((branch.length, number))
        if not short:
            return
        del network.branches[min(short)[1]]


def _foot(network: Network, number: int, node: int) -> Floats:
    """Return where a free branch begins, (2,): its junction, or the corner of the two others there."""
    others = [end for end in network.ends(node) if end[0] != number]
    met = _meeting(network, *others) if len(others) == 2 else None
    return network.position[node] if met is None else met


def _join_through(network: Network) -> None:
    """Join two branches that meet where no other does."""
    for node in range(len(network.position)):
        ends = network.ends(node)
        if len(ends) == 2 and ends[0][0] != ends[1][0]:
            first, second = ends
            points = np.concatenate([network.away(first)[::-1], network.away(second)[1:]])
            nodes = [network.branches[k].nodes[1 - e] for k, e in ends]
            del network.branches[second[0]]
            network.branches[first[0]] = Branch(nodes, points)


def _joints(network: Network) -> Joints:
    """Return which end of a branch continues in which, and the points between them."""
    joints: Joints = {}
    nothing = np.empty((0, 2))
    for number in list(network.branches):
        _share(network, number, joints)
    for node in range(len(network.position)):
        ends = [end for end in network.ends(node) if end not in joints]
        if len(ends) == 2 and len(network.ends(node)) == 2:
            joints[ends[0]], joints[ends[1]] = (ends[1], nothing), (ends[0], nothing)
            continue
        paths = {end: network.path(end) for end in ends}
        pairs = sorted((float(settle(paths[a] @ paths[b])), a, b) for a, b in combinations(ends, 2))
        for cosine, a, b in pairs:
            if cosine < -STRAIGHT and a not in joints and b not in joints:
                between = _round(network, a, b)
                joints[a], joints[b] = (b, between), (a, between)
    return joints


def _round(network: Network, first: End, second: End) -> Floats:
    """Return the point of the arc that joins two branches, (1, 2); none if they are straight."""
    met = _meeting(network, first, second)
    if met is None:
        return np.empty((0, 2))
    # Half as far out as the tangents meet: exact for a flat arc.
    return (0.25 * (_begin(network, first) + _begin(network, second)) + 0.5 * met)[None]


def _begin(network: Network, end: End) -> Floats:
    """Return where a branch comes out of its junction, (2,)."""
    return _without_nodes(network, end, {end})[0]


def _meeting(network: Network, end: End, other: End) -> Floats | None:
    """Return where two branches would meet if they went straight on to their junction and beyond, (2,)."""
    paths, starts = zip(*((network.path(e), _begin(network, e)) for e in (end, other)), strict=True)
    away = intersect(paths, starts, BENT)
    return starts[0] + away[0] * paths[0] if away is not None and away.max() < 0.0 else None


def intersect(paths: Sequence[Floats], starts: Sequence[Floats], least: float) -> Floats | None:
    """Return how far along two lines they meet, (2,), m; none if the sine between them is below `least`."""
    sides = np.column_stack([paths[0], -paths[1]])
    if abs(np.linalg.det(sides)) < least:
        return None
    return np.linalg.solve(sides, starts[1] - starts[0])


def _share(network: Network, number: int, joints: Joints) -> None:
    """Let two lines share a branch if two branches at each of its ends continue in it."""
    branch = network.branches[number]
    first, second = branch.nodes
    width = 2.0 * network.widest(branch)
    if first == second or branch.length > TOGETHER * width:
        return
    sides = [[end for end in network.ends(node) if end[0] != number] for node in branch.nodes]
    if [len(side) for side in sides] != [2, 2] or any(
        end in joints for side in sides for end in side
    ):
        return
    paths = np.array([[network.path(end) for end in side] for side in sides])
    along = network.position[second] - network.position[first]
    cosines_along = np.array([paths[0] @ -along, paths[1] @ along]) / max(
        float(np.hypot(*along)), 1e-12
    )
    most = TURN_OF_LOOPS if len({end[0] for side in sides for end in side}) == 2 else TURN
    if np.arccos(np.clip(cosines_along, -1.0, 1.0)).mean() > most:
        return
    order = min(
        permutations((0, 1)), key=lambda pair: float(np.sum(paths[0] * paths[1][list(pair)]))
    )
    # A stretch that is shorter than wide is a crossing, which each line passes straight.
    shared = branch.points[:0] if branch.length <= width else branch.points
    for k in (0, 1):
        a, b = sides[0][k], sides[1][order[k]]
        joints[a], joints[b] = (b, shared), (a, shared[::-1])
    del network.branches[number]


def _assembled(network: Network, joints: Joints, junctions: frozenset[int]) -> Iterable[Chain]:
    """Yield the lines that the branches form."""
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


def _without_nodes(network: Network, end: End, through: Container[End]) -> Floats:
    """Return the points of a branch from an end on, without those in junctions that ends run `through`."""
    points, branch = network.away(end), network.branches[end[0]]
    outside = np.ones(len(points), bool)
    for k in (0, 1):
        node = branch.nodes[k]
        if (end[0], k) in through and len(network.ends(node)) > 2:
            outside &= np.hypot(*(points - network.position[node]).T) > THROUGH * network.half[node]
    middle = len(points) // 2
    outside[middle] |= not outside.any()
    return points[outside]
