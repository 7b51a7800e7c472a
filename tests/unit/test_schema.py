"""Scenes: defaults, presets, what goes together, text and back; files found, read, overridden, refused."""

import tomllib
from dataclasses import replace

import pytest
from digiclay.core.base.errors import LONGEST, ParameterError, SceneError, one_line
from digiclay.core.scene.scene_source import SAMPLES, Setting, find, list_samples, load
from digiclay.core.scene.schema import (
    NEEDS,
    OPTIONAL,
    PARTS,
    SECTIONS,
    UNASKED,
    Simulation,
)
from digiclay.core.scene.toml_table import PRESETS, format_scene, resolve

from tests.assemble import table


def test_an_empty_file_is_a_whole_scene_that_presses_once_and_a_written_one_names_everything():
    scene = resolve({})
    assert (scene.layout.rows, scene.layout.pitch, scene.valve.orifice_diameter) == (
        25,
        3e-3,
        0.5e-3,
    )
    assert tuple(name for name in SECTIONS if scene.section(name) is None) == UNASKED
    scene = resolve({"actuator": {"rest_height": 0.03}})
    assert 0.0 < min(point.position[2] for point in scene.section("trajectory").waypoints) < 0.03
    points = [{"time": 0, "position": [0, 0, 0.05]}, {"time": 0.7, "position": [0, 0, 0.05]}]
    assert resolve({"trajectory": {"waypoints": points}}).simulation.duration == 0.7
    scene = resolve({name: {} for name in UNASKED})
    tables = tomllib.loads(format_scene(scene))
    missing = [
        (name, key)
        for name in PARTS
        for key in vars(scene.section(name)).keys() - scene.section(name).list_idle()
        if key not in tables[name]
    ]
    assert missing == []


def test_quantities_may_have_a_unit_and_a_cell_has_the_share_of_its_area():
    scene = resolve({"relaxation": {"times": ["4 ms", 0.07, "1.4 s"]}, "fluid": {"density": 900}})
    # The product of number and unit is rounded once.
    assert scene.section("relaxation").times == pytest.approx((4e-3, 0.07, 1.4), rel=1e-15)
    assert isinstance(scene.fluid.density, float)
    for pitch, arrangement, share in (
        (3e-3, "aligned", 0.34),
        (3e-3, "staggered", 0.34),
        (3e-3, "hexagonal", 0.294449),
        (4e-3, "aligned", 0.604444),
        (2e-3, "hexagonal", 0.130866),
    ):
        bed = {"layout": {"pitch": pitch, "arrangement": arrangement}}
        assert resolve(bed).section("contact").share == share
        assert resolve({**bed, "contact": {"share": 0.3}}).section("contact").share == 0.3


@pytest.mark.parametrize("preset", ["fast", "viscous"])
def test_a_preset_changes_what_it_says_unless_the_file_does_and_nothing_else(preset):
    asked = {name: {} for name in UNASKED}
    changed, plain = resolve({"preset": preset, **asked}), resolve(asked)
    for name in PARTS:
        wanted = replace(plain.section(name), **PRESETS[preset].get(name, {}))
        assert changed.section(name) == wanted
    scene = resolve({"preset": "viscous", "fluid": {"viscosity": 1e-6}})
    assert (scene.fluid.viscosity, scene.fluid.density) == (1e-6, 908.0)


@pytest.mark.parametrize(
    "name, other", [*zip(OPTIONAL, OPTIONAL, strict=True), *NEEDS.items()], ids=lambda name: name
)
def test_an_optional_part_can_be_left_out_and_what_needs_it_leaves_with_it(name, other):
    assert resolve({other: "absent"}).section(name) is None


def test_periods_cover_the_duration_and_steps_the_period_without_one_more_by_rounding():
    # 0.3 / 0.1 is a little more than 3 in binary: that is no fourth period.
    sizes = {"control_period": 0.1, "physics_step": 0.1}
    lasting = [resolve({"simulation": {"duration": d, **sizes}}) for d in (0.3, 0.31, 1e-3)]
    counts = [scene.periods for scene in lasting]
    assert counts == [3, 4, 1]
    # 0.3 / 0.1 is 2.9999999999999996 and 0.7 / 0.1 is 6.999999999999999; 0.6 / 0.2 is
    # 2.9999999999999996.
    assert [Simulation(n * 0.1, 0.1).steps for n in range(1, 11)] == list(range(1, 11))
    longest = (5e-3, 1e-2, 1e-3, 2e-3, 4.9e-3, 5e-6)
    steps = [Simulation(control_period=5e-3, physics_step=size).steps for size in longest]
    assert steps == [1, 1, 5, 3, 2, 1000]


def refused(table):
    with pytest.raises(ParameterError) as caught:
        resolve(table)
    return str(caught.value)


POINT = {"time": 0, "position": [0, 0, 0]}
#: Sections, and how the only line about them begins.
WRONG = [
    ({"valve": {"orifice_diameter": "-0.3 mm"}}, "valve.orifice_diameter must be above 0 m (got '-0.3 mm')."),
    (
        {"control": {"method": "hybrid", "force_gain": 1}},
        "control.force_gain must be a parameter of hybrid (got 1). It is one of virtual_master, cell_states.",
    ),
    ({"valve": {"orifice_diamater": 1}}, "valve.orifice_diamater must be a known key (got 1). Did you mean"),
    ({"fluid": {"xyz": 1}}, "fluid.xyz must be a known key (got 1). Known here: density, viscosity."),
    ({"valv": {"a": 1}}, "valv must be a known key (got a section). Did you mean valve?"),
    ({"valve": {"a\nb": 1}}, "valve.'a\\nb' must be a known key (got 1). Known here: "),
    ({"fluid": {"density": "thick"}}, "fluid.density must be a number, or a text such as '1.5 kg/m3' ("),
    ({"valve": {"stroke": "3 s"}}, "valve.stroke must be in m or a multiple of it (got '3 s')."),
    ({"preset": "quick"}, "preset must be one of paper, fast, viscous, design (got 'quick')."),
    ({"control": {"method": "hand"}}, "control.method must be one of virtual_master, cell_states, elastic"),
    ({"blister": {"radius": 0.038, "edge_radius": 0.041}}, "blister.radius must be at most half the bed's l"),
    ({"blister": {"edge_radius": 0.015}}, "blister.edge_radius must be above radius, 0.015 m (got 0.015"),
    ({"blister": {"flat_radius": 0.015}}, "blister.flat_radius must be below radius, 0.015 m (got 0.015"),
    ({"layout": 3}, "layout must be a section, [layout] (got 3)."),
    ({"valve": "absent"}, "valve must be a section, [valve] (got 'absent')."),
    ({"conduit": "absnt"}, "conduit must be a section, [conduit], or \"absent\" (got 'absnt')."),
    ({"layout": {"pitch": 1e-3}}, "layout.pitch must be at least actuator.bore, 0.002 m: cylinders would ov"),
    ({"actuator": {"rest_height": 0.2}}, "actuator.rest_height must be at most the stroke, 0.1 m (got 0.2 m"),
    ({"supply": {"high": -1e5}}, "supply.high must be above supply.low (got -100000 Pa, low -50000 Pa)."),
    ({"simulation": {"physics_step": 1e-9}}, "simulation.physics_step must be at least a 1000th of simulati"),
    ({"trajectory": {"waypoints": [POINT]}}, "simulation.duration must be above 0 s where no finger has a"),
    ({"delay": {"dead_time": 100}}, "delay.dead_time must be at most 1000 control periods, 5 s (got 100 s)."),
    ({"trajectory": {"waypoints": []}}, "trajectory.waypoints must have at least one waypoint (got none)."),
    ({"trajectory": {"interpolation": "cubic"}}, "trajectory.interpolation must be one of smooth, linear (g"),
    *(({"trajectory": {"waypoints": [{**POINT, **wrong}]}}, f"trajectory.{said}") for wrong, said in (
        ({"time": -1}, "waypoints #1.time must be at least 0 s (got -1 s)."),
        ({"position": [0, 0]}, "waypoints #1.position must be a list of 3 numbers (got 2 of them)."),
        ({"positon": [0, 0, 0]}, "waypoints #1.positon must be a known key (got [0, 0, 0]). Did you mean tr"),
        ({"orientation": [0, 0, 0, 0]}, "orientations must have a length above 0 (got 0, 0, 0, 0)."),
    )),
    ({"trajectory": {"waypoints": [{"position": [0, 0, 0]}]}}, "trajectory.waypoints #1.time must be given"),
    ({"trajectory": {"waypoints": [{**POINT, "time": time} for time in (0, 2, 1)]}},
     "trajectory.times must increase from waypoint to waypoint (got 1 s after 2 s at waypoint 3)."),
    ({"fluid": {"density": "x" * 10_000}}, "fluid.density must be a number"),
    ({"shape": {"file": ""}}, "shape.file must be a sample shape's name"),
]  # fmt: skip


@pytest.mark.parametrize("table, said", WRONG)
def test_what_is_wrong_is_said_in_one_line_of_a_sane_length(table, said):
    line = refused(table)
    assert (line[: len(said)], "\n" in line, len(line) < 400) == (said, False, True)


SCENES = {
    "default": {},
    "with nothing that can be left out": dict.fromkeys(OPTIONAL, "absent"),
    "of awkward numbers": {
        "valve": {"stroke": 0.1 + 0.2e-16},
        "fluid": {"viscosity": 1 / 3 * 1e-5},
    },
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
    "with every kind of sensor": {
        "sensors": {"force_noise": "0.5 mN", "height_noise": "5 um", "delay": 1}
    },
    "with an observer": {"sensors": {"observer": "valve"}},
    "hexagonal and viscous": {
        "preset": "viscous",
        "layout": {"arrangement": "hexagonal", "rows": 3},
    },
}


@table("table", SCENES)
def test_a_scene_written_as_a_file_reads_back_as_an_equal_one(table):
    scene = resolve(table, "some name")
    assert resolve(tomllib.loads(format_scene(scene))) == scene


def scene(folder, text, **settings):
    """Write a scene file and read it; settings have a double underscore for the dot."""
    path = folder / "my.toml"
    path.write_text(text, encoding="utf-8")
    return load(path, [Setting(key.replace("__", "."), value) for key, value in settings.items()])


def refused_file(folder, text, **settings):
    with pytest.raises(SceneError) as caught:
        scene(folder, text, **settings)
    return str(caught.value).replace(f"{folder}/", "")


@pytest.mark.parametrize(
    "text, setting, said",
    [
        ("", {"valve__stroke": "0"}, "--set: valve.stroke must be above 0 m (got 0 m)."),
        # A mistake in the file is not blamed on a setting; what both break together is.
        ("[valve]\nstroke = 0", {"layout__rows": "3"}, "my.toml: valve.stroke must be above 0 m (got 0 m)."),
        ("[actuator]\nrest_height = 0.05", {"actuator__stroke": "0.01"},
         "--set: actuator.rest_height must be at most the stroke, 0.01 m (got 0.05 m)."),
        # A setting cannot smuggle in a second key.
        ("", {"layout__rows": "3\nx = 4"}, "--set: layout.rows must be a whole number (got '3\\nx = 4')."),
    ],
)  # fmt: skip
def test_a_mistake_is_told_with_the_file_or_the_option(tmp_path, text, setting, said):
    assert refused_file(tmp_path, text, **setting) == said


@pytest.mark.parametrize(
    "text, settings, part, key, value",
    [
        ("[valve]\nstroke = 0.0", {"valve__stroke": "3e-5"}, "valve", "stroke", 3e-5),  # it mends
        ("", {"layout__pitch": "4 mm"}, "layout", "pitch", 4e-3),  # without quotes
        ("", {"layout__arrangement": "hexagonal"}, "layout", "arrangement", "hexagonal"),
        ("", {"relaxation__times": "[1]", "relaxation__weights": "[1, 1]"}, "relaxation", "times", (1.0,)),
        ('conduit = "absent"', {"conduit__length": "0.02"}, "conduit", "length", 0.02),  # put back
    ],
)  # fmt: skip
def test_a_setting_is_a_value_of_the_scene(tmp_path, text, settings, part, key, value):
    made = scene(tmp_path, text, **settings, delay="absent")
    assert (getattr(made.section(part), key), made.delay, made.name) == (value, None, "my")


@pytest.mark.parametrize(
    "text, said",
    [
        ("[valve\nstroke = 1", "my.toml, line 1: Expected ']' at the end of a table declaration."),
        ("a = 1\nb 2\n", "my.toml, line 2: Expected '=' after a key in a key/value pair."),
        ("name = 'x'\nname = 'y'\n", "my.toml, line 2: Cannot overwrite a value."),
        ('name = """\n\n', "my.toml, line 2: Unterminated string."),
        ("a = " + "[" * 100_000, "my.toml: lists or tables are nested too deeply."),
    ],
)
def test_text_that_is_no_toml_is_told_with_its_line(tmp_path, text, said):
    assert refused_file(tmp_path, text) == said


def test_a_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "my.toml"
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(SceneError, match=r"my\.toml must be UTF-8 text \(byte 8 is not\)\."):
        load(path)


def test_a_sample_is_found_although_a_run_of_it_lies_here_which_stands_for_its_scene(here):
    (here / "tap").mkdir()
    (here / "tap" / "scene.toml").touch()
    assert find("tap") == SAMPLES / "tap.toml"
    assert find(str(here / "tap")) == here / "tap" / "scene.toml"


@pytest.mark.parametrize("word", ["nowhere.toml", "a\0b", 300 * "a", "", 300 * "a" + "/b"])
def test_a_word_no_file_can_be_called_is_told_as_any_other(word):
    with pytest.raises(SceneError, match=r"neither a file nor a sample|there is no such file"):
        find(word)


def test_every_sample_is_a_scene_called_like_its_file():
    assert [name for name in list_samples() if load(find(name)).name != name] == []


@pytest.mark.parametrize(
    "word, known",
    [
        ("ridge_mund_valley", ". Did you mean ridge_mound_valley?"),
        ("qqq", f" ({', '.join(list_samples())})."),
    ],
    ids=["misspelt", "like no other"],
)
def test_what_is_no_sample_is_told_with_the_nearest_or_with_all(word, known):
    with pytest.raises(SceneError) as caught:
        find(word)
    # Too many for a line of a message: those in the middle are left out.
    whole = f"{word} is neither a file nor a sample{known}"
    assert str(caught.value) == one_line(whole, LONGEST)
