"""Measurements of `digiclay paper` as one value, for figures and claims."""

from dataclasses import dataclass, field
from typing import NamedTuple

from digiclay.core.base.arrays import Array, Floats
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import Result
from digiclay.core.studies.speed_limits import Criterion, Drag, Follows

from .scenes import SINK, TALL

#: The speed up to which the paper says both methods track, m/s, and its session.
PAPER_SPEED, SESSION = 15e-3, "ridge_mound_valley"
#: The simple trajectories: straight and level drags over the fingertip's height, m; and one more,
#: less deep.
RIDGE = "a ridge 15 mm high"
WAYS = {
    "in the surface": Drag(height=-4.5e-3),
    RIDGE: Drag(height=TALL),
    "a valley": Drag(height=SINK),
}
DRAGS = WAYS | {"less deep": Drag(height=-1.5e-3)}
#: How far ahead of the fingertip cells are looked at that do not feel it yet, m.
AHEAD = (9e-3, 12e-3)
#: The scene without a change, among its variants.
AS_IT_IS = "as it is"
#: Smallest amplitude of an oscillation that goes on, a fortieth of the set point, N.
SUSTAINED = 0.01


@dataclass(frozen=True)
class Extent:
    """Extent of the simulations."""

    resolution: float
    """Of the largest speeds, m/s."""
    drags: tuple[float, float]
    lifts: tuple[float, float]
    """Between which speeds the largest of a drag and of a lift are looked for, m/s."""
    speeds: tuple[float, ...]
    """Of the drags that are drawn, m/s."""
    gains: tuple[float, ...]
    position_gains: tuple[float, ...]
    """Of the sweep, 1/N and 1/m."""
    cell_gains: tuple[float, ...]
    """K_FF of Method II's sweep, 1/N."""
    ways: tuple[str, ...]
    """Which of the simple trajectories the variants of the scene are tried on."""
    noises: tuple[float, ...]
    """Standard deviations of the force sensors with which the fingertip is located, N."""
    third: tuple[str, ...] = ()
    """What Method III is run on besides the session: blisters, tracks."""


FULL = Extent(
    0.5e-3, (5e-3, 32e-3), (2e-3, 40e-3), (10e-3, 15e-3, 20e-3, 25e-3),
    (2.0, 2.5, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0, 28.0, 40.0, 57.0, 80.0, 113.0, 160.0),
    (500.0, 1000.0, 2000.0), (15.0, 25.0, 50.0, 70.0, 100.0, 200.0, 400.0), tuple(WAYS),
    (0.5e-3, 1e-3, 2e-3), ("blisters", "tracks"),
)  # fmt: skip
QUICK = Extent(
    15e-3, (15e-3, 30e-3), (15e-3, 30e-3), (), (5.0, 80.0), (500.0, 1000.0), (15.0, 100.0),
    ("in the surface",), (2e-3,),
)  # fmt: skip


#: Largest speed of a drag that is looked for with Method III, m/s, and more speeds of its drags.
BEYOND = 80e-3, (40e-3, 60e-3)


class Swing(NamedTuple):
    """Result of a hold after a quick press, at one pair of gains."""

    gain: float
    position_gain: float
    """K_f, 1/N, and K_p, 1/m."""
    amplitude: float
    """Of the force in the last second, N."""
    frequency: float | None
    """Hz."""
    settling: float | None
    """From the press until the force stays within 10 % of its set point, s; None: it goes on swinging."""

    @property
    def sustained(self) -> bool:
        """Whether the force still swings, and does not only drift, in the last second."""
        return self.frequency is not None and self.amplitude > SUSTAINED


class Dragged(NamedTuple):
    """Result of a straight level drag."""

    follows: Follows
    force: float
    deviation: float
    """Mean and standard deviation over time of the total force, N."""
    followers: float
    """Mean number of cells that follow the force."""
    unevenness: float | None
    """See the metric ``ridge_unevenness``, m."""
    ahead: float | None
    """Mean height over the bed at rest of cells that do not feel the fingertip and lie `AHEAD` of it, m."""


class Located(NamedTuple):
    """Error of Method I's position of a fingertip at rest, with noisy force sensors."""

    noise: float
    """Standard deviation of a cell's force sensor, N."""
    radius: float
    """r_VM, m."""
    thresholds: bool
    """Whether the controller takes readings below the threshold of the noise for none."""
    scatter: float | None
    """Root mean square distance of the virtual master from its mean place, m; None: it never shapes."""
    losses: int
    """How often the fingertip was lost."""


class Session(NamedTuple):
    """Quantities of a session for figures and claims."""

    scene: Scene
    history: dict[str, Array]
    """Every fourth row of time, height, total force, total force asked for (``set_point``), number of cells
    that follow and fingertip; and the positions."""
    detail: dict[str, Array]
    """Every row of time and height in the first seconds."""
    metrics: dict[str, float | None]
    """As `Result.figures`."""
    lost: list[float]
    """When the fingertip was lost though it rose no faster than a pin can, s."""
    windows: dict[str, dict[str, float | None]]
    """RFD, N, and standard deviations over time of total force, N, and of the height under the fingertip, m,
    by the names of `windows.WINDOWS` and of the metrics."""

    def gain(self, name: str) -> float:
        """Return a parameter of the controller; 0 where it has none."""
        return getattr(self.scene.control, name, 0.0)


@dataclass
class Results:
    """All results, by method where methods are compared; Method III's come last."""

    criterion: Criterion = field(default_factory=Criterion)
    blisters: dict[tuple[str, str, str], Result] = field(default_factory=dict)
    drags: dict[str, tuple[Result, float, float]] = field(default_factory=dict)
    printed: dict[str, Session] = field(default_factory=dict)
    session: dict[str, Session] = field(default_factory=dict)
    slow: float = 1.0
    simple: dict[tuple[str, str], Follows] = field(default_factory=dict)
    tracks: dict[str, list[Follows]] = field(default_factory=dict)
    fastest: dict[tuple[str, str], float | None] = field(default_factory=dict)
    lifting: dict[str, float | None] = field(default_factory=dict)
    swings: list[Swing] = field(default_factory=list)
    details: dict[tuple[float, float], tuple[Floats, Floats]] = field(default_factory=dict)
    quicker: list[Swing] = field(default_factory=list)
    quicker_speed: float = 0.0
    wild: Session | None = None
    cell_swings: list[Swing] = field(default_factory=list)
    dragged: dict[tuple[str, str, str], Dragged] = field(default_factory=dict)
    located: list[Located] = field(default_factory=list)

    @property
    def slowness(self) -> str:
        """How much longer the session takes than its own times, in words; empty if it does not."""
        return f", {self.slow:g} times as long" if self.slow > 1.0 else ""

    @property
    def sweeps(self) -> dict[float, list[Swing]]:
        """The swings by K_p, 1/m, in ascending order, each sweep by K_f."""
        gains = sorted({swing.position_gain for swing in self.swings})
        return {
            gain: sorted(swing for swing in self.swings if swing.position_gain == gain)
            for gain in gains
        }

    def onset(self, position_gain: float) -> tuple[float | None, float | None]:
        """Return the `onset_among` those at one K_p, 1/m."""
        return onset_among(self.sweeps.get(position_gain, []))


def onset_among(swings: list[Swing]) -> tuple[float | None, float | None]:
    """Return the largest K_f below the first sustained oscillation, and the one that has it, 1/N."""
    row = sorted(swings, key=lambda one: one.gain)
    first = next((i for i, one in enumerate(row) if one.sustained), None)
    if first is None:
        return (row[-1].gain if row else None), None
    return (row[first - 1].gain if first else None), row[first].gain
