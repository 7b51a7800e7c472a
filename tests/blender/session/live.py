"""A small bed, a clock, and a finger: what the tests of live sessions in Blender share."""

import bpy
import numpy as np
from digiclay import bridge
from digiclay.core.engine.simulation import begin
from digiclay.core.scene.assembly import assemble
from digiclay.core.session import snapshot
from digiclay.live import beds, handlers, tick
from digiclay.roles import fingertip_of, is_bed
from digiclay.sessions import running
from digiclay.sessions.sculpting import queue_stroke, set_recording
from digiclay.settings import properties

#: Attributes are float32: 24 bits of at most 0.1 m, drawn ten times as large.
FLOAT32 = 0.1 * 2.0**-23
TICK = 1 / 30
#: Ticks in which any stroke of a test comes to its end, if each forms a single period.
MOST_TICKS = 2000


class Clock:
    """Ticks as the window's timer does."""

    now = 0.0

    def until(self, holds):
        """Tick until something holds; return what there is to tell."""
        notes = []
        for _ in range(MOST_TICKS):
            if holds():
                return notes
            notes += self.tick()
        raise AssertionError("What was waited for did not come")

    def tick(self, count=1):
        """Tick some times; return what there is to tell."""
        notes = []
        for _ in range(count):
            self.now += TICK
            bpy.context.view_layer.update()
            notes += tick.tick(bpy.context, self.now)
        return notes


def started(bed):
    """Start a session; there must be nothing to tell."""
    assert tick.start(bpy.context, bed) == []


def move(bed, clock, places):
    """Move the fingertip through places x, z of its lowest point, in mm, tick by tick."""
    notes = []
    for x, z in places:
        # The semi-axis upwards is 8 mm: the empty is the ellipsoid's center.
        fingertip_of(bed).location = np.array([x, 0.0, z + 8.0]) * 1e-3 * bridge.SCALE
        notes += clock.tick()
    return notes


def press(bed, clock, x=0.0, pressed=4, lifted=4):
    """Press at a place and lift off, by default in 24 ticks, which are whole periods."""
    down = [(x, z) for z in np.linspace(46, 37, 8)]
    path = [*down, *[(x, 37.0)] * pressed, *down[::-1], *[(x, 46.0)] * lifted]
    assert move(bed, clock, path) == []


def only_session():
    """Return the session of the only bed."""
    return running.find(only_bed())


def record(bed):
    """Have the session of a bed record from now on."""
    running.put(set_recording(running.find(bed), True))


def queue(bed, stroke):
    """Queue a stroke for the session of a bed; return its number."""
    session, number = queue_stroke(running.find(bed), stroke)
    running.put(session)
    return number


def exact(bed=None):
    """Return the pin tops that a bed, or the only one, keeps, exactly, m."""
    bed = bed or only_bed()
    system = assemble(properties.scene_of(bed))
    kept = beds.read_snapshot(bed)
    return (begin(system) if kept is None else snapshot.load(system, kept)).row(0)


def shown(bed=None):
    """Return the pin tops drawn of a bed, or the only one, m."""
    return bridge.read_cells((bed or only_bed()).data)["height"]


def undone(clock, times=1):
    """Undo, and let the sessions take it up."""
    for _ in range(times):
        bpy.ops.ed.undo()
    clock.tick(handlers.STALE)


def only_bed():
    """Return the bed, fetched anew: undo invalidates all references."""
    (found,) = [thing for thing in bpy.context.scene.objects if is_bed(thing)]
    return found


def waits(bed, clock, *, words):
    """Check that the session waits, says why once, and stands still."""
    notes = clock.tick(3)
    assert [note.level for note in notes] == ["WARNING"]
    assert words in notes[0].message
    session = running.list_sessions()[0]
    assert words in session.blocking_reason
    period = session.state.period
    assert clock.tick(3) == []
    assert running.list_sessions()[0].state.period == period


def goes_on(clock):
    """Check that the session says that it goes on, and does."""
    period = running.list_sessions()[0].state.period
    notes = clock.tick(handlers.STALE + 3)
    assert ["goes on" in note.message for note in notes] == [True]
    assert running.list_sessions()[0].state.period > period
