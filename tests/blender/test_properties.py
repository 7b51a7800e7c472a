"""A bed's settings hold every parameter of the core, and give back its scene; a bed is rebuilt by them."""

import dataclasses

import bpy
import numpy as np
import pytest
from digiclay import bridge
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.modes import Mode
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.methods import METHODS
from digiclay.core.files.run_folder import list_files
from digiclay.core.model.layout import ARRANGEMENTS, Layout, make_grid
from digiclay.core.scene.scene_source import SAMPLES, find, load
from digiclay.core.scene.schema import OPTIONAL, SECTIONS, import_parameters
from digiclay.core.scene.toml_table import PRESETS, resolve
from digiclay.device import parts, view
from digiclay.live import beds
from digiclay.roles import BED, fingertip_of
from digiclay.settings import properties
from digiclay.settings.declared import read
from digiclay.settings.shown_units import unit_of

from tests.assemble import assert_near
from tests.blender.at_hand import evaluate, instances, new_bed

pytestmark = pytest.mark.usefixtures("extension")

EVERY = [(section, "virtual_master") for section in SECTIONS if section != "control"]
EVERY += [("control", method) for method in METHODS]


def thing(layout=None, fingers=0):
    """Return a bed with the pins of a layout, by default the default's, and so many fingertips."""
    places = make_grid(layout or Layout())
    mesh = bridge.points("Bed", places.count)
    bridge.write_cells(mesh, places.positions, np.zeros(places.count))
    bed = parts.marked(mesh, "Bed", BED, bpy.context.collection)
    for number in range(1, fingers + 1):
        parts.make_fingertip(bed, number)
    return bed


def told(bed, scene):
    """Return a scene as a bed's settings can tell it: its name, and no words or path of its own."""
    path = resolve({"actuator": {"rest_height": scene.actuator.rest_height}}).section("trajectory")
    return scene.with_sections(name=bed.name, description="", trajectory=path)


@pytest.mark.parametrize("section, method", EVERY)
def test_every_parameter_has_a_property_with_its_unit_meaning_and_bounds(section, method):
    settings = thing().digiclay
    settings.method = method
    group = properties.part_group(settings, section)
    shown = group.bl_rna.properties
    kind = import_parameters(section, method)
    defaults = {field.name: field.default for field in dataclasses.fields(kind)}
    for name, known in list_quantities(kind).items():
        unit, _ = unit_of(known.unit, defaults[name])
        assert shown[name].name.endswith(f"({unit})") or not unit
        assert known.doc[1:] in shown[name].description
        # A number cannot be dragged out of its bounds.
        for end in (-1e30, 1e30) if isinstance(defaults[name], float) else ():
            setattr(group, name, end)
            value = read(group, kind, {}, section)[name]
            bounds = (known.above, known.at_least) if end < 0 else (known.below, known.at_most)
            if any(bound is not None for bound in bounds):
                assert known.broken_rule(value) == "", name


@pytest.mark.parametrize("sample", list_files(SAMPLES, ".toml"))
def test_a_sample_scene_comes_back_bit_for_bit(sample):
    scene = load(find(sample))
    bed = thing(scene.layout, len(scene.fingers))
    properties.write_scene(bed, scene)
    assert properties.scene_of(bed) == told(bed, scene)


def test_values_blender_cannot_keep_come_back_bit_for_bit():
    scene = resolve({
        "valve": {"stroke": 1 / 33000, "orifice_diameter": 1e-12}, "sensors": {"seed": 2**63 - 1},
        "relaxation": {"times": [1 / 300, 1 / 7], "weights": [0.1, 1 / 3, 0.2]},
    })  # fmt: skip
    bed = thing()
    properties.write_scene(bed, scene)
    assert properties.scene_of(bed) == told(bed, scene)
    copy = bed.copy()
    bed.digiclay.valve.stroke = 0.04  # what is changed by hand is no longer the value adopted
    assert properties.scene_of(bed).valve.stroke == 40e-6
    assert properties.scene_of(copy).valve.stroke == 1 / 33000
    for typed, meant in ((3.0, 3e-3), (2.7, 2.7e-3), (12.34567, 12.34567e-3)):
        bed.digiclay.layout.pitch = typed
        assert properties.read_scene(bed).layout.pitch == meant


@pytest.mark.parametrize("section", OPTIONAL)
def test_a_part_that_is_switched_off_is_left_out_and_each_method_keeps_parameters_of_its_own(
    section,
):
    bed = thing()
    assert properties.scene_of(bed) == resolve({}, bed.name)
    setattr(bed.digiclay, f"use_{section}", False)
    assert properties.scene_of(bed).section(section) is None
    setattr(bed.digiclay, f"use_{section}", True)
    assert properties.scene_of(bed).section(section) is not None
    bed.digiclay.control.virtual_master.force_setpoint = 0.25
    for method, force in (("cell_states", 0.04), ("virtual_master", 0.25)):
        bed.digiclay.method = method
        assert properties.scene_of(bed).control.force_setpoint == force


@pytest.mark.parametrize(
    "section, name, before, value, table",
    [
        *(("", "preset", "viscous", name, {"preset": name}) for name in PRESETS),
        *(("", "method", "cell_states", name, {"control": {"method": name}}) for name in METHODS),
        *(
            ("layout", "arrangement", "hexagonal", one, {"layout": {"arrangement": one}})
            for one in ARRANGEMENTS
        ),
        ("layout", "pitch", 5.0, 4.0, {"layout": {"pitch": 4e-3}}),
    ],
)
def test_a_choice_gives_the_scene_of_a_file(section, name, before, value, table):
    bed = thing()
    group = getattr(bed.digiclay, section) if section else bed.digiclay
    setattr(group, name, before)
    setattr(group, name, value)
    assert properties.read_scene(bed) == resolve(table, bed.name)


@pytest.mark.parametrize(
    "typed, rule",
    [
        *((typed, "be numbers separated by commas") for typed in ("", "4; 70", "4, , 70", "four")),
        *(
            (typed, "be (a finite number|at least)")
            for typed in ("nan, 70", "4, inf, 5", "-4, 70", "0, 70")
        ),
    ],
)
def test_a_list_without_sense_is_refused(typed, rule):
    bed = thing()
    bed.digiclay.relaxation.times = typed
    with pytest.raises(ParameterError, match=rf"^Relaxation: Times must {rule}"):
        properties.scene_of(bed)


def test_a_path_that_starts_at_the_file_is_one_the_core_can_open(tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "here.blend"))
    bed = thing()
    bed.digiclay.method = "shape_display"
    bed.digiclay.control.shape_display.shape = "//hill.npy"
    assert properties.table_of(bed)["control"]["shape"] == str(tmp_path / "hill.npy")


#: Positions are float32 and drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23


@pytest.fixture
def bed():
    """A small bed away from the origin, its fingertip moved and its pins formed."""
    bed = new_bed(rows=6, columns=8)
    bed.location = (1.0, -2.0, 0.5)
    fingertip_of(bed).location.x += 0.05
    bed.data.vertices[7].co.z += 0.02
    bpy.context.view_layer.update()
    return bed


def identity(bed):
    tip = fingertip_of(bed)
    counts = (len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.node_groups))
    places = (tuple(bed.location), tuple(tip.location))
    return bed.session_uid, tip.session_uid, *places, *counts, view.shows_force(bed)


def test_a_rebuilt_bed_is_the_same_with_its_new_pins_at_rest_where_its_layout_says(bed):
    view.color_by(bed, "force")
    bed[beds.STATE], before, settings = b"of 48 pins", identity(bed), bed.digiclay
    settings.layout.rows, settings.layout.columns, settings.layout.arrangement = 9, 20, "hexagonal"
    settings.actuator.rest_height = 30.0
    assert bpy.ops.digiclay.rebuild() == {"FINISHED"}
    cells = bridge.read_cells(bed.data)
    wanted = make_grid(properties.scene_of(bed).layout)
    assert_near(cells["position"], wanted.positions, FLOAT32)
    assert_near(cells["height"], 0.030, FLOAT32)
    assert set(cells["mode"]) == {Mode.REST}
    assert (identity(bed), beds.read_snapshot(bed), len([*instances(bed)])) == (before, None, 180)
    # The housing is about all of them.
    housing, pins = (bridge.read_points(mesh)[:, 0].max() for mesh in (evaluate(bed), bed.data))
    assert housing > pins
    bpy.data.objects.remove(fingertip_of(bed))
    bed.modifiers.clear()
    bpy.ops.digiclay.rebuild()
    assert fingertip_of(bed) is not None
    bpy.context.view_layer.update()
    assert len([*instances(bed)]) == 180


def test_settings_that_do_not_go_together_leave_the_bed_as_it_is(bed):
    bed.digiclay.layout.pitch = 1.0
    before = (len(bpy.data.objects), bed.data.name)
    words = r"Layout: Pitch must be at least Actuator: Bore, 2 mm: cylinders would overlap \(got 1 mm\)\.$"
    with pytest.raises(RuntimeError, match=words):
        bpy.ops.digiclay.rebuild()
    assert before == (len(bpy.data.objects), bed.data.name)


@pytest.mark.parametrize(
    "field, value",
    [("rows", 8), ("pitch", 3.5), ("arrangement", "staggered"), ("arrangement", "hexagonal")],
)
def test_the_panel_says_when_a_bed_is_no_longer_as_its_layout(field, value, bed):
    assert properties.rebuild_reason(bed) == ""
    setattr(bed.digiclay.layout, field, value)
    if field == "rows":
        assert properties.rebuild_reason(bed) == "The bed has 48 pins, not 64"
        bed.digiclay.layout.columns = 6  # exchanged: another bed of as many pins
    assert properties.rebuild_reason(bed) == "The pins differ from the parameters of Layout"
    with pytest.raises(ParameterError, match="press Rebuild"):
        properties.scene_of(bed)
    bpy.ops.digiclay.rebuild()
    assert properties.rebuild_reason(bed) == ""


def test_a_copy_of_the_bed_keeps_its_pins_when_the_other_is_rebuilt(bed):
    copy = bed.copy()
    bpy.context.scene.collection.objects.link(copy)
    bed.digiclay.layout.columns = 11
    bpy.ops.digiclay.rebuild()
    bpy.context.view_layer.update()
    assert len([*instances(copy)]) == 48
