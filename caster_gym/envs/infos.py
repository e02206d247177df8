"""The quantities of a report by name, as `CasterTrackEnv` describes them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.block_layout import (
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

_TERMS = slice(FIRST_TERM, FIRST_POSE)
_TORQUES = np.s_[..., FIXED_REPORT_ROWS:]
_POSE, _REFERENCE_POSE = np.s_[..., FIRST_POSE : FIRST_POSE + 4], np.s_[..., FIRST_POSE + 4 : FIRST_POSE + 8]
_IMPULSE = np.s_[..., FIRST_RECORD + 1 : FIRST_RECORD + 3]


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
    if reports.ndim > 1:
        left, unfinite, touched = reports[:ENDINGS] > 0.0
    else:
        row = reports.tolist()  # numbers of one robot are Python's own
        left, unfinite, touched = row[LEFT_CORRIDOR] > 0.0, row[NOT_FINITE] > 0.0, row[TOUCHED] > 0.0
    columns = reports.T
    return {
        "position_error": row[POSITION_ERROR],
        "heading_error": row[HEADING_SIN],
        "reward_terms": dict(zip(terms, row[_TERMS], strict=False)),
        "torque": columns[_TORQUES],
        "power": row[FIRST_RECORD],
        "traction_use": row[FIRST_RECORD + ASKS],
        "wheels_lifted": row[FIRST_RECORD + ASKS + 1],
        "conditioning": row[CONDITIONING],
        "pose": columns[_POSE],
        "reference_pose": columns[_REFERENCE_POSE],
        "progress": row[FIRST_SITUATION],
        "progress_share": row[FIRST_SITUATION + 1],
        "clearance": row[FIRST_SITUATION + 2],
        "impacts": row[FIRST_RECORD + 6],
        "impulse": columns[_IMPULSE],
        "impact_traction": row[FIRST_RECORD + IMPACT_TRACTION],
        "normal_impulse": row[FIRST_RECORD + 3],
        "left_corridor": left,
        "not_finite": unfinite,
        "touched": touched,
    }
