"""Benchmark ``hand``: the methods under fingertips on prescribed paths and on hands that give way."""

import argparse
import math
from itertools import product

from digiclay.core.model.yielding_hand import Hand
from digiclay.core.scene.scene_source import Setting, find, load

from digiclay_study.method_trials import place_trial

from .report import Report, Row, Steps, tabulate

#: Prescribed paths, and a hand of the default values.
HANDS = {"none": None, "default": Hand()}
TRAJECTORIES = ("session", "ridge-15", "surface", "valley", "lift")
METHODS = {"I": "virtual_master", "II": "cell_states", "III": "hybrid"}
#: Columns of the table.
COLUMNS = {
    "trajectory": "trajectory",
    "hand": "hand",
    **{f"RFD {name}, mN": f"{method}_N .1f 1e3" for name, method in METHODS.items()},
    **{f"losses {name}": f"{method}_losses .0f" for name, method in METHODS.items()},
    "least RFD first": "ranking",
}


def measure(arguments: argparse.Namespace, steps: Steps) -> list[Report]:
    """Measure the RFD of the methods, without noise, on each trajectory with each of `HANDS`."""
    rows: list[Row] = []
    cases = list(product(TRAJECTORIES[1:] if arguments.quick else TRAJECTORIES, HANDS))
    for trajectory, name in steps.through(cases, " ".join):
        row: dict[str, object] = {"trajectory": trajectory, "hand": name}
        rfd = {}
        for number, method in METHODS.items():
            scene = load(find("ridge_mound_valley"), [Setting("control.method", method)])
            placed, judge = place_trial(scene.with_sections(hand=HANDS[name]), trajectory)
            figures = (judge(placed, None) or {})["figures"]
            rfd[number] = math.inf if figures["rfd"] is None else figures["rfd"]
            row |= {f"{method}_N": figures["rfd"], f"{method}_losses": figures["losses"]}
        rows.append({**row, "ranking": ", ".join(sorted(rfd, key=lambda each: rfd[each]))})
    return [Report(tabulate(rows, COLUMNS, left=2), rows)]
