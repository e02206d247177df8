"""One Gauss-Newton step of an optimal control problem with limits on its controls, for many robots, compiled.

    x_k      state: x, y, β, vx, vy, ω, δ_1, … with x_{k+1} = f(x_k, u_k)                    n = 6 + N
    u_k      controls, shares of the motors' greatest torques, low ≤ u ≤ high                 m driven motors
    r(x)     residuals of a state, their squares are added up                                 6, in m
    A, B     ∂f/∂x (n, n) and ∂f/∂u (n, m) along the trajectory that is improved

minimise Σ_k w_k |r(x_{k+1}) + J δx_{k+1}|² + ε² |u_k + δu_k|² subject to δx_{k+1} = A δx_k + B δu_k and the limits. The
backward sweep is that of Riccati. Where limits cut controls, each stage is solved within them, and those at a limit get
no feedback (Tassa, Mansard and Todorov, "Control-limited differential dynamic programming", ICRA 2014).
"""

from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from caster_gym.arrays import Array
from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import compiled

RESIDUALS = 6
ROUNDS = 12  # of the search for the controls at their limits; each of them changes sides about once
ROUNDING = 1e-12  # of the diagonal, below which a gradient is zero


class Costs(NamedTuple):
    """What an error and a control cost."""

    length: float  # [m] by which angles are multiplied
    time: float  # [s] by which rates of errors are multiplied
    effort: float  # ε [m]: error that costs as much as a whole torque
    last: float  # w of the last state; 1 for the others


class Linearised(NamedTuple):
    """A trajectory of robots under planned controls, and its derivatives by the rows of states with directions."""

    states: Array  # (K + 1, robots, 7 + 2 N) x, y, cos β, sin β, vx, vy, ω, cos δ_1, sin δ_1, …
    by_state: Array  # (K, robots, 7 + 2 N, 7 + 2 N) of each state by the one before
    by_torque: Array  # (K, robots, 7 + 2 N, 2 N) likewise by joint torques


@register_jitable
def _reduced(slopes: Any, end: Any, out: Any) -> None:
    """Derivatives of x, y, β, …, δ_1, … from those of rows with directions: dφ = c ds − s dc."""
    for j in range(slopes.shape[1]):
        out[0, j], out[1, j] = slopes[0, j], slopes[1, j]
        out[2, j] = end[2] * slopes[3, j] - end[3] * slopes[2, j]
        out[3, j], out[4, j], out[5, j] = slopes[4, j], slopes[5, j], slopes[6, j]
        for i in range(6, len(out)):
            at = 2 * i - 5
            out[i, j] = end[at] * slopes[at + 1, j] - end[at + 1] * slopes[at, j]


@register_jitable
def _by_angles(slopes: Any, start: Any, out: Any) -> None:
    """Derivatives by x, y, β, …, δ_1, … from those by rows with directions: dc = −s dφ, ds = c dφ."""
    for i in range(len(slopes)):
        out[i, 0], out[i, 1] = slopes[i, 0], slopes[i, 1]
        out[i, 2] = start[2] * slopes[i, 3] - start[3] * slopes[i, 2]
        out[i, 3], out[i, 4], out[i, 5] = slopes[i, 4], slopes[i, 5], slopes[i, 6]
        for j in range(6, out.shape[1]):
            at = 2 * j - 5
            out[i, j] = start[at] * slopes[i, at + 1] - start[at + 1] * slopes[i, at]


@register_jitable
def _residuals(state: Any, wanted: Any, costs: Any, r: Any, jacobian: Any) -> None:
    """Errors of a state against x, y, cos, sin, and velocities in the world, and their derivatives."""
    length, time = costs.length, costs.time
    c, s, vx, vy = state[2], state[3], state[4], state[5]
    r[0], r[1] = state[0] - wanted[0], state[1] - wanted[1]
    r[2] = length * np.arctan2(s * wanted[2] - c * wanted[3], c * wanted[2] + s * wanted[3])
    r[3] = time * (c * vx - s * vy - wanted[4])
    r[4] = time * (s * vx + c * vy - wanted[5])
    r[5] = time * length * (state[6] - wanted[6])
    jacobian[:] = 0.0
    jacobian[0, 0] = jacobian[1, 1] = 1.0
    jacobian[2, 2] = length
    jacobian[3, 2], jacobian[3, 3], jacobian[3, 4] = time * (-s * vx - c * vy), time * c, -time * s
    jacobian[4, 2], jacobian[4, 3], jacobian[4, 4] = time * (c * vx - s * vy), time * s, time * c
    jacobian[5, 5] = time * length


@register_jitable
def _solve_free(hessian: Any, right: Any, free: Any, factor: Any) -> None:
    """Solve for the free rows by Cholesky's factors, in place of `right`; the others become 0."""
    m = len(free)
    for j in range(m):
        for i in range(j, m):
            if not (free[i] and free[j]):
                factor[i, j] = 1.0 if i == j else 0.0
                continue
            rest = hessian[i, j]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(rest) if i == j else rest / factor[j, j]
    for column in range(right.shape[1]):
        for i in range(m):
            rest = right[i, column] if free[i] else 0.0
            for k in range(i):
                rest -= factor[i, k] * right[k, column]
            right[i, column] = rest / factor[i, i]
        for i in range(m - 1, -1, -1):
            rest = right[i, column]
            for k in range(i + 1, m):
                rest -= factor[k, i] * right[k, column]
            right[i, column] = rest / factor[i, i]


@register_jitable
def _within(hessian: Any, gradient: Any, low: Any, high: Any, step: Any, free: Any, factor: Any, wish: Any) -> None:
    """The step within low … high with the least ½ stepᵀ H step + gᵀ step, and which of its numbers are free."""
    m = len(step)
    for i in range(m):
        step[i], free[i] = min(max(0.0, low[i]), high[i]), True
    for _ in range(ROUNDS):
        changed = False
        for i in range(m):
            slope, scale = gradient[i], ROUNDING * hessian[i, i]
            for j in range(m):
                slope += hessian[i, j] * step[j]
            held = (step[i] <= low[i] and slope > scale) or (step[i] >= high[i] and slope < -scale)
            changed = changed or free[i] == held
            free[i] = not held
        for i in range(m):
            rest = -gradient[i]
            for j in range(m):
                if not free[j]:
                    rest -= hessian[i, j] * step[j]
            wish[i, 0] = rest
        _solve_free(hessian, wish, free, factor)
        cut = False
        for i in range(m):
            if free[i]:
                to = min(max(wish[i, 0], low[i]), high[i])
                cut = cut or to != wish[i, 0]
                step[i] = to
        if not (changed or cut):
            break


def _improve(
    states: Any, by_state: Any, by_torque: Any, spread: Any, shares: Any, low: Any, high: Any, wanted: Any, costs: Any
) -> None:
    """Improve the shares (robots, K, m) of all robots in place; see `improve`."""
    stages, robots, rows = by_state.shape[0], by_state.shape[1], by_state.shape[2]
    n, m, joints = (rows + 5) // 2, spread.shape[1], by_torque.shape[3]
    a, half, b = np.empty((n, n)), np.empty((n, rows)), np.empty((n, m))
    of_joints, jacobian, r = np.empty((n, joints)), np.empty((RESIDUALS, n)), np.empty(RESIDUALS)
    value, slope, va, vb = np.empty((n, n)), np.empty(n), np.empty((n, n)), np.empty((n, m))
    quu, qux, qu, qx = np.empty((m, m)), np.empty((m, n)), np.empty(m), np.empty(n)
    free, factor, wish = np.empty(m, np.bool_), np.empty((m, m)), np.empty((m, 1))
    least, most, feedback = np.empty(m), np.empty(m), np.empty((m, n))
    all_a, all_b = np.empty((stages, n, n)), np.empty((stages, n, m))
    steps, gains = np.empty((stages, m)), np.empty((stages, m, n))
    deviation, moved = np.empty(n), np.empty(n)
    for robot in range(robots):
        value[:], slope[:] = 0.0, 0.0
        for k in range(stages - 1, -1, -1):
            start, end = states[k, robot], states[k + 1, robot]
            _residuals(end, wanted[robot, k], costs, r, jacobian)
            weight = costs.last if k == stages - 1 else 1.0
            for row in range(RESIDUALS):
                for i in range(n):
                    if jacobian[row, i] != 0.0:
                        slope[i] += weight * jacobian[row, i] * r[row]
                        for j in range(n):
                            value[i, j] += weight * jacobian[row, i] * jacobian[row, j]
            _reduced(by_state[k, robot], end, half)
            _by_angles(half, start, a)
            _reduced(by_torque[k, robot], end, of_joints)
            for i in range(n):
                for j in range(m):
                    whole = 0.0
                    for joint in range(joints):
                        whole += of_joints[i, joint] * spread[joint, j]
                    b[i, j] = whole
            all_a[k], all_b[k] = a, b
            for i in range(n):
                for j in range(n):
                    whole = 0.0
                    for e in range(n):
                        whole += value[i, e] * a[e, j]
                    va[i, j] = whole
                for j in range(m):
                    whole = 0.0
                    for e in range(n):
                        whole += value[i, e] * b[e, j]
                    vb[i, j] = whole
            for i in range(m):
                qu[i] = costs.effort**2 * shares[robot, k, i]
                for e in range(n):
                    qu[i] += b[e, i] * slope[e]
                for j in range(m):
                    whole = costs.effort**2 if i == j else 0.0
                    for e in range(n):
                        whole += b[e, i] * vb[e, j]
                    quu[i, j] = whole
                for j in range(n):
                    whole = 0.0
                    for e in range(n):
                        whole += b[e, i] * va[e, j]
                    qux[i, j] = whole
                least[i], most[i] = low[robot, k, i] - shares[robot, k, i], high[robot, k, i] - shares[robot, k, i]
            _within(quu, qu, least, most, steps[k], free, factor, wish)
            for i in range(m):
                for j in range(n):
                    feedback[i, j] = -qux[i, j]
            _solve_free(quu, feedback, free, factor)
            gains[k] = feedback
            for i in range(n):
                whole = 0.0
                for e in range(n):
                    whole += a[e, i] * slope[e]
                for e in range(m):
                    force = qu[e]
                    for j in range(m):
                        force += quu[e, j] * steps[k, j]
                    whole += feedback[e, i] * force + qux[e, i] * steps[k, e]
                qx[i] = whole
            slope[:] = qx
            for i in range(n):
                for j in range(n):
                    whole = 0.0
                    for e in range(n):
                        whole += a[e, i] * va[e, j]
                    for e in range(m):
                        whole += qux[e, i] * feedback[e, j]
                    value[i, j] = whole
            for i in range(n):
                for j in range(i):
                    value[i, j] = value[j, i] = 0.5 * (value[i, j] + value[j, i])
        deviation[:] = 0.0
        for k in range(stages):
            for i in range(m):
                step = steps[k, i]
                for j in range(n):
                    step += gains[k, i, j] * deviation[j]
                share = min(max(shares[robot, k, i] + step, low[robot, k, i]), high[robot, k, i])
                steps[k, i] = share - shares[robot, k, i]
                shares[robot, k, i] = share
            for i in range(n):
                whole = 0.0
                for j in range(n):
                    whole += all_a[k, i, j] * deviation[j]
                for j in range(m):
                    whole += all_b[k, i, j] * steps[k, j]
                moved[i] = whole
            deviation[:] = moved


_compiled_improve = compiled(_improve, lambda _: Work("optimal control", 3.0))


def improve(
    shares: Array, around: Linearised, spread: Array, low: Array, high: Array, wanted: Array, costs: Costs
) -> None:
    """Improve planned torque shares (robots, K, m) in place, by one step.

    spread (2 N, m): joint torques of each motor at its greatest torque [N m]. low, high (robots, K, m): limits of them.
    wanted (robots, K, 7): x, y [m], cos β, sin β, and velocities x, y [m/s], β [rad/s] in the world, of states 1 … K.
    """
    _compiled_improve(*around, spread, shares, low, high, wanted, costs)
