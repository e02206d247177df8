"""The robot from first principles once more, without the constraint of rolling: the floor's forces are applied forces.

Bodies, attitudes and their velocities are those of `tests.kane`, by automatic differentiation; here every generalised
coordinate q = (x, y, β, η_1 … η_N, θ_1 … θ_N) is free.
"""

import numpy as np
import torch
from torch import Tensor
from torch.func import jvp

from tests.kane import Kane, _plane


class FreeKane(Kane):
    """Accelerations, slip, energy and moments of a robot whose wheels may slip. Rates (N, 2): η̇, θ̇ of each caster."""

    def _rates_of(self, q: Tensor, twist: np.ndarray, rates: np.ndarray) -> Tensor:
        """Rates of q."""
        nu, own = torch.as_tensor(twist), torch.as_tensor(rates)
        return torch.cat((_plane(q[2]) @ nu[:2], nu[2:], own[:, 0], own[:, 1]))

    def _masses_of(self, q: Tensor) -> Tensor:
        """Inertia matrix (n, n) of all coordinates."""
        return self._summed_inertia(q, *self._velocities(q), self.spins)

    def _floor_rows(self, q: Tensor) -> Tensor:
        """Velocity (N, 2, n) of the wheels' material points at the floor along f and f⊥."""
        _, f, left = self._points(q)
        rows = self._contact_rows(q).reshape(self.count, 2, -1)
        return torch.stack((torch.einsum("ni,nij->nj", f, rows), torch.einsum("ni,nij->nj", left, rows)), 1)

    def slip(self, steering: np.ndarray, twist: np.ndarray, rates: np.ndarray) -> np.ndarray:
        """u (N, 2)."""
        q = self._coordinates(steering)
        return (self._floor_rows(q) @ self._rates_of(q, twist, rates)).numpy()

    def energy(self, steering: np.ndarray, twist: np.ndarray, rates: np.ndarray) -> float:
        """Kinetic energy of all bodies. [J]"""
        q = self._coordinates(steering)
        move = self._rates_of(q, twist, rates)
        return float(0.5 * move @ self._masses_of(q) @ move)

    def inertia_beside(self, steering: np.ndarray) -> np.ndarray:
        """What answers (3, 3) to an impulse on the platform, in B: the inverse of what it does to the twist."""
        q = self._coordinates(steering)
        turn = torch.eye(3, dtype=torch.float64)
        turn[:2, :2] = _plane(q[2])
        mobility = torch.linalg.inv(self._masses_of(q))[:3, :3]
        beside: np.ndarray = torch.linalg.inv(turn.T @ mobility @ turn).numpy()
        return beside

    def accelerations(
        self,
        steering: np.ndarray,
        twist: np.ndarray,
        rates: np.ndarray,
        torque: np.ndarray,
        floor: np.ndarray,
        wrench: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Twist rate (3,) and rates of the casters' rates (N, 2), under forces of the floor (N, 2) on the wheels."""
        q = self._coordinates(steering)
        move = self._rates_of(q, twist, rates)
        rate = self._second(q, move, torque, floor, wrench)
        back, omega = _plane(q[2]).T, float(twist[2])
        flat = back @ rate[:2] - omega * torch.tensor([-twist[1], twist[0]])
        own = torch.stack((rate[3 : 3 + self.count], rate[3 + self.count :]), -1)
        return torch.cat((flat, rate[2:3])).numpy(), own.numpy()

    def tilt(
        self,
        steering: np.ndarray,
        twist: np.ndarray,
        rates: np.ndarray,
        torque: np.ndarray,
        floor: np.ndarray,
        wrench: np.ndarray,
    ) -> np.ndarray:
        """Height times force (2,) along x and y of B: change of the spin about the point on the floor below C."""
        q = self._coordinates(steering)
        move = self._rates_of(q, twist, rates)
        fixed = torch.cat((q[:2], torch.zeros(1)))

        def spin(q: Tensor, move: Tensor) -> Tensor:
            v, w = self._velocities(q)
            return self._momentum(q, v @ move, w @ move, fixed)[1]

        _, moment = jvp(spin, (q, move), (move, self._second(q, move, torque, floor, wrench)))[:2]
        push = self.height * torch.as_tensor(wrench)[:2]
        return (_plane(q[2]).T @ torch.stack((moment[1], -moment[0])) - push).numpy()

    def _second(self, q: Tensor, move: Tensor, torque: np.ndarray, floor: np.ndarray, wrench: np.ndarray) -> Tensor:
        """Second derivatives of q."""
        v0, w0 = self._velocities(q)
        _, (drift, turning) = jvp(lambda q: tuple(part @ move for part in self._velocities(q)), (q,), (move,))[:2]
        own = self._spin_rate(q, (w0 @ move)[..., None], turning)
        bias = torch.einsum("bij,bi->j", v0, self.masses[:, None] * drift) + torch.einsum("bij,bi->j", w0, own)
        held = torch.einsum("nij,ni->j", self._floor_rows(q), torch.as_tensor(floor))
        force = self._applied(q, move, torque, wrench) + held - bias
        rate: Tensor = torch.linalg.solve(self._masses_of(q), force)
        return rate
