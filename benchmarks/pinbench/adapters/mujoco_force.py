"""Adapter: MuJoCo, pins on slide joints, the contact law of the problem applied as a force."""

from typing import Any

import numpy as np

from ..problem import Law

METHODS = {"MuJoCo, applied force": (5e-3, 1e-3, 5e-4)}
#: Mass of a pin, kg: as good as none; damping of a shut valve, N s/m.
MASS, SHUT = 1e-6, 1e9


def prepare(problem: Any, method: str, setting: float) -> Any:
    """Return what integrates a problem once at a step, s."""
    import mujoco

    mujoco.set_mju_user_warning(lambda text: None)  # of instability, which is compared
    law, stroke = Law(problem), problem.file["pin"]["stroke"]
    pin = f'<body><joint type="slide" axis="0 0 1"/><geom size="1e-3" mass="{MASS}"/></body>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{setting}" gravity="0 0 0" integrator="implicitfast">'
        f'<flag contact="disable"/></option><worldbody>{pin * problem.places[0].size}</worldbody></mujoco>'
    )
    steps, aged = round(law.period / setting), np.exp(-law.rates * setting)

    def solve() -> Any:
        data, state, rows = mujoco.MjData(model), law.begin(), []
        data.qpos[:], model.dof_damping[:] = state[0], law.damping or 0.0
        tension, force = law.load(0.0, state)
        for i in range(1, problem.count * steps + 1):
            middle = (i - 0.5) * setting
            if law.damping is None:
                opening = law.opening(middle, law.segment(middle))
                pushing = np.where(opening > 0.0, law.high, law.low) * law.area - force
                conductance = law.conductance(opening, pushing / law.area)
                model.dof_damping[:] = law.area**2 / np.maximum(conductance, law.area**2 / SHUT)
                data.qfrc_applied[:] = pushing
            else:
                np.negative(force, data.qfrc_applied)
            mujoco.mj_step(model, data)
            np.clip(data.qpos, 0.0, stroke, out=data.qpos)  # limits of joints without mass are soft
            state[0] = data.qpos
            if aged.size:
                state[1:] = aged * state[1:] + (1.0 - aged) * tension
            tension, force = law.load(i * setting, state)
            if i % steps == 0 and i // steps in problem.judged:
                rows.append((state[0, problem.pins], force[problem.pins]))
        return rows

    return solve
