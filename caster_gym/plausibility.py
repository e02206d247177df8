"""Warnings about implausible numbers of a robot: millimetres for metres, grams for kilograms, tiny inertias.

Bounds are wide: they let pass what is merely unusual. Nothing is refused, since a robot may be as odd as one likes.
"""

import warnings
from collections.abc import Iterator
from itertools import combinations
from math import hypot
from typing import TYPE_CHECKING, NamedTuple

from caster_gym.brief import cut

if TYPE_CHECKING:
    from caster_gym.robot import Caster, Motor, Robot

_GRAVITY = 9.81  # [m/s²]
_MOST_CASTERS = 16
_SHOWN = 3  # pairs of casters in a warning
_STEEL_BALL = 7850.0 * 4.19  # [kg/m³] mass of a steel ball over the cube of its radius


class RobotWarning(UserWarning):
    """A robot whose numbers are allowed and can hardly be meant."""


class _Doubt(NamedTuple):
    field: str
    value: float
    unit: str
    usual: str


def warn_if_implausible(robot: "Robot") -> None:
    """Warn once of all numbers of a robot that can hardly be meant, by field and value, and of what would be usual."""
    sentences: dict[str, list[str]] = {}
    for number, caster in enumerate(robot.casters, start=1):
        for doubt in _caster_doubts(caster, robot):
            sentences.setdefault(_sentence(doubt), []).append(str(number))
    said = [*map(_sentence, _platform_doubts(robot)), *_crowding(robot)]
    for sentence, numbers in sentences.items():
        said.append(f"caster{'s' * (len(numbers) > 1)} {', '.join(numbers)}: {sentence}")
    if said:
        units = "the numbers are in m, kg, kg m², N m and rad/s"
        warnings.warn(
            f"robot {cut(robot.name)!r} can hardly be meant so ({units}): {'; '.join(said)}", RobotWarning, stacklevel=2
        )


def _crowding(robot: "Robot") -> Iterator[str]:
    """Sentences about more casters than anybody builds, and about casters whose wheels collide when they line up."""
    if robot.caster_count > _MOST_CASTERS:
        yield f"it has {robot.caster_count} casters; usual are 3 … 6"
    close = []
    for (i, one), (j, other) in combinations(enumerate(robot.casters, start=1), 2):
        apart, need = hypot(one.x - other.x, one.y - other.y), one.radius + other.radius
        if apart < need:
            close.append(f"casters {i} and {j} stand {apart:.2g} m apart, where their wheels need {need:.2g} m in line")
    yield from close[:_SHOWN]
    if len(close) > _SHOWN:
        yield f"so do {len(close) - _SHOWN} more pairs"


def _sentence(doubt: _Doubt) -> str:
    return f"{doubt.field!r} is {doubt.value:g}{doubt.unit and ' '}{doubt.unit}, {doubt.usual}"


def _outside(field: str, value: float, unit: str, low: float, high: float, usual: str) -> Iterator[_Doubt]:
    """A doubt about a value that does not lie between two bounds."""
    if not low <= value <= high:
        yield _Doubt(field, value, unit, usual)


def _platform_doubts(robot: "Robot") -> Iterator[_Doubt]:
    platform, reach, area = robot.platform, robot.platform.footprint.outline.reach, robot.platform.footprint.area
    yield from _outside("platform.footprint", reach, "m from C", 0.01, 10.0, "usual are 0.1 … 1")
    per_area = platform.mass / area
    yield from _outside(
        "platform.mass",
        platform.mass,
        "kg",
        1.0 * area,
        5000.0 * area,
        f"{per_area:.2g} kg per m² of its outline; usual are 20 … 1000",
    )
    gyration = (platform.inertia / platform.mass) ** 0.5
    yield from _outside(
        "platform.inertia",
        platform.inertia,
        "kg m²",
        platform.mass * (0.1 * reach) ** 2,
        platform.mass * (1.5 * reach) ** 2,
        f"a radius of gyration of {gyration:.2g} m where the outline reaches {reach:.2g} m; usual are 0.3 … 0.8 of "
        f"that, here {platform.mass * (0.3 * reach) ** 2:.2g} … {platform.mass * (0.8 * reach) ** 2:.2g} kg m²",
    )
    away = float((platform.com[0] ** 2 + platform.com[1] ** 2) ** 0.5)
    yield from _outside("platform.com", away, "m from C", 0.0, reach, f"outside of the outline of {reach:.2g} m")
    tall = f"where the outline reaches {reach:.2g} m from C; usual are 0.3 … 2 of that"
    yield from _outside("platform.height", platform.height, "m", 0.0, 10.0 * reach, tall)
    if any(motor.coulomb > 0.0 for motor in robot.motors):
        slowest = min(motor.max_speed for motor in robot.motors)
        yield from _outside(
            "coulomb_speed",
            robot.coulomb_speed,
            "rad/s",
            0.0,
            0.5 * slowest,
            f"where a motor turns at {slowest:g} rad/s at most, so that its dry friction hardly acts; usual are "
            "0.005 … 0.1",
        )
    yield from _outside("floor_friction", robot.floor_friction, "", 0.02, 5.0, "usual are 0.3 … 1.2")


def _caster_doubts(caster: "Caster", robot: "Robot") -> Iterator[_Doubt]:
    reach, mass = robot.platform.footprint.outline.reach, robot.platform.mass
    size = f"where the platform's outline reaches {reach:.2g} m from C"
    away = float((caster.x**2 + caster.y**2) ** 0.5)
    yield from _outside("x, y", away, "m from C", 0.0, 2.0 * reach, size)
    yield from _outside("radius", caster.radius, "m", 0.01 * reach, reach, f"{size}; usual are 0.1 … 0.3 of that")
    yield from _outside("trail", caster.trail, "m", 1e-3 * reach, reach, f"{size}; usual are 0.05 … 0.3 of that")
    yield from _outside("offset", caster.offset, "m", -reach, reach, size)
    behind = float((caster.link.com[0] ** 2 + caster.link.com[1] ** 2) ** 0.5)
    yield from _outside("link.com", behind, "m from its steering axis", 0.0, reach, size)
    yield from _mass_doubts(caster, mass)
    yield from _motor_doubts(caster, robot)


def _mass_doubts(caster: "Caster", platform: float) -> Iterator[_Doubt]:
    """Masses and inertias; a body without any of them is a model's choice."""
    wheel, link, radius = caster.wheel, caster.link, caster.radius
    if wheel.mass > 0.0:
        # wide above: some files count rotors and gears among the wheel
        ball, square = _STEEL_BALL * radius**3, wheel.mass * radius**2
        yield from _outside(
            "wheel.mass",
            wheel.mass,
            "kg",
            5e-4 * ball,
            max(5.0 * ball, 0.5 * platform),
            f"where a ball of steel of its radius has {ball:.2g} kg and the platform {platform:g} kg",
        )
        usual = f"where mass · radius² is {square:.2g} kg m²; usual are"
        yield from _outside(
            "wheel.spin_inertia",
            wheel.spin_inertia,
            "kg m²",
            0.02 * square,
            12.0 * square,
            f"{usual} 0.5 … 0.8 of that",
        )
        yield from _outside(
            "wheel.yaw_inertia", wheel.yaw_inertia, "kg m²", 0.01 * square, 8.0 * square, f"{usual} 0.25 … 0.5 of that"
        )
    yield from _outside("link.mass", link.mass, "kg", 0.0, 2.0 * platform, f"where the platform has {platform:g} kg")
    if link.mass > 0.0:
        size = max(caster.trail, radius, abs(caster.offset), abs(link.com[0]), abs(link.com[1]))
        high = link.mass * (4.0 * size) ** 2
        gyration = (link.inertia / link.mass) ** 0.5
        yield from _outside(
            "link.inertia",
            link.inertia,
            "kg m²",
            link.mass * (0.01 * size) ** 2,
            high,
            f"a radius of gyration of {gyration:.2g} m; usual is about that of trail or wheel, {size:.2g} m",
        )


def _motor_doubts(caster: "Caster", robot: "Robot") -> Iterator[_Doubt]:
    whole = robot.platform.mass + sum(one.wheel.mass + one.link.mass for one in robot.casters)
    yield from _outside(
        "roll.max_speed",
        caster.roll.max_speed,
        "rad/s",
        1e-3 * caster.roll.max_speed / caster.top_speed,
        20.0 * caster.roll.max_speed / caster.top_speed,
        f"which rolls at {caster.top_speed:.3g} m/s; usual are 0.3 … 5 m/s",
    )
    yield from _outside("steer.max_speed", caster.steer.max_speed, "rad/s", 0.05, 1000.0, "usual are 5 … 100 rad/s")
    (roll, roll_steer), (steer_roll, steer) = caster.gear
    joints = (
        ("roll", caster.roll, caster.radius, max(abs(roll), abs(steer_roll)), (1e-3, 500.0), 50.0),
        ("steer", caster.steer, caster.trail, max(abs(steer), abs(roll_steer)), (1e-3, 5000.0), 200.0),
    )
    for name, motor, arm, ratio, (slow, fast), heavy in joints:
        push = motor.max_torque * ratio / arm / whole  # [m/s²]
        yield from _outside(
            f"{name}.max_torque",
            motor.max_torque,
            "N m",
            slow * motor.max_torque / push,
            fast * motor.max_torque / push,
            f"which alone accelerates the robot by {push:.2g} m/s²; usual are 0.2 … 20 m/s²",
        )
        seems = motor.armature / arm**2
        usual = f"which seems to weigh {seems:.2g} kg on the floor, the robot {whole:.2g} kg"
        yield from _outside(f"{name}.armature", motor.armature, "kg m²", 0.0, heavy * whole * arm**2, usual)
        seems = motor.rotor * ratio**2 / arm**2
        usual = (
            f"which through a gear of {ratio:.3g} seems to weigh {seems:.2g} kg on the floor, the robot {whole:.2g} kg"
        )
        yield from _outside(f"{name}.rotor", motor.rotor, "kg m²", 0.0, heavy * whole * arm**2 / ratio**2, usual)
        yield from _friction_doubts(name, motor, ratio)
    grip = _GRAVITY * whole * caster.radius
    yield from _outside(
        "scrub",
        caster.scrub,
        "N m s/rad",
        0.0,
        10.0 * grip / caster.steer.max_speed,
        f"{caster.scrub * caster.steer.max_speed:.2g} N m at the top speed of steering, more than the robot's weight "
        "can hold; usual are 0.001 … 0.2",
    )


def _friction_doubts(name: str, motor: "Motor", ratio: float) -> Iterator[_Doubt]:
    """Friction that the motor cannot overcome."""
    torque = motor.max_torque * ratio
    usual = f"where the motor has {torque:.2g} N m at the joint; usual are 0.01 … 0.2 of that"
    yield from _outside(f"{name}.coulomb", motor.coulomb, "N m", 0.0, torque, usual)
    lost = motor.viscous * motor.max_speed / ratio
    yield from _outside(
        f"{name}.viscous",
        motor.viscous,
        "N m s/rad",
        0.0,
        10.0 * torque * ratio / motor.max_speed,
        f"{lost:.2g} N m at top speed {usual}",
    )
