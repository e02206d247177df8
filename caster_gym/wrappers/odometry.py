"""Odometry: pose and twist as a robot works them out from its encoders, with the sizes that its description gives.

    V̂        least squares of diag(l) (J(δ̂) V̂ − q̇) over all casters, with l the radius and the trail, so that speeds of
             rims and pivots count alike; δ̂ are the steering angles that the robot sees, q̇ its joint rates
    β̂′       β̂ + T (ω̂ + ω̂′)/2, and the place moves by T (v̂ + v̂′)/2 along the heading in the middle

Where wheels have other sizes, encoders other zeros, or wheels slip, V̂ is wrong, and the pose drifts.
"""

from typing import Literal

import numpy as np

from caster_gym.arrays import Array, Indices
from caster_gym.engines.numpy_model import Model
from caster_gym.envs.observation import OBSERVATION_LIMIT
from caster_gym.wrappers.feature import Feature, Observations, Place, Quantities, Robots, Runtime
from caster_gym.wrappers.misjudging import Misjudged


class Odometry(Feature):
    """Pose and twist are not measured from outside but counted from the encoders, from the true pose at the start on.

    It sees joint rates and steering angles as the features before it in the list show them.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Odometry, WheelErrors, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), WheelErrors(radius=(-0.001, 0.001)), Odometry())
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["odometry"] = "odometry"

    def runtime(self, place: Place) -> Runtime:
        """Odometers of every robot."""
        return _Odometry(place)


class _Odometry(Runtime):
    """Poses are x, y [m], β [rad] in W, of which β counts turns."""

    constants = frozenset({"_model", "_misjudged"})

    def __init__(self, place: Place) -> None:
        self._place, robot = place, place.engine.robot
        self._model, self._misjudged = Model(robot), Misjudged(place.engine.layout)
        self._levers = np.array([(one.radius, one.trail) for one in robot.casters]).ravel()
        self._true = np.zeros((place.count, 3))
        self._counted = np.zeros((place.count, 3))
        self._twist = np.zeros((place.count, 3))  # as counted at the end of the period before
        self._clocks = np.zeros(place.count, dtype=np.int64)  # up to which was counted

    def begin(self, robots: Indices, quantities: Quantities) -> None:
        self._look(robots, quantities)
        self._counted[robots] = self._true[robots]
        self._clocks[robots] = self._place.clocks[robots]

    def look(self, quantities: Quantities) -> None:
        self._look(slice(None), quantities)

    def _look(self, robots: Robots, quantities: Quantities) -> None:
        x, y, cos, sin = quantities("pose")[robots].T
        self._true[robots] = np.stack((x, y, np.arctan2(sin, cos)), axis=1)

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        shown = observations.astype(np.float64)
        twist = self._counted_twist(observations)
        self._count(robots, twist)
        errors = np.concatenate([self._errors(robots), twist - self._seen(observations, "twist")], axis=1)
        self._misjudged.misjudge(shown, errors, turned=True)
        return np.clip(shown, -OBSERVATION_LIMIT, OBSERVATION_LIMIT).astype(np.float32)

    def _seen(self, observations: Observations, part: str) -> Array:
        return self._place.engine.layout.physical(observations, part)

    def _counted_twist(self, observations: Observations) -> Array:
        """V̂ (robots, 3)."""
        directions = self._seen(observations, "directions").reshape(len(observations), -1, 2)
        jacobian = self._levers[:, None] * self._model.jacobian(np.arctan2(directions[..., 1], directions[..., 0]))
        speeds = self._levers * self._seen(observations, "joint_rates")
        both = np.swapaxes(jacobian, -1, -2)
        return np.asarray(np.linalg.solve(both @ jacobian, both @ speeds[..., None])[..., 0], dtype=np.float64)

    def _count(self, robots: Robots, twist: Array) -> None:
        """Count the control period that has passed, for those robots for which one has."""
        passed = self._place.clocks[robots] != self._clocks[robots]
        moved: Array = 0.5 * self._place.period * passed[:, None] * (self._twist[robots] + twist)
        heading = self._counted[robots, 2] + 0.5 * moved[:, 2]
        cos, sin = np.cos(heading), np.sin(heading)
        ahead, left, turned = moved.T
        self._counted[robots] += np.stack((cos * ahead - sin * left, sin * ahead + cos * left, turned), axis=1)
        self._twist[robots], self._clocks[robots] = twist, self._place.clocks[robots]

    def _errors(self, robots: Robots) -> Array:
        """Counted minus true pose (robots, 3), in B. [m, m, rad]"""
        x, y, turned = (self._counted[robots] - self._true[robots]).T
        cos, sin = np.cos(self._true[robots, 2]), np.sin(self._true[robots, 2])
        return np.stack((cos * x + sin * y, cos * y - sin * x, turned), axis=1)
