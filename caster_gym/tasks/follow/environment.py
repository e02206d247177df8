"""CasterFollow-v0: follow a path at a speed that the robot chooses, among walls and pillars, with motor torques."""

from caster_gym.tasks.environment import TaskEnv, TaskVectorEnv
from caster_gym.tasks.follow import TASK


class CasterFollowEnv(TaskEnv):
    """An omnidirectional robot on powered casters follows a path inside a corridor, at a speed that it chooses.

    **Progress** is the arc length s of the point of the path nearest to the robot, among the points from the progress
    so far to 0.2 m ahead. It never falls. Shortcuts across a crossing and loops backward earn nothing.

    **Reference** is that point, with the speed and acceleration of a time law: from rest to rest, as fast as the speed
    limit (1 m/s) and a margin (80 %) of the motors allow. The time law is not binding.

    **Action** as for `CasterTrackEnv`.

    **Observation** as for `CasterTrackEnv`, from that reference, with a preview at arc lengths ahead (0.05, 0.15,
    0.4 m) and the 3 nearest obstacles.

    **Reward**, the sum of terms that `info["reward_terms"]` names; k(e, ℓ) = ½/(1 + e²/ℓ²) + ½/(1 + e²/(10 ℓ)²), and
    σ is the progress in the control period as a share of what the speed limit allows, at most 1; at the end of the path
    it is 1/(1 + e²/(0.02 m)²) of the distance e to its last point:

    | term | meaning | range |
    |---|---|---|
    | progress | 0.2 σ | 0 … 0.2 |
    | cross_track | 0.4 σ k(distance to the path, 0.01 m) | 0 … 0.4 |
    | heading | 0.4 σ k(chord of the heading error, 0.15) | 0 … 0.4 |
    | effort | −0.02 times the mean square of torques as shares of their limits | −0.02 … 0 |
    | impact | −0.5 J/(J + 0.5 N s), J the normal impulse of obstacles in the period | −0.5 … 0 |
    | alive | 0.52, so that no step is worth less than none | 0.52 |

    **Impacts** as for `CasterTrackEnv`: where `impact_traction` is above 1 the floor cannot hold the wheels, and the
    true impulse is smaller than the one here.

    **Floor** as for `CasterTrackEnv`.

    **Info** as for `CasterTrackEnv`; progress [m] is s, progress_share is σ, position_error the distance to the path.

    **Endings** `terminated`: the robot left its corridor (0.25 m from the path), its state stopped being finite, or it
    touched an obstacle and `touching` is "ends"; all terms of that step are 0. `truncated`: 1.5 times what the time
    law takes is over. Arriving does not end an episode.

    **Start** at rest, with random steering, beside the path's start by up to 0.02 m along each axis and 0.1 rad, unless
    `reset(options={…})` says otherwise: as for `CasterTrackEnv`, but with `progress` [m], the arc length s at which the
    robot starts, instead of `time`. A `pose` without it starts at the place of the path that is nearest.

    robot, path, actuation, arena, render_mode: as for `CasterTrackEnv`; of a path only its geometry and headings count.
    All other keywords are fields of `caster_gym.tasks.follow.parameters.FollowParameters`, with the numbers above.

    >>> import caster_gym, gymnasium
    >>> env = gymnasium.make("caster_gym:CasterFollow-v0", path="lemniscate")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(0.1 * env.action_space.high)
    >>> observation in env.observation_space, round(reward, 3), round(info["progress"], 3)  # [m]
    (True, 0.798, 0.007)
    """

    definition = TASK


class CasterFollowVectorEnv(TaskVectorEnv):
    """A batch of `CasterFollowEnv`; see `TaskVectorEnv`.

    >>> import caster_gym, gymnasium
    >>> batch = gymnasium.make_vec("caster_gym:CasterFollow-v0", num_envs=16, path="lemniscate")
    >>> observations, infos = batch.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = batch.step(batch.action_space.sample())
    >>> observations in batch.observation_space, rewards.shape, infos["progress"].shape
    (True, (16,), (16,))
    """

    definition = TASK
