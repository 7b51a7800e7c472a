"""Figure of the laws of a cell, by the package's own functions: a panel each, with its parameters marked."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from digiclay.core.model.actuator import Actuator, Supply
from digiclay.core.model.conduit import Conduit, OrificeAndConduit
from digiclay.core.model.contact import Contact
from digiclay.core.model.control_interface import NONE, Measurement
from digiclay.core.model.delay import Delay, split_delay
from digiclay.core.model.lag import ValveLag
from digiclay.core.model.null_parts import PerfectSensors
from digiclay.core.model.relaxation import Relaxation
from digiclay.core.model.sensors import Noisy, Quantized, Sensing
from digiclay.core.model.valve import Fluid, Valve
from digiclay.plots.figure import LINES, MM, STYLE, empty, save

BAR, BLACK_DOTS, DASHED = 1e5, "ko", "k--"
#: Horizontal and vertical values, the form of the line, its label.
Curve = tuple[Any, Any, str, str]
#: Title, labels of the axes, scale of the horizontal one, then its curves.
Panel = tuple[str, str, str, str, list[Curve]]
VALVE, HIGH = Valve().flow_law(Fluid()), Supply().high


def compute_flows(opening: float, drops: Any) -> Any:
    """Return flows through the valve, mm³/s, under drops, bar."""
    return 1e9 * VALVE.flow(np.full(drops.shape, opening), BAR * drops)


def compute_speeds(diameter: float, openings: Any) -> Any:
    """Return speeds of a pin without load, mm/s, behind a conduit of a diameter, m."""
    law = OrificeAndConduit(VALVE, Conduit(diameter=diameter).resistance(Fluid()))
    return MM * law.flow(openings, np.full(openings.shape, HIGH)) / Actuator().area


def read_sensors(sensing: Sensing, cells: Any) -> Any:
    """Return readings of the force on cells that nothing touches, mN."""
    none = np.zeros(cells.size)
    seen = Measurement(none[None], none, none, none, none.astype(np.int8), NONE, cells)
    noisy = Noisy(PerfectSensors(), sensing.force_noise, 0.0, sensing.seed)
    return MM * Quantized(noisy, sensing.force_step, 0.0).measure(seen, 0)[0]


def list_panels() -> Iterator[Panel]:
    """Give the panels."""
    drops, sizes = np.logspace(-2, 2.5), (1.0, 0.5, 0.25)
    knees = VALVE.knee / BAR / np.square(sizes)
    curves: list[Curve] = [(drops, compute_flows(size, drops), "-", f"h* = {size:g}") for size in sizes]
    flows = [compute_flows(size, knee) for size, knee in zip(sizes, knees, strict=True)]
    curves += [(knees, flows, BLACK_DOTS, "$ΔP_{crit}$")]
    curves += [([HIGH / BAR] * 2, [0.1, 1e4], DASHED, "$P_{high}$")]
    yield "a  Valve, eq. 3 to 7", "pressure drop ΔP (bar)", "flow Q (mm³/s)", "log", curves

    openings, widths = np.linspace(0.0, 1.0), (0.8e-3, 0.25e-3, 0.2e-3)
    curves = [(openings, compute_speeds(width, openings), "-", f"$D_c$ = {MM * width:g} mm") for width in widths]
    yield "b  Valve and conduit, eq. 8", "opening h*", "speed without load (mm/s)", "linear", curves

    lag, delay, times = ValveLag(), Delay(), np.linspace(0.0, 12e-3, 241)
    reached = delay.dead_time + lag.time_constant
    opened = lag.response(split_delay(delay, 1.0), [*times, delay.dead_time, reached])[:, -1]
    curves = [(MM * times, opened[:-2], "-", "opening K"), (MM * times, times >= 0.0, DASHED, "command")]
    marks = MM * np.array([delay.dead_time, reached])
    curves += [(marks, opened[-2:], BLACK_DOTS, "$t_d$, and $τ_v$ later")]
    yield "c  Dead time and lag, eq. 9", "time (ms)", "share of full opening", "linear", curves

    depths = np.linspace(0.0, 2.5e-3)
    laws = [Contact(exponent=exponent) for exponent in (2000.0, 1500.0, 1000.0)]
    curves = [(MM * depths, law.tension(depths), "-", f"m = {law.exponent:g} 1/m") for law in laws]
    curves += [(MM * depths, laws[0].stiffness * depths, DASHED, "slope b at $x_0$ = 0")]
    yield "d  Contact, eq. 11", "indentation x (mm)", "tension T (N)", "linear", curves

    law, times = Relaxation(), np.logspace(-4, 1.5)
    curves = [(times, law.reduced(times), "-", "G(t)")]
    curves += [(law.times, law.reduced(np.array(law.times)), BLACK_DOTS, "1/$ν_1$, 1/$ν_2$, 1/$ν_3$")]
    curves += [(times[[0, -1]], [law.weights[0] / sum(law.weights)] * 2, DASHED, "$c_0$/Σc")]
    yield "e  Relaxation, eq. 12", "time after a step of x (s)", "share of the tension", "log", curves

    sensing, cells = Sensing(force_noise=2e-3, force_step=2e-3), np.arange(300)
    curves = [(cells, read_sensors(sensing, cells), ".", "$σ_F$ = 2 mN, $q_F$ = 2 mN")]
    curves += [(cells[[0, -1]], [MM * sensing.force_floor] * 2, DASHED, "noise floor $F_n$")]
    yield "f  Force sensors", "cell, none touched", "force reading (mN)", "linear", curves


def draw_laws(out: Path) -> None:
    """Write the figure: panels in two columns."""
    style = STYLE | {"axes.prop_cycle": f"cycler('color', {list(LINES)})", "legend.fontsize": 11}
    with empty(10.0, 11.6, style, layout="constrained") as figure:
        panels = figure.subplots(3, 2).flat
        for axes, (title, across, up, scale, curves) in zip(panels, list_panels(), strict=True):
            for *values, label in curves:
                axes.plot(*values, label=label)
            axes.set(title=title, xlabel=across, ylabel=up, xscale=scale)
            axes.legend()
        panels[0].set_yscale("log")
        save(figure, out)
