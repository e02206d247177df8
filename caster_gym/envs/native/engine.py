"""The engine of every task, for any number of robots, in compiled code; the environments are thin layers above it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.native.compilation import compilations, included
from caster_gym.engines.native.held import Held
from caster_gym.engines.native.lanes import LANES
from caster_gym.engines.native.threads import over_blocks
from caster_gym.envs import rows
from caster_gym.envs.native import layout
from caster_gym.envs.native import step as kernel
from caster_gym.envs.native.compilation import told_plainly
from caster_gym.envs.native.robots import Robots
from caster_gym.envs.plan import Beside, Span
from caster_gym.envs.report import RESULT, named
from caster_gym.envs.scene import Scene, draw_scene
from caster_gym.mechanics.separation import Obstacles
from caster_gym.states import AnyState

DRAW_A_PATH = -1
_ENDED = rows.span((RESULT.failed, RESULT.late))


class Outcome(NamedTuple):
    """What a step brought, one entry per robot along the axes named `robots`."""

    observations: NDArray[np.float32]  # (robots, size)
    rewards: NDArray[np.float64]  # (robots,)
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    reports: NDArray[np.float64]  # (quantities, robots)


class TaskEngine(Robots):
    """Robots of one kind, each on one of several paths.

    on_restart: functions that are called with the indices of robots that start a new episode, before they are placed.
    """

    def restart(
        self, selected: NDArray[np.int64], into: Outcome | None = None, path: int | NDArray[np.int64] = DRAW_A_PATH
    ) -> Outcome:
        """Start new episodes of the selected robots; the others' entries are those of `into`, or zero.

        path: index of the path to follow, for all or for each of the selected; DRAW_A_PATH draws one.
        """
        for prepare in self.on_restart:
            prepare(selected)
        outcome = self._empty() if into is None else into
        views = layout.Views(outcome.observations, outcome.reports, np.zeros((len(RESULT), 0)))
        paths = np.broadcast_to(np.asarray(path, dtype=np.int64), selected.shape).copy()
        before = compilations()
        with told_plainly(self.plan.source):
            kernel.restart(selected, paths, self._world, self.spread, views, self._workspace, self._sizes)
            if compilations() > before:
                self._compile_step()
        if self._kept_reports is not None:
            self._kept_reports[:, selected] = outcome.reports[:, selected]
        if self._late is not None:
            self._late[selected] = 0
            self._late = self._late if self._late.any() else None
        return outcome

    def checked_path(self, path: Any) -> NDArray[np.int64]:
        """Indices of paths, one a robot. Raises ValueError for one that is not there or no whole number."""
        wanted = np.asarray(path)
        if wanted.shape not in ((), (self.count,)):
            raise ValueError(f"path must be one number or an array of shape ({self.count},), got shape {wanted.shape}")
        if (
            wanted.dtype.kind not in "iu"
            or wanted.size == 0
            or wanted.min() < DRAW_A_PATH
            or wanted.max() >= len(self.plan.names)
        ):
            raise ValueError(f"path must be a whole number in 0 … {len(self.plan.names) - 1}, got {path!r}")
        return np.broadcast_to(wanted.astype(np.int64), (self.count,))

    def step(self, actions: NDArray[np.float32]) -> Outcome:
        """Move all robots for one control period under actions (robots, driven joints) in −1 … 1."""
        observations, reports, results = (pool.take() for pool in self._pools)
        views = layout.Views(observations, reports, results)
        over_blocks(kernel.step_blocks, len(self._world.blocks), self._world, actions, views, self._sizes)
        if self._kept_reports is not None:
            self._kept_reports = reports.copy()
        if self.count == 1:
            self._workspace_report[:] = reports[:, 0]
        terminated, truncated = results[_ENDED] > 0.0
        if self._late is not None:
            truncated = self._over(self._late)
        return Outcome(observations, results[RESULT.reward], terminated, truncated, reports)

    def step_alone(
        self, action: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], float, bool, bool, NDArray[np.float64]]:
        """Move the only robot there is for a control period: observation, reward, terminated, truncated, report.

        Faster than `step`, and the same to the last bit. Raises ValueError for an action (driven joints,) that is not a
        number.
        """
        observation = np.empty(self._observation_size, dtype=np.float32)
        report = np.empty(self.report_rows)
        held = self._held if self._held is not None else self._hold()
        if not kernel.step_single(held, action, observation, report):
            raise ValueError(f"action must hold numbers, got {action}")
        reward, failed, late = self._results.tolist()
        return observation, reward, failed > 0.0, late > 0.0, report

    def _hold(self) -> Held:
        self._held = Held((self._world, self._workspace, self._results, self._sizes))
        return self._held

    def _compile_step(self) -> None:
        """Compile the step as well, by a call that does nothing, so that whoever waits does so once."""
        nothing, action = self._empty(), np.full(len(self.robot.driven), np.nan, dtype=np.float32)
        with included():
            if self.count == 1:
                kernel.step_single(self._hold(), action, nothing.observations[0], nothing.reports[:, 0].copy())
            else:
                views = layout.Views(nothing.observations, nothing.reports, np.zeros((len(RESULT), self.count)))
                actions = np.zeros((self.count, len(action)), dtype=np.float32)
                kernel.step_blocks(0, 0, self._world, actions, views, self._sizes)

    def look(self, progress_stays: bool = True) -> Outcome:
        """What all robots see and report where they are now, as at a start: after no time, without torques.

        Everything comes from what the engine alone holds; arrays that it gave away may have been written into since.
        Unless their progress stays, the robots seek the point of a path that is nearest to them.
        """
        world = self._world
        blocks, parameters, clocks, _ = self.changing
        source: Any = world.source.still() if progress_stays else world.source
        clocks[layout.CLOCKS.done] -= 1
        still = world._replace(blocks=blocks, parameters=parameters, clocks=clocks, source=source, substeps=0)
        outcome = self._empty()
        still_actions = np.zeros((self.count, len(self.robot.driven)), dtype=np.float32)
        if self.count > 1:
            views = layout.Views(outcome.observations, outcome.reports, np.zeros((len(RESULT), self.count)))
            kernel.step_blocks(0, len(blocks), still, still_actions, views, self._sizes)
            return outcome
        workspace = blocks.reshape(-1)
        still = still._replace(parameters=self._workspace_parameters(workspace))
        held = Held((still, workspace, np.zeros(len(RESULT)), self._sizes))
        report = np.zeros(self.report_rows)
        kernel.step_single(held, still_actions[0], outcome.observations[0], report)
        outcome.reports[:, 0] = report
        return outcome

    def _over(self, late: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whose time is over; an episode that began late may take as long as any, but not past the trajectory's end."""
        span = Span(*self.plan.source.spans[self.paths].T)
        done = self._world.clocks[layout.CLOCKS.done]
        over: NDArray[np.bool_] = done >= np.minimum(span.last - span.first, late + span.periods)
        return over

    def _empty(self) -> Outcome:
        size, count = self.layout.size, self.count
        nothing = np.zeros(count, dtype=np.bool_)
        return Outcome(
            np.zeros((count, size), dtype=np.float32),
            np.zeros(count),
            nothing,
            nothing.copy(),
            np.zeros((self.report_rows, count)),
        )

    def info(self, reports: NDArray[np.float64]) -> dict[str, Any]:
        """Named quantities of all robots, or one; see `caster_gym.envs.report.named`."""
        return named(reports, self.plan.terms, self.slipping)

    def scene(self, robot: int) -> Scene:
        """What there is to see of one robot."""
        if self.count > 1 and self._kept_reports is None:
            self.keep_reports()
        path = int(self._world.clocks[layout.CLOCKS.path, robot])
        return draw_scene(
            self.robot,
            float(self._world.clocks[layout.CLOCKS.done, robot]) * self._pace.substeps * self._pace.time_step,
            self.states[robot],
            self._report_of(robot),
            len(self.plan.terms),
            self.wrenches[robot],
            self.plan.tables[path][:, :2],
            self._pace.corridor,
            self._obstacles_beside(path),
            self._pace.floor,
            self._pace.time_step,
        )

    def set_state(self, state: AnyState) -> None:
        """See `Robots`. Where robots are drawn and those of the state were not, they report what they see now."""
        drawn = self._kept_reports is not None
        super().set_state(state)
        if drawn:
            self.keep_reports()

    def keep_reports(self) -> None:
        """Keep a copy of every report from now on, which pictures of a batch need."""
        if self._kept_reports is None and self.count > 1:
            self._kept_reports = self.look().reports

    def _report_of(self, robot: int) -> NDArray[np.float64]:
        """The latest report of a robot, from where nobody else can have changed it."""
        if self._kept_reports is not None:
            return self._kept_reports[:, robot].copy()
        return self._workspace_report.copy()

    @property
    def _workspace_report(self) -> NDArray[np.float64]:
        """Where the latest report of a robot alone stands."""
        row = self._rows.report
        return self._workspace.reshape(-1, LANES)[row : row + self.report_rows, 0]

    def _obstacles_beside(self, path: int) -> Obstacles:
        around, beside = self.plan.around.obstacles, Beside(*self.plan.arenas[path])
        here = slice(beside.first, beside.end)
        return around._replace(radii=around.radii[here], spans=around.spans[here])
