"""The quantities of a report by name, as `CasterTrackEnv` describes them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.native.layout import (
    CONDITIONING,
    ENDINGS,
    FIRST_POSE,
    FIRST_RECORD,
    FIRST_SITUATION,
    FIRST_TERM,
    FIXED_REPORT_ROWS,
    HEADING_SIN,
    LEFT_CORRIDOR,
    NOT_FINITE,
    POSITION_ERROR,
    TOUCHED,
)
from caster_gym.envs.tracking import ASKS, IMPACT_TRACTION

# Rows of a report; looked up once, since a robot alone is told every 5 µs
_TERMS, _TORQUES = slice(FIRST_TERM, FIRST_POSE), slice(FIXED_REPORT_ROWS, None)
_POSE, _REFERENCE_POSE = slice(FIRST_POSE, FIRST_POSE + 4), slice(FIRST_POSE + 4, FIRST_POSE + 8)
_POWER, _IMPULSE, _NORMAL_IMPULSE = FIRST_RECORD, slice(FIRST_RECORD + 1, FIRST_RECORD + 3), FIRST_RECORD + 3
_IMPACTS, _IMPACT_TRACTION = FIRST_RECORD + 6, FIRST_RECORD + IMPACT_TRACTION
_TRACTION_USE, _WHEELS_LIFTED = FIRST_RECORD + ASKS, FIRST_RECORD + ASKS + 1
_PROGRESS, _PROGRESS_SHARE, _CLEARANCE = FIRST_SITUATION, FIRST_SITUATION + 1, FIRST_SITUATION + 2


def named(reports: NDArray[np.float64], terms: tuple[str, ...], slipping: int = 0) -> dict[str, Any]:
    """Named quantities of all robots, from reports (quantities, robots): arrays (robots,) or (robots, width).

    Of one robot, from its report (quantities,): numbers or arrays (width,). Reward terms are in a dictionary.
    slipping: how many wheels may slip, whose slips stand behind the torques.
    """
    if slipping:
        infos = named(reports[:-slipping], terms)
        infos["wheel_slip"] = reports[-slipping:].T
        return infos
    row: Any = reports
    torque, impulse = reports[_TORQUES], reports[_IMPULSE]
    pose, reference_pose = reports[_POSE], reports[_REFERENCE_POSE]
    if reports.ndim > 1:
        left, unfinite, touched = reports[:ENDINGS] > 0.0
        torque, impulse, pose, reference_pose = torque.T, impulse.T, pose.T, reference_pose.T
    else:
        row = reports.tolist()  # numbers of one robot are Python's own
        left, unfinite, touched = row[LEFT_CORRIDOR] > 0.0, row[NOT_FINITE] > 0.0, row[TOUCHED] > 0.0
    return {
        "position_error": row[POSITION_ERROR],
        "heading_error": row[HEADING_SIN],
        "reward_terms": dict(zip(terms, row[_TERMS], strict=False)),
        "torque": torque,
        "power": row[_POWER],
        "traction_use": row[_TRACTION_USE],
        "wheels_lifted": row[_WHEELS_LIFTED],
        "conditioning": row[CONDITIONING],
        "pose": pose,
        "reference_pose": reference_pose,
        "progress": row[_PROGRESS],
        "progress_share": row[_PROGRESS_SHARE],
        "clearance": row[_CLEARANCE],
        "impacts": row[_IMPACTS],
        "impulse": impulse,
        "impact_traction": row[_IMPACT_TRACTION],
        "normal_impulse": row[_NORMAL_IMPULSE],
        "left_corridor": left,
        "not_finite": unfinite,
        "touched": touched,
    }
