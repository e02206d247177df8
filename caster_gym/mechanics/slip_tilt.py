"""The tilt of a robot whose wheels may slip, which shifts loads between them. docs/equations.md, section S."""

from caster_gym.mechanics.caster import pivot_velocity
from caster_gym.mechanics.floor_friction import NO_TIME
from caster_gym.mechanics.free_casters import Pair, pivot_rows
from caster_gym.mechanics.ground import platform_tilt
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import dot, scale
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Vector, add, each, maximum, total


def caster_motion(rate: Scalar, before: Pair, after: Pair, now: Pair) -> tuple[Pair, Pair]:
    """Rates of a caster now [rad/s], and what they change by in a second [rad/s²]."""
    return now, (rate * (after[0] - before[0]), rate * (after[1] - before[1]))


def free_tilt(
    v: Vector, v_rate: Vector, f: Direction, motion: tuple[Pair, Pair], caster: CasterParameters
) -> tuple[Scalar, Scalar]:
    """Moment, as height times force along x and y of B, by which a caster that may slip tilts the robot. [N m]"""
    (eta, theta), (eta_rate, theta_rate) = motion
    along, across = pivot_rows(f, caster)
    a, b = pivot_velocity(v, f, caster)
    a_f, a_p = dot(along, v_rate) - v[2] * b, dot(across, v_rate) + v[2] * a
    d, s, behind, left = caster.trail, caster.offset, caster.link_behind, caster.link_left
    wheel = a_f - s * eta_rate + d * eta * eta, a_p - d * eta_rate - s * eta * eta
    link = a_f - left * eta_rate + behind * eta * eta, a_p - behind * eta_rate - left * eta * eta
    m_w, m_l = caster.radius * caster.wheel_mass, caster.radius * caster.link_mass
    p = m_w * wheel[0] + m_l * link[0] + caster.spin_inertia * theta_rate  # (S10)
    q = m_w * wheel[1] + m_l * link[1] + caster.spin_inertia * theta * eta
    return p * f[0] - q * f[1], p * f[1] + q * f[0]


def tilt_after(
    change: Vector,
    rates: tuple[Pair, ...],
    start: State,
    middle: State,
    time: Scalar,
    wrench: Vector,
    robot: RobotParameters,
) -> Pair:
    """`ground.tilt` of a robot whose twist and rates change by so much over some seconds. [N m]"""
    rate = 1.0 / maximum(time, NO_TIME)
    v_rate = scale(rate, change)
    motions = each(caster_motion, (rate,), start.rates, rates, middle.rates)
    casters = total(each(free_tilt, (middle.twist, v_rate), middle.directions, motions, robot.casters))
    platform = platform_tilt(middle.twist, v_rate, wrench, robot.platform)
    return add(platform, casters)
