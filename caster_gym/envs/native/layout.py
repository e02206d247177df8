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
from caster_gym.engines.native.lanes import BODY_ROWS, LANES
from caster_gym.envs.native.reference import borrowed_source
from caster_gym.envs.observation import CHANNELS, Channel, Neighbour, observation_size, observe, observed
from caster_gym.envs.report import RECORD, REPORT_ROWS, Situation
from caster_gym.envs.tracking import POINT_ROWS, Reference
from caster_gym.mechanics.parameters import CASTER_FIELDS, PLATFORM_FIELDS
from caster_gym.mechanics.scalars import each


class World(NamedTuple):
    """What a batch keeps from step to step."""

    blocks: Any  # float64 (blocks, rows · LANES)
    parameters: Any  # float64 (blocks, fields · LANES), or (1, fields · LANES) which all blocks share
    clocks: Any  # int64 (2, robots): control periods done, path
    seeds: Any  # uint64 (2, robots): key, episode
    slots: Any  # int64 (2 N,): which action drives each motor, −1 for none
    source: Any  # ReferenceSource of the task
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
    preview: int
    situation: int
    nearest: int  # obstacles
    observation: int
    report: int  # its parts from here on
    terms: int  # of the reward
    motors: int  # their torques, and slips
    end: int


def state_rows(casters: int, slips: bool) -> int:
    """Numbers of the state of a robot with so many casters, whose wheels may slip or not."""
    return BODY_ROWS + 2 * casters + (2 * casters + 2 if slips else 0)


def rows_of(sizes: Sizes) -> Workspace:
    """Where each part of a workspace begins."""
    casters, preview, nearest, slipping, terms = (len(items) for items in sizes)
    widths = Workspace(
        state=state_rows(casters, slipping > 0),
        room=1,
        wrench=3,
        progress=1,
        parameters=PLATFORM_FIELDS + CASTER_FIELDS * casters,
        commands=2 * casters,
        torques=2 * casters,
        record=len(RECORD),
        slips=slipping,
        friction=slipping,
        reference=len(Reference._fields),
        preview=POINT_ROWS * preview,
        situation=len(Situation._fields),
        nearest=len(Neighbour._fields) * nearest,
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
