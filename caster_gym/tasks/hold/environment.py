"""CasterHold-v0: go to a pose and hold it, with motor torques."""

from caster_gym.tasks.environment import TaskEnv, TaskVectorEnv
from caster_gym.tasks.hold import TASK


class CasterHoldEnv(TaskEnv):
    """An omnidirectional robot on powered casters goes to a pose and holds it.

    **Reference** is the pose, at rest: `target`, given as x, y [m] and heading [rad] in W, or without it the end of the
    path of the episode, which is drawn from the pool (`path`) like those of `CasterTrackEnv`.

    **Action**, **Floor**, **Impacts** and **Info** as for `CasterTrackEnv`.

    **Observation** as for `CasterTrackEnv`, from that reference, without a preview.

    **Reward**, the sum of terms that `info["reward_terms"]` names; k(e, ℓ) = ½/(1 + e²/ℓ²) + ½/(1 + e²/(30 ℓ)²):

    | term | meaning | range |
    |---|---|---|
    | position | 0.4 k(distance to the pose, 0.01 m) | 0 … 0.4 |
    | heading | 0.3 k(chord of the heading error, 0.02) | 0 … 0.3 |
    | rest | 0.3 times both kernels above, over 1 + (speed/0.05 m/s)² + (yaw rate/0.2 rad/s)² | 0 … 0.3 |
    | effort | −0.02 times the mean square of torques as shares of their limits | −0.02 … 0 |
    | impact | −impact_weight (0) J/(J + 0.5 N s), J the normal impulse of obstacles in the period | ≤ 0 |
    | alive | 0.02 + impact_weight, so that no step is worth less than none | ≥ 0.02 |

    **Endings** `terminated`: the robot is farther than its corridor (1 m) from the pose, its state stopped being
    finite, or it touched an obstacle and `touching` is "ends"; all terms of that step are 0. `truncated`: `duration`
    (4 s) is over. Arriving does not end an episode.

    **Start** at rest, with random steering, drawn in an area around the pose: up to 0.3 m along each of its axes and
    1 rad, unless `reset(options={…})` says otherwise: `path`, `pose`, `twist` and `steering` as for `CasterTrackEnv`.

    robot, path, actuation, arena, render_mode: as for `CasterTrackEnv`; of a path only its end counts. All other
    keywords are fields of `caster_gym.tasks.hold.parameters.HoldParameters`, which holds the numbers above.

    >>> import caster_gym, gymnasium
    >>> env = gymnasium.make("caster_gym:CasterHold-v0", target=(1.0, 0.5, 1.57))
    >>> observation, info = env.reset(seed=0)
    >>> observation in env.observation_space, info["reference_pose"].round(3).tolist()
    (True, [1.0, 0.5, 0.001, 1.0])
    """

    definition = TASK


class CasterHoldVectorEnv(TaskVectorEnv):
    """A batch of `CasterHoldEnv`; see `TaskVectorEnv`.

    >>> import caster_gym, gymnasium
    >>> envs = gymnasium.make_vec("caster_gym:CasterHold-v0", num_envs=3, target=(1.0, 0.5, 1.57))
    >>> observations, infos = envs.reset(seed=0)
    >>> observations in envs.observation_space, bool((infos["position_error"] < 0.43).all())
    (True, True)
    """

    definition = TASK
