"""caster_gym.paths.trailing: casters that trail, against the steering rates of the model."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from caster_gym import Model, load_robot
from caster_gym.arrays import Plane
from caster_gym.paths import read_paths
from caster_gym.paths.trailing import directions_at_rows, trailing_directions
from caster_gym.paths.trajectory import COLUMNS

ROBOT = load_robot("chung2008")


def trajectories(path, time_step=0.02):
    return tuple(t for one in read_paths(path) for t in one.trajectories(time_step))


def twists_in_body(samples):
    """Twists (K + 1, 3) in B."""
    c, s, omega = (samples[:, COLUMNS.index(name)] for name in ("cos", "sin", "omega"))
    vx, vy = samples[:, 4:6].T
    return np.stack([c * vx + s * vy, c * vy - s * vx, omega], axis=1)


def steering_along(samples, time_step, robot):
    directions = trailing_directions(samples[None], time_step, robot)[0]
    return np.angle(directions / (samples[:, 2] + 1j * samples[:, 3])[:, None])


@pytest.mark.parametrize("path", ["lemniscate", {"shape": "circle", "heading": "spinning"}])
@pytest.mark.parametrize("name", ["chung2008", pytest.param("tidybot2", marks=pytest.mark.slow)])
def test_casters_trail_as_the_steering_rates_of_the_model_say(path, name):
    """DOP853 on δ̇ of the model, the motion by quintics through a table of 1 ms, against the map at 20 ms and at 10 ms.

    In a step of 20 ms the pivots of tidybot2 move by two of its trails: a map by chords is off by half of their turn.
    """
    robot = load_robot(name)
    model = Model(robot)
    (exact,) = trajectories(path, 0.001)
    twist = make_interp_spline(0.001 * np.arange(len(exact.samples)), twists_in_body(exact.samples), k=5)
    times = np.arange(1.0, exact.duration - 1.0, 0.02)  # at rest directions are those of ways that are lost in rounding
    errors = []
    for time_step in (0.02, 0.01):
        (coarse,) = trajectories(path, time_step)
        steering = steering_along(coarse.samples, time_step, robot)[:: round(0.02 / time_step)]
        start = steering[50]
        solution = solve_ivp(
            lambda t, angle: model.rates(angle, twist(t))[2],
            times[[0, -1]],
            start,
            "DOP853",
            times,
            rtol=1e-10,
            atol=1e-12,
        )
        expected = solution.y.T
        found = steering[50 : 50 + len(expected)]
        errors.append(abs(np.angle(np.exp(1j * (found - expected)))).max())
    assert errors[0] < 2e-5  # rad
    assert errors[0] / errors[1] > 3.0 or errors[0] < 1e-7  # arcs are exact


def test_casters_point_along_a_straight_line_from_the_start():
    (line,) = trajectories({"shape": "spline", "waypoints": [(0, 0), (3, 4)], "heading": "fixed"})
    assert_allclose(trailing_directions(line.samples[None], 0.02, ROBOT), 0.6 + 0.8j, atol=1e-9)  # first way of 1e-6 m


def test_pivots_that_never_move_keep_their_casters_ahead():
    still = np.zeros((1, 11, len(COLUMNS)))
    still[..., COLUMNS.index("cos")] = 1.0
    assert_allclose(trailing_directions(still, 0.02, ROBOT), 1.0, atol=0.0)


def turning_line(steps, intervals=20, length=2.0, turns=4.0) -> tuple[Plane, Plane]:
    """A straight line of C at `steps` points an interval, the heading turning: pivots move in loops and cusps."""
    s = np.linspace(0.0, length, steps * intervals + 1)
    point, heading = s.astype(np.complex128), np.exp(2j * np.pi * turns * s / length)
    points, headings = (
        np.stack([p[k : p.size - steps + k : steps] for k in range(steps + 1)])[..., None] for p in (point, heading)
    )
    return points, headings


def test_maps_of_whole_intervals_give_the_directions_that_the_model_integrates():
    """Against SciPy's Runge-Kutta method of order 8 on the model's steering rates; the error falls by 2⁴ a halving."""
    rate, model = 2.0 * np.pi * 4.0 / 2.0, Model(ROBOT)
    pivots = np.array([complex(caster.x, caster.y) for caster in ROBOT.casters])

    def slope(s, steering):
        v = np.exp(-1j * rate * s)
        return model.rates(steering, [v.real, v.imag, rate])[2]

    at = np.linspace(0.0, 2.0, 21)
    start = np.angle(1.0 + 1j * rate * pivots)
    exact = solve_ivp(slope, (0.0, 2.0), start, "DOP853", at, rtol=1e-11, atol=1e-11).y.T
    errors = []
    for steps in (50, 100):
        directions = directions_at_rows(*turning_line(steps), ROBOT)[:, 0, :, 0].T  # at the starts of intervals
        steering = np.angle(directions * np.exp(-1j * rate * at[:-1])[:, None])
        # the direction of the first way errs by the second power, and is forgotten after two intervals, of 8 trails
        errors.append(abs(np.angle(np.exp(1j * (steering - exact[:-1]))))[2:].max())
    assert errors[1] < 1e-7
    assert errors[0] / errors[1] > 10.0


def test_points_of_neighbouring_intervals_agree():
    """The last point of an interval is the first of the next one, reached by other maps: rounding."""
    directions = directions_at_rows(*turning_line(8), ROBOT)
    assert_allclose(directions[:, -1, :-1], directions[:, 0, 1:], atol=1e-12)
    assert_allclose(np.abs(directions), 1.0, atol=1e-12)
