"""Random events at a running session: moves, undos, mode switches, deletes, and all keys."""

import random

import bpy
import numpy as np

from tests.window import driver as blender

EVENTS = 150
#: After so many of them a session is started where none runs any more.
REVIVED = 4
CHOICES = {
    "move": 60, "turn": 8, "grab": 30, "undo": 34, "redo": 14, "edit": 12, "select": 16, "delete": 8,
    "add": 6, "start": 40, "stop": 4, "pause": 12, "step": 8, "rewind": 12, "reset": 6, "method": 8,
    "scale": 5, "workspace": 5, "scene": 5, "play": 6, "parameter": 5, "duplicate": 4, "save": 3, "load": 2,
}  # fmt: skip
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


class Events:
    def __init__(self, source):
        self.source = source

    @property
    def tip(self):
        found = [blender.fingertip(number) for number in range(len(blender.beds()))]
        tips = [tip for tip in found if tip is not None]
        return self.source.choice(tips) if tips else None

    def happen(self, name):
        if name in KEYS:
            kind, modifiers = KEYS[name]
            blender.key(kind, self.somewhere(), **modifiers)
        else:
            getattr(self, name)()

    def somewhere(self):
        _, region = blender.view()
        pick = self.source.random
        x = region.x + int(region.width * (0.2 + 0.5 * pick()))
        return x, region.y + int(region.height * (0.2 + 0.6 * pick()))

    def move(self):
        if self.tip is not None:
            pick = self.source.uniform
            self.tip.location = pick(-0.35, 0.35), pick(-0.35, 0.35), pick(0.42, 0.56)

    def turn(self):
        if self.tip is not None:
            self.tip.rotation_quaternion = [self.source.uniform(-1, 1) for _ in range(4)]

    def grab(self):
        at = self.somewhere()
        blender.key("G", at)
        for _ in range(3):
            at = self.somewhere()
            blender.event("MOUSEMOVE", "NOTHING", at)
        blender.key(self.source.choice(["LEFTMOUSE", "RIGHTMOUSE", "ESC", "RET"]), at)

    def select(self):
        things = list(blender.window().view_layer.objects)
        if things and bpy.context.mode == "OBJECT":
            blender.select(self.source.choice(things))

    def add(self):
        if len(blender.beds()) < 3 and bpy.context.mode == "OBJECT":
            self.operator(bpy.ops.mesh.digital_clay_add, rows=11, columns=11)

    def operator(self, operator, *how, **properties):
        area, region = blender.view()
        with bpy.context.temp_override(window=blender.window(), area=area, region=region):
            willing = operator.poll()
        if willing:
            try:
                # With an undo step: data that come and go without one crash Blender at the next
                # undo.
                blender.call(operator, *(how or ("EXEC_DEFAULT",)), True, **properties)
            except RuntimeError as error:
                if not str(error).startswith("Error: "):  # what an operator reports is no fault
                    raise

    def start(self):
        beds = blender.beds()
        if beds and bpy.context.mode == "OBJECT":
            blender.select(self.source.choice(beds))
        self.operator(bpy.ops.digiclay.session, "INVOKE_DEFAULT")

    def revive(self):
        """Have a session run again: what happens to none tells nothing about it."""
        if blender.sessions():
            return
        if bpy.context.mode != "OBJECT":
            self.operator(bpy.ops.object.mode_set, mode="OBJECT")
        for bed in blender.beds():
            bed.scale = 1, 1, 1
        self.add()
        self.start()

    def method(self):
        methods = ["virtual_master", "cell_states", "plastic", "push_pull"]
        for bed in blender.beds():
            bed.digiclay.method = self.source.choice(methods)

    def parameter(self):
        for bed in blender.beds():
            bed.digiclay.simulation.control_period = self.source.choice([5.0, 10.0])

    def scale(self):
        for bed in blender.beds():
            bed.scale = self.source.choice([(1, 1, 1), (1, 1, 1), (2, 2, 2), (1, 2, 1), (0, 0, 0)])

    def workspace(self):
        name = self.source.choice(["Layout", "Layout", "Animation", "Modeling"])
        blender.window().workspace = bpy.data.workspaces[name]

    def scene(self):
        if len(bpy.data.scenes) < 2:
            bpy.data.scenes.new("Other")
            bpy.ops.ed.undo_push(message="Scene")
        blender.window().scene = self.source.choice([*bpy.data.scenes, bpy.data.scenes[0]])

    def play(self):
        self.operator(bpy.ops.screen.animation_play)

    def duplicate(self):
        if bpy.context.mode == "OBJECT" and len(blender.beds()) < 3:
            self.operator(bpy.ops.object.duplicate, linked=self.source.random() < 0.5)

    def save(self):
        bpy.ops.wm.save_as_mainfile(filepath=str(blender.OUT / "random.blend"))

    def load(self):
        if (blender.OUT / "random.blend").is_file():
            bpy.ops.wm.open_mainfile(filepath=str(blender.OUT / "random.blend"))


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
    source = random.Random(20)
    events = Events(source)
    names = source.choices(list(CHOICES), weights=list(CHOICES.values()), k=EVENTS)
    done = []
    blender.SEEN["done"] = done
    live = 0
    for name in names:
        done.append(name)
        if len(done) % REVIVED == 0:
            events.revive()
        events.happen(name)
        yield 0.1
        check()
        live += bool(blender.sessions())
    blender.SEEN["live"] = live
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
