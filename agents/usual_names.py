"""What Stable-Baselines3, rsl-rl-lib and Gymnasium call what is set here, so that their names get an answer that helps.

Each name stands for a field, whose value means the same, or for words that say where such a thing is set.
"""

from caster_gym.envs.task import Task

_EVERY_LEARNER = {
    "total_timesteps": "steps",
    "n_steps_total": "steps",
    "max_timesteps": "steps",
    "timesteps": "steps",
    "n_envs": "robots",
    "num_envs": "robots",
    "nenvs": "robots",
    "gamma": "discount",
    "lr": "learning_rate",
    "net_arch": "hidden",
    "hidden_dims": "hidden",
    "hidden_sizes": "hidden",
    "policy_kwargs": "the layers of the networks are set by 'hidden', e.g. hidden=[256, 256]",
    "policy": "the policy is a network of dense layers, set by 'hidden'",
    "activation_fn": "the layers are ReLU; their sizes are set by 'hidden'",
    "lr_schedule": "'falling' says whether the learning rate falls linearly to zero",
    "seed": "the seed is given by `caster-gym train --seed`, or by 'seeds' of a comparison",
    "threads": "the number of threads is given by --threads",
    "n_jobs": "the number of threads is given by --threads",
    "verbose": "a bar shows how far training is, and progress.csv has the numbers",
    "log_interval": "numbers are written to progress.csv and TensorBoard after every round",
    "tensorboard_log": "TensorBoard events are always written, to the folder of --out",
    "eval_freq": "'validations' says how often the policy is validated, evenly spread over the run",
    "n_eval_episodes": "one episode is run on each validation path of the task",
    "max_episode_steps": "an episode is as long as its path, whose 'duration' the task sets",
    "use_sde": "exploration is drawn anew in every control period",
    "sde_sample_freq": "exploration is drawn anew in every control period",
    "env": "the task is given by `caster-gym train --task`, or by 'task' of a comparison",
    "task": "the task is given by `caster-gym train --task`, or by 'task' of a comparison",
}
_ON_THE_CPU = {"device": "Stable-Baselines3 works on the CPU here; the agents ppo_gpu and shac have a 'device'"}
_NO_CRITIC_WEIGHT = {"vf_coef": "the value's weight in the loss is 0.5, as is usual, and cannot be set"}
_ON_POLICY = {
    **_EVERY_LEARNER,
    **_NO_CRITIC_WEIGHT,
    "n_steps": "horizon",
    "num_steps": "horizon",
    "num_steps_per_env": "horizon",
    "rollout_steps": "horizon",
    "batch_size": "batch",
    "minibatch_size": "batch",
    "n_epochs": "epochs",
    "num_epochs": "epochs",
    "update_epochs": "epochs",
    "num_learning_epochs": "epochs",
    "gae_lambda": "trace",
    "lam": "trace",
    "clip_range": "clip",
    "clip_coef": "clip",
    "clip_param": "clip",
    "ent_coef": "entropy",
    "entropy_coef": "entropy",
    "log_std_init": "initial_log_std",
    "num_mini_batches": "'batch' is the size of a batch: robots · horizon over their number",
    "n_minibatches": "'batch' is the size of a batch: robots · horizon over their number",
    "num_minibatches": "'batch' is the size of a batch: robots · horizon over their number",
    "train_batch_size": "robots · horizon steps come before each update",
    "value_loss_coef": _NO_CRITIC_WEIGHT["vf_coef"],
    "max_grad_norm": "gradients are shortened to a norm of 0.5, as is usual, which cannot be set",
    "target_kl": "updates are never cut short; 'epochs' and 'learning_rate' say how far they go",
    "tau": "PPO has no target network",
    "clip_range_vf": "values are not clipped, as is usual",
    "normalize_advantage": "advantages are normalised in every batch, as is usual",
}
PPO = {**_ON_POLICY, **_ON_THE_CPU}
RSL_PPO = _ON_POLICY
SAC = {
    **_EVERY_LEARNER,
    **_ON_THE_CPU,
    "batch_size": "batch",
    "buffer_size": "buffer",
    "learning_starts": "first_random",
    "gradient_steps": "updates",
    "tau": "soft_update",
    "ent_coef": "entropy",
    "train_freq": "SAC learns after every control period of all robots; 'updates' says how many steps it then makes",
    "n_steps": "SAC learns after every control period of all robots; 'updates' says how many steps it then makes",
    "horizon": "SAC learns after every control period of all robots; 'updates' says how many steps it then makes",
    "n_epochs": "SAC learns after every control period of all robots; 'updates' says how many steps it then makes",
    "action_noise": "SAC explores by the entropy of its policy, whose coefficient begins as 'entropy'",
    "use_sde_at_warmup": "exploration is drawn anew in every control period",
    "target_update_interval": "the target follows after every step, by a share of 'soft_update'",
    "gae_lambda": "SAC has no trace; its targets look one control period ahead",
    "clip_range": "SAC does not clip its updates",
    "vf_coef": "actor and critics have losses of their own",
    "max_grad_norm": "SAC's gradients are not shortened; a smaller 'learning_rate' makes smaller steps",
}
SHAC = {
    **_EVERY_LEARNER,
    "n_steps": "window",
    "num_steps": "window",
    "num_steps_per_env": "window",
    "steps_num": "window",
    "horizon": "window",
    "batch_size": "critic_batch",
    "batch": "critic_batch",
    "n_epochs": "critic_epochs",
    "epochs": "critic_epochs",
    "gae_lambda": "trace",
    "lam": "trace",
    "tau": "soft_update",
    "max_grad_norm": "greatest_gradient",
    "grad_norm": "greatest_gradient",
    "actor_learning_rate": "learning_rate",
    "critic_lr": "critic_learning_rate",
    "ent_coef": "SHAC explores by 'noise' and by starting robots anew, not by an entropy",
    "entropy": "SHAC explores by 'noise' and by starting robots anew, not by an entropy",
    "clip_range": "SHAC does not clip its updates; 'greatest_gradient' limits them",
    "vf_coef": "the critic has a loss and a 'critic_learning_rate' of its own",
}
COMPUTED_TORQUE = {
    "natural_frequency": "it is chosen among the 'natural_frequencies' listed, e.g. natural_frequencies: [10.0]",
    "bandwidth": "it is chosen among the 'natural_frequencies' listed, e.g. natural_frequencies: [10.0]",
    "kp": "gains follow from the natural frequency: list it as natural_frequencies: [10.0]",
    "kd": "gains follow from the natural frequency: list it as natural_frequencies: [10.0]",
}


def of_task_files(parameters: set[str]) -> dict[str, str]:
    """Answers to keys beside `task` that belong into it, or that stand elsewhere; parameters: those of all tasks."""
    inside = {name: f"write it inside of 'task', as task: {{{name}: …}}" for name in parameters}
    usual = {
        name: f"write it inside of 'task', as task: {{{here}: …}}"
        for name, here in Task.usual_names.items()
        if here in parameters
    }
    return {
        **inside,
        **usual,
        "env": "environment",
        "env_id": "environment",
        "path": "the paths are those of 'train', 'validation' and 'test'",
        "paths": "the paths are those of 'train', 'validation' and 'test'",
        "max_episode_steps": Task.usual_names["max_episode_steps"],
        "seed": "random paths have a 'seed' of their own, and training runs are given one by --seed",
        "n_envs": "the number of robots is set by 'robots' of an agent",
        "num_envs": "the number of robots is set by 'robots' of an agent",
        "obstacles": "obstacles stand in 'arena'",
        "rewards": "shaping",
        "eval": "validation",
        "evaluation": "test",
    }


def of_comparison_files(parameters: set[str]) -> dict[str, str]:
    """Answers to keys of comparisons that belong to its agents or to its task; parameters: keys of tasks."""
    usual = {name: here for name, here in _EVERY_LEARNER.items() if here.isidentifier()}
    fields = {here: here for names in (PPO, SAC, SHAC) for here in names.values() if here.isidentifier()}
    return {
        **{
            name: f"it belongs to the agents: write {here} into their files, or give --set {here}=…"
            for name, here in {**usual, **fields}.items()
        },
        **dict.fromkeys(parameters, "it is a key of a task, whose name or file is given as 'task'"),
        "seed": "seeds",
        "n_seeds": "'seeds' lists them: [0, 1, 2]",
        "agent": "agents",
        "threads": "the number of threads is given by --threads",
        "n_eval_episodes": "starts",
    }
