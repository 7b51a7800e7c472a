"""Crests: lines along the top of a boss or the bottom of a crease, to a fraction of a pitch.

The pins along the top give their number and their order (skeleton, crest_network). Each line is
then drawn through the middle of the feature's sections, and ends where its spine does: half the
width at half its height before the height has fallen to a half. A line shorter than the feature is
wide is the top of a mound.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..base.arrays import TIE, Floats, Indices, settle
from .crest_network import (
    SADDLE,
    Chain,
    find_banks,
    find_chains,
    find_stretch,
    intersect,
    measure_run,
    normalize,
    place_along,
    reaches_out,
)
from .formed import Formed
from .skeleton import find_skeleton, measure_half_width

#: Steps per pitch in a search for a distance.
STEPS = 2
#: Pairs of a point and a step that are computed at once.
CHUNK = 1 << 20
#: Heights that differ by less than this share of the rise count as level.
LEVEL = 0.1
#: Directions in which a half width is measured.
AROUND = 16
#: Rounds in which a line is moved into the middle of its sections.
ROUNDS = 3
#: Rounds in which the end of a line is found.
ROUNDS_AT_END = 8
#: The end of a line is at most this many half widths before the feature's end.
WIDE = 1.5
#: A section wider than the median by this factor crosses a junction, and does not show its middle.
EVEN = 1.25
#: A line that has fallen below this share of its height at its end, and rises again, has ended in
#: between.
FALLEN = 0.75
#: Sections are taken at this share of the height.
MIDDLE = 0.7
#: A line may have a corner where it turns by more than `TURN` within `LEG` half widths to both
#: sides. Its legs are straight from `CORNER` half widths on. It is a corner if the feature has at
#: least the share `HIGH` of its height there, and less than half the loss of height that an arc
#: between the legs would have.
CORNER, LEG, TURN, HIGH = 1.5, 2.5, np.radians(28.0), 0.7
#: Shares of a smoothing step and of the step back.
TO_AND_FRO = (0.5, -0.53)


@dataclass(frozen=True, eq=False)
class Field:
    """Heights of one feature between the pins, and the largest distance of its flanks."""

    bed: Formed
    off: Floats
    most: float

    def at(self, position: Floats) -> Floats:
        """Return the height of the feature at positions, m; 0 beyond the bed."""
        return np.nan_to_num(self.bed.at(self.off, position))

    def falls(self, position: Floats, direction: Floats, level: Floats) -> Floats:
        """Return the distances (k,), m, along unit vectors at which the feature falls to levels; else inf."""
        step = self.bed.spacing / STEPS
        steps = np.arange(1, int(np.ceil(self.most / step)) + 1) * step
        distance, rows = np.full(len(position), np.inf), max(1, CHUNK // len(steps))
        for start in range(0, len(position), rows):
            part = slice(start, start + rows)
            here = position[part, None] + steps[:, None] * direction[part, None]
            at_start, on_path = self.bed.at(self.off, position[part]), self.bed.at(self.off, here)
            above = np.column_stack([at_start, on_path]) - level[part, None]
            fallen = above < 0.0  # not where the bed has ended: NaN
            first = np.argmax(fallen | np.isnan(above), axis=1)
            row = np.arange(len(first))
            over, under = above[row, np.maximum(first - 1, 0)], above[row, first]
            with np.errstate(invalid="ignore", divide="ignore"):
                reached = np.where(first > 0, step * (first - 1 + over / (over - under)), 0.0)
            distance[part] = np.where(fallen[row, first], reached, np.inf)
        return distance

    def half_widths(self, position: Floats) -> Floats:
        """Return the least distances (k,), m, at which the feature falls to half its height."""
        angles = 2.0 * np.pi * np.arange(AROUND) / AROUND
        directions = np.tile(np.column_stack([np.cos(angles), np.sin(angles)]), (len(position), 1))
        level = np.repeat(0.5 * self.at(position), AROUND)
        distance = self.falls(np.repeat(position, AROUND, axis=0), directions, level).reshape(
            -1, AROUND
        )
        return np.minimum(distance.min(axis=1), self.most)

    def line(self, chain: Chain) -> Floats | None:
        """Return the line along the top that follows a chain of pins, or none if it has no length."""
        pitch = self.bed.spacing
        line = space_evenly(chain.points, pitch)
        if len(line) < 2:
            return None
        line = smooth(line, 2, chain.closed)
        for _ in range(ROUNDS):
            line = space_evenly(self._centered(line, chain), pitch)
            if len(line) < 2:
                return None
            line = smooth(line, 1, chain.closed)
        half = self.half_width(line, chain.closed)
        for end, order in ((0, -1), (1, 1)):
            if not (chain.closed or chain.joined[end]):
                line = self._find_line_ends(line[::order], half)[::order]
                if len(line) < 2:
                    return None
        return self._sharpened(line, half, chain.closed)

    def _sharpened(self, line: Floats, half: float, closed: bool) -> Floats:
        """Return a line with corners where its straight legs meet, if the feature is high enough there."""
        step = self.bed.spacing / 2.0
        fine = space_evenly(line, step)
        width = max(2, round(CORNER * half / step))
        if len(fine) < 4 * width:
            return line
        wide = max(2, round(LEG * half / step))
        turn = _turns(fine, wide, closed)
        if closed:  # from a straight place on
            first = int(np.argmin(turn[:-1]))
            fine = np.concatenate([fine[first:-1], fine[: first + 1]])
            turn = np.concatenate([turn[first:-1], turn[: first + 1]])
        sharp = np.flatnonzero(turn > TURN)
        peaks = [i for i in sharp if turn[i] == turn[max(i - wide, 0) : i + wide + 1].max()]
        ends = [0, *peaks, len(fine) - 1]
        pieces, start, reach = [], 0, width + wide
        for before, i, after in zip(ends, peaks, ends[2:], strict=False):
            first = (before + i + 1) // 2 if before else 0
            last = (i + after) // 2 if after < len(fine) - 1 else after
            leg = fine[max(i - reach, first) : i - width + 1]
            next_leg = fine[i + width : min(i + reach, last) + 1]
            corner = self._meeting(leg, next_leg[::-1], half)
            if corner is not None and i - width >= start:
                pieces.append(np.concatenate([fine[start : i - width + 1], corner]))
                fine[i + width - 1], start = corner[0], i + width - 1
        if not pieces:
            return line
        # The last point of a piece is the first one of the next.
        parts = [space_evenly(piece, 2.0 * step)[:-1] for piece in pieces]
        return np.concatenate([*parts, space_evenly(fine[start:], 2.0 * step)])

    def extend(self, line: Floats, half: float, others: list[Floats]) -> Floats:
        """Return a line extended straight onto one of others, or else to their nearest point."""
        step = self.bed.spacing / 4.0
        if not others:
            return line
        fine = space_evenly(line, step)
        near, far = (round(share * half / step) for share in (CORNER, CORNER + LEG))
        leg = fine[-far - 1 : -near]
        every = np.concatenate([space_evenly(other, step) for other in others])
        corner = every[[int(np.argmin(np.hypot(*(every - line[-1]).T)))]]
        if len(leg) > 4:
            middle, direction = _straight(leg)
            aside = (every - middle) @ np.array([-direction[1], direction[0]])
            ahead = (every - middle) @ direction
            met = np.flatnonzero((np.abs(aside) <= step) & (ahead > 0.0))
            if len(met):
                end = float((line[-1] - middle) @ direction)
                at = met[[int(np.argmin(np.abs(ahead[met] - end)))]]
                path = _sample(middle, every[at])
                if self.at(path).min() >= HIGH * float(np.median(self.at(leg))):
                    fine, corner = fine[:-near], every[at]
        return space_evenly(np.concatenate([fine, corner]), self.bed.spacing)

    def _meeting(self, leg: Floats, other: Floats, half: float) -> Floats | None:
        """Return where two legs (k, 2) meet that lead to a corner, (1, 2), or none."""
        if min(len(leg), len(other)) < 3:
            return None
        middles, directions = zip(*map(_straight, (leg, other)), strict=True)
        away = intersect(directions, middles, 1e-3)
        if away is None:
            return None
        corner = (middles[0] + away[0] * directions[0])[None]
        path = np.concatenate([_sample(middle, corner) for middle in middles])
        high = float(np.median(self.at(np.concatenate([leg, other]))))
        turn = max(np.arccos(np.clip(-directions[0] @ directions[1], -1.0, 1.0)), 1e-3) / 2.0
        out = np.hypot(*(middles[1] - middles[0])) / 2.0 * (1.0 / np.sin(turn) - 1.0 / np.tan(turn))
        least = max(HIGH, 1.0 - 0.25 * (out / half) ** 2)
        return corner if away.min() > 0.0 and self.at(path).min() >= least * high else None

    def _sections(self, line: Floats, closed: bool, share: float) -> tuple[Floats, Floats, Floats]:
        """Return the directions of a line's sections, and their extents to both sides at a level."""
        ahead = np.gradient(line, axis=0) if len(line) > 2 else np.tile(line[-1] - line[0], (2, 1))
        if closed:
            ahead[0] = ahead[-1] = line[1] - line[-2]
        ahead /= np.maximum(np.hypot(*ahead.T), 1e-12)[:, None]
        aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
        level = share * self.at(line)
        return aside, self.falls(line, aside, level), self.falls(line, -aside, level)

    def _centered(self, line: Floats, chain: Chain) -> Floats:
        """Return a line moved into the middle of its sections."""
        aside, left, right = self._sections(line, chain.closed, MIDDLE)
        wide = left + right
        seen = np.isfinite(wide)
        if not seen.any():
            return line
        seen &= wide <= EVEN * float(np.median(wide[seen]))
        # Across a junction the line continues as it does beside it.
        valid = np.flatnonzero(seen)
        shift = np.interp(np.arange(len(line)), valid, 0.5 * (left[valid] - right[valid]))
        shift = np.clip(shift, -self.bed.spacing, self.bed.spacing)
        for end in (0, 1):
            if chain.joined[end] and not chain.closed:
                shift[-end] = 0.0
        return line + shift[:, None] * aside

    def half_width(self, line: Floats, closed: bool) -> float:
        """Return half the width at half the height, the median along a line."""
        _, left, right = self._sections(line, closed, 0.5)
        # Along the edge of the bed a feature has one flank only.
        half = np.where(np.isfinite(left + right), 0.5 * (left + right), np.minimum(left, right))
        seen = np.isfinite(half)
        return float(np.median(half[seen])) if seen.any() else self.most

    def _find_line_ends(self, line: Floats, half: float) -> Floats:
        """Return a line cut or extended at its last point, so that it ends where its spine ends."""
        pitch = self.bed.spacing
        run = measure_run(line)
        # Its last pins may turn aside, at the edge of the bed more of them: the line goes straight
        # on there.
        directions = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        around = line[-1] + (half + pitch) * directions
        at_edge = bool(np.isnan(self.bed.at(self.off, around)).any())
        aside_at_end = half if at_edge else min(half, pitch)
        before = run <= run[-1] - (aside_at_end if run[-1] > 4.0 * half else 0.0)
        line, run = line[before], run[before]
        back = max(0.0, run[-1] - max(2.0 * half, 2.0 * pitch))
        direction = normalize(line[-1] - place_along(np.array([back]), run, line)[0])
        longer = np.arange(1, int(np.ceil(self.most / pitch)) + 1)[:, None] * pitch * direction
        path = np.concatenate([line, line[-1] + longer])
        fine = space_evenly(path, pitch / 4.0)
        off, along = self.bed.at(self.off, fine), measure_run(fine)
        beyond = np.flatnonzero(np.isnan(off))
        last = int(beyond[0]) if len(beyond) else len(off)
        end = float(run[-1])
        for _ in range(ROUNDS_AT_END):
            near = (along[:last] >= end - max(0.5 * half, pitch)) & (along[:last] <= end)
            if not near.any():
                break
            level = float(off[:last][near].mean())
            start, at = np.flatnonzero(near)[[0, -1]].tolist()
            lowest = np.minimum.accumulate(off[start:last])
            again = (lowest < FALLEN * level) & (off[start:last] > lowest + LEVEL * level)
            low = np.flatnonzero((off[start:last] < 0.5 * level) | again)
            if not len(low):
                end = float(along[last - 1])  # the feature continues beyond the bed
                break
            k = start + int(low[0])
            if again[k - start]:
                k = start + int(np.argmin(off[start : k + 1]))
            over, under = off[k - 1] - 0.5 * level, off[k] - 0.5 * level
            share = over / (over - under) if k > start and under < 0.0 else 1.0
            fallen = along[k - 1] + (along[k] - along[k - 1]) * share
            aside = np.array([-direction[1], direction[0]])
            sides = self.falls(fine[[at, at]], np.stack([aside, -aside]), np.full(2, 0.5 * level))
            if np.isfinite(sides).all():
                half_here = 0.5 * float(sides.sum())
            else:
                half_here = min(float(sides.min()), half)
            end = float(fallen) - min(half_here, WIDE * half)
        if end <= 0.0:
            return line[:1]
        before = along < end - 0.25 * pitch
        tip = place_along(np.array([end]), along, fine)
        return space_evenly(np.concatenate([fine[before], tip]), pitch)


def space_evenly(points: Floats, step: float) -> Floats:
    """Return points along a line at even steps, `step` apart at most; one of a line without length."""
    run = measure_run(points)
    if run[-1] < 1e-9:
        return points[:1]
    count = max(2, int(np.ceil(run[-1] / step - TIE)) + 1)
    return place_along(np.linspace(0.0, run[-1], count), run, points)


def _straight(leg: Floats) -> tuple[Floats, Floats]:
    """Return the middle of a leg (k, 2), and the unit vector along it."""
    first, second = leg[: (len(leg) + 1) // 2], leg[len(leg) // 2 :]
    return leg.mean(axis=0), normalize(second.mean(axis=0) - first.mean(axis=0))


def _sample(start: Floats, stop: Floats) -> Floats:
    """Return nine points (9, 2) of the straight line between two points."""
    return start + np.linspace(0.0, 1.0, 9)[:, None] * (stop - start)


def _turns(line: Floats, width: int, closed: bool) -> Floats:
    """Return the turn of a line (m, 2) at its points, from `width` points before to as many after, rad."""
    count = len(line) - 1
    at = np.arange(count + 1)
    before, after = at - width, at + width
    if closed:
        before, after = before % count, after % count
    else:
        before, after = before.clip(0), after.clip(None, count)
    arriving, leaving = line - line[before], line[after] - line
    sine = arriving[:, 0] * leaving[:, 1] - arriving[:, 1] * leaving[:, 0]
    return np.asarray(settle(np.abs(np.arctan2(sine, np.sum(arriving * leaving, axis=1)))))


def smooth(line: Floats, times: int, closed: bool) -> Floats:
    """Return a line without its staircase; ends stay."""
    if len(line) < 4:
        return line
    # A step towards the mean of the neighbors and a little further back again, so that an arc does
    # not shrink: G. Taubin, A signal processing approach to fair surface design, SIGGRAPH 1995.
    for share in TO_AND_FRO * times:
        pull = np.zeros_like(line)
        pull[1:-1] = 0.5 * (line[:-2] + line[2:]) - line[1:-1]
        if closed:
            pull[[0, -1]] = 0.5 * (line[-2] + line[1]) - line[0]
        line = line + share * pull
    return line


#: A low stretch longer than this many half widths is no saddle, but a ridge between two mounds.
NOTCH = 1.5


def measure_in_space(points: Floats) -> float:
    """Return the length of a line (p, 3), m."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class Crest:
    """Line along a feature."""

    points: Floats
    """(p, 3): m, a pitch apart at most."""
    off: Floats
    """(p,): Height or depth of the feature along it, off the former surface, m, positive."""
    closed: bool
    """Then the last point is the first."""
    half: float
    """Half the width of the feature at half its height, the median along the line, m."""
    crossed: bool
    """Whether it meets another line."""

    @property
    def length(self) -> float:
        """In space, m."""
        return measure_in_space(self.points)


class Ridge(NamedTuple):
    """Part of a feature: lines that meet, longest first, or a mound; its top (m, 2) and its half width, m."""

    crests: tuple[Crest, ...]
    core: Floats
    half: float


def find_ridges(bed: Formed, pins: Indices, off: Floats, least: float) -> tuple[Ridge, ...]:
    """Return the ridges and mounds of a feature that saddles divide, with their crests."""
    of_feature = np.zeros(len(off))
    of_feature[pins] = off[pins]
    beside = bed.neighbors[pins]
    rank = np.minimum(np.searchsorted(pins, beside), len(pins) - 1)
    among, on_bed = np.where(pins[rank] == beside, rank, -1), beside >= 0
    line = find_skeleton(among, on_bed, off[pins])
    position = bed.position[pins]
    field = Field(bed, of_feature, 2.0 * (measure_half_width(among, on_bed) + 2.0) * bed.spacing)
    half = field.half_widths(position[line])
    chains = (
        find_chains(among, line, position, half, bed.spacing, field.at) if len(line) > 1 else []
    )
    if not chains:  # a single pin, or a ring of three
        return (Ridge((), position[line], float(half.max())),)
    usual = float(np.median(half))
    pieces = [
        piece
        for chain in chains
        for piece in _parted(chain, field, usual, least)
        if piece is chain or not any(piece.joined) or reaches_out(piece.points, usual, bed.spacing)
    ]
    lines = [field.line(piece) for piece in pieces]
    _meet(pieces, lines, field)
    groups: list[tuple[set[int], list[int]]] = []
    for number, piece in enumerate(pieces):
        group = (set(piece.nodes), [number])
        for other in [other for other in groups if other[0] & group[0]]:
            groups.remove(other)
            group = (group[0] | other[0], group[1] + other[1])
        groups.append(group)
    ridges = []
    for _, numbers in groups:
        every = [_crest(field, pieces[n], lines[n]) for n in numbers]
        crests = sorted(filter(None, every), key=lambda crest: -settle(crest.length))
        if crests:
            core = np.concatenate([crest.points[:, :2] for crest in crests])
            half_width = crests[0].half
        else:
            core = np.concatenate([pieces[n].points for n in numbers])
            top = core[[int(np.argmax(field.at(core)))]]
            half_width = float(field.half_widths(top)[0])
        ridges.append(Ridge(tuple(crests), core, half_width))
    return tuple(ridges)


def _parted(chain: Chain, field: Field, half: float, least: float) -> list[Chain]:
    """Return the parts of a line between its saddles: short stretches below half the height beside them."""
    points = chain.points
    off = field.at(points)
    if chain.closed:
        low = int(np.argmin(off))
        usual = float(np.median(off))
        if off[low] >= SADDLE * usual or usual - off[low] < least or len(points) < 4:
            return [chain]
        opened = np.concatenate([points[low:-1], points[: low + 1]])
        return _parted(Chain(opened, False, (False, False), chain.nodes), field, half, least)
    banks = find_banks(off)
    run = measure_run(points)
    for at in np.argsort(settle(off / np.maximum(banks, 1e-12)), kind="stable").tolist():
        if off[at] >= SADDLE * banks[at]:
            return [chain]
        first, last = find_stretch(off < off[at] + LEVEL * (banks[at] - off[at]), at)
        deep = banks[at] - off[at] >= least
        short = run[last] - run[first] <= NOTCH * half
        if deep and short and 0 < at < len(off) - 1:
            first, last = find_stretch(off < SADDLE * banks[at], at)
            part = replace(chain, points=points[: max(first, 1)], joined=(chain.joined[0], False))
            rest = points[min(last + 1, len(off) - 1) :]
            other = replace(chain, points=rest, joined=(False, chain.joined[1]))
            return [*_parted(part, field, half, least), *_parted(other, field, half, least)]
    return [chain]


def _meet(pieces: list[Chain], lines: list[Floats | None], field: Field) -> None:
    """Extend lines that end at a junction to another line there, in place."""
    for number, piece in enumerate(pieces):
        for end, order in ((0, -1), (-1, 1)):
            line = lines[number]
            if line is None or piece.closed or not piece.joined[end]:
                continue
            met = [k for k, other in enumerate(pieces) if k != number and other.nodes & piece.nodes]
            others = [other for k in met if (other := lines[k]) is not None]
            lines[number] = field.extend(line[::order], field.half_width(line, False), others)[
                ::order
            ]


def _crest(field: Field, chain: Chain, line: Floats | None) -> Crest | None:
    """Return the crest along a line, or none if it is shorter than the feature is wide."""
    if line is None:
        return None
    half = field.half_width(line, chain.closed)
    top = np.nan_to_num(field.bed.at(field.bed.height, line), nan=float(field.bed.height.mean()))
    whole = smooth(np.column_stack([line, top, field.at(line)]), 2, chain.closed)
    if chain.closed:
        whole[-1] = whole[0]
    crest = Crest(whole[:, :3], whole[:, 3], chain.closed, half, len(chain.nodes) > 0)
    return crest if crest.length >= 2.0 * half else None
