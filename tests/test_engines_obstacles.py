"""Robots among obstacles on all engines: they agree, nothing tunnels, nothing leaves a room in ten million steps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.arena import read_arena
from caster_gym.arena.packing import surroundings
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.native.lanes import LANES
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.mechanics.separation import clearance
from caster_gym.robot import Footprint

ALLOWED = 1e-4  # m, deepest that a robot may be found in an obstacle
SHAPES = {
    "small disc": 0.02,
    "disc": 0.15,
    "triangle": ((0.12, 0.0), (-0.06, 0.1), (-0.06, -0.1)),
    "box": ((0.15, -0.08), (0.15, 0.08), (-0.15, 0.08), (-0.15, -0.08)),
    "needle": ((0.3, 0.0), (-0.3, 0.004), (-0.3, -0.004)),
}
ROOM = {
    "room": [[-1.0, -1.0], [1.0, 1.0]],
    "pillars": [{"centre": [0.4, 0.3], "radius": 0.1}, {"centre": [-0.5, 0.5], "radius": 0.05}],
    "walls": [
        {"start": [-0.8, -0.4], "end": [-0.2, -0.4], "thickness": 0.005},
        {"start": [0.0, -0.9], "end": [0.3, -0.5]},
    ],
    "polygons": [{"corners": [[0.6, -0.6], [0.8, -0.5], [0.55, -0.3]]}],
}
MANY = 1003


def robot_of(outline, top_speed=2.5, viscous=0.0):
    """chung2008 with another outline, top speed [m/s] and friction [N m s] of its wheels."""
    robot = load_robot("chung2008")
    shape = {"disc": outline} if isinstance(outline, float) else {"polygon": outline}
    change = {"viscous": viscous, "max_speed": top_speed / robot.casters[0].radius}
    casters = tuple(c.model_copy(update={"roll": c.roll.model_copy(update=change)}) for c in robot.casters)
    platform = robot.platform.model_copy(update={"footprint": Footprint(**shape)})
    return robot.model_copy(update={"casters": casters, "platform": platform})


def around_it(robot, arena, restitution=0.5, friction=0.2):
    return surroundings(robot, read_arena({"restitution": restitution, "friction": friction, **arena}))


def gaps(states, around):
    """Gap (count,) of each robot to its nearest obstacle."""
    x, y, c, s = states.T[:4]
    return clearance((x, y), (c, s), around.hull, around.obstacles, 0, len(around.obstacles.radii))


def with_directions(rows):
    """(x, y, cos β, sin β, twist, cos δ_1, sin δ_1, …) from (x, y, β, twist, δ_1, …)."""
    beta, steering = rows[..., 2], rows[..., 6:]
    wheels = np.stack((np.cos(steering), np.sin(steering)), -1).reshape(*steering.shape[:-1], -1)
    return np.concatenate((rows[..., :2], np.stack((np.cos(beta), np.sin(beta)), -1), rows[..., 3:6], wheels), -1)


def scattered(seed, count, around):
    """States (count, 9) with angles, at rest or not, of robots that stand free in ROOM."""
    rng = np.random.default_rng(seed)
    low, high = [-1, -1, -np.pi, -1, -1, -2, *[-np.pi] * 3], [1, 1, np.pi, 1, 1, 2, *[np.pi] * 3]
    rows = rng.uniform(low, high, (count, 9))
    while (blocked := gaps(with_directions(rows), around) < 1e-3).any():
        rows[blocked, :3] = rng.uniform(low[:3], high[:3], (blocked.sum(), 3))
    return rows


def random_torques(seed, count, size=1.0):
    return np.random.default_rng((seed, 1)).uniform(-size, size, (count, 6)) * np.tile([0.1, 0.05], 3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["disc", "box"])
def test_all_engines_agree_over_several_impacts(name):
    robot = robot_of(SHAPES[name])
    around = around_it(robot, {**ROOM, "room": [[-0.6, -0.6], [0.6, 0.6]]}, 0.8)
    rng, count = np.random.default_rng(1), 4
    rows = np.zeros((count, 9))
    rows[:, 1:3] = rng.uniform(-0.02, 0.02, (count, 2))
    rows[:, 3:6], rows[:, 6:] = rng.uniform(-1.0, 1.0, (count, 3)), rng.uniform(-3.0, 3.0, (count, 3))
    torques, h, steps = random_torques(1, count), 4e-3, 120
    fleet = Fleet(robot, count, around=around)
    fleet.state = with_directions(rows)
    fleet.step(torques, h, steps)
    numpy = Model(robot).simulate(rows, torques, h, steps, around)
    tensors = TorchModel(robot).simulate(rows, torques, h, steps, around).numpy()
    free = Model(robot).simulate(rows, torques, h, steps)
    assert (np.abs(free[-1] - numpy[-1]).max(axis=1) > 0.05).sum() >= 2
    # an impact makes rounding, 1e-15, some hundred times larger, when a caster flips behind it too
    assert_allclose(fleet.state, with_directions(numpy[-1]), rtol=0.0, atol=1e-8)
    assert_allclose(tensors, numpy, rtol=0.0, atol=1e-8)


def test_the_law_of_an_impact_reaches_compiled_code():
    robot = robot_of(SHAPES["disc"])
    states = with_directions(scattered(9, 30, around_it(robot, ROOM)))
    ends = []
    for law in ("stronge", "chatterjee_ruina"):
        around = around_it(robot, {**ROOM, "impact_law": law}, 0.8, 0.6)
        fleet = Fleet(robot, 30, around=around)
        fleet.state = states
        for _ in range(5):
            fleet.step(np.zeros((30, 6)), 5e-3, 20)
        angles = np.column_stack((states[:, :2], np.arctan2(states[:, 3], states[:, 2]), states[:, 4:7]))
        wheels = np.arctan2(states[:, 8::2], states[:, 7::2])
        walked = Model(robot).simulate(np.column_stack((angles, wheels)), np.zeros(6), 5e-3, 100, around)
        assert_allclose(fleet.state, with_directions(walked[-1]), rtol=0.0, atol=1e-7)  # as above, for half a second
        ends.append(fleet.state)
    assert (np.abs(ends[0] - ends[1]).max(axis=1) > 1e-3).sum() > 5


@pytest.mark.parametrize("name", ["disc", "triangle"])
def test_one_robot_among_obstacles_equals_the_same_robot_in_a_batch(name):
    """To the last bit, in the compiled fleet."""
    robot = robot_of(SHAPES[name])
    around = around_it(robot, ROOM)
    states, torques = with_directions(scattered(2, MANY, around)), random_torques(2, MANY)
    batch = Fleet(robot, MANY, around=around)
    batch.state = states
    batch.step(torques, 5e-3, 200)
    together = batch.state
    for i in (0, 1, LANES - 1, LANES, 500, MANY - 1):
        alone = Fleet(robot, around=around)
        alone.state = states[i : i + 1]
        alone.step(torques[i : i + 1], 5e-3, 200)
        assert_array_equal(alone.state[0], together[i])


@pytest.mark.slow
@pytest.mark.parametrize("engine", [Model, TorchModel])
def test_a_batch_of_a_model_among_obstacles_equals_its_single_robots(engine):
    robot = robot_of(SHAPES["box"])
    around = around_it(robot, ROOM)
    rows, torques = scattered(3, 4, around), random_torques(3, 4)
    together = np.asarray(engine(robot).simulate(rows, torques, 5e-3, 60, around))
    for i in range(4):
        alone = np.asarray(engine(robot).simulate(rows[i], torques[i], 5e-3, 60, around))
        assert_array_equal(alone, together[:, i])


def test_many_steps_among_obstacles_equal_single_ones():
    robot = robot_of(SHAPES["triangle"])
    around = around_it(robot, ROOM)
    states, torques = with_directions(scattered(4, 20, around)), random_torques(4, 20)
    once, often = Fleet(robot, 20, around=around), Fleet(robot, 20, around=around)
    once.state = often.state = states
    once.step(torques, 5e-3, 100)
    for _ in range(100):
        often.step(torques, 5e-3)
    assert_array_equal(once.state, often.state)


def test_far_obstacles_change_nothing():
    """To the last bit."""
    robot = robot_of(SHAPES["triangle"])
    rng = np.random.default_rng(5)
    states = with_directions(rng.uniform(-1.0, 1.0, (50, 9)))
    torques = random_torques(5, 50)
    among, free = Fleet(robot, 50, around=around_it(robot, {"room": [[-9, -9], [9, 9]]})), Fleet(robot, 50)
    among.state = free.state = states
    among.step(torques, 5e-3, 200)
    free.step(torques, 5e-3, 200)
    assert_array_equal(among.state, free.state)


TARGETS = {
    "wall of 5 mm": {"walls": [{"start": [0.0, -9.0], "end": [0.0, 9.0], "thickness": 0.005}]},
    "wall without thickness": {"walls": [{"start": [0.0, -9.0], "end": [0.0, 9.0]}]},
    "end of a wall": {"walls": [{"start": [0.0, -0.03], "end": [0.0, 0.05], "thickness": 0.005}]},
    "pillar": {"pillars": [{"centre": [0.0, 0.0], "radius": 0.01}]},
    "tip": {"polygons": [{"corners": [[0.0, 0.0], [1.0, -0.05], [1.0, 0.05]]}]},
}


def thrown(outline, seed, count):
    """States of robots before the y-axis that fly towards the origin at 10 m/s, most of them spinning."""
    rng = np.random.default_rng(seed)
    angle, beta = rng.uniform(-0.6, 0.6, count), rng.uniform(-np.pi, np.pi, count)
    reach = outline if isinstance(outline, float) else np.hypot(*np.transpose(outline)).max()
    way = reach + rng.uniform(0.005, 0.05, count)
    x, y = -way * np.cos(angle) - 0.005, -way * np.sin(angle)
    omega = rng.uniform(-30.0, 30.0, count) * (rng.random(count) < 0.7)
    v = 10.0 * np.exp(1j * (angle - beta))
    return with_directions(np.column_stack([x, y, beta, v.real, v.imag, omega, rng.uniform(-np.pi, np.pi, (count, 3))]))


def inside(points, corners, depth):
    """Which points (..., 2) lie in a convex polygon (..., M, 2), counter-clockwise, deeper than `depth`."""
    edges = np.roll(corners, -1, axis=-2) - corners
    normals = np.stack([edges[..., 1], -edges[..., 0]], -1) / np.linalg.norm(edges, axis=-1, keepdims=True)
    beyond = ((points[..., None, :] - corners[..., None, :, :]) * normals[..., None, :, :]).sum(-1)
    return (beyond < -depth).all(-1)


def outline_in_world(outline, states):
    """Corners (count, M, 2); a disc is a polygon of 90 corners."""
    if isinstance(outline, float):
        angles = np.arange(90) * 2.0 * np.pi / 90
        outline = outline * np.stack([np.cos(angles), np.sin(angles)], -1)
    x, y, c, s = states.T[:4, :, None]
    px, py = np.asarray(outline).T
    return np.stack([x + c * px - s * py, y + s * px + c * py], -1)


@pytest.mark.slow
@pytest.mark.parametrize("share", [1.0, 0.3])
@pytest.mark.parametrize("outline", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)
def test_nothing_tunnels_at_ten_metres_a_second(target, outline, share):
    """At the longest time step that the robot allows, 25 mm of way, and at a shorter one."""
    robot, count = robot_of(outline, top_speed=10.0), 200
    h = share * min(c.trail for c in robot.casters) / robot.top_speed
    around = around_it(robot, target)
    fleet = Fleet(robot, count, around=around)
    fleet.state = start = thrown(outline, 6, count)
    free = Fleet(robot, count)
    free.state = start
    obstacle = around.obstacles.corners
    for _ in range(round(14 / share)):
        fleet.step(np.zeros((count, 6)), h)
        free.step(np.zeros((count, 6)), h)
        states = fleet.state
        assert np.isfinite(states).all()
        assert (gaps(states, around) >= -ALLOWED).all()
        ours = outline_in_world(outline, states)
        if len(obstacle) == 2:
            assert (ours[..., 0] < ALLOWED).all()
        elif len(obstacle) > 2:
            assert not inside(ours, obstacle[None], ALLOWED).any()
            assert not inside(np.broadcast_to(obstacle, (count, *obstacle.shape)), ours, ALLOWED).any()
        if np.abs(obstacle).max() > 5.0:
            assert (ours[..., 0] < ALLOWED).all()
    assert (np.abs(states - free.state)[:, :2].max(axis=1) > 1e-3).sum() > 20  # so many have hit it


def test_a_robot_that_leans_against_a_wall_stays_where_it_rests():
    """Boxes on their long sides for ten seconds; motors push up to 12° from the normal, friction holds up to 27°."""
    robot, count, h = robot_of(SHAPES["box"]), 30, 1e-2
    around = around_it(robot, {"half_planes": [{"point": [0.0, 0.0], "normal": [0.0, 1.0]}]}, 0.3, 0.5)
    rows = np.zeros((count, 9))
    rows[:, 1] = 0.08
    rows[:, 6:] = np.radians(np.linspace(-102.0, -78.0, count))[:, None]
    fleet = Fleet(robot, count, around=around)
    fleet.state = with_directions(rows)
    for _ in range(200):
        fleet.step(np.tile([0.05, 0.0], (count, 3)), h, 5)
        assert (abs(fleet.state[:, :2] - rows[:, :2]) < ALLOWED).all()
        assert (abs(fleet.state[:, 3:7]) < ALLOWED).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["triangle", "box"])
def test_robots_jammed_between_obstacles_do_not_sink_in(name):
    """Pushed for long, without bounce or friction, at the longest time step that the robot allows."""
    robot, count = robot_of(SHAPES[name], viscous=1e-3), 250
    around = around_it(robot, ROOM, 0.0, 0.0)
    fleet = Fleet(robot, count, around=around)
    fleet.state = with_directions(scattered(10, count, around))
    rng, torques = np.random.default_rng(11), random_torques(10, count)
    for _ in range(400):
        changed = rng.random(count) < 0.05
        torques[changed] = random_torques(rng.integers(10**6), count, 2.0)[changed]
        fleet.step(torques, 1e-2, 5)
        assert (gaps(fleet.state, around) >= -ALLOWED).all()
    assert np.isfinite(fleet.state).all()


LONG_RUN = [  # outline, restitution, friction
    ("disc", 0.5, 0.2),
    ("small disc", 1.0, 0.0),
    ("triangle", 0.0, 0.0),
    ("triangle", 0.9, 0.5),
    ("box", 0.0, 0.3),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "restitution", "friction"), LONG_RUN)
def test_nothing_leaves_a_room_or_gains_energy_in_two_million_steps(name, restitution, friction):
    """Random torques, held for random times; every tenth step is looked at closely.

    The work of motors and friction in a step is at most their power at its beginning or end, whichever is greater,
    times its length. By how much the free robot misses the mean of both is the error of integrator and rule.
    """
    count, h, closely = 1000, 5e-3, 200
    robot = robot_of(SHAPES[name], viscous=2e-3)
    model, around = Model(robot), around_it(robot, ROOM, restitution, friction)
    fleet, free = Fleet(robot, count, around=around), Fleet(robot, count)
    fleet.state = with_directions(scattered(7, count, around))
    rng, torques = np.random.default_rng(8), random_torques(7, count)
    worst = excess = error = 0.0

    def energy_and_power(states):
        steering = np.arctan2(states[:, 8::2], states[:, 7::2])
        twist = states[:, 4:7]
        _, theta, delta = model.rates(steering, twist)
        rates = np.stack([theta, delta], -1).reshape(count, 6)
        lost = (model.friction(steering, twist) * twist).sum(-1)
        return model.kinetic_energy(steering, twist), (torques * rates).sum(-1) - lost

    for _ in range(closely):
        changed = rng.random(count) < 0.1
        torques[changed] = (random_torques(rng.integers(10**6), count) * (rng.random((count, 1)) < 0.8))[changed]
        fleet.step(torques, h, 9)
        free.state = before = fleet.state
        fleet.step(torques, h)
        free.step(torques, h)
        (old, power), (new, power_after) = energy_and_power(before), energy_and_power(fleet.state)
        alone, power_alone = energy_and_power(free.state)
        worst = min(worst, gaps(fleet.state, around).min())
        excess = max(excess, (new - old - h * np.maximum(power, power_after)).max())
        error = max(error, abs(alone - old - 0.5 * h * (power + power_alone)).max())
    assert np.isfinite(fleet.state).all()
    assert worst >= -ALLOWED
    assert excess <= error
