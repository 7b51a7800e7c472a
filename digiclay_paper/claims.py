"""Claims of the paper beside measurements, with numbers from the results alone."""

from pathlib import Path
from typing import NamedTuple

from digiclay.core.scene.scene_source import read_table

from . import evidence
from .evidence import MM
from .results import AHEAD, PAPER_SPEED, Results
from .scenes import PRESSED

#: Claims, figures and metrics of the page, in its order.
TEXTS = read_table(Path(__file__).with_name("paper.toml"))


class Claim(NamedTuple):
    """Row of the page: claim, measurement, result, and the reason of a failure."""

    printed: str
    measured: str
    verdict: str
    why: str = ""


def claims(results: Results) -> list[Claim]:
    """Return all claims, in the order of the paper."""
    near, far = (f"{distance * MM:g}" for distance in AHEAD)
    words = {
        "slow": results.slowness.lstrip(","),
        "radius": f"{evidence.find_radius(results) * MM:g}",
        "speed": f"{PAPER_SPEED * MM:g} mm/s",
        "press": f"a quick press of {PRESSED * MM:g} mm",
        "near": near,
        "far": far,
    }
    judged = []
    for claim in TEXTS["claim"]:
        shown = getattr(evidence, claim["judge"])(results)
        printed, beginning = (claim[key].format(**words) for key in ("paper", "measured"))
        judged.append(Claim(printed, beginning + shown.measured, shown.verdict, shown.why))
    return judged
