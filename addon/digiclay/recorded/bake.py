"""Bake of a session into the bed: ordinary animation, played and rendered without the simulation."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import bridge
from ..bridge import WRITTEN
from ..compat import (
    Modifier,
    NodeTree,
    Object,
    Scene,
    bpy,
    curves,
    keyframe_node_setting,
    own_curves,
    set_node_setting,
)
from ..core.base.arrays import Cells, Flags, Floats, Modes
from ..core.base.errors import DigiclayError
from ..core.engine.bodies import Knot, find_given
from ..core.model.fingertip import Fingertip
from ..core.model.layout import make_grid
from ..core.scene.assembly import assemble
from ..core.scene.schema import Scene as DeviceScene
from ..core.session.take import Take, play
from ..device import pressers, view
from ..device.node_tree import (
    attribute,
    enabled,
    finish,
    mesh_of,
    new_tree,
    node,
    number,
    sample,
    socket,
    store,
)
from ..roles import BAKE, PALM, ROLE, fingertips_of, owner_of

#: The setting that is keyframed: which moment to show, from 0 on; between two of them heights are
#: blended.
MOMENT = "Moment"


def playback_nodes(bake: Object, moments: int) -> NodeTree:
    """Make the node group that moves the pins of a bed to where object `bake` has them at a moment."""
    tree = new_tree("Digital Clay Bake")
    socket(tree, MOMENT, "NodeSocketFloat", 0.0, "Which baked moment to show, counted from 0")
    settings, table = node(tree, "NodeGroupInput"), mesh_of(tree, bake)
    cells = settings.outputs["Geometry"]

    least = number(tree, "MAXIMUM", settings.outputs[MOMENT], 0.0)
    moment = number(tree, "MINIMUM", least, float(moments - 1))
    before, after = number(tree, "FLOOR", moment), number(tree, "CEIL", moment)
    part = number(tree, "SUBTRACT", moment, before)
    count = node(tree, "GeometryNodeAttributeDomainSize", {"Geometry": cells}).outputs[
        "Point Count"
    ]
    pin = node(tree, "GeometryNodeInputIndex").outputs["Index"]
    first = number(tree, "MULTIPLY_ADD", before, count, pin)
    second = number(tree, "MULTIPLY_ADD", after, count, pin)

    position = node(tree, "GeometryNodeInputPosition").outputs["Position"]
    ends = {
        "A": sample(tree, table, position, "FLOAT_VECTOR", first),
        "B": sample(tree, table, position, "FLOAT_VECTOR", second),
    }
    blend = node(tree, "ShaderNodeMix", {"Factor": part, **ends}, data_type="VECTOR")
    moved = {"Geometry": cells, "Position": enabled(blend.outputs, "Result")}
    shown = node(tree, "GeometryNodeSetPosition", moved).outputs["Geometry"]
    for name, (kind, _, _) in WRITTEN.items():
        value = sample(tree, table, attribute(tree, name, kind), kind, first)
        shown = store(tree, shown, name, kind, value)
    finish(tree, shown)
    return tree


#: Name of the modifier.
MODIFIER = "Baked session"
#: Longest time between two readings of pressers, s.
INTERVAL = 15e-3
#: Frame ranges longer than this are a slip of the hand: an hour at 60 frames a second.
MOST_FRAMES = 216_000


class AnimatedPath(NamedTuple):
    """Poses of animated fingertips (t + 1, f, 7), and pressers."""

    poses: Floats
    knots: tuple[Knot, ...]


@dataclass(frozen=True, eq=False)
class BakedFrames:
    """Content of a bake, one row per frame."""

    #: (n, 2), axes of the pins, m.
    position: Floats
    #: (t, n), m.
    height: NDArray[np.float32]
    #: (t, n).
    mode: Modes
    #: (t, n), N.
    force: NDArray[np.float32]
    #: (t, n), whether they wait for their drive.
    waiting: Flags
    #: (t, f, 7), of the fingertips.
    pose: Floats


def frame_periods(take: Take, rate: float) -> Cells:
    """Return the control period, 0 to t, that each frame of a take shows at a rate, 1/s: the nearest one."""
    period = take.scene.simulation.control_period
    count = int(np.floor(take.duration * rate + 1e-6)) + 1
    return np.asarray(
        np.minimum(np.rint(np.arange(count) / (rate * period)), take.periods), np.intp
    )


def simulate_frames(take: Take, rate: float) -> Iterator[float | BakedFrames]:
    """Simulate a take; yield the share done after each control period, and at last the `BakedFrames`."""
    wanted = frame_periods(take, rate)
    grid = make_grid(take.scene.layout)
    count = grid.count
    height = np.empty((wanted.size, count), np.float32)
    force, mode = np.empty_like(height), np.empty((wanted.size, count), np.int8)
    waiting = np.empty(mode.shape, np.bool_)
    frame = 0
    for period, (system, state) in enumerate(play(take)):
        while frame < wanted.size and wanted[frame] == period:
            height[frame], force[frame] = state.row(0), state.row(system.rows.force)
            mode[frame], waiting[frame] = state.mode(), state.waiting()
            frame += 1
        yield period / take.periods
    yield BakedFrames(grid.positions, height, mode, force, waiting, take.poses[wanted])


def apply(
    bed: Object,
    moments: BakedFrames,
    first: int,
    fingers: Sequence[Fingertip],
    numbers: Sequence[int],
) -> None:
    """Give a bed a bake from a frame on, in place of an older one, and some fingertips keyframes."""
    free(bed)
    count = len(moments.height)
    source = _make_source(moments)
    sources = view.sources_of(bed)
    if sources is not None:
        # As `view.hold_parts` has it: appended, the bed leaves it out of the scene.
        sources.objects.link(source)
    play_moments(bed, source, first, count)
    tips = [tip for number, tip in fingertips_of(bed).items() if number in numbers]
    moving = [*dict.fromkeys(filter(None, (owner_of(tip, PALM) for tip in tips))), *tips]
    for thing in moving:
        thing.animation_data_clear()
        thing.rotation_mode = "QUATERNION"
        for constraint in thing.constraints:
            constraint.mute = True
    for row, poses in enumerate(moments.pose if tips else ()):
        bridge.place_fingertips(bed, poses, fingers, numbers)
        for thing in moving:
            thing.keyframe_insert("location", frame=first + row)
            thing.keyframe_insert("rotation_quaternion", frame=first + row)


def play_moments(thing: Object, source: Object, first: int, count: int) -> None:
    """Have the points of an object move from a frame on as a source, of the role BAKE, has them."""
    thing.modifiers.new(MODIFIER, "NODES").node_group = playback_nodes(source, count)
    thing.modifiers.move(len(thing.modifiers) - 1, 0)
    modifier = thing.modifiers[0]
    own_curves(thing)
    for row in (0, count - 1):
        set_node_setting(modifier, MOMENT, float(row))
        keyframe_node_setting(modifier, MOMENT, first + row)
    for _, curve in _curves(thing):
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def is_baked(bed: Object) -> bool:
    """Return whether a bed plays a bake."""
    return _modifier(bed) is not None


def read_moments(bed: Object) -> tuple[Floats, Floats]:
    """Return the positions (n, 2) and heights (t, n) of a baked bed, m."""
    modifier, count = _modifier(bed), len(bed.data.vertices)
    source = modifier and _source(modifier.node_group)
    assert source is not None  # it is baked
    cells = bridge.read_cells(source.data)
    return cells["position"][:count], cells["height"].reshape(-1, count)


def free(bed: Object) -> bool:
    """Take a bed's bake away; return whether it had one. Keyframes of the fingertip stay."""
    modifier = _modifier(bed)
    if modifier is None:
        return False
    own_curves(bed)
    for owner, curve in list(_curves(bed)):
        owner.remove(curve)
    tree = modifier.node_group
    bed.modifiers.remove(modifier)
    if not tree.users:
        source = _source(tree)
        bpy.data.node_groups.remove(tree)
        if source is not None and source.users == len(source.users_collection):
            bpy.data.meshes.remove(source.data)  # takes the object along
    return True


def read_rate(scene: Scene) -> float:
    """Return the frames of a scene per second; DigiclayError where its time is stretched."""
    render = scene.render
    if render.frame_map_old != render.frame_map_new:
        got = f"{render.frame_map_old} to {render.frame_map_new}"
        raise DigiclayError(f"The scene's Time Stretching must have two equal numbers (got {got}).")
    return float(render.fps / render.fps_base)


def sample_path(
    scene: Scene, bed: Object, first: int, last: int, device: DeviceScene
) -> Iterator[float | AnimatedPath]:
    """Read fingertips and pressers of a bed as animated; yield the share done, and their paths at last."""
    if not 0 < last - first <= MOST_FRAMES:
        rule = f"must have from 1 to {MOST_FRAMES} frames after its first"
        raise DigiclayError(f"The frames to bake {rule} (got {first} to {last}).")
    rate = read_rate(scene)
    period, system = device.simulation.control_period, assemble(device)
    count = int(np.ceil((last - first) / rate / period - 1e-6))
    knots: list[Knot] = []
    given, every, aim = find_given(system), max(1, int(INTERVAL / period)), None
    frame_before = scene.frame_current, scene.frame_subframe
    tips = len(fingertips_of(bed))
    if not tips:
        raise DigiclayError(f"{bed.name} has no fingertip: undo its removal.")
    poses = np.empty((count + 1, tips, 7))
    try:
        for row in range(count + 1):
            whole, part = divmod(first + row * period * rate, 1.0)
            scene.frame_set(int(whole), subframe=part)
            poses[row] = bridge.poses(bed)
            if given and (row % every == 0 or row == count):
                if fault := pressers.find_fault(bpy.context, bed):
                    raise DigiclayError(fault)
                aim = pressers.read_pressers(bpy.context, bed, aim)
                assert aim is not None  # there are bodies
                if row == 0:
                    pressers.refuse_sunk(bed, system, aim)
                knots.append((row, given.condense(aim, knots[0][1] if knots else aim)))
            yield row / count
    finally:
        scene.frame_set(frame_before[0], subframe=frame_before[1])
    yield AnimatedPath(poses, tuple(knots))


def _modifier(bed: Object) -> Modifier | None:
    """Return the modifier that plays a bake, whatever its name is now, or None."""
    for modifier in bed.modifiers:
        if (
            modifier.type == "NODES"
            and modifier.node_group
            and _source(modifier.node_group) is not None
        ):
            return modifier
    return None


def _source(tree: NodeTree) -> Object | None:
    """Return the object that holds the baked pins a tree plays, or None when it plays none."""
    infos = [item for item in tree.nodes if item.bl_idname == "GeometryNodeObjectInfo"]
    sources = (info.inputs["Object"].default_value for info in infos)
    return next(
        (source for source in sources if source is not None and source.get(ROLE) == BAKE), None
    )


def _curves(bed: Object) -> Iterator[tuple[Any, Any]]:
    """Give the curves that drive a bed's bake, each with what it can be removed from."""
    modifier = _modifier(bed)
    start = f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"]' if modifier else None
    for group in curves(bed):
        yield from (
            (group, curve) for curve in group if start and curve.data_path.startswith(start)
        )


def _make_source(moments: BakedFrames) -> Object:
    """Make the object that holds the pins moment after moment; it stands in no scene."""
    count, pins = moments.height.shape
    mesh = bridge.points("Digital Clay Bake", count * pins)
    bridge.write_cells(
        mesh,
        np.tile(moments.position, (count, 1)),
        moments.height.ravel().astype(np.float64),
        mode=moments.mode.ravel(),
        force=moments.force.ravel(),
        waiting=moments.waiting.ravel(),
    )
    bake = bpy.data.objects.new(mesh.name, mesh)
    bake[ROLE] = BAKE
    return bake
