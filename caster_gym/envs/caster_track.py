"""CasterTrack-v0: follow a timed trajectory with motor torques."""

from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.setup import PathLike, RobotLike, action_space, make_engine, observation_space, refuse_rendering
from caster_gym.envs.tracking_engine import DRAW_A_PATH, info_of_one

Observation = NDArray[np.float32]


class CasterTrackEnv(gym.Env[Observation, NDArray[np.float32]]):
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

    **Reward**, the sum of terms that `info["reward_terms"]` names; k(e, ℓ) = ½/(1 + e²/ℓ²) + ½/(1 + e²/(10 ℓ)²):

    | term | meaning | range |
    |---|---|---|
    | position | 0.5 k(distance to the reference, 0.01 m) | 0 … 0.5 |
    | heading | 0.3 k(chord of the heading error, 0.02) | 0 … 0.3 |
    | speed | 0.2 times such a kernel of the twist error over 0.1 m/s and 0.3 rad/s | 0 … 0.2 |
    | effort | −0.02 times the mean square of torques as shares of their limits | −0.02 … 0 |
    | alive | 0.02, so that no step is worth less than none | 0.02 |

    **Info**, after reset and step alike; arrays have the robots in front in a batch:

    | key | meaning | unit |
    |---|---|---|
    | position_error, heading_error | distance to the reference; reference heading minus robot heading | m, rad |
    | reward_terms | the terms above, by name | – |
    | torque | mean torque of each of the 2 N motors over the control period, 0 where a joint is not driven | N m |
    | power | mean mechanical power of all motors over the control period | W |
    | traction_use | largest share of the floor's friction that a wheel uses; above 1 it would slip | – |
    | conditioning | σ_min/σ_max of the driven motors' wrenches, 0 where they cannot push the robot somewhere | – |
    | pose, reference_pose | x, y, cos β, sin β in W | m, – |
    | left_corridor, not_finite | why an episode has terminated | bool |

    **Endings** `terminated`: the robot left its corridor (0.5 m from the reference) or its state stopped being finite,
    as `info["left_corridor"]` and `info["not_finite"]` tell; all terms of that step are 0. `truncated`: the trajectory
    is over. Success does not end an episode.

    **Start** at rest, with random steering, beside the trajectory's start by up to 0.05 m along each axis and 0.2 rad.

    robot: name, YAML file or Robot. path: name, specification or several (`caster_gym.paths`), of which each episode
    draws one. actuation: "all" or the names of the driven joints; by default the robot's own. All other keywords are
    fields of `caster_gym.envs.track_task.TrackTask`, which holds the numbers above; unknown ones are errors.
    """

    # Gymnasium declares it for instances, so that mypy refuses the ClassVar which RUF012 asks for
    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        robot: RobotLike = "chung2008",
        path: PathLike = "random_paths",
        actuation: str | list[str] | tuple[str, ...] | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        self.engine = make_engine(robot, path, actuation, task, count=1)
        self.robot, self.task = self.engine.robot, self.engine.task
        self.observation_space = observation_space(self.engine)
        self.action_space = action_space(self.engine)
        refuse_rendering(render_mode)
        self.render_mode = None
        self._started = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; info as after a step. options["path"] chooses a trajectory by its index in the pool."""
        path = self.engine.checked_path((options or {}).get("path", DRAW_A_PATH))
        super().reset(seed=seed)
        if seed is not None or not self._started:
            self.engine.seed(0, int(self.np_random.integers(2**63)))
            self._started = True
        outcome = self.engine.restart(_ONLY, path=path)
        return outcome.observations[0], info_of_one(outcome.reports[:, 0])

    def step(self, action: NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the action for a control period. Raises ValueError for a wrong shape or a value that is not a number."""
        actions = np.asarray(action, dtype=np.float32)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"action must have shape {self.action_space.shape}, got {actions.shape}")
        if np.isnan(actions).any():
            raise ValueError(f"action must hold numbers, got {action}")
        if not self._started:
            raise RuntimeError("reset the environment before its first step")
        outcome = self.engine.step(actions[None])
        return (
            outcome.observations[0],
            float(outcome.rewards[0]),
            bool(outcome.terminated[0]),
            bool(outcome.truncated[0]),
            info_of_one(outcome.reports[:, 0]),
        )


_ONLY = np.zeros(1, dtype=np.int64)
