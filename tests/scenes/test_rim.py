"""Under a fingertip that slides off the bed no pin rises; one that is lifted at the rim is followed."""

import math
from functools import cache

import numpy as np
import pytest
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.model.layout import Layout
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.toml_table import resolve
from digiclay.settings.devices import BEDS, make_scene

from tests.assemble import path, table

REST, DEPTH, PRESSED = 40.0, 3.0, 0.6
#: How much higher than before a pin may get, mm; Method II raises flanks of 1.7 mm on a whole bed, too.
MOST = {"virtual_master": 0.2, "hybrid": 0.2, "cell_states": 1.9}
#: From where to where a fingertip leaves a bed of half length h, mm.
WAYS = {
    "straight": lambda h: ((h - 12, 0), (h + 20, 0)),
    "over a corner": lambda h: ((h - 12, h - 12), (h + 12, h + 12)),
    "slanting": lambda h: ((h - 12, 0), (h + 20, 16)),
    "nearly along the rim": lambda h: ((h - 6, -20), (h + 12, 20)),
}
IMAGES = {
    "as it is": ((1, 0), (0, 1)),
    "turned": ((0, -1), (1, 0)),
    "turned about": ((-1, 0), (0, -1)),
    "turned again": ((0, 1), (-1, 0)),
    "mirrored": ((1, 0), (0, -1)),
}


@cache
def add(name, method):
    bed = BEDS[name]
    return make_scene("paper", Layout(bed.rows, bed.columns, bed.pitch), method, bed.share)


def half(scene):
    """Return how far the outer cells are from the middle of a bed, mm."""
    return 0.5e3 * (scene.layout.columns - 1) * scene.layout.pitch


def rise(scene, start, end, lifted=-DEPTH):
    """Return how far any pin gets above rest, mm, after a press at a place, mm; then the finger goes on.

    It is lifted to a height, mm, and goes to another place at 10 mm/s.
    """
    lift = PRESSED + (lifted + DEPTH) / 6.0
    off = lift + math.dist(start, end) / 10.0
    points = [(0.0, *start, REST + 1), (0.3, *start, REST - DEPTH), (PRESSED, *start, REST - DEPTH)]
    points += [(lift, *start, REST + lifted)] if lift > PRESSED else []
    points += [(off, *end, REST + lifted)] if off > lift else []
    system = assemble(scene)
    states = periods(
        system, [path(*points, interpolation="linear")], begin(system), round((off + 0.3) / 5e-3)
    )
    tops = [state.row(0).max() for state in states if state.period * system.period > PRESSED]
    return float(1e3 * max(tops)) - REST


def device(method, **tables):
    """Return the paper's device with some other tables."""
    return resolve({"control": {"method": method}, **tables})


#: Scene, way, and its image, off each side and over a corner.
OFF = {
    "off the left": (add("paper", "virtual_master"), "straight", "turned about"),
    "along the lower rim": (add("paper", "virtual_master"), "nearly along the rim", "turned"),
    "Method III, a corner": (add("paper", "hybrid"), "over a corner", "mirrored"),
    "Method III": (add("paper", "hybrid"), "slanting", "turned again"),
    "fine": (add("fine", "virtual_master"), "straight", "as it is"),
    "of cells": (add("paper", "cell_states"), "nearly along the rim", "turned"),
    "design, Method III": (add("design", "hybrid"), "straight", "as it is"),
    "fine, Method III": (add("fine", "hybrid"), "slanting", "as it is"),
    "hexagonal": (device("hybrid", layout={"arrangement": "hexagonal"}), "slanting", "as it is"),
    "staggered": (
        device("virtual_master", layout={"arrangement": "staggered"}),
        "slanting",
        "as it is",
    ),
    "narrow": (device("virtual_master", layout={"rows": 9}), "slanting", "as it is"),
    "with noise": (device("hybrid", sensors={"force_noise": 5e-3}), "slanting", "as it is"),
    "fast": (device("hybrid", preset="fast"), "slanting", "as it is"),
}


@table("scene, way, image", OFF)
def test_a_finger_that_slides_off_raises_no_pin(scene, way, image):
    # 8 to 36 mm with Method I, up to 3 with Method III without a rim.
    off = np.dot(WAYS[way](half(scene)), np.transpose(IMAGES[image])).tolist()
    assert rise(scene, *off) <= MOST[scene.method]


@pytest.mark.parametrize("method, bed", [("virtual_master", "design"), ("hybrid", "paper")])
def test_a_raised_ridge_ends_at_the_rim_as_high_as_it_is(method, bed):
    # 19 mm on the paper's bed and 43 on design with Method I without a rim.
    scene = add(bed, method)
    start, end = WAYS["slanting"](half(scene))
    inside = rise(scene, (0, 0), (12, 6), lifted=8.0)
    assert rise(scene, start, end, lifted=8.0) <= inside + 2 * MOST[method]


@pytest.mark.parametrize(
    "method, beside",
    [("virtual_master", 0.5), ("cell_states", 0.0), ("hybrid", -1.0), ("hybrid", 0.5)],
)
def test_a_finger_lifted_over_the_outer_cells_raises_them(method, beside):
    scene = add("paper", method)
    place = half(scene) + beside * 3.0, 0.0
    assert rise(scene, place, place, lifted=8.0) > 8.0


def deviation(method, beyond, image, outside=0.0):
    """Return the rms deviation of the force from its set point, N, along the rim, lifted 8 mm, at 12 mm/s.

    The lowest point is so far beyond the last row, mm; judged from the lift on, also without
    contact. The finger is pressed there, or farther `outside`, mm, from where it comes in.
    """
    scene = add("paper", method)
    out, lift = half(scene) + beyond, 0.8 + outside / 12.0
    ways = [(0.0, outside, -8, 42), (0.5, outside, -8, 35.5)]
    ways += [(lift - 0.3, 0.0, -8, 35.5)] if outside else []
    ways += [(lift, 0.0, -8, 35.5), (lift + 1.6, 0.0, -8, 44), (lift + 1.8, 0.0, -8, 44)]
    ways += [(lift + 3.1, 0.0, 7.6, 44)]
    points = [(time, *np.dot(IMAGES[image], (out + far, along)), z) for time, far, along, z in ways]
    system = assemble(scene)
    last = round((lift + 3.1) / 5e-3)
    states = periods(system, [path(*points, interpolation="linear")], begin(system), last)
    forces = np.array([state.row(system.rows.force).sum() for state in states])
    return float(np.sqrt(np.mean((forces[round(lift / 5e-3) :] - 0.4) ** 2)))


@pytest.mark.parametrize(
    "beyond, image, most",
    [(0.0, "turned", 0.03), (3.0, "turned again", 0.09)],
)
def test_along_the_rim_method_three_is_no_worse_than_method_one(beyond, image, most):
    # It was lost from 1 mm on, at 0.3 to 0.4 N.
    three = deviation("hybrid", beyond, image)
    assert three <= 1.1 * deviation("virtual_master", beyond, image)
    assert three <= most


@pytest.mark.parametrize(
    "beyond, image, most",
    [(1.5, "mirrored", 1.5), (0.0, "turned", 0.7)],
)
def test_pressed_in_from_outside_method_three_is_as_much_worse_as_the_page_says(
    beyond, image, most
):
    one, three = (
        deviation(method, beyond, image, 20.0 - beyond) for method in ("virtual_master", "hybrid")
    )
    assert three <= most * one
    assert max(one, three) < 0.2  # neither is lost
