"""The smallest motors of a robot that suffice for a target. Derivation: docs/analysis.md, section S.

A motor's torque falls linearly to zero at its top speed and is whole when it brakes (docs/equations.md, (M3)). With a
margin k it must lie on or above its line as if every torque and every speed were k times as great.
"""

from dataclasses import dataclass

import numpy as np

from caster_gym.arrays import Array
from caster_gym.design.envelope import (
    Loads,
    Motions,
    envelope_loads,
    joined,
    least_possible_share,
    measures,
    motor_uses,
    path_loads,
    sampled_motions,
    together,
)
from caster_gym.design.target import Target, check_actuation, check_conditioning, driven_as, loaded
from caster_gym.paths.trajectory import MOST_STEPS, Trajectory
from caster_gym.robot import Robot

_STARTS, _ROUNDS, _TRIES = 4, 24, 24  # of the search for harder motions around the hardest of so many parts
_FIRST_STEP, _SHRINKING = 0.3, 0.8  # [-] its step in shares, paces and, times π, directions; and its ratio


@dataclass(frozen=True)
class MotorRequirement:
    """What a target asks of one motor, margin included, beside what the motor of the robot file has."""

    joint: str
    torque: float  # [N m] greatest
    speed: float  # [rad/s] greatest
    power: float  # [W] greatest that it gives
    use: float  # [-] of the torque that the file's motor has at its speed: 1 is the limit; inf beyond its top speed
    standstill_torque: float  # [N m] of the smallest motor whose line lies above all that is asked
    top_speed: float  # [rad/s] of that motor
    has_torque: float  # [N m] at standstill
    has_speed: float  # [rad/s] at which no torque is left

    @property
    def has_power(self) -> float:
        """Greatest power on the line of the file's motor, at half its top speed. [W]"""
        return 0.25 * self.has_torque * self.has_speed

    @property
    def enough(self) -> bool:
        """Whether the file's motor does what is asked, margin included."""
        return self.use <= 1.0


@dataclass(frozen=True)
class Requirement:
    """What a target asks of a robot's motors."""

    motors: tuple[MotorRequirement, ...]
    share: float  # [-] greatest share of its standstill torque that any motor gives, without margin, in the envelope
    least_share: float  # [-] the same if the motors shared the work in the best possible way

    @property
    def use(self) -> float:
        """The greatest use of any motor. [-]"""
        return max(motor.use for motor in self.motors)

    @property
    def factor(self) -> float:
        """By which all torques of the file must be multiplied, if top speeds are those of the smallest motors. [-]"""
        return max(motor.standstill_torque / motor.has_torque for motor in self.motors)


def trajectories_of(target: Target) -> tuple[Trajectory, ...]:
    """The timed trajectories of the target's paths. Raises ValueError for a path that cannot be timed."""
    steps = sum(getattr(path, "count", 1) * path.duration / target.time_step for path in target.paths)
    if steps > MOST_STEPS:
        raise ValueError(f"the paths take {steps:.3g} time steps together, at most {MOST_STEPS} are looked at")
    return tuple(one for path in target.paths for one in path.trajectories(target.time_step))


def motor_shares(loads: Loads, robot: Robot, margin: float) -> Array:
    """Torque (J, S) of each driven motor with a margin, as a share of its greatest, whatever its speed. (S9)"""
    sizes = robot.max_torques[robot.driven_indices, None]
    shares: Array = margin * np.maximum(loads.along, loads.against) / sizes
    return shares


def require(robot: Robot, target: Target, motions: Motions | None = None) -> Requirement:
    """What the target asks of the robot's motors: the worst of its envelope, searched, and of its paths.

    motions: the samples to start from. Raises ValueError for driven joints that are singular at some steering angles,
    and for those whose conditioning is too bad for torques to be exact.
    """
    able = driven_as(robot, target)
    check_actuation(able)
    check_conditioning(able)
    full = loaded(able, target)
    samples = sampled_motions(robot.caster_count) if motions is None else motions
    hardest = joined(samples, harder_motions(samples, full, target))
    envelope = envelope_loads(hardest, full, target)
    parts = [envelope]
    if paths := trajectories_of(target):
        parts.append(path_loads(paths, full, target.margin))
    loads = together(parts)
    motors = [full.motors[j] for j in full.driven_indices]
    k = target.margin
    torque, power = np.maximum(loads.along, loads.against), loads.along * loads.speed
    uses = motor_uses(loads, full, k)
    rows = []
    for j, (joint, motor) in enumerate(zip(full.driven, motors, strict=True)):
        size, top = smallest_motor(k * loads.along[j], k * loads.against[j], k * loads.speed[j])
        rows.append(
            MotorRequirement(
                joint=joint,
                torque=k * float(torque[j].max()),
                speed=k * float(loads.speed[j].max()),
                power=k * float(power[j].max()),
                use=float(uses[j].max()),
                standstill_torque=size,
                top_speed=top,
                has_torque=motor.max_torque,
                has_speed=motor.max_speed,
            )
        )
    share = float(motor_shares(envelope, full, 1.0).max())
    return Requirement(tuple(rows), share, least_possible_share(hardest, full, target))


def harder_motions(motions: Motions, robot: Robot, target: Target) -> Motions:
    """The motions that are worst for each motor's use, torque, speed and power, found by search around the samples.

    A random search with a fixed seed, whose step shrinks; it never returns to something easier.
    """
    rng = np.random.default_rng(0)
    known = measures(envelope_loads(motions, robot, target), robot, target.margin)
    parts = [range(start, known.shape[1], _STARTS) for start in range(_STARTS)]
    worst = np.concatenate([np.array(part)[known[:, part].argmax(axis=1)] for part in parts])
    best = Motions(*(part[..., worst] for part in motions))
    rows = np.arange(len(worst))
    for step in _FIRST_STEP * _SHRINKING ** np.arange(_ROUNDS):
        tried = _moved(best, step, rng)
        values = measures(envelope_loads(tried, robot, target), robot, target.margin)
        values = values.reshape(-1, len(rows), _TRIES)[rows % len(values), rows]
        best = Motions(*(part[..., rows * _TRIES + values.argmax(axis=1)] for part in tried))
    return best


def smallest_motor(along: Array, against: Array, speed: Array) -> tuple[float, float]:
    """Standstill torque [N m] and top speed [rad/s] of the motor of least product of both that gives all loads (S,).

    Its line lies on or above all torques along the motion at their speeds. (S6)
    """
    from scipy.optimize import minimize_scalar

    fastest, braking = float(speed.max()), float(against.max())
    if fastest == 0.0:
        return max(braking, float(along.max())), 0.0

    def standstill(ratio: float) -> float:
        """Torque of a motor whose top speed is the fastest over the ratio."""
        return max(braking, float((along / (1.0 - ratio * speed / fastest)).max()))

    found = minimize_scalar(lambda t: np.log(standstill(t) / t), bounds=(1e-3, 1.0 - 1e-6), method="bounded")
    return standstill(found.x), fastest / float(found.x)


def sized(robot: Robot, requirement: Requirement) -> Robot:
    """The robot with motors that just do what is required.

    All torques of the file are multiplied by one factor, lest the motors share the work differently; each driven motor
    has the top speed of its smallest one.
    """
    tops = {motor.joint: motor.top_speed for motor in requirement.motors}
    casters = []
    for i, caster in enumerate(robot.casters, start=1):
        changed = {}
        for kind, motor in zip(("roll", "steer"), caster.motors, strict=True):
            changed[kind] = motor.model_copy(
                update={
                    "max_torque": motor.max_torque * requirement.factor,
                    "max_speed": tops.get(f"{kind}_{i}") or motor.max_speed,
                }
            )
        casters.append(caster.model_copy(update=changed))
    return robot.model_copy(update={"casters": tuple(casters)})


def _moved(motions: Motions, step: float, rng: np.random.Generator) -> Motions:
    """Each of K motions, and random ones a step away from it in all that is continuous, as K T motions."""
    share, course, push, pace, *others = (np.repeat(part, _TRIES, axis=-1) for part in motions)
    away = step * rng.standard_normal((len(share) + 3, share.shape[1]))
    away[:, ::_TRIES] = 0.0
    return Motions(
        np.mod(share + away[:-3] + 1.0, 2.0) - 1.0,
        course + np.pi * away[-3],
        push + np.pi * away[-2],
        np.clip(pace + away[-1], 0.0, 1.0),
        *others,
    )
