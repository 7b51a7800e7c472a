"""Branches of a skeleton, between ends and junctions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats

Pins = NDArray[np.int64]

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
        return measure_length(self.points)


#: A branch's end: its number, and 0 for the first point or 1 for the last.
End = tuple[int, int]


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
        run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        near, far = min(SHOWS[0] * half, run[-1] / 2.0), min(SHOWS[1] * half, run[-1])
        step = np.array([np.interp(far, run, axis) - np.interp(near, run, axis) for axis in points.T])
        return step / max(float(np.hypot(*step)), 1e-12)


def read_network(beside: Pins, pins: Pins, position: Floats, half: Floats) -> Network:
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
        _add_node(network, position[sorted(group)], [wide[one] for one in group])
    seen: set[tuple[int, int]] = set()

    def walk(start: int, step: int) -> list[int]:
        path = [start, step]
        while path[-1] not in cluster and path[-1] != start:
            path.append(next(n for n in around[path[-1]] if n != path[-2]))
        seen.update(((path[0], path[1]), (path[-1], path[-2])))
        seen.update((one, -1) for one in path[1:-1])
        return path

    def add(path: Iterable[int], nodes: list[int]) -> None:
        points = np.array([position[one] for one in path])
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


def _neighbors(beside: Pins, pins: Pins) -> dict[int, list[int]]:
    """Return for each pin of a skeleton those it is joined to: corners only where there is no side way."""
    among = set(pins.tolist())
    found: dict[int, list[int]] = {}
    for pin, row in zip(pins.tolist(), beside[pins].tolist(), strict=True):
        there = [n in among for n in row]
        straight = [
            len(row) == 6 or k % 2 == 0 or not (there[k - 1] or there[(k + 1) % 8]) for k in range(len(row))
        ]
        found[pin] = [n for n, one, path in zip(row, there, straight, strict=True) if one and path]
    return found


def _add_node(network: Network, places: Floats, half: list[float]) -> int:
    """Add a node in the middle of some places."""
    network.position.append(places.mean(axis=0))
    network.half.append(max(half))
    return len(network.position) - 1


def measure_length(points: Floats) -> float:
    """Return the length of a line in plan, m."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
