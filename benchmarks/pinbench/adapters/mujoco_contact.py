"""Adapter: MuJoCo, damped pins below soft constraints: moving joint limits, or contacts of spheres."""

from typing import Any

import numpy as np

from ..problem import Law

LIMITS, SPHERES = "MuJoCo, moving joint limits", "MuJoCo, contacts of spheres"
METHODS = dict.fromkeys((LIMITS, SPHERES), (5e-3, 1e-3, 5e-4))
#: Methods with another contact model.
APART = {SPHERES}
#: Mass of a pin, kg, where contacts of spheres have 0.01; radius of its top, m; depth of the fit, m.
MASS, RADIUS, DEPTH = 1e-6, 1e-3, 0.8e-3


def prepare(problem: Any, method: str, setting: float) -> Any:
    """Return what integrates a problem once at a step, s; nothing where pins are no dampers."""
    import mujoco

    law, spheres, tip = Law(problem), method == SPHERES, problem.file["fingertip"]
    damping = law.damping
    if damping is None or law.shares.size:
        return None
    axes, mass = f"{tip['length']} {tip['width']} {tip['height']}", 0.01 if spheres else MASS
    stiffness, impedance = fit_limit(law)
    # MuJoCo divides the stiffness by the square of the largest impedance.
    limit = f'solreflimit="{-stiffness * impedance[1] ** 2 / MASS} 0" solimplimit="{str(impedance)[1:-1]}"'
    pins = "".join(
        f'<body pos="{x} {y} {-RADIUS}"><joint type="slide" axis="0 0 1" range="-1 1" {limit}/>'
        f'<geom size="{RADIUS}" mass="{mass}" contype="0"/></body>'
        for x, y in zip(*problem.places, strict=True)
    )
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{setting}" gravity="0 0 0" integrator="implicitfast"/><worldbody>'
        f'<body mocap="true"><geom type="ellipsoid" size="{axes}" contype="{spheres:d}" conaffinity="0"/>'
        f"</body>{pins}</worldbody></mujoco>"
    )
    steps = round(law.period / setting)

    def solve() -> Any:
        data, rows = mujoco.MjData(model), []
        data.qpos[:], model.dof_damping[:] = law.begin()[0], damping
        for i in range(1, problem.count * steps + 1):
            if spheres:
                data.mocap_pos[0] = np.add(law.pose(i * setting), (0.0, 0.0, tip["height"]))
            else:
                model.jnt_range[:, 1] = law.underside((i - 1) * setting)
            mujoco.mj_step(model, data)
            if i % steps == 0 and i // steps in problem.judged:
                rows.append((data.qpos[problem.pins], -damping * data.qvel[problem.pins]))
        return rows

    return solve


def fit_limit(law: Any) -> tuple[float, Any]:
    """Return stiffness s, N/m, and solimp d(r): a damped pin without mass feels s r d² / (1 - d)."""
    from scipy.optimize import least_squares

    depth = np.linspace(0.02, 1.0, 50) * DEPTH
    stiffness = 1e4 * law.unit * law.exponent
    share = law.tension(depth) / (stiffness * depth)
    goal = (np.sqrt(share * share + 4.0 * share) - share) / 2.0

    def misfit(values: Any) -> Any:
        low, high, width, middle, power = values
        x = np.minimum(depth / width, 1.0)
        early = x**power / middle ** (power - 1.0)
        late = 1.0 - (1.0 - x) ** power / (1.0 - middle) ** (power - 1.0)
        return np.log((low + (high - low) * np.where(x < middle, early, late)) / goal)

    start, least, most = (
        (0.01, 0.1, 1e-3, 0.5, 2.5),
        (1e-4, 1e-3, DEPTH, 0.1, 1.0),
        (0.5, 0.99, 3e-3, 0.95, 6),
    )
    return stiffness, least_squares(misfit, start, bounds=(least, most), x_scale=start).x
