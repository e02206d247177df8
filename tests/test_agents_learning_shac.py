"""agents.learning.shac: its gradient is that of the return, its critic's targets are TD(λ)'s, and it learns."""

from typing import Any

import numpy as np
import pytest
import torch
import yaml

from caster_gym import load_robot
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.bundle import load_policy
from caster_gym.agents.learning.settings import SHACSettings
from caster_gym.agents.learning.shac import Critic, ShortHorizon, Window, frozen, make_task, td_lambda
from caster_gym.agents.learning.training import train
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.tasks.track.parameters import TrackParameters

# One RK4 step a period, since Torch alone, uncompiled, is slow
QUICK: dict[str, Any] = {"control_period": 0.01, "substeps": 1}
PATH = {"shape": "random_paths", "duration": 2.5, "max_speed": 0.3, "count": 2}
TASK = parse(
    TaskSettings,
    {
        **{kind: [{**PATH, "seed": seed}] for seed, kind in enumerate(("train", "validation", "test"))},
        "task": QUICK,
    },
    "task",
)
FIELDS = {
    "algorithm": "shac",
    "n_envs": 4,
    "n_steps": 3,
    "batch_size": 6,
    "net_arch": (16,),
    "restarts": 0.0,
    "compile": False,  # which would take longer than all tests together
}


@pytest.fixture(autouse=True)
def one_thread():
    """Training sets the number of threads of the whole process."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def learner(longest=None, dtype=torch.float64, seed=0, **changes):
    task = TorchTask("track", path=[{**PATH, "seed": 0}], max_episode_steps=longest, dtype=dtype, **QUICK)
    return ShortHorizon(task, parse(SHACSettings, {**FIELDS, **changes}, "agent"), seed)


def gain_of(learning, weights, start):
    """The gain of a policy with these weights, from the same start."""
    torch.nn.utils.vector_to_parameters(weights, learning.actor.parameters())
    learning.state, learning.outcome = start
    return learning.gain()[0]


@pytest.mark.parametrize("longest", [None, 2], ids=["one episode", "an episode ends within the window"])
def test_gradient_is_the_derivative_of_the_return(longest):
    """Central differences along random directions of all weights, through dynamics, reward, policy and critic."""
    learning = learner(longest)
    start = learning.state, learning.outcome
    rng = torch.Generator().manual_seed(2)
    weights = torch.nn.utils.parameters_to_vector(learning.actor.parameters()).detach()
    weights = weights + 0.1 * torch.randn(len(weights), generator=rng, dtype=weights.dtype)
    gain = gain_of(learning, weights.clone(), start)
    slopes = torch.autograd.grad(gain, list(learning.actor.parameters()))
    gradient = torch.cat([slope.flatten() for slope in slopes])
    for _ in range(2):
        along = torch.randn(len(weights), generator=rng, dtype=weights.dtype)
        with torch.no_grad():
            high, low = (gain_of(learning, weights + h * along, start) for h in (1e-5, -1e-5))
        # error of differences h² and round-off 1e-16 / h, both near 1e-10 of slopes of order 0.1 to 1
        assert float((high - low) / 2e-5) == pytest.approx((gradient @ along).item(), rel=1e-5)
        assert abs((gradient @ along).item()) > 1e-3


def test_gain_is_the_discounted_return_and_what_the_critic_expects_after_it():
    """Summed by hand from the window's own rewards, with episodes of two periods in a window of three."""
    learning = learner(longest=2)
    gain, window = learning.gain()
    r, v, g = window.rewards, window.after, learning.settings.gamma
    assert window.ended.tolist() == [[False] * 4, [True] * 4, [False] * 4]
    total = r[0] + g * r[1] + g * g * v[1] + r[2] + g * v[2]
    assert gain.item() == pytest.approx(float(total.sum()) / (3 * 4), rel=1e-12)
    assert (v != 0.0).all()  # ends by time are followed by what the critic expects


def test_nothing_is_expected_after_a_failure():
    learning = learner()
    with torch.no_grad():
        learning.state.bodies[0, 1] += 3.0  # far out of the corridor
    _, window = learning.gain()
    assert window.ended[0].tolist() == [False, True, False, False]
    assert window.rewards[0, 1] == 0.0
    assert window.after[0].eq(0.0).tolist() == [False, True, False, False]


def test_no_gradient_enters_a_window():
    learning = learner()
    learning.gain()
    assert not any(tensor.requires_grad for tensor in (*learning.state, *learning.outcome))


def test_some_robots_start_anew_before_a_window():
    """Those that do are at rest in their next episode; for all others nothing has changed."""
    learning = learner(n_envs=64, batch_size=192, restarts=0.25)
    learning.gain()
    before, seen = learning.state, learning.outcome.observations
    learning.start_some_anew()
    anew = learning.state.clocks == 0
    assert 0.05 * 64 < int(anew.sum()) < 0.5 * 64  # a quarter, give or take three standard deviations of 5 %
    assert (learning.state.bodies[4:7, anew] == 0.0).all()
    assert torch.equal(learning.state.episodes, before.episodes + anew)
    assert torch.equal(learning.state.bodies[:, ~anew], before.bodies[:, ~anew])
    assert torch.equal(learning.outcome.observations[~anew], seen[~anew])
    assert (learning.outcome.observations[anew] != seen[anew]).any(dim=1).all()


def test_a_critic_learns_a_return_as_its_mean_reward():
    """Error of 2 in a return worth 10 periods: 0.2 in the mean reward."""
    critic = Critic(3, (8,), discount=0.9)
    observations = torch.ones(2, 5, 3)
    returns = critic(observations)
    assert returns.shape == (2, 5)
    torch.testing.assert_close(critic.loss(observations, returns + 2.0), torch.tensor(0.04))


def test_targets_lie_between_one_step_and_the_whole_window():
    """TD(λ) by its definition, the mean of n-step returns with weights (1 − λ) λⁿ⁻¹, for a robot without an ending."""
    rng = torch.Generator().manual_seed(3)
    r, v = (torch.rand(4, 1, generator=rng, dtype=torch.float64) for _ in range(2))
    g, trace = 0.9, 0.6
    window = Window(torch.zeros(4, 1, 2), r, v, torch.zeros(4, 1, dtype=torch.bool))
    for k in range(4):
        returns = [sum(g**i * r[k + i] for i in range(n)) + g**n * v[k + n - 1] for n in range(1, 5 - k)]
        weights = [(1 - trace) * trace**n for n in range(len(returns))]
        weights[-1] = trace ** (len(returns) - 1)
        expected = sum(w * one for w, one in zip(weights, returns, strict=True))
        assert float(td_lambda(window, g, trace)[k]) == pytest.approx(float(expected), rel=1e-12)


def test_targets_do_not_look_beyond_an_ending():
    r, v = torch.ones(3, 1), torch.tensor([[5.0], [0.0], [7.0]])
    window = Window(torch.zeros(3, 1, 2), r, v, torch.tensor([[False], [True], [False]]))
    assert td_lambda(window, 0.5, 1.0)[:, 0].tolist() == [1.5, 1.0, 4.5]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*singular")
def test_policies_get_better():
    """Mean reward of half a second from the same starts at rest, with a critic that expects nothing and learns nothing.

    Long trails and slow motors let the robot do with one RK4 step in 40 ms.
    """
    robot = load_robot("chung2008")
    slow = robot.casters[0].steer.model_copy(update={"max_speed": 25.0})
    robot = robot.model_copy(
        update={"casters": tuple(caster.model_copy(update={"trail": 0.1, "steer": slow}) for caster in robot.casters)}
    )
    coarse: dict[str, Any] = {"control_period": 0.04, "substeps": 1, "preview": (0.08, 0.2, 0.4)}
    task = TorchTask("track", robot, path=[{**PATH, "seed": 0}], **coarse)
    changes = {"n_envs": 16, "n_steps": 12, "batch_size": 192, "critic_learning_rate": 1e-12, "learning_rate": 1e-2}
    learning = ShortHorizon(task, parse(SHACSettings, {**FIELDS, **changes}, "agent"), seed=0)
    for parameter in (*learning.critic.parameters(), *learning.target.parameters()):
        parameter.data.zero_()
    with torch.no_grad():
        learning.actor.head.weight *= 0.01  # begins with hardly any torque
    start = learning.state, learning.outcome
    rewards = []
    for _ in range(5):
        learning.state, learning.outcome = start
        rewards.append(learning.improve(0.0)["reward"])
    assert rewards[-1] > rewards[0] + 0.004


def test_a_frozen_policy_does_not_learn_any_more():
    learning = learner()
    kept = frozen(learning.actor)
    before = {name: tensor.clone() for name, tensor in kept.state_dict().items()}
    learning.improve(0.0)
    assert all(torch.equal(before[name], tensor) for name, tensor in kept.state_dict().items())
    assert {tensor.dtype for tensor in before.values()} == {torch.float32}
    assert not any(parameter.requires_grad for parameter in kept.parameters())


def test_the_rate_falls_and_the_last_window_hardly_learns():
    learning = learner()
    assert learning.improve(0.75)["learning_rate"] == pytest.approx(0.25 * learning.settings.learning_rate.start)
    before = torch.nn.utils.parameters_to_vector(learning.actor.parameters()).detach().clone()
    learning.improve(1.0)
    assert torch.equal(torch.nn.utils.parameters_to_vector(learning.actor.parameters()), before)


def test_a_run_leaves_a_policy_that_evaluates_alike_after_loading(tmp_path):
    settings = parse(SHACSettings, {**FIELDS, "n_timesteps": 24, "validations": 2}, "agent")
    for name in ("first", "again"):
        best = train(TASK, settings, 3, tmp_path / name, lambda steps, verdict: None, threads=1)
    facts = yaml.safe_load((tmp_path / "first" / "run.yaml").read_text(encoding="utf-8"))
    assert parse(SHACSettings, facts["agent"], "run.yaml") == settings
    assert [one["steps"] for one in facts["validations"]] == [12, 24]
    first, again = (load_policy(tmp_path / name / "best") for name in ("first", "again"))
    assert (first.description.name, first.description.squash) == ("SHAC", "tanh")
    assert first.description.trained_with["steps"] == best.steps
    observations = np.random.default_rng(0).normal(size=(5, first.description.layout.size)).astype(np.float32)
    np.testing.assert_array_equal(first.agent.act(observations), again.agent.act(observations))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"batch_size": 13}, "'batch_size' must be at most n_envs · n_steps = 12 steps, got 13"),
        ({"n_steps": 0}, "'n_steps' should be greater than 0, got 0"),
        ({"noise": -0.1}, "'noise' should be .*-0.1"),
        ({"restarts": 1.5}, "'restarts' should be .*1.5"),
        ({"horizon": 16}, "unknown key 'horizon'; it is called 'n_steps' here"),
    ],
)
def test_what_is_wrong_with_the_settings_is_named(content, message):
    with pytest.raises(ConfigurationError, match=message):
        parse(SHACSettings, {**FIELDS, **content}, "agent")


def test_settings_that_come_with_the_package():
    assert isinstance(read_agent("shac"), SHACSettings)


def test_a_missing_compiler_is_named_with_the_setting():
    wanted = r"compile=true needs a C\+\+ compiler, and none was found.*compile=false"
    with torch._inductor.config.patch({"cpp.cxx": ("no-such-compiler",)}), pytest.raises(ValueError, match=wanted):
        make_task(TASK, parse(SHACSettings, {**FIELDS, "compile": True}, "agent"))
    assert not make_task(TASK, parse(SHACSettings, FIELDS, "agent")).diagnostics


@pytest.mark.parametrize(("robot", "period", "own", "taken"), [("chung2008", 0.02, 4, 2), ("chung2008", 0.01, 1, 1)])
def test_robots_learn_with_as_few_time_steps_as_their_casters_allow(robot, period, own, taken):
    """A trail of 25 mm at 2.5 m/s asks for steps of 10 ms or less."""
    fields = {"control_period": period, "substeps": own, "preview": (0.1,)}
    task = TASK.model_copy(update={"robot": robot, "task": TrackParameters(**fields)})
    settings = parse(SHACSettings, FIELDS, "agent")
    assert make_task(task, settings).task.substeps == taken
    assert make_task(task, settings.model_copy(update={"substeps": own})).task.substeps == own
