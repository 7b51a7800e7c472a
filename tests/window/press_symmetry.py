"""Draws symmetric strokes on a turned and shifted bed, one after the other without a pause, by X events."""

import time

import bpy
import numpy as np

from tests.window import driver as blender
from tests.window.hand_strokes import (
    act,
    brush,
    done,
    finish,
    hand,
    line,
    note,
    on_the_screen,
    prepare,
    reset,
    to,
)

#: Ends of a stroke that stays apart from its images, of one across the mirror's axis, and of one on
#: it, mm.
APART = ((27.0, 9.0), (27.0, 21.0))
ACROSS = ((-27.0, -9.0), (27.0, 12.0))
ALONG = ((0.0, -24.0), (0.0, 24.0))
#: Strokes that are timed on the bed "design": symmetry, images, ends, mm; apart, 1 mm beside an
#: axis, a ray.
FAR = ((20.0, 8.5), (40.0, 12.0))
BESIDE = ((1.0, -10.0), (1.0, 10.0))
RAY = ((2.0, 1.0), (20.0, 9.5))
TIMED = {
    "1": ("NONE", 2, FAR), "2": ("X", 2, FAR), "6": ("RADIAL", 6, FAR), "12": ("RADIAL", 12, FAR),
    "1 beside": ("NONE", 2, BESIDE), "2 beside": ("X", 2, BESIDE),
    "1 ray": ("NONE", 2, RAY), "12 rays": ("RADIAL", 12, RAY),
}  # fmt: skip


def script():
    """Do what a hand does."""
    yield from prepare("TOP", bed="paper")
    bed = blender.bed()
    bed.rotation_euler[2], bed.location[0], bed.location[1] = 0.4, 0.3, -0.2
    blender.evaluate()
    yield None
    blender.call(bpy.ops.view3d.view_all)
    yield from blender.rounds()
    blender.shot("symmetry_begun")
    # The first press starts the session.
    yield from act(to(on_the_screen(0.0, 0.0), 0.3), "click 1 sleep 0.3")
    yield from blender.until(lambda: bool(blender.sessions()))
    settings = brush()
    settings.radial = 4
    for name, symmetry, way in (
        ("one", "NONE", APART),
        ("radial", "RADIAL", APART),
        ("mirrored", "X", APART),
        ("across alone", "NONE", ACROSS),
        ("across", "X", ACROSS),
        ("along alone", "NONE", ALONG),
        ("along", "X", ALONG),
    ):
        yield from begin()
        settings.symmetry = symmetry
        process = line(*way, 0.3, 125)
        yield from blender.until(lambda: is_pressing())
        blender.shot(f"symmetry_{name}")
        yield from finish(process)
        write_down(name)
    blender.shot("symmetry_formed")
    yield from impatient()


def is_pressing():
    """Tell whether a fingertip is in the pins, or the stroke is done already."""
    (session,) = blender.sessions()
    return not session.strokes or bool((session.state.finger_forces() > 0.01).any())


def begin():
    """Have a bed at rest, and record from now on."""
    yield from reset()
    bpy.ops.ed.undo_push(message="Reset")
    blender.call(bpy.ops.digiclay.take_record)
    yield from blender.settle()


def write_down(name):
    """Note the heights, the periods of the last stroke up to the last order, and the recorded fingertips."""
    note(name)
    (session,) = blender.sessions()
    recording = session.recording
    ordered = np.flatnonzero(recording.orders.rows.any(axis=1))
    blender.SEEN[name] |= {
        "periods": int(ordered[-1]) + 1 - (session.gestures[-1].period - recording.first),
        "fingers": recording.path.shape[1],
        "left": session.system.fingers,
    }


def impatient():
    """Draw three strokes at once, one of another symmetry; undo the last; Esc in the middle of a fourth."""
    settings = brush()
    yield from begin()
    settings.symmetry = "RADIAL"
    first = line(*APART, 0.2, 125)
    yield from blender.until(lambda: first.poll() is not None)
    settings.symmetry = "Y"
    second = line((-27.0, 15.0), (-12.0, 15.0), 0.2, 125)
    yield from blender.until(lambda: second.poll() is not None)
    settings.symmetry = "X"
    yield from finish(line((6.0, 30.0), (15.0, 30.0), 0.2, 125))
    note("three")
    yield from act(to(on_the_screen(0.0, 0.0)), "key ctrl+z")
    note("two")
    settings.symmetry = "RADIAL"
    process = line((9.0, 9.0), (15.0, 9.0), 0.2, 125, last="sleep 2")
    yield from blender.until(lambda: any(one.system.fingers == 4 for one in blender.sessions()))
    yield from act("key Escape sleep 0.2")
    hand("mouseup 1")
    yield from finish(process)
    note("escaped")
    # The recording is kept, replayed and baked.
    blender.call(bpy.ops.digiclay.take_keep)
    yield from blender.settle()
    (session,) = blender.sessions()
    blender.SEEN["at the end"] = session.poses.shape
    yield from act("key Escape")
    yield from blender.stopped()
    bed = blender.bed()
    take = blender.part("recorded.takes").read(bed)
    blender.SEEN["take"] = [max(take.fingers), min(take.fingers)]
    blender.call(bpy.ops.digiclay.take_replay)  # in steps of its own
    yield from done(hand("sleep 0.1"))
    note("replayed")
    yield from time_images()


def time_images():
    """Note the periods of strokes with several images, and the seconds until all is formed."""
    yield from prepare("TOP", bed="design")
    yield from act(to(on_the_screen(0.0, 0.0), 0.3), "click 1 sleep 0.3")
    yield from blender.until(lambda: bool(blender.sessions()))
    settings, timed = brush(), {}
    settings.depth = 4.0
    for name, (symmetry, count, way) in TIMED.items():
        yield from reset()
        settings.symmetry, settings.radial = symmetry, count
        begun, process = time.perf_counter(), line(*way, 0.3, 125)
        yield from blender.until(lambda: any(one.strokes for one in blender.sessions()), 0.01)
        yield from blender.until(lambda: not any(one.strokes for one in blender.sessions()), 0.01)
        (session,), seconds = blender.sessions(), time.perf_counter() - begun
        timed[name] = session.state.period - session.gestures[-1].period, seconds
        yield from finish(process)
    blender.SEEN["timed"] = timed
