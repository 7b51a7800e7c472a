"""A hand locks pins by a box and a lasso that crosses itself, by height, and in part: X events."""

from itertools import pairwise

import numpy as np

from tests.window.blender_window import up

PLAYED = {"script": "hand_locks.py", "size": (1300, 760), "by_hand": True}


def shares(seen, name):
    return np.array(seen[name]["shares"])


def is_far(seen, name, path):
    """Return which pins are seen farther from the lines of a path than the hand may be off, 3 pixels."""
    places, far = np.array(seen[name]["seen"]), True
    for start, end in pairwise(path):
        way = np.subtract(end, start)
        share = np.clip((places - start) @ way / (way @ way), 0.0, 1.0)
        far = far & (np.linalg.norm(places - start - share[:, None] * way, axis=1) > 3.0)
    return far


def test_a_box_locks_the_pins_that_are_seen_in_it(seen):
    (left, top), (right, bottom) = seen["box"]["path"]
    corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
    low, high = np.sort([(left, top), (right, bottom)], axis=0)
    places = np.array(seen["box"]["seen"])
    inside = ((places > low) & (places < high)).all(axis=1)
    far = is_far(seen, "box", corners)
    assert inside[far].sum() > 20
    np.testing.assert_array_equal(shares(seen, "box")[far], inside[far])


def test_a_lasso_that_crosses_itself_locks_both_loops_and_is_one_undo_step(seen):
    path = seen["lasso"]["path"]
    far, places = is_far(seen, "lasso", path), np.array(seen["lasso"]["seen"])
    turns = np.zeros(len(places))
    for start, end in pairwise(path):
        before, after = np.subtract(start, places), np.subtract(end, places)
        cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        turns += np.arctan2(cross, (before * after).sum(axis=1)) / (2.0 * np.pi)
    inside = turns.round().astype(int) % 2 == 1  # how often the path goes around a pin
    assert {-1, 1} <= set(turns.round().astype(int)[far])
    added = shares(seen, "lasso") - shares(seen, "box")
    far &= shares(seen, "box") == 0.0
    np.testing.assert_array_equal(added[far], inside[far])
    np.testing.assert_array_equal(shares(seen, "lasso undone"), shares(seen, "box"))


def test_a_box_locks_the_mirror_images_of_what_is_seen_in_it(seen):
    left, top, right, bottom = np.ravel(seen["box"]["path"])
    corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
    shape = up(seen, "mirrored box").shape
    low, high = np.sort([(left, top), (right, bottom)], axis=0)
    places = np.array(seen["mirrored box"]["seen"])
    inside = ((places > low) & (places < high)).all(axis=1)
    far = is_far(seen, "mirrored box", corners)
    mirrored, both = (each.reshape(shape)[:, ::-1].ravel() for each in (inside, far))
    far &= both
    assert (inside & ~mirrored)[far].sum() > 20
    np.testing.assert_array_equal(shares(seen, "mirrored box")[far], (inside | mirrored)[far])


def test_ctrl_unlocks_and_a_box_beside_the_bed_changes_nothing(seen):
    lost = shares(seen, "box") - shares(seen, "box with ctrl")
    assert set(lost) == {0.0, 1.0}
    assert 5 < lost.sum() < shares(seen, "box").sum()
    np.testing.assert_array_equal(shares(seen, "nothing inside"), shares(seen, "box with ctrl"))


def test_pins_above_a_height_are_locked_and_blurred_ones_in_part(seen):
    high = up(seen, "by height").ravel() >= 4.0
    assert high.sum() > 20
    before = shares(seen, "nothing inside") == 1.0
    np.testing.assert_array_equal(shares(seen, "by height") == 1.0, high | before)
    blurred = shares(seen, "blurred")
    assert ((blurred > 0.0) & (blurred < 1.0)).sum() > 40


def test_erasing_brings_pins_locked_in_part_back_by_the_rest_of_their_share(seen):
    blurred, before = shares(seen, "blurred"), up(seen, "blurred").ravel()
    after = up(seen, "erased").ravel()
    np.testing.assert_array_equal(after[blurred == 1.0], before[blurred == 1.0])
    partly = (blurred > 0.05) & (blurred < 1.0) & (before > 2.0)
    assert partly.sum() > 5
    # At the rim of the ring less is erased.
    assert (after[partly] > (blurred * before)[partly] - 0.01).all()
    assert (after[partly] < 0.9 * before[partly]).any()


def test_locked_pins_are_hatched_in_skin_and_pins_until_they_are_free(seen):
    assert not shares(seen, "cleared").any()
    for locked, free in (("skin", "skin_cleared"), ("pins_blurred", "pins_cleared")):
        white = sum(seen[f"white {locked}"]), sum(seen[f"white {free}"])
        assert white[0] > white[1] + 1000, (locked, white)


def test_locked_pins_of_several_beds_are_hatched_without_a_session_and_in_a_file_opened_again(seen):
    partly = shares(seen, "left in part")
    assert ((partly > 0.0) & (partly < 1.0)).sum() > 20
    # A skin is on the left, pins are on the right.
    for name in ("two", "opened"):
        assert min(seen[f"white {name}"]) > 300, (name, seen[f"white {name}"])
