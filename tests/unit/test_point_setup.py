"""Set-up of thousands of points: what they have in common is done once, and changes nothing."""

from __future__ import annotations

import hashlib
import itertools
from dataclasses import fields

from digiclay.core.batch.packing import Findings, describe_structure
from digiclay.core.scene.assembly import assemble, count_rows, make_motion
from digiclay.core.scene.scene_source import Setting, find, list_samples, load
from digiclay.core.scene.toml_table import format_scene
from digiclay.core.studies.axes import Point, make_points, read_axis
from digiclay.core.studies.sweep_plan import NOTE, hash_points

#: What other sections depend on: the method has its blister, the contact of a hexagonal bed its share.
AXES = [
    "control.method=virtual_master,cell_states",
    "layout.arrangement=aligned,hexagonal",
    "valve.stroke=20 um,30 um",
    "delay.dead_time=5 ms,10 ms",
]
SHORT = [Setting("simulation.duration", "0.1")]


def make_points_of(axes: list[str]) -> list[Point]:
    """Return the points of a sweep of a sample."""
    return make_points(find("slow_press"), SHORT, [read_axis(axis) for axis in axes])


def test_a_point_is_the_scene_with_its_values_in_the_same_batch_whatever_is_known_of_others() -> None:
    keys = [axis.partition("=")[0] for axis in AXES]
    rows = itertools.product(*(axis.partition("=")[2].split(",") for axis in AXES))
    known = Findings()
    for point, words in zip(make_points_of(AXES), rows, strict=True):
        varied = [Setting(key, word) for key, word in zip(keys, words, strict=True)]
        scene = load(find("slow_press"), [*SHORT, *varied])
        assert point.scene == scene
        assert describe_structure(scene, known) == describe_structure(scene)
        system = assemble(scene)
        assert count_rows(scene, system.grid, make_motion(scene)) == system.rows


def test_the_number_of_points_is_that_of_their_scene_files() -> None:
    scenes = [load(find(name), SHORT) for name in list_samples()]
    made = [*make_points_of(AXES[:2]), *(Point(0, (), scene) for scene in scenes), Point(1, (), None, "no")]
    plain = hashlib.sha256()
    for point in made:
        plain.update((NOTE.sub("", format_scene(point.scene)) if point.scene else point.error).encode())
    assert hash_points(made) == plain.hexdigest()


def test_points_share_each_part_that_is_not_varied_also_a_duration_taken_from_the_path() -> None:
    made = make_points(find("slow_press"), [], [read_axis("control.force_gain=1:5:3")])
    first, *others = (point.scene for point in made)
    for other in others:
        names = [one.name for one in fields(first)]
        apart = {name for name in names if getattr(first, name) is not getattr(other, name)}
        assert apart - {"fingers"} == {"control"}  # the tuple of fingers is made anew, its parts are shared
