"""Method III: regional height and force commands, by an estimate of the fingertip.

It is the framework that the paper asks for in its conclusion.

Observe, fit, solve, serve: the pulp's tension over each cell from its force; the known fingertip from the
undersides; the one height of the blister's top at which the forces predicted add up to the set point; the
valve commands that bring every pin to its height in time. Heights are the blister's around the predicted
place of the finger, and ahead of it as far as the speed of the pins asks for.
"""

from __future__ import annotations

from ..model.contact import Contact
from ..model.fingertip import Fingertip
from ..model.null_parts import Unrelaxed
from ..model.touch import Touch
from .device_info import DeviceInfo, check_floor
from .finger_estimate import FingerFilter, Spread
from .flow_servo import make_flow_servo
from .hybrid_controller import HybridControl
from .hybrid_parameters import Hybrid
from .lead_profile import LeadProfile
from .pulp_estimate import PulpEstimate
from .virtual_master import HEAVIEST, VirtualMaster
from .virtual_master import build as build_master

__all__ = ["Hybrid", "HybridControl", "build"]

#: How far beyond the fingertip's largest semi-axis cells may be touched, m.
BESIDE = 3e-3
#: Standard deviation of the forces of sensors without noise that the filter counts on, N.
QUIET = 2e-4
#: Noise beyond which a finger is taken to accelerate the less, the noisier its forces are, N: else the filter
#: follows the noise of 10 mN to velocities of 40 mm/s.
STEADY = 5e-4


def build(parameters: Hybrid, device: DeviceInfo) -> HybridControl:
    """Put Method III together for a device; the device has a blister."""
    assert device.blister is not None
    asked = parameters.force_setpoint
    check_floor(HEAVIEST * asked, "force_setpoint", asked, device.force_floor)
    # Without a finger nothing is ever felt.
    touch = device.cell.touch or Touch(Fingertip(), Contact(), Unrelaxed())
    servo = make_flow_servo(device.cell, device.period, device.dead_time, parameters.dead_band)
    noise = max(device.force_floor / 5.0, QUIET)
    spread = Spread(
        parameters.acceleration * min(STEADY / noise, 1.0),
        parameters.turn,
        parameters.size_drift,
        parameters.underside_error,
    )
    share = parameters.speed_share
    return HybridControl(
        parameters,
        device.blister,
        device,
        PulpEstimate(touch, device.period, servo.ahead, device.force_floor),
        FingerFilter(touch.fingertip, spread, device.period),
        LeadProfile(
            device.blister.flat_radius + parameters.level_margin,
            share * servo.rise,
            share * servo.fall,
            parameters.skirt_speed,
        ),
        servo,
        max(parameters.felt_force, device.force_floor),
        noise,
        max(touch.fingertip.length, touch.fingertip.width) + BESIDE,
        build_master(VirtualMaster(force_setpoint=asked, loss_time=parameters.loss_time), device),
    )
