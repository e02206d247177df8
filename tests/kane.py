"""The robot from first principles: Kane's equations over all 2 N + 1 bodies.

Nothing here is derived by hand. Where each body is and how it is turned stands as a function of the generalised
coordinates q = (x, y, β, η_1 … η_N, θ_1 … θ_N), η the yaw of a steering link over ground; automatic differentiation
gives velocities and accelerations. Rolling without slip is the statement that the material point of the wheel at the
floor is at rest. It shares no line with the package, only the numbers of `caster_gym.robot.Robot`.
"""

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor
from torch.func import jacfwd, jvp

from caster_gym.robot import Robot

POSE = (0.4, -0.3, 0.7)  # [m, m, rad] anywhere: the results are given in B
COULOMB_SPEED = 0.1  # [rad/s] dry friction is coulomb · rate / √(rate² + COULOMB_SPEED²)


class Kane:
    """Inertia, bias, accelerations and contact forces of a robot; all results in the body frame, at C."""

    def __init__(self, robot: Robot) -> None:
        def column(get: Callable[..., float]) -> Tensor:
            return torch.tensor([get(caster) for caster in robot.casters], dtype=torch.float64)

        self.count = robot.caster_count
        self.x, self.y = column(lambda c: c.x), column(lambda c: c.y)
        self.trail, self.offset = column(lambda c: c.trail), column(lambda c: c.offset)
        self.radius = column(lambda c: c.radius)
        self.behind, self.left = column(lambda c: c.link.com[0]), column(lambda c: c.link.com[1])
        self.platform_com, self.height = robot.platform.com, robot.platform.height
        self.masses = torch.cat(
            (_vector(robot.platform.mass), column(lambda c: c.link.mass), column(lambda c: c.wheel.mass))
        )
        flat = torch.cat((_vector(robot.platform.inertia), column(lambda c: c.link.inertia)))
        upright = torch.zeros(self.count + 1, 3, dtype=torch.float64)
        upright[:, 2] = flat  # only their yaw inertia is ever felt
        yaw, spin = column(lambda c: c.wheel.yaw_inertia), column(lambda c: c.wheel.spin_inertia)
        self.inertias = torch.diag_embed(torch.cat((upright, torch.stack((yaw, spin, yaw), -1))))
        armatures = torch.cat((column(lambda c: c.roll.armature), column(lambda c: c.steer.armature)))
        rotors = torch.cat((column(lambda c: c.roll.rotor), column(lambda c: c.steer.rotor)))
        self.spinning = torch.cat((armatures, rotors))  # inertias of what turns with the joints and with the motors
        self.viscous = torch.cat((column(lambda c: c.roll.viscous), column(lambda c: c.steer.viscous)))
        self.coulomb = torch.cat((column(lambda c: c.roll.coulomb), column(lambda c: c.steer.coulomb)))
        self.scrub = column(lambda c: c.scrub)
        n = self.count
        identity, zero = torch.eye(n, dtype=torch.float64), torch.zeros(n, n, dtype=torch.float64)
        heading = torch.zeros(n, 3, dtype=torch.float64)
        heading[:, 2] = 1.0
        self.joints = torch.cat(  # rates of the joints θ_1 …, δ_1 = η_1 − β … from the rates of q
            (torch.cat((0.0 * heading, zero, identity), 1), torch.cat((-heading, identity, zero), 1))
        )
        self.yaws = torch.cat((0.0 * heading, identity, zero), 1)
        gears = torch.tensor([caster.gear for caster in robot.casters], dtype=torch.float64)
        theta, delta = self.joints[:n], self.joints[n:]
        motors = [gears[:, k, :1] * theta + gears[:, k, 1:] * delta for k in (0, 1)]
        self.spins = torch.cat((self.joints, *motors))  # rates of joints and motors from the rates of q

    # Where the bodies are: platform, links, wheels.

    def _points(self, q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Pivots, rolling directions and their left normals, in W."""
        pivots = q[:2] + torch.stack((self.x, self.y), -1) @ _plane(q[2]).T
        eta = q[3 : 3 + self.count]
        f = torch.stack((torch.cos(eta), torch.sin(eta)), -1)
        return pivots, f, torch.stack((-f[:, 1], f[:, 0]), -1)

    def _places(self, q: Tensor) -> Tensor:
        """Mass centres (2 N + 1, 3) in W."""
        pivots, f, left = self._points(q)
        platform = q[:2] + _plane(q[2]) @ torch.tensor(self.platform_com, dtype=torch.float64)
        links = pivots - self.behind[:, None] * f + self.left[:, None] * left
        wheels = pivots - self.trail[:, None] * f + self.offset[:, None] * left
        flat = torch.cat((platform[None], links, wheels))
        height = torch.cat((_vector(self.height), self.radius, self.radius))  # links lie as high as their axles
        return torch.cat((flat, height[:, None]), 1)

    def _attitudes(self, q: Tensor) -> Tensor:
        """Rotations (2 N + 1, 3, 3) from each body to W; a wheel turns about its axle, its own y-axis."""
        eta, theta = q[3 : 3 + self.count], q[3 + self.count :]
        links = _about_z(eta)
        return torch.cat((_about_z(q[2:3]), links, links @ _about_y(theta)))

    # How they move.

    def _velocities(self, q: Tensor) -> tuple[Tensor, Tensor]:
        """Jacobians (2 N + 1, 3, n) of mass centres and of attitudes with respect to q."""
        turned = torch.einsum("bijn,bkj->bikn", jacfwd(self._attitudes)(q), self._attitudes(q))
        spin = torch.stack((turned[:, 2, 1], turned[:, 0, 2], turned[:, 1, 0]), 1)
        return jacfwd(self._places)(q), spin

    def _contact_rows(self, q: Tensor) -> Tensor:
        """Velocity (2 N, n) of the wheels' material points at the floor, from the rates of q."""
        velocity, spin = self._velocities(q)
        down = torch.zeros(self.count, 3, 1, dtype=torch.float64)
        down[:, 2, 0] = -self.radius
        velocity, spin = velocity[1 + self.count :], spin[1 + self.count :]
        slip = velocity + torch.linalg.cross(spin, down.expand_as(spin), dim=1)
        rows: Tensor = slip[:, :2].reshape(2 * self.count, -1)
        return rows

    def _partial(self, q: Tensor) -> Tensor:
        """Rates of q (n, 3) for each unit twist: the null space of the constraints, in terms of the twist."""
        pose = torch.cat((torch.cat((_plane(q[2]).T, torch.zeros(2, 1)), 1), torch.tensor([[0.0, 0.0, 1.0]])))
        body = torch.cat((pose, torch.zeros(3, 2 * self.count, dtype=torch.float64)), 1)
        both = torch.cat((self._contact_rows(q), body))
        partial: Tensor = torch.linalg.inv(both)[:, -3:]
        return partial

    def _partial_velocities(self, q: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Of mass centres, of attitudes, and of joints and motors, per unit twist."""
        velocity, spin = self._velocities(q)
        partial = self._partial(q)
        return velocity @ partial, spin @ partial, self.spins @ partial

    def _coordinates(self, steering: np.ndarray) -> Tensor:
        delta = torch.as_tensor(steering, dtype=torch.float64)
        theta = torch.linspace(-1.0, 2.0, self.count, dtype=torch.float64)  # how far the wheels have rolled is all one
        return torch.cat((torch.tensor(POSE, dtype=torch.float64), POSE[2] + delta, theta))

    def _inertia_tensors(self, q: Tensor) -> Tensor:
        attitudes = self._attitudes(q)
        return attitudes @ self.inertias @ attitudes.mT

    def _inertial(self, q: Tensor, twist: Tensor, twist_rate: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Rates of change of momentum, of spin (2 N + 1, 3), and of the spin of gears and rotors (4 N), in W."""
        partial = self._partial_velocities(q)
        move = self._partial(q) @ twist
        _, drift = jvp(lambda q: tuple(part @ twist for part in self._partial_velocities(q)), (q,), (move,))[:2]
        a, alpha, joint = (p @ twist_rate + e for p, e in zip(partial, drift, strict=True))
        omega = (partial[1] @ twist)[..., None]
        return self.masses[:, None] * a, self._spin_rate(q, omega, alpha), self.spinning * joint

    def _spin_rate(self, q: Tensor, omega: Tensor, alpha: Tensor) -> Tensor:
        """Rate of change (2 N + 1, 3) of the spin of bodies that turn at omega (2 N + 1, 3, 1), in W."""
        tensors = self._inertia_tensors(q)
        rate: Tensor = tensors @ alpha[..., None] + torch.linalg.cross(omega, tensors @ omega, dim=1)
        return rate[..., 0]

    def _summed_inertia(self, q: Tensor, v: Tensor, w: Tensor, joint: Tensor) -> Tensor:
        """Inertia of all bodies, gears and rotors for the coordinates in which their velocities are given."""
        moving = torch.einsum("b,bij,bik->jk", self.masses, v, v)
        turning = torch.einsum("bij,bil,blk->jk", w, self._inertia_tensors(q), w)
        return moving + turning + joint.T @ (self.spinning[:, None] * joint)

    def _momentum(self, q: Tensor, v: Tensor, w: Tensor, fixed: Tensor) -> tuple[Tensor, Tensor]:
        """Momentum (3,), and spin (3,) about a fixed point, of bodies with velocities (2 N + 1, 3)."""
        linear = self.masses[:, None] * v
        own = self._inertia_tensors(q) @ w[..., None]
        return linear.sum(0), (torch.linalg.cross(self._places(q) - fixed, linear) + own[..., 0]).sum(0)

    # What comes out.

    def inertia(self, steering: np.ndarray) -> np.ndarray:
        """M (3, 3)."""
        q = self._coordinates(steering)
        return self._summed_inertia(q, *self._partial_velocities(q)).numpy()

    def bias(self, steering: np.ndarray, twist: np.ndarray) -> np.ndarray:
        """h (3,): the force that keeps the components of the twist constant without friction."""
        q, nu = self._coordinates(steering), torch.as_tensor(twist)
        return self._reduced(q, self._inertial(q, nu, torch.zeros_like(nu))).numpy()

    def rates(self, steering: np.ndarray, twist: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """η̇, θ̇, δ̇ (N,)."""
        move = self._partial(self._coordinates(steering)) @ torch.as_tensor(twist)
        joint = self.joints @ move
        return (self.yaws @ move).numpy(), joint[: self.count].numpy(), joint[self.count :].numpy()

    def forward_dynamics(
        self, steering: np.ndarray, twist: np.ndarray, torque: np.ndarray, wrench: np.ndarray
    ) -> np.ndarray:
        """Twist rate (3,) under joint torques (2 N,) in the order roll_1, steer_1, …, friction and a wrench at C."""
        q = self._coordinates(steering)
        move = self._partial(q) @ torch.as_tensor(twist)
        force = self._partial(q).T @ self._applied(q, move, torque, wrench)
        return np.linalg.solve(self.inertia(steering), force.numpy() - self.bias(steering, twist))

    def contact_forces(
        self, steering: np.ndarray, twist: np.ndarray, torque: np.ndarray, wrench: np.ndarray
    ) -> np.ndarray:
        """Forces (N, 2) of the floor along f and f⊥: what Newton's laws of the single bodies leave to be explained."""
        q = self._coordinates(steering)
        rate = torch.as_tensor(self.forward_dynamics(steering, twist, torque, wrench))
        momentum, spin, rotors = self._inertial(q, torch.as_tensor(twist), rate)
        velocity, turning = self._velocities(q)
        needed = torch.einsum("bin,bi->n", velocity, momentum) + torch.einsum("bin,bi->n", turning, spin)
        move = self._partial(q) @ torch.as_tensor(twist)
        needed = needed + self.spins.T @ rotors - self._applied(q, move, torque, wrench)
        force = torch.linalg.lstsq(self._contact_rows(q).T, needed[:, None]).solution.reshape(self.count, 2)
        _, f, left = self._points(q)
        return torch.stack(((force * f).sum(1), (force * left).sum(1)), -1).numpy()

    def momentum_rate(self, steering: np.ndarray, twist: np.ndarray, twist_rate: np.ndarray) -> np.ndarray:
        """Rate of change (3,) of all bodies' momentum, and of their spin about the vertical where C is now."""
        force, moment = self.momentum_rates(steering, twist, twist_rate)
        return np.array([*force[:2], moment[2]])

    def momentum_rates(
        self, steering: np.ndarray, twist: np.ndarray, twist_rate: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Rates of change (3,) and (3,) of momentum, and of spin about the fixed point on the floor below C."""
        q, nu, rate = self._coordinates(steering), torch.as_tensor(twist), torch.as_tensor(twist_rate)
        fixed = torch.cat((q[:2], torch.zeros(1)))

        def momentum(q: Tensor, nu: Tensor) -> tuple[Tensor, Tensor]:
            v, w, _ = self._partial_velocities(q)
            return self._momentum(q, v @ nu, w @ nu, fixed)

        _, (force, moment) = jvp(momentum, (q, nu), (self._partial(q) @ nu, rate))[:2]
        back = _about_z(q[2:3])[0].T
        return (back @ force).numpy(), (back @ moment).numpy()

    def _reduced(self, q: Tensor, inertial: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        v, w, joint = self._partial_velocities(q)
        momentum, spin, rotors = inertial
        return torch.einsum("bij,bi->j", v, momentum) + torch.einsum("bij,bi->j", w, spin) + joint.T @ rotors

    def _applied(self, q: Tensor, move: Tensor, torque: np.ndarray, wrench: np.ndarray) -> Tensor:
        """Generalised forces (n,) on q, which changes at the rates `move`, of torques, friction and wrench."""
        rate = self.joints @ move
        friction = self.viscous * rate + self.coulomb * rate / torch.sqrt(rate**2 + COULOMB_SPEED**2)
        given = torch.as_tensor(torque, dtype=torch.float64).reshape(self.count, 2).T.reshape(-1)
        push = torch.as_tensor(wrench, dtype=torch.float64)
        outside = torch.cat((_plane(q[2]) @ push[:2], push[2:], torch.zeros(2 * self.count)))
        return self.joints.T @ (given - friction) - self.yaws.T @ (self.scrub * (self.yaws @ move)) + outside


def _vector(number: float) -> Tensor:
    return torch.tensor([number], dtype=torch.float64)


def _plane(angle: Tensor) -> Tensor:
    c, s = torch.cos(angle), torch.sin(angle)
    return torch.stack((torch.stack((c, -s)), torch.stack((s, c))))


def _about_z(angle: Tensor) -> Tensor:
    c, s, zero, one = torch.cos(angle), torch.sin(angle), torch.zeros_like(angle), torch.ones_like(angle)
    return torch.stack((c, -s, zero, s, c, zero, zero, zero, one), -1).reshape(-1, 3, 3)


def _about_y(angle: Tensor) -> Tensor:
    c, s, zero, one = torch.cos(angle), torch.sin(angle), torch.zeros_like(angle), torch.ones_like(angle)
    return torch.stack((c, zero, s, zero, one, zero, -s, zero, c), -1).reshape(-1, 3, 3)
