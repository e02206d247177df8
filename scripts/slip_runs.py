"""Robots on a floor that wheels slip on, here and in MuJoCo: scenarios, both simulators, and what is compared."""

import time
from typing import Any, NamedTuple

import mujoco
import numpy as np

from caster_gym import Model, Robot
from caster_gym.arrays import Array
from caster_gym.engines.native.fleet import Fleet
from caster_gym.export.mjcf import mjcf
from caster_gym.floor import Floor
from caster_gym.mechanics.floor import on_floor
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import GRAVITY, robot_parameters
from caster_gym.mechanics.scalars import pairs
from caster_gym.mechanics.slip import slip_step
from caster_gym.mechanics.slip_state import rolling_state
from scripts.mujoco_robot import joint_indices, motor_torques, without_dry_friction

ROBOTS = ("chung2008", "xr4000", "tidybot2")
HEIGHT = 0.05  # [m] of the platform's mass centre, so that loads shift
STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)  # [s] MuJoCo's
OUR_STEPS = (5e-3, 2.5e-3, 1.25e-3, 2.5e-4)  # [s] the last one is what MuJoCo is compared with
DRAWS = 3
GRIPS = 0.02  # [m/s] a slower wheel is taken to roll: MuJoCo's creep
SOFTNESS, STIFFNESS = 5e-3, 1000.0  # MuJoCo's contacts: time constant [s], and friction's stiffness over the normal's
SETTLING = 0.1  # [s] for its robots to sink onto their wheels
ROUNDS = 5  # of timing


class Scenario(NamedTuple):
    """A robot on a floor of a friction, from a state and the casters' rates, under torques that may grow."""

    name: str
    robot: Robot
    draw: int
    friction: float
    state: Array  # (6 + N)
    rates: Array  # (N, 2) η̇, θ̇ [rad/s]
    torque: Array  # (2 N,) [N m]
    ramp: bool  # whether they grow from nothing
    duration: float  # [s]


class Course(NamedTuple):
    """What became of it, at equal intervals."""

    time: Array  # (T,) [s]
    pose: Array  # (T, 3)
    slip: Array  # (T, N) [m/s]
    roll: Array  # (T, N) rolling rates [rad/s]


def on_three(robot: Robot) -> Robot:
    """The robot on three of its casters, evenly around it, with its mass centre at HEIGHT above the middle."""
    reach = float(np.mean([np.hypot(c.x, c.y) for c in robot.casters]))
    angles = np.pi * np.array([1.0, 3.0, 5.0]) / 3.0
    casters = [
        c.model_copy(update={"x": reach * float(np.cos(a)), "y": reach * float(np.sin(a))})
        for c, a in zip(robot.casters, angles, strict=False)
    ]
    platform_ = robot.platform.model_copy(update={"height": HEIGHT, "com": (0.0, 0.0)})
    return robot.model_copy(update={"casters": tuple(casters), "platform": platform_, "actuation": "all"})


def scenarios(robot: Robot, draw: int) -> list[Scenario]:
    """All that a robot is put through, on three of its casters, with random steering."""
    rng, robot = np.random.default_rng(draw), on_three(without_dry_friction(robot))
    n = robot.caster_count
    weight = GRAVITY * (robot.platform.mass + sum(c.wheel.mass + c.link.mass for c in robot.casters))
    radius, trail = (np.array([getattr(c, name) for c in robot.casters]) for name in ("radius", "trail"))
    askew, trailing, nothing = rng.uniform(-np.pi, np.pi, n), np.zeros(n), np.zeros(2 * n)

    def rolling(steering: Array, twist: Array) -> Array:
        eta, theta, _ = Model(robot).rates(steering, twist)
        return np.stack((eta, theta), -1)

    def one(name: str, friction: float, steering: Array, twist: Array, **how: Any) -> Scenario:
        given: dict[str, Any] = {"torque": nothing, "ramp": False, "duration": 0.5} | how
        state = np.concatenate((np.zeros(3), twist, steering))
        rates = given.pop("rates", rolling(steering, twist))
        return Scenario(name, robot, draw, friction, state, rates, **given)

    still, share = np.zeros(3), weight / n
    forward = np.stack((0.6 * share * radius, 0.0 * radius), -1).ravel()
    drift = 0.26 * share * np.stack((radius, trail), -1).ravel() * rng.uniform(-1.0, 1.0, 2 * n)
    single = nothing.copy()
    single[0] = 0.5 * share * radius[0]
    moving, other = np.array([0.5, 0.0, 0.0]), np.array([0.35, 0.25, 0.8])
    braked = robot.model_copy(
        update={
            "casters": tuple(
                c.model_copy(update={"roll": c.roll.model_copy(update={"viscous": 20.0 * share * c.radius**2})})
                for c in robot.casters
            )
        }
    )
    return [
        one("onset of slip", 0.3, trailing + 0.3 * askew, still, torque=forward, ramp=True, duration=0.4),
        one("drift", 0.2, askew, np.array([0.3, 0.1, 0.5]), torque=drift),
        one("spin-up of a wheel", 0.3, trailing, still, torque=single, duration=0.15),
        one("regrip", 0.4, trailing, other, rates=rolling(trailing, moving)),
        one("braking", 0.4, trailing, moving, rates=0.0 * rolling(trailing, moving), duration=0.4)._replace(
            robot=braked
        ),
    ]


def ours(scene: Scenario, step: float) -> Course:
    """Our course at a time step."""
    numbers = on_floor(robot_parameters(scene.robot), Floor(friction=scene.friction))
    f = tuple((float(np.cos(a)), float(np.sin(a))) for a in scene.state[6:])
    state = rolling_state(State((0.0, 0.0), (1.0, 0.0), tuple(scene.state[3:6].tolist()), f), numbers)
    state = state._replace(rates=tuple(map(tuple, scene.rates.tolist())))
    frictions = (scene.friction,) * len(f)
    count = round(scene.duration / step)
    times, poses, slips, rolls = [0.0], [(0.0, 0.0, 0.0)], [slip_of(scene)], [scene.rates[:, 1]]
    for k in range(count):
        size = (k + 0.5) / count if scene.ramp else 1.0
        torques = pairs(tuple((size * scene.torque).tolist()))
        state, footfall = slip_step(state, torques, (0.0, 0.0, 0.0), step, frictions, numbers)
        times.append((k + 1) * step)
        poses.append((*state.position, float(np.arctan2(state.heading[1], state.heading[0]))))
        slips.append(np.hypot(*np.transpose(footfall.slips)))
        rolls.append(np.array(state.rates)[:, 1])
    return Course(np.array(times), np.array(poses), np.array(slips), np.array(rolls))


def slip_of(scene: Scenario) -> Array:
    """Slip (N,) of the wheels at the start. [m/s]"""
    eta, theta, _ = Model(scene.robot).rates(scene.state[6:], scene.state[3:6])
    casters = scene.robot.casters
    trail, offset, radius = (np.array([getattr(c, k) for c in casters]) for k in ("trail", "offset", "radius"))
    turn, roll = eta - scene.rates[:, 0], theta - scene.rates[:, 1]
    return np.hypot(offset * turn + radius * roll, trail * turn)


def peer_model(scene: Scenario, step: float, softness: float = SOFTNESS) -> tuple[Any, Any]:
    """MuJoCo's model and data of a scenario: a platform that may tip, settled on its wheels before it moves.

    Contacts have the time constant `softness` [s] whatever the step; motors have no limits, as ours have none here.
    """
    model: Any = mujoco.MjModel.from_xml_string(mjcf(scene.robot, step, scene.friction, tips=True))
    model.geom_solref[:, 0], model.opt.impratio, model.actuator_ctrllimited[:] = softness, STIFFNESS, 0
    data: Any = mujoco.MjData(model)
    body, joints = joint_indices(scene.robot, model)
    data.qpos[joints[1::2]] = scene.state[6:]
    mujoco.mj_step(model, data, round(SETTLING / step))
    data.qvel[:], data.qpos[body], data.qpos[joints[1::2]] = 0.0, 0.0, scene.state[6:]
    data.qvel[body] = scene.state[3:6]
    data.qvel[joints[0::2]], data.qvel[joints[1::2]] = scene.rates[:, 1], scene.rates[:, 0] - scene.state[5]
    data.ctrl[:] = motor_torques(scene.robot, scene.torque)
    return model, data


def peer(scene: Scenario, step: float, softness: float = SOFTNESS) -> Course:
    """MuJoCo's course at a time step, with contacts of a time constant. [s]"""
    robot, n = scene.robot, scene.robot.caster_count
    model, data = peer_model(scene, step, softness)
    body, joints = joint_indices(robot, model)
    wheels = [(model.body(f"wheel_{i}").id, caster.radius) for i, caster in enumerate(robot.casters, start=1)]
    full, count = data.ctrl.copy(), round(scene.duration / step)
    times: Array = step * np.arange(count + 1, dtype=np.float64)
    poses = np.zeros((count + 1, 3))
    slips, rolls = np.zeros((count + 1, n)), np.zeros((count + 1, n))
    slips[0], rolls[0], velocity = slip_of(scene), scene.rates[:, 1], np.zeros(6)
    for k in range(count):
        data.ctrl[:] = full * ((k + 0.5) / count if scene.ramp else 1.0)
        mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        for i, (wheel, radius) in enumerate(wheels):
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, wheel, velocity, 0)
            at_floor = velocity[3:] + np.cross(velocity[:3], (0.0, 0.0, -radius))
            slips[k + 1, i] = np.hypot(*at_floor[:2])
        poses[k + 1], rolls[k + 1] = data.qpos[body], data.qvel[joints[0::2]]
    return Course(times, poses, slips, rolls)


def until(course: Course, time: float) -> Course:
    """The course up to a time. [s]"""
    count = int(np.searchsorted(course.time, time + 1e-9))  # rounding of times
    return Course(*(series[:count] for series in course))


def measure(scene: Scenario, course: Course) -> float:
    """What a scenario is about: time of the onset or of the regrip [s], way of a drift or of braking [m], or rate."""
    if scene.name == "onset of slip":
        return float(course.time[np.argmax(course.slip.max(axis=1) > GRIPS)])
    if scene.name == "regrip":
        return float(course.time[len(course.time) - np.argmax((course.slip.max(axis=1) > GRIPS)[::-1])])
    if scene.name == "spin-up of a wheel":
        return float(course.roll[-1, 0])
    return float(np.hypot(*course.pose[-1, :2]))


def off(course: Course, exact: Course) -> float:
    """Distance of the ends, an angle counted as the way at 0.2 m. [m]"""
    return float(np.linalg.norm((course.pose[-1] - exact.pose[-1]) * (1.0, 1.0, 0.2)))


class Comparison(NamedTuple):
    """One scenario of one robot."""

    scene: Scenario
    ours: Course  # at our shortest step
    theirs: Course  # at MuJoCo's shortest step
    our_errors: Array  # [m] distance of our ends, at OUR_STEPS but the last, from ours at the last
    their_errors: Array  # [m] distance of MuJoCo's ends at STEPS from ours at the last


def compare(scene: Scenario) -> Comparison:
    """Both courses at all steps."""
    mine, theirs = [ours(scene, step) for step in OUR_STEPS], [peer(scene, step) for step in STEPS]
    exact = mine[-1]
    return Comparison(
        scene,
        exact,
        theirs[-1],
        np.array([off(one, exact) for one in mine[:-1]]),
        np.array([off(one, exact) for one in theirs]),
    )


class Rate(NamedTuple):
    """Simulated seconds per second of one core."""

    robot: str
    batch: float
    single: float
    peer: Array  # at STEPS


def rates(robot: Robot) -> Rate:
    """Of robots that drift, in turns, the best of some rounds."""
    scene = next(one for one in scenarios(robot, 0) if one.name == "drift")
    floor, step = Floor(friction=scene.friction), OUR_STEPS[0]
    fleets = [Fleet(scene.robot, count, floor=floor) for count in (1024, 1)]
    start = on_wheels(scene)
    best = np.zeros(2 + len(STEPS))
    for fleet in fleets:
        fleet.step(np.tile(scene.torque, (fleet.count, 1)), step, 1)
    for _ in range(ROUNDS):
        for i, fleet in enumerate(fleets):
            fleet.state, torque = np.tile(start, (fleet.count, 1)), np.tile(scene.torque, (fleet.count, 1))
            steps = round(scene.duration / step) if fleet.count > 1 else 20 * round(scene.duration / step)
            before = time.process_time()
            fleet.step(torque, step, steps)
            best[i] = max(best[i], fleet.count * steps * step / (time.process_time() - before))
        for i, step_of_theirs in enumerate(STEPS):
            model, data = peer_model(scene, step_of_theirs)
            steps = round(scene.duration / step_of_theirs)
            before = time.process_time()
            mujoco.mj_step(model, data, steps)
            best[2 + i] = max(best[2 + i], steps * step_of_theirs / (time.process_time() - before))
    return Rate(robot.name, best[0], best[1], best[2:])


def on_wheels(scene: Scenario) -> Array:
    """The start of a scenario as a state (7 + 2 N) of `Fleet`."""
    steering = scene.state[6:]
    directions = np.stack((np.cos(steering), np.sin(steering)), -1).ravel()
    return np.concatenate(([0.0, 0.0, 1.0, 0.0], scene.state[3:6], directions))
