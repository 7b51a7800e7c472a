"""A new law is one file and one line: it runs alone and in batches, and is found wherever parameters are."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from digiclay.core.base.errors import ParameterError
from digiclay.core.base.quantity import Parameters, quantity
from digiclay.core.model.contact import ExponentialLaw
from digiclay.core.model.valve import Orifice

from tests.package_copy import ROOT, copy_package, find_changes, run_python

#: An equal-percentage valve: the lift grows exponentially with the opening.
VALVE = '''
"""A valve whose lift grows exponentially with the opening."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..base.quantity import Parameters, quantity
from .valve import Fluid, Orifice, Valve, make_orifice


@dataclass(frozen=True)
class EqualPercentage(Parameters):
    """Seat valve with an exponential characteristic."""

    orifice_diameter: float = quantity(0.5e-3, "diameter of the orifice", unit="m", above=0.0)
    stroke: float = quantity(30e-6, "lift of the fully open valve", unit="m", above=0.0)
    rangeability: float = quantity(20.0, "lift when open over lift when just open", symbol="R", above=1.0)

    def flow_law(self, fluid: Fluid) -> Orifice:
        """Return the valve's flow law in a fluid."""
        open_ = make_orifice(Valve(self.orifice_diameter, self.stroke), fluid)
        return ExponentialOrifice(open_.laminar, open_.turbulent, open_.power, self.rangeability)


@dataclass(frozen=True)
class ExponentialOrifice(Orifice):
    """Its flow law."""

    rangeability: float

    def laminar_lift(self, opening: Any, out: Any) -> Any:
        """Return (R^|K| - 1) / (R - 1), squared."""
        lift = np.abs(opening, out)
        lift = np.multiply(lift, np.log(self.rangeability), out)
        lift = np.expm1(lift, out)
        lift = np.divide(lift, self.rangeability - 1.0, out)
        return np.multiply(lift, lift, out)
'''
#: A pad whose stiffness doubles over a length: the exponential law by other parameters.
CONTACT = '''
"""A pad whose stiffness doubles over a length."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..base.quantity import Parameters, quantity
from .contact import ExponentialLaw


@dataclass(frozen=True)
class Pad(ExponentialLaw, Parameters):
    """Pad with a stiffness that doubles."""

    stiffness: float = quantity(250.0, "stiffness at first touch", unit="N/m", above=0.0)
    offset: float = quantity(0.0, "indentation at which force begins", unit="m", at_least=0.0)
    share: float = quantity(0.34, "share of the law a cell carries", above=0.0)
    doubling: float = quantity(0.4e-3, "indentation that doubles the stiffness", unit="m", above=0.0)

    @property
    def exponent(self) -> float:
        """m, 1/m."""
        return math.log(2.0) / self.doubling
'''
#: What runs in the copy: three values of each law alone and in one batch; a line of JSON for each law.
SESSION = """
import json, sys, tomllib
import numpy as np
from digiclay.core.batch.run_together import run_together
from digiclay.core.model.contact import Contact
from digiclay.core.scene.scene_source import Setting, find, load
from digiclay.core.scene.toml_table import format_scene, resolve
from digiclay.core.session.run_scene import run
from digiclay.settings.groups import GROUPS

def scene(*settings):
    return load(find("tap"), [Setting(*one.split("=")) for one in settings])

def height(scene):
    return run(scene).history["height"]

for asked in sys.argv[1:]:
    section, law, key, *values = asked.split()
    scenes = [scene(f"{section}.law={law}", f"{section}.{key}={value}") for value in values]
    alone = [height(one) for one in scenes]
    batch = {number: result.history["height"].copy() for number, result in run_together(scenes)}
    said = format_scene(scenes[1])
    print(json.dumps({
        "batch": max(float(np.abs(batch[i] - alone[i]).max()) for i in range(len(values))),
        "apart": float(np.abs(alone[0] - alone[-1]).max()),
        "default": float(np.abs(height(scene()) - alone[0]).max()),
        "told": resolve(tomllib.loads(said)) == scenes[1],
        "stepper": scenes[0].simulation.stepper,
        "panel": [name in GROUPS[section].__annotations__ for name in ("law", key)],
        "law in file": f'law = "{law}"' in said,
    }))
plain = resolve({"simulation": {"duration": 0.01}})
print(json.dumps(["law =" in format_scene(plain), run(plain.with_sections(contact=Contact())).periods]))
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a copy of the package."""
    return copy_package(tmp_path)


def add_law(copy: Path, section: str, row: str, name: str, text: str) -> None:
    """Write a law's file, and its row into the list of laws."""
    model = copy / "addon" / "digiclay" / "core" / "model"
    (model / name).write_text(text.lstrip(), encoding="utf-8")
    laws = model / "laws.py"
    lines = laws.read_text(encoding="utf-8").splitlines(keepends=True)
    place = lines.index(f'    "{section}": {{\n') + 2
    laws.write_text("".join([*lines[:place], f"        {row}\n", *lines[place:]]), encoding="utf-8")


#: Section, row of the list of laws, file and its text.
EQUAL = '"equal_percentage": ("model.valve_exponential", "EqualPercentage"),'
LAWS = (
    ("valve", EQUAL, "valve_exponential.py", VALVE),
    ("contact", '"pad": ("model.pad", "Pad"),', "pad.py", CONTACT),
)


def test_new_laws_are_a_file_and_a_line_each_and_change_no_other_test(copy: Path) -> None:
    for law in LAWS:
        add_law(copy, *law)
    assert find_changes(copy) == sorted(["laws.py", *(name for *_, name, _ in LAWS)])
    asked = ("valve equal_percentage rangeability 10 20 40", "contact pad doubling 0.3e-3 0.4e-3 0.6e-3")
    *laws, plain = (json.loads(line) for line in run_python(copy, "-c", SESSION, *asked).splitlines())
    for words, found in zip(asked, laws, strict=True):
        # Sums in another order: a last bit here and there.
        assert found.pop("batch") < 1e-12
        assert min(found.pop("apart"), found.pop("default")) > 1e-5
        assert found == {"told": True, "stepper": "bernoulli", "law in file": True, "panel": [True, True]}
        section, law, key, *_ = words.split()
        options = ("describe", "tap", "--parameters", "--set", f"{section}.law={law}")
        assert f"{section}.{key} = " in run_python(copy, "-m", "digiclay", *options)
    assert plain == [False, 2]  # a scene without a word of laws
    shutil.copytree(ROOT / "tests", copy / "tests")
    shutil.copy(ROOT / "pyproject.toml", copy)
    old = str(copy / "tests" / "regression" / "test_old_formats.py")
    run_python(copy, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider", f"--rootdir={copy}", old)


@pytest.mark.parametrize(
    ("base", "name", "said"),
    [
        (ExponentialLaw, "tension", "tension must be that of ExponentialLaw: the closed form"),
        (ExponentialLaw, "_numbers", "_numbers must be that of ExponentialLaw: the closed form"),
        (Orifice, "flow", "flow must be that of Orifice: steppers and conduits compute the flow from lam"),
        (Orifice, "conductance", "conductance must be that of Orifice"),
        (Parameters, "gap", "gap must have one of the units m, s, Pa, N"),
    ],
)
def test_a_class_that_the_steps_cannot_see_is_refused_in_a_line(base: type, name: str, said: str) -> None:
    with pytest.raises(ParameterError, match=f"^Wrong.{said}"):
        type("Wrong", (base,), {name: quantity(1.0, "gap", unit="1")})


@pytest.mark.parametrize(
    ("number", "old", "new", "said"),
    [
        (0, "def flow_law", "def flows", "EqualPercentage without flow_law"),
        (
            1,
            "Pad(ExponentialLaw, ",
            "Pad(",
            "contact.pad must derive from Parameters and ExponentialLaw, and",
        ),
        (1, "def exponent", "def stiffening", "got Pad without exponent"),
    ],
)
def test_a_law_that_lacks_what_a_law_has_is_refused_in_a_line(
    copy: Path, number: int, old: str, new: str, said: str
) -> None:
    section, row, name, text = LAWS[number]
    add_law(copy, section, row, name, text.replace(old, new))
    make = "from digiclay.core.scene.toml_table import resolve; from digiclay.core.base.errors import *\n"
    assert said in run_python(copy, "-c", f"{make}try: resolve({{}})\nexcept ParameterError as e: print(e)")


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
    "wide": ('Arrangement(1.5, 0.0, "Wide rows")', ["0.34", "61", "8", "4", "[61, 71, 59, 49]"]),
    "close": (
        'Arrangement(0.7, 0.5, "Close rows", share=0.25)',
        ["0.25", "61", "6", "6", "[61, 72, 71, 59, 49, 50]"],
    ),
    "odd": ('Arrangement(1.0, 0.3, "No lattice")', ["0.34", *[REFUSED] * 4]),
}


def test_a_new_arrangement_is_one_row_and_what_needs_neighbors_refuses_one_without(copy: Path) -> None:
    layout = copy / "addon" / "digiclay" / "core" / "model" / "layout.py"
    rows = "".join(f'    "{name}": {row},\n' for name, (row, _) in NEW.items())
    head, tail = layout.read_text(encoding="utf-8").split("ARRANGEMENTS = {\n")
    layout.write_text(f"{head}ARRANGEMENTS = {{\n{rows}{tail}", encoding="utf-8")
    said = [line.split("|") for line in run_python(copy, "-c", BEDS, *NEW).splitlines()]
    assert said == [["True", *found] for _, found in NEW.values()]
