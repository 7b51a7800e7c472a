"""Crests: lines along the top of a boss or the bottom of a crease, to a fraction of a pitch.

The pins along the top give their number and their order (feature_skeleton, feature_network). Each line is
then drawn through the middle of the feature's sections, and ends where its spine does: half the width at half
its height before the height has fallen to a half (feature_line). A line that is not as long as the feature is
wide is the top of a mound, and no crest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .crest_network import SADDLE, Chain, find_chains, find_stretch, reaches_out
from .pin_lattice import Lattice
from .section_line import LEVEL, Field, smooth
from .skeleton import find_skeleton, measure_half_width

Pins = NDArray[np.int64]

#: Where a line is too low for more half widths than so many, there is a ridge between two mounds.
NOTCH = 1.5


@dataclass(frozen=True, eq=False)
class Crest:
    """Line along a feature.

    Attributes
    ----------
    points : ndarray (p, 3)
        m, a pitch apart at most.
    off : ndarray (p,)
        How far the feature is off its former place along it, m, positive.
    closed : bool
        Then the last point is the first.
    half : float
        Half the width of the feature at half its height, the median along the line, m.
    crossed : bool
        Whether it meets another line.
    """

    points: Floats
    off: Floats
    closed: bool
    half: float
    crossed: bool

    @property
    def length(self) -> float:
        """In space, m."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


class Ridge(NamedTuple):
    """Connected part of a feature: lines that meet, or the top of a mound.

    Attributes
    ----------
    crests : tuple of Crest
        The longest first; none for a mound.
    core : ndarray (m, 2)
        Places along the top, m.
    half : float
        Half its width, m.
    """

    crests: tuple[Crest, ...]
    core: Floats
    half: float


def find_ridges(lattice: Lattice, pins: Pins, off: Floats, height: Floats, least: float) -> tuple[Ridge, ...]:
    """Return the ridges and mounds of a feature that are parted by saddles, with their crests."""
    own = np.zeros(len(off))
    own[pins] = off[pins]
    beside = lattice.neighbor[pins]
    place = np.minimum(np.searchsorted(pins, beside), len(pins) - 1)
    among, on_bed = np.where(pins[place] == beside, place, -1), beside >= 0
    line = find_skeleton(among, on_bed, off[pins])
    position = lattice.formed.position[pins]
    field = Field(lattice, own, height, 2.0 * (measure_half_width(among, on_bed) + 2.0) * lattice.pitch)
    half = field.half_widths(position[line])
    found = find_chains(among, line, position, half, lattice.pitch, field.at) if len(line) > 1 else []
    if not found:  # a single pin, or a ring of three
        return (Ridge((), position[line], float(half.max())),)
    usual = float(np.median(half))
    pieces = [
        piece
        for chain in found
        for piece in _parted(chain, field, usual, least)
        if piece is chain or not any(piece.joined) or reaches_out(piece.points, usual, lattice.pitch)
    ]
    lines = [field.line(piece) for piece in pieces]
    _meet(pieces, lines, field)
    groups: list[tuple[set[int], list[int]]] = []
    for number, piece in enumerate(pieces):
        group = (set(piece.nodes), [number])
        for other in [one for one in groups if one[0] & group[0]]:
            groups.remove(other)
            group = (group[0] | other[0], group[1] + other[1])
        groups.append(group)
    made = []
    for _, numbers in groups:
        own_crests = [_crest(field, pieces[n], lines[n]) for n in numbers]
        kept = sorted((one for one in own_crests if one is not None), key=lambda one: -one.length)
        core = np.concatenate([pieces[n].points for n in numbers])
        if kept:
            core = np.concatenate([one.points[:, :2] for one in kept])
        wide = kept[0].half if kept else float(field.half_widths(core[[int(np.argmax(field.at(core)))]])[0])
        made.append(Ridge(tuple(kept), core, wide))
    return tuple(made)


def _parted(chain: Chain, field: Field, half: float, least: float) -> list[Chain]:
    """Return the parts of a line between saddles that are short, and lower than half of what they part."""
    points = chain.points
    off = field.at(points)
    if chain.closed:
        low = int(np.argmin(off))
        usual = float(np.median(off))
        if off[low] >= SADDLE * usual or usual - off[low] < least or len(points) < 4:
            return [chain]
        opened = np.concatenate([points[low:-1], points[: low + 1]])
        return _parted(Chain(opened, False, (False, False), chain.nodes), field, half, least)
    before, after = np.maximum.accumulate(off), np.maximum.accumulate(off[::-1])[::-1]
    banks = np.minimum(before, after)
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    for at in np.argsort(off / np.maximum(banks, 1e-12)).tolist():
        if off[at] >= SADDLE * banks[at]:
            return [chain]
        first, last = find_stretch(off < off[at] + LEVEL * (banks[at] - off[at]), at)
        if banks[at] - off[at] >= least and run[last] - run[first] <= NOTCH * half and 0 < at < len(off) - 1:
            first, last = find_stretch(off < SADDLE * banks[at], at)
            one = replace(chain, points=points[: max(first, 1)], joined=(chain.joined[0], False))
            two = replace(
                chain, points=points[min(last + 1, len(off) - 1) :], joined=(False, chain.joined[1])
            )
            return [*_parted(one, field, half, least), *_parted(two, field, half, least)]
    return [chain]


def _meet(pieces: list[Chain], lines: list[Floats | None], field: Field) -> None:
    """Let lines that end at a junction end on another line there, in place."""
    for number, piece in enumerate(pieces):
        for end in (0, -1):
            mine = lines[number]
            if mine is None or piece.closed or not piece.joined[end]:
                continue
            others = [
                line
                for k, line in enumerate(lines)
                if k != number and line is not None and pieces[k].nodes & piece.nodes
            ]
            turned = field.extend(mine[::-1] if end == 0 else mine, field.half_width(mine, False), others)
            lines[number] = turned[::-1] if end == 0 else turned


def _crest(field: Field, chain: Chain, line: Floats | None) -> Crest | None:
    """Return the crest along a line, or none where it is no more than a top."""
    if line is None:
        return None
    half = field.half_width(line, chain.closed)
    top = np.nan_to_num(field.lattice.at(field.height, line), nan=float(field.height.mean()))
    whole = smooth(np.column_stack([line, top, field.at(line)]), 2, chain.closed)
    if chain.closed:
        whole[-1] = whole[0]
    crest = Crest(whole[:, :3], whole[:, 3], chain.closed, half, len(chain.nodes) > 0)
    return crest if crest.length >= 2.0 * half else None
