"""The verdict on a policy in words."""

from typing import Any

from caster_gym.tasks.measuring import Printed, shown


def in_words(verdict: Any) -> str:
    """The verdict's main numbers and its failures, such as "position RMSE 1.23 mm, 0 failures"."""
    parts = []
    for name, how in shown(type(verdict)):
        if isinstance(how, Printed):
            parts.append(f"{how.title} {how.factor * getattr(verdict, name):.3g} {how.unit}")
    return ", ".join([*parts, f"{verdict.failures:g} failure{'s' * (verdict.failures != 1)}"])
