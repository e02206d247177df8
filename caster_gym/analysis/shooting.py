"""Predictions of a recording, window by window, and their exact derivatives.

A recording is cut into W windows of S samples, each predicted from an initial state of its own, so that no error grows
longer than a window lasts, even where casters flip. All windows are one batch.

    starts     states x, y, β, vx, vy, ω, δ_1, … at the first sample of each window      (W, 6 + N)
    values     of the unknowns, in their units                                           (P,)
    path       states predicted, after each of k simulator's steps between samples       (W, 1 + k (S − 1), 6 + N)

The derivatives are those of the simulator's steps, by forward differentiation with Torch, chained along each window.
"""

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import torch
from numpy.typing import NDArray

from caster_gym.analysis.recording import Recording, substeps_of
from caster_gym.analysis.unknowns import parameters_with
from caster_gym.engines.numpy_model import Model
from caster_gym.engines.torch_model import TorchModel
from caster_gym.mechanics.parameters import Dynamics, RobotParameters
from caster_gym.robot import Robot

Array = NDArray[np.float64]

_SMOOTHING = 7  # samples over which velocities are first guessed from poses
_TOGETHER = 30_000  # numbers in one tensor: more, and Torch would wake its threads, which wait for busy neighbours


class Shooting:
    """The windows of a recording of a robot.

    names: of the unknowns; known: values of other names, see `caster_gym.analysis.unknowns`.
    seconds: length of a window; windows are stretched a little so that fewer samples than windows are left over.
    """

    def __init__(
        self,
        robot: Robot,
        recording: Recording,
        names: Sequence[str],
        known: Mapping[str, float],
        seconds: float,
        dynamics: Dynamics = "exact",
    ) -> None:
        samples = len(recording.pose)
        shortest = min(max(round(seconds / recording.time_step), 2) + 1, samples)
        self.count = samples // shortest
        self.length = samples // self.count
        self.robot, self.recording, self.names, self.known, self.dynamics = robot, recording, names, known, dynamics
        self.observed = recording.observed
        self._substeps = substeps_of(robot, recording.time_step)
        self._step = recording.time_step / self._substeps
        self.measured = self._cut(recording.measured)  # (W, S, observed)
        held = self._cut(recording.torque)[:, :-1]
        self._torque = np.repeat(held, self._substeps, axis=1)  # (W, k (S − 1), 2 N)
        self._angle = np.isin(np.array(recording.kinds)[self.observed], ("heading", "steering"))

    def first_guess(self) -> Array:
        """Starts as measured; where velocities were not, from a parabola through the poses nearby."""
        recording = self.recording
        twist = _twist_from(recording) if recording.twist is None else recording.twist
        return self._cut(np.concatenate([recording.pose, twist, recording.steering], axis=1))[:, 0]

    def predict(self, starts: Array, values: Array) -> Array:
        """The predicted path; not finite where the simulation ran away."""
        model = Model(self.robot, parameters=self._parameters(values))
        torque = self._torque.swapaxes(0, 1)
        with np.errstate(all="ignore"):
            return model.simulate(starts, torque, self._step, len(torque), checked=True).swapaxes(0, 1)

    def starts_on(self, coarser: "Shooting", path: Array) -> Array:
        """Starts of another cut of the recording, from a path of this one."""
        samples = path[:, :: self._substeps].reshape(-1, path.shape[-1])
        return samples[: coarser.count * coarser.length : coarser.length]

    def at_samples(self, path: Array) -> Array:
        """What a path says of the measured components, (W, S, observed)."""
        return path[:, :: self._substeps, self.observed]

    def errors(self, path: Array) -> Array:
        """Predicted minus measured (W, S, observed), angles within ± π."""
        errors = self.at_samples(path) - self.measured
        with np.errstate(invalid="ignore"):
            turned = np.mod(errors + np.pi, 2.0 * np.pi) - np.pi
        return np.where(self._angle, turned, errors)

    def derivatives(self, path: Array, values: Array) -> tuple[Array, Array]:
        """Derivatives of what is observed with respect to starts (W, S, observed, 6 + N) and values (…, P)."""
        slopes = self._step_derivatives(path[:, :-1], values)
        width, count = path.shape[-1], len(values)
        here = np.zeros((self.count, width, width + count))
        here[..., :width] = np.eye(width)
        chained = [here]
        for k in range(slopes.shape[1]):
            here = slopes[:, k, :, :width] @ here
            here[..., width:] += slopes[:, k, :, width:]
            chained.append(here)
        observed = np.stack(chained[:: self._substeps], axis=1)[:, :, self.observed]
        return observed[..., :width], observed[..., width:]

    def _step_derivatives(self, states: Array, values: Array) -> Array:
        """Derivatives (W, k (S − 1), 6 + N, 6 + N + P) of each step's end with respect to its start and the values."""
        width, count = states.shape[-1], len(values)
        flat = torch.as_tensor(states.reshape(-1, width))
        torques = torch.as_tensor(self._torque.reshape(len(flat), -1))
        seeds = torch.eye(width + count, dtype=torch.float64)
        lanes = max(1, _TOGETHER // len(seeds))
        parts = [
            self._tangents(state, torque, torch.as_tensor(values), seeds)
            for state, torque in zip(torch.split(flat, lanes), torch.split(torques, lanes), strict=True)
        ]
        slopes: Array = torch.cat(parts, dim=1).permute(1, 2, 0).numpy()
        return slopes.reshape(*states.shape, width + count)

    def _tangents(
        self, state: torch.Tensor, torque: torch.Tensor, values: torch.Tensor, seeds: torch.Tensor
    ) -> torch.Tensor:
        """How one step's ends (L, 6 + N) change along each of some directions of state and values, one a seed."""

        def end(state: torch.Tensor, values: torch.Tensor) -> torch.Tensor:
            model = TorchModel(self.robot, parameters=self._parameters(values))
            both: Any = model.simulate(cast(Any, state), cast(Any, torque), self._step, 1)
            return cast(torch.Tensor, both[1])

        def along(seed: torch.Tensor) -> torch.Tensor:
            tangents = (seed[: state.shape[1]].expand_as(state), seed[state.shape[1] :])
            return cast(torch.Tensor, torch.func.jvp(end, (state, values), tangents)[1])

        return torch.vmap(along)(seeds)

    def _parameters(self, values: Array | torch.Tensor) -> RobotParameters:
        replaced = {**self.known, **{name: values[i] for i, name in enumerate(self.names)}}
        return parameters_with(self.robot, replaced, self.dynamics)

    def _cut(self, rows: Array) -> Array:
        return rows[: self.count * self.length].reshape(self.count, self.length, -1)


def _twist_from(recording: Recording) -> Array:
    """Twist (K, 3) in B from the poses alone."""
    from scipy.signal import savgol_filter

    pose = np.column_stack([recording.pose[:, :2], np.unwrap(recording.pose[:, 2])])
    rates = savgol_filter(pose, _SMOOTHING, 2, deriv=1, delta=recording.time_step, axis=0)
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    return np.column_stack([c * rates[:, 0] + s * rates[:, 1], c * rates[:, 1] - s * rates[:, 0], rates[:, 2]])
