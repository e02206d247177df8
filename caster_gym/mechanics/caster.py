"""One caster rolling without slip. Derivation: docs/equations.md, section K.

a and b are the velocity of the pivot along f and along its left normal f⊥ = (−sin δ, cos δ) [m/s].
A row g is the gradient of a joint's rate with respect to the twist: rate = g · v.
"""

from caster_gym.mechanics.parameters import CasterParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Vector


def pivot_velocity(v: Vector, f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Velocity of the steering axis along f and f⊥. [m/s]"""
    c, s = f
    vx, vy, omega = v
    ax, ay = vx - omega * caster.y, vy + omega * caster.x
    return c * ax + s * ay, c * ay - s * ax


def rates(v: Vector, f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar, Scalar]:
    """Yaw rate over ground, rolling rate and steering rate. [rad/s]"""
    a, b = pivot_velocity(v, f, caster)
    eta = b / caster.trail  # (K1)
    theta = (a - caster.offset * eta) / caster.radius  # (K2)
    return eta, theta, eta - v[2]  # (K3)


def rate_rows(f: Direction, caster: CasterParameters) -> tuple[Vector, Vector, Vector]:
    """Rows g_η, g_θ, g_δ: they exist for every δ, since trail and radius are positive."""
    c, s = f
    d, r, o = caster.trail, caster.radius, caster.offset
    eta = (-s / d, c / d, (caster.x * c + caster.y * s) / d)  # (K1)
    theta = ((c - o * eta[0]) / r, (s - o * eta[1]) / r, (caster.x * s - caster.y * c - o * eta[2]) / r)  # (K2)
    delta = (eta[0], eta[1], eta[2] - 1.0)  # (K3)
    return eta, theta, delta


def rate_drifts(v: Vector, f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar, Scalar]:
    """ε_η, ε_θ, ε_δ: the joints' accelerations at constant twist. [rad/s²]"""
    a, b = pivot_velocity(v, f, caster)
    delta = b / caster.trail - v[2]
    e_eta = -(a / caster.trail) * delta  # (K4)
    e_theta = (b * delta - caster.offset * e_eta) / caster.radius  # (K4)
    return e_eta, e_theta, e_eta


def joint_rates(v: Vector, f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Rolling rate and steering rate, the two that motors turn. [rad/s]"""
    _, theta, delta = rates(v, f, caster)
    return theta, delta


def wheel_centre(f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Point O = A − d f + s f⊥ above the contact with the floor, in B. [m]"""
    c, s = f
    return caster.x - caster.trail * c - caster.offset * s, caster.y - caster.trail * s + caster.offset * c


def link_mass_centre(f: Direction, caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Mass centre A − l f + q f⊥ of the steering link, in B. [m]"""
    c, s = f
    behind, left = caster.link_behind, caster.link_left
    return caster.x - behind * c - left * s, caster.y - behind * s + left * c
