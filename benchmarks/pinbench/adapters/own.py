"""Adapter: digiclay."""

from typing import Any

import numpy as np
from digiclay.core.base.errors import DivergenceError
from digiclay.core.files.tables import Record
from digiclay.core.scene.toml_table import resolve

from ...session_parts import run

STEPS = (5e-3, 2.5e-3, 1e-3, 5e-4)
METHODS = {
    "digiclay": (*STEPS, 1e-4),
    "digiclay richardson": STEPS,
    "digiclay runge_kutta_4": STEPS,
    "digiclay heun": STEPS,
    "digiclay euler": STEPS,
    "digiclay adaptive": (1e-5, 1e-6, 1e-7),
}


def prepare(problem: Any, method: str, setting: float) -> Any:
    """Return what integrates a problem once at a physics step, s, or adaptive's tolerance, m."""
    scene = resolve(make_tables(problem.file, method.partition(" ")[2] or "bernoulli", setting))
    shape = problem.count, problem.places[0].size
    commands = np.broadcast_to(problem.commands, shape)

    def solve() -> Any:
        system, states = run(scene, commands)
        read, rows = (0, system.rows.force), []
        try:
            for period, state in enumerate(states, 1):
                if period in problem.judged:
                    rows.append([state.row(row)[problem.pins] for row in read])
        except DivergenceError:
            return np.full((len(problem.judged), 2, problem.pins.size), np.inf)
        return rows

    return solve


def make_tables(file: Record, stepper: str, step: float) -> Record:
    """Return the tables of a scene file."""
    absent = ("recorder", "control", "valve_lag", "delay", "relaxation")
    tables: Record = dict.fromkeys(absent, "absent")
    tables |= {"layout": file["bed"], "actuator": file["pin"], "fingertip": file["fingertip"]}
    exponent, unit = file["contact"]["exponent"], file["contact"]["unit"]
    tables["contact"] = {"stiffness": exponent * unit, "exponent": exponent, "share": 1.0}
    tables |= make_valve(file)
    tables |= {"relaxation": file["relaxation"]} if "relaxation" in file else {}
    tables |= {"valve_lag": {"time_constant": file["lag"]}} if file.get("lag") else {}
    tables |= {"delay": {"dead_time": file["dead_time"]}} if file.get("dead_time") else {}
    chosen = {"tolerance": step} if stepper == "adaptive" else {"physics_step": step}
    tables["simulation"] = {"control_period": file["period"], "stepper": stepper, **chosen}
    tables["trajectory"] = {
        "interpolation": "linear",
        "waypoints": [{"time": t, "position": xyz} for t, *xyz in file["path"]],
    }
    return tables


def make_valve(file: Record) -> Record:
    """Return the tables of a valve with given coefficients; a damper is one that is open to no pressure."""
    density, viscosity, diameter = 855.0, 1.6e-6, 0.5e-3
    area = np.pi * file["pin"]["bore"] ** 2 / 4.0
    damper = {"laminar": area**2 / file.get("damping", 1.0), "turbulent": 1e-6, "conduit": 0.0}
    valve = file.get("valve", damper)
    term = 4.0 * valve["turbulent"] * np.sqrt(density / 2.0)
    stroke = term**2 / (8.0 * 200.0**2 * density * viscosity * valve["laminar"])
    length = valve["conduit"] * np.pi * 1e-3**4 / (128.0 * density * viscosity)
    return {
        "valve": {"discharge_slope": float(term / (np.pi * diameter**2)), "stroke": float(stroke)},
        "conduit": {"length": float(length), "diameter": 1e-3},
        "supply": file.get("supply", {"high": 1.0, "low": 0.0}),
    }
