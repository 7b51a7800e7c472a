"""Takes: record, keep, export, remove, replay, bake; recorded strokes are played."""

import time
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from .. import bridge, preferences
from ..compat import Context, Event, Object, Operator, bpy
from ..core.base.errors import DigiclayError
from ..core.engine.simulation import begin
from ..core.engine.state import State
from ..core.engine.system import System
from ..core.files.run_folder import write_whole
from ..core.scene.assembly import assemble
from ..core.scene.toml_table import format_scene
from ..core.session import snapshot
from ..core.session.live_session import Clock, periods_due
from ..core.session.take import MOST_PARTS, Take, refine, to_scene
from ..core.session.take import play as play_take
from ..device import view
from ..device.instant import find_ellipsoids
from ..exchange import formed_bed
from ..exchange.animation_file import ENDINGS, SUFFIXES, animate, write_animation
from ..live import beds, handlers, tick
from ..recorded import bake, takes
from ..recorded.pointer_strokes import play_strokes, read_strokes
from ..roles import bed_of, fingertips_of
from ..sessions import running, sculpting
from ..settings import properties
from ..settings.declared import choice, integer, text
from ..ui_text import localize
from .action import (
    FileAction,
    Result,
    SteppedAction,
    TimedAction,
    action,
    file_of,
    inform,
    show_status,
)
from .export_mesh import UNIT
from .poll_messages import (
    baked,
    cannot_change,
    cannot_form,
    cannot_measure,
    cannot_record,
    no_bake,
    no_bed,
    no_motion,
    no_recording,
    no_take,
    session_runs,
)

TAKE = text("Take", "Number of the take; empty: the last one")


@action("digiclay.take_record", "Record Take", cannot_record)
def record_take(operator: Operator, context: Context) -> None:
    """Record the fingertip's path from now on, to replay, bake or export it"""
    session = running.find(bed_of(context))
    assert session is not None  # by the poll
    running.put(sculpting.set_recording(session, True))


@action(
    "digiclay.take_keep",
    "Keep Take",
    no_recording,
    name=text("Name", "Name of the take; empty: its number", maxlen=60),
)
def keep_take(operator: Operator, context: Context) -> Result | None:
    """Stop recording and keep the take in this file"""
    handlers.clear_recovery()
    bed = bed_of(context)
    session = running.find(bed)
    assert session is not None  # by the poll
    take = takes.read_recording(session)
    running.put(sculpting.set_recording(session, False))
    if take is None:
        inform(operator, "Nothing was recorded: the session was paused", level="WARNING")
        return {"CANCELLED"}
    entry = takes.add(bed, take, operator.name, session)
    inform(operator, "{}: {:.1f} s kept", entry.name, entry.seconds)
    return None


class ExportTake(FileAction, Operator):
    """Write a take as a scene file for `digiclay run`"""

    bl_idname = "digiclay.take_export"
    bl_label = "Export Take"
    bl_options = {"REGISTER"}
    needs = no_bed, no_take

    take: TAKE
    filepath: bpy.props.StringProperty(subtype="FILE_PATH")
    filter_glob: bpy.props.StringProperty(default="*.toml", options={"HIDDEN"})

    def invoke(self, context: Context, event: Event) -> Result:
        """Open the file browser, with the name of the take."""
        try:
            name = takes.find(bed_of(context), self.take).name
        except DigiclayError:
            name = "take"
        self.filepath = bpy.path.clean_name(name) + ".toml"
        return super().invoke(context, event)

    def perform(self, context: Context) -> None:
        entry = takes.find(bed_of(context), self.take)
        take = takes.read(bed_of(context), entry.number)
        # A point in the name is not where an ending begins: "ridge 1.5" is no "ridge 1".
        file = Path(bpy.path.ensure_ext(bpy.path.abspath(self.filepath), ".toml"))
        scene = to_scene(take, entry.name)
        numbers = takes.list_fingers(bed_of(context), entry.number, len(take.scene.fingers))
        if len(numbers) > 1 and numbers[-1] > len(numbers):  # a scene file counts its own from 1 on
            numbering = ", ".join(f"{row} = {number}" for row, number in enumerate(numbers, 1))
            scene = replace(
                scene, description="Numbers of the fingers here = on the bed: " + numbering
            )
        write_whole(file, format_scene(scene).encode())
        inform(self, "{} written to {}", entry.name, file)


@action("digiclay.take_remove", "Remove Take", cannot_change, no_take, take=TAKE)
def remove_take(operator: Operator, context: Context) -> None:
    """Remove a take"""
    takes.remove(bed_of(context), takes.find(bed_of(context), operator.take).number)


@action(
    "digiclay.play_strokes",
    "Play Strokes",
    cannot_form,
    session_runs,
    baked,
    bases=(FileAction,),
    **file_of("*.toml"),
)
def play(operator: Operator, context: Context) -> None:
    """Form recorded strokes of the Press tool on the bed, from a file, as fast as they can be simulated"""
    recorded = read_strokes(Path(bpy.path.abspath(operator.filepath)))
    bed = bed_of(context)
    for note in tick.start(context, bed):
        operator.report({note.level}, note.message)
    try:
        session = running.find(bed)
        assert session is not None  # it has just been started
        *_, session = play_strokes(session, recorded.strokes)
        tick.bring_back(context, bed, session)
    finally:  # when a stroke fails, the bed stays as it was
        tick.stop(bed.session_uid)
    inform(operator, "{}: {} strokes", recorded.name, len(recorded.strokes))


def read_fitting_take(bed: Object, number: str) -> Take:
    """Return a take of a bed; DigiclayError for one of another layout."""
    take = takes.read(bed, number)
    plan = take.scene.layout
    if properties.find_layout_mismatch(bed, plan):
        raise DigiclayError(
            f"The take must have the layout of the bed (got {plan.rows} x {plan.columns} pins, "
            f"{1e3 * plan.pitch:g} mm apart, {plan.arrangement})."
        )
    return take


class ReplayTake(TimedAction, Operator):
    """Replay a take at its recorded speed. Esc stops and restores the bed"""

    _states: Iterator[tuple[System, State]]
    _clock: Clock
    _at: int

    bl_idname = "digiclay.take_replay"
    bl_label = "Replay Take"
    bl_options = {"REGISTER", "UNDO"}
    needs = cannot_form, session_runs.reworded("Stop the session on this bed first"), baked, no_take

    take: TAKE
    parts: integer(
        "Finer Steps",
        "Number of parts of each physics step: 1 replays the take bit for bit",
        default=1,
        min=1,
        max=MOST_PARTS,
    )

    def perform(self, context: Context) -> None:
        """Play it without showing anything but its end."""
        self._begin(context)
        for moment in self._states:
            (self._system, self._state), self._at = moment, self._at + 1
        self._finish(context)

    def prepare(self, context: Context, event: Event) -> None:
        self._begin(context)
        self.interval = 1.0 / preferences.get(context).redraw_rate

    def modal(self, context: Context, event: Event) -> Result:
        """Continue by the wall clock."""
        if event.type == "ESC" and event.value == "PRESS":
            return self._restore(context)
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        bed = bed_of(context)
        if bed is None or bed.session_uid != self._uid:
            return self._restore(context)
        if bridge.find_fault(bed.data):  # it continues when it can be drawn again
            self._clock = self._clock.stopped()
            return {"PASS_THROUGH"}
        period = self._system.period
        count, self._clock = periods_due(
            self._clock, time.perf_counter(), period, preferences.get(context).most_periods
        )
        for _ in range(min(count, self._take.periods - self._at)):
            self._system, self._state = next(self._states)
            self._at += 1
        if self._at == self._take.periods:
            self.cancel(context)
            return self._finish(context)
        view.show_state(bed, self._system, self._state)
        self._place(bed)
        seconds, whole = self._at * period, self._take.duration
        show_status(context, localize("Replay: {:.1f} of {:.1f} s     Esc: stop", seconds, whole))
        return {"PASS_THROUGH"}

    def cancel(self, context: Context) -> None:
        """Give back what the replay needs of Blender, and the states to come."""
        self._states = iter(())
        super().cancel(context)

    def give_up(self, context: Context, words: str) -> None:
        """Show the bed as it was before."""
        self._restore(context)

    def _begin(self, context: Context) -> None:
        """Read the take and put everything to its start."""
        bed = bed_of(context)
        self._uid = bed.session_uid
        # The poses of the fingertips now: they may have been moved since the last session.
        self._stood = bridge.poses(bed)
        self._take = read_fitting_take(bed, self.take)
        self._numbers = takes.list_fingers(bed, self.take, len(self._take.scene.fingers))
        self._states = play_take(self._take, refine(self._take.scene, self.parts))
        self._system, self._state = next(self._states)
        self._clock, self._at = Clock(), 0

    def _place(self, bed: Object) -> None:
        """Put the fingertips to where the take has them; one that is animated follows its animation."""
        fingers = find_ellipsoids(self._take.scene)
        bridge.place_fingertips(bed, self._take.poses[self._at], fingers, self._numbers)

    def _finish(self, context: Context) -> Result:
        """Leave the bed in the final state of the take, and report the comparison."""
        bed, system = bed_of(context), self._system
        state = snapshot.dump(system, self._state)
        self._place(bed)
        # The session that continues from here.
        numbers, tick_count = self._numbers, beds.read_tick(bed)
        begun = sculpting.begin_session(
            bed.session_uid,
            bed.name,
            self._take.scene,
            self._take.poses[-1, : len(numbers)],
            state,
            tick_count,
            numbers,
            running.name_fingers(numbers, system.fingers),
            self._take.base,
        )
        beds.write(bed, begun[0])
        view.show_state(bed, system, self._state)
        seconds = f"{self._take.duration:.1f} s"
        if state == self._take.end:
            inform(self, "Replayed {}: it ends in the same state, bit for bit", seconds)
            return {"FINISHED"}
        recorded = snapshot.load(self._system, self._take.end)
        away = 1e6 * float(np.abs(self._state.row(0) - recorded.row(0)).max())
        if self.parts == 1:
            words = localize(
                "Replayed {}: it ends {:.3g} µm away, as another version can", seconds, away
            )
            self.report({"WARNING"}, words)
        else:
            words = localize("steps {} times finer end {:.3g} µm away", self.parts, away)
            inform(self, "Replayed {}: {}", seconds, words)
        return {"FINISHED"}

    def _restore(self, context: Context) -> Result:
        """Show the bed as it was before."""
        self.cancel(context)
        bed = beds.find_object(self._uid)
        if bed is not None:
            try:
                scene = properties.scene_of(bed)
                before, _ = sculpting.begin_session(
                    bed.session_uid,
                    bed.name,
                    scene,
                    self._stood,
                    beds.read_snapshot(bed),
                    0,
                    tuple(fingertips_of(bed)),
                    beds.read_numbers(bed),
                )
                view.show_state(bed, before.system, before.state)
                tick.place_fingers(context, bed, before)
            except DigiclayError as error:
                self.report({"WARNING"}, str(error))
        inform(self, "Replay stopped: the bed is restored")
        return {"CANCELLED"}


SOURCES = (
    ("FINGERTIP", "Animated Fingertip", "The fingertip as it moves in the frames of the scene"),
    ("TAKE", "Take", "The fingertip as it was recorded in a session"),
)


class Bake(SteppedAction, Operator):
    """Make an ordinary animation of the bed from a session; it plays and renders without simulation"""

    bl_idname = "digiclay.bake"
    bl_label = "Bake Session"
    bl_options = {"REGISTER", "UNDO"}
    needs = cannot_form, session_runs.reworded("Stop the session on this bed first")

    take: TAKE
    source: choice("Source", "Source of the fingertip path", items=SOURCES, default="FINGERTIP")
    first: integer("First Frame", "First frame of the session", default=1)
    last: integer("Last Frame", "Last frame of the session; a take has its own length", default=250)

    def prepare(self, context: Context, event: Event) -> None:
        """Take the scene's frames where none are asked for; work goes on while Blender draws."""
        if not self.properties.is_property_set("first"):
            self.first = context.scene.frame_start
        if not self.properties.is_property_set("last"):
            self.last = context.scene.frame_end
        super().prepare(context, event)

    def work(self, context: Context) -> Generator[float, None, None]:
        """Read the path, simulate it and write the bake, which Esc leaves out; yield the share done."""
        bed, scene = bed_of(context), context.scene
        recorded = self.source == "TAKE"
        if recorded:
            take = read_fitting_take(bed, self.take)
        else:
            device = properties.scene_of(bed)
            for step in bake.sample_path(scene, bed, self.first, self.last, device):
                if isinstance(step, float):
                    yield 0.3 * step
                else:
                    path = step
            system = assemble(device)
            # How the path ends is unknown before its simulation, and nothing asks for it.
            take = Take(
                device, snapshot.dump(system, begin(system)), path.poses, b"", knots=path.knots
            )
        rate = bake.read_rate(scene)
        for part in bake.simulate_frames(take, rate):
            if isinstance(part, float):
                yield 0.3 + 0.7 * part
            else:
                moments = part
        fingers = find_ellipsoids(take.scene)
        numbers = takes.list_fingers(bed, self.take, len(fingers)) if recorded else ()
        bake.apply(bed, moments, self.first, fingers, numbers)
        count = len(moments.height)
        last = self.first + count - 1
        inform(self, "Baked {} frames, {} to {}", count, self.first, last)


@action("digiclay.bake_free", "Free Bake", cannot_change, no_bake)
def free_bake(operator: Operator, context: Context) -> None:
    """Remove the bake: the bed shows its own state again. Keyframes of the fingertip stay"""
    bake.free(bed_of(context))


class ExportAnimation(SteppedAction, Operator):
    """Write a session as an animated file: the bake, or else the recording so far, or else the last take"""

    bl_idname = "export_anim.digital_clay"
    bl_label = "Export Animation"
    bl_options = {"REGISTER"}
    needs = cannot_measure, no_motion

    take: text("Take", "Number of the take to be written; empty: the bake, recording or last take")
    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    check_existing: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    file_format: choice(
        "Format",
        "Format of the file",
        items=[(name, name.upper(), "") for name in SUFFIXES],
        default="usd",
    )
    kind: choice(
        "Mesh",
        "Kind of mesh that moves",
        items=[
            ("pins", "Pins", "Instances of one mesh"),
            ("surface", "Skin", "Skin over the pins"),
        ],
        default="pins",
    )
    unit: UNIT
    #: Whether the file browser is open.
    browses = False

    def invoke(self, context: Context, event: Event) -> Result:
        """Open the file browser, with the name of the bed; with a path, begin."""
        if self.filepath:
            return super().invoke(context, event)
        self.browses = True
        self.filepath = bpy.path.clean_name(bed_of(context).name) + SUFFIXES[self.file_format]
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: Context) -> Result:
        """Write at once; from the file browser, in steps."""
        if not self.browses:
            return super().execute(context)
        result: Result = bpy.ops.export_anim.digital_clay("INVOKE_DEFAULT", **self.as_keywords())
        return result - {"RUNNING_MODAL"} or {"FINISHED"}

    def cancel(self, context: Context) -> None:
        """Take back what shows the progress, of which the file browser has none."""
        if not self.browses:
            super().cancel(context)

    def work(self, context: Context) -> Generator[float, None, None]:
        """Find the heights of all frames, which may need a simulation, and write them."""
        bed, file, rate = bed_of(context), self._choose_file(), bake.read_rate(context.scene)
        if bake.is_baked(bed) and not self.take:
            position, height = bake.read_moments(bed)
        else:
            for part in bake.simulate_frames(self._find_take(bed), rate):
                if isinstance(part, float):
                    yield part
                else:
                    position, height = part.position, part.height.astype(np.float64)
        model = formed_bed.model(bed, kind=self.kind)
        write_animation(file, animate(position, height, rate, model), self.file_format, self.unit)
        inform(self, "Written: {}", file)

    def _choose_file(self) -> Path:
        """Return the file with the extension of its format, which the name tells where none is given."""
        file = Path(bpy.path.abspath(self.filepath or "digital_clay"))
        named = ENDINGS.get(file.suffix.lower())
        if named and not self.properties.is_property_set("file_format"):
            self.file_format = named
        stem = file.with_suffix("") if named else file
        return Path(f"{stem}{SUFFIXES[self.file_format]}")

    def _find_take(self, bed: Object) -> Take:
        """Return the recording so far, if there is one and no take is asked for; else the take."""
        session = running.find(bed)
        recording = takes.read_recording(session) if session and not self.take else None
        return recording or takes.read(bed, self.take)
