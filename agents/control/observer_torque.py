"""Computed torque on the state that an estimator knows: filtered, and predicted to when actions arrive."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caster_gym.agents.control.beliefs import Beliefs
from caster_gym.agents.control.computed_torque import ComputedTorque, KnownModel
from caster_gym.agents.control.estimator import Estimator
from caster_gym.arrays import Flags
from caster_gym.configuration import parse
from caster_gym.envs.observation import ObservationLayout


class ObserverTorque(ComputedTorque):
    """Computed torque that remembers: for actions that arrive late, noisy sensors and unknown forces.

    It acts on the robot as it will be when the action arrives, subtracts the disturbance that it has found, and sends
    what makes lagging motors give the wanted torques in the mean of a control period, or, with noisy sensors, at its
    end, which takes less action.

    beliefs: what it reckons with, of which each part may be left out, as in {"prediction": {"delay": 2, "lag": 0.01},
    "sensors": {"position": 0.002}, "unmodelled": 1.0, "drift": 3.0}. Derivation and units: docs/control.md.

    >>> import caster_gym, gymnasium, numpy as np
    >>> from caster_gym.wrappers import ActionDelay, wrap
    >>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate"), ActionDelay(periods=2))
    >>> layout = caster_gym.ObservationLayout(caster_gym.load_robot("chung2008"), preview=(0.1, 0.2, 0.4))
    >>> beliefs = {"prediction": {"delay": 2}}  # [control periods]
    >>> controller = caster_gym.ObserverTorque(layout, natural_frequency=30.0, period=0.02, beliefs=beliefs)
    >>> observation, info = env.reset(seed=0)
    >>> controller.reset(np.array([True]))  # an episode begins
    >>> for _ in range(100):
    ...     observation, reward, terminated, truncated, info = env.step(controller.act(observation[None])[0])
    >>> info["position_error"] < 1e-4  # [m]
    True
    """

    def __init__(
        self,
        layout: ObservationLayout,
        natural_frequency: float,
        period: float,
        beliefs: Beliefs | Mapping[str, Any],
        known: KnownModel = "exact",
    ) -> None:
        super().__init__(layout, natural_frequency, period, known)
        checked = parse(Beliefs, beliefs, "beliefs") if isinstance(beliefs, Mapping) else beliefs
        self.estimator = Estimator(self._model, layout, period, checked)
        noisy = checked.sensors is not None and checked.sensors.noisy
        self._left = self.estimator.lag.end if noisy else self.estimator.lag.mean

    @property
    def name(self) -> str:
        """What tables and figures call it."""
        return f"{'observing' if self.estimator.observes else 'predicting'} {super().name}"

    def reset(self, mask: Flags) -> None:
        """New episodes of some robots (robots,) begin with the next observation."""
        self.estimator.reset(mask)

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) for observations (robots, size)."""
        seen = self.estimator.look(observations)
        wishes = self._feedback(seen.error, seen.rate, seen.twist, seen.acceleration, seen.jerk)
        shares = self._shares(seen.steering, seen.twist, *wishes, seen.disturbance)
        left = self._left
        actions = np.clip((shares - left * seen.followed) / (1.0 - left), -1.0, 1.0).astype(np.float32)  # (X10)
        self.estimator.sent(actions)
        return actions
