"""Sessions with controllers made for another device than the one they control."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from digiclay.core.engine.simulation import begin, periods
from digiclay.core.metrics.force import compute_rfd
from digiclay.core.model.control_interface import Controller, find_set_point
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.schema import Scene


def change_finger(scene: Scene, part: str, **factors: float) -> Scene:
    """Return a scene with some numbers of a part of its finger times a factor."""
    known = scene.section(part)
    return scene.with_sections(
        **{part: replace(known, **{name: getattr(known, name) * by for name, by in factors.items()})}
    )


def list_models(true: Scene) -> dict[str, Scene]:
    """Return scenes that differ from the true one, for controllers made for them."""
    sizes = ("length", "width", "height")
    # The laminar flow goes with the fourth power of the diameter.
    valves = {
        f"valve × {share}": replace(
            true, valve=replace(true.valve, orifice_diameter=true.valve.orifice_diameter * share**0.25)
        )
        for share in (0.7, 1.3, 3)
    }
    return {
        **valves,
        "pulp stiffness × 0.5": change_finger(true, "contact", stiffness=0.5),
        "pulp stiffness × 2": change_finger(true, "contact", stiffness=2.0),
        "exponent × 0.7": change_finger(true, "contact", exponent=0.7),
        "exponent × 1.4": change_finger(true, "contact", exponent=1.4),
        "fingertip × 0.75": change_finger(true, "fingertip", **dict.fromkeys(sizes, 0.75)),
        "fingertip × 1.3": change_finger(true, "fingertip", **dict.fromkeys(sizes, 1.3)),
        "length × 1.5": change_finger(true, "fingertip", length=1.5),
        "width × 0.6": change_finger(true, "fingertip", width=0.6),
    }


def run_mismatched(true: Scene, model: Scene) -> dict[str, float | None]:
    """Return the figures of a session whose controller is made for another device.

    `true`: the device, and the fingertip's path; `model`: the device that the controller is made for.
    """
    controller = assemble(model).controller
    assert controller is not None  # scenes of the benchmark have one
    return run_controller(true, controller)


def run_controller(
    scene: Scene, controller: Controller, phase: Sequence[float] | None = None
) -> dict[str, float | None]:
    """Return RFD, losses and largest force of a session with a controller in place of the scene's.

    `phase`: when the part starts and ends whose RFD is taken, over all its rows, s; by default rows in
    contact.
    """
    system = replace(assemble(scene), controller=controller)
    forces, losses = [], 0
    for state in periods(system, scene.trajectories(), begin(system), scene.periods):
        forces.append(float(state.active.all.force.sum()))
        losses = state.memory.losses
    total = np.array(forces)
    wanted = find_set_point(scene.set_point, total)
    moments = np.arange(1, total.size + 1) * system.period
    rows = None if phase is None else (moments >= phase[0]) & (moments <= phase[1])
    rfd = compute_rfd(moments, total, wanted, rows)
    return {"rfd": rfd, "losses": float(losses), "max_total_force": float(total.max())}
