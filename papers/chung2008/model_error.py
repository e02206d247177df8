"""The error that an incomplete model makes under computed torque, from the equations alone.

    M, h     inertia and bias of the robot, on the reference          M̂, ĥ    what the controller knows of them
    Δ        force that it does not know, (M − M̂) ν̇ + h − ĥ           [N, N, N m]
    e        reference minus robot, position and heading              [m, m, rad]

The controller's force M̂ (ν̇ + k_d ė + k_p e) + ĥ, with ν̇ of the reference, moves a robot at M (ν̇ − ë) + h, so that

    M ë + M̂ (k_d ė + k_p e) = Δ

and an error that changes slowly beside the feedback is M̂⁻¹ Δ / k_p. A motion driven in another time has the same Δ
along its way, but for the square of its speed.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from caster_gym.agents.control.computed_torque import Gains, KnownModel, known_model
from caster_gym.analysis.frames import motion_in_body
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.paths.specification import AnyPath
from caster_gym.paths.trailing import trailing_directions
from caster_gym.robot import Robot

_STEP = 0.25  # [-] of the trail: way of a pivot between two steps of its caster's direction


class Lack(NamedTuple):
    """What a model lacks along a trajectory, in the world frame, at its K + 1 samples."""

    push: Array  # (K + 1, 3) M⁻¹ Δ [m/s², m/s², rad/s²]
    grip: Array  # (K + 1, 3, 3) M⁻¹ M̂: what becomes of the feedback's acceleration

    @property
    def balanced(self) -> Array:
        """M̂⁻¹ Δ (K + 1, 3): k_p times the error that stands still. [m/s², m/s², rad/s²]"""
        return np.asarray(np.linalg.solve(self.grip, self.push[..., None])[..., 0], dtype=np.float64)


def lacks(path: AnyPath, robot: Robot, models: Sequence[KnownModel], period: float) -> list[list[Lack]]:
    """For each model, what it lacks along each trajectory of a path, casters trailing, a sample every period [s]."""
    coarse = np.stack([one.samples for one in path.trajectories(period)])
    fastest = (np.hypot(coarse[..., 4], coarse[..., 5]) + robot.pivot_reach * np.abs(coarse[..., 6])).max()
    parts = int(np.ceil(fastest * period / (_STEP * min(caster.trail for caster in robot.casters))))
    fine = np.stack([one.samples for one in path.trajectories(period / parts)])
    steering = trailing_steering(fine, period / parts, robot)[:, ::parts]
    return [[_lack(*one, robot, known) for one in zip(coarse, steering, strict=True)] for known in models]


def trailing_steering(samples: Array, time_step: float, robot: Robot) -> Array:
    """Angles (P, K + 1, N) of trailing casters [rad]; time step in s."""
    back = samples[..., 2] - 1j * samples[..., 3]
    return np.angle(trailing_directions(samples, time_step, robot) * back[..., None])


def _lack(samples: Array, steering: Array, robot: Robot, known: KnownModel) -> Lack:
    twist, rate = motion_in_body(samples)
    exact, guess = Model(robot), known_model(robot, known)
    delta = exact.inverse_dynamics(steering, twist, rate) - guess.inverse_dynamics(steering, twist, rate)
    c, s = samples[:, 2], samples[:, 3]
    one, nothing = np.ones_like(c), np.zeros_like(c)
    to_world = np.array([[c, -s, nothing], [s, c, nothing], [nothing, nothing, one]]).transpose(2, 0, 1)
    inertia = exact.inertia(steering)
    push = to_world @ np.linalg.solve(inertia, delta[..., None])
    grip = to_world @ np.linalg.solve(inertia, guess.inertia(steering)) @ to_world.swapaxes(1, 2)
    return Lack(push[..., 0], grip)


def predict(lacking: Sequence[Lack], of: Sequence[Gains], period: float) -> Array:
    """Errors (K + 1, runs, 3) in the world, from 0, under torques that are held for a period [s].

    One run for each lack and its gains. K is that of the longest; a shorter one is NaN after its end.
    """
    length = max(len(one.push) for one in lacking)
    push = np.full((length, len(lacking), 3), np.nan)
    grip = np.full((length, len(lacking), 3, 3), np.nan)
    for run, one in enumerate(lacking):
        push[: len(one.push), run], grip[: len(one.grip), run] = one.push, one.grip
    stiffness, damping = np.array(of).T[..., None]
    error, rate = np.zeros((2, len(lacking), 3))
    errors = [error]
    for k in range(length - 1):
        feedback = grip[k] @ (damping * rate + stiffness * error)[..., None]
        u = 0.5 * (push[k] + push[k + 1]) - feedback[..., 0]
        error, rate = error + period * rate + 0.5 * period**2 * u, rate + period * u
        errors.append(error)
    return np.stack(errors)
