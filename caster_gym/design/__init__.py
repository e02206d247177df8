"""Which robot suits a task: the wheel radius and trail that suit a target best, and the motors that it needs.

`read_design` and `design` are the command; `make_design` computes without writing; `require` sizes the motors of a
robot as it is. The modules `isotropy` and `joint_sets` are open to other analyses. All else is this room's own.
"""

from caster_gym.design.command import DesignReport, DesignSettings, design, make_design, read_design, write_design
from caster_gym.design.sizing import Requirement, require, sized
from caster_gym.design.target import Payload, Target

__all__ = [
    "DesignReport",
    "DesignSettings",
    "Payload",
    "Requirement",
    "Target",
    "design",
    "make_design",
    "read_design",
    "require",
    "sized",
    "write_design",
]
