"""Claims of the paper beside measurements, with numbers from the results alone."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from . import evidence
from .evidence import MM, Evidence
from .results import AHEAD, PAPER_SPEED, Results
from .scenes import PRESSED
from .simulations import GAUSSIAN, STAGGERED


class Claim(NamedTuple):
    """Row of the page: claim, measurement, result, and the reason of a failure."""

    printed: str
    measured: str
    verdict: str
    why: str = ""


SPEED, PRESS = f"{PAPER_SPEED * MM:g} mm/s", f"a quick press of {PRESSED * MM:g} mm"
#: What judges a claim, what the paper says, and the beginning of what was measured, in the paper's order.
CLAIMS: tuple[tuple[Callable[[Results], Evidence], str, str], ...] = (
    (evidence.tracking, f"Both methods track to {SPEED} on simple trajectories", ""),
    (evidence.largest_speed, f"Up to {SPEED}, and how far beyond",
     "Largest speed of a straight level drag, and of a lift: "),
    (evidence.deviations, "Method II's deviations of height and force are much greater",
     "Method I and II on the session{slow}: "),
    (evidence.reference_force, "RFD of both methods, Method I's being the smaller", "Session{slow}: "),
    (evidence.onset, "The virtual master makes a second-order loop that oscillates at high gain",
     f"Holding still after {PRESS}, a cycle that goes on sets in "),
    (evidence.trade, "Proportional gains trade oscillation for speed of response",
     "Time until the force stays within 10 % of its set point: "),
    (evidence.blister,
     "A blister is lifted by 15 mm, or sunk, with a cone or a Gaussian for its profile (Fig. 4)", ""),
    (evidence.freezing, "Cells left behind freeze, and the ridge stays", f"Ridge dragged at {SPEED}. "),
    (evidence.carried_out, "Both methods carry out the session of Fig. 8",
     "At its own times (lift-offs faster than a pin left aside): "),
    (evidence.relief,
     "The session leaves a ridge, a mound at its end, and a valley across the far edge (Fig. 10)",
     "Sections, session{slow}, deviation from the section asked for: "),
    (evidence.rise, "The slight rise of Method II's blister causes its greater forces",
     f"Drags at {SPEED}: "),
    (evidence.ahead, "Method I lowers the cells ahead of a finger in the surface, however deep",
     f"Mean height over the bed at rest, {AHEAD[0] * MM:g} to {AHEAD[1] * MM:g} mm ahead of the fingertip, "
     "of cells that do not feel it: "),
    (evidence.escape, "Method II, without a virtual master, escapes the oscillation",
     f"Amplitude of the force in the last second of a hold after {PRESS}: "),
    (evidence.radius, "A search radius around the virtual master rejects noise",
     "How far Method I's master wanders under a finger held still (rms), r_VM {radius} mm, by noise of "
     "the force sensors: "),
    (partial(evidence.varied, STAGGERED), "Both methods work on a staggered bed",
     f"Drags at {SPEED}, lag and RFD: "),
    (partial(evidence.varied, GAUSSIAN), "Both methods drag a Gaussian blister as they do a cone",
     f"Drags at {SPEED}, lag and RFD: "),
)  # fmt: skip


def claims(results: Results) -> list[Claim]:
    """Return all claims, in the order of the paper."""
    slow, radius, judged = results.slowness.lstrip(","), f"{evidence.find_radius(results) * MM:g}", []
    for judge, printed, beginning in CLAIMS:
        shown = judge(results)
        measured = beginning.format(slow=slow, radius=radius) + shown.measured
        judged.append(Claim(printed, measured, shown.verdict, shown.why))
    return judged
