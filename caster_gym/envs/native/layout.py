"""How the quantities of a task lie in memory, and what else a batch keeps.

Rows of a block, which is kept from step to step: state, room, wrench, progress. On a desk, which stays in the
processor's cache, one block after the other is worked out; behind the rows of the block it has the robots' parameters,
motor commands, mean motor torques, record, slip, friction of the floor, reference, preview, situation, nearest
obstacles, observation, report. (Two arrays instead of one desk would stop the compiler from making SIMD loops.) Robots
that are all alike share the parameters of one block, which then stay on the desk; a robot alone lives on its desk. The
tuples in `Sizes` have an item per caster, per previewed point, per observed obstacle and per wheel that may slip: their
lengths are part of their types, so that all rows are constants of the compiled code.
"""

from typing import Any, NamedTuple

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE
from caster_gym.engines.native.lanes import BODY_ROWS
from caster_gym.envs.native.reference import POINT_ROWS, REFERENCE_ROWS
from caster_gym.envs.tracking import Record, Situation
from caster_gym.mechanics.parameters import CASTER_FIELDS, PLATFORM_FIELDS

RECORD_ROWS = len(Record._fields)
SITUATION_ROWS = len(Situation._fields)
NEIGHBOUR_ROWS = 3
FIXED_REPORT_ROWS = 37
LEFT_CORRIDOR, NOT_FINITE, TOUCHED, ENDINGS = 0, 1, 2, 3
POSITION_ERROR, HEADING_SIN, HEADING_COS, CONDITIONING = 3, 4, 5, 6
FIRST_TERM, TERMS, FIRST_POSE, FIRST_RECORD = 7, 6, 13, 21
FIRST_SITUATION = FIRST_RECORD + RECORD_ROWS


class World(NamedTuple):
    """What a batch keeps from step to step."""

    blocks: Any  # float64 (blocks, rows · LANES)
    parameters: Any  # float64 (blocks, fields · LANES), or (1, fields · LANES) which all blocks share
    clocks: Any  # int64 (2, robots): control periods done, path
    seeds: Any  # uint64 (2, robots): key, episode
    slots: Any  # int64 (2 N,): which action drives each motor, −1 for none
    guide: Any  # ReferenceSource of the task
    hull: Any  # Hull; this and the next two are None where there is no obstacle
    obstacles: Any  # Obstacles
    arenas: Any  # int64 (paths, 2): first and end of the obstacles beside each path
    floor: Any  # FloorTable; None where wheels roll without slip
    substeps: Any
    time_step: Any  # [s]


class Views(NamedTuple):
    """Where compiled code leaves what Python reads."""

    observations: Any  # float32 (robots, size)
    reports: Any  # float64 (quantities, robots)
    results: Any  # float64 (3, robots): reward, terminated, truncated


class Sizes(NamedTuple):
    """As many items as there are casters, previewed points, obstacles in an observation, and wheels that may slip."""

    casters: tuple[int, ...]
    preview: tuple[int, ...]
    nearest: tuple[int, ...]
    slipping: tuple[int, ...]  # empty where wheels roll without slip, else as long as casters


def state_rows(casters: int, slips: bool) -> int:
    """Numbers of the state of a robot with so many casters, whose wheels may slip or not."""
    return BODY_ROWS + 2 * casters + (2 * casters + 2 if slips else 0)


@register_jitable(**INLINE)
def room_row(sizes: Sizes) -> int:
    """Row of the room, see `caster_gym.engines.native.guarding`."""
    free = len(sizes.slipping)
    return BODY_ROWS + 2 * len(sizes.casters) + (2 * free + 2 if free > 0 else 0)


@register_jitable(**INLINE)
def wrench_row(sizes: Sizes) -> int:
    """First row of the external wrench at C, in B."""
    return room_row(sizes) + 1


@register_jitable(**INLINE)
def progress_row(sizes: Sizes) -> int:
    """Row of the progress [m], negative at the start of an episode."""
    return wrench_row(sizes) + 3


@register_jitable(**INLINE)
def parameter_row(sizes: Sizes) -> int:
    """First row of the robot's parameters, behind the rows of a block."""
    return progress_row(sizes) + 1


@register_jitable(**INLINE)
def parameter_rows(sizes: Sizes) -> int:
    """Rows of the robot's parameters."""
    return PLATFORM_FIELDS + CASTER_FIELDS * len(sizes.casters)


@register_jitable(**INLINE)
def command_row(sizes: Sizes) -> int:
    """First row of the motor commands."""
    return parameter_row(sizes) + parameter_rows(sizes)


@register_jitable(**INLINE)
def torque_row(sizes: Sizes) -> int:
    """First row of the mean motor torques [N m]."""
    return command_row(sizes) + 2 * len(sizes.casters)


@register_jitable(**INLINE)
def record_row(sizes: Sizes) -> int:
    """First row of the record of the control period."""
    return torque_row(sizes) + 2 * len(sizes.casters)


@register_jitable(**INLINE)
def slip_row(sizes: Sizes) -> int:
    """First row of the greatest slip of each wheel in the control period [m/s]."""
    return record_row(sizes) + RECORD_ROWS


@register_jitable(**INLINE)
def friction_row(sizes: Sizes) -> int:
    """First row of the floor's friction under each wheel."""
    return slip_row(sizes) + len(sizes.slipping)


@register_jitable(**INLINE)
def reference_row(sizes: Sizes) -> int:
    """First row of the reference, with the previewed points behind it."""
    return friction_row(sizes) + len(sizes.slipping)


@register_jitable(**INLINE)
def situation_row(sizes: Sizes) -> int:
    """First row of the situation."""
    return reference_row(sizes) + REFERENCE_ROWS + POINT_ROWS * len(sizes.preview)


@register_jitable(**INLINE)
def nearest_row(sizes: Sizes) -> int:
    """First row of the nearest obstacles."""
    return situation_row(sizes) + SITUATION_ROWS


@register_jitable(**INLINE)
def observation_row(sizes: Sizes) -> int:
    """First row of the observation."""
    return nearest_row(sizes) + NEIGHBOUR_ROWS * len(sizes.nearest)


@register_jitable(**INLINE)
def report_row(sizes: Sizes) -> int:
    """First row of the report."""
    points = POINT_ROWS * len(sizes.preview) + NEIGHBOUR_ROWS * len(sizes.nearest)
    return observation_row(sizes) + 13 + 4 * len(sizes.casters) + points


@register_jitable(**INLINE)
def desk_rows(sizes: Sizes) -> int:
    """Rows of a desk."""
    return report_row(sizes) + FIXED_REPORT_ROWS + 2 * len(sizes.casters) + len(sizes.slipping)
