"""A new law or behavior is one file and one line: it runs alone and in batches, and is found everywhere."""

import json
from pathlib import Path

import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.quantity import Parameters, quantity
from digiclay.core.model.contact import ExponentialLaw
from digiclay.core.model.valve import Orifice

from tests.package_copy import copy_package, find_changes, run_python

#: An equal-percentage valve: the lift grows exponentially with the opening.
VALVE = """
from dataclasses import dataclass

import numpy as np

from ..base.quantity import Parameters, quantity
from .valve import Orifice, Valve, make_orifice


@dataclass(frozen=True)
class EqualPercentage(Parameters):
    orifice_diameter: float = quantity(0.5e-3, "diameter of the orifice", unit="m", above=0.0)
    stroke: float = quantity(30e-6, "lift of the fully open valve", unit="m", above=0.0)
    rangeability: float = quantity(20.0, "lift when open over lift when just open", symbol="R", above=1.0)

    def flow_law(self, fluid, area):
        open_ = make_orifice(Valve(self.orifice_diameter, self.stroke), fluid)
        return ExponentialOrifice(open_.laminar, open_.turbulent, open_.power, self.rangeability)


@dataclass(frozen=True)
class ExponentialOrifice(Orifice):
    rangeability: float

    def laminar_lift(self, opening, out):
        lift = np.multiply(np.abs(opening, out), np.log(self.rangeability), out)
        lift = np.divide(np.expm1(lift, out), self.rangeability - 1.0, out)
        return np.multiply(lift, lift, out)
"""
#: A pad whose stiffness doubles over a length: the exponential law by other parameters.
CONTACT = """
import math
from dataclasses import dataclass

from ..base.quantity import Parameters, quantity
from .contact import ExponentialLaw


@dataclass(frozen=True)
class Pad(ExponentialLaw, Parameters):
    stiffness: float = quantity(250.0, "stiffness at first touch", unit="N/m", above=0.0)
    offset: float = quantity(0.0, "indentation at which force begins", unit="m", at_least=0.0)
    share: float = quantity(0.34, "share of the law a cell carries", above=0.0)
    doubling: float = quantity(0.4e-3, "indentation that doubles the stiffness", unit="m", above=0.0)

    @property
    def exponent(self):
        return math.log(2.0) / self.doubling
"""
#: A sponge gives way under a force, and swells back slowly, by a share of its way a second.
SPONGE = """
from dataclasses import dataclass

import numpy as np

from ..base.modes import Mode
from ..base.quantity import quantity
from ..model.control_interface import Commands
from .pin_motion import CellwiseControl, TouchParameters, check_damping, make_pin_motion


@dataclass(frozen=True)
class Sponge(TouchParameters):
    damping: float = quantity(5.0, "force for the speed at which a pin sinks", unit="N s/m", above=0.0)
    swelling_time: float = quantity(0.3, "time constant of the swelling", unit="s", symbol="τ_w", above=0.0)


@dataclass(frozen=True, eq=False)
class SpongeControl(CellwiseControl):
    parameters: Sponge

    rows = 1

    def command(self, memory, seen):
        known, rest = self.parameters, self.actuator.rest_height
        pressed = seen.force >= known.felt_force
        seen.own[0] = np.where(pressed, seen.own[0] + 1.0, 0.0)
        speed = np.where(pressed, -seen.force / known.damping, (rest - seen.height) / known.swelling_time)
        mode = np.where(pressed, np.int8(Mode.SPRING), np.int8(Mode.REST))
        target = np.full(seen.height.shape, rest)
        return memory, Commands(target, mode, self.motion.command(speed, seen.force))


def build(parameters, device):
    check_damping(parameters.damping, device.cell, device.period)
    motion = make_pin_motion(parameters, device.cell, device.period)
    return SpongeControl(parameters, device.cell.actuator, motion)
"""
#: What runs in the copy: three values of each part alone and in one batch; a line of JSON for each.
SESSION = """
import json, sys, tomllib
import numpy as np
from digiclay.core.batch.columns import make_batch
from digiclay.core.batch.run_together import run_together
from digiclay.core.model.contact import Contact
from digiclay.core.scene.assembly import assemble
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session.run_scene import run
from digiclay.settings.groups import GROUPS, METHOD_GROUPS

def scene(*settings):
    return load(find("tap"), [Setting(*one.split("=")) for one in settings])

def height(scene):
    return run(scene).history["height"]

for asked in sys.argv[1:]:
    section, choice, name, key, *values = asked.split()
    scenes = [scene(f"{section}.{choice}={name}", f"{section}.{key}={value}") for value in values]
    alone = [height(one) for one in scenes]
    batch = {number: result.history["height"].copy() for number, result in run_together(scenes)}
    text = format_scene(scenes[1])
    group = {**GROUPS, "control": METHOD_GROUPS.get(name)}[section].__annotations__
    print(json.dumps({
        "batch": max(float(np.abs(batch[i] - alone[i]).max()) for i in range(len(values))),
        "apart": float(np.abs(alone[0] - alone[-1]).max()),
        "default": float(np.abs(height(scene()) - alone[0]).max()),
        "joined": type(make_batch([assemble(one) for one in scenes]).controller).__name__,
        "read back": resolve(tomllib.loads(text)) == scenes[1],
        "panel": key in group and (choice == "method" or choice in group),
        "in file": f'{choice} = "{name}"' in text,
    }))
plain = resolve({"simulation": {"duration": 0.01}})
print(json.dumps(["law =" in format_scene(plain), run(plain.with_sections(contact=Contact())).periods]))
"""


@pytest.fixture
def copy(tmp_path):
    return copy_package(tmp_path)


def add_part(copy, table, line, row, name, text):
    core = copy / "addon" / "digiclay" / "core"
    (core / table).with_name(name).write_text(text.lstrip(), encoding="utf-8")
    head, found, tail = (core / table).read_text(encoding="utf-8").partition(line)
    assert found
    (core / table).write_text(f"{head}{line}    {row}\n{tail}", encoding="utf-8")


#: Table of the parts, line before its new row, row, file and its text.
VALVES, CONTACTS = '("model.valve", "Valve"),\n', '("model.contact", "Contact"),\n'
METHODS = "METHODS: dict[str, Method] = {\n"
EQUAL = '    "equal_percentage": ("model.valve_exponential", "EqualPercentage"),'
SPONGE_ROW = '"sponge": Method("control.sponge", "Sponge", recovers=True),'
PARTS = (
    ("model/laws.py", VALVES, EQUAL, "valve_exponential.py", VALVE),
    ("model/laws.py", CONTACTS, '    "pad": ("model.pad", "Pad"),', "pad.py", CONTACT),
    ("control/methods.py", METHODS, SPONGE_ROW, "sponge.py", SPONGE),
)


def test_new_laws_and_a_new_behavior_are_a_file_and_a_line_each(copy):
    for part in PARTS:
        add_part(copy, *part)
    tables = {Path(table).name for table, *_ in PARTS}
    assert find_changes(copy) == sorted([*tables, *(name for *_, name, _ in PARTS)])
    asked = (
        "valve law equal_percentage rangeability 10 20 40",
        "contact law pad doubling 0.3e-3 0.4e-3 0.6e-3",
        "control method sponge swelling_time 0.1 0.3 0.9",
    )
    *parts, plain = (
        json.loads(line) for line in run_python(copy, "-c", SESSION, *asked).splitlines()
    )
    for words, found in zip(asked, parts, strict=True):
        section, choice, name, key, *_ = words.split()
        # Sums in another order: a last bit here and there.
        assert found.pop("batch") < 1e-12
        assert min(found.pop("apart"), found.pop("default")) > 1e-5
        # All runs of a batch in one call, not one after the other.
        joined = "SpongeControl" if name == "sponge" else "VirtualMasterBatch"
        assert found == {"joined": joined, "read back": True, "panel": True, "in file": True}
        options = ("describe", "tap", "--parameters", "--set", f"{section}.{choice}={name}")
        assert f"{section}.{key} = " in run_python(copy, "-m", "digiclay", *options)
    assert plain == [False, 2]  # a scene without a word of laws


@pytest.mark.parametrize(
    "base, name, said",
    [
        (ExponentialLaw, "tension", "tension must be that of ExponentialLaw: the closed form"),
        (ExponentialLaw, "_numbers", "_numbers must be that of ExponentialLaw: the closed form"),
        (
            Orifice,
            "flow",
            "flow must be that of Orifice: steppers and conduits compute the flow from lam",
        ),
        (Orifice, "conductance", "conductance must be that of Orifice"),
        (Parameters, "gap", "gap must have one of the units m, s, Pa, N"),
    ],
)
def test_a_class_that_the_steps_cannot_see_is_refused_in_a_line(base, name, said):
    with pytest.raises(ParameterError, match=f"^Wrong.{said}"):
        type("Wrong", (base,), {name: quantity(1.0, "gap", unit="1")})


@pytest.mark.parametrize(
    "number, old, new, said",
    [
        (0, "def flow_law", "def flows", "EqualPercentage without flow_law"),
        (
            1,
            "Pad(ExponentialLaw, ",
            "Pad(",
            "contact.pad must derive from Parameters and ExponentialLaw",
        ),
    ],
)
def test_a_law_that_lacks_what_a_law_has_is_refused_in_a_line(copy, number, old, new, said):
    *place, text = PARTS[number]
    add_part(copy, *place, text.replace(old, new))
    make = "from digiclay.core.scene.toml_table import resolve; from digiclay.core.base.errors import *\n"
    assert said in run_python(
        copy, "-c", f"{make}try: resolve({{}})\nexcept ParameterError as e: print(e)"
    )


#: What runs in the copy: each arrangement under several methods, and what refuses it.
BEDS = """
import sys
import numpy as np
from digiclay.core.base.errors import DigiclayError
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.session.run_scene import run
from digiclay.core.surface.formed import make_formed
from digiclay.core.surface.pins_solid import make_parts

def attempt(make):
    try:
        return make()
    except DigiclayError as error:
        return str(error)

def scene(arrangement, *settings):
    bed = ("layout.rows=11", "layout.columns=11", f"layout.arrangement={arrangement}")
    settings = (*bed, "simulation.duration=0.3", *settings)
    return load(find("tap"), [Setting(*one.split("=")) for one in settings])

for name in sys.argv[1:]:
    known, viscous = scene(name), scene(name, "control.method=viscous")
    done = run(known)
    formed = make_formed(done.history, -1)
    print(done.figures["max_total_force"] > 0.0, known.fingers[0].contact.share, sep="|", end="|")
    print(attempt(lambda: len(run(viscous).history["time"])), end="|")
    print(attempt(lambda: formed.neighbors.shape[1]), end="|")
    print(attempt(lambda: np.bincount(make_parts(formed).pin).max()), end="|")
    print(attempt(lambda: known.layout.find_neighbors(corners=False)[60].tolist()))
"""
REFUSED = (
    "layout.arrangement must have its rows in line or shifted by half a pitch, where neighbors are needed "
    "(got a shift of 0.3 pitches)."
)
#: Rows of the list of arrangements, and what is found of them.
NEW = {
    "wide": ('Arrangement(1.5, 0.0, "Wide rows")', ["0.51", "61", "8", "6", "[61, 71, 59, 49]"]),
    "close": (
        'Arrangement(0.7, 0.5, "Close rows")',
        ["0.238", "61", "6", "6", "[61, 72, 71, 59, 49, 50]"],
    ),
    "odd": ('Arrangement(1.0, 0.3, "No lattice")', ["0.34", *[REFUSED] * 4]),
}


def test_a_new_arrangement_is_one_row_and_what_needs_neighbors_refuses_one_without(copy):
    layout = copy / "addon" / "digiclay" / "core" / "model" / "layout.py"
    rows = "".join(f'    "{name}": {row},\n' for name, (row, _) in NEW.items())
    head, tail = layout.read_text(encoding="utf-8").split("ARRANGEMENTS = {\n")
    layout.write_text(f"{head}ARRANGEMENTS = {{\n{rows}{tail}", encoding="utf-8")
    said = [line.split("|") for line in run_python(copy, "-c", BEDS, *NEW).splitlines()]
    assert said == [["True", *found] for _, found in NEW.values()]
