"""Motions that take the orthogonal complement of chung2008 to singular configurations, and what becomes of it."""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot
from papers.analysis.action_lines import action_lines
from papers.analysis.coordinate_switching import forward_dynamics, singular_steering
from papers.analysis.driven_motion import steady_steering
from papers.analysis.orthogonal_complement import OrthogonalComplement

DISTANCES = np.logspace(0.0, -16.0, 33)  # [rad] from a singular configuration
DECADES = (DISTANCES < 0.5) & (DISTANCES > 1e-5)  # near enough to see a power, not so near that only rounding is left
CASES = 2  # singular configurations of each three joints
PERIOD, STEP, RADIUS = 10.0, 0.01, 0.5  # [s, s, m] of the path


class Drive(NamedTuple):
    """A motion with the torques that make it, by the operational-space model."""

    states: Array  # (steps + 1, 6 + N)
    torques: Array  # (steps, 2 N)


def relative(ours: Array, reference: Array) -> Array:
    """Largest error among the components of a vector, relative to the largest component."""
    return np.asarray(np.abs(ours - reference).max(-1) / np.abs(reference).max(-1))


def drive(robot: Robot) -> Drive:
    """A circle at constant speed while the heading swings: every few seconds a set of three joints is singular."""
    model = Model(robot)
    times = STEP * np.arange(round(PERIOD / STEP))
    turn, swing = 2.0 * np.pi / PERIOD, 4.0 * np.pi / PERIOD

    def wanted(t: float) -> Array:
        omega = 0.5 * swing * np.cos(swing * t)
        along = turn * t - 0.5 * np.sin(swing * t)  # direction of travel in B
        return np.array([turn * RADIUS * np.cos(along), turn * RADIUS * np.sin(along), omega])

    twist = wanted(0.0)
    states, torques = [np.array([0.0, 0.0, 0.0, *twist, *steady_steering(robot, twist)])], []
    for t in times:
        now = states[-1]
        rate = (wanted(t + STEP) - now[3:6]) / STEP
        force = model.inverse_dynamics(now[6:], now[3:6], rate)
        torques.append(np.linalg.lstsq(model.jacobian(now[6:]).T, force, rcond=None)[0])
        states.append(model.simulate(now, torques[-1], STEP, 1)[-1])
    return Drive(np.array(states), np.array(torques))


class Approach(NamedTuple):
    """What happens at `DISTANCES` from singular configurations, each of as many cases as rows."""

    condition_numbers: Array  # of the J_p that becomes singular
    printed_errors: Array  # of the twist rate, relative; 1 where no digit is right, or there was no result at all
    errors: Array  # the same with C φ̇_a multiplied from the right
    best_errors: Array  # with the joints whose J_p is farthest from singular there
    inertia_numbers: Array  # condition numbers of the operational-space inertia
    coriolis: Array  # greatest entry of C, (30), at those of `DECADES`
    line_determinants: Array  # (cases,) of the joints' three lines at the singular configurations [m]


def approach(complements: tuple[OrthogonalComplement, ...]) -> Approach:
    """Every three joints, on the way to `CASES` singular configurations each, in random directions and motions."""
    rng = np.random.default_rng(1)
    model = complements[0].model
    unit = np.array([1.0, 1.0, 1.0 / model.characteristic_length])
    rows = []
    for one in complements:
        printed = OrthogonalComplement(one.robot, one.independent, as_printed=True)
        for _ in range(CASES):
            singular = singular_steering(one, rng.uniform(-np.pi, np.pi, 3))
            away, twist, torque = rng.normal(size=3), rng.uniform(-1.0, 1.0, 3), rng.uniform(-0.1, 0.1, 6)
            if singular is None:
                continue
            path = singular + DISTANCES[:, None] * away / np.linalg.norm(away)
            exact = model.forward_dynamics(path, twist, torque)
            numbers = np.stack([c.condition_number(path) for c in complements], -1)
            best = forward_dynamics(path, *_repeated(twist, torque, len(path)), complements, numbers.argmin(-1))
            scaled = unit[:, None] * model.inertia(path) * unit
            rows.append(
                (
                    numbers[:, complements.index(one)],
                    [_error_or_one(printed, at, twist, torque, right) for at, right in zip(path, exact, strict=True)],
                    [_error_or_one(one, at, twist, torque, right) for at, right in zip(path, exact, strict=True)],
                    relative(best, exact),
                    np.linalg.cond(scaled),
                    _greatest_coriolis(one, path[DECADES], twist),
                    np.linalg.det(action_lines(one.robot, singular, one.independent)),
                )
            )
    return Approach(*(np.array(part) for part in zip(*rows, strict=True)))


def _repeated(twist: Array, torque: Array, count: int) -> tuple[Array, Array]:
    return np.tile(twist, (count, 1)), np.tile(torque, (count, 1))


def _error_or_one(one: OrthogonalComplement, steering: Array, twist: Array, torque: Array, right: Array) -> float:
    try:
        return min(1.0, float(relative(one.forward_dynamics(steering, twist, torque), right)))
    except ValueError:  # singular to the last digit
        return 1.0


def _greatest_coriolis(one: OrthogonalComplement, steering: Array, twist: Array) -> Array:
    _, coriolis = one.equations(steering, one.independent_rates(steering, twist))
    return np.asarray(np.abs(coriolis).max((-2, -1)))


def power(values: Array) -> float:
    """n of values (cases, `DECADES`) that grow as 1/distanceⁿ in the middle of all cases."""
    return float(-np.polyfit(np.log(DISTANCES[DECADES]), np.log(np.median(values, axis=0)), 1)[0])
