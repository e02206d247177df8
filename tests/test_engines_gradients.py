"""Gradients of rollouts on tensors against finite differences: torques, initial state, the robot's own numbers."""

import pytest
import torch

from caster_gym import load_robot
from caster_gym.engines.tensor.fleet import TorchFleet
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.envs.report import REPORT
from caster_gym.envs.rows import span
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.mechanics.parameters import robot_parameters
from tests.random_robots import random_robot
from tests.walks import around_it, shaped

CIRCLE = {"shape": "circle", "radius": 0.5}
STEP = 1e-6  # [-] of central differences: truncation of 1e-12 and rounding of 1e-10 for quantities of order 1
SMOOTH = 1e-6  # relative, above both


def slope(function, at, direction, step):
    """Central difference of a scalar function along a direction."""
    return (function(at + step * direction) - function(at - step * direction)).item() / (2.0 * step)


def assert_slope_agrees(function, at, step=STEP, tolerance=SMOOTH, seed=0):
    """The gradient along three random directions."""
    at = at.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(function(at), at)
    assert gradient.isfinite().all()
    generator = torch.Generator().manual_seed(seed)
    for _ in range(3):
        direction = torch.randn(at.shape, generator=generator, dtype=at.dtype)
        expected = slope(function, at.detach(), direction, step)
        assert (gradient * direction).sum().item() == pytest.approx(expected, rel=tolerance, abs=tolerance)


def weighted(tensor):
    """A number that every entry of a tensor enters with a weight of its own."""
    return (tensor * torch.linspace(0.3, 1.7, tensor.numel(), dtype=tensor.dtype).reshape(tensor.shape)).sum()


def moving(count, n, seed=1):
    """States (count, 7 + 2 N) of robots in motion."""
    generator = torch.Generator().manual_seed(seed)
    angles = 6.28 * torch.rand((count, 1 + n), generator=generator, dtype=torch.float64)
    units = torch.stack((angles.cos(), angles.sin()), 2)
    free = 0.3 * torch.randn((count, 5), generator=generator, dtype=torch.float64)
    return torch.cat((free[:, :2], units[:, 0], free[:, 2:], units[:, 1:].flatten(1)), 1)


@pytest.mark.slow
def test_a_rollout_of_the_bare_mechanics():
    """20 steps, with respect to torques and initial velocities."""
    robot = random_robot(1, 3)
    fleet = TorchFleet(robot, 2, dtype=torch.float64)
    start = moving(2, 3)

    def end(torque, twist):
        fleet.state = torch.cat((start[:, :4], twist, start[:, 7:]), 1)
        fleet.step(torque, 1e-3, 20)
        return weighted(fleet.state)

    torque, twist = torch.full((2, 6), 0.02, dtype=torch.float64), start[:, 4:7]
    assert_slope_agrees(lambda it: end(it, twist), torque)
    assert_slope_agrees(lambda it: end(torque, it), twist)


def parameterised(robot, name, value):
    """The robot's numbers with one of the platform or of all casters replaced."""
    numbers = robot_parameters(robot)
    if name in numbers.platform._fields:
        return numbers._replace(platform=numbers.platform._replace(**{name: value}))
    return numbers._replace(casters=tuple(caster._replace(**{name: value}) for caster in numbers.casters))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["mass", "inertia", "trail", "radius", "wheel_mass", "roll_viscous", "roll_coulomb", "scrub"]
)
def test_a_rollout_with_respect_to_the_robot(name):
    robot = random_robot(2, 3)
    numbers = robot_parameters(robot)
    usual = getattr(numbers.platform if name in numbers.platform._fields else numbers.casters[0], name)
    torque, start = torch.full((1, 6), 0.02, dtype=torch.float64), moving(1, 3)

    def end(value):
        fleet = TorchFleet(robot, 1, parameters=parameterised(robot, name, value), dtype=torch.float64)
        fleet.state = start
        fleet.step(torque, 1e-3, 10)
        return weighted(fleet.state)

    at = torch.tensor([usual + 0.01], dtype=torch.float64)  # away from zero, where dry friction may have a kink
    assert_slope_agrees(end, at)


@pytest.fixture(scope="module")
def task():
    return TorchTask("track", path=CIRCLE, dtype=torch.float64)


def rollout(task, state, actions):
    """Sum of the rewards, and the last outcome and state, under actions (periods, robots, joints)."""
    rewards = 0.0
    for action in actions:
        state, outcome = task.step(state, action)
        rewards = rewards + outcome.rewards.sum()
    return rewards, outcome, state


def actions_of(task, periods, count, size=0.3, seed=3):
    """Torques that no motor's limit clips."""
    generator = torch.Generator().manual_seed(seed)
    shape = (periods, count, len(task.robot.driven))
    return size * (2.0 * torch.rand(shape, generator=generator, dtype=torch.float64) - 1.0)


def test_rewards_observations_and_reports_with_respect_to_actions(task):
    start, _ = task.begin(torch.arange(3))

    def outcome(actions):
        rewards, last, _ = rollout(task, start, actions)
        return rewards + weighted(last.observations) + weighted(last.report[span(REPORT.deviation)])

    assert_slope_agrees(outcome, actions_of(task, 4, 3), tolerance=1e-5)  # traction and conditioning bend sharply


def test_rewards_with_respect_to_the_initial_state(task):
    start, _ = task.begin(torch.arange(3))
    actions = actions_of(task, 4, 3)
    assert_slope_agrees(lambda it: rollout(task, start._replace(bodies=it), actions)[0], start.bodies)


@pytest.mark.slow
def test_following_rewards_with_respect_to_actions():
    """Through the projection on the path, from 20 periods on the way; 1e-4: Newton's steps stop near its root."""
    task = TorchTask("follow", path=CIRCLE, corridor=1.0, dtype=torch.float64)
    start, _ = task.begin(torch.arange(2))
    _, _, start = rollout(task, start, [torch.tensor([[0.3, 0.0] * 3] * 2, dtype=torch.float64)] * 20)
    start = start.detached()
    assert_slope_agrees(lambda it: rollout(task, start, it)[0], actions_of(task, 3, 2), tolerance=1e-4)


def test_no_gradient_passes_a_restart_or_a_detached_state(task):
    start, _ = task.begin(torch.arange(2))
    actions = actions_of(task, 1, 2)[0].requires_grad_()
    state, outcome = task.step(start, actions)
    state, _ = task.restart(state, outcome, torch.tensor([True, False]))
    (gradient,) = torch.autograd.grad(state.bodies.sum(), actions)
    assert (gradient[0] == 0.0).all()
    assert (gradient[1] != 0.0).any()
    assert not state.detached().bodies.requires_grad


def test_robots_at_their_reference_without_motion_have_finite_gradients():
    """Distances of zero, rates of zero, equal motors: no root or quotient of zero makes a gradient no number."""
    task = TorchTask("track", path=CIRCLE, start_offset=0.0, start_turn=0.0, dtype=torch.float64)
    state, _ = task.begin(torch.arange(2))
    bodies = state.bodies.clone().requires_grad_()
    actions = torch.zeros((2, 6), dtype=torch.float64, requires_grad=True)
    state, outcome = task.step(state._replace(bodies=bodies), actions)
    finite = torch.where(outcome.report.isfinite(), outcome.report, 0.0)
    for gradient in torch.autograd.grad(outcome.rewards.sum() + finite.sum(), (bodies, actions)):
        assert gradient.isfinite().all()


@pytest.fixture(scope="module")
def before_a_wall():
    """A task in a room, and a robot on its way straight into one wall."""
    arena = {"room": [[-1.0, -1.0], [1.0, 1.0]], "restitution": 0.6, "friction": 0.2}
    task = TorchTask("track", path=CIRCLE, arena=arena, corridor=5.0, dtype=torch.float64)
    state, _ = task.begin(torch.arange(1))
    bodies = state.bodies.clone()
    bodies[:, 0] = torch.tensor([0.89, 0.1, 1.0, 0.0, 0.8, 0.15, 0.1, *[1.0, 0.0] * 3], dtype=torch.float64)
    return task, state._replace(bodies=bodies, room=torch.zeros_like(state.room))


@pytest.mark.slow
def test_through_an_impact(before_a_wall):
    """With respect to velocities and torques, through the time of the impact and its impulse with friction.

    The search for the contact ends within 1 µm of it: central differences over 1e-3 feel at most 1e-3 of that, and
    where it stops short its derivative errs by as much.
    """
    task, state = before_a_wall
    actions = actions_of(task, 3, 1, 0.1)
    _, outcome, _ = rollout(task, state, actions[:1])
    assert task.info(outcome.report)["impacts"].item() == 1.0

    def end(bodies, given):
        return rollout(task, state._replace(bodies=bodies), given)[2].bodies[[0, 1, 4, 5, 6]]

    for at, function in (
        (state.bodies[4:7], lambda it: weighted(end(torch.cat((state.bodies[:4], it, state.bodies[7:])), actions))),
        (actions, lambda it: weighted(end(state.bodies, it))),
    ):
        assert_slope_agrees(function, at, step=1e-3, tolerance=5e-3)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_through_contacts_that_are_struck_jointly(friction):
    """A robot that touches two walls of a corner runs into both."""
    robot = shaped(load_robot("chung2008"), 0.1)
    corner = [{"point": [-0.1, 0.0], "normal": [1.0, 0.0]}, {"point": [0.0, -0.1], "normal": [0.3, 1.0]}]
    corner[1]["point"] = [-0.1 * 0.3 / 1.09**0.5, -0.1 / 1.09**0.5]
    around = around_it(robot, {"half_planes": corner}, restitution=0.5, friction=friction)
    model = TorchModel(robot)
    place, steering = torch.zeros(3, dtype=torch.float64), torch.tensor([0.4, 1.9, -2.0], dtype=torch.float64)

    def end(twist):
        state = torch.cat((place, twist, steering))
        return weighted(model.simulate(state, torch.zeros(6, dtype=torch.float64), 1e-3, 1, around)[-1][3:6])

    before = torch.tensor([-0.5, -0.4, 0.1], dtype=torch.float64)
    assert_slope_agrees(end, before, tolerance=1e-5)  # sweeps end at changes of 1e-9, of which 1e-6 feels a thousandth
