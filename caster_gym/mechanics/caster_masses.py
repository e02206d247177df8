"""Masses of one caster about its pivot, and friction as part of them over a time step. docs/equations.md, section S.

Friction of a joint is a slope times its rate; half of it, or more where a step is long, is that of the step's end, and
counts as an inertia.
"""

from typing import NamedTuple

from caster_gym.mechanics.parameters import CasterParameters
from caster_gym.mechanics.scalars import Scalar, maximum, sqrt


class Slopes(NamedTuple):
    """One number for each kind of friction in a caster."""

    roll: Scalar  # of the rolling joint
    steer: Scalar  # of the steering joint
    scrub: Scalar  # of the contact patch against the yaw over ground


def first_moments(caster: CasterParameters) -> tuple[Scalar, Scalar, Scalar]:
    """Mass of wheel and link [kg], its moment behind the pivot and to the left of it [kg m]."""
    behind = caster.wheel_mass * caster.trail + caster.link_mass * caster.link_behind
    left = caster.wheel_mass * caster.offset + caster.link_mass * caster.link_left
    return caster.wheel_mass + caster.link_mass, behind, left


def held_inertia(caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Inertia of link and wheel about the pivot, and of the wheel about its axle, without rotors. [kg m²]"""
    d, s, behind, left = caster.trail, caster.offset, caster.link_behind, caster.link_left
    wheel, link = caster.wheel_mass * (d * d + s * s), caster.link_mass * (behind * behind + left * left)
    return caster.yaw_inertia + caster.link_inertia + wheel + link, caster.spin_inertia


def joint_slope(rate: Scalar, viscous: Scalar, coulomb: Scalar, coulomb_speed: Scalar) -> Scalar:
    """Friction of a joint for each unit of its rate: `dynamics.joint_friction` over the rate. [N m s/rad]"""
    return viscous + coulomb / sqrt(rate * rate + coulomb_speed * coulomb_speed)


def friction_slopes(
    omega: Scalar, coulomb_speed: Scalar, rates: tuple[Scalar, Scalar], caster: CasterParameters
) -> Slopes:
    """Friction of one caster for each unit of its rates. [N m s/rad]"""
    eta, theta = rates
    return Slopes(
        joint_slope(theta, caster.roll_viscous, caster.roll_coulomb, coulomb_speed),
        joint_slope(eta - omega, caster.steer_viscous, caster.steer_coulomb, coulomb_speed),
        caster.scrub,
    )


def implicit_share(h: Scalar, slope: Scalar, inertia: Scalar) -> Scalar:
    """What friction of a slope [N m s/rad] adds to an inertia [kg m²] when half of it is that of the step's end.

    More than half where the step is long, so that friction stops a light wheel and does not turn it back. (S8)
    """
    whole = h * slope
    return maximum(0.5 * whole, whole - inertia)


def implicit_shares(h: Scalar, slopes: Slopes, caster: CasterParameters) -> Slopes:
    """`implicit_share` of each kind of friction in one caster. [kg m²]"""
    yaw, spin = held_inertia(caster)
    return Slopes(
        implicit_share(h, slopes.roll, spin + caster.roll_armature),
        implicit_share(h, slopes.steer, 0.5 * (yaw + caster.steer_armature)),  # two brake the yaw
        implicit_share(h, slopes.scrub, 0.5 * (yaw + caster.steer_armature)),
    )


def without_friction(caster: CasterParameters) -> Slopes:
    """No friction in a caster."""
    nothing = 0.0 * caster.x
    return Slopes(nothing, nothing, nothing)
