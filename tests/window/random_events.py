"""Random events at a running session: moves, undos, mode switches, deletes, and all keys."""

import random

import bpy
import numpy as np

from tests.window import driver as blender

EVENTS = 150
#: After so many of them a session is started where none runs any more.
REVIVED = 4
SOURCE = random.Random(20)
KEYS = {
    "undo": ("Z", {"ctrl": True}),
    "redo": ("Z", {"ctrl": True, "shift": True}),
    "edit": ("TAB", {}),
    "delete": ("DEL", {}),
    "stop": ("ESC", {}),
    "pause": ("P", {}),
    "step": ("P", {"shift": True}),
    "rewind": ("BACK_SPACE", {}),
    "reset": ("BACK_SPACE", {"shift": True}),
}


def find_tip():
    """Return the fingertip of some bed, or None."""
    found = [blender.fingertip(number) for number in range(len(blender.beds()))]
    tips = [tip for tip in found if tip is not None]
    return SOURCE.choice(tips) if tips else None


def somewhere():
    _, region = blender.view()
    pick = SOURCE.random
    x = region.x + int(region.width * (0.2 + 0.5 * pick()))
    return x, region.y + int(region.height * (0.2 + 0.6 * pick()))


def move():
    if tip := find_tip():
        pick = SOURCE.uniform
        tip.location = pick(-0.35, 0.35), pick(-0.35, 0.35), pick(0.42, 0.56)


def turn():
    if tip := find_tip():
        tip.rotation_quaternion = [SOURCE.uniform(-1, 1) for _ in range(4)]


def grab():
    at = somewhere()
    blender.key("G", at)
    for _ in range(3):
        at = somewhere()
        blender.hover(at)
    blender.key(SOURCE.choice(["LEFTMOUSE", "RIGHTMOUSE", "ESC", "RET"]), at)


def select():
    things = list(blender.window().view_layer.objects)
    if things and bpy.context.mode == "OBJECT":
        blender.select(SOURCE.choice(things))


def add():
    if len(blender.beds()) < 3 and bpy.context.mode == "OBJECT":
        carry_out(bpy.ops.mesh.digital_clay_add, rows=11, columns=11)


def carry_out(operator, *how, **properties):
    with blender.in_the_view():
        willing = operator.poll()
    if willing:
        try:
            # With an undo step: data that come and go without one crash Blender at the next
            # undo.
            blender.call(operator, *(how or ("EXEC_DEFAULT",)), True, **properties)
        except RuntimeError as error:
            if not str(error).startswith("Error: "):  # what an operator reports is no fault
                raise


def start():
    beds = blender.beds()
    if beds and bpy.context.mode == "OBJECT":
        blender.select(SOURCE.choice(beds))
    carry_out(bpy.ops.digiclay.session, "INVOKE_DEFAULT")


def revive():
    """Have a session run again: what happens to none tells nothing about it."""
    if blender.sessions():
        return
    if bpy.context.mode != "OBJECT":
        carry_out(bpy.ops.object.mode_set, mode="OBJECT")
    for bed in blender.beds():
        bed.scale = 1, 1, 1
    add()
    start()


def method():
    methods = ["virtual_master", "cell_states", "plastic", "push_pull"]
    for bed in blender.beds():
        bed.digiclay.method = SOURCE.choice(methods)


def parameter():
    for bed in blender.beds():
        bed.digiclay.simulation.control_period = SOURCE.choice([5.0, 10.0])


def scale():
    for bed in blender.beds():
        bed.scale = SOURCE.choice([(1, 1, 1), (1, 1, 1), (2, 2, 2), (1, 2, 1), (0, 0, 0)])


def workspace():
    name = SOURCE.choice(["Layout", "Layout", "Animation", "Modeling"])
    blender.window().workspace = bpy.data.workspaces[name]


def scene():
    if len(bpy.data.scenes) < 2:
        bpy.data.scenes.new("Other")
        bpy.ops.ed.undo_push(message="Scene")
    blender.window().scene = SOURCE.choice([*bpy.data.scenes, bpy.data.scenes[0]])


def play():
    carry_out(bpy.ops.screen.animation_play)


def duplicate():
    if bpy.context.mode == "OBJECT" and len(blender.beds()) < 3:
        carry_out(bpy.ops.object.duplicate, linked=SOURCE.random() < 0.5)


def save():
    bpy.ops.wm.save_as_mainfile(filepath=str(blender.OUT / "random.blend"))


def load():
    if (blender.OUT / "random.blend").is_file():
        bpy.ops.wm.open_mainfile(filepath=str(blender.OUT / "random.blend"))


#: What happens, and how often: things that are done, and keys.
CHOICES = {
    move: 60, turn: 8, grab: 30, "undo": 34, "redo": 14, "edit": 12, select: 16, "delete": 8, add: 6,
    start: 40, "stop": 4, "pause": 12, "step": 8, "rewind": 12, "reset": 6, method: 8, scale: 5,
    workspace: 5, scene: 5, play: 6, parameter: 5, duplicate: 4, save: 3, load: 2,
}  # fmt: skip


def happen(event):
    if event in KEYS:
        kind, modifiers = KEYS[event]
        blender.key(kind, somewhere(), **modifiers)
    else:
        event()


def check():
    for session in blender.sessions():
        state = blender.part("core.session.snapshot").load(session.system, session.snapshot)
        height = state.row(0)
        assert np.isfinite(height).all()
        assert height.min() >= 0.0
        assert height.max() <= session.system.cell.actuator.stroke
        bed = blender.part("live.beds").find_bed(session)
        if bed is not None and not session.stale:
            assert blender.part("live.beds").read_snapshot(bed) == session.snapshot
    for bed in blender.beds():
        if not bed.data.is_editmode:
            assert np.isfinite(blender.part("bridge").read_cells(bed.data)["height"]).all()


def script():
    """Do random things, checking after each; then form a bed in peace."""
    yield from blender.scene_with_bed(rows=15, columns=15)
    blender.call(bpy.ops.digiclay.session, "INVOKE_DEFAULT")
    live = 0
    events = SOURCE.choices(list(CHOICES), weights=list(CHOICES.values()), k=EVENTS)
    for number, event in enumerate(events, 1):
        if number % REVIVED == 0:
            revive()
        happen(event)
        yield 0.1
        check()
        live += bool(blender.sessions())
    blender.SEEN["done"], blender.SEEN["live"] = number, live
    blender.shot("session_random")

    # Whatever state that was, somebody who goes on from it can sculpt.
    blender.key("ESC")
    yield 0.5
    if bpy.context.screen.is_animation_playing:
        blender.call(bpy.ops.screen.animation_cancel)
    bpy.ops.wm.read_homefile()
    yield 1.0
    blender.call(bpy.ops.mesh.digital_clay_add, rows=15, columns=15)
    yield from blender.start()
    blender.fingertip().location.z = 0.45
    yield from blender.settle(5)
    blender.look("formed")
    blender.shot("session_after_random")
