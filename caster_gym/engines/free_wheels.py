"""Time steps for wheels that slip: without grip, a motor turns nothing but its own wheel and link.

Friction of floor and joints is implicit in the time step (docs/equations.md, section S), so that motors alone bound it:
their torque is that of the speed at a step's start, and full torque must not throw a free wheel beyond its top speed.
"""

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.time_scales import STEPS_TO_TOP
from caster_gym.engines.time_step import MOST_SUBSTEPS, follows, rounded_down, substeps_for
from caster_gym.mechanics.caster_masses import held_inertia
from caster_gym.mechanics.parameters import CasterParameters, unpack_parameters


def check_free_wheels(what: str, rows: Array, time_step: float, substeps: int) -> None:
    """Refuse a time step [s] that cannot follow the wheels of robots (R, fields) once they slip, and say which would.

    substeps: in how many such steps a control period is cut.
    """
    rates = free_rates(rows)
    robot, caster = np.unravel_index(int(rates.argmax()), rates.shape)
    rate = float(rates[robot, caster])
    if rate == 0.0 or follows(time_step, 1.0 / (STEPS_TO_TOP * rate)):
        return
    longest = 1.0 / (STEPS_TO_TOP * rate)
    count = substeps_for(time_step * substeps, longest)
    remedy = f"'substeps' of {count} would suffice, in place of {substeps}"
    if count > MOST_SUBSTEPS:
        remedy = f"{count:,} 'substeps', more than a task may have; give the wheels more inertia, or let the floor grip"
    raise ValueError(
        f"a time step of {time_step:g} s cannot follow {what} where wheels may slip: full torque brings the free wheel "
        f"of caster {caster + 1} to its top speed in {1.0 / rate:.2g} s; it must be at most {rounded_down(longest)} s: "
        f"{remedy}"
    )


def free_rates(rows: Array) -> Array:
    """Rates (R, N) at which full torque reaches the top speeds of each caster's motors while its wheel slips. [1/s]"""
    robots = unpack_parameters(tuple(rows.T))
    return np.stack([_rate(caster) for caster in robots.casters], axis=1)


def _rate(caster: CasterParameters) -> Array:
    """Greatest eigenvalue of D⁻¹ Γᵀ diag(torque / speed) Γ, of two rows and columns."""
    yaw, spin = held_inertia(caster)
    ee, tt, et = yaw + caster.steer_armature, spin + caster.roll_armature, caster.cross_armature
    roll = caster.roll_active * caster.roll_max_torque / caster.roll_max_speed
    steer = caster.steer_active * caster.steer_max_torque / caster.steer_max_speed
    a = roll * caster.gear_rs**2 + steer * caster.gear_ss**2
    b = roll * caster.gear_rr * caster.gear_rs + steer * caster.gear_sr * caster.gear_ss
    c = roll * caster.gear_rr**2 + steer * caster.gear_sr**2
    det = ee * tt - et * et
    half = 0.5 * (a * tt - 2.0 * b * et + c * ee) / det
    rate: Array = half + np.sqrt(np.maximum(half * half - (a * c - b * b) / det, 0.0))
    return rate
