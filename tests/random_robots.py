"""Robots that nobody would build, and motions of them: every number differs from caster to caster and none is zero."""

import numpy as np

from caster_gym.robot import Caster, Footprint, Link, Motor, Platform, Robot, Wheel

CASTER_COUNTS = (2, 3, 4, 5)


def random_robot(seed: int, caster_count: int) -> Robot:
    """A robot of which every parameter is drawn, with its mass centre among its casters."""
    rng = np.random.default_rng((seed, caster_count))
    around = 2.0 * np.pi * (np.arange(caster_count) + rng.uniform(-0.3, 0.3, caster_count)) / caster_count
    return Robot(
        name=f"random_{seed}",
        platform=Platform(
            mass=rng.uniform(5.0, 20.0),
            inertia=rng.uniform(0.05, 0.5),
            com=(_signed(rng, 0.01, 0.05), _signed(rng, 0.01, 0.05)),
            footprint=Footprint(disc=0.4),
        ),
        casters=tuple(_random_caster(rng, angle) for angle in around),
    )


def random_motion(
    seed: int, robot: Robot, count: int | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Steering [rad], twist, joint torques [N m] and a wrench at C, each with a leading axis of `count` if given."""
    rng = np.random.default_rng((seed, 7))
    batch = () if count is None else (count,)
    n = robot.caster_count
    return (
        rng.uniform(-np.pi, np.pi, (*batch, n)),
        rng.uniform(-1.0, 1.0, (*batch, 3)),
        rng.uniform(-0.5, 0.5, (*batch, 2 * n)),
        rng.uniform(-5.0, 5.0, (*batch, 3)),
    )


def frictionless(robot: Robot) -> Robot:
    """The same robot without friction in its joints and contact patches."""
    still = {"viscous": 0.0, "coulomb": 0.0}
    casters = tuple(
        caster.model_copy(
            update={
                "scrub": 0.0,
                "roll": caster.roll.model_copy(update=still),
                "steer": caster.steer.model_copy(update=still),
            }
        )
        for caster in robot.casters
    )
    return robot.model_copy(update={"casters": casters})


def _random_caster(rng: np.random.Generator, angle: float) -> Caster:
    distance = rng.uniform(0.15, 0.35)
    return Caster(
        x=distance * np.cos(angle),
        y=distance * np.sin(angle),
        trail=rng.uniform(0.03, 0.1),
        offset=_signed(rng, 0.005, 0.02),
        radius=rng.uniform(0.03, 0.08),
        wheel=Wheel(
            mass=rng.uniform(0.2, 1.0),
            spin_inertia=rng.uniform(2e-4, 2e-3),
            yaw_inertia=rng.uniform(1e-4, 1e-3),
        ),
        link=Link(
            mass=rng.uniform(0.2, 1.0),
            inertia=rng.uniform(1e-4, 2e-3),
            com=(_signed(rng, 0.005, 0.05), _signed(rng, 0.005, 0.03)),
        ),
        roll=_random_motor(rng),
        steer=_random_motor(rng),
        scrub=rng.uniform(1e-3, 1e-2),
        gear=(
            (rng.uniform(0.5, 4.0), _signed(rng, 0.1, 0.4)),
            (_signed(rng, 0.1, 0.4), rng.uniform(0.5, 4.0)),
        ),
    )


def _random_motor(rng: np.random.Generator) -> Motor:
    torque, speed, turning = rng.uniform(0.2, 2.0), rng.uniform(20.0, 40.0), rng.uniform(1e-4, 2e-3)
    return Motor(
        max_torque=torque,
        max_speed=speed,
        rotor=0.4 * turning,
        armature=0.6 * turning,
        viscous=rng.uniform(1e-3, 1e-2),
        coulomb=rng.uniform(1e-3, 2e-2),
    )


def _signed(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose size lies between low and high, of either sign."""
    return float(rng.choice((-1.0, 1.0)) * rng.uniform(low, high))
