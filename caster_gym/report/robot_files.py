"""Robot files that commands write."""

import yaml

from caster_gym.robot import Robot


def robot_yaml(robot: Robot, *remarks: str) -> str:
    """The file of a robot, with remarks as comments at its top; `load_robot` of that file gives the same robot."""
    content = robot.model_dump(mode="json", exclude_none=True)
    header = "".join(f"# {remark}\n" for remark in remarks)
    return header + yaml.safe_dump(content, sort_keys=False, allow_unicode=True, default_flow_style=None, width=110)
