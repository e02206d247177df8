"""The letters and signs of both papers, and today's: the one place that translates them.

    φ        a paper's steering angle                    δ   ours, from the body x-axis to the rolling direction
    θ̇        rolling rate, in chung2008 of opposite sign
    η̇        yaw rate over ground, the same everywhere; φ̇ = ω − η̇ = −δ̇ in both papers
    u̇        twist (v_x, v_y, ω) of the platform in its own frame, the same everywhere

A paper's joints of one caster come in the order η, θ, φ; joint sets are written such as (θ_1, φ_1, θ_2).
"""

import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.plausibility import RobotWarning
from caster_gym.robot import Caster, Footprint, Link, Motor, Platform, Robot, Wheel
from papers.analysis import joint_kinematics


class Notation(NamedTuple):
    """How a paper counts angles and rates."""

    name: str
    straight: float  # [rad] the paper's φ of a caster whose δ is zero: φ = straight − δ
    rolling: float  # sign of the paper's θ̇ relative to ours

    def steering(self, phi: ArrayLike) -> Array:
        """δ [rad] of a paper's φ [rad], and as well φ of δ: the map is its own inverse."""
        turned: Array = self.straight - np.asarray(phi, dtype=np.float64)
        return turned

    @property
    def rates(self) -> Array:
        """(3, 3): a paper's rates (η̇, θ̇, φ̇) of a caster from ours (η̇, θ̇, δ̇); its own inverse."""
        return np.diag([1.0, self.rolling, -1.0])

    def inverse_jacobian(self, robot: Robot, phi: ArrayLike) -> Array:
        """G_u^φ (..., N, 3, 3) of a paper, from our mechanics: the rates (η̇, θ̇, φ̇) from the twist."""
        return self.rates @ joint_kinematics.inverse_jacobian(robot, self.steering(phi))

    def forward_jacobian(self, robot: Robot, phi: ArrayLike) -> Array:
        """G_φ^u (..., N, 3, 3) of a paper, from our mechanics: the twist from the rates (η̇, θ̇, φ̇)."""
        return joint_kinematics.forward_jacobian(robot, self.steering(phi)) @ self.rates

    def forward_hessian(self, robot: Robot, phi: ArrayLike) -> Array:
        """H_φφ^u (..., N, 3, 3, 3) of a paper, from our mechanics: planes of u, rows and columns of (η, θ, φ)."""
        return self.rates @ joint_kinematics.forward_hessian(robot, self.steering(phi)) @ self.rates

    def inertial_hessian(self, robot: Robot, phi: ArrayLike) -> Array:
        """The same of the acceleration of C over ground, along the axes of the body frame."""
        return self.rates @ joint_kinematics.inertial_hessian(robot, self.steering(phi)) @ self.rates

    def inverse_hessian(self, robot: Robot, phi: ArrayLike) -> Array:
        """H_uu^φ (..., N, 3, 3, 3) of a paper, from our mechanics: planes of (η, θ, φ), rows and columns of u."""
        turned: Array = np.einsum(
            "ij,...jmn->...imn", self.rates, joint_kinematics.inverse_hessian(robot, self.steering(phi))
        )
        return turned


CHUNG2008 = Notation("chung2008", straight=np.pi, rolling=-1.0)
KIM2001 = Notation("kim2001", straight=0.5 * np.pi, rolling=1.0)

_LETTERS = {"roll": "θ", "steer": "φ"}


def in_letters(joints: Sequence[str]) -> str:
    """(θ_1, φ_1, θ_2) for [roll_1, steer_1, roll_2]."""
    return "(" + ", ".join(f"{_LETTERS[kind]}_{number}" for kind, number in (j.split("_") for j in joints)) + ")"


def in_words(letters: str) -> tuple[str, ...]:
    """("roll_1", "steer_1", "roll_2") for "θ_1 φ_1 θ_2". Raises ValueError for anything else."""
    kinds = {letter: kind for kind, letter in _LETTERS.items()}
    joints = [joint.partition("_") for joint in letters.split()]
    unknown = [letter + mark + number for letter, mark, number in joints if letter not in kinds or not number.isdigit()]
    if unknown:
        raise ValueError(f"a joint must be a letter θ or φ with a number, such as θ_1, got {unknown[0]!r}")
    return tuple(f"{kinds[letter]}_{number}" for letter, _, number in joints)


def kim2001_robot(radius: float, trail: float, a: float = 1.0) -> Robot:
    """The robot of kim2001, IV: pivots at the corners of an equilateral triangle, C at its centre. [m]

    radius: of the wheels, r; trail: length of the steering links, d; a: from C to the triangle's sides, so that b = 2a
    and l = 2√3 a. The paper has no masses, torques or footprint: the platform has 1 kg, 1 kg m² and the triangle as
    its outline, the casters have no mass and every motor has 1 N m and 1 rad/s, so that only kinematics are meant.
    Raises ValueError for a length that is not positive and finite.
    """
    for name, length in (("radius", radius), ("trail", trail), ("a", a)):
        if not 0.0 < length < float("inf"):
            raise ValueError(f"{name} must be a positive length, got {length}")
    half = float(np.sqrt(3.0)) * a
    pivots = ((-half, -a), (half, -a), (0.0, 2.0 * a))
    motor = Motor(max_torque=1.0, max_speed=1.0)
    first = Caster(
        x=-half,
        y=-a,
        trail=trail,
        radius=radius,
        wheel=Wheel(mass=0.0, spin_inertia=0.0, yaw_inertia=0.0),
        link=Link(mass=0.0, inertia=0.0),
        roll=motor,
        steer=motor,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotWarning)  # it is a drawing of a robot, in units of a
        return Robot(
            name="kim2001",
            platform=Platform(mass=1.0, inertia=1.0, footprint=Footprint(polygon=pivots)),
            casters=tuple(first.model_copy(update={"x": x, "y": y}) for x, y in pivots),
        )


class Lengths(NamedTuple):
    """The lengths of both papers, in their letters: pivots at (−l/2, −a), (l/2, −a) and (0, b). [m]"""

    l: float  # noqa: E741 - the papers' letter
    a: float
    b: float
    r: float  # radius of the wheels
    d: float  # length of the steering links

    @property
    def pivots(self) -> tuple[tuple[float, float], ...]:
        """(x, y) of the three pivots."""
        return ((-0.5 * self.l, -self.a), (0.5 * self.l, -self.a), (0.0, self.b))


def lengths_of(robot: Robot) -> Lengths:
    """The papers' letters of a robot. Raises ValueError if it has not the geometry that their matrices assume."""
    casters = robot.casters
    if len(casters) != 3:
        raise ValueError(f"the papers' matrices are for 3 casters, robot {robot.name!r} has {len(casters)}")
    first, second, third = casters
    found = Lengths(2.0 * second.x, -second.y, third.y, first.radius, first.trail)
    pivots = tuple((caster.x, caster.y) for caster in casters)
    if pivots != found.pivots:
        raise ValueError(f"the pivots must be (−l/2, −a), (l/2, −a) and (0, b), robot {robot.name!r} has {pivots}")
    unlike = [c for c in casters if (c.radius, c.trail, c.offset) != (found.r, found.d, 0.0)]
    if unlike:
        raise ValueError(
            f"all casters must have one radius, one trail and no lateral offset, robot {robot.name!r} has one with "
            f"radius {unlike[0].radius:g}, trail {unlike[0].trail:g} and offset {unlike[0].offset:g}"
        )
    return found
