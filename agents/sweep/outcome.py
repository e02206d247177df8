"""What became of a trial, and one number that says how good it was."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

from caster_gym.agents.comparison.validation import Validation


class Outcome(NamedTuple):
    """What became of a trial; it consists of what JSON can hold.

    scores: of the best policy so far after each validation, of each seed that was trained, greater is better.
    verdicts: of the best policy of each of these seeds, by name.
    """

    kind: Literal["completed", "pruned", "failed"]
    scores: Sequence[Sequence[float]] = ()
    verdicts: Sequence[Mapping[str, float]] = ()
    reason: str = ""  # why it failed

    def score(self, over: Literal["mean", "worst"]) -> float:
        """Score of the trial, of those seeds that were trained; minus infinity without one."""
        last = [one[-1] for one in self.scores]
        if not last:
            return -math.inf
        return math.fsum(last) / len(last) if over == "mean" else min(last)


def scores_of(history: Sequence[Validation]) -> list[float]:
    """Score of the best policy so far after each validation of a training."""
    best, scores = -math.inf, []
    for one in history:
        best = max(best, score_of(one.verdict.merit))
        scores.append(best)
    return scores


def score_of(merit: Sequence[float]) -> float:
    """One number for the numbers of a merit, in the same order as these: each counts less than 1 of the one before it.

    All but the last are whole numbers, such as of failures. The last one alone is given as it is.
    """
    first, *others = (-math.inf if math.isnan(one) else float(one) for one in merit)
    return first + _within_one(score_of(others)) if others else first


def _within_one(number: float) -> float:
    """A number between −1/2 and 1/2, in the order of all numbers."""
    return math.copysign(0.5, number) if math.isinf(number) else 0.5 * number / (1.0 + abs(number))


def least_scores(outcomes: Sequence[Outcome], percentile: float, trials: int, validations: int) -> list[float]:
    """What a training must reach at each validation, from what completed ones have; empty while these are too few."""
    completed = [one for outcome in outcomes if outcome.kind == "completed" for one in outcome.scores]
    if sum(outcome.kind == "completed" for outcome in outcomes) < trials:
        return []
    longest = max(map(len, completed))
    reached = [sorted(one[i] for one in completed if i < len(one)) for i in range(longest)]
    return [
        -math.inf if i < validations else at[min(int(len(at) * (1.0 - percentile / 100.0)), len(at) - 1)]
        for i, at in enumerate(reached)
    ]


def is_behind(scores: Sequence[float], least: Sequence[float]) -> bool:
    """Whether a training has fallen behind what it must reach."""
    return any(one < bar for one, bar in zip(scores, least, strict=False))


def verdict_numbers(verdict: Any) -> dict[str, float]:
    """A verdict as JSON can hold it."""
    return {name: float(value) for name, value in verdict._asdict().items()}
