"""Hand that an armature closes in the pins: what it leaves is the lowest that Blender's rays find."""

import bpy
import digiclay
import numpy as np
import pytest
from digiclay.recorded.bake import read_moments
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from tools.closing_hand import KEYS, make_scene

UP = Vector((0.0, 0.0, 1.0))
#: A pin in so many is looked at; heights of pins at rest, m, and Blender units per m.
EVERY, REST, SCALE = 7, 40e-3, 10.0


@pytest.fixture
def closed():
    """Return scene, bed and hand."""
    digiclay.register()
    yield make_scene()
    digiclay.unregister()


def find_lowest(scene, hand, places):
    """Return the lowest undersides over places, (m, 2), m, in all frames, by rays from below."""
    lowest = np.full(len(places), np.inf)
    for frame in range(1, scene.frame_end):
        scene.frame_set(frame)
        tree = BVHTree.FromObject(hand, bpy.context.evaluated_depsgraph_get())
        into = hand.matrix_world.inverted()
        turn = into.to_3x3()
        for number, (x, y) in enumerate(places * SCALE):
            hit = tree.ray_cast(into @ Vector((x, y, -5.0)), turn @ UP)[0]
            if hit is not None:
                lowest[number] = min(lowest[number], (hand.matrix_world @ hit).z / SCALE)
    return lowest


def test_clay_keeps_the_lowest_that_a_closing_hand_reaches(closed):
    scene, bed, hand = closed
    position, heights = read_moments(bed)
    some = slice(None, None, EVERY)
    height, lowest = heights[-1][some], find_lowest(scene, hand, position[some])
    pressed = lowest < REST
    assert pressed.sum() > 350
    # The spring of the contact gives, and between frames the hand is lower than in them.
    off = np.abs(height - lowest)
    assert np.corrcoef(height[pressed], lowest[pressed])[0, 1] > 0.999
    assert np.sqrt(np.mean(off[pressed] ** 2)) < 0.15e-3
    assert off[pressed].max() < 0.6e-3
    assert height[lowest > REST + 1e-3] == pytest.approx(REST, abs=1e-8)  # Blender's 32 bits
    # The open hand left its print; fingers that close dig into it, as deep as that was.
    opened, closing = heights[KEYS[2][0] - 1], heights[KEYS[3][0] - 1]
    assert [opened.min(), closing.min()] == pytest.approx([22e-3] * 2, abs=1e-3)
    assert np.count_nonzero(opened - closing > 2e-3) > 100
