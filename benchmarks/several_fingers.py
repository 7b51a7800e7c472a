"""Benchmark ``fingers``: what several fingertips cost, and how near two of them may come to each other."""

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
from digiclay.core.metrics.summary import compute_metrics, split_fingers
from digiclay.core.model.trajectory import Path, Waypoint
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.schema import Scene
from digiclay.core.session.run_scene import run, select_rows

from .report import Report, Row, Steps, tabulate, time_by_turns
from .session_parts import simulate

#: Numbers of fingers, and where ten of them press, mm: two hands.
COUNTS = (1, 2, 5, 10)
PLACES = [(x, y) for y in (-18.0, 18.0) for x in (0.0, 15.0, -15.0, 30.0, -30.0)]
METHODS = ("", "virtual_master", "cell_states", "hybrid")
#: Speed of all drags and rises, mm/s; height of a lifted, a sunk and a pressing fingertip, mm: one
#: that is 2 mm higher Method II does not follow.
DRAG, RISE, UP, DOWN, PRESSED = 10.0, 6.0, 46.0, 32.0, 36.5
#: All cases are turned and shifted, rad and m: along the rows of pins symmetry would hide faults.
TURN, SHIFT = 0.3, (0.7e-3, -0.4e-3)
#: From when on the force is judged, s: then all fingertips have touched down.
JUDGED = 1.0

Way = list[tuple[float, float, float, float]]


def land(x: float, y: float) -> Way:
    """Return the beginning of a way (time, x, y, z), s and mm: press, and stay until 1.2 s."""
    return [(0.0, x, y, 43.0), (0.5, x, y, PRESSED), (1.2, x, y, PRESSED)]


def press_and_drag(
    x: float, y: float, to_x: float, to_y: float, height: float = UP, wait: float = 0.0
) -> Way:
    """Return a way (time, x, y, z), s and mm: press, go to a height, wait, drag."""
    there = 1.2 + abs(height - PRESSED) / RISE
    start = max(there, 1.2 + (UP - PRESSED) / RISE) + wait
    end = start + float(np.hypot(to_x - x, to_y - y)) / DRAG
    return [*land(x, y), (there, x, y, height), (start, x, y, height), (end, to_x, to_y, height)]


def meet(apart: float, far: float, lifted: float) -> Iterator[Way]:
    """Give the ways of two fingertips that come within `apart`, mm, lifted to a height before or after."""
    for side in (-1.0, 1.0):
        way = land(side * far, 0.0)
        height = lifted if far > 15.0 else PRESSED
        gone, near = 1.2 + (height - PRESSED) / RISE, side * apart / 2
        there = gone + (far - apart / 2) / DRAG
        way += [(gone, side * far, 0.0, height), (there, near, 0.0, height)]
        end = (side * far, lifted) if far > 15.0 else (near, lifted)
        yield [*way, (there + 0.5 + (far if far > 15.0 else 8.0) / DRAG * 1.6, end[0], 0.0, end[1])]


#: Two fingertips near each other: their ways by name, with the least distance, mm.
CASES: dict[str, list[Way]] = {
    **{
        f"{name}, {d}": [
            press_and_drag(-20, -d / 2, 20, -d / 2), press_and_drag(-20, d / 2, 20, d / 2, height)
        ]
        for name, height in (("parallel", UP), ("up beside down", DOWN)) for d in (25, 18, 15, 12)
    },
    **{
        f"sinks beside a drag, {d}": [
            [*land(0, 0), (1.9, 0, 5, PRESSED - 1), (5.0, 0, 5, PRESSED - 1)],
            [*land(-5, 18), (1.9, -5, 18, PRESSED), (3.4, *at), (5.0, *at)],
        ]
        for d, at in ((d, (-0.8 * d, 5 + 0.6 * d, DOWN - 1)) for d in (15, 12, 10))
    },
    **{f"approach and part, {d}": list(meet(d, 20.0, 47.0)) for d in (12, 9, 6)},
    **{
        f"lands over the rim beside one, {d}": [
            [*land(0, 62 - d), (3.0, 0, 62 - d, PRESSED)],
            [(0.0, 3, 62, 43.0), (0.5, 3, 62, 43.0), (1.0, 3, 62, PRESSED), (3.0, 3, 62, PRESSED)],
        ]
        for d in (12, 11)
    },
    **{f"pinch, pull up, {d}": list(meet(d, 14.0, UP)) for d in (20, 16, 12)},
    **{
        f"crossing, {d}": [
            press_and_drag(-25, 0, 25, 0), press_and_drag(0, -25, 0, 25, wait=2**0.5 * d / DRAG)
        ]
        for d in (16, 11)
    },
}  # fmt: skip


def make_scene(method: str, ways: list[Way], size: int = 40, turn: float = TURN) -> Scene:
    """Return the paper's bed, of size x size pins, with a method and fingertips on their ways, turned, rad.

    They go straight between the points of their ways; all of it lasts as long as the longest one.
    """
    control = Setting("control.method", method) if method else Setting("control", "absent")
    sides = [Setting(f"layout.{side}", str(size)) for side in ("rows", "columns")]
    scene = load(find("ridge_mound_valley"), [control, *sides])
    half = math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)

    def lay(time: float, x: float, y: float, z: float) -> Waypoint:
        x, y = x * 1e-3 + SHIFT[0], y * 1e-3 + SHIFT[1]
        turned = x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn)
        return Waypoint(time=time, position=(*turned, 1e-3 * z), orientation=half)

    # Of points at one time the last.
    paths = [
        Path("linear", tuple(lay(*p) for p in {round(p[0], 9): p for p in way}.values()))
        for way in ways
    ]
    return replace(
        scene,
        simulation=replace(scene.simulation, duration=max(way[-1][0] for way in ways)),
        fingers=tuple(replace(scene.fingers[0], trajectory=path) for path in paths),
    )


def feel(scene: Scene) -> list[Row]:
    """Return the metrics of each fingertip of a scene, from when on all have touched down."""
    judged = select_rows(run(scene).history, JUDGED, math.inf)
    return [compute_metrics(finger, scene.set_point) for finger in split_fingers(judged)]


def measure_near(method: str, name: str, turn: float = TURN) -> tuple[list[Row], list[Row]]:
    """Return the metrics of the two fingertips of a case, turned, together and each alone."""
    both = make_scene(method, CASES[name], turn=turn)
    return feel(both), [feel(replace(both, fingers=(finger,)))[0] for finger in both.fingers]


def measure_cost(method: str, count: int, repeats: int) -> list[float]:
    """Return the processor time per period of `COUNTS` fingers, s: medians of `repeats` runs, in turns."""
    works = []
    for fingers in COUNTS:
        depth = PRESSED if method else 39.0
        ways = [
            [(0.0, x, y, 41.0), (0.3, x, y, depth), (1.0, x, y, depth), (3.0, x + 10, y + 3, depth)]
            for x, y in PLACES[:fingers]
        ]
        scene = make_scene(method, ways, 25)
        works.append(partial(simulate, assemble(scene), scene, count))
    return [spent / count for spent in time_by_turns(works, repeats)]


#: Columns of the tables.
COST = {
    "method": "method",
    "one, µs": "one_s .0f 1e6",
    **{f"{count} fingers, times": f"times_{count} .1f" for count in COUNTS[1:]},
}
NEAR = {
    "two fingertips, mm apart": "case",
    "method": "method",
    "RFD alone, mN": "alone_N .0f 1e3",
    "other": "alone_other_N .0f 1e3",
    "together, mN": "together_N .0f 1e3",
    "other's": "together_other_N .0f 1e3",
    "largest force, N": "force_N .2f",
    "in contact, of alone, %": "contact .0f 100",
}


def measure(arguments: argparse.Namespace, steps: Steps) -> list[Report]:
    """Measure what a period costs, and how two fingertips disturb each other."""
    count, repeats = (200, 3) if arguments.quick else (400, 7)
    cases = list(CASES)[:: 4 if arguments.quick else 1]
    steps.total = len(METHODS) + len(cases)
    costs: list[Row] = []
    near: list[Row] = []
    for method in METHODS:
        spent = dict(zip(COUNTS, measure_cost(method, count, repeats), strict=True))
        ratios = {f"times_{fingers}": spent[fingers] / spent[1] for fingers in COUNTS[1:]}
        costs.append({"method": method or "no control", "one_s": spent[1], **ratios})
        steps(method or "no control")
    for name in cases:
        for method in METHODS[1:]:
            together, alone = measure_near(method, name)
            names = "together_N", "together_other_N", "alone_N", "alone_other_N"
            rfd = dict(zip(names, (metrics["rfd"] for metrics in together + alone), strict=True))
            largest = max(metrics["max_total_force"] or 0.0 for metrics in together)
            # The RFD leaves out the time without contact: one that is lost has a small one.
            both = zip(together, alone, strict=True)
            contact = min(
                (metrics["contact_share"] or 0.0) / (reference["contact_share"] or 1.0)
                for metrics, reference in both
            )
            near.append(
                {"case": name, "method": method, **rfd, "force_N": largest, "contact": contact}
            )
        steps(name)
    return [
        Report(tabulate(costs, COST), costs, name="fingers_cost"),
        Report(tabulate(near, NEAR), near, name="fingers"),
    ]
