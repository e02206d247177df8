"""caster_gym.identification.kinematic_laws: (R1) to (R3) hold of motions that formulas give, and tell their sizes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from caster_gym.identification.kinematic_laws import laws_of, window_of
from caster_gym.identification.recording import Recording
from caster_gym.robot import load_robot

ROBOT = load_robot("chung2008")
STEP, COUNT = 0.01, 800
ZEROS, RADIUS, TRAIL = np.array([0.02, -0.03, 0.01]), 0.026, 0.024


def drive():
    """Analytic poses; steering and rolling integrated from the velocity of each steering axis, in the world."""
    time = STEP * np.arange(COUNT)

    def pose(t):
        return np.array([0.5 * np.sin(0.9 * t), 0.4 * np.cos(1.3 * t), 0.8 * np.sin(0.7 * t)])

    def rate(t):
        return np.array([0.45 * np.cos(0.9 * t), -0.52 * np.sin(1.3 * t), 0.56 * np.cos(0.7 * t)])

    places = np.array([(caster.x, caster.y) for caster in ROBOT.casters])

    def slopes(t, state):
        beta, (vx, vy, omega) = pose(t)[2], rate(t)
        c, s = np.cos(beta), np.sin(beta)
        ax = vx - omega * (s * places[:, 0] + c * places[:, 1])
        ay = vy + omega * (c * places[:, 0] - s * places[:, 1])
        phi = state[:3]
        turning = (np.cos(phi) * ay - np.sin(phi) * ax) / TRAIL
        return np.concatenate([turning, (np.cos(phi) * ax + np.sin(phi) * ay) / RADIUS])

    found = solve_ivp(slopes, (0.0, time[-1]), np.zeros(6), t_eval=time, rtol=1e-10, atol=1e-12).y.T
    poses, rates = np.array([pose(t) for t in time]), np.array([rate(t) for t in time])
    c, s = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    twist = np.column_stack([c * rates[:, 0] + s * rates[:, 1], c * rates[:, 1] - s * rates[:, 0], rates[:, 2]])
    steering = found[:, :3] - poses[:, 2:] + ZEROS
    return Recording(STEP, poses, steering, np.zeros((COUNT, 6)), twist, found[:, 3:])


def test_a_motion_by_formulas_keeps_all_laws_and_tells_its_sizes():
    recording = drive()
    laws = laws_of(recording, ROBOT, window_of(recording))
    assert [law.columns for law in laws.laws if law.silent] == [("time",)]
    assert max(law.misfit for law in laws.laws) < 1e-6  # of (R1), (R2) and (R3): rows of 10 ms, curvature of the way
    shown = {size.name: size.shown for size in laws.sizes}
    for i in range(3):
        assert shown[f"trail_{i + 1}"] == pytest.approx(TRAIL, rel=1e-3)
        assert shown[f"radius_{i + 1}"] == pytest.approx(RADIUS, rel=1e-4)
        assert shown[f"steering_zero_{i + 1}"] == pytest.approx(ZEROS[i], abs=2e-4)
    assert shown["vx and vy"] == pytest.approx(1.0, rel=1e-4)
    assert shown["yaw_rate"] == pytest.approx(1.0, rel=1e-4)


def test_a_robot_that_stands_says_nothing():
    still = Recording(
        STEP, np.zeros((50, 3)), np.zeros((50, 3)), np.zeros((50, 6)), np.zeros((50, 3)), np.zeros((50, 3))
    )
    assert all(law.silent for law in laws_of(still, ROBOT, window_of(still)).laws)
