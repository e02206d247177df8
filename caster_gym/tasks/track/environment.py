"""CasterTrack-v0: follow a timed trajectory with motor torques."""

from caster_gym.tasks.environment import TaskEnv, TaskVectorEnv
from caster_gym.tasks.track import TASK


class CasterTrackEnv(TaskEnv):
    """An omnidirectional robot on powered casters follows a timed trajectory. B is the body frame, W the world frame.

    **Action** `Box(−1, 1, (driven joints,), float32)`, held for a control period (0.02 s by default):

    | index | meaning | frame | unit of 1 |
    |---|---|---|---|
    | j | torque of the j-th driven motor, in the order roll_1, steer_1, roll_2, … | joint | its max_torque [N m] |

    A motor gives less near its top speed; `info["torque"]` holds what it gave.

    **Observation** `Box(−20, 20, float32)` for N casters and K previewed points; errors are reference minus robot:

    | index | meaning | frame | unit of 1 | range |
    |---|---|---|---|---|
    | 0–1 | position error, ahead and left | B | 0.1 m | ±20 |
    | 2–3 | cos and sin of the heading error | – | 1 | ±1 |
    | 4–6 | twist error vx, vy, ω | B | 0.25 m/s, 0.25 m/s, 0.5 rad/s | ±20 |
    | 7–9 | twist vx, vy, ω | B | 1 m/s, 1 m/s, 2 rad/s | ±20 |
    | 10–12 | acceleration of the reference, ahead, left, yaw | B | 2 m/s², 2 m/s², 4 rad/s² | ±20 |
    | 13 … 12+2N | cos δ_i, sin δ_i of each rolling direction | B | 1 | ±1 |
    | 13+2N … 12+4N | rolling rate r θ̇_i and steering rate d δ̇_i | joint | 1 m/s | ±20 |
    | then 7 for each K | its point: ahead, left; cos, sin of heading; vx, vy; ω | B | 0.5 m; 1; 1 m/s; 2 rad/s | ±20 |
    | then 3 for each of `nearest` (0) | obstacle: gap, at most 1 m; direction from it | B | 0.25 m; 1 | ±20 |

    **Reward**, the sum of terms that `info["reward_terms"]` names; k(e, ℓ) = ½/(1 + e²/ℓ²) + ½/(1 + e²/(10 ℓ)²):

    | term | meaning | range |
    |---|---|---|
    | position | 0.5 k(distance to the reference, 0.01 m) | 0 … 0.5 |
    | heading | 0.3 k(chord of the heading error, 0.02) | 0 … 0.3 |
    | speed | 0.2 times such a kernel of the twist error over 0.1 m/s and 0.3 rad/s | 0 … 0.2 |
    | effort | −0.02 times the mean square of torques as shares of their limits | −0.02 … 0 |
    | impact | −impact_weight (0) J/(J + 0.5 N s), J the normal impulse of obstacles in the period | ≤ 0 |
    | alive | 0.02 + impact_weight, so that no step is worth less than none | ≥ 0.02 |

    **Info**, after reset and step alike; arrays have the robots in front in a batch:

    | key | meaning | unit |
    |---|---|---|
    | position_error, heading_error | distance to the reference; reference heading minus robot heading | m, rad |
    | reward_terms | the terms above, by name | – |
    | torque | mean torque of each of the 2 N motors over the control period, 0 where a joint is not driven | N m |
    | power | mean mechanical power of all motors over the control period | W |
    | traction_use | greatest share of friction used; above 1 a wheel would slip; at most 1 where wheels may slip | – |
    | wheel_slip | greatest speed of each wheel over the floor; only there where wheels may slip, see Floor | m/s |
    | wheels_lifted | most wheels at once that a push, an acceleration or a load lifts off the floor | – |
    | conditioning | σ_min/σ_max of the driven motors' wrenches, 0 where they cannot push the robot somewhere | – |
    | pose, reference_pose | x, y, cos β, sin β in W | m, – |
    | progress, progress_share | 0 in this task | m, – |
    | clearance | gap to the nearest obstacle; inf where there is none | m |
    | impacts | number of impacts faster than 1 cm/s in the control period | – |
    | impact_traction | largest share of the floor's friction that a wheel uses in one of them; above 1 it slips | – |
    | normal_impulse | sum of all normal impulses of obstacles, of impacts and of lasting contacts | N s |
    | impulse | sum of the impulses of obstacles on the robot, in W | N s |
    | left_corridor, not_finite, touched | why an episode has terminated | bool |

    **Impacts** act through the whole inertia, as if the floor could keep the wheels from slipping whatever that takes.
    Where `impact_traction` is above 1 it cannot, and the true impulse is smaller, which `floor` takes in. Head-on into
    a smooth wall at 0.5 m/s with restitution 0.5, medians over steering angles (docs/truth/impacts.md):

    | robot | impact_traction | impulse here | MuJoCo's, whose wheels slip | sideways here | MuJoCo's |
    |---|---|---|---|---|---|
    | chung2008 | 1.0 | 4.7 N s | 4.7 N s | 0.05 m/s | 0.05 m/s |
    | xr4000 | 8.0 | 67 N s | 53 N s | 0.06 m/s | 0.02 m/s |
    | tidybot2 | 36 | 120 N s | 50 N s | 0.18 m/s | 0.03 m/s |

    **Floor** By default, `floor="grip"`, wheels roll without slip whatever they need. With a mapping such as
    `floor={"friction": 0.3, "patches": [{"x": 1.0, "y": 0.0, "radius": 0.4, "friction": 0.05}]}` each wheel slips once
    it needs more than friction times load, in driving and in impacts: traction_use is at most 1, and 1 where a wheel
    slips. Without `friction` that of the robot counts, which the feature `friction` draws anew in each episode. Patches
    are discs in W with a friction of their own, whatever is around them. Joint rates are those of the wheels, as
    encoders show them, and no more those of rolling; observations have the same layout on every floor. A start rolls.

    **Endings** `terminated`: the robot left its corridor (0.5 m from the reference), its state stopped being finite,
    or it touched an obstacle and `touching` is "ends"; info tells which, and all terms of that step are 0. `truncated`:
    the trajectory is over. Success does not end an episode.

    **Start** at rest, with random steering, beside the trajectory's start by up to 0.05 m along each axis and 0.2 rad,
    unless `reset(options={…})` says otherwise; what it leaves open, and all later episodes, are drawn as without it:

    | option | meaning | unit |
    |---|---|---|
    | path | index of the path in the pool | – |
    | time | place along the trajectory, to the nearest control period; the start is drawn beside it | s |
    | pose | x, y and heading in W; inside the corridor around the reference and free of obstacles | m, m, rad |
    | twist | vx, vy, ω in B, which wheels and motors can reach | m/s, m/s, rad/s |
    | steering | angle δ_i of each caster | rad |

    robot: name, YAML file, mapping or Robot. path: what `caster_gym.paths.read_paths` reads: a name, a file, points,
    poses with times, a Trajectory, a specification, or several of these, of which each episode draws one. actuation:
    "all" or the names of the driven joints; by default the robot's own. arena: obstacles (`caster_gym.arena`).
    render_mode: "human" or "rgb_array". All other keywords are fields of
    `caster_gym.tasks.track.parameters.TrackParameters`, which holds the numbers above; unknown ones are errors.

    >>> import caster_gym, gymnasium
    >>> env = gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(0.1 * env.action_space.high)
    >>> observation in env.observation_space, round(reward, 3), round(info["position_error"], 3)  # [m]
    (True, 0.532, 0.051)
    """

    definition = TASK


class CasterTrackVectorEnv(TaskVectorEnv):
    """A batch of `CasterTrackEnv`; see `TaskVectorEnv`.

    >>> import caster_gym, gymnasium
    >>> batch = gymnasium.make_vec("caster_gym:CasterTrack-v0", num_envs=16, path="lemniscate")
    >>> observations, infos = batch.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = batch.step(batch.action_space.sample())
    >>> observations in batch.observation_space, rewards.shape, infos["position_error"].shape
    (True, (16,), (16,))
    >>> state = batch.get_state()  # arrays, from which another batch goes on
    >>> other = gymnasium.make_vec("caster_gym:CasterTrack-v0", num_envs=16, path="lemniscate")
    >>> other.set_state(state)
    >>> actions = batch.action_space.sample()
    >>> bool((other.step(actions)[0] == batch.step(actions)[0]).all())
    True
    """

    definition = TASK
