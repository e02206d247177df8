"""Changing the independent joints before they become singular. docs/analysis.md, section N.

The remedy for the natural orthogonal complement: watch the condition number of J_p and, where it passes a limit, go on
with the joints for which it is least. The limit keeps the joints from changing to and fro: those just taken are
far from it.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym.analysis.checked import finite
from caster_gym.analysis.frames import turn_planar
from caster_gym.arrays import Array
from caster_gym.engines.time_step import check_time_step
from caster_gym.robot import Robot
from papers.analysis.orthogonal_complement import INDEPENDENT, OrthogonalComplement

Places = NDArray[np.int64]


class Walk(NamedTuple):
    """A motion that was computed step by step."""

    states: Array  # (steps + 1, 6 + N) as `Model.simulate` gives them; not a number after a breakdown
    chosen: Places  # (steps,) which of the candidates each step was computed with
    condition_numbers: Array  # (steps,) of its J_p at the step's beginning
    examined: int  # condition numbers that had to be computed


def all_complements(robot: Robot) -> tuple[OrthogonalComplement, ...]:
    """One for every three of the joints that can have a motor."""
    return tuple(OrthogonalComplement(robot, joints) for joints in combinations(robot.joints, INDEPENDENT))


def singular_steering(complement: OrthogonalComplement, steering: Array) -> Array | None:
    """Steering angles (N,) at which J_p is singular: the given ones but for one caster; None if turning one finds none.

    They are singular to rounding: where det J_p changes its sign.
    """
    from scipy.optimize import brentq

    for caster in reversed(range(len(steering))):

        def determinant(angle: float, caster: int = caster) -> float:
            there = np.array(steering)
            there[caster] = angle
            return float(np.linalg.det(complement.loops(there)[0]))  # (N2)

        angles = steering[caster] + np.linspace(0.0, 2.0 * np.pi, 73)
        values = [determinant(angle) for angle in angles]
        for low, high, at, after in zip(angles[:-1], angles[1:], values[:-1], values[1:], strict=True):
            if at * after < 0.0:
                found = np.array(steering)
                found[caster] = brentq(determinant, low, high, xtol=1e-16)
                return found
    return None


def choose_along(steering: ArrayLike, candidates: Sequence[OrthogonalComplement], limit: float) -> tuple[Places, Array]:
    """Which candidate to use at each of the steering angles (T, N) of a path, and the condition numbers (T, C) of all.

    The first are those with the least condition number at the beginning. Raises ValueError for a limit below 1.
    """
    _check(candidates, limit)
    numbers = np.stack([one.condition_number(steering) for one in candidates], -1)
    chosen = np.empty(len(numbers), dtype=np.int64)
    now = int(numbers[0].argmin())
    for step, row in enumerate(numbers):
        now = now if row[now] <= limit else int(row.argmin())  # (N9)
        chosen[step] = now
    return chosen, numbers


def forward_dynamics(
    steering: ArrayLike,
    twist: ArrayLike,
    torque: ArrayLike,
    candidates: Sequence[OrthogonalComplement],
    chosen: ArrayLike,
) -> Array:
    """Twist rates (T, 3), each by the candidate that was chosen for it."""
    angles, v, tau, which = (np.asarray(part) for part in (steering, twist, torque, chosen))
    rates = np.empty((len(angles), 3))
    for one in np.unique(which):
        here = which == one
        rates[here] = candidates[one].forward_dynamics(angles[here], v[here], tau[here])
    return rates


def simulate(
    candidates: Sequence[OrthogonalComplement], state: ArrayLike, torque: ArrayLike, dt: float, limit: float = np.inf
) -> Walk:
    """The motion from a state (6 + N,) under torques (steps, 2 N), with the rates of independent joints as the state.

    Steps of dt [s] by Dormand and Prince's method of fifth order, the joints being changed between them; with one
    candidate they never are.
    The walk ends where the numbers cease to be finite or the joints are singular to the last digit.
    Raises ValueError for a dt that cannot follow the casters, and for arrays of the wrong shape or not finite.
    """
    _check(candidates, limit)
    robot = candidates[0].robot
    check_time_step(robot, dt)
    torques = finite("torque", torque, 2 * robot.caster_count)
    start = finite("state", state, 6 + robot.caster_count)
    if torques.ndim != 2 or start.ndim != 1:
        raise ValueError(f"torque must have two axes and state one, got shapes {torques.shape} and {start.shape}")
    states = np.full((len(torques) + 1, len(start)), np.nan)
    chosen, numbers = np.zeros(len(torques), dtype=np.int64), np.full(len(torques), np.nan)
    states[0] = start
    now, examined = _best(candidates, start[6:]), len(candidates)
    rates = candidates[now].independent_rates(start[6:], start[3:6])
    for step, given in enumerate(torques):
        steering = states[step, 6:]
        number = float(candidates[now].condition_number(steering))
        examined += 1
        if number > limit:
            twist = candidates[now].twist(steering, rates)
            now = _best(candidates, steering)  # (N9)
            rates = candidates[now].independent_rates(steering, twist)
            number = float(candidates[now].condition_number(steering))
            examined += len(candidates)
        chosen[step], numbers[step] = now, number
        try:
            full = _stepped(candidates[now], np.concatenate((states[step, :3], rates, steering)), given, dt)
            states[step + 1] = (*full[:3], *candidates[now].twist(full[6:], full[3:6]), *full[6:])
        except ValueError:
            break
        rates = full[3:6]
    return Walk(states, chosen, numbers, examined)


def _best(candidates: Sequence[OrthogonalComplement], steering: Array) -> int:
    """The candidate whose J_p is farthest from singular at steering angles (N,)."""
    return int(np.argmin([one.condition_number(steering) for one in candidates]))


def _check(candidates: Sequence[OrthogonalComplement], limit: float) -> None:
    if not candidates:
        raise ValueError("candidates must hold at least one set of independent joints, got none")
    if not limit >= 1.0:
        raise ValueError(f"limit must be 1 or more, as condition numbers are, got {limit:g}")


def _stepped(complement: OrthogonalComplement, y: Array, torque: Array, h: float) -> Array:
    """Pose, independent rates and steering angles after one step. Raises ValueError where there is none."""
    from scipy.integrate import RK45

    def derivative(_: float, y: Array) -> Array:
        motion = complement.motion(y[6:], y[3:6], torque)
        return np.concatenate((turn_planar(motion.twist, np.exp(1j * y[2])), motion.accelerations, motion.rates[2::3]))

    solver = RK45(derivative, 0.0, y, h, first_step=h, atol=np.inf)  # no error is too great: the step stays
    with np.errstate(over="ignore", invalid="ignore"):
        solver.step()
    if solver.status != "finished":
        raise ValueError("the motion ceases to be finite within a step")
    return np.asarray(solver.y)
