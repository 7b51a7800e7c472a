"""Display of a shape on a bed in Blender, from an object or a file."""

from collections import deque
from dataclasses import replace

import numpy as np

from .. import bridge
from ..compat import Depsgraph, Object
from ..core.base.errors import DigiclayError, ParameterError
from ..core.engine.bodies import PlacedMesh
from ..core.engine.simulation import begin, periods
from ..core.model.layout import make_grid
from ..core.model.trajectory import make_level
from ..core.model.underside import Mesh
from ..core.scene.assembly import assemble
from ..core.scene.forming import compute_display_time, find_display, find_touch_height
from ..core.scene.schema import Scene
from ..core.session import snapshot
from ..core.shapes.fitting import Fitted, Relief, fit_relief, fit_shape, pack
from ..core.shapes.mesh_relief import ShapeMesh, make_shape_mesh
from ..core.shapes.request import Shape
from ..device import view
from ..device.instant import CLEARANCE, find_ellipsoids
from ..live import beds
from ..roles import ROLE, fingertips_of
from ..sessions import sculpting
from ..settings import properties

#: Kinds of objects that have a surface.
SURFACED = ("MESH", "CURVE", "SURFACE", "FONT", "META")
#: Simulated time after which a shape that does not stand is shown as far as it has come, s.
LONGEST = 60.0
#: The fingertip waits so far above the bed while the shape comes up, m.
AWAY = 50.0


def has_surface(thing: Object) -> bool:
    """Return whether an object has a surface that can be displayed."""
    return thing is not None and thing.type in SURFACED and ROLE not in thing


def read_relief(thing: Object, bed: Object, depsgraph: Depsgraph) -> ShapeMesh:
    """Return the surface of an object, all modifiers included, in the space of a bed, m."""
    evaluated = thing.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    if mesh is None:
        raise ParameterError("shape", "file", "must be an object with a surface", thing.name)
    try:
        placed = PlacedMesh(Mesh(*bridge.read_triangles(mesh)), bridge.read_place(bed, thing))
    finally:
        evaluated.to_mesh_clear()
    return make_shape_mesh(thing.name, placed.vertices, placed.mesh.triangles, "z", 1.0)


def show_relief(bed: Object, relief: Relief, shape: Shape) -> tuple[Fitted, float]:
    """Display a relief on a bed as `shape` requests; return the fit, and what the display is off by, m."""
    scene = properties.scene_of(bed)
    return _show(
        bed, scene, shape, fit_relief(shape, relief, make_grid(scene.layout), scene.actuator)
    )


def show_file(bed: Object, shape: Shape) -> tuple[Fitted, float]:
    """Display the shape of a file or sample on a bed; see `show_relief`."""
    scene = properties.scene_of(bed)
    return _show(bed, scene, shape, fit_shape(shape, make_grid(scene.layout), scene.actuator))


def _show(bed: Object, scene: Scene, shape: Shape, laid: Fitted) -> tuple[Fitted, float]:
    """Drive the pins of a bed to a shape, and keep shape and state in the bed."""
    # Pressers wait as well, wherever they are.
    scene = replace(scene, bodies=(), shape=replace(shape, heights=pack(laid.heights)))
    system = assemble(scene)
    display = find_display(system)
    assert display is not None
    fingers = [make_level(np.zeros(1), np.array([[0.0, 0.0, AWAY]]))] * len(scene.fingers)
    count = min(compute_display_time(display), LONGEST) / system.period
    (state,) = deque(periods(system, fingers, begin(system), max(1, round(count))), maxlen=1)
    off = float(np.abs(state.row(0) - display.heights).max())
    poses, grid = bridge.poses(bed), make_grid(scene.layout)
    for pose, finger in zip(poses, find_ellipsoids(scene), strict=True):
        # The fingertip rises where the shape is higher.
        touch = find_touch_height(grid, state.row(0), finger, float(pose[0]), float(pose[1]))
        pose[2] = max(pose[2], touch + CLEARANCE)
    # All that can fail is done: from here on the bed changes.
    properties.write_scene(bed, scene)
    began, problem = sculpting.begin_session(
        bed.session_uid,
        bed.name,
        scene,
        poses,
        snapshot.dump(system, state),
        beds.read_tick(bed),
        tuple(fingertips_of(bed)),
    )
    if problem:
        raise DigiclayError(f"{bed.name}: {problem}")
    beds.write(bed, began)
    view.show_state(bed, system, began.state)
    bridge.place_fingertips(bed, poses, find_ellipsoids(scene))
    return laid, off
