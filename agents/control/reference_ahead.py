"""How the reference goes on, as its preview shows it. Derivation: docs/control.md, section X.

Everything is in the frame R of the reference as it stands now: it does not depend on where the robot thinks that it is,
so that noise of the sensors does not move it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.agents.control.planar import short_way, turned
from caster_gym.arrays import Array
from caster_gym.envs.observation import ObservationLayout


class Ahead(NamedTuple):
    """The reference some time ahead: place and heading, and their derivatives, each (robots, 3) in R."""

    place: Array  # [m, m, rad]
    velocity: Array
    acceleration: Array
    jerk: Array


class Course(NamedTuple):
    """The reference from now on, piece by piece: derivatives (pieces, 5, robots, 3) at the start of each."""

    starts: Array  # (pieces,) [s]
    pieces: Array

    def at(self, times: Array) -> Ahead:
        """Where the references of all robots are after some times (robots,). [s]"""
        number = np.maximum(np.searchsorted(self.starts, times, side="right") - 1, 0)
        t = (times - self.starts[number])[:, None]
        p, v, a, j, s = np.moveaxis(self.pieces[number, :, np.arange(len(times))], 1, 0)
        return Ahead(
            p + t * (v + t / 2.0 * (a + t / 3.0 * (j + t / 4.0 * s))),  # (X1)
            v + t * (a + t / 2.0 * (j + t / 3.0 * s)),
            a + t * (j + t / 2.0 * s),
            j + t * s,
        )


def course_of(layout: ObservationLayout, observations: NDArray[np.float32], until: float) -> Course:
    """The course that observations (robots, size) show, for the coming `until` seconds.

    Up to the first previewed point it is the quartic of (X2), from there on cubics between points. Without a preview
    the acceleration is taken to stay.
    """
    see = layout.physical
    cos, sin = see(observations, "heading_error").T
    zero = np.zeros((len(observations), 3))
    velocity = turned(see(observations, "twist") + see(observations, "twist_error"), cos, -sin)
    acceleration = turned(see(observations, "reference_acceleration"), cos, -sin)
    starts, pieces = [0.0], []
    place, here = zero, turned(np.column_stack([see(observations, "position_error"), zero[:, 0]]), cos, -sin)
    for number, horizon in enumerate(sorted(layout.preview)):
        if number and starts[-1] >= until:
            break
        point = see(observations, f"preview_{horizon:g}{layout.unit}")
        turn = np.arctan2(point[:, 3] * cos - point[:, 2] * sin, point[:, 2] * cos + point[:, 3] * sin)
        there = turned(np.column_stack([point[:, :2], turn]), cos, -sin) - here
        speed = turned(point[:, 4:], cos, -sin)
        if number:  # turns are counted from the piece before
            there[:, 2] = place[:, 2] + short_way(there[:, 2] - place[:, 2])
        h = horizon - starts[-1]
        if number:
            far, fast = there - place - h * velocity, speed - velocity
            cubic = 6.0 * far / h**2 - 2.0 * fast / h, 6.0 * fast / h**2 - 12.0 * far / h**3
            pieces.append((place, velocity, *cubic, zero))
        else:
            far = there - h * velocity - 0.5 * h**2 * acceleration
            fast = speed - velocity - h * acceleration
            jerk, snap = 24.0 * far / h**3 - 6.0 * fast / h**2, 24.0 * fast / h**3 - 72.0 * far / h**4  # (X2)
            pieces.append((place, velocity, acceleration, jerk, snap))
        place, velocity = there, speed
        starts.append(horizon)
    if not pieces:
        return Course(np.zeros(1), np.array([(zero, velocity, acceleration, zero, zero)]))
    return Course(np.array(starts[:-1]), np.array(pieces))
