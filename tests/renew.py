"""Numbers that tests compare with, made anew after a change that is meant: ``python -m tests.renew``.

It writes the golden run, `samples/golden.json`, and what is simulated anew from samples of old
formats: heights and forces of states and takes, histories and metrics of runs. The files of old
formats stay as they are. Commit the differences with their reason, and add it to
`samples/README.md`.
"""

import json
from pathlib import Path

import numpy as np
from digiclay.core.base.quantity import list_quantities
from digiclay.core.control.methods import METHODS
from digiclay.core.engine.simulation import periods
from digiclay.core.model.valve import Fluid
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import load
from digiclay.core.scene.schema import SECTIONS, import_parameters
from digiclay.core.session import snapshot
from digiclay.core.session.accuracy import estimate_errors
from digiclay.core.session.run_scene import run
from digiclay.core.session.take import from_bytes, replay

from tests.assemble import one_cell, path, record, sample, scripted

SAMPLES = Path(__file__).parent / "samples"
GOLDEN = SAMPLES / "golden.json"
#: Remedy that the tests of these numbers print.
REMEDY = "If the change is meant, 'python -m tests.renew' writes the numbers anew."


def run_golden(*settings):
    """Return forces, N, and heights, mm, of the first nine seconds of the paper's session.

    ``forces``: in total, every second; ``heights``: at the end, of every eighth pin that is off its
    rest by more than 1 mm; ``weighed``: sum over all rows and cells of force times row times cell,
    both from 0 to 1.
    """
    history = run(sample("ridge_mound_valley", "simulation.duration=9", *settings)).history
    height, force = history["height"][-1], history["force"]
    return {
        "forces": history["total_force"][::200].tolist(),
        "heights": (height[np.abs(height - 40e-3) > 1e-3][::8] * 1e3).tolist(),
        "weighed": float(
            np.linspace(0.0, 1.0, len(force)) @ force @ np.linspace(0.0, 1.0, force.shape[1])
        ),
    }


def run_turbulent():
    """Return heights, mm, and forces, N, of a pin that is pressed while its valve follows a script."""
    system = one_cell(
        fluid=Fluid(viscosity=1.6e-9), control=scripted(lambda t, x, y: 0.05 * np.sin(40.0 * t))
    )
    done = record(
        system, path((0.0, 0.0, 0.0, 40.2), (0.2, 0.0, 0.0, 37.5), (0.4, 0.0, 0.0, 39.5)), 80
    )
    return {
        "scripted_heights": (done.height[::10, 0] * 1e3).tolist(),
        "scripted_forces": done.force[::10, 0].tolist(),
    }


def list_declarations():
    """Return default, unit and bounds of every parameter of a scene, by section, method and name."""
    return {
        f"{section} {method} {name}": [
            getattr(kind(), name),
            known.unit,
            dict(known.list_bounds()),
            list(known.choices),
        ]
        for section in SECTIONS
        for method in (METHODS if section == "control" else ("",))
        for kind in [import_parameters(section, method or "virtual_master")]
        for name, known in list_quantities(kind).items()
    }


def go_on(file):
    """Return heights and forces of 50 periods from a state, or heights of a take, every tenth row."""
    if file.suffix == ".take":
        return {
            "height": np.array(
                [state.row(0) for state in replay(from_bytes(file.read_bytes()))][::10]
            )
        }
    scene = load(file.with_suffix(".toml"))
    system = assemble(scene)
    rows = [
        (state.row(0), state.row(system.rows.force))
        for state in periods(
            system, scene.trajectories(), snapshot.load(system, file.read_bytes()), 50
        )
    ]
    return {
        "height": np.array([row for row, _ in rows][::10]),
        "force": np.array([row for _, row in rows][::10]),
    }


def run_again(scene, metrics):
    """Return the run of a scene, with its errors where its metrics have them."""
    result = run(scene)
    errors = estimate_errors(scene, result.history) if "height_error" in metrics else None
    return result.with_errors(errors) if errors else result


def collect_golden():
    """Return the present numbers and declarations."""
    return {**run_golden(), **run_turbulent(), "parameters": list_declarations()}


def renew():
    """Write all of it."""
    GOLDEN.write_text(json.dumps(collect_golden(), indent=1) + "\n", encoding="utf-8")
    for file in sorted([*SAMPLES.glob("states/*.state"), *SAMPLES.glob("takes/*.take")]):
        stored = dict(np.load(file.with_suffix(".npz")))
        np.savez_compressed(file.with_suffix(".npz"), **{**stored, **go_on(file)})
    for file in sorted(SAMPLES.glob("runs/*/metrics.json")):
        text = file.read_text(encoding="utf-8")
        metrics = json.loads(text)
        result = run_again(load(file.with_name("scene.toml")), metrics)
        # What says when and where it was run stays, and so does what an older version did not
        # measure.
        kept = ("run_time", "real_time_factor", "versions", "units")
        metrics |= {name: result.metrics[name] for name in metrics if name not in kept}
        end = "\n" if text.endswith("\n") else ""
        file.write_text(json.dumps(metrics, indent=2, ensure_ascii=False) + end, encoding="utf-8")
        if result.history:
            older = np.load(file.with_name("history.npz"))
            np.savez_compressed(
                file.with_name("history.npz"), **{name: result.history[name] for name in older}
            )


if __name__ == "__main__":
    renew()
