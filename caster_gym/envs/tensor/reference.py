"""What leads the robots, for a batch of tensors: `caster_gym.envs.native.reference` without its loop over robots."""

from typing import NamedTuple, TypeAlias, cast

import torch
from torch import Tensor

from caster_gym.envs.following import (
    FollowWeights,
    Row,
    arrived_share,
    at_rest,
    course_reference,
    nearest_share,
)
from caster_gym.envs.native.reference import POINT_ROWS, Courses, Timetable
from caster_gym.envs.tracking import Point, Reference, Weights
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import Scalar, clip, each, maximum, minimum, where


class Guidance(NamedTuple):
    """What the robots are to do next."""

    reference: Reference
    preview: tuple[Point, ...]
    progress: Tensor  # [m]
    share: Tensor  # of the progress that the period allows


class TorchTimetable:
    """Trajectories run by the clock."""

    def __init__(self, guide: Timetable, dtype: torch.dtype, device: torch.device) -> None:
        self.samples = torch.as_tensor(guide.samples, dtype=dtype, device=device).T.contiguous()  # (10, rows)
        self.spans = torch.as_tensor(guide.spans, device=device)
        self.weights = Weights(*_weights(guide.weights, dtype, device))
        self._horizons = tuple(guide.horizons.tolist())

    def reference_at(self, path: Tensor, clock: Tensor, _state: State) -> Reference:
        """Reference at clocks (robots,) [control periods]."""
        first, last = self.spans[path, 0], self.spans[path, 1]
        return Reference(*self.samples[:, torch.minimum(first + clock, last)].unbind(0))

    def fetch(self, state: State, clock: Tensor, path: Tensor, before: Tensor) -> Guidance:
        """Reference and preview at the robots' clocks."""
        first, last = self.spans[path, 0], self.spans[path, 1]
        reference = self.reference_at(path, clock, state)
        rows = [self.samples[:POINT_ROWS, torch.minimum(first + clock + ahead, last)] for ahead in self._horizons]
        none = torch.zeros_like(before)
        return Guidance(reference, tuple(cast(Point, row.unbind(0)) for row in rows), none, none)


class TorchCourses:
    """Paths walked at the robots' own pace."""

    def __init__(self, guide: Courses, dtype: torch.dtype, device: torch.device) -> None:
        self.samples = torch.as_tensor(guide.samples, dtype=dtype, device=device).T.contiguous()  # (10, rows)
        self.spans = torch.as_tensor(guide.spans, device=device)
        self.weights = FollowWeights(*_weights(guide.weights, dtype, device))
        self._guide, self._horizons = guide, tuple(guide.horizons.tolist())
        self._spacings = torch.as_tensor(guide.spacings, dtype=dtype, device=device)
        self._lengths = self._spacings * (self.spans[:, 1] - self.spans[:, 0])
        self._windows = torch.as_tensor((guide.window / guide.spacings).astype(int) + 2, device=device)
        self._widest = torch.arange(int((guide.window / guide.spacings).max()) + 2, device=device)

    def fetch(self, state: State, clock: Tensor, path: Tensor, before: Tensor) -> Guidance:
        """Reference and preview at the points of the paths nearest to the robots; before: their progress so far [m]."""
        guide, length = self._guide, self._lengths[path]
        sought = self.nearest(state, path, maximum(before, 0.0))
        progress = torch.where(before < 0.0, 0.0, sought)
        reference = self.reference_at(path, progress, state)
        preview = []
        for ahead in self._horizons:
            r = self.reference_at(path, torch.minimum(progress + ahead, length), state)
            preview.append((r.x, r.y, r.cos, r.sin, r.vx, r.vy, r.omega))
        share = minimum((progress - maximum(before, 0.0)) / guide.stride, 1.0)
        last: Row = self._row(self.spans[path, 1])
        there = arrived_share(*state.position, last, guide.arrival_scale)
        share = torch.where(progress >= length - guide.arrival, torch.maximum(share, there), share)
        return Guidance(reference, tuple(preview), progress, share)

    def _row(self, i: Tensor) -> Row:
        return cast(Row, self.samples[:, i].unbind(0))

    def nearest(self, state: State, path: Tensor, before: Tensor) -> Tensor:
        """Arc length of the point nearest to each robot, from `before` to a window ahead. [m]"""
        x, y = state.position
        base, last, spacing = self.spans[path, 0], self.spans[path, 1], self._spacings[path]
        first = torch.minimum(base + (before.detach() / spacing).long(), last - 1)
        end = torch.minimum(first + self._windows[path], last)
        with torch.no_grad():
            rows = first[:, None] + self._widest
            within = rows < end[:, None]
            rows = torch.minimum(rows, last[:, None] - 1)
            ax, ay = self.samples[0, rows], self.samples[1, rows]
            bx, by = self.samples[0, rows + 1] - ax, self.samples[1, rows + 1] - ay
            wx, wy = x[:, None] - ax, y[:, None] - ay
            shares = clip((wx * bx + wy * by) / (bx * bx + by * by), 0.0, 1.0)
            distance = (wx - shares * bx) ** 2 + (wy - shares * by) ** 2
            best = torch.where(within, distance, torch.inf).argmin(1)
            guess = shares.gather(1, best[:, None])[:, 0]
        chosen = first + best
        share = nearest_share(self._row(chosen), self._row(chosen + 1), guess, spacing, x, y)
        # beside a row itself chords on the outer side of a bend are equally near
        after = torch.minimum(chosen + 1, end - 1)
        beyond = nearest_share(self._row(after), self._row(after + 1), torch.zeros_like(guess), spacing, x, y)
        on = (share >= 1.0) & (chosen + 1 < end)
        chosen, share = torch.where(on, after, chosen), torch.where(on, beyond, share)
        reached = torch.minimum((chosen - base + share) * spacing, before + self._guide.window)
        return torch.maximum(reached, before)

    def reference_at(self, path: Tensor, arc: Tensor, state: State) -> Reference:
        """Reference at an arc length [m]; at rest at the end of the path, and turned like the robot if that is free.

        A robot without a heading (0, 0) is one that has not started.
        """
        base, last, spacing = self.spans[path, 0], self.spans[path, 1], self._spacings[path]
        i = torch.minimum(base + (arc.detach() / spacing).long(), last - 1)
        share = minimum(arc / spacing - (i - base), 1.0)
        walked = course_reference(self._row(i), self._row(i + 1), share, spacing)
        done = arc >= (last - base) * spacing
        reference = Reference(*each(where, (done,), at_rest(walked), walked))
        if not self._guide.free_heading:
            return reference
        c, s = state.heading
        started = c * c + s * s > 0.5
        free = reference._replace(cos=c, sin=s, omega=0.0 * c, alpha=0.0 * c)
        return Reference(*each(where, (started,), free, reference))


TorchGuide: TypeAlias = TorchTimetable | TorchCourses


def torch_guide(guide: Timetable | Courses, dtype: torch.dtype, device: torch.device) -> TorchGuide:
    """A guide's tables on a device."""
    if isinstance(guide, Timetable):
        return TorchTimetable(guide, dtype, device)
    return TorchCourses(guide, dtype, device)


def _weights(numbers: Scalar, dtype: torch.dtype, device: torch.device) -> tuple[Tensor, ...]:
    """Tensors (1,): a Python number times a flag of 0 or 1 would have Torch's default precision."""
    return torch.as_tensor(numbers, dtype=dtype, device=device)[:, None].unbind(0)
