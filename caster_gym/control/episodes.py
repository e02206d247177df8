"""Agents that remember: they are told which robots begin a new episode."""

from collections.abc import Callable
from typing import Any

from caster_gym.arrays import Flags
from caster_gym.brief import brief


def reset_of(agent: Any) -> Callable[[Flags], object]:
    """The method `reset(mask)` of an agent; one that does nothing where an agent has none, and so no memory.

    mask (robots,): robots whose next observation is the first of an episode. Whoever rolls out calls it for all robots
    before their first action. Raises ValueError for a `reset` that cannot be called.
    """
    if not remembers(agent):
        return _nothing
    reset: Callable[[Flags], object] = agent.reset
    if not callable(reset):
        raise ValueError(f"its reset must be a method that takes a mask of robots, got {brief(reset)}")
    return reset


def remembers(agent: Any) -> bool:
    """Whether what an agent does may depend on what it saw and did before."""
    return getattr(agent, "reset", None) is not None


def _nothing(mask: Flags) -> None:
    """What an agent without memory does at the beginning of an episode."""
