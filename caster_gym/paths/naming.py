"""Errors about unknown names, with the nearest known one."""

from collections.abc import Iterable

from caster_gym.brief import brief
from caster_gym.configuration import did_you_mean


def unknown_name(what: str, name: object, known: Iterable[str]) -> str:
    """Sentence that refuses a name and offers the nearest known one, or all of them."""
    if name is None:
        return f"{what!r} is missing; known are {', '.join(sorted(known))}"
    return f"unknown {what} {brief(name)}; {did_you_mean(name, known)}"
