"""How the quantities of a task lie in memory, and what else a batch keeps. All arithmetic on rows is done here.

A workspace, which stays in the processor's cache, is where one block of robots after the other is worked out; its parts
are the fields of `Workspace`. Only the parts before the parameters are kept, in the block. (Two arrays instead of one
workspace would stop the compiler from making SIMD loops.) Robots that are all alike share the parameters of one block,
which then stay in the workspace; a robot alone lives in its workspace. The tuples in `Sizes` have an item per caster,
per previewed point, per observed obstacle, per wheel that may slip and per reward term: their lengths are part of their
types, so that all rows are constants of the compiled code.
"""

from itertools import accumulate
from typing import Any, NamedTuple

from numba.extending import overload, register_jitable

from caster_gym.engines.native.compiler import INLINE, borrowed
from caster_gym.engines.native.guarding import borrowed_floor, borrowed_hull, borrowed_obstacles
from caster_gym.engines.native.lanes import LANES, counting, read, write
from caster_gym.envs.native.reference import borrowed_source
from caster_gym.envs.observation import (
    CHANNELS,
    GAP_LIMIT,
    Channel,
    Neighbour,
    observation_size,
    observe,
    observed,
)
from caster_gym.envs.report import RECORD, REPORT_ROWS, Record, Situation
from caster_gym.envs.rows import numbered
from caster_gym.envs.tracking import POINT_ROWS, REFERENCE_ROWS, Point, Reference
from caster_gym.mechanics.integration import state_rows
from caster_gym.mechanics.parameters import CASTER_FIELDS, PLATFORM_FIELDS
from caster_gym.mechanics.scalars import each

NO_WRENCH = (0.0, 0.0, 0.0)
NO_NEIGHBOUR = Neighbour(GAP_LIMIT, 0.0, 0.0)
_NEIGHBOUR_ROWS = len(Neighbour._fields)

_REFERENCE = (0.0,) * REFERENCE_ROWS
_POINT = (0.0,) * POINT_ROWS
_RECORD = (0.0,) * len(RECORD)
_SITUATION = (0.0,) * len(Situation._fields)


class Clocks(NamedTuple):
    """Where each robot is in its episode."""

    done: Any  # control periods
    path: Any  # index


class Seeds(NamedTuple):
    """What a robot's random numbers count from."""

    key: Any
    episode: Any  # the one that starts next


CLOCKS, SEEDS = numbered(Clocks), numbered(Seeds)


class World(NamedTuple):
    """What a batch keeps from step to step."""

    blocks: Any  # float64 (blocks, rows · LANES)
    parameters: Any  # float64 (blocks, fields · LANES), or (1, fields · LANES) which all blocks share
    clocks: Any  # int64 (2, robots) as in `Clocks`
    seeds: Any  # uint64 (2, robots) as in `Seeds`
    slots: Any  # int64 (2 N,): which action drives each motor, −1 for none
    source: Any  # ReferenceSource of the task
    hull: Any  # Hull; this and the next two are None where there is no obstacle
    obstacles: Any  # Obstacles
    arenas: Any  # int64 (paths, 2) as in `caster_gym.envs.plan.Beside`
    floor: Any  # FloorTable; None where wheels roll without slip
    substeps: Any
    time_step: Any  # [s]


class Views(NamedTuple):
    """Where compiled code leaves what Python reads."""

    observations: Any  # float32 (robots, size)
    reports: Any  # float64 (quantities, robots)
    results: Any  # float64 (len(Result), robots)


class Sizes(NamedTuple):
    """As many items as there are casters, previewed points, obstacles in an observation, and so on."""

    casters: tuple[int, ...]
    preview: tuple[int, ...]
    nearest: tuple[int, ...]
    slipping: tuple[int, ...]  # empty where wheels roll without slip, else as long as casters
    terms: tuple[int, ...]  # of the reward


class Workspace(NamedTuple):
    """First row of each part of a workspace."""

    state: int  # as in `pack_state`
    room: int  # see `caster_gym.engines.native.guarding`
    wrench: int  # external, at C, in B
    progress: int  # [m] negative at the start of an episode
    parameters: int  # of the robot; first of the parts that are not kept in a block
    commands: int  # of the motors
    torques: int  # mean, of the motors [N m]
    record: int  # of the control period
    slips: int  # greatest, of each wheel in the control period [m/s]
    friction: int  # of the floor under each wheel
    reference: int
    preview: int  # right behind the reference, where `write_point` puts it
    situation: int
    nearest: int  # obstacles
    observation: int
    report: int  # its parts from here on
    terms: int  # of the reward
    motors: int  # their torques, and slips
    end: int


def rows_of(sizes: Sizes) -> Workspace:
    """Where each part of a workspace begins."""
    casters, preview, nearest, slipping, terms = (len(items) for items in sizes)
    widths = Workspace(
        state=state_rows(casters, slipping > 0),
        room=1,
        wrench=len(NO_WRENCH),
        progress=1,
        parameters=PLATFORM_FIELDS + CASTER_FIELDS * casters,
        commands=2 * casters,
        torques=2 * casters,
        record=len(RECORD),
        slips=slipping,
        friction=slipping,
        reference=REFERENCE_ROWS,
        preview=POINT_ROWS * preview,
        situation=len(Situation._fields),
        nearest=_NEIGHBOUR_ROWS * nearest,
        observation=observation_size(casters, preview, nearest),
        report=REPORT_ROWS,
        terms=terms,
        motors=2 * casters + slipping,
        end=0,
    )
    return Workspace(*accumulate(widths[:-1], initial=0))


@overload(rows_of, jit_options=INLINE, strict=False)
def _rows_of(sizes: Any) -> Any:
    rows = rows_of(Sizes(*(tuple(range(len(items))) for items in sizes)))
    return lambda sizes: rows


@overload(observe, jit_options=INLINE, strict=False)
def _observe(view: Any) -> Any:
    views = dict(zip(view.fields, view.types, strict=True))
    items = {"caster": len(views["rates"]), "point": len(views["preview"]), "obstacle": len(views["nearest"])}
    units = sum((channel.units * items.get(channel.per, 1) for channel in CHANNELS), ())
    see = _seen(CHANNELS)
    return lambda view: each(observed, (), see(view), units)


def _seen(channels: tuple[Channel, ...]) -> Any:
    """A function for compiled code that sees all channels."""
    if len(channels) < 4:
        first, second, third = (*(channel.see for channel in channels), _nothing, _nothing)[:3]
        return register_jitable(**INLINE)(lambda view: first(view) + second(view) + third(view))
    start, middle, end = (_seen(channels[i * len(channels) // 3 : (i + 1) * len(channels) // 3]) for i in range(3))
    return register_jitable(**INLINE)(lambda view: start(view) + middle(view) + end(view))


@register_jitable(**INLINE)
def _nothing(_view: Any) -> Any:
    return ()


def as_many(numbers: tuple[Any, ...], items: tuple[Any, ...]) -> tuple[Any, ...]:
    """The numbers, of which there must be as many as items, else compiling raises TypeError."""
    if len(numbers) != len(items):
        raise TypeError(f"the reward has {len(numbers)} terms, and the task names {len(items)}")
    return numbers


@overload(as_many, jit_options=INLINE, strict=False)
def _as_many(numbers: Any, items: Any) -> Any:
    as_many(numbers, items)
    return lambda numbers, items: numbers


@register_jitable(**INLINE)
def copy_rows(source: Any, target: Any, lane: Any, lanes: Any, rows: Any, first: Any) -> None:
    """Copy the first rows of all lanes, or of one, to the rows from `first` on."""
    if lanes == LANES:
        for i in range(rows * LANES):
            target[first * LANES + i] = source[i]
    else:
        for row in range(rows):
            target[(first + row) * LANES + lane] = source[row * LANES + lane]


@register_jitable(**INLINE)
def read_record(workspace: Any, lane: Any, sizes: Sizes) -> Record:
    """What has happened to a robot in the control period."""
    return Record(*read(workspace, lane, rows_of(sizes).record, _RECORD))


@register_jitable(**INLINE)
def write_record(workspace: Any, lane: Any, record: Record, sizes: Sizes) -> None:
    """Keep what has happened to a robot in the control period."""
    write(workspace, lane, rows_of(sizes).record, record[:])


@register_jitable(**INLINE)
def read_reference(workspace: Any, lane: Any, sizes: Sizes) -> Reference:
    """What a robot is to do now."""
    return Reference(*read(workspace, lane, rows_of(sizes).reference, _REFERENCE))


@register_jitable(**INLINE)
def read_points(workspace: Any, lane: Any, sizes: Sizes) -> tuple[Point, ...]:
    """What a robot is to do soon."""
    return each(_read_point, (workspace, lane, rows_of(sizes).preview), counting(sizes.preview))


@register_jitable(**INLINE)
def _read_point(workspace: Any, lane: Any, row: Any, index: Any) -> Point:
    return Point(*read(workspace, lane, row + POINT_ROWS * index, _POINT))


@register_jitable(**INLINE)
def write_reference(workspace: Any, lane: Any, row: Any, reference: Reference) -> None:
    """Keep what a robot is to do now; row: first of its reference."""
    write(workspace, lane, row, reference[:])


@register_jitable(**INLINE)
def write_point(workspace: Any, lane: Any, row: Any, index: Any, point: Point) -> None:
    """Keep one of the points that a robot is to reach soon; row: first of its reference."""
    write(workspace, lane, row + REFERENCE_ROWS + POINT_ROWS * index, point[:])


@register_jitable(**INLINE)
def read_situation(workspace: Any, lane: Any, sizes: Sizes) -> Situation:
    """Where a robot is on its way."""
    return Situation(*read(workspace, lane, rows_of(sizes).situation, _SITUATION))


@register_jitable(**INLINE)
def write_situation(workspace: Any, lane: Any, situation: Situation, sizes: Sizes) -> None:
    """Keep where a robot is on its way."""
    write(workspace, lane, rows_of(sizes).situation, situation[:])


@register_jitable(**INLINE)
def read_neighbours(workspace: Any, lane: Any, sizes: Sizes) -> tuple[Neighbour, ...]:
    """The obstacles that are nearest to a robot."""
    return each(read_neighbour, (workspace, lane, sizes), counting(sizes.nearest))


@register_jitable(**INLINE)
def read_neighbour(workspace: Any, lane: Any, sizes: Sizes, index: Any) -> Neighbour:
    """One of the obstacles that are nearest to a robot."""
    return Neighbour(*read(workspace, lane, rows_of(sizes).nearest + _NEIGHBOUR_ROWS * index, NO_NEIGHBOUR[:]))


@register_jitable(**INLINE)
def write_neighbour(workspace: Any, lane: Any, sizes: Sizes, index: Any, neighbour: Neighbour) -> None:
    """Keep one of the obstacles that are nearest to a robot."""
    write(workspace, lane, rows_of(sizes).nearest + _NEIGHBOUR_ROWS * index, neighbour[:])


@register_jitable(**INLINE)
def _borrowed_arenas(arenas: Any) -> Any:
    if arenas is None:
        return None
    return borrowed(arenas)


@register_jitable(**INLINE)
def borrowed_world(w: World) -> World:
    return World(
        borrowed(w.blocks),
        borrowed(w.parameters),
        borrowed(w.clocks),
        borrowed(w.seeds),
        borrowed(w.slots),
        borrowed_source(w.source),
        borrowed_hull(w.hull),
        borrowed_obstacles(w.obstacles),
        _borrowed_arenas(w.arenas),
        borrowed_floor(w.floor),
        w.substeps,
        w.time_step,
    )


@register_jitable(**INLINE)
def borrowed_views(v: Views) -> Views:
    return Views(borrowed(v.observations), borrowed(v.reports), borrowed(v.results))
