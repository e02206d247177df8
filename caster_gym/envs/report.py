"""The report of a control period: its numbers, on generic scalars, and their names.

A report is a row of numbers for each robot: those of `Report`, then the reward's terms, as many as the task has, the
motor torques, and the slips of wheels that may slip. The rows come from the tuples, see `caster_gym.envs.rows`.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.rows import check_names, flat, numbered, span
from caster_gym.mechanics.contact import Touch
from caster_gym.mechanics.plant import Drive
from caster_gym.mechanics.scalars import Scalar, each, flatten, maximum, total, where


class Record(NamedTuple):
    """What happened during a control period."""

    power: Scalar  # [W] mean of all motors
    impulse_x: Scalar  # [N s] of obstacles on the robot, in W
    impulse_y: Scalar
    pressing: Scalar  # [N s] sum of all normal impulses
    point_x: Scalar  # [m] of the last impact, in W
    point_y: Scalar
    impacts: Scalar  # how many
    traction: Scalar  # [-] greatest share of the floor's friction that a wheel used at the start of a time step
    lifted: Scalar  # most wheels that left the floor at once
    held_x: Scalar  # [N, N, N m] wrench of lasting contacts on the robot at the end, at C, in B
    held_y: Scalar
    held_moment: Scalar
    impact_traction: Scalar  # [-] greatest share of the floor's friction that a wheel used in an impact


class Situation(NamedTuple):
    """Where the robot is on its way."""

    progress: Scalar  # [m] arc length reached, where the task measures it
    share: Scalar  # of the progress that the period allows, 0 … 1
    clearance: Scalar  # [m] gap to the nearest obstacle


class Endings(NamedTuple):
    """Why an episode has failed; each 1 or 0."""

    left_corridor: Scalar
    not_finite: Scalar
    touched: Scalar


class Pose(NamedTuple):
    """Place and heading in W."""

    x: Scalar  # [m]
    y: Scalar
    cos: Scalar
    sin: Scalar


class Deviation(NamedTuple):
    """How far the robot is from what it should do, and from what it can."""

    position_error: Scalar  # [m]
    heading_sin: Scalar  # of the heading error; in reports that have been delivered, the error itself [rad]
    heading_cos: Scalar
    conditioning: Scalar  # [-] of the driven motors' wrenches


class Report(NamedTuple):
    """The numbers of a report that all tasks and robots have."""

    endings: Endings
    deviation: Deviation
    pose: Pose
    reference_pose: Pose
    record: Record
    situation: Situation


class Result(NamedTuple):
    """What a step is worth, and whether the episode ends with it: 1 or more if so, else 0."""

    reward: Scalar
    failed: Scalar
    late: Scalar


REPORT, RECORD, RESULT = numbered(Report), numbered(Record), numbered(Result)
REPORT_ROWS = len(flat(REPORT))

_ENDINGS = ("left_corridor", "not_finite", "touched")  # as infos name them

check_names(Endings._fields, "the fields of Endings", _ENDINGS, "those that `named` tells")

# Looked up once, since a robot alone reports every 5 µs
_LEFT_CORRIDOR, _NOT_FINITE, _TOUCHED = (getattr(REPORT.endings, name) for name in _ENDINGS)
_POSITION_ERROR, _HEADING_ERROR = REPORT.deviation.position_error, REPORT.deviation.heading_sin
_CONDITIONING = REPORT.deviation.conditioning
_POSE, _REFERENCE_POSE = span(REPORT.pose), span(REPORT.reference_pose)
_POWER, _TRACTION, _LIFTED = REPORT.record.power, REPORT.record.traction, REPORT.record.lifted
_IMPULSE = span((REPORT.record.impulse_x, REPORT.record.impulse_y))
_NORMAL_IMPULSE, _IMPACTS, _IMPACT_TRACTION = (
    REPORT.record.pressing,
    REPORT.record.impacts,
    REPORT.record.impact_traction,
)
_PROGRESS, _PROGRESS_SHARE = REPORT.situation.progress, REPORT.situation.share
_CLEARANCE = REPORT.situation.clearance


def torque_rows(terms: int, casters: int) -> slice:
    """Rows of the motor torques in a report of a task with so many reward terms. [N m]"""
    return slice(REPORT_ROWS + terms, REPORT_ROWS + terms + 2 * casters)


def flat_report(
    report: Report, terms: tuple[Scalar, ...], torques: tuple[tuple[Scalar, Scalar], ...], slips: tuple[Scalar, ...]
) -> tuple[Scalar, ...]:
    """A report as a row of numbers, with the reward's terms, the motor torques and the slips of wheels."""
    return flatten(report[:]) + terms[:] + flatten(torques) + slips


def named(reports: NDArray[np.float64], terms: tuple[str, ...], slipping: int = 0) -> dict[str, Any]:
    """Quantities of all robots by name, as `CasterTrackEnv` describes them, from reports (quantities, robots).

    Arrays (robots,) or (robots, width); of one robot, from its report (quantities,), numbers or arrays (width,). Reward
    terms, whose names are given, are in a dictionary. slipping: how many wheels may slip.
    """
    end = REPORT_ROWS + len(terms)  # of the terms
    row: Any = reports
    torque, impulse = reports[end:-slipping] if slipping else reports[end:], reports[_IMPULSE]
    pose, reference_pose = reports[_POSE], reports[_REFERENCE_POSE]
    if reports.ndim > 1:
        torque, impulse, pose, reference_pose = torque.T, impulse.T, pose.T, reference_pose.T
    else:
        row = reports.tolist()  # numbers of one robot are Python's own
    infos = {
        "position_error": row[_POSITION_ERROR],
        "heading_error": row[_HEADING_ERROR],
        "reward_terms": dict(zip(terms, row[REPORT_ROWS:end], strict=True)),
        "torque": torque,
        "power": row[_POWER],
        "traction_use": row[_TRACTION],
        "wheels_lifted": row[_LIFTED],
        "conditioning": row[_CONDITIONING],
        "pose": pose,
        "reference_pose": reference_pose,
        "progress": row[_PROGRESS],
        "progress_share": row[_PROGRESS_SHARE],
        "clearance": row[_CLEARANCE],
        "impacts": row[_IMPACTS],
        "impulse": impulse,
        "impact_traction": row[_IMPACT_TRACTION],
        "normal_impulse": row[_NORMAL_IMPULSE],
        "left_corridor": row[_LEFT_CORRIDOR] > 0.0,
        "not_finite": row[_NOT_FINITE] > 0.0,
        "touched": row[_TOUCHED] > 0.0,
    }
    if slipping:
        infos["wheel_slip"] = reports[-slipping:].T
    return infos


def record_of(done: Record, drive: Drive, touch: Touch, share: Scalar) -> Record:
    """A record with a time step among obstacles, which is a share of the control period."""
    hit = touch.impacts > 0.0
    return Record(
        done.power + share * drive.power,
        done.impulse_x + touch.impulse[0],
        done.impulse_y + touch.impulse[1],
        done.pressing + touch.pressing,
        where(hit, touch.point[0], done.point_x),
        where(hit, touch.point[1], done.point_y),
        done.impacts + touch.impacts,
        maximum(drive.asks.traction, done.traction),
        maximum(drive.asks.lifted, done.lifted),
        *touch.held,
        maximum(touch.impact_traction, done.impact_traction),
    )


def sum_of(numbers: tuple[Scalar, ...]) -> Scalar:
    """Sum of the terms of a reward, or of endings."""
    (result,) = total(each(_alone, (), numbers))
    return result


def _alone(number: Scalar) -> tuple[Scalar]:
    return (number,)
