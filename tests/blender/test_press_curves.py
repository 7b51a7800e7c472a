"""Form along Curves: what is read of curves, texts and Grease Pencil, what is queued and refused."""

import addon_utils
import bpy
import numpy as np
import pytest
from digiclay.live import handlers, tick
from digiclay.operators.press_curves import read_lines
from digiclay.press import brush, tool
from digiclay.sessions import running
from digiclay.sessions.running import find_device
from digiclay.strokes.nominal import find_nominal
from digiclay.strokes.stroke import Brush, Combine

from tests.assemble import assert_near
from tests.blender.at_hand import beds, done, in_the_view, new_bed, select
from tests.blender.session.live import Clock, undone

#: Half the side of the bed, mm: 25 pins 3 mm apart. A unit of Blender is 100 mm.
HALF = 37.5
NAN = float("nan")


@pytest.fixture
def settings(extension):
    """The settings of the tool in hand, over a bed in a session, with nothing selected."""
    bed = new_bed()
    with in_the_view():
        tool.take_up(bpy.context)
        tick.start(bpy.context, bed)
        handlers.watch()
        bpy.ops.object.select_all(action="DESELECT")
        chosen = brush.tool_settings(bpy.context)
        chosen.brush = "RAISE"
        yield chosen


def make(data):
    thing = bpy.data.objects.new(data.name, data)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def lay(*lines, cyclic=False):
    """Add a curve of straight lines through places, mm."""
    curve = bpy.data.curves.new("Lines", "CURVE")
    curve.dimensions = "3D"
    for line in lines:
        spline = curve.splines.new("POLY")
        spline.points.add(len(line) - 1)
        places = [(x / 100.0, y / 100.0, 3.0, 1.0) for x, y in line]
        spline.points.foreach_set("co", np.ravel(places))
        spline.use_cyclic_u = cyclic
    return make(curve)


def circle(radius=20.0, filled=False):
    bpy.ops.curve.primitive_bezier_circle_add(radius=radius / 100.0)
    thing = bpy.context.object
    if filled:
        thing.data.dimensions, thing.data.fill_mode = "2D", "BOTH"
        thing.data.extrude, thing.data.bevel_depth = 0.3, 0.02
    return thing


def write(words):
    text = bpy.data.curves.new("Text", "FONT")
    text.body, text.size = words, 0.4
    return make(text)


def place(thing, **values):
    for name, value in values.items():
        setattr(thing, name, value)
    return thing


def repeat(thing):
    array = thing.modifiers.new("Array", "ARRAY")
    array.count, array.use_relative_offset = 2, False
    array.use_constant_offset, array.constant_offset_displace = True, (0.0, 0.1, 0.0)
    return thing


def follow(thing, above):
    thing.parent, above.location = above, (0.0, 0.1, 0.0)
    return thing


def strands():
    hair = bpy.data.hair_curves.new("Hair")
    hair.add_curves([2, 3])
    hair.position_data.foreach_set("vector", np.arange(15, dtype=np.float32) / 100.0)
    return make(hair)


def draw_layers():
    """Draw with Grease Pencil: a closed and an open line on a layer moved by 10 mm, one on a hidden one."""
    lines = (
        ([(0, 0), (10, 0), (10, 5)], True),
        ([(0, 20), (10, 20)], False),
        ([(9, 9), (8, 8)], False),
    )
    legacy = bpy.app.version < (4, 3)
    pencils = "grease_pencils" if legacy or bpy.app.version >= (5, 0) else "grease_pencils_v3"
    pencil = getattr(bpy.data, pencils).new("Pencil")
    for number, (line, cyclic) in enumerate(lines):
        if number != 1:
            layer = pencil.layers.new(f"Layer {number}")
            frame = layer.frames.new(1)
        places = [(x / 100.0, y / 100.0, 1.0) for x, y in line]
        if legacy:
            stroke = frame.strokes.new()
            stroke.points.add(len(line))
            stroke.points.foreach_set("co", np.ravel(places))
            stroke.use_cyclic = cyclic
        else:
            frame.drawing.add_strokes([len(line)])
            stroke = frame.drawing.strokes[-1]
            for point, at in zip(stroke.points, places, strict=True):
                point.position = at
            stroke.cyclic = cyclic
    pencil.layers[1].hide = True
    setattr(pencil.layers[0], "location" if legacy else "translation", (0.1, 0.0, 0.0))
    return make(pencil)


#: What is selected; its lines: how many places each has, whether it is closed, the first place and
#: the last, mm.
LINES = {
    "two lines, one of them closed": (
        lambda: lay([(0, 0), (10, 5), (20, 0)], [(0, 9), (9, 9), (9, 12)], cyclic=True),
        [(4, True, (0, 0), (0, 0)), (4, True, (0, 9), (0, 9))],
    ),
    "a line of a place": (lambda: lay([(1, 2)]), []),
    "a filled circle, thick": (lambda: circle(filled=True), [(49, True, (-20, 0), (-20, 0))]),
    "scaled, turned and moved": (
        lambda: place(
            lay([(0, 0), (10, 0)]), scale=(2.0, 1.0, 5.0), location=(0.1, 0.0, 9.0),
            rotation_euler=(0.0, 0.0, np.pi / 2.0),
        ),
        [(2, False, (10, 0), (10, 20))],
    ),
    "upright": (
        lambda: place(lay([(0, 0), (10, 10)]), rotation_euler=(np.pi / 2.0, 0.0, 0.0)),
        [(2, False, (0, -300), (10, -300))],
    ),
    "parented": (lambda: follow(lay([(0, 0), (10, 0)]), lay()), [(2, False, (0, 10), (10, 10))]),
    "with a modifier": (
        lambda: repeat(lay([(0, 0), (10, 0)])),
        [(2, False, (0, 0), (10, 0)), (2, False, (0, 10), (10, 10))],
    ),
    "hair": (strands, [(13, False, (0, 1), (3, 4)), (25, False, (6, 7), (12, 13))]),
    "Grease Pencil": (
        draw_layers, [(4, True, (10, 0), (10, 0)), (2, False, (10, 20), (20, 20))],
    ),
    "1e5 places": (
        lambda: lay(np.column_stack([np.linspace(-30, 30, 100_000), np.zeros(100_000)])),
        [(100_000, False, (-30, 0), (30, 0))],
    ),
}  # fmt: skip


@pytest.mark.parametrize("make_it, wanted", LINES.values(), ids=LINES)
def test_lines_are_read_in_the_space_of_the_bed_and_nothing_is_left_in_the_file(
    settings, make_it, wanted
):
    (bed,), thing = beds(), make_it()
    bpy.context.view_layer.update()
    before = {
        name: len(getattr(bpy.data, name))
        for name in ("objects", "meshes", "curves", "node_groups")
    }
    found = read_lines(bpy.context, thing, bed)
    assert [len(line) for line in found] == [count for count, *_ in wanted]
    for line, (_, closed, first, last) in zip(found, wanted, strict=True):
        assert (line[0] == line[-1]).all() == closed
        # Blender has 24 bits, of up to 10 units.
        assert_near(1e3 * line[[0, -1]], [first, last], 1e-4)
    assert before == {name: len(getattr(bpy.data, name)) for name in before}


def test_a_bed_that_is_turned_scaled_and_elsewhere_sees_a_curve_where_it_stands_over_it(settings):
    (bed,), thing = beds(), lay([(0, 0), (10, 0)])
    bed.location, bed.scale, bed.rotation_euler = (0.5, 0.0, 0.0), (2.0,) * 3, (0.0, 0.0, np.pi / 2)
    bpy.context.view_layer.update()
    (line,) = read_lines(bpy.context, thing, bed)
    assert_near(1e3 * line, [[0, 25], [0, 20]], 1e-4)


def test_a_text_has_a_closed_line_per_outline(settings):
    found = read_lines(bpy.context, write("Ri"), beds()[0])
    assert len(found) == 4
    assert all((line[0] == line[-1]).all() for line in found)


SVG = """<svg xmlns="http://www.w3.org/2000/svg" width="50mm" height="50mm" viewBox="0 0 50 50">
<circle cx="25" cy="25" r="20" fill="none" stroke="black"/><path d="M20 20 L30 20 L25 30 Z"/></svg>"""


def test_an_imported_svg_is_curves(settings, tmp_path):
    file, before = tmp_path / "logo.svg", set(bpy.data.objects)
    file.write_text(SVG)
    addon_utils.enable("io_curve_svg")
    try:
        bpy.ops.import_curve.svg(filepath=str(file))
    finally:
        addon_utils.disable("io_curve_svg")
    curves = set(bpy.data.objects) - before
    for curve in curves:
        curve.scale *= 10.0  # a millimeter of the file as one of the device
    bpy.context.view_layer.update()
    lines = [read_lines(bpy.context, curve, beds()[0])[0] for curve in curves]
    ring, triangle = sorted(lines, key=len, reverse=True)
    middle = ring[:-1].mean(axis=0)
    # Four cubic curves are a circle to 0.03 %, in twelve straight parts each to 0.2 %.
    assert_near(np.hypot(*(ring - middle).T), 20e-3, 5e-5)
    # The importer takes 90 pixels per inch in four digits.
    sides = [10e-3, 125**0.5 * 1e-3, 125**0.5 * 1e-3]
    assert_near(np.hypot(*np.diff(triangle, axis=0).T), sides, 2e-4 * 12e-3)


def queue():
    return running.find(beds()[0]).strokes


def form(*things, **options):
    select(*things)
    return bpy.ops.digiclay.press_curves(**options)


def test_curves_become_strokes_of_the_brush_with_its_settings_and_one_undo_step(settings):
    settings.height, settings.strength, settings.symmetry = 8.0, 0.5, "X"
    done("Before")
    form(lay([(-10, 0), (10, 0)], [(0, -10), (0, 10), (0, 60)]), circle())
    done("Form along Curves")
    # 20 mm, up to the edge of the bed at 37.5 mm, and 2 pi 20 mm.
    assert sorted(len(stroke.samples) for stroke in queue()) == [21, 48, 127]
    for stroke in queue():
        assert (stroke.brush, stroke.combine) == (Brush.RAISE, Combine.HIGHEST)
        assert stroke.samples[0].depth == pytest.approx(4e-3)
        assert len(stroke.images) == 2
        assert not stroke.held
    undone(Clock())
    assert queue() == ()


def test_a_ring_is_raised_along_it_without_a_seam_whether_or_not_strokes_accumulate(settings):
    settings.height = 8.0
    for settings.accumulate in (False, True):
        form(circle())
    session = running.find(beds()[0])
    device, height = find_device(session), session.state.row(0)
    # The surface to which the valves bring the pins: the second ring is on the first one.
    for stroke in queue():
        height = find_nominal(stroke, device, height).height
    grid = session.system.grid
    near = np.abs(np.hypot(grid.x, grid.y) - 20e-3) < 1e-3
    assert near.sum() > 15
    assert_near(1e3 * (height[near] - 40e-3), 16.0, 0.1)
    assert height.max() < 56.1e-3


def test_a_text_is_stamped_with_an_edge_and_the_eye_of_its_letters_stays(settings):
    settings.height = 5.0
    form(place(write("O"), location=(-0.31, -0.28, 0.0), scale=(2.0,) * 3), fill=True)
    Clock().until(lambda: not queue())
    height = 1e3 * (running.find(beds()[0]).state.row(0) - 40e-3).reshape(25, 25)
    full, flat = np.abs(height - 5.0) < 0.1, np.abs(height) < 0.1
    # Across the middle: beside the letter, a stem, the eye, a stem; at a rim a pin stands as high as
    # the letter covers of it.
    assert full[12].sum() >= 3
    assert flat[12, 7:19].all()
    assert (~full[12] & ~flat[12]).sum() <= 4
    assert flat[[0, -1]].all()
    assert height.max() < 5.1


REFUSED = {
    "nothing selected": (list, {}, "Select curves, texts or Grease Pencil strokes"),
    "a mesh": (lambda: [bpy.data.objects["Cube"]], {}, "Select curves"),
    "hidden": (lambda: [place(lay([(0, 0), (9, 9)]), hide_viewport=True)], {}, "Select curves"),
    "without lines": (lambda: [lay()], {}, r"Curves must have a line over the bed \(got none\)"),
    "scaled to nothing": (
        lambda: [place(lay([(0, 0), (9, 9)]), scale=(0.0, 0.0, 0.0))], {}, "must have a line",
    ),
    "not a number": (
        lambda: [lay([(0, 0), (NAN, 9)])], {}, r"Lines\S*\.length must be finite, .* \(got nan m\)",
    ),
    "too long": (
        lambda: [lay(*[[(-30, 0), (30, 0)]] * 167)], {}, r"length must be at most 10 m .*10\.02 m",
    ),
    "a surface by a modifier": (
        lambda: [screw(lay([(0, 0), (9, 9)]))], {}, r"modifiers must be lines, .* faces\)",
    ),
    "a line filled": (
        lambda: [lay([(0, 0), (9, 9)])], {"fill": True}, r"Lines\S*\.fill must hold a surface",
    ),
    "hair filled": (lambda: [strands()], {"fill": True}, r"Hair\.fill must be a curve or a text"),
    "filled beside the bed": (
        lambda: [place(write("O"), location=(2.0, 0.0, 0.0))], {"fill": True}, "must lie over the bed",
    ),
}  # fmt: skip


def screw(thing):
    thing.modifiers.new("Screw", "SCREW")
    return thing


@pytest.mark.parametrize("make_them, options, words", REFUSED.values(), ids=REFUSED)
def test_what_gives_no_stroke_is_refused_in_a_line_and_nothing_is_lost(
    settings, make_them, options, words
):
    form(lay([(0, 0), (9, 9)]))
    bpy.ops.object.select_all(action="DESELECT")
    things = make_them()
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=words) as caught:
        form(*things, **options)
    assert len(str(caught.value).strip().splitlines()) == 1 or "poll" in str(caught.value)
    assert len(queue()) == 1


def test_a_bed_in_another_scene_is_not_formed_by_curves_of_this_one(settings):
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    with in_the_view(), pytest.raises(RuntimeError, match=r"Select a bed|not in this view layer"):
        form(lay([(0, 0), (9, 9)]))


@pytest.mark.parametrize(
    "name, fill, words", [("STAMP", False, "another one along"), ("SMOOTH", True, "must be Raise")]
)
def test_brushes_that_cannot_are_told(settings, name, fill, words):
    settings.brush = name
    with pytest.raises(RuntimeError, match=words):
        form(circle(filled=True), fill=fill)
    assert queue() == ()
