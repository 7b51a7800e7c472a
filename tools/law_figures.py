"""Figure of the laws of a cell, by the package's own functions: a panel each, with its parameters marked."""

from pathlib import Path
from typing import Any

import digiclay
import numpy as np
from digiclay.core.model.control_interface import Measurement
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
BAR = 1e5
STEP = "2 mN"


def draw_laws(out: Path) -> None:
    """Write the figure: panels in two columns."""
    style = STYLE | {"axes.prop_cycle": f"cycler('color', {list(LINES)})", "legend.fontsize": 11}
    with empty(10.0, 11.6, style, layout="constrained") as figure:
        figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
        panels = figure.subplots(3, 2).ravel()
        draw_curves(*panels)
        for axes, (title, across, up) in zip(panels, PANELS, strict=True):
            axes.set(title=title, xlabel=across, ylabel=up)
            axes.legend()
        save(figure, out)


def draw_curves(
    valve: Any, conduit: Any, lag: Any, contact: Any, relaxation: Any, sensors: Any
) -> None:
    """Draw the curves of each law into its panel."""
    scene = digiclay.scene({"sensors": {"force_noise": STEP, "force_step": STEP}})
    system, limit = assemble(scene), {"color": "k", "linestyle": "--"}
    law = scene.valve.flow_law(scene.fluid, scene.actuator.area)
    high = scene.supply.high
    sizes = np.array([1.0, 0.5, 0.25])
    drops, knees = np.logspace(3, 7.5)[:, None], law.knee / sizes**2
    valve.loglog(
        drops / BAR, 1e9 * law.flow(sizes, drops), label=[f"h* = {size:g}" for size in sizes]
    )
    valve.plot(knees / BAR, 1e9 * law.flow(sizes, knees), "ko", label="$ΔP_{crit}$")
    valve.axvline(high / BAR, label="$P_{high}$", **limit)

    openings, depths = np.linspace(0.0, 1.0), np.linspace(0.0, 2.5e-3)
    for diameter, exponent in ((0.8, 2000), (0.25, 1500), (0.2, 1000)):
        changed = {"conduit": {"diameter": f"{diameter} mm"}, "contact": {"exponent": exponent}}
        cell = assemble(digiclay.scene(changed)).cell
        speeds = cell.flow.flow(openings, np.full(50, high)) / cell.actuator.area
        conduit.plot(openings, MM * speeds, label=f"$D_c$ = {diameter} mm")
        contact.plot(MM * depths, cell.touch.contact.tension(depths), label=f"m = {exponent} 1/m")
    contact.plot(
        MM * depths, cell.touch.contact.stiffness * depths, "k--", label="slope b at $x_0$ = 0"
    )

    dead = scene.delay.dead_time
    end = scene.valve_lag.time_constant
    times = np.linspace(0.0, 12e-3, 241)
    lag.plot(
        MM * times,
        system.cell.lag.response(split_delay(scene.delay, 1.0), times)[:, -1],
        label="opening K",
    )
    lag.axhline(1.0, label="command", **limit)
    lag.axvspan(0.0, MM * dead, alpha=0.3, label="$t_d$")
    lag.axvspan(MM * dead, MM * (dead + end), color=LINES[4], alpha=0.3, label="$τ_v$")

    pulp, times = system.cell.touch.pulp, np.logspace(-4, 1.5)
    relaxation.semilogx(times, pulp.reduced(times), label="G(t)")
    relaxation.plot(pulp.times, pulp.reduced(pulp.times), "ko", label="1/$ν_1$, 1/$ν_2$, 1/$ν_3$")
    relaxation.axhline(1.0 - pulp.shares.sum(), label="$c_0$/Σc", **limit)

    none, cells = np.zeros(300), np.arange(300)
    seen = Measurement(none, none, none, none, none, none, cells)
    label = f"$σ_F$ = {STEP}, $q_F$ = {STEP}"
    sensors.plot(cells, MM * system.sensors.measure(seen, 0)[0], ".", label=label)
    sensors.axhline(MM * scene.sensors.force_floor, label="noise floor $F_n$", **limit)
    sensors.set_ylim(-8.0, 18.0)
