"""The equations of a robot on powered casters, once, for any kind of scalar.

Every function here is plain arithmetic on its arguments. They may be Python floats, NumPy arrays, Torch tensors or
symbols, and the same source is compiled by Numba: an engine brings the data and holds no formula. The derivation is
docs/equations.md, and each tag (K1), (D3), (C2) there stands on the line that computes it here.

    B        body frame: origin C, x forward, y left                  W        world frame
    v        platform twist (vx, vy, omega) at C, in B                [m/s, m/s, rad/s]
    f        rolling direction of one caster, unit vector (cos δ, sin δ), in B
    eta      yaw rate of a steering link and its wheel over ground    [rad/s]
    theta    rolling rate of a wheel, > 0 drives it along +f          [rad/s]
    delta    steering rate, of the link relative to the platform      [rad/s]
    M        symmetric 3×3 matrix as (xx, xy, xz, yy, yz, zz)
    F        generalised force (fx, fy, moment) at C, in B            [N, N, N m]

    >>> import caster_gym
    >>> from caster_gym import mechanics
    >>> numbers = mechanics.robot_parameters(caster_gym.load_robot("chung2008"))
    >>> ahead, torques = ((1.0, 0.0),) * 3, ((0.1, 0.0),) * 3  # (cos δ, sin δ) and joint torques [N m] of each caster
    >>> rate = mechanics.forward_dynamics((0.0, 0.0, 0.0), ahead, torques, (0.0, 0.0, 0.0), numbers)
    >>> round(rate[0], 3)  # [m/s²]
    1.589
"""

from caster_gym.mechanics.dynamics import forward_dynamics, inertia, inverse_dynamics
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import pairs, register

__all__ = ["forward_dynamics", "inertia", "inverse_dynamics", "pairs", "register", "robot_parameters"]
