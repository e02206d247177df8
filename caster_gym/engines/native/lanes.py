"""Blocks of robots side by side: how a batch lies in memory, and how compiled code reads and writes it.

A block holds LANES robots. Quantity `row` of robot `lane` lies at block[row · LANES + lane], so that a loop over lanes
reads neighbours and, with offsets known while compiling, turns into SIMD instructions.
"""

from typing import Any

import numpy as np
from numba.extending import overload, register_jitable

from caster_gym.arrays import Array
from caster_gym.engines.native.compiler import INLINE
from caster_gym.mechanics.integration import BODY_ROWS, State, state_rows
from caster_gym.mechanics.parameters import (
    CASTER_FIELDS,
    PLATFORM_FIELDS,
    CasterParameters,
    PlatformParameters,
    RobotParameters,
)
from caster_gym.mechanics.scalars import each

LANES = 32

_PLATFORM = (0.0,) * PLATFORM_FIELDS
_CASTER = (0.0,) * CASTER_FIELDS
_BODY = (0.0,) * BODY_ROWS


def block_count(robots: int) -> int:
    """Blocks that hold so many robots."""
    return -(-robots // LANES)


def to_lanes(rows: Array, blocks: Array, first_row: int) -> None:
    """Put quantities (robots, rows) into blocks (blocks, rows · LANES), from a row on; spare lanes copy the last."""
    count, width = rows.shape
    view = blocks.reshape(len(blocks), -1, LANES)[:, first_row : first_row + width]
    padded = np.concatenate([rows, np.repeat(rows[-1:], len(blocks) * LANES - count, axis=0)])
    view[:] = padded.reshape(len(blocks), LANES, width).transpose(0, 2, 1)


def from_lanes(blocks: Array, first_row: int, width: int, robots: int) -> Array:
    """Quantities (robots, width) from blocks, from a row on, as a copy."""
    view = blocks.reshape(len(blocks), -1, LANES)[:, first_row : first_row + width]
    return np.ascontiguousarray(view.transpose(0, 2, 1).reshape(-1, width)[:robots])


def read(block: Any, lane: Any, row: Any, like: tuple[Any, ...]) -> tuple[Any, ...]:
    """As many quantities of one robot as the tuple `like` has items, from a row on."""
    return tuple(block[(row + i) * LANES + lane] for i in range(len(like)))


def write(block: Any, lane: Any, row: Any, values: tuple[Any, ...]) -> None:
    """Quantities of one robot, from a row on."""
    for i, value in enumerate(values):
        block[(row + i) * LANES + lane] = value


@overload(read, jit_options=INLINE, strict=False)
def _read(block: Any, lane: Any, row: Any, like: Any) -> Any:
    half = len(like) // 2
    if len(like) > 3:
        return lambda block, lane, row, like: (
            read(block, lane, row, like[:half]) + read(block, lane, row + half, like[half:])
        )
    return [
        lambda block, lane, row, like: (block[row * LANES + lane],),
        lambda block, lane, row, like: (block[row * LANES + lane], block[(row + 1) * LANES + lane]),
        lambda block, lane, row, like: (
            block[row * LANES + lane],
            block[(row + 1) * LANES + lane],
            block[(row + 2) * LANES + lane],
        ),
    ][len(like) - 1]


@overload(write, jit_options=INLINE, strict=False)
def _write(block: Any, lane: Any, row: Any, values: Any) -> Any:
    def write_one(block: Any, lane: Any, row: Any, values: Any) -> None:
        block[row * LANES + lane] = values[0]

    def write_two(block: Any, lane: Any, row: Any, values: Any) -> None:
        block[row * LANES + lane] = values[0]
        block[(row + 1) * LANES + lane] = values[1]

    def write_three(block: Any, lane: Any, row: Any, values: Any) -> None:
        block[row * LANES + lane] = values[0]
        block[(row + 1) * LANES + lane] = values[1]
        block[(row + 2) * LANES + lane] = values[2]

    def write_halves(block: Any, lane: Any, row: Any, values: Any) -> None:
        write(block, lane, row, values[:half])
        write(block, lane, row + half, values[half:])

    half = len(values) // 2
    return [write_one, write_two, write_three][len(values) - 1] if len(values) < 4 else write_halves


def counting(like: tuple[Any, ...]) -> tuple[int, ...]:
    """(0, 1, 2, …), as long as the tuple `like`."""
    return tuple(range(len(like)))


@overload(counting, jit_options=INLINE, strict=False)
def _counting(like: Any) -> Any:
    numbers = tuple(range(len(like)))
    return lambda like: numbers


@register_jitable(**INLINE)
def _read_direction(block: Any, lane: Any, row: Any, index: Any) -> Any:
    return block[(row + 2 * index) * LANES + lane], block[(row + 2 * index + 1) * LANES + lane]


@register_jitable(**INLINE)
def _read_caster(block: Any, lane: Any, row: Any, index: Any) -> Any:
    return CasterParameters(*read(block, lane, row + CASTER_FIELDS * index, _CASTER))


@register_jitable(**INLINE)
def read_pairs(block: Any, lane: Any, row: Any, casters: Any) -> Any:
    """Two quantities for each caster."""
    return each(_read_direction, (block, lane, row), counting(casters))


@register_jitable(**INLINE)
def read_state(block: Any, lane: Any, row: Any, casters: Any) -> State:
    """State of one robot; `casters` is any tuple with an item for each."""
    x, y, c, s, vx, vy, omega = read(block, lane, row, _BODY)
    return State((x, y), (c, s), (vx, vy, omega), read_pairs(block, lane, row + BODY_ROWS, casters), (), ())


@register_jitable(**INLINE)
def read_slip_state(block: Any, lane: Any, row: Any, casters: Any) -> State:
    """State of one robot whose wheels may slip."""
    body = read_state(block, lane, row, casters)
    behind = row + state_rows(len(casters), False)
    rates = read_pairs(block, lane, behind, casters)
    tilt = read(block, lane, behind + 2 * len(casters), (0.0, 0.0))
    return State(body.position, body.heading, body.twist, body.directions, rates, tilt)


@register_jitable(**INLINE)
def read_robot(block: Any, lane: Any, row: Any, casters: Any) -> RobotParameters:
    """Parameters of one robot; `casters` is any tuple with an item for each."""
    platform = PlatformParameters(*read(block, lane, row, _PLATFORM))
    return RobotParameters(platform, each(_read_caster, (block, lane, row + PLATFORM_FIELDS), counting(casters)))
