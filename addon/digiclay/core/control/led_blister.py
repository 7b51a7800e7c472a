"""Blister of Method III around the predicted fingertip, led ahead of it; memory of the method."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..base.arrays import TIE, Floats
from ..model.layout import Disc, enclose_discs
from .blister import BlisterCells, BlisterRule
from .finger_estimate import STATES, Aim, Estimate
from .finger_sections import WHOLE, Whole
from .travel import Heading
from .virtual_master import IDLE, Master, Phase

#: A fingertip slower than this has no direction, m/s.
SLOWEST = 1e-3
#: Slope without lead: pins are below every surface.
STEEP = 1e9


@dataclass(frozen=True)
class LeadProfile:
    """Slopes of the heights around the fingertip."""

    level: float
    """Radius within which pins are level with the top, m."""
    rise: float
    fall: float
    """Assumed speeds of free pins, m/s."""
    skirt: float
    """Speed of expected drags from rest, m/s; 0: no skirt."""

    def find_reach(self, height: float, speed: float) -> float:
        """Return the radius within which pins may be led, m, for a height over the surface and a speed."""
        quickest = max(speed, self.skirt)
        return self.level + abs(height) * quickest / (self.rise if height > 0.0 else self.fall)

    def find_slopes(self, speed: float, *, raised: bool) -> tuple[float, float]:
        """Return the largest slopes around and ahead at a speed, m/s, up to the top if `raised`."""
        free = self.rise if raised else self.fall
        around = free / self.skirt if self.skirt else STEEP
        return around, min(free / speed if speed >= SLOWEST else STEEP, around)

    def find_drop(self, distance: Floats, ahead: Floats, around: Any, forward: Any) -> Floats:
        """Return the largest distances of pins from the top, (m,), m, by slopes of `find_slopes`."""
        drop: Floats = distance - self.level
        np.maximum(drop, 0.0, out=drop)
        drop *= around if forward is around else np.where(ahead > TIE, forward, around)
        return drop


class Follower(NamedTuple):
    """Memory of Method III about its fingertip, see `following.Follower`."""

    phase: Phase = IDLE
    period: int = 0
    """IDLE or SHAPING; control periods so far."""
    estimate: Estimate = Estimate(np.zeros(STATES), np.zeros((STATES, STATES)))
    top: float = 0.0
    edge: float = 0.0
    """Heights of the blister's top and of the surface around it, m."""
    heading: Heading = Heading()
    trim: float = 0.0
    """Slow correction of the set point, N."""
    felt: float = 0.0
    alone: int = 0
    losses: int = 0
    """Top when the fingertip was last felt, m; control periods since then; number of losses."""
    led_x: float = 0.0
    led_y: float = 0.0
    led_radius: float = 0.0
    """Disc within which pins may be led, m; a radius of 0: none is."""
    due: tuple[float, ...] = ()
    doubt: float = 0.0
    """Total forces predicted for this and the next periods, N, below 0: none; mean square error of the last
    predictions, N²."""
    master: Master = Master()
    """Memory of Method I while it has taken over; else IDLE."""

    @property
    def position(self) -> tuple[float, float] | None:
        """Position of the fingertip, m; None if none is followed."""
        if self.phase is IDLE or self.master.phase is not IDLE:
            return self.master.position
        x, y, *_ = self.estimate.mean.tolist()
        return x, y


#: Margin of the disc of led pins around the estimated position and reach, m.
MARGIN = 2e-3


class Region(NamedTuple):
    """Cells about the predicted positions of the fingertips."""

    edges: list[float]
    raised: list[bool]
    """Height of the surface ahead of each, m, and whether the blister's top is above it."""
    aims: list[Aim]
    speeds: list[float]
    """Lowest point of each fingertip then, m, and its speed in the plane, m/s."""
    cells: BlisterCells
    drop: Floats
    """Cells around the aims, and largest distances from the top, (m,), m; see `LeadProfile.find_drop`."""


@dataclass(frozen=True, eq=False)
class LedBlister:
    """Blister that is led; `ahead`: time over which the fingertip is predicted, s."""

    rule: BlisterRule
    profile: LeadProfile
    ahead: float

    def find_disc(self, memory: Follower) -> Disc | None:
        """Return the disc of the pins to command: those led now or before."""
        led = (memory.led_x, memory.led_y, memory.led_radius)
        if memory.phase is IDLE:
            return led if memory.led_radius else None
        x, y, _, vx, vy, *_ = memory.estimate.mean.tolist()
        reach = self.profile.find_reach(memory.top - memory.edge, math.hypot(vx, vy))
        disc = (x, y, max(self.rule.blister.edge_radius, reach) + MARGIN)
        return enclose_discs(disc, led) if memory.led_radius else disc

    def survey(
        self, memories: list[Follower], basis: Floats, left: Floats, sections: Whole = WHOLE
    ) -> Region:
        """Return the cells around predicted fingertips, by the heights at which pins were left, (m,), m."""
        time, aims, speeds, poses = self.ahead, [], [], []
        for memory in memories:
            x, y, z, vx, vy, vz, *_ = memory.estimate.mean.tolist()
            aims.append((x + vx * time, y + vy * time, z + vz * time))
            speeds.append(math.hypot(vx, vy))
            poses.append((*aims[-1][:2], *memory.heading[2:]))
        cells = self.rule.divide(sections.spread(poses), basis)
        edges = sections.average(
            left, self.rule.find_edge(cells), [memory.edge for memory in memories]
        )
        raised = [memory.top > edge + TIE for memory, edge in zip(memories, edges, strict=True)]
        find = self.profile.find_slopes
        slopes = [find(speed, raised=up) for speed, up in zip(speeds, raised, strict=True)]
        drop = self.profile.find_drop(cells.distance, cells.ahead, *sections.spread(slopes))
        return Region(edges, raised, aims, speeds, cells, drop)
