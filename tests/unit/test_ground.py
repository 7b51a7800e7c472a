"""Blister that rises from each cell's own height: what is formed already is not cut."""

import tomllib

import numpy as np
import pytest
from digiclay.core.base.modes import Mode
from digiclay.core.control.blister import Blister
from digiclay.core.control.ground import GROUNDS
from digiclay.core.control.travel import Heading, update_heading
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.model.layout import Layout, make_grid
from digiclay.core.scene.toml_table import format_scene, resolve

from tests.assemble import make_system, master, table
from tests.measured import measure

BED = make_grid(Layout(15, 15))
EAST = (1.0, 0.0)
#: A ridge along y that the blister is above, of 4 mm.
RIDGE = np.where(np.abs(BED.x) < 4e-3, 44e-3, 40e-3)


def seen(target, mode, own=0.0):
    """Return a measurement of a whole bed at its commanded heights that nobody touches."""
    measured = measure(BED.x, BED.y, height=target, mode=mode, rows=1)
    measured.own[0] = own
    return measured


def command(memory, measured, ground="cell"):
    system = make_system(Layout(15, 15), control=VirtualMaster(ground=ground))
    return system.controller.command(memory, measured)[1]


def at(x, y):
    return int(np.hypot(BED.x - x * 1e-3, BED.y - y * 1e-3).argmin())


#: Share of the way to the top 12 mm from the middle.
SHARE = Blister().evaluate_profile(np.array([12e-3]))[0]
RISEN = seen(np.full(BED.count, 47e-3), Mode.BLISTER, own=40e-3)


@table(
    "measured, place, height",
    {
        "at the rim it stays where it is formed": (seen(RIDGE, Mode.HOLD), (0, 15), 44e-3),
        "also beside the ridge": (seen(RIDGE, Mode.HOLD), (15, 0), 40e-3),
        "its share of the way": (seen(RIDGE, Mode.HOLD), (0, 12), 44e-3 + SHARE * 6e-3),
        "beside the ridge likewise": (seen(RIDGE, Mode.HOLD), (12, 0), 40e-3 + SHARE * 10e-3),
        "from where it was when the blister came": (RISEN, (12, 0), 40e-3 + SHARE * 10e-3),
    },
)
def test_a_cell_rises_from_its_own_ground(measured, place, height):
    assert command(master(height=50e-3), measured).target[at(*place)] == pytest.approx(
        height, abs=1e-9
    )
    # The paper's ground cuts a ridge at the rim.
    assert command(master(height=50e-3), seen(RIDGE, Mode.HOLD), "edge").target[at(0, 15)] < 42e-3


def test_a_cell_takes_its_commanded_height_for_its_ground_and_what_was_raised_stays():
    for mode in (Mode.REST, Mode.HOLD, Mode.EDGE):
        measured = seen(RIDGE, mode, own=90e-3)
        command(master(height=50e-3), measured)
        np.testing.assert_array_equal(measured.own[0], RIDGE)
    # It comes up out of a valley of 4 mm, whose bottom it has raised to its top.
    ground, level = 40e-3 - np.where(BED.x < 0.0, 4e-3, 0.0), np.full(BED.count, 39.3e-3)
    found = command(
        master(*EAST, height=39.3e-3), touch(seen(level, Mode.BLISTER, own=ground), 1.5, 4.5)
    )
    assert found.target[[at(x, 0) for x in (-3, 0, 3)]] == pytest.approx(39.3e-3, abs=1e-5)


@pytest.mark.parametrize(
    "target, ground, top, kept",
    [
        (44e-3, 40e-3, 46e-3, True),  # raised farther than the blister raises it there
        (41e-3, 40e-3, 46e-3, False),  # a higher blister takes it along
        (48e-3, 44e-3, 42e-3, True),  # raised on a ridge beside which the blister sinks
        (38e-3, 40e-3, 46e-3, False),  # a dent under a blister that rises
        (38e-3, 40e-3, 39e-3, True),  # a valley behind a blister in a flatter one
        (39.9e-3, 40e-3, 30e-3, False),  # a deeper blister takes it along
    ],
)
def test_what_is_left_behind_a_blister_that_travels(target, ground, top, kept):
    behind = seen(np.full(BED.count, target), Mode.FROZEN, own=ground)
    found = command(master(*EAST, height=top), behind).target[at(-12, 0)]
    assert (found == target) == kept


@pytest.mark.parametrize("ground", GROUNDS)
def test_a_scene_is_read_with_its_ground_and_the_papers_as_older_versions_read_it(ground):
    scene = resolve({"control": {"ground": ground}})
    assert ("ground" in format_scene(scene)) == (ground != "edge")
    assert resolve(tomllib.loads(format_scene(scene))) == scene


#: A slope that rises to the east by 1 mm a millimeter, within the stroke.
SLOPE = 40e-3 + BED.x


def touch(measured, x, about=3.0):
    """Return the measurement with forces in three cells on the x axis, mm: their grounds differ."""
    measured.force[[at(x - about, 0.0), at(x, 0.0), at(x + about, 0.0)]] = 0.05, 0.3, 0.05
    return measured


def pressed(x, top, mode=Mode.BLISTER, ground=SLOPE):
    """Return the commands to a blister that the finger touches at x, mm."""
    return command(master(*EAST, height=top), touch(seen(ground, mode, own=ground), x))


def test_a_blister_that_sinks_into_a_slope_raises_no_cell_and_one_that_rises_is_level():
    measured = seen(SLOPE, Mode.BLISTER, own=SLOPE)
    measured.force[at(0.0, 0.0)] = 0.4
    change = command(master(height=36e-3), measured).target - SLOPE
    # Cells that it does not touch count with a nanonewton: a hundredth of a millimeter.
    assert change.max() <= 1e-5
    # Below the finger by 4 mm.
    assert change.min() == pytest.approx(-4e-3, abs=1e-5)
    target = pressed(0.0, 44e-3).target
    assert target[[at(3, 0), at(-3, 0)]] == pytest.approx(44e-3, abs=1e-9)


#: By so little even ground rises: 0.03 mm a millimeter.
EVEN = 40e-3 + 0.03 * BED.x


@table(
    "ground, top, left, ahead",
    {
        "sinks into a slope": (SLOPE, 36e-3, Mode.FROZEN, Mode.BLISTER),
        "rises": (SLOPE, 45e-3, Mode.BLISTER, Mode.FROZEN),
        "sinks into even ground": (EVEN, 36e-3, Mode.BLISTER, Mode.FROZEN),
    },
)
def test_on_uneven_ground_that_a_blister_sinks_into_cells_freeze_sooner_and_are_freed_ahead(
    ground, top, left, ahead
):
    assert pressed(3.0, top, ground=ground).mode[at(-3, 0)] == left
    assert pressed(0.0, top, Mode.FROZEN, ground).mode[at(6, 0)] == ahead


@table(
    "change, x, height, touched, cells",
    {
        # Those far behind, where the slope is below the top, and the one 1 mm behind, within what
        # freezes.
        "pressed by one that climbs": (-3e-3, 1e-3, 38e-3, 6.0, (-9.0, -6.0, 0.0)),
        "raised, and ahead again": (3e-3, 0.0, 36e-3, 0.0, (6.0,)),
    },
)
def test_what_a_blister_has_formed_on_a_slope_stays_frozen(change, x, height, touched, cells):
    measured = touch(seen(SLOPE + change, Mode.FROZEN, own=SLOPE), touched)
    found, there = command(master(*EAST, x=x, height=height), measured), [at(x, 0) for x in cells]
    assert set(found.mode[there]) == {Mode.FROZEN}
    np.testing.assert_array_equal(found.target[there], SLOPE[there] + change)


def test_on_its_own_ground_a_centroid_that_moves_back_by_little_does_not_reverse_the_direction():
    east = Heading(0.0, 0.0, 1.0, 0.0)
    back = [
        update_heading(east, -way, 0.0, 1.5e-3, 6e-3).toward_x for way in (2e-3, 5.9e-3, 6.1e-3)
    ]
    assert back == [1.0, 1.0, -1.0]
    # A way to the side is a new one, also when it leads back a little: 60 degrees off the way back
    # at least.
    assert update_heading(east, 0.0, 2e-3, 1.5e-3, 6e-3).toward_y == 1.0
    assert update_heading(east, -0.9e-3, 2e-3, 1.5e-3, 6e-3).toward_y > 0.9
    assert update_heading(east, -1.3e-3, 2e-3, 1.5e-3, 6e-3) == east
    # One that rests has no other direction, however short the travel.
    assert update_heading(east, 0.0, 0.0, 1e-12) == east
    for ground, reversal in (("cell", 6e-3), ("edge", 1.5e-3)):
        assert make_system(control=VirtualMaster(ground=ground)).controller.reversal == reversal
