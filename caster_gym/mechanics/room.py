"""Which robots need careful steps because an obstacle may be near.

A robot's room is a lower bound on its gap to the nearest obstacle [m]. A step that certainly uses up less than the room
is an ordinary one, so that robots in the open keep their speed; only the others measure gaps.
"""

from typing import Any

from caster_gym.mechanics.integration import State, pack_state
from caster_gym.mechanics.scalars import Scalar, Vector, absolute, each, either, where

CLOSE = 1e-4  # [m] room that a step must leave
WORTHWHILE = 6.0  # steps whose way the room must last for, before it is measured again


def speed_bound(v: Vector, reach: Scalar) -> Scalar:
    """Bound for the speed of every point of a robot that reaches so far [m] from C. [m/s]"""
    return absolute(v[0]) + absolute(v[1]) + reach * absolute(v[2])


def should_measure(room: Scalar, v: Vector, h: Scalar, reach: Scalar) -> Scalar:
    """Whether the room is so short that the true gap should be measured before the coming step."""
    return room < CLOSE + WORTHWHILE * h * speed_bound(v, reach)


def step_within_room(
    obstacles: Any, room: Scalar, state: State, end: State, h: Scalar, reach: Scalar
) -> tuple[tuple[Scalar, ...], Scalar, Scalar]:
    """What an ordinary step that would lead to `end` makes of a robot: its packed state, its room, and 1 if it went.

    A robot that may touch something stays where it is, with a room of −1; its step is to be taken with care. obstacles:
    None where there are none at all, and every step is an ordinary one.
    """
    found: tuple[tuple[Scalar, ...], Scalar, Scalar] = either(
        obstacles, free_end, guarded_end, (room, state, end, h, reach)
    )
    return found


def free_end(
    room: Scalar, _state: State, end: State, _h: Scalar, _reach: Scalar
) -> tuple[tuple[Scalar, ...], Scalar, Scalar]:
    """The end of the step."""
    return pack_state(end), room, 1.0


def guarded_end(
    _obstacles: Any, room: Scalar, state: State, end: State, h: Scalar, reach: Scalar
) -> tuple[tuple[Scalar, ...], Scalar, Scalar]:
    """The way of every point is bounded by the sum of both ends' speeds, twice their mean."""
    left = room - h * (speed_bound(state.twist, reach) + speed_bound(end.twist, reach))
    risky = left < CLOSE
    stays = each(where, (risky,), pack_state(state), pack_state(end))
    return stays, where(risky, -1.0, left), where(risky, 0.0, 1.0)
