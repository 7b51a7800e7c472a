"""Comparing methods: one input, a column each, and one line for each mistake."""

from __future__ import annotations

import json

import numpy as np
import pytest
from digiclay.cli import main
from digiclay.commands.compare import table
from digiclay.core.session.run_scene import RUN_METRICS
from digiclay.plots.sweep import PANELS, comparison

from tests.scene_files import scene_text

SCENE = scene_text(11, 11, (0.0, 0.041), (0.3, 0.035), (0.5, 0.035))
BOTH = ["virtual_master", "cell_states"]


pytestmark = pytest.mark.usefixtures("here")


def test_both_methods_are_printed_side_by_side_and_kept_with_a_picture_of_the_same_input(here, capsys):
    methods, setting = ["--methods", "cell_states,virtual_master"], ["--set", "control.force_setpoint=0.03"]
    assert main(["compare", "my.toml", *methods, *setting]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["metric", "unit", *BOTH[::-1]]
    printed = {line.split()[0]: line.split()[-2:] for line in lines[2 : 2 + len(RUN_METRICS)]}
    assert list(printed) == list(RUN_METRICS)
    assert [name for name, values in printed.items() if len(values) != 2] == []
    # The finger comes down 5 mm deep: Method I alone presses harder than fingers were measured.
    said = [line for line in lines if "the contact law does not hold" in line]
    assert [line.split(":")[0] for line in said] == ["virtual_master"]
    folder = here / "my_compare"
    assert sorted(path.name for path in folder.iterdir()) == ["compare.png", "metrics.json"]
    known = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))["methods"]
    assert list(known) == BOTH[::-1]
    assert list(known["cell_states"]) == list(RUN_METRICS)
    assert known["cell_states"]["duration"] == known["virtual_master"]["duration"] == 0.5
    # Other controllers, other forces: neither was run twice.
    assert known["cell_states"]["max_total_force"] != known["virtual_master"]["max_total_force"]
    # The setting reached both, and is asked of each cell that follows: of one at least, of all 121 at most.
    assert known["virtual_master"]["set_point"] == 0.03
    assert 0.03 <= known["cell_states"]["set_point"] < 121 * 0.03


def test_the_table_is_aligned_in_the_units_people_read_with_a_dash_for_what_was_not_found() -> None:
    found = {name: dict.fromkeys(RUN_METRICS, 12.345 * (i + 1)) for i, name in enumerate(BOTH)}
    assert len({len(line) for line in table(found)}) == 1
    rows = [line.split() for line in table({"one": dict.fromkeys(RUN_METRICS) | {"lag_max": 0.0025}})]
    assert ["lag_max", "mm", "2.5"] in rows
    assert ["rfd", "N", "–"] in rows


def test_every_panel_has_a_bar_for_every_method() -> None:
    found = {name: dict.fromkeys(RUN_METRICS, 1.0) for name in (*BOTH, "third")}
    forces = {name: ([0.0, 1.0], [0.0, 0.4], [np.nan, 0.4]) for name in found}
    figure = comparison(found, forces, "scene")
    panels = {axes.get_label(): axes for axes in figure.axes}
    assert {key: len(panels[key].patches) for key in PANELS} == dict.fromkeys(PANELS, 3)
    assert len(panels["force"].get_legend().get_texts()) == 4  # and the set points
