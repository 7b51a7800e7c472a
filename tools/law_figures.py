"""Figure of the laws of a cell, by the package's own functions: a panel each, with its parameters marked."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import digiclay
import numpy as np
from digiclay.core.model.contact import Contact
from digiclay.core.model.control_interface import NONE, Measurement
from digiclay.core.model.delay import split_delay
from digiclay.core.scene.assembly import assemble
from digiclay.plots.figure import LINES, MM, STYLE, empty, save

#: Title and labels of the axes of each panel.
PANELS = (
    ("a  Valve, eq. 3 to 7", "pressure drop ΔP (bar)", "flow Q (mm³/s)"),
    ("b  Valve and conduit, eq. 8", "opening h*", "speed without load (mm/s)"),
    ("c  Dead time and lag, eq. 9", "time (ms)", "share of full opening"),
    ("d  Contact, eq. 11", "indentation x (mm)", "tension T (N)"),
    ("e  Relaxation, eq. 12", "time after a step of x (s)", "share of the tension"),
    ("f  Force sensors", "cell, none touched", "force reading (mN)"),
)
#: Openings, diameters of conduits, m, and exponents of contact laws, 1/m.
VARIED = ((1.0, 0.8e-3, 2000.0), (0.5, 0.25e-3, 1500.0), (0.25, 0.2e-3, 1000.0))


def draw_laws(out: Path) -> None:
    """Write the figure: panels in two columns."""
    style = STYLE | {"axes.prop_cycle": f"cycler('color', {list(LINES)})", "legend.fontsize": 11}
    with empty(10.0, 11.6, style, layout="constrained") as figure:
        panels = figure.subplots(3, 2).ravel()
        draw_curves(*panels)
        for axes, (title, across, up) in zip(panels, PANELS, strict=True):
            axes.set(title=title, xlabel=across, ylabel=up)
            axes.legend()
        save(figure, out)


def draw_curves(valve: Any, conduit: Any, lag: Any, contact: Any, relaxation: Any, sensors: Any) -> None:
    """Draw the curves of each law into its panel."""
    scene = digiclay.scene({"sensors": {"force_noise": "2 mN", "force_step": "2 mN"}})
    system, law, high = assemble(scene), scene.valve.flow_law(scene.fluid), scene.supply.high
    drops, openings, depths = np.logspace(3, 7.5), np.linspace(0.0, 1.0), np.linspace(0.0, 2.5)
    for opening, diameter, exponent in VARIED:
        knee = law.knee / opening**2
        flow = 1e9 * law.flow(np.array(opening), np.append(drops, knee))
        valve.loglog(drops / 1e5, flow[:-1], label=f"h* = {opening:g}")
        valve.plot(knee / 1e5, flow[-1], "ko")
        narrow = replace(scene, conduit=replace(scene.conduit, diameter=diameter))
        flow = assemble(narrow).cell.flow.flow(openings, np.full(openings.shape, high))
        conduit.plot(openings, MM * flow / scene.actuator.area, label=f"$D_c$ = {MM * diameter:g} mm")
        contact.plot(depths, Contact(exponent=exponent).tension(depths / MM), label=f"m = {exponent:g} 1/m")
    valve.annotate("$ΔP_{crit}$", (6.0, 3e3))
    valve.axvline(high / 1e5, color="k", linestyle="--", label="$P_{high}$")
    contact.plot(depths, Contact().stiffness * depths / MM, "k--", label="slope b at $x_0$ = 0")

    dead, slow, times = scene.delay.dead_time, scene.valve_lag.time_constant, np.linspace(0.0, 12.0, 241)
    opened = system.cell.lag.response(split_delay(scene.delay, 1.0), times / MM)[:, -1]
    lag.plot(times, opened, label="opening K")
    lag.axhline(1.0, color="k", linestyle="--", label="command")
    lag.axvspan(0.0, MM * dead, alpha=0.3, label="$t_d$")
    lag.axvspan(MM * dead, MM * (dead + slow), color=LINES[4], alpha=0.3, label="$τ_v$")

    pulp, times = system.cell.touch.pulp, np.logspace(-4, 1.5)
    relaxation.semilogx(times, pulp.reduced(times), label="G(t)")
    relaxation.plot(pulp.times, pulp.reduced(np.array(pulp.times)), "ko", label="1/$ν_1$, 1/$ν_2$, 1/$ν_3$")
    relaxation.axhline(1.0 - pulp.shares.sum(), color="k", linestyle="--", label="$c_0$/Σc")

    cells = np.arange(300)
    none = np.zeros(cells.size)
    seen = Measurement(none, none, none, none, none, NONE, cells)
    sensors.plot(MM * system.sensors.measure(seen, 0)[0], ".", label="$σ_F$ = 2 mN, $q_F$ = 2 mN")
    sensors.axhline(MM * scene.sensors.force_floor, color="k", linestyle="--", label="noise floor $F_n$")
    sensors.set_ylim(-8.0, 18.0)
