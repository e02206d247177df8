"""Paths walked at the robots' own pace, for a batch of tensors."""

import torch
from torch import Tensor

from caster_gym.envs.plan import SPAN
from caster_gym.envs.tensor.reference import Guidance
from caster_gym.envs.tracking import Reference, point_of
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import each, maximum, minimum, where
from caster_gym.tasks.follow.course import (
    ROW,
    Row,
    at_rest,
    chord_share,
    course_reference,
    nearest_share,
    progress_share,
)
from caster_gym.tasks.follow.reference import Courses


class TorchCourses:
    """Paths walked at the robots' own pace."""

    def __init__(self, source: Courses, dtype: torch.dtype, device: torch.device) -> None:
        self.samples = torch.as_tensor(source.samples, dtype=dtype, device=device).T.contiguous()  # (10, rows)
        self.spans = torch.as_tensor(source.spans, device=device)
        self._source, self._horizons = source, tuple(source.horizons.tolist())
        self._spacings = torch.as_tensor(source.spacings, dtype=dtype, device=device)
        self._lengths = self._spacings * (self.spans[:, SPAN.last] - self.spans[:, SPAN.first])
        self._windows = torch.as_tensor((source.window / source.spacings).astype(int) + 2, device=device)
        self._widest = torch.arange(int((source.window / source.spacings).max()) + 2, device=device)

    def fetch(self, state: State, clock: Tensor, path: Tensor, before: Tensor) -> Guidance:
        """Reference and preview at the points of the paths nearest to the robots; before: their progress so far [m]."""
        source, length = self._source, self._lengths[path]
        sought = self.nearest(state, path, maximum(before, 0.0))
        progress = torch.where(before < 0.0, 0.0, sought)
        reference = self.reference_at(path, progress, state)
        preview = []
        for ahead in self._horizons:
            coming = self.reference_at(path, torch.minimum(progress + ahead, length), state)
            preview.append(point_of(coming))
        last = self._row(self.spans[path, SPAN.last])
        share = progress_share(progress, before, length, state.position, last, source)
        return Guidance(reference, tuple(preview), progress, share)

    def _row(self, i: Tensor) -> Row:
        return Row(*self.samples[:, i].unbind(0))

    def nearest(self, state: State, path: Tensor, before: Tensor) -> Tensor:
        """Arc length of the point nearest to each robot, from `before` to a window ahead. [m]"""
        x, y = state.position
        base, last = self.spans[path, SPAN.first], self.spans[path, SPAN.last]
        spacing = self._spacings[path]
        first = torch.minimum(base + (before.detach() / spacing).long(), last - 1)
        end = torch.minimum(first + self._windows[path], last)
        with torch.no_grad():
            rows = first[:, None] + self._widest
            within = rows < end[:, None]
            rows = torch.minimum(rows, last[:, None] - 1)
            ahead = rows + 1
            xs, ys = self.samples[ROW.x], self.samples[ROW.y]
            a, b = (xs[rows], ys[rows]), (xs[ahead], ys[ahead])
            shares, distance = chord_share(a, b, x[:, None], y[:, None])
            best = torch.where(within, distance, torch.inf).argmin(1)
            guess = shares.gather(1, best[:, None])[:, 0]
        chosen = first + best
        share = nearest_share(self._row(chosen), self._row(chosen + 1), guess, spacing, x, y)
        # beside a row itself chords on the outer side of a bend are equally near
        after = torch.minimum(chosen + 1, end - 1)
        beyond = nearest_share(self._row(after), self._row(after + 1), torch.zeros_like(guess), spacing, x, y)
        on = (share >= 1.0) & (chosen + 1 < end)
        chosen, share = torch.where(on, after, chosen), torch.where(on, beyond, share)
        reached = torch.minimum((chosen - base + share) * spacing, before + self._source.window)
        return torch.maximum(reached, before)

    def reference_at(self, path: Tensor, arc: Tensor, state: State) -> Reference:
        """Reference at an arc length [m]; at rest at the end of the path, and turned like the robot if that is free.

        A robot without a heading (0, 0) is one that has not started.
        """
        base, last = self.spans[path, SPAN.first], self.spans[path, SPAN.last]
        spacing = self._spacings[path]
        i = torch.minimum(base + (arc.detach() / spacing).long(), last - 1)
        share = minimum(arc / spacing - (i - base), 1.0)
        walked = course_reference(self._row(i), self._row(i + 1), share, spacing)
        done = arc >= (last - base) * spacing
        reference = Reference(*each(where, (done,), at_rest(walked), walked))
        if not self._source.free_heading:
            return reference
        c, s = state.heading
        started = c * c + s * s > 0.5
        free = reference._replace(cos=c, sin=s, omega=0.0 * c, alpha=0.0 * c)
        return Reference(*each(where, (started,), free, reference))
