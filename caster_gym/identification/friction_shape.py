"""Deviations of friction from the model's law, as far as a recording shows them.

The model's friction of a joint is viscous · ϑ + coulomb · ϑ / √(ϑ² + ϑ₀²). That of a real joint may be sharper at zero,
greater before it breaks away, or bent at high rates, and an estimate that rests on the law alone is then wrong by more
than its interval. So a friction g(ϑ) is added to that of the rolling joints and to that of the steering joints:

    g(ϑ) = Σ a_k p_k(ϑ),    s_ε(ϑ) = ϑ / √(ϑ² + ε²)                                                        (H1)

    slow shapes    s_ε − s_ε' of neighbouring rates ε < ε', which fade out at rates beyond ε'
    fast shapes    s_ε of greater rates ε, which hardly begin below ε

Between them the plateau of dry friction is left to the law. The factors a_k of either kind of shape are normal about
zero with one standard deviation for each kind of joint, four in all. They are those under which the errors that a fit
leaves are likeliest, all unknowns and factors integrated out, so that a recording which the law explains keeps it.
For slow shapes they are at least a share of the dry friction: how that passes through zero is never known.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.identification.shooting import Shooting
from caster_gym.identification.window_fit import Point
from caster_gym.robot import Robot

JOINTS = ("rolling", "steering")
_SHARPEST = 0.1  # [-] of `coulomb_speed`: what is sharper than this cannot be told from it
_PLATEAU = 10.0**1.5  # [-] times `coulomb_speed`, where slow shapes end and fast ones begin
_RATIO = 10.0**0.5  # of neighbouring rates ε
_UNIT = 0.1  # [-] of a motor's greatest torque, which factors count in
_DEVIATIONS = np.concatenate([[0.0], np.geomspace(1e-5, 10.0, 25)])  # [-] that are tried
_NEVER_KNOWN = 0.5  # [-] of dry friction, standard deviation of the factors of slow shapes at least
_SWEEPS = 8


class Shapes:
    """The shapes p_k for a robot: slow and fast ones of the rolling joints, then of the steering joints."""

    def __init__(self, robot: Robot) -> None:
        slowest, middle = _SHARPEST * robot.coulomb_speed, _PLATEAU * robot.coulomb_speed
        fastest = float(robot.max_speeds.max())
        self._slow = np.geomspace(slowest, middle, _count(middle / slowest))
        self._fast = np.geomspace(middle, max(fastest, _RATIO * middle), _count(fastest / middle))[1:]
        own = [0] * (len(self._slow) - 1) + [1] * len(self._fast)
        self.groups = np.array([*own, *(group + 2 for group in own)])  # (K,) which standard deviation a factor has
        self.greatest = np.mean(robot.max_torques.reshape(-1, 2).T.copy(), axis=1)  # (2,) torque of the motors [N m]
        self.units = np.repeat(_UNIT * self.greatest, len(own))  # (K,) [N m]

    def pushes(self, shooting: Shooting, path: Array, values: Array) -> Array:
        """Torques (W, k (S − 1), 2 N, K) of each shape over the steps of a path, for factors of one unit. [N m]"""
        n, state = shooting.robot.caster_count, path[..., : 6 + shooting.robot.caster_count]
        model = Model(shooting.robot, parameters=shooting.parameters(values))
        _, rolling, steering = model.rates(state[..., 6:], state[..., 3:6])
        pushes = np.zeros((*path[:, 1:].shape[:2], 2 * n, len(self.units)))
        half = len(self.units) // 2
        for joint, rates in enumerate((rolling, steering)):
            of = slice(joint * half, (joint + 1) * half)
            pushes[:, :, joint::2, of] = -self._means(rates[:, :-1], rates[:, 1:]) * self.units[of]
        return pushes

    def rates(self, shooting: Shooting, point: Point) -> tuple[Array, Array]:
        """Rates of rolling and of steering joints that a robot went through, from slow to fast. [rad/s]"""
        model, state = Model(shooting.robot, parameters=shooting.parameters(point.values)), point.path
        count = shooting.robot.caster_count
        _, rolling, steering = model.rates(state[..., 6 : 6 + count], state[..., 3:6])
        fastest = [float(np.quantile(np.abs(rates), 0.95)) for rates in (rolling, steering)]
        rolled, steered = (np.geomspace(self._slow[0], max(fast, 2.0 * self._slow[0]), 50) for fast in fastest)
        return rolled, steered

    def least(self, shooting: Shooting, values: Array) -> Array:
        """Least standard deviations (4,) of factors, in units, for values (P,) of the unknowns."""
        casters = shooting.parameters(values).casters
        dry = [[getattr(caster, f"{key}_coulomb") for caster in casters] for key in ("roll", "steer")]
        slow = _NEVER_KNOWN * np.maximum(np.mean(dry, axis=1), 0.0) / self.units[:: len(self.units) // 2]
        return np.array([slow[0], 0.0, slow[1], 0.0])

    def torque(self, joint: int, rates: Array, factors: Array) -> Array:
        """Friction (…) beyond the law's of a joint (0: rolling, 1: steering) at rates (…) [rad/s]. [N m]"""
        of = slice(joint * (half := len(self.units) // 2), (joint + 1) * half)
        result: Array = self._means(rates, rates) @ (self.units[of] * factors[of])
        return result

    def _means(self, before: Array, after: Array) -> Array:
        """Means (…, K / 2) of the shapes over rates that go evenly from one value (…) to another."""
        edges = np.concatenate([self._slow, self._fast])
        a, b = before[..., None], after[..., None]
        # the integral of s_ε is √(ϑ² + ε²), whose difference over b − a is written without a division by zero
        steps = (a + b) / (np.hypot(a, edges) + np.hypot(b, edges))  # (H3)
        slow = len(self._slow)
        return np.concatenate([steps[..., : slow - 1] - steps[..., 1:slow], steps[..., slow:]], axis=-1)


def _count(ratio: float) -> int:
    return max(2, round(float(np.log(ratio) / np.log(_RATIO))) + 1)


class Believed(NamedTuple):
    """Standard deviations of factors, and how much likelier than the least ones each kind makes a recording."""

    deviations: Array  # (K,) in units
    gains: Array  # (4,) logarithms of ratios of likelihoods, in the order of `Shapes.groups`


def likeliest_deviations(information: Array, pull: Array, groups: NDArray[np.int64], least: Array) -> Believed:
    """The standard deviations under which a recording is likeliest, from the least ones (4,) up.

    information (K, K) and pull (K,) of the factors, all else that is unknown integrated out: the logarithm of their
    likelihood is pull · a − ½ a · information · a.
    """

    strengths, vectors = np.linalg.eigh(information)
    information = vectors * np.maximum(strengths, 0.0) @ vectors.T  # rounding may leave less than nothing

    def likelihoods(chosen: Array) -> Array:
        """Of several choices (B, 4) at once."""
        deviations = chosen[:, groups]
        matrix = np.eye(len(groups)) + deviations[:, :, None] * information * deviations[:, None]
        along = deviations * pull
        solved = np.linalg.solve(matrix, along[..., None])[..., 0]
        result: Array = 0.5 * (along * solved).sum(axis=1) - 0.5 * np.linalg.slogdet(matrix)[1]  # (H2)
        return result

    def replaced(group: int, values: Array) -> Array:
        others = np.tile(best, (len(values), 1))
        others[:, group] = values
        return others

    starts = np.maximum(least, _DEVIATIONS[:: len(_DEVIATIONS) // 4, None])
    best = starts[int(likelihoods(starts).argmax())]
    for _ in range(_SWEEPS):
        before = best
        for group, lowest in enumerate(least):
            trials = replaced(group, np.unique(np.maximum(_DEVIATIONS, lowest)))
            best = trials[int(likelihoods(trials).argmax())]
        if (best == before).all():
            break
    reached = likelihoods(best[None])[0]
    without = [likelihoods(replaced(group, np.array([lowest])))[0] for group, lowest in enumerate(least)]
    return Believed(best[groups], reached - np.array(without))
