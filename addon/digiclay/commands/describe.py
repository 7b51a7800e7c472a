"""``digiclay describe``: parts and null parts of a scene, and their cost."""

import argparse
import math
import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..core.base.quantity import Parameters, Quantity, list_quantities
from ..core.control.virtual_master import make_master_cell
from ..core.engine.system import System
from ..core.model.laws import select_law
from ..core.scene.assembly import assemble
from ..core.scene.schema import LATER, SECTIONS, Scene
from ..core.session.memory_limit import (
    count_busy_cells,
    count_bytes_needed,
    measure_available_memory,
)
from ..core.session.plate import list_cautions
from ..core.shapes.body import read_bodies
from ..core.shapes.fitting import fit_shape
from .arguments import add_scene, command, scene_of

EXAMPLES = """\
examples:
  digiclay describe ridge_mound_valley
  digiclay describe my.toml --set relaxation=absent
  digiclay describe my.toml --parameters
"""
#: Sections of the scene along the line from finger to pins, and names of places that are others.
PLACES = (
    "hand",
    "fingertip",
    "contact",
    "relaxation",
    "actuator",
    "supply",
    "fluid",
    "valve",
    "conduit",
    "valve_lag",
    "delay",
    "drive",
    "sensors",
    "control",
    "blister",
    "recorder",
)
NAMES = {
    "fingertip": "finger",
    "valve_lag": "valve lag",
    "delay": "dead time",
    "control": "controller",
}
#: Force on a pin at which the stiffness felt is told, N.
FELT = 0.05
#: Units people read: factor and name.
READ = {
    "m": (1e3, "mm"),
    "s": (1e3, "ms"),
    "Pa": (1e-5, "bar"),
    "m3": (1e9, "mm3"),
    "m2/s": (1e6, "mm2/s"),
    "m/s": (1e3, "mm/s"),
    "kg": (1e3, "g"),
}


@command(
    "list the parts of a scene and their parameters",
    EXAMPLES,
    add_scene,
    {"--parameters": "each key with its value, range, meaning and source instead"},
)
def carry_out(arguments: argparse.Namespace) -> int:
    """Describe."""
    scene, _ = scene_of(arguments)
    lines = list_parameters(scene) if arguments.parameters else description(scene, assemble(scene))
    print("\n".join(lines))
    return 0


def list_parameters(scene: Scene) -> Iterator[str]:
    """Give two lines for each parameter of the parts of a scene: key and value; meaning, range, source."""
    yield "Sources: P the paper, D derived, C chosen, or a reference of docs/nomenclature.md."
    for section in SECTIONS:
        for fingers, part in _list_parts(scene, section):
            owner = f"finger #{fingers}.{section}" if fingers else section
            for name, declared in list_quantities(part).items() if part else ():
                yield f"{owner}.{name} = {write_value(getattr(part, name))} {declared.unit}".rstrip()
                parts = describe_meaning(declared), write_range(declared), declared.source
                text = "; ".join(filter(None, parts))
                yield textwrap.fill(text, 110, initial_indent="    ", subsequent_indent="    ")


def _list_parts(scene: Scene, section: str) -> list[tuple[str, Any]]:
    """Return the different parts of a section, and the numbers of their fingers where several differ."""
    owners: dict[Any, list[str]] = {}
    for number, part in enumerate(scene.list_parts(section), 1):
        owners.setdefault(part, []).append(str(number))
    return [
        (", ".join(numbers) if len(owners) > 1 else "", part) for part, numbers in owners.items()
    ]


def describe_meaning(declared: Quantity) -> str:
    """Write the meaning of a parameter, with its choices."""
    return declared.doc + (f" ({', '.join(declared.choices)})" if declared.choices else "")


def write_value(value: object) -> str:
    """Write a value with the fewest digits that restore it."""
    if isinstance(value, tuple):
        return "[" + ", ".join(write_value(item) for item in value) + "]"
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def write_range(declared: Quantity) -> str:
    """Write the range of a parameter, in its unit."""
    return ", ".join(
        f"{word.replace('_', ' ')} {write_value(end)}" for word, end in declared.list_bounds()
    )


def description(scene: Scene, system: System) -> Iterator[str]:
    """Give the lines that describe a scene. `system`: assembled from it."""
    yield scene.name + (f": {scene.description.strip()}" if scene.description else "")
    yield f"\nThe line from finger to pins (preset {scene.preset})"
    for section in PLACES:
        for fingers, part in _list_parts(scene, section):
            if part is None and section in LATER:
                continue
            method = f"{scene.method}: " if section == "control" else ""
            parameters = "left out" if part is None else method + _parameters(part)
            text = f"of {fingers}: {parameters}" if fingers else parameters
            yield _filled(NAMES.get(section, section), text)
    if scene.shape:
        yield _filled("shape", fit_shape(scene.shape, system.grid, scene.actuator).describe())
    simulation = scene.simulation
    yield _filled("stepper", f"{system.stepper.name}, order {system.stepper.order}")
    yield "\nThe bed"
    layout = scene.layout
    pitch = human(layout.pitch, "m")
    yield f"  {layout.rows} x {layout.columns} = {scene.cells} cells, {pitch} apart, {layout.arrangement}"
    yield from (_filled("caution", text) for text in list_cautions(scene))
    yield "\nThe pins"
    for name, text in _pins(scene, system):
        yield _filled(name, text)
    yield "\nThe state of a cell"
    rows = ", ".join(
        f"{name} ({count})" if count > 1 else name for name, count in _rows(system) if count
    )
    yield f"  {system.rows.count} rows: {rows}; {8 * system.rows.count} bytes"
    yield "\nThe session"
    period, step = human(simulation.control_period, "s"), human(simulation.physics_step, "s")
    yield f"  {simulation.duration:g} s, {scene.periods} control periods of {period}, physics steps of {step}"
    for finger in scene.fingers:
        path, points = finger.trajectory, finger.trajectory.waypoints
        yield f"  {len(points)} waypoints, {path.interpolation}, the last at {points[-1].time:g} s"
    meshes = read_bodies(each.body for each in scene.bodies)
    for number, (each, mesh) in enumerate(zip(scene.bodies, meshes, strict=True), 1):
        name, last = each.body.file or "a packed mesh", each.trajectory.waypoints[-1].time
        sides = " x ".join(f"{1e3 * side:.3g}" for side in np.ptp(mesh.vertices, axis=0))
        yield f"  body {number}: {name}, {sides} mm, its path until {last:g} s"
    sizes = scene.cells, scene.periods, count_busy_cells(scene)
    needed = count_bytes_needed(scene.recorder, system.rows, *sizes)
    free = measure_available_memory()
    extent = (
        f"{scene.recorder.rows(scene.periods)} rows kept" if scene.recorder else "no history kept"
    )
    yield f"  {extent}; {size(needed)} of memory needed, {size(free)} free"


def _pins(scene: Scene, system: System) -> Iterator[tuple[str, str]]:
    """Give what a pin can do, and how long the bed takes over it."""
    actuator, supply = scene.actuator, system.cell.supply
    speed = make_master_cell(system.cell, system.period).speed
    up, down = speed(1.0), 0.0 - speed(-1.0)
    drive, turns, electric = scene.drive, 1, getattr(scene.valve, "law", "") == "motor"
    count, words = scene.cells, "one per pin"
    if drive is not None:
        lines, count = drive.count_lines(scene.layout), drive.count_valves(scene.layout)
        turns = drive.count_turns(scene.layout)
        words = f"for {scene.cells} pins in {lines} lines" if count < scene.cells else words
    yield "motors" if electric else "valves", f"{count}, {words}"
    full = "at full command" if electric else "valve wide open"
    speeds = f"{up * 1e3:.3g} mm/s up, {down * 1e3:.3g} mm/s down"
    yield "free speed", f"{speeds}, {full} and no load"
    lift, pull = supply.high * actuator.area, (0.0 - supply.low) * actuator.area
    yield "stall", f"{lift:.3g} N up, {pull:.3g} N down, {full}"
    if supply.locks:
        leak = 60e3 * down * (drive.leak if drive else 0.0)
        leaks = "" if electric else f"; leak without load: {leak:.3g} mm per minute"
        yield "command 0", f"holds any load, rigid{leaks}"
    else:
        yield "command 0", f"yields {1e3 * up / lift:.3g} mm/s per N"
    for fingers, contact in _list_parts(scene, "contact"):
        if contact is not None:
            law = select_law("contact", contact)
            first = law.share * law.stiffness
            yield (
                f"felt {fingers}".strip(),
                f"a held pin through the pulp: {first:.4g} N/m at first touch, "
                f"{first + law.exponent * FELT:.4g} N/m at {FELT:g} N",
            )
    volume, stroke = scene.cells * actuator.area * actuator.stroke, turns * actuator.stroke
    yield (
        "refresh",
        f"{f'in {turns} turns' if turns > 1 else 'all pins together'}, from the floor to the full stroke: "
        f"{_lasting(stroke, up)}; back to the floor: {_lasting(stroke, down)}"
        + ("" if electric else f"; {volume * 1e6:.3g} ml"),
    )


def _lasting(distance: float, speed: float) -> str:
    """Write how long a distance, m, takes at a speed, m/s; a reservoir may push the other way."""
    return f"{distance / speed:.3g} s" if speed > 0.0 else "never"


def _rows(system: System) -> Iterator[tuple[str, int]]:
    """Give the groups of a cell's state rows, and how many each has."""
    cell = system.cell
    yield "height", 1
    yield "relaxation", cell.touch.pulp.rows if cell.touch else 0
    yield "valve", cell.lag.rows
    yield "commands on their way", system.rows.queue
    yield "commanded height", 1
    yield "force", 1
    yield "forces of the fingers", system.rows.fingers
    yield "the controller's", system.rows.control
    yield "the sensors'", system.rows.sensors


def _filled(place: str, text: str) -> str:
    """Write the text of a place, on as many lines as needed."""
    return textwrap.fill(text, 110, initial_indent=f"  {place:<11} ", subsequent_indent=" " * 14)


def _parameters(part: Parameters) -> str:
    """Write a part's parameters on one line, without those of laws that are not selected."""
    shown, idle = [], part.list_idle()
    for name, declared in list_quantities(part).items():
        if name in idle:
            continue
        value = getattr(part, name)
        values = value if isinstance(value, tuple) else (value,)
        shown.append(
            f"{name.replace('_', ' ')} {' '.join(human(value, declared.unit) for value in values)}"
        )
    return ", ".join(shown)


def human(value: object, unit: str) -> str:
    """Write a value in the unit people read. `value`: in SI; `unit`: SI unit; empty where there is none."""
    if isinstance(value, bool):
        return str(value).lower()
    factor, name = READ.get(unit, (1.0, unit))
    return (
        f"{value * factor:.6g} {name}".rstrip() if isinstance(value, (int, float)) else str(value)
    )


def size(count: float) -> str:
    """Write a number of bytes."""
    power = min(int(math.log10(max(count, 1.0))) // 3, 4)
    return f"{count / 1e3**power:.3g} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"
