"""The natural orthogonal complement: the dynamics in three independent joint rates. docs/analysis.md, section N.

    q̇      rates (η̇_i, θ̇_i, δ̇_i) of all casters, one caster after the other                [rad/s]   (…, 3 N)
    q̇_a    the three independent ones, in the order of their names; q̇_p the others, in the order of q̇
    K_i    twist of the platform at C from the rates of caster i, section J's forward Jacobian         (…, 3, 3)
    J_p    of the closed loops, J_p q̇_p = J_a q̇_a                                         (…, 3 N − 3, 3 N − 3)
    S      q̇ = S q̇_a                                                                                 (…, 3 N, 3)
    T      twists (angular velocity, velocity of the mass centre) of all bodies from q̇     (…, 6 (2 N + 1), 3 N)
    G      the same from q̇_a: G = T S, the natural orthogonal complement                     (…, 6 (2 N + 1), 3)

Vectors have their components in the inertial frame that coincides with B at the moment: derivatives are true ones. The
bodies are the wheels, the links and the platform, in this order. Nothing here uses the operational-space dynamics: the
chains' kinematics and a robot's numbers are all that they share, so that agreement means something.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.analysis.checked import finite
from caster_gym.analysis.frames import rate_in_body
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.dynamics import joint_friction
from caster_gym.robot import Robot, check_joints
from papers.analysis.joint_kinematics import forward_jacobian, inertial_hessian
from papers.analysis.mobility import closed, loop_closure

INDEPENDENT = 3  # joint rates: as many as the platform has degrees of freedom


class Vectors(NamedTuple):
    """What turns: or, with `one` = 0, how fast each of them turns."""

    f: Array  # (…, N, 2) rolling directions
    left: Array  # (…, N, 2) f⊥
    com: Array  # (…, 2) mass centre of the platform, from C [m]
    one: float


class Motion(NamedTuple):
    """What independent rates and torques imply."""

    twist: Array  # (..., 3) of the platform at C, in B
    rates: Array  # (..., 3 N) q̇
    accelerations: Array  # (..., 3) q̈_a [rad/s²]


class Embedding(NamedTuple):
    """The rates and twists that the independent rates imply, and how the maps change."""

    s: Array
    s_rate: Array
    g: Array
    g_rate: Array
    k: Array  # of the first caster
    k_rate: Array
    rates: Array  # q̇ (…, 3 N)
    left: Array


class OrthogonalComplement:
    """Dynamics of a robot in terms of three of its joint rates, as in chung2008, (20) to (30).

    independent: three joints, such as ("roll_1", "roll_2", "steer_3"); there are configurations in which these do not
    tell how the robot moves, and near them the results are worthless (`condition_number`).
    as_printed: form the matrix C of (30) and multiply it with the rates, instead of multiplying C q̇_a from the right,
    vector by vector, which loses less near those configurations.
    steering (..., N) [rad], rates (..., 3) of the independent joints [rad/s], torque (..., 2 N) at all joints [N m];
    leading axes are a batch. Friction of joints and contact patches is included.
    Raises ValueError for other than three known joints, arrays of the wrong last axis, values that are not finite, and
    a J_p, or an inertia I built on it, that is singular to the last digit.
    """

    def __init__(self, robot: Robot, independent: Sequence[str], as_printed: bool = False) -> None:
        if isinstance(independent, str) or len(independent) != INDEPENDENT:
            raise ValueError(f"independent must name {INDEPENDENT} joints, got {independent!r}")
        self.robot = robot
        self.as_printed = as_printed
        self.independent = check_joints(tuple(independent), robot.caster_count)
        self.model = Model(robot)
        place = {"roll": 1, "steer": 2}
        named = [joint.split("_") for joint in self.independent]
        self._a = [3 * (int(number) - 1) + place[kind] for kind, number in named]
        self._p = [i for i in range(3 * robot.caster_count) if i not in self._a]
        self._numbers = _Numbers(robot)

    @property
    def dependent(self) -> tuple[str, ...]:
        """Names of the other joints, yaw_i among them, in the order of q̇_p."""
        return tuple(f"{('yaw', 'roll', 'steer')[i % 3]}_{i // 3 + 1}" for i in self._p)

    def loops(self, steering: ArrayLike) -> tuple[Array, Array]:
        """J_p and J_a: every caster says how the platform moves, and all must say the same."""
        return self._split(loop_closure(self.robot, steering))

    def condition_number(self, steering: ArrayLike) -> Array:
        """Of J_p (...), all its rows in m/s: angular velocities times the characteristic length of the robot."""
        j_p, _ = self.loops(steering)
        rows = np.tile([1.0, 1.0, self.model.characteristic_length], self.robot.caster_count - 1)
        return np.asarray(np.linalg.cond(j_p * rows[:, None]))

    def independent_rates(self, steering: ArrayLike, twist: ArrayLike) -> Array:
        """q̇_a (..., 3) of a platform twist (..., 3): what has to be computed anew at each change of coordinates."""
        rows = self.model.jacobian(steering, self.independent)
        return np.asarray(np.einsum("...jk,...k->...j", rows, finite("twist", twist, 3)))

    def all_rates(self, steering: ArrayLike, rates: ArrayLike) -> Array:
        """q̇ (..., 3 N) of the independent rates."""
        s = self._complete(*self.loops(steering))
        return _times(s, finite("rates", rates, INDEPENDENT))  # (N3)

    def twist(self, steering: ArrayLike, rates: ArrayLike) -> Array:
        """Platform twist (..., 3) of the independent rates."""
        k = forward_jacobian(self.robot, steering)[..., 0, :, :]
        return _times(k, self.all_rates(steering, rates)[..., :3])

    def equations(self, steering: ArrayLike, rates: ArrayLike) -> tuple[Array, Array]:
        """I and C (..., 3, 3) of I q̈_a + C q̇_a = Sᵀ τ."""
        angles = self._steering(steering)
        e = self._embed(angles, finite("rates", rates, INDEPENDENT))
        return self._inertia(e), self._coriolis(e, np.eye(INDEPENDENT))

    def motion(self, steering: ArrayLike, rates: ArrayLike, torque: ArrayLike) -> Motion:
        """How the robot moves on."""
        accelerations, e = self._solve(steering, rates, torque)
        return Motion(_times(e.k, e.rates[..., :3]), e.rates, accelerations)

    def forward_dynamics(self, steering: ArrayLike, twist: ArrayLike, torque: ArrayLike) -> Array:
        """Twist rate (..., 3) as `Model.forward_dynamics` gives it, by way of the independent joints."""
        rates = self.independent_rates(steering, twist)
        accelerations, e = self._solve(steering, rates, torque)
        joint = _times(e.s, accelerations) + _times(e.s_rate, rates)
        true = _times(e.k, joint[..., :3]) + _times(e.k_rate, e.rates[..., :3])
        return rate_in_body(true, _times(e.k, e.rates[..., :3]))  # (N8)

    def _solve(self, steering: ArrayLike, rates: ArrayLike, torque: ArrayLike) -> tuple[Array, Embedding]:
        q_a = finite("rates", rates, INDEPENDENT)
        torques = finite("torque", torque, 2 * self.robot.caster_count)
        e = self._embed(self._steering(steering), q_a)
        if self.as_printed:
            inertial = _times(self._coriolis(e, np.eye(INDEPENDENT)), q_a)
        else:
            inertial = self._coriolis(e, q_a[..., None])[..., 0]
        effective = _times(np.swapaxes(e.s, -1, -2), self._numbers.applied(e.rates, torques))
        return self._solved(self._inertia(e), (effective - inertial)[..., None])[..., 0], e  # (N7)

    def _embed(self, steering: Array, q_a: Array) -> Embedding:
        """All maps from the independent rates, with their derivatives."""
        vectors = self._vectors(steering)
        k = forward_jacobian(self.robot, steering)
        j_p, j_a = self._split(closed(k))
        s = self._complete(j_p, j_a)
        rates = _times(s, q_a)
        eta, omega = rates[..., ::3], _times(k[..., 0, :, :], rates[..., :3])[..., 2]
        turning = Vectors(
            eta[..., None] * vectors.left,
            -eta[..., None] * vectors.f,
            omega[..., None] * _turned(vectors.com),
            0.0,
        )
        by_caster = rates.reshape(*rates.shape[:-1], -1, 1, 3, 1)
        k_rate = (inertial_hessian(self.robot, steering) @ by_caster)[..., 0]
        j_p_rate, j_a_rate = self._split(closed(k_rate))
        p_rate = self._solved(j_p, j_a_rate - j_p_rate @ s[..., self._p, :])  # (N4)
        s_rate = np.zeros((*p_rate.shape[:-2], *s.shape[-2:]))
        s_rate[..., self._p, :] = p_rate
        t = self._numbers.twists(vectors, k[..., 0, :, :])
        t_rate = self._numbers.twists(turning, k_rate[..., 0, :, :])
        g, g_rate = t @ s, t_rate @ s + t @ s_rate  # (N5)
        return Embedding(s, s_rate, g, g_rate, k[..., 0, :, :], k_rate[..., 0, :, :], rates, vectors.left)

    def _inertia(self, e: Embedding) -> Array:
        s_t, g_t = np.swapaxes(e.s, -1, -2), np.swapaxes(e.g, -1, -2)
        rotors = self._numbers.rotors
        return np.asarray(g_t @ self._numbers.momenta(e.g, e.left) + s_t @ (rotors @ e.s))  # (N6)

    def _coriolis(self, e: Embedding, x: Array) -> Array:
        """C x of columns x (…, 3, k), multiplied from the right: C itself where x is the unit matrix.

        GᵀWMG is zero: the gyroscopic moment of a wheel points along its rolling direction, and the floor takes it.
        """
        s_t, g_t = np.swapaxes(e.s, -1, -2), np.swapaxes(e.g, -1, -2)
        rotors = self._numbers.rotors
        return np.asarray(g_t @ self._numbers.momenta(e.g_rate @ x, e.left) + s_t @ (rotors @ (e.s_rate @ x)))  # (N6)

    def _complete(self, j_p: Array, j_a: Array) -> Array:
        s = np.zeros((*j_p.shape[:-2], 3 * self.robot.caster_count, INDEPENDENT))
        s[..., self._a, range(INDEPENDENT)] = 1.0
        s[..., self._p, :] = self._solved(j_p, j_a)  # (N3)
        return s

    def _split(self, closures: Array) -> tuple[Array, Array]:
        """J_p and J_a from the matrix of all closed loops."""
        return closures[..., self._p], -closures[..., self._a]  # (N1)

    def _solved(self, matrix: Array, right: Array) -> Array:
        try:
            return np.asarray(np.linalg.solve(matrix, right))
        except np.linalg.LinAlgError:
            names = ", ".join(self.independent)
            raise ValueError(f"the joints {names} do not tell here how the robot moves: J_p or I is singular") from None

    def _steering(self, steering: ArrayLike) -> Array:
        return finite("steering", steering, self.robot.caster_count)

    def _vectors(self, steering: Array) -> Vectors:
        f = np.stack((np.cos(steering), np.sin(steering)), -1)
        return Vectors(f, _turned(f), self._numbers.com, 1.0)


class _Numbers:
    """Geometry and masses of a robot as arrays over its casters, and the maps that are made of them alone."""

    def __init__(self, robot: Robot) -> None:
        def column(values: list[float]) -> Array:
            return np.array(values)[:, None]

        casters = robot.casters
        self.count = len(casters)
        self.com = np.array(robot.platform.com)
        self.radius = column([c.radius for c in casters])
        self.ahead = column([c.trail - c.link.com[0] for c in casters])  # p: from the wheel's centre to the link's
        self.right = column([c.offset - c.link.com[1] for c in casters])  # σ
        wheels = [[c.wheel.yaw_inertia] * 3 + [c.wheel.mass] * 3 for c in casters]
        links = [[0.0, 0.0, c.link.inertia] + [c.link.mass] * 3 for c in casters]
        platform = [0.0, 0.0, robot.platform.inertia] + [robot.platform.mass] * 3
        self.diagonal = np.array([*wheels, *links, platform])[..., None]  # of M, but for the axles' share
        self.axle = np.array([c.wheel.spin_inertia - c.wheel.yaw_inertia for c in casters])
        self.rotors = np.zeros((3 * self.count, 3 * self.count))  # over η, θ, δ of each caster, gears included
        for i, c in enumerate(casters):
            gear, motors = np.array(c.gear), (c.roll, c.steer)
            own = np.diag([motor.armature for motor in motors])
            joints = slice(3 * i + 1, 3 * i + 3)
            self.rotors[joints, joints] = own + gear.T @ np.diag([motor.rotor for motor in motors]) @ gear
        self.viscous = np.array([b for c in casters for b in (c.scrub, c.roll.viscous, c.steer.viscous)])
        self.coulomb = np.array([b for c in casters for b in (0.0, c.roll.coulomb, c.steer.coulomb)])
        self.coulomb_speed = robot.coulomb_speed

    def twists(self, v: Vectors, k: Array) -> Array:
        """T, or its rate of change; k of the first caster."""
        n = self.count
        t = np.zeros((*v.f.shape[:-2], 2 * n + 1, 6, 3 * n))
        for i in range(n):
            eta, theta = 3 * i, 3 * i + 1
            rolling = self.radius[i] * v.f[..., i, :]
            t[..., i, 2, eta] = t[..., n + i, 2, eta] = v.one
            t[..., i, :2, theta] = v.left[..., i, :]
            t[..., i, 3:5, theta] = t[..., n + i, 3:5, theta] = rolling
            t[..., n + i, 3:5, eta] = self.right[i] * v.f[..., i, :] + self.ahead[i] * v.left[..., i, :]
        t[..., 2 * n, 2, :3] = k[..., 2, :]
        t[..., 2 * n, 3:5, :3] = k[..., :2, :]
        t[..., 2 * n, 3:5, :3] += _turned(v.com)[..., None] * [1.0, 0.0, -1.0]  # (N5)
        return t.reshape(*t.shape[:-3], -1, 3 * n)

    def momenta(self, twists: Array, left: Array) -> Array:
        """M times columns of twists (…, 6 (2 N + 1), k); left: the axles (…, N, 2)."""
        bodies = twists.reshape(*twists.shape[:-2], -1, 6, twists.shape[-1])
        momenta = self.diagonal * bodies
        along = self.axle[:, None] * np.einsum("...ni,...nij->...nj", left, bodies[..., : self.count, :2, :])
        momenta[..., : self.count, :2, :] += left[..., None] * along[..., None, :]
        return momenta.reshape(twists.shape)

    def applied(self, rates: Array, torques: Array) -> Array:
        """Torques (…, 3 N) that act on all joints: the given ones less friction."""
        tau = -joint_friction(rates, self.viscous, self.coulomb, self.coulomb_speed)
        pairs = torques.reshape(*torques.shape[:-1], self.count, 2)
        shape = np.broadcast_shapes(tau.shape[:-1], torques.shape[:-1])
        tau = np.broadcast_to(tau, (*shape, 3 * self.count)).copy()
        tau.reshape(*shape, self.count, 3)[..., 1:] += pairs
        return tau


def _turned(v: Array) -> Array:
    """ẑ × v."""
    return np.stack((-v[..., 1], v[..., 0]), -1)


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[..., None])[..., 0])
