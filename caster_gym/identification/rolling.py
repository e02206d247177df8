"""Rolling angles of wheels along a simulated path: the time integral of (K2)."""

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model

_ASIDE = 1e-6  # [s] by which rates are looked at before and after, for their slopes


def rolled_along(model: Model, path: Array, torque: Array, step: float) -> Array:
    """Angles (k + 1, …, N) that the wheels have rolled since the start of a path (k + 1, …, 6 + N) of steps [s].

    torque (2 N,) held all along, or (k, …, 2 N) held over each step. Hermite's rule, of the order of the path's own;
    accelerations are looked at on both sides of each step's ends, since they jump where torques do.
    """
    twist, steering = path[..., 3:6], path[..., 6:]
    _, rolling, turning = model.rates(steering, twist)
    held = np.broadcast_to(torque, (*path[1:].shape[:-1], torque.shape[-1]))

    def slopes(of: slice) -> Array:
        gained = _ASIDE * model.forward_dynamics(steering[of], twist[of], held)
        turned = _ASIDE * turning[of]
        after = model.rates(steering[of] + turned, twist[of] + gained)[1]
        before = model.rates(steering[of] - turned, twist[of] - gained)[1]
        return (after - before) / (2.0 * _ASIDE)

    ends = slopes(slice(None, -1)) - slopes(slice(1, None))
    angles = np.cumsum(step / 2.0 * (rolling[:-1] + rolling[1:]) + step * step / 12.0 * ends, axis=0)
    return np.concatenate([np.zeros_like(rolling[:1]), angles])
