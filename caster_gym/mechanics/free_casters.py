"""The robot whose wheels may slip: casters that are only pinned to the platform. docs/equations.md, section S.

Each caster has two motions of its own, the yaw of link and wheel over ground and the roll of the wheel, and nothing
but the platform couples them. The inertia matrix is an arrow: a constant 2×2 block for each caster and a border of
three rows for the platform. Once the casters are eliminated, one by one, what is left is 3×3.

    rates    (eta, theta) of one caster                                               [rad/s]
    u        velocity of a wheel's material point at the floor, along f and f⊥        [m/s]
    D        inertia of one caster at (eta, theta) while its pivot is held            [kg m²]
    C        columns at eta and theta that couple it to the platform
    E        rows that give u from the rates
"""

from typing import NamedTuple

from caster_gym.mechanics.caster import pivot_velocity
from caster_gym.mechanics.caster_masses import Slopes, first_moments, held_inertia
from caster_gym.mechanics.dynamics import platform_inertia
from caster_gym.mechanics.linear import dot, subtract
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, each, total

Pair = tuple[Scalar, Scalar]


class OwnInertia(NamedTuple):
    """Inertia of one caster about its pivot, friction at a step's end included."""

    steer: Scalar  # J_δ [kg m²]
    inverse: tuple[Scalar, Scalar, Scalar]  # of D at (eta, eta), (eta, theta), (theta, theta)


class Border(NamedTuple):
    """What the platform feels of one caster that answers freely."""

    eta: Vector  # change of eta against the twist: D⁻¹ Cᵀ
    theta: Vector  # the same of theta
    inertia: Symmetric  # what it adds to the platform's


class Forces(NamedTuple):
    """Known forces of one caster: moments at its own motions, and the wrench on the platform."""

    at_eta: Scalar
    at_theta: Scalar
    at_platform: Vector


def pivot_rows(f: Direction, caster: CasterParameters) -> tuple[Vector, Vector]:
    """Rows that give the pivot's velocity along f and f⊥ from the twist."""
    c, s = f
    x, y = caster.x, caster.y
    return (c, s, x * s - y * c), (-s, c, x * c + y * s)


def slip_velocity(v: Vector, f: Direction, rates: Pair, caster: CasterParameters) -> Pair:
    """Velocity of the wheel's material point at the floor along f and f⊥. [m/s]"""
    a, b = pivot_velocity(v, f, caster)
    eta, theta = rates
    return a - caster.offset * eta - caster.radius * theta, b - caster.trail * eta  # (S1)


def own_inertia(shares: Slopes, caster: CasterParameters) -> OwnInertia:
    """D of one caster, inverted. Shares of friction from `implicit_shares`, zero without. [kg m²]"""
    yaw, spin = held_inertia(caster)
    steer, cross = caster.steer_armature + shares.steer, caster.cross_armature
    ee, tt = yaw + shares.scrub + steer, spin + caster.roll_armature + shares.roll  # (S2)
    scale = 1.0 / (ee * tt - cross * cross)
    return OwnInertia(steer, (tt * scale, -cross * scale, ee * scale))


def border(f: Direction, own: OwnInertia, caster: CasterParameters) -> Border:
    """One caster, eliminated."""
    mass, behind, left = first_moments(caster)
    along, across = pivot_rows(f, caster)
    x, y, k = caster.x, caster.y, caster.cross_armature
    c0 = -left * along[0] - behind * across[0]  # (S3)
    c1 = -left * along[1] - behind * across[1]
    c2 = -left * along[2] - behind * across[2] - own.steer
    ee, et, tt = own.inverse
    eta = (ee * c0, ee * c1, ee * c2 - et * k)
    theta = (et * c0, et * c1, et * c2 - tt * k)
    inertia = (  # (S4)
        mass - c0 * eta[0],
        -c0 * eta[1],
        -mass * y - c0 * eta[2],
        mass - c1 * eta[1],
        mass * x - c1 * eta[2],
        mass * (x * x + y * y) + own.steer - c2 * eta[2] + k * theta[2],
    )
    return Border(eta, theta, inertia)


def floor_rows(f: Direction, edge: Border, caster: CasterParameters) -> tuple[Vector, Vector]:
    """Rows that give u of a caster that answers freely from a change of the twist."""
    along, across = pivot_rows(f, caster)
    d, s, r = caster.trail, caster.offset, caster.radius
    return (  # (S5)
        (
            along[0] + s * edge.eta[0] + r * edge.theta[0],
            along[1] + s * edge.eta[1] + r * edge.theta[1],
            along[2] + s * edge.eta[2] + r * edge.theta[2],
        ),
        (across[0] + d * edge.eta[0], across[1] + d * edge.eta[1], across[2] + d * edge.eta[2]),
    )


def floor_mobility(own: OwnInertia, caster: CasterParameters) -> tuple[Scalar, Scalar, Scalar]:
    """K = E D⁻¹ Eᵀ at (f, f), (f, f⊥), (f⊥, f⊥): how u answers to a force while the pivot is held. [1/kg]"""
    ee, et, tt = own.inverse
    d, s, r = caster.trail, caster.offset, caster.radius
    return s * s * ee + 2.0 * s * r * et + r * r * tt, d * (s * ee + r * et), d * d * ee  # (S5)


def turning_forces(v: Vector, f: Direction, rates: Pair, caster: CasterParameters) -> Forces:
    """What one caster takes at constant twist and rates, as forces that hold them. [N, N m]"""
    omega, eta = v[2], rates[0]
    mass, behind, left = first_moments(caster)
    a, b = pivot_velocity(v, f, caster)
    along, across = pivot_rows(f, caster)
    n_f = behind * eta * eta - mass * omega * b  # (S6)
    n_p = mass * omega * a - left * eta * eta
    return Forces(
        omega * (left * b - behind * a),
        0.0 * n_f,
        (
            along[0] * n_f + across[0] * n_p,
            along[1] * n_f + across[1] * n_p,
            along[2] * n_f + across[2] * n_p,
        ),
    )


def joint_forces(omega: Scalar, torque: Pair, rates: Pair, slopes: Slopes) -> Forces:
    """Torques at the joints of one caster less their friction at given rates."""
    eta, theta = rates
    roll, steer = torque
    steer = steer - slopes.steer * (eta - omega)
    nothing = 0.0 * steer
    return Forces(steer - slopes.scrub * eta, roll - slopes.roll * theta, (nothing, nothing, -steer))


def balance(given: Forces, taken: Forces) -> Forces:
    """What is left of the forces given after those taken."""
    p, q = given.at_platform, taken.at_platform
    return Forces(
        given.at_eta - taken.at_eta,
        given.at_theta - taken.at_theta,
        subtract(p, q),
    )


def free_response(h: Scalar, rates: Pair, own: OwnInertia, forces: Forces) -> Pair:
    """Rates after forces over h seconds while the pivot is held."""
    ee, et, tt = own.inverse
    e, t = h * forces.at_eta, h * forces.at_theta
    return rates[0] + ee * e + et * t, rates[1] + et * e + tt * t


def felt_force(edge: Border, forces: Forces) -> Vector:
    """Force on the platform of one caster that answers freely."""
    p, e, t = forces.at_platform, forces.at_eta, forces.at_theta
    return (
        p[0] - edge.eta[0] * e - edge.theta[0] * t,
        p[1] - edge.eta[1] * e - edge.theta[1] * t,
        p[2] - edge.eta[2] * e - edge.theta[2] * t,
    )


def edge_inertia(edge: Border) -> Symmetric:
    """What one caster adds to the platform's inertia."""
    return edge.inertia


def follow(change: Vector, rates: Pair, edge: Border) -> Pair:
    """Rates of a caster that answers freely to a change of the twist."""
    return rates[0] - dot(edge.eta, change), rates[1] - dot(edge.theta, change)  # (S4)


def push_back(impulse: Pair, own: OwnInertia, caster: CasterParameters) -> Pair:
    """Change of a caster's rates by an impulse of the floor along f and f⊥ while the pivot is held."""
    ee, et, tt = own.inverse
    e, t = -caster.offset * impulse[0] - caster.trail * impulse[1], -caster.radius * impulse[0]
    return ee * e + et * t, et * e + tt * t


def caster_energy(v: Vector, f: Direction, rates: Pair, caster: CasterParameters) -> tuple[Scalar]:
    """Kinetic energy of one caster. [J]"""
    mass, behind, left = first_moments(caster)
    yaw, spin = held_inertia(caster)
    a, b = pivot_velocity(v, f, caster)
    eta, theta = rates
    delta = eta - v[2]
    moving = 0.5 * mass * (a * a + b * b) - (left * a + behind * b) * eta + 0.5 * yaw * eta * eta
    roll = 0.5 * (spin + caster.roll_armature) * theta * theta
    return (moving + roll + (caster.cross_armature * theta + 0.5 * caster.steer_armature * delta) * delta,)


def platform_energy(v: Vector, robot: RobotParameters) -> Scalar:
    """Kinetic energy of the platform. [J]"""
    xx, _, xz, yy, yz, zz = platform_inertia(robot.platform)
    return 0.5 * (xx * v[0] * v[0] + yy * v[1] * v[1] + zz * v[2] * v[2]) + (xz * v[0] + yz * v[1]) * v[2]


def slip_energy(
    v: Vector, directions: tuple[Direction, ...], rates: tuple[Pair, ...], robot: RobotParameters
) -> Scalar:
    """Kinetic energy of all bodies. [J] (S7)"""
    (casters,) = total(each(caster_energy, (v,), directions, rates, robot.casters))
    return platform_energy(v, robot) + casters
