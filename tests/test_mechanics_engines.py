"""The same equations on NumPy arrays and on Torch tensors; batches, gradients and bad input."""

import inspect

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.mechanics.parameters import RobotParameters, robot_parameters
from tests.random_robots import CASTER_COUNTS, random_motion, random_robot

STEP = 2e-3  # s


def calls(robot, seed, count=None):
    """Every method of the model with arguments, of `count` robots at once if given."""
    steering, twist, torque, wrench = random_motion(seed, robot, count)
    rng = np.random.default_rng((seed, 101))
    batch = () if count is None else (count,)
    angle = rng.uniform(-np.pi, np.pi, batch)
    normal = np.stack((np.cos(angle), np.sin(angle)), -1)
    point, e, mu = rng.uniform(-0.4, 0.4, (*batch, 2)), rng.uniform(0.0, 1.0, batch), rng.uniform(0.0, 2.0, batch)
    state = np.concatenate((rng.normal(size=(*batch, 3)), twist, steering), -1)
    return {
        "rates": (steering, twist),
        "jacobian": (steering,),
        "inertia": (steering,),
        "bias": (steering, twist),
        "friction": (steering, twist),
        "forward_dynamics": (steering, twist, torque, wrench),
        "inverse_dynamics": (steering, twist, wrench),
        "kinetic_energy": (steering, twist),
        "ground_forces": (steering, twist, torque),
        "wheel_loads": (steering,),
        "motor_wrenches": (steering,),
        "conditioning": (steering,),
        "collide": (steering, twist, point, normal, e, mu),
        "simulate": (state, torque, STEP, 5),
    }


METHODS = tuple(calls(random_robot(101, 2), 101))


def results(model, method, arguments):
    """What a method returns, as a list of arrays."""
    value = getattr(model, method)(*arguments)
    return [np.asarray(part) for part in (value if isinstance(value, tuple) else (value,))]


def test_every_method_is_compared():
    public = [name for name, _ in inspect.getmembers(Model, inspect.isfunction) if not name.startswith("_")]
    assert sorted(public) == sorted(METHODS)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_torch_agrees_with_numpy(method, caster_count):
    robot = random_robot(102, caster_count)
    arguments = calls(robot, 102, 20)[method]
    # the order of roundings is the same, sine and cosine may differ in the last bit; ill-conditioned: root of rounding
    tolerance = 1e-7 if method == "conditioning" else 1e-12
    if method == "wheel_loads" and caster_count == 2:
        tolerance = 1e-6  # the damping of 1e-9 multiplies rounding
    for ours, theirs in zip(
        results(TorchModel(robot), method, arguments), results(Model(robot), method, arguments), strict=True
    ):
        assert ours.shape == theirs.shape
        assert_allclose(ours, theirs, rtol=0.0, atol=tolerance * np.abs(theirs).max())


@pytest.mark.parametrize("method", METHODS)
def test_single_precision_stays_close(method):
    """Float32 carries 1.2e-7; sums and solves lose up to two digits of them, a root near zero half."""
    robot = random_robot(103, 3)
    arguments = calls(robot, 103, 20)[method]
    single = TorchModel(robot, dtype=torch.float32)
    tolerance = 2e-3 if method == "conditioning" else 2e-5
    for ours, theirs in zip(results(single, method, arguments), results(Model(robot), method, arguments), strict=True):
        assert ours.dtype == np.float32
        assert_allclose(ours, theirs, rtol=0.0, atol=tolerance * np.abs(theirs).max())


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("engine", [Model, TorchModel])
def test_a_batch_equals_its_single_robots(engine, method):
    """To the last bit: no robot feels its neighbours."""
    robot = random_robot(104, 3)
    model, arguments = engine(robot), calls(robot, 104, 7)[method]
    together = results(model, method, arguments)
    for i in range(7):
        one = [a[i] if isinstance(a, np.ndarray) else a for a in arguments]
        for single, batch in zip(results(model, method, one), together, strict=True):
            assert_array_equal(single, batch[:, i] if method == "simulate" else batch[i])


def test_leading_axes_broadcast():
    """Steerings along one axis, twists along another."""
    model = Model(random_robot(105, 3))
    steering, twist, torque, _ = random_motion(105, model.robot, 4)
    grid = model.forward_dynamics(steering[:, None], twist[None, :3], torque[0])
    assert grid.shape == (4, 3, 3)
    assert_array_equal(grid[2, 1], model.forward_dynamics(steering[2], twist[1], torque[0]))
    assert model.collide(steering[:, None], -twist[None, :3], [0.1, 0.0], [1.0, 0.0], 0.5)[1].shape == (4, 3, 3)
    assert model.simulate(np.zeros((4, 2, 9)), np.zeros(6), STEP, 3).shape == (4, 4, 2, 9)


def test_torque_may_change_from_step_to_step():
    model = Model(random_robot(106, 3))
    steering, twist, torque, _ = random_motion(106, model.robot, 6)
    state = np.concatenate((np.zeros(3), twist[0], steering[0]))
    whole = model.simulate(state, torque, STEP, 6)
    for i in range(6):
        one = model.simulate(whole[i], torque[i], STEP, 1)[-1]
        assert_allclose(whole[i + 1], one, rtol=0.0, atol=1e-13)  # rounding of angles made directions again


def test_each_robot_of_a_batch_may_have_its_own_parameters():
    robots = [random_robot(seed, 3) for seed in (107, 108)]
    numbers = [robot_parameters(robot) for robot in robots]
    both = RobotParameters(
        type(numbers[0].platform)(*map(np.array, zip(*(p.platform for p in numbers), strict=True))),
        tuple(
            type(casters[0])(*map(np.array, zip(*casters, strict=True)))
            for casters in zip(*(p.casters for p in numbers), strict=True)
        ),
    )
    steering, twist, torque, wrench = random_motion(107, robots[0], 2)
    together = Model(robots[0], parameters=both).forward_dynamics(steering, twist, torque, wrench)
    for i, robot in enumerate(robots):
        single = Model(robot).forward_dynamics(steering[i], twist[i], torque[i], wrench[i])
        assert_array_equal(together[i], single)


def tensors(*arrays):
    return tuple(torch.tensor(array, dtype=torch.float64, requires_grad=True) for array in arrays)


def test_gradients_of_forward_dynamics():
    """With respect to steering, twist, torque and wrench, against finite differences."""
    robot = random_robot(109, 3)
    assert torch.autograd.gradcheck(TorchModel(robot).forward_dynamics, tensors(*random_motion(109, robot)))


def test_gradients_of_a_simulation():
    robot = random_robot(110, 3)
    steering, twist, torque, _ = random_motion(110, robot)
    model = TorchModel(robot)
    state = np.concatenate((np.zeros(3), 0.3 * twist, steering))

    def outcome(state, torque):
        return model.simulate(state, torque, STEP, 3)[-1]

    assert torch.autograd.gradcheck(outcome, tensors(state, torque), fast_mode=True)


@pytest.mark.parametrize("name", ["trail", "offset", "radius", "wheel_mass", "link_left", "steer_armature", "scrub"])
def test_gradients_with_respect_to_the_robot(name):
    """A number of the second caster as a tensor, through forward dynamics and a short simulation."""
    robot = random_robot(111, 3)
    numbers = robot_parameters(robot)
    steering, twist, torque, wrench = random_motion(111, robot)
    state = np.concatenate((np.zeros(3), 0.3 * twist, steering))

    def outcome(value):
        casters = (numbers.casters[0], numbers.casters[1]._replace(**{name: value}), numbers.casters[2])
        model = TorchModel(robot, parameters=numbers._replace(casters=casters))
        rate = model.forward_dynamics(steering, twist, torque, wrench)
        return torch.cat((rate, model.simulate(state, torque, STEP, 2)[-1]))

    assert torch.autograd.gradcheck(outcome, tensors(getattr(numbers.casters[1], name)), fast_mode=True)


@pytest.fixture(params=[Model, TorchModel])
def published(request):
    return request.param(load_robot("chung2008"))


def test_wrong_shapes_are_refused(published):
    with pytest.raises(ValueError, match=r"steering must have a last axis of 3, got shape \(2,\)"):
        published.inertia([0.0, 0.0])
    with pytest.raises(ValueError, match=r"twist must have a last axis of 3, got shape \(\)"):
        published.bias([0.0, 0.0, 0.0], 1.0)
    with pytest.raises(ValueError, match="torque must have a last axis of 6"):
        published.forward_dynamics(np.zeros(3), np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="state must have a last axis of 9"):
        published.simulate(np.zeros(6), np.zeros(6), STEP, 1)
    with pytest.raises(ValueError, match="torque must hold 4 steps along its first axis, got 3"):
        published.simulate(np.zeros(9), np.zeros((3, 6)), STEP, 4)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused(bad):
    model = Model(load_robot("chung2008"))
    with pytest.raises(ValueError, match=f"steering must be finite, got {bad}"):
        model.inertia([0.0, bad, 0.0])
    with pytest.raises(ValueError, match=f"restitution must lie in 0 … 1, got {bad}"):
        model.collide(np.zeros(3), np.zeros(3), np.zeros(2), [1.0, 0.0], bad)


def test_unknown_joints_are_refused(published):
    with pytest.raises(ValueError, match="unknown joint 'roll_4'; the joints are roll_1, steer_1"):
        published.jacobian(np.zeros(3), ("roll_1", "roll_4"))
    with pytest.raises(ValueError, match="named twice"):
        published.jacobian(np.zeros(3), ("roll_1", "roll_1"))


def test_impossible_impacts_are_refused(published):
    steering, twist, point = np.zeros(3), np.array([-1.0, 0.0, 0.0]), np.zeros(2)
    with pytest.raises(ValueError, match="restitution must lie in 0 … 1, got 2"):
        published.collide(steering, twist, point, [1.0, 0.0], 2.0)
    with pytest.raises(ValueError, match=r"restitution must lie in 0 … 1, got 1\.5$"):
        published.collide(steering, twist, point, [1.0, 0.0], [0.5, 1.5, 1.0])
    for wrong in ("x", None, [[0.5], [0.5, 0.5]]):
        with pytest.raises(ValueError, match="restitution must "):
            published.collide(steering, twist, point, [1.0, 0.0], wrong)
        with pytest.raises(ValueError, match="twist must "):
            published.collide(steering, wrong, point, [1.0, 0.0], 0.5)
    for number in (-0.1, np.inf, np.nan):
        with pytest.raises(ValueError, match=rf"friction must lie in 0 … 1e\+06, got {number}$"):
            published.collide(steering, twist, point, [1.0, 0.0], 0.5, number)
    with pytest.raises(ValueError, match=r"normal must be a unit vector, got a length of 2"):
        published.collide(steering, twist, point, [2.0, 0.0], 0.5)
    with pytest.raises(ValueError, match=r"normal must be a unit vector, got a length of 0.5"):
        published.collide(np.zeros((2, 3)), twist, point, [[1.0, 0.0], [0.5, 0.0]], 0.5)


@pytest.mark.parametrize("law", ["stronge", "chatterjee_ruina"])
def test_a_contact_of_the_greatest_friction_sticks(published, law):
    """By Stronge its contact point ends at rest along the tangent; by both laws more friction would change nothing."""
    steering, twist, point = [0.3, 1.0, -2.0], [-1.0, 0.4, 0.2], [-0.3, 0.05]
    _, after = published.collide(steering, twist, point, [1.0, 0.0], 0.5, 1e6, law)
    _, less = published.collide(steering, twist, point, [1.0, 0.0], 0.5, 1e4, law)
    assert_allclose(after, less, atol=1e-3)  # the bend, which goes with the inverse of the friction
    if law == "stronge":
        assert abs(float(after[1] + after[2] * point[0])) < 1e-5


def test_a_coarse_time_step_names_the_longest_that_would_do(published):
    """Trail 25 mm at a top speed of 2.5 m/s: 10 ms."""
    with pytest.raises(ValueError, match=r"a time step of 0.02 s cannot follow the casters.* at most 0.01 s"):
        published.simulate(np.zeros(9), np.zeros(6), 0.02, 1)
    assert published.simulate(np.zeros(9), np.zeros(6), 0.01, 1).shape == (2, 9)
    for bad in (0.0, -0.01, np.nan):
        with pytest.raises(ValueError, match=r"must be positive and at most 0\.01 s"):
            published.simulate(np.zeros(9), np.zeros(6), bad, 1)
    with pytest.raises(ValueError, match="steps must be 0 or more, got -1"):
        published.simulate(np.zeros(9), np.zeros(6), 0.01, -1)


def test_other_models_are_refused():
    with pytest.raises(ValueError, match='dynamics must be "exact" or "chung2008", got \'kim2001\''):
        Model(load_robot("chung2008"), dynamics="kim2001")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"dtype must be torch.float32 or torch.float64, got torch.int32"):
        TorchModel(load_robot("chung2008"), dtype=torch.int32)
