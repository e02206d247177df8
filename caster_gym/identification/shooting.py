"""Predictions of a recording, window by window, and their exact derivatives.

A recording is cut into W windows of S samples, each predicted from an initial state of its own, so that no error grows
longer than a window lasts, even where casters flip. All windows are one batch.

    starts     states x, y, β, vx, vy, ω, δ_1, … at the first sample of each window      (W, 6 + N)
    values     of the unknowns, in their units                                           (P,)
    path       states predicted, after each of k simulator's steps between samples       (W, 1 + k (S − 1), 6 + N)

Where the recording has the wheels' angles, these are N more components of a state, and their rates are integrated.
The derivatives are those of the simulator's steps, see `caster_gym.PeriodDerivatives`, chained along each window.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import cast

import numpy as np

from caster_gym.analysis.frames import wrap_angle
from caster_gym.arrays import Array
from caster_gym.engines.native.derivatives import PeriodDerivatives
from caster_gym.engines.numpy_model import Model
from caster_gym.identification.acting import acting_torque, acts, shown_errors
from caster_gym.identification.recording import FINER, Recording, substeps_of
from caster_gym.identification.rolling import rolled_along
from caster_gym.identification.unknowns import PARAMETERS, kind_of, parameters_with
from caster_gym.mechanics.parameters import Dynamics, RobotParameters, pack_parameters, parameter_names
from caster_gym.robot import Robot

_SMOOTHING = 7  # samples over which velocities are first guessed from poses
_ASIDE = 1e-6  # [-] of a value, or in its unit, by which it is changed for a difference
_TOGETHER = 4096  # steps that are differentiated at once, so that the derivatives by directions take a few MB


class Shooting:
    """The windows of a recording of a robot.

    names: of the unknowns; known: values of other names, see `caster_gym.identification.unknowns`.
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
        self._state = 6 + robot.caster_count
        self._rolls = recording.rolling is not None
        self._plain = self._torque({}) if not acts({**known, **dict.fromkeys(names, 0.0)}) else None
        self._angle = np.isin(np.array(recording.kinds)[self.observed], ("heading", "steering"))
        self._pushes = np.zeros((self.count, self._substeps * (self.length - 1), 2 * robot.caster_count, 0))

    def with_pushes(self, pushes: Array) -> "Shooting":
        """The same with K more values behind those of the unknowns, each a factor of further torques.

        pushes (W, k (S − 1), 2 N, K): torques that act at the joints over each step, for factors of one. [N m]
        """
        wider = copy(self)
        wider._pushes = pushes
        return wider

    def first_guess(self, values: Array) -> Array:
        """Starts as measured; where velocities were not, from a parabola through the poses nearby."""
        recording, errors = self.recording, self._shown_errors(values)
        twist = _twist_from(recording) + errors[3:6] if recording.twist is None else recording.twist
        parts = [recording.pose, twist, recording.steering, recording.rolling]
        return self._cut(np.concatenate([part for part in parts if part is not None], axis=1) - errors)[:, 0]

    def predict(self, starts: Array, values: Array) -> Array:
        """The predicted path; not finite where the simulation ran away."""
        model = Model(self.robot, parameters=self.parameters(values))
        torque = self._pushed_torque(values).swapaxes(0, 1)
        with np.errstate(all="ignore"):
            path = model.simulate(starts[:, : self._state], torque, self._step, len(torque), checked=True)
        if self._rolls:
            wild = not np.isfinite(path).all()
            rolled = np.full_like(path[..., 6:], np.nan) if wild else rolled_along(model, path, torque, self._step)
            path = np.concatenate([path, starts[:, self._state :] + rolled], axis=-1)
        return path.swapaxes(0, 1)

    def step_errors(self, path: Array, values: Array) -> Array:
        """By how much FINER times as many steps end elsewhere than each step of a path (W, k (S − 1), of a state).

        All steps are gone through side by side, so that this takes less time than a prediction.
        """
        model, width = Model(self.robot, parameters=self.parameters(values)), self._state
        torque, fine = self._pushed_torque(values), self._step / FINER
        states = model.simulate(path[:, :-1, :width], torque, fine, FINER, checked=True)
        errors: Array = states[-1] - path[:, 1:, :width]
        angles = [2, *range(6, width)]
        errors[..., angles] = wrap_angle(errors[..., angles])
        if self._rolls:
            rolled = rolled_along(model, states, torque, fine)[-1]
            errors = np.concatenate([errors, rolled - np.diff(path[..., width:], axis=1)], axis=-1)
        return errors

    def starts_on(self, coarser: "Shooting", path: Array) -> Array:
        """Starts of another cut of the recording, from a path of this one."""
        samples = path[:, :: self._substeps].reshape(-1, path.shape[-1])
        return samples[: coarser.count * coarser.length : coarser.length]

    def at_samples(self, path: Array, values: Array) -> Array:
        """What sensors show of a path, of the measured components (W, S, observed)."""
        return path[:, :: self._substeps, self.observed] + self._shown_errors(values)[self.observed]

    def errors(self, path: Array, values: Array) -> Array:
        """Predicted minus measured (W, S, observed), angles within ± π."""
        errors = self.at_samples(path, values) - self.measured
        with np.errstate(invalid="ignore"):
            turned = wrap_angle(errors)
        return np.where(self._angle, turned, errors)

    def derivatives(self, path: Array, values: Array) -> tuple[Array, Array]:
        """Derivatives of what is observed with respect to starts (W, S, observed, 6 + N) and values (…, P + K)."""
        of_starts, of_values, _ = self.derivatives_and_drift(path, values, None)
        return of_starts, of_values

    def derivatives_and_drift(
        self, path: Array, values: Array, step_errors: Array | None
    ) -> tuple[Array, Array, Array]:
        """Derivatives, and what errors of the steps add up to in what is observed (W, S, observed), to first order."""
        slopes = self._step_derivatives(path[:, :-1, : self._state], values)
        width, count = self._state, len(values)
        here = np.zeros((self.count, width, width + count + 1))
        here[..., :width] = np.eye(width)
        chained = [here]
        for k in range(slopes.shape[1]):
            here = slopes[:, k, :, :width] @ here
            here[..., width:-1] += slopes[:, k, :, width:]
            if step_errors is not None:
                here[..., -1] += step_errors[:, k, :width]
            chained.append(here)
        whole = np.stack(chained, axis=1)
        if self._rolls:
            whole = self._with_rolling(path, values, whole)
            width = whole.shape[-1] - count - 1
            if step_errors is not None:
                whole[:, 1:, self._state :, -1] += np.cumsum(step_errors[..., self._state :], axis=1)
        observed = whole[:, :: self._substeps][:, :, self.observed]
        errors = self._slopes_of(lambda moved: self._shown_errors(moved)[self.observed], values)
        return observed[..., :width], observed[..., width:-1] + errors, observed[..., -1]

    def _with_rolling(self, path: Array, values: Array, whole: Array) -> Array:
        """Derivatives of states and of the wheels' angles, from those of states (W, …, 6 + N, 6 + N + P)."""
        state, n = self._state, self.robot.caster_count
        twist, steering = path[..., 3:6], path[..., 6:state]

        def rates(steering: Array, values: Array) -> Array:
            return Model(self.robot, parameters=self.parameters(values)).rates(steering, twist)[1]

        model = Model(self.robot, parameters=self.parameters(values))
        turned = (rates(steering + _ASIDE, values) - rates(steering - _ASIDE, values)) / (2.0 * _ASIDE)
        slopes = model.jacobian(steering)[..., ::2, :] @ whole[..., 3:6, :] + turned[..., None] * whole[..., 6:, :]
        slopes[..., state:-1] += self._slopes_of(lambda moved: rates(steering, moved), values)
        steps = np.cumsum(0.5 * self._step * (slopes[:, 1:] + slopes[:, :-1]), axis=1)
        grown = np.zeros((*whole.shape[:2], state + n, whole.shape[-1] + n))
        grown[..., :state, :state], grown[..., :state, state + n :] = whole[..., :state], whole[..., state:]
        grown[:, 1:, state:, :state], grown[:, 1:, state:, state + n :] = steps[..., :state], steps[..., state:]
        grown[..., state:, state : state + n] = np.eye(n)
        return grown

    def _slopes_of(self, function: Callable[[Array], Array], values: Array) -> Array:
        """Derivatives (…, P) of a function of the values, by differences."""
        slopes = []
        for i, (name, value) in enumerate(zip(self.names, values[: len(self.names)], strict=True)):
            aside = _ASIDE * (abs(value) or 1.0)
            low, high = values.copy(), values.copy()
            low[i], high[i] = value - aside, value + aside
            if name == "motor_lag":
                low[i] = max(low[i], 0.0)
            slopes.append((function(high) - function(low)) / (high[i] - low[i]))
        rest = [np.zeros_like(slopes[0])] * (len(values) - len(slopes))
        return np.stack([*slopes, *rest], axis=-1)

    def _step_derivatives(self, states: Array, values: Array) -> Array:
        """Derivatives (W, k (S − 1), 6 + N, 6 + N + P + K) of each step's end with respect to its start and values."""
        width, pushed = states.shape[-1], self._torque_slopes(values)
        of_numbers = self._slopes_of(lambda moved: np.array(pack_parameters(self.parameters(moved)), float), values)
        told: Array = np.any(of_numbers != 0.0, axis=1)
        told[0] = True  # without any, other code would be compiled
        by = [name for name, one in zip(parameter_names(self.robot.caster_count), told, strict=True) if one]
        numbers = self.parameters(values)
        steps = PeriodDerivatives(self.robot, self._step, by=by, parameters=numbers, checked=True)
        flat, slopes = states.reshape(-1, width), np.empty((states[..., 0].size, width, width + len(values)))
        torques = self._pushed_torque(values).reshape(len(flat), -1)
        for few in np.split(np.arange(len(flat)), range(_TOGETHER, len(flat), _TOGETHER)):
            end = steps.at(_with_directions(flat[few]), torques[few])
            slopes[few, :, :width] = _by_angles(_of_angles(end.by_state, end.state), flat[few])
            slopes[few, :, width:] = _of_angles(end.by_parameters, end.state) @ of_numbers[told]
            if pushed is not None:
                by_torque = _of_angles(end.by_torque, end.state)
                slopes[few, :, width:] += by_torque @ pushed.reshape(len(flat), -1, len(values))[few]
        return slopes.reshape(*states.shape, -1)

    def _torque_slopes(self, values: Array) -> Array | None:
        """Derivatives (W, k (S − 1), 2 N, P + K) of the torques with respect to the values; none if they are fixed."""
        if self._plain is not None and not self._pushes.shape[-1]:
            return None
        moved = np.zeros((*self._pushes.shape[:-1], len(self.names)))
        if self._plain is None:
            moved = self._slopes_of(lambda values: self._torque(self._named(values)), values[: len(self.names)])
        return np.concatenate([moved, self._pushes], axis=-1)

    def _pushed_torque(self, values: Array) -> Array:
        """Torques (W, k (S − 1), 2 N) that act over each step, with what pushes besides."""
        torque, further = self._torque(self._named(values)), values[len(self.names) :]
        return torque + self._pushes @ further if len(further) else torque

    def _torque(self, values: Mapping[str, float]) -> Array:
        """Torques (W, k (S − 1), 2 N) that act over each step."""
        if getattr(self, "_plain", None) is not None:
            return cast(Array, self._plain)
        torque = acting_torque(self.recording, self.robot, values, self._substeps)
        rows = self.length * self._substeps
        return torque[: self.count * rows].reshape(self.count, rows, -1)[:, : rows - self._substeps]

    def _shown_errors(self, values: Array) -> Array:
        return shown_errors(self.robot, self._named(values), len(self.recording.kinds))

    def _named(self, values: Array) -> dict[str, float]:
        return {**self.known, **{name: float(values[i]) for i, name in enumerate(self.names)}}

    def parameters(self, values: Array) -> RobotParameters:
        """The numbers of the robot with values (P,) of the unknowns, and what comes behind these left out."""
        named = {**self.known, **{name: values[i] for i, name in enumerate(self.names)}}
        replaced = {name: value for name, value in named.items() if kind_of(name) in PARAMETERS}
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


def _with_directions(states: Array) -> Array:
    """States (L, 7 + 2 N) with directions in place of angles (L, 6 + N)."""
    casters = np.stack([np.cos(states[:, 6:]), np.sin(states[:, 6:])], axis=-1).reshape(len(states), -1)
    heading = np.column_stack([np.cos(states[:, 2]), np.sin(states[:, 2])])
    return np.concatenate([states[:, :2], heading, states[:, 3:6], casters], axis=1)


def _of_angles(slopes: Array, states: Array) -> Array:
    """Derivatives (L, 6 + N, …) of states with angles, from those (L, 7 + 2 N, …) with directions: dφ = c ds − s dc."""
    c, s = states[:, [2, *range(7, states.shape[1], 2)]], states[:, [3, *range(8, states.shape[1], 2)]]
    turns = c[..., None] * slopes[:, [3, *range(8, states.shape[1], 2)]]
    turns -= s[..., None] * slopes[:, [2, *range(7, states.shape[1], 2)]]
    return np.concatenate([slopes[:, :2], turns[:, :1], slopes[:, 4:7], turns[:, 1:]], axis=1)


def _by_angles(slopes: Array, states: Array) -> Array:
    """Derivatives (L, …, 6 + N) by states with angles, from those (L, …, 7 + 2 N) by directions."""
    angles = states[:, None, [2, *range(6, states.shape[1])]]
    cos, sin = slopes[..., [2, *range(7, slopes.shape[-1], 2)]], slopes[..., [3, *range(8, slopes.shape[-1], 2)]]
    turns = np.cos(angles) * sin - np.sin(angles) * cos
    return np.concatenate([slopes[..., :2], turns[..., :1], slopes[..., 4:7], turns[..., 1:]], axis=-1)
