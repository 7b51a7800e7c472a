"""Generator of docs/nomenclature.md: `python tools/nomenclature.py`.

The parameters come from their declarations in the core; terms and variables are listed here.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "nomenclature.md"
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT / "addon"))

from digiclay.core.base.quantity import EXTENTS, Parameters, Quantity, list_quantities  # noqa: E402
from digiclay.core.control.methods import METHODS  # noqa: E402
from digiclay.core.scene.schema import SECTIONS, import_parameters  # noqa: E402

INTRODUCTION = """\
# Nomenclature

Units are SI. Height is positive upwards from the floor of the bed. A force that presses a pin down is
positive. Flow into a cylinder is positive. A valve command lies in −1 to 1; a command above 0 opens to the
high reservoir.

`tools/nomenclature.py` generates this page. A test compares the two.

## Terms

Each term has one meaning on all pages.

"""
#: Term, its one meaning.
TERMS = (
    ("pin", "rod whose top is a point of the formed surface"),
    ("cell", "pin with its cylinder, valve, conduit and sensors; the unit of all arrays"),
    ("row, column", "line of cells along x, along y; only of the layout"),
    ("bed", "all cells of one device"),
    ("fingertip", "ellipsoid with a deformable pulp that presses on the pins"),
    ("finger", "fingertip with its contact law, relaxation and path; a scene has a tuple of them"),
    ("underside", "lower boundary of the fingertip, as a height over the bed"),
    ("pulp", "soft tissue of the fingertip: exponential spring with relaxation"),
    ("indentation", "pin top less underside"),
    ("active cell", "cell that is integrated in a control period; the active set is all of them"),
    ("part", "component of the model: valve lag, delay, conduit, relaxation, sensors, control, stepper"),
    ("null part", "replacement of an omitted part; it has no state rows and computes nothing"),
    (
        "control method",
        "algorithm that maps measurements to valve commands; Method I and Method II are the paper's",
    ),
    ("behavior", "one of the six control methods without a blister"),
    ("blister", "raised or lowered patch of pins under the fingertip, moved by Method I or II"),
    ("virtual master", "simulated cell of Method I that follows the fingertip"),
    ("set point", "total force that a control method holds"),
    ("loss", "instant at which a control method ends the tracking of the fingertip"),
    (
        "mode",
        "a cell's control: rest, hold, edge, blister, virtual spring, force follow, critical, frozen",
    ),
    ("state", "all quantities that vary in time, at one instant"),
    ("control period", "time between two commands"),
    ("physics step", "one step of the integration; a control period has one or more"),
    ("tick", "one execution of Blender's timer; it simulates whole control periods"),
    (
        "scene",
        "parameters and fingertip path of one simulation, a TOML file; Blender's own is a Blender scene",
    ),
    ("session", "simulation of one bed from an initial state; a live session takes place in Blender"),
    ("run", "session of a scene together with its results in a run folder"),
    (
        "history",
        "recorded heights, forces, commands and modes of a run; a row is one recorded control period",
    ),
    ("trace", "sums of each row from which the metrics are computed"),
    ("snapshot", "state as bytes, in a file or a .blend"),
    ("smoothing order", "disc of the bed and strength with which its pins are smoothed in a control period"),
    (
        "take",
        "initial state and fingertip path of a live session, a pose and a smoothing order a control period",
    ),
    ("bake", "Blender animation made from a take"),
    ("batch", "several runs that are simulated in one call, with the run as the last array axis"),
    ("job", "one run of a job series, with its meshes and pictures"),
    ("job series", "all jobs of a JOBS file; the command `digiclay batch` executes it"),
    ("sweep", "one scene over a grid of parameter values; a point is one combination of them"),
    ("study", "runs of a scene over ranges of parameters, and the Sobol indices of their outputs"),
    ("tuning", "search for the Pareto front of two metrics over ranges of parameters"),
    ("series", "a job series, a sweep, a study or a tuning, with its folder"),
    ("shape", "mesh, picture or array to which the pins are driven before the fingertip arrives"),
    ("skin", "interpolated surface through the pin tops"),
    ("boss, crease", "region of the skin above, below the former surface; a feature is either"),
    ("press stroke", "one drag of the Press tool; strokes of a cylinder and of a valve are lengths"),
    ("RFD", "reference force deviation: rms of total force less set point"),
)
VARIABLES_HEADING = "\n## Variables\n"
#: Symbol, name in code, unit, meaning.
VARIABLES = (
    ("H", "`height`, row 0 of `State.rows`", "m", "height of a pin's top"),
    ("H_com", "`target`", "m", "height a cell is commanded to"),
    ("K_com", "`command`", "1", "valve command, held for a control period"),
    ("K", "`opening`, `Cell.lag_rows`", "1", "valve opening; its sign picks the reservoir"),
    ("h\\*", "size of `opening`", "1", "relative opening of the valve, \\|K\\|"),
    (
        "z_i",
        "`filters`, `Cell.pulp_rows`",
        "N",
        "relaxed force of the pulp over a cell, one a relaxation time",
    ),
    ("x", "`depth`", "m", "indentation: pin top less underside"),
    ("T", "`tension`", "N", "elastic force of the pulp (11)"),
    ("F", "`force`", "N", "force on a pin, `f_d max(T − Σ ĉ_i z_i, 0)` (14)"),
    ("ĉ_i", "`Relaxation.shares`", "1", "share of a relaxation time, c_i / Σ c"),
    ("G", "`Relaxation.reduced`", "1", "reduced relaxation (12)"),
    ("P_a", "`Actuator.pressure`", "Pa", "gauge pressure in a cylinder (2)"),
    ("A_a", "`Actuator.area`", "m2", "cross section of a cylinder"),
    ("P_s", "`Supply.pressure`", "Pa", "gauge pressure of the reservoir the valve opens to"),
    ("ΔP", "`drop`", "Pa", "pressure drop over valve and conduit, P_s − P_a"),
    ("ΔP_crit", "`Orifice.knee`", "Pa", "drop at which the flow turns turbulent (6), fully open valve"),
    ("Q, q", "`flow`", "m3/s", "flow into the cylinder (7)"),
    ("g, a", "`Orifice.laminar`, `Orifice.turbulent`", "m3/(s Pa), …", "coefficients of the open valve (7)"),
    ("C_q", "in `valve.make_orifice`", "1", "discharge coefficient (3, 5)"),
    ("Re\\*", "in `valve.make_orifice`", "1", "modified Reynolds number (4)"),
    ("R", "`Conduit.resistance`", "Pa s/m3", "resistance of the conduit (8)"),
    ("μ", "`Fluid.dynamic_viscosity`", "Pa s", "dynamic viscosity ρ ν"),
    ("r_VM", "`Master.x`, `Master.y`", "m", "position of the virtual master (13 again)"),
)
LEGEND = """\

## Parameters

The name is the key in a scene file. The source is P (the paper), D (derived), C (chosen), or a reference of
the last section. A default in brackets is a sequence of values. A range is in the unit of the parameter. It
does not contain rules that join several parameters. A range without an end has the limits of its unit:

| Unit | Least above 0 | Most |
|---|---|---|
"""
#: Key, work and extracted value of each reference beside the paper.
REFERENCES = {
    "Jindrich 2003": (
        "D. L. Jindrich, Y. Zhou, T. Becker and J. T. Dennerlein, *Non-linear viscoelastic models "
        "predict fingertip pulp force-displacement characteristics during voluntary tapping*, Journal "
        "of Biomechanics 36 (4), 497–503, 2003. The fingertip dissipates 81 % of a tap's energy: the "
        "weights are chosen so that the pulp here loses 77 to 81 %, in taps of 30 to 300 ms."
    ),
    "Melinder 2010": (
        "Å. Melinder, *Properties of Secondary Working Fluids for Indirect Systems*, International "
        "Institute of Refrigeration, 2010, as CoolProp fits it for Syltherm XLT (its fluid PMS2): 855.2 "
        "kg/m³ and 1.60 mm²/s at 20 °C."
    ),
    "Microsoft": (
        "Microsoft, *Contact area size*, Windows hardware design (touch), dn672264: index fingers touch "
        "glass over 9.4 mm x 8.8 mm on average, 10.8 mm x 10.5 mm in a tap. The ellipsoid here does "
        "over 11.7 mm x 9.3 mm when pressed 1.5 mm deep."
    ),
    "Pawluk 1999": (
        "D. T. V. Pawluk and R. D. Howe, *Dynamic lumped element response of the human fingerpad*, "
        "Journal of Biomechanical Engineering 121 (2), 178–183, 1999: relaxation by three exponentials "
        "of about 4 ms, 70 ms and 1.4 s, and a force that grows exponentially with indentation."
    ),
    "Roberts 2003": (
        "D. C. Roberts et al., *A piezoelectric microvalve for compact high-frequency, "
        "high-differential pressure hydraulic micropumping systems*, Journal of Microelectromechanical "
        "Systems 12 (1), 81–92, 2003: valve strokes of 20 to 30 µm at more than 1 kHz."
    ),
    "Zhu 2005": (
        "H. Zhu, *Practical Structural Design and Control for Digital Clay*, PhD thesis, Georgia "
        "Institute of Technology, 2005: the ways of refreshing a surface."
    ),
}
PAPER = (
    "P: Askins and Book, *Digital Clay: User Interaction Model for Control of a Fluidically "
    "Actuated Haptics Device*, Georgia Institute of Technology, 2003."
)
RULE = "|---|---|---|---|---|---|---|"


def shown(value: object) -> str:
    """Write a default with the fewest digits that restore it."""
    if isinstance(value, tuple):
        return "[" + ", ".join(shown(item) for item in value) + "]"
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def bounds(known: Quantity) -> str:
    """Write the range of a parameter; its ends are included except after above and below."""
    ends = (
        ("above", known.above), ("from", known.at_least), ("below", known.below), ("up to", known.at_most),
    )  # fmt: skip
    return " ".join(f"{word} {shown(float(end))}" for word, end in ends if end is not None)


def section(name: str, method: str) -> list[str]:
    """Return the lines of one section of a scene file."""
    kind: type[Parameters] = import_parameters(name, method)
    title = f"### [{name}]" + (f' with method = "{method}"' if name == "control" else "")
    lines = ["", title, "", "| Symbol | Name | Unit | Meaning | Range | Default | Source |", RULE]
    defaults = kind()
    for field, known in list_quantities(kind).items():
        meaning = known.doc + (f" ({', '.join(known.choices)})" if known.choices else "")
        default = shown(getattr(defaults, field))
        cells = (known.symbol, f"`{name}.{field}`", known.unit, meaning, bounds(known), default, known.source)
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def page() -> str:
    """Return the page."""
    lines = [INTRODUCTION + "| Term | Meaning |", "|---|---|"]
    lines += ["| " + " | ".join(row) + " |" for row in TERMS]
    lines += [VARIABLES_HEADING, "| Symbol | Name in code | Unit | Meaning |", "|---|---|---|---|"]
    lines += ["| " + " | ".join(row) + " |" for row in VARIABLES]
    lines.append(LEGEND.rstrip())
    lines += [f"| {unit or 1} | {least:g} | {most:g} |" for unit, (least, most) in EXTENTS.items()]
    for name in SECTIONS:
        for method in METHODS if name == "control" else ("virtual_master",):
            lines += section(name, method)
    lines += ["", "## References", "", PAPER]
    lines += ["", *(f"- **{key}**: {said}" for key, said in REFERENCES.items())]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
