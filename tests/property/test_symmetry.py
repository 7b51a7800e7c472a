"""Mirrored and rotated scenes give mirrored and rotated results."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from digiclay.core.base.arrays import Floats
from digiclay.core.control.blister import Blister
from digiclay.core.control.virtual_master import VirtualMaster
from digiclay.core.model.layout import Layout
from digiclay.core.model.trajectory import Trajectory

from tests.assemble import make_system, record

#: Press, lift, drag, lift off: off the cells' axes, tilted. Time, x, y, z in mm, then the quaternion.
WAYPOINTS = np.array(
    [
        (0.0, -5.3, 3.1, 42.0, 0.97, 0.1, 0.2, 0.0), (0.25, -5.3, 3.1, 35.5, 0.97, 0.1, 0.2, 0.0),
        (0.6, -5.3, 3.1, 39.5, 0.97, 0.0, 0.2, 0.1), (1.2, 4.4, -1.7, 40.0, 0.95, -0.1, 0.2, 0.2),
        (1.4, 4.4, -1.7, 60.0, 0.95, -0.1, 0.2, 0.2),
    ]
)  # fmt: skip
COUNT = 260


#: A press in the middle of the bed, of the waypoints.
MIDDLE = [1, 0, 0, 1, 1, 0, 0, 0]
#: What a mirror across x, or across y, makes of a waypoint.
MIRRORED_X, MIRRORED_Y = np.array([1, -1, 1, 1, 1, 1, -1, -1]), np.array([1, 1, -1, 1, 1, -1, 1, -1])


def turned(points: Floats) -> Floats:
    """Return waypoints turned by 90 degrees about z: (x, y) to (-y, x)."""
    t, x, y, z, *q = points.T
    half = np.sqrt(0.5)
    w, qx, qy, qz = q
    turn = [half * (w - qz), half * (qx - qy), half * (qx + qy), half * (w + qz)]
    return np.column_stack([t, -y, x, z, *turn])


#: Name: arrangement, shape of the bed, what is done to the path, and to rows and columns of cells.
CASES: dict[str, tuple[str, tuple[int, int], Callable[[Floats], Floats], Callable[[Floats], Floats]]] = {
    "mirrored": ("aligned", (9, 12), lambda p: p * MIRRORED_X, lambda h: h[:, :, ::-1]),
    "mirrored, odd": ("aligned", (11, 11), lambda p: p * MIRRORED_X, lambda h: h[:, :, ::-1]),
    "rotated by 90": ("aligned", (11, 11), turned, lambda h: h.transpose(0, 2, 1)[:, :, ::-1]),
    "rotated by 180": ("aligned", (9, 12), lambda p: turned(turned(p)), lambda h: h[:, ::-1, ::-1]),
    "hexagonal, mirrored": ("hexagonal", (11, 12), lambda p: p * MIRRORED_Y, lambda h: h[:, ::-1, :]),
    "staggered, rotated": ("staggered", (10, 12), lambda p: turned(turned(p)), lambda h: h[:, ::-1, ::-1]),
}


def formed(arrangement: str, shape: tuple[int, int], points: Floats, profile: str) -> tuple[Floats, Floats]:
    """Return heights and forces, shape (t, rows, columns)."""
    system = make_system(
        Layout(*shape, 3e-3, arrangement), control=VirtualMaster(), blister=Blister(profile=profile)
    )
    run = record(system, Trajectory(points[:, 0], points[:, 1:4] * 1e-3, points[:, 4:]), COUNT)
    return run.height.reshape(-1, *shape), run.force.reshape(-1, *shape)


@pytest.mark.parametrize(
    ("case", "points", "profile"),
    [
        *((case, WAYPOINTS, "cone") for case in CASES if case != "mirrored, odd"),
        ("mirrored", WAYPOINTS, "gaussian"),
        # A press on a cell in the middle: cells lie exactly on the circles of the control here.
        *(
            ("mirrored, odd", WAYPOINTS * [1, 0, 0, 1, 1, 0, 0, 0], profile)
            for profile in ("cone", "gaussian")
        ),
    ],
)
def test_a_moved_scene_gives_the_moved_result(case: str, points: Floats, profile: str) -> None:
    arrangement, shape, points_moved, cells_moved = CASES[case]
    height, force = formed(arrangement, shape, points, profile)
    moved_height, moved_force = formed(arrangement, shape, points_moved(points), profile)
    assert np.ptp(height[-1]) > 1e-3
    # Rounding of positions, 1e-17 m, through 260 periods of a closed loop; forces grow e-fold in 0.5 mm.
    assert np.abs(moved_height - cells_moved(height)).max() < 1e-12
    assert np.abs(moved_force - cells_moved(force)).max() < 1e-10
