"""agents.learning.bundle: a policy acts after loading as before saving, and a folder from a stranger runs nothing."""

import pickle

import numpy as np
import pytest
import torch
import yaml
from numpy.testing import assert_allclose, assert_array_equal
from safetensors.torch import load_file, save_file

from caster_gym import durable_files
from caster_gym.agents.comparison.evaluation import roll_out
from caster_gym.agents.learning import bundle as module
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.bundle import DESCRIPTION, WEIGHTS, Bundle, PolicyDescription, load_policy, save_bundle
from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.agents.learning.sb3_learning import actor_of, make_learner
from caster_gym.agents.learning.settings import PPOSettings, SACSettings
from caster_gym.configuration import ConfigurationError
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import load_robot
from caster_gym.tasks.follow.parameters import FollowParameters
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.tasks.track.parameters import TrackParameters
from caster_gym.wrappers import History, MotorLag, TwistCommands
from tests.kills import killed_at_each_line

ROBOT = load_robot("chung2008")
TASK = TrackParameters(corridor=0.4)
LAYOUT = ObservationLayout(ROBOT, TASK.preview)
FOLLOWED = ObservationLayout(ROBOT, FollowParameters().preview, "m", FollowParameters().nearest)
HIDDEN = (16, 8)


def fresh_bundle(seed=0, squash="clip", actions=6, **told):
    """A policy with random weights, some of whose actions leave −1 … 1 before they are bounded."""
    torch.manual_seed(seed)
    layout = FOLLOWED if told.get("environment") == "follow" else LAYOUT
    actor = Actor(layout.size, HIDDEN, actions, squash)
    with torch.no_grad():
        actor.head.weight *= 30.0
    description = PolicyDescription(
        format=1,
        name="PPO",
        squash=squash,
        hidden=HIDDEN,
        robot=ROBOT,
        actions=actions,
        **{"task": TASK, **told},
        trained_with={"seed": seed, "settings": {"learning_rate": 3e-4}},
        versions={"numpy": np.__version__},
    )
    return Bundle(description, actor)


def observations(count=500, seed=0):
    return np.random.default_rng(seed).normal(size=(count, LAYOUT.size)).astype(np.float32)


def saved(tmp_path, **arguments):
    folder = tmp_path / "policy"
    save_bundle(folder, fresh_bundle(**arguments))
    return folder


def change_description(folder, **changes):
    content = yaml.safe_load((folder / DESCRIPTION).read_text(encoding="utf-8"))
    (folder / DESCRIPTION).write_text(yaml.safe_dump({**content, **changes}), encoding="utf-8")


def change_weights(folder, change):
    weights = load_file(folder / WEIGHTS)
    change(weights)
    save_file(weights, folder / WEIGHTS)


@pytest.mark.parametrize("squash", ["clip", "tanh"])
def test_a_policy_acts_after_loading_as_before_saving(tmp_path, squash):
    """To the last bit, in single actions and in whole episodes."""
    before = fresh_bundle(squash=squash)
    save_bundle(tmp_path / "policy", before)
    after = load_policy(tmp_path / "policy")
    assert after.description == before.description
    assert after.agent.name == before.agent.name == "PPO"
    assert_array_equal(after.agent.act(observations()), before.agent.act(observations()))
    path = {"shape": "circle", "duration": 8.0}
    batch = CasterTrackVectorEnv(5, path=path, **TASK.model_dump())
    first, second = (roll_out(one.agent, batch, seed=3) for one in (before, after))
    for name, mine, other in zip(first._fields, first, second, strict=True):
        assert_array_equal(mine, other, name)
    assert np.isfinite(first.reward).any()


@pytest.mark.parametrize("squash", ["clip", "tanh"])
def test_actions_stay_within_their_bounds(squash):
    actions = fresh_bundle(squash=squash).agent.act(observations())
    assert actions.dtype == np.float32
    assert actions.shape == (500, 6)
    assert np.abs(actions).max() <= 1.0
    assert np.abs(actions).max() > 0.99  # the bound was reached


@pytest.mark.parametrize(
    "settings",
    [
        PPOSettings(algorithm="ppo", net_arch=HIDDEN, n_envs=4, n_steps=8, batch_size=32),
        SACSettings(algorithm="sac", net_arch=HIDDEN, n_envs=4, buffer_size=100),
    ],
    ids=["ppo", "sac"],
)
def test_the_actor_is_the_deterministic_policy_of_sb3(settings):
    """The same float32 layers on the same input: equal to the last bit, but for what SB3 does with tanh's ends.

    SB3 rescales squashed actions to the bounds of the space and back, which rounds in float32.
    """
    batch = CasterTrackVectorEnv(4, path="circle", autoreset_mode="SameStep", corridor=TASK.corridor)
    learner = make_learner(settings, SB3VecEnv(batch), seed=1)
    seen = observations()
    expected, _ = learner.predict(seen, deterministic=True)
    actions = fresh_bundle().agent.act(seen)
    assert np.abs(actions - expected).max() > 0.1  # another network acts otherwise
    actor = actor_of(learner, settings)
    actions = Bundle(fresh_bundle().description, actor).agent.act(seen)
    if settings.algorithm == "ppo":
        assert_array_equal(actions, expected)
    else:
        assert_allclose(actions, expected, rtol=0.0, atol=1.2e-7)  # one rounding at 1


def test_the_actor_keeps_weights_of_its_own():
    """Later training does not change a policy that was kept."""
    settings = PPOSettings(algorithm="ppo", net_arch=HIDDEN, n_envs=4, n_steps=8, batch_size=32)
    batch = CasterTrackVectorEnv(4, path="circle", autoreset_mode="SameStep", corridor=TASK.corridor)
    learner = make_learner(settings, SB3VecEnv(batch), seed=1)
    actor = actor_of(learner, settings)
    kept = {name: tensor.clone() for name, tensor in actor.state_dict().items()}
    with torch.no_grad():
        for weight in learner.policy.parameters():
            weight.add_(1.0)
    assert all(torch.equal(tensor, kept[name]) for name, tensor in actor.state_dict().items())


class Trap:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, file):
        self.file = file

    def __reduce__(self):
        return open, (str(self.file), "w")


@pytest.mark.parametrize("write", [pickle.dump, torch.save], ids=["pickle", "torch"])
def test_pickled_weights_are_refused_and_run_nothing(tmp_path, write):
    folder, mark = saved(tmp_path), tmp_path / "it ran"
    with (folder / WEIGHTS).open("wb") as file:
        write(Trap(mark), file)
    with pytest.raises(ConfigurationError, match=r"weights\.safetensors holds no weights"):
        load_policy(folder)
    assert not mark.exists()


def test_python_tags_in_the_description_are_refused_and_run_nothing(tmp_path):
    folder, mark = saved(tmp_path), tmp_path / "it ran"
    text = (folder / DESCRIPTION).read_text(encoding="utf-8")
    text = text.replace("name: PPO", f"name: !!python/object/apply:os.system ['touch {mark}']", 1)
    assert "os.system" in text
    (folder / DESCRIPTION).write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"policy\.yaml cannot be read as YAML"):
        load_policy(folder)
    assert not mark.exists()


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r"there is no folder '.*nowhere' of a policy"):
        load_policy(tmp_path / "nowhere")
    folder = saved(tmp_path)
    (folder / WEIGHTS).unlink()
    with pytest.raises(ConfigurationError, match=r"there is no file '.*weights\.safetensors'"):
        load_policy(folder)


def test_a_policy_without_a_task_is_refused(tmp_path):
    folder = saved(tmp_path)
    content = yaml.safe_load((folder / DESCRIPTION).read_text(encoding="utf-8"))
    del content["task"]
    (folder / DESCRIPTION).write_text(yaml.safe_dump(content), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=r"policy\.yaml: 'task' is missing"):
        load_policy(folder)


@pytest.mark.parametrize("version", [2, 0, "1", None, True, [1]])
def test_another_format_is_refused(tmp_path, version):
    folder = saved(tmp_path)
    change_description(folder, format=version)
    with pytest.raises(ConfigurationError, match=r"'?format'?.* (reads 1|should be)"):
        load_policy(folder)


def test_an_unknown_key_is_named(tmp_path):
    folder = saved(tmp_path)
    change_description(folder, sqash="clip")
    with pytest.raises(ConfigurationError, match=r"policy\.yaml: unknown key 'sqash'; did you mean 'squash'\?"):
        load_policy(folder)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda w: w.pop("head.bias"), r"weight 'head\.bias' is missing"),
        (lambda w: w.update(extra=torch.zeros(1)), "weight 'extra' is not known"),
        (lambda w: w.update({"head.bias": torch.zeros(5)}), r"weight 'head\.bias' must be \[6\] .*got \[5\]"),
        (lambda w: w.update({"head.bias": torch.zeros(6, dtype=torch.float64)}), "'F32', got .*'F64'"),
        (lambda w: w["layers.0.weight"].fill_(float("nan")), r"weight 'layers\.0\.weight' holds numbers that are not"),
        (lambda w: w["head.bias"].fill_(float("inf")), r"weight 'head\.bias' holds numbers that are not finite"),
    ],
    ids=["missing", "unknown", "shape", "type", "nan", "inf"],
)
def test_weights_that_do_not_fit_are_named(tmp_path, change, message):
    folder = saved(tmp_path)
    change_weights(folder, change)
    with pytest.raises(ConfigurationError, match=message):
        load_policy(folder)


def test_layers_that_do_not_fit_the_weights_are_refused(tmp_path):
    folder = saved(tmp_path)
    change_description(folder, hidden=[16, 9])
    with pytest.raises(ConfigurationError, match=r"weight 'layers\.1\.weight' must be \[9, 16\]"):
        load_policy(folder)


def test_a_bundle_replaces_the_one_that_was_there_whole(tmp_path):
    folder = saved(tmp_path, seed=1)
    (folder / "stale.txt").write_text("of the old one", encoding="utf-8")
    save_bundle(folder, fresh_bundle(seed=2))
    assert sorted(file.name for file in folder.iterdir()) == [DESCRIPTION, WEIGHTS]
    assert [one.name for one in tmp_path.iterdir()] == ["policy"]
    assert_array_equal(load_policy(folder).agent.act(observations()), fresh_bundle(seed=2).agent.act(observations()))


def test_a_bundle_that_is_saved_again_is_there_at_every_instant(tmp_path):
    (tmp_path / "run").mkdir()
    old, new = fresh_bundle(seed=1), fresh_bundle(seed=2)
    save_bundle(tmp_path / "run" / "best", old)
    left = killed_at_each_line(
        [module, durable_files], tmp_path / "run", lambda: save_bundle(tmp_path / "run" / "best", new)
    )
    heads = [load_policy(one / "best").agent.actor.head.weight for one in left]
    is_old = [torch.equal(head, old.agent.actor.head.weight) for head in heads]
    assert is_old == sorted(is_old, reverse=True) and is_old[0] and not is_old[-1] and len(left) > 5
    assert torch.equal(heads[-1], new.agent.actor.head.weight)
    assert [one.name for one in (tmp_path / "run").iterdir()] == ["best"]


@pytest.mark.parametrize("failing", ["write_file", "yaml"])
def test_a_failure_while_saving_leaves_the_old_bundle(tmp_path, monkeypatch, failing):
    folder = saved(tmp_path, seed=1)

    def fail(*_, **__):
        raise OSError("no space left on device")

    if failing == "write_file":
        monkeypatch.setattr(module, "write_file", fail)
    else:
        monkeypatch.setattr(yaml, "safe_dump", fail)
    for target in (folder, tmp_path / "new"):
        with pytest.raises(OSError, match="no space left"):
            save_bundle(target, fresh_bundle(seed=2))
    assert [one.name for one in tmp_path.iterdir()] == ["policy"]
    monkeypatch.undo()
    assert_array_equal(load_policy(folder).agent.act(observations()), fresh_bundle(seed=1).agent.act(observations()))


def test_a_policy_is_refused_where_it_cannot_act():
    bundle = fresh_bundle()
    bundle.check_fits(LAYOUT, TASK.control_period)
    with pytest.raises(ValueError, match=r"the policy drives roll_1, .* of 'chung2008', the task .* of 'tidybot2'"):
        bundle.check_fits(ObservationLayout(load_robot("tidybot2"), TASK.preview), TASK.control_period)
    with pytest.raises(ValueError, match=r"the policy drives .*, the task roll_1, steer_1, roll_2, steer_2 of"):
        fewer = ROBOT.with_actuation(["roll_1", "steer_1", "roll_2", "steer_2"])
        bundle.check_fits(ObservationLayout(fewer, TASK.preview), TASK.control_period)
    with pytest.raises(ValueError, match=r"needs a preview of \(0\.1, 0\.2, 0\.4\) s, the task shows \(0\.1,\) s"):
        bundle.check_fits(ObservationLayout(ROBOT, (0.1,)), TASK.control_period)
    with pytest.raises(ValueError, match=r"acts every 0\.02 s, the task every 0\.01 s"):
        bundle.check_fits(LAYOUT, 0.01)
    with pytest.raises(ValueError, match="the policy sees 0 obstacles, the task shows 3"):
        bundle.check_fits(ObservationLayout(ROBOT, TASK.preview, "s", 3), TASK.control_period)


def test_a_policy_is_refused_in_the_other_environment():
    tracks, follows = fresh_bundle(), fresh_bundle(environment="follow", task=FollowParameters())
    layout = follows.description.layout
    follows.check_fits(layout, TASK.control_period)
    assert layout.size == FOLLOWED.size
    with pytest.raises(
        ValueError, match=r"learned to follow a timetable .*'track'.*, the task is to .* at its own pace"
    ):
        tracks.check_fits(layout, TASK.control_period)
    with pytest.raises(ValueError, match=r"learned to follow a path at its own pace .*, the task is to .* a timetable"):
        follows.check_fits(LAYOUT, TASK.control_period)


def test_a_policy_is_refused_where_its_actions_mean_something_else():
    """What only changes sensors or the plant may differ: a policy can be tried with it."""
    commands, lag = TwistCommands(), MotorLag()
    bundle = fresh_bundle(wrappers=(commands, lag))
    bundle.check_fits(LAYOUT, TASK.control_period, [commands])
    fresh_bundle().check_fits(LAYOUT, TASK.control_period, [lag])
    with pytest.raises(ValueError, match=r"the policy's actions are \{kind: twist_commands\}, the task takes torques"):
        bundle.check_fits(LAYOUT, TASK.control_period)
    with pytest.raises(ValueError, match=r"the policy's actions are torques, the task takes \{kind: twist_commands\}"):
        fresh_bundle().check_fits(LAYOUT, TASK.control_period, [commands])


def test_a_policy_with_features_is_read_back(tmp_path):
    """Here three speeds of the platform instead of six torques."""
    before = fresh_bundle(wrappers=(TwistCommands(),), actions=3)
    save_bundle(tmp_path / "policy", before)
    after = load_policy(tmp_path / "policy")
    assert after.description == before.description
    assert after.agent.act(observations(4)).shape == (4, 3)
    assert_array_equal(after.agent.act(observations()), before.agent.act(observations()))


def test_a_name_that_no_folder_can_have_is_told():
    with pytest.raises(ConfigurationError, match="is no name of a file: it is too long"):
        load_policy("n" * 300)


def test_a_policy_that_sees_the_past_is_written_and_read_and_needs_it(tmp_path):
    """Its weights are as wide as what it sees; without the feature, the sentence names what it has learned from."""
    past = History(observations=1, actions=2)
    plain = fresh_bundle()
    size, actions = plain.description.layout.size, plain.agent.actor.head.out_features
    wide = Actor(2 * size + 2 * actions, plain.description.hidden, actions, plain.description.squash)
    bundle = Bundle(plain.description.model_copy(update={"wrappers": (past,)}), wide)
    save_bundle(tmp_path / "policy", bundle)
    again = load_policy(tmp_path / "policy")
    observations = np.random.default_rng(0).normal(size=(3, 2 * size + 2 * actions)).astype(np.float32)
    assert_array_equal(again.act(observations), bundle.act(observations))
    fits = plain.description.layout, plain.description.task.control_period
    again.check_fits(*fits, (past,))
    with pytest.raises(ValueError, match=r"has learned from \{kind: history, actions: 2\}, the task shows the present"):
        again.check_fits(*fits)
    with pytest.raises(ValueError, match=r"from the present observation alone, the task shows \{kind: history"):
        plain.check_fits(*fits, (past,))
