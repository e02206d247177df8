"""CONTRIBUTING.md: its recipes give what they promise."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_allclose

import caster_gym
from caster_gym.arena import arena, distances

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def recipe(title, language):
    """The first block of code of a section."""
    section = TEXT[TEXT.index(f"## {title}\n") :]
    block = re.search(rf"^ *```{language}\n(.*?)^ *```", section, re.M | re.S)
    assert block is not None
    return textwrap.dedent(block[1])


def test_the_five_caster_robot_can_be_driven(tmp_path, recwarn):
    file = tmp_path / "five.yaml"
    file.write_text(recipe("Add a robot", "yaml"), encoding="utf-8")
    robot = caster_gym.load_robot(file)
    pivots = np.array([complex(caster.x, caster.y) for caster in robot.casters])
    assert_allclose(pivots, 0.25 * np.exp(2j * np.pi * np.arange(5) / 5), atol=1e-4)  # as many digits as the file has
    assert gym.make("caster_gym:CasterTrack-v0", robot=str(file), path="circle").action_space.shape == (10,)
    assert not list(recwarn)  # none of its numbers is implausible, and its motors can always push it


def test_the_new_kind_of_obstacle_is_where_it_says():
    known = dict(vars(arena))
    exec(recipe("Add an obstacle kind", "python"), known)
    barrel: Any = known["Barrel"]

    class Yard(arena.Arena):
        barrels: tuple[barrel, ...] = ()  # as the recipe says

    yard = Yard.model_validate({"barrels": [{"start": (1.0, -1.0), "end": (1.0, 1.0), "radius": 0.2}]})
    robot = caster_gym.load_robot("chung2008")  # a disc of 0.15 m
    gaps, _ = distances(yard, robot, [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [3.0, 2.0, 0.0]])
    by_hand = np.array([1.0, 1.0, np.hypot(2.0, 1.0)]) - 0.2 - 0.15  # to the side, beyond the end, from the corner
    assert_allclose(gaps[:, 0], by_hand, rtol=1e-12)  # rounding


def change(root, title):
    """Change a copy of the package as a section says, under names that nobody has taken.

    Each piece adds lines beside one that it shows, wherever that line is now.
    """
    name, *pieces = recipe(title, "diff").removeprefix("--- ").split("\n@@\n")
    text = (root / name).read_text(encoding="utf-8")
    for piece in pieces:
        lines = piece.splitlines()
        (anchor,) = [line[1:] for line in lines if line[0] == " "]
        added = [
            re.sub(r"\b(power(?=[:=])|reference_twist\b)", r"tried_\1", line[1:]) for line in lines if line[0] != " "
        ]
        assert all(line[0] in "+ " for line in lines)
        assert text.count(f"\n{anchor}\n") == 1, anchor
        place = len(added) if lines[-1][1:] == anchor else 0
        added.insert(place, anchor)
        text = text.replace(f"\n{anchor}\n", "\n" + "\n".join(added) + "\n")
    (root / name).write_text(text, encoding="utf-8")


@pytest.fixture
def copied(tmp_path):
    """A copy of the package, to be changed."""
    for name in ("caster_gym", "agents", "configs"):
        shutil.copytree(ROOT / name, tmp_path / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def run_in(root, program):
    """What a program says that imports the package from there."""
    environment = os.environ | {"PYTHONPATH": str(root), "NUMBA_CACHE_DIR": str(root / "cache")}
    command = [sys.executable, "-c", textwrap.dedent(program)]
    return subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_new_reward_term_and_a_new_channel_shift_nothing(copied):
    """One robot, a batch and tensors agree; rewards are sums of all terms, and the rest is what it was."""
    program = """
        import gymnasium as gym, numpy as np, torch
        from numpy.testing import assert_allclose, assert_array_equal
        import caster_gym
        from caster_gym.tasks.track import TASK

        robot = caster_gym.load_robot("chung2008")
        pair = robot.model_copy(update={"casters": robot.casters[:2], "actuation": "all"})  # for speed
        path = {"shape": "circle", "radius": 0.3, "duration": 8.0}
        settings = dict(robot=pair, path=path, preview=(0.1,), start_offset=0.0)
        single = gym.make("caster_gym:CasterTrack-v0", **settings).unwrapped
        batch = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=2, **settings)
        tensors = caster_gym.TorchVectorEnv("track", 2, dtype=torch.float64, **settings)
        for env in (single, batch, tensors):
            env.reset(seed=4)
        actions = np.full((2, 4), 0.2, dtype=np.float32)
        for _ in range(3):
            one, many, there = single.step(actions[0]), batch.step(actions), tensors.step(torch.as_tensor(actions))

        observation, reward, *_, info = one
        assert tuple(info["reward_terms"]) == TASK.terms._fields and "tried_power" in TASK.terms._fields
        assert reward == sum(info["reward_terms"].values())
        assert info["power"] > 0.0
        assert_allclose(info["reward_terms"]["tried_power"], 0.02 / (1.0 + (info["power"] / 20.0) ** 2), rtol=1e-12)
        assert_array_equal(info["pose"], single.engine.states[0][:4])
        assert_array_equal(info["reference_pose"], single.engine.plan.tables[0][3][:4])
        assert_allclose(info["torque"], [0.04, 0.02] * 2, rtol=1e-6)  # float32 shares of 0.2 and 0.1 N m
        assert (info["clearance"], info["impacts"], info["touched"]) == (np.inf, 0.0, False)

        layout = single.engine.layout
        assert layout.size == observation.size == single.observation_space.shape[0]
        names = "twist_error", "twist", "tried_reference_twist"
        error, twist, wanted = (layout.physical(observation, name) for name in names)
        assert_allclose(wanted, twist + error, atol=1e-6)  # float32 of order 1
        assert_allclose(twist, single.engine.states[0][4:7], rtol=1e-6)
        directions = layout.physical(observation, "directions").reshape(-1, 2)
        assert_allclose(np.hypot(*directions.T), 1.0, rtol=1e-6)
        assert_allclose(np.hypot(*layout.physical(observation, "preview_0.1s")[2:4]), 1.0, rtol=1e-6)

        def numbers(of, robot):
            flat = {**of, **of["reward_terms"]}
            del flat["reward_terms"]
            return {k: np.asarray(v if robot is None else v[robot]) for k, v in flat.items() if k[0] != "_"}

        assert_array_equal(many[0][0], observation)
        assert many[1][0] == reward
        assert_allclose(there[0][0], observation, atol=1e-6)  # float64 against float32
        assert_allclose(float(there[1][0]), reward, atol=1e-12)  # rounding in another order
        there[4].pop("final_obs"), there[4].pop("final_info")
        for name, value in numbers(info, None).items():
            assert_array_equal(numbers(many[4], 0)[name], value, err_msg=name)
            assert_allclose(numbers(there[4], 0)[name], value, atol=1e-9, err_msg=name)
    """
    change(copied, "Add a reward term")
    change(copied, "Add an observation channel")
    done = run_in(copied, program)
    assert done.returncode == 0, done.stderr


def test_a_channel_of_another_width_than_its_units_is_refused_at_import(copied):
    change(copied, "Add an observation channel")
    file = copied / "caster_gym/envs/observation.py"
    text = file.read_text(encoding="utf-8")
    head, _, tail = text.partition("def tried_reference_twist(")
    tail = tail.replace("vx, vy, view.reference.omega", "vx, vy", 1)
    file.write_text(f"{head}def tried_reference_twist({tail}", encoding="utf-8")
    said = run_in(copied, "import caster_gym.envs.observation").stderr
    assert "channel 'tried_reference_twist' of the observation has 3 units per robot, and its function" in said
    assert "tried_reference_twist gives 2 numbers" in said
