"""Scenes: defaults, presets, what goes together, and the way to text and back."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from typing import Any

import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.quantity import list_quantities
from digiclay.core.scene.schema import (
    NEEDS,
    OPTIONAL,
    PARTS,
    SECTIONS,
    UNASKED,
    Scene,
    Simulation,
    import_parameters,
)  # fmt: skip
from digiclay.core.scene.toml_table import PRESETS, format_scene, resolve


def section(name: str, **values: Any) -> Scene:
    """Return a scene in which one section says something."""
    return resolve({name: values})


def test_an_empty_file_is_a_whole_scene() -> None:
    scene = resolve({})
    assert (scene.layout.rows, scene.layout.pitch, scene.valve.orifice_diameter) == (25, 3e-3, 0.5e-3)
    assert tuple(name for name in SECTIONS if scene.section(name) is None) == UNASKED


def test_a_scene_without_a_path_presses_once_below_the_rest_height() -> None:
    scene = section("actuator", rest_height=0.03)
    lowest = min(point.position[2] for point in scene.section("trajectory").waypoints)
    assert 0.0 < lowest < 0.03


def test_quantities_may_be_written_with_a_unit_or_as_whole_numbers() -> None:
    relaxation = section("relaxation", times=["4 ms", 0.07, "1.4 s"]).section("relaxation")
    # The product of number and unit is rounded once.
    assert relaxation.times == pytest.approx((4e-3, 0.07, 1.4), rel=1e-15)
    assert isinstance(section("fluid", density=900).fluid.density, float)


@pytest.mark.parametrize("preset", ["fast", "viscous"])
def test_a_preset_changes_what_it_says_and_nothing_else(preset: str) -> None:
    asked: dict[str, Any] = {name: {} for name in UNASKED}
    changed, plain = resolve({"preset": preset, **asked}), resolve(asked)
    for name in PARTS:
        wanted = replace(plain.section(name), **PRESETS[preset].get(name, {}))
        assert changed.section(name) == wanted


def test_the_file_wins_over_the_preset() -> None:
    scene = resolve({"preset": "viscous", "fluid": {"viscosity": 1e-6}})
    assert (scene.fluid.viscosity, scene.fluid.density) == (1e-6, 908.0)


def test_a_hexagonal_bed_shares_the_force_among_more_cells_unless_the_file_says_so() -> None:
    bed = {"layout": {"arrangement": "hexagonal"}}
    assert resolve(bed).section("contact").share == 0.29
    assert resolve({**bed, "contact": {"share": 0.3}}).section("contact").share == 0.3


@pytest.mark.parametrize("name", OPTIONAL)
def test_an_optional_part_can_be_left_out(name: str) -> None:
    assert resolve({name: "absent"}).section(name) is None


@pytest.mark.parametrize(("name", "other"), NEEDS.items())
def test_a_part_leaves_together_with_the_one_it_needs(name: str, other: str) -> None:
    assert resolve({other: "absent"}).section(name) is None


def test_the_duration_is_the_trajectorys_unless_it_is_given() -> None:
    points = [{"time": 0, "position": [0, 0, 0.05]}, {"time": 0.7, "position": [0, 0, 0.05]}]
    assert resolve({"trajectory": {"waypoints": points}}).simulation.duration == 0.7


def test_a_session_has_as_many_periods_as_cover_its_duration() -> None:
    # 0.3 / 0.1 is a little more than 3 in binary: that is no fourth period.
    sizes = {"control_period": 0.1, "physics_step": 0.1}
    counts = [section("simulation", duration=d, **sizes).periods for d in (0.3, 0.31, 1e-3)]
    assert counts == [3, 4, 1]


def refused(table: dict[str, Any]) -> str:
    """Return what is said of a table that is no scene."""
    with pytest.raises(ParameterError) as caught:
        resolve(table)
    return str(caught.value)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "out of range": (
        {"valve": {"orifice_diameter": -0.0003}},
        "valve.orifice_diameter must be above 0 m (got -0.0003 m).",
    ),
    "out of range, with a unit": (
        {"valve": {"orifice_diameter": "-0.3 mm"}},
        "valve.orifice_diameter must be above 0 m (got '-0.3 mm').",
    ),
    "unknown key": (
        {"valve": {"orifice_diamater": 1}},
        "valve.orifice_diamater must be a known key (got 1). Did you mean valve.orifice_diameter?",
    ),
    "unknown key like no other": (
        {"fluid": {"xyz": 1}},
        "fluid.xyz must be a known key (got 1). Known here: density, viscosity.",
    ),
    "unknown section": ({"valv": {"a": 1}}, "valv must be a known key (got a section). Did you mean valve?"),
    "key that would break the line": (
        {"valve": {"a\nb": 1}},
        "valve.'a\\nb' must be a known key (got 1). "
        f"Known here: {', '.join(list_quantities(import_parameters('valve', '')))}.",
    ),
    "text for a number": (
        {"fluid": {"density": "thick"}},
        "fluid.density must be a number, or a text such as '3 kg/m3' (got 'thick').",
    ),
    "true for a number": ({"fluid": {"density": True}}, "fluid.density must be a number (got True)."),
    "fraction for a count": ({"layout": {"rows": 2.5}}, "layout.rows must be a whole number (got 2.5)."),
    "number for a list": (
        {"relaxation": {"times": 1.0}},
        "relaxation.times must be a list of numbers (got 1.0).",
    ),
    "number for a name": ({"name": 3}, "name must be a text (got 3)."),
    "not a number": (
        {"fluid": {"density": float("nan")}},
        "fluid.density must be a finite number (got nan kg/m3).",
    ),
    "infinite": (
        {"fluid": {"density": float("inf")}},
        "fluid.density must be a finite number (got inf kg/m3).",
    ),
    "unit of something else": (
        {"valve": {"stroke": "3 s"}},
        "valve.stroke must be in m or a multiple of it (got '3 s').",
    ),
    "unknown choice": (
        {"simulation": {"stepper": "leapfrog"}},
        "simulation.stepper must be one of bernoulli, richardson, adaptive, euler, heun, runge_kutta_4 "
        "(got 'leapfrog').",
    ),
    "unknown preset": ({"preset": "quick"}, "preset must be one of paper, fast, viscous (got 'quick')."),
    "unknown method": (
        {"control": {"method": "hand"}},
        "control.method must be one of virtual_master, cell_states, elastic, plastic, viscous, "
        "push_pull, force_display, shape_display, hybrid (got 'hand'). A method of your own must be "
        "loaded: by --method path/to/mine.py:Mine, in Blender by the preferences.",
    ),
    "blister wider than the bed": (
        {"blister": {"radius": 0.038, "edge_radius": 0.041}},
        "blister.radius must be at most half the bed's longer side, 0.0375 m (got 0.038 m).",
    ),
    "edge inside the blister": (
        {"blister": {"edge_radius": 0.014}},
        "blister.edge_radius must be above the radius, 0.015 m (got 0.014 m).",
    ),
    "no section": ({"layout": 3}, "layout must be a section, [layout] (got 3)."),
    "part that must be there": (
        {"valve": "absent"},
        "valve must be a section, [valve] (got 'absent').",
    ),
    "misspelt absent": (
        {"conduit": "absnt"},
        "conduit must be a section, [conduit], or \"absent\" (got 'absnt').",
    ),
    "no cells": ({"layout": {"rows": 0}}, "layout.rows must be at least 1 (got 0)."),
    "pitch below bore": (
        {"layout": {"pitch": 1e-3}},
        "layout.pitch must be at least actuator.bore, 0.002 m: cylinders would overlap (got 0.001 m).",
    ),
    "rest above stroke": (
        {"actuator": {"rest_height": 0.2}},
        "actuator.rest_height must be at most the stroke, 0.1 m (got 0.2 m).",
    ),
    "reservoirs the wrong way round": (
        {"supply": {"high": -1e5}},
        "supply.high must be above supply.low (got -100000 Pa, low -50000 Pa).",
    ),
    "endless steps": (
        {"simulation": {"physics_step": 1e-9}},
        "simulation.physics_step must be at least a 1000th of simulation.control_period, 0.005 s "
        "(got 1e-09 s).",
    ),
    "negative duration": (
        {"simulation": {"duration": -1}},
        "simulation.duration must be at least 0 s (got -1 s).",
    ),
    "no duration at all": (
        {"trajectory": {"waypoints": [{"time": 0, "position": [0, 0, 0.05]}]}},
        "simulation.duration must be above 0 s where the trajectory has no duration of its own (got 0 s).",
    ),
    "endless dead time": (
        {"delay": {"dead_time": 100}},
        "delay.dead_time must be at most 1000 control periods, 5 s (got 100 s).",
    ),
    "waypoint before the start": (
        {"trajectory": {"waypoints": [{"time": -1, "position": [0, 0, 0]}]}},
        "trajectory.waypoints #1.time must be at least 0 s (got -1 s).",
    ),
    "waypoint in two dimensions": (
        {"trajectory": {"waypoints": [{"time": 1, "position": [0, 0]}]}},
        "trajectory.waypoints #1.position must be a list of 3 numbers (got 2 of them).",
    ),
    "waypoint without a time": (
        {"trajectory": {"waypoints": [{"position": [0, 0, 0]}]}},
        "trajectory.waypoints #1.time must be given (got none).",
    ),
    "misspelt key of a waypoint": (
        {"trajectory": {"waypoints": [{"time": 0, "positon": [0, 0, 0]}]}},
        "trajectory.waypoints #1.positon must be a known key (got [0, 0, 0]). "
        "Did you mean trajectory.waypoints #1.position?",
    ),
    "waypoints in disorder": (
        {"trajectory": {"waypoints": [{"time": t, "position": [0, 0, 0]} for t in (0, 2, 1)]}},
        "trajectory.times must increase from waypoint to waypoint (got 1 s after 2 s at waypoint 3).",
    ),
    "orientation of length 0": (
        {"trajectory": {"waypoints": [{"time": 0, "position": [0, 0, 0], "orientation": [0, 0, 0, 0]}]}},
        "trajectory.orientations must have a length above 0 (got 0, 0, 0, 0).",
    ),
    "no waypoints": (
        {"trajectory": {"waypoints": []}},
        "trajectory.waypoints must have at least one waypoint (got none).",
    ),
    "unknown interpolation": (
        {"trajectory": {"interpolation": "cubic"}},
        "trajectory.interpolation must be one of smooth, linear (got 'cubic').",
    ),
}


@pytest.mark.parametrize(("table", "said"), WRONG.values(), ids=WRONG.keys())
def test_what_is_wrong_is_said_in_one_line(table: dict[str, Any], said: str) -> None:
    assert refused(table) == said


def test_a_long_value_is_shortened_to_fit_on_the_line() -> None:
    assert len(refused({"fluid": {"density": "x" * 10_000}})) < 200


SCENES: dict[str, dict[str, Any]] = {
    "default": {},
    "with nothing that can be left out": dict.fromkeys(OPTIONAL, "absent"),
    "of awkward numbers": {"valve": {"stroke": 0.1 + 0.2e-16}, "fluid": {"viscosity": 1 / 3 * 1e-5}},
    "of awkward texts": {"name": 'a "b" \\ é 漢', "description": "two\nlines\tand a tab"},
    "with a turning finger": {
        "trajectory": {
            "interpolation": "linear",
            "waypoints": [
                {"time": 0.1, "position": [0.1, -0.2, 1e-5], "orientation": [0.9, 0.1, 0.0, -0.3]},
                {"time": "300 ms", "position": ["3 mm", 0, "4 cm"]},
            ],
        }
    },
    "hexagonal and viscous": {"preset": "viscous", "layout": {"arrangement": "hexagonal", "rows": 3}},
}


@pytest.mark.parametrize("table", SCENES.values(), ids=SCENES.keys())
def test_a_scene_written_as_a_file_reads_back_as_an_equal_one(table: dict[str, Any]) -> None:
    scene = resolve(table, "some name")
    assert resolve(tomllib.loads(format_scene(scene))) == scene


def test_a_written_scene_names_every_parameter() -> None:
    scene = resolve({name: {} for name in UNASKED})
    tables = tomllib.loads(format_scene(scene))
    missing = [(name, key) for name in PARTS for key in vars(scene.section(name)) if key not in tables[name]]
    assert missing == []


@pytest.mark.parametrize(
    ("step", "count"), [(5e-3, 1), (1e-2, 1), (1e-3, 5), (2e-3, 3), (4.9e-3, 2), (5e-6, 1000)]
)
def test_a_period_has_as_few_equal_steps_as_its_longest_allows(step: float, count: int) -> None:
    assert Simulation(control_period=5e-3, physics_step=step).steps == count


def test_a_period_of_many_longest_steps_does_not_gain_one_by_rounding() -> None:
    # 0.3 / 0.1 is 2.9999999999999996 and 0.7 / 0.1 is 6.999999999999999; 0.6 / 0.2 is 2.9999999999999996.
    assert [Simulation(control_period=n * 0.1, physics_step=0.1).steps for n in range(1, 11)] == list(
        range(1, 11)
    )
