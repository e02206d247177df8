"""A robot as a model for MuJoCo (MJCF): rigid bodies, spheres for wheels, rolling by contact friction.

MuJoCo knows nothing of casters: it holds the bodies together by joints and the wheels on the floor by friction, which
its solver softens over a few time steps. So it slips a little, and less with every smaller time step; the limit is
rolling without slip, the equations of caster_gym.

The platform slides in x, y and z and turns about the vertical: it cannot tip, the slide in z lets its weight press the
wheels on the floor; with `tips` it moves freely, its mass centre at its height, and can tip. Armature, damping and dry
friction sit at the joints, as in the robot's file. MuJoCo's dry friction holds a joint that caster_gym lets creep: a
comment in the model says how fast. A motor that turns one joint alone acts on that joint, and its rotor is part of the
joint's armature; a motor that the gear of its caster couples to both joints acts on a tendon whose length is what the
motor has turned, and whose armature is its rotor, driven or not. docs/export.md tells which of this other readers of
MJCF take.
"""

import math
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from caster_gym.mechanics.parameters import GRAVITY
from caster_gym.robot import Caster, Footprint, Robot

FRICTION = 5.0  # [-] more than any floor has, so that no wheel breaks away
FRICTION_STIFFNESS = 100.0  # [-] of friction over that of the normal force: less creep under load
CONTACT_STEPS = 2.0  # time constant of the contact in time steps, the stiffest that MuJoCo accepts
DRAWN_HEIGHT = 0.05  # [m] of the platform, which has none in the robot's file
_KINDS = ("roll", "steer")  # of the joints and motors of a caster
_AXES = ("1 0 0", "0 1 0", "0 0 1")
_TURNS = (("yaw", "0 0 1"), ("pitch", "0 1 0"), ("tilt", "1 0 0"))
_SEEN = 'contype="0" conaffinity="0" mass="0"'  # drawn only


def mjcf(robot: Robot, time_step: float, friction: float = FRICTION, tips: bool = False) -> str:
    """The robot as MJCF, with one motor for each joint of `robot.driven`, in that order.

    Motors take torques [N m] within their greatest; that these fall with speed is left to who drives them. time_step in
    s; friction between wheels and floor; tips: the platform is free, so that loads shift between the wheels as it
    accelerates. Raises ValueError for masses and inertias that no solid body can have.

    >>> import caster_gym
    >>> text = caster_gym.mjcf(caster_gym.load_robot("chung2008"), time_step=0.002)
    >>> text.count("<motor "), text.splitlines()[0]
    (6, '<mujoco model="chung2008">')
    """
    if not 0.0 < time_step < math.inf:
        raise ValueError(f"time_step must be positive and finite, got {time_step:g} s")
    if not 0.0 < friction < math.inf:
        raise ValueError(f"friction must be positive and finite, got {friction:g}")
    for number, caster in enumerate(robot.casters, start=1):
        _check_solid(number, caster)
    casters = "".join(_caster_body(number, caster) for number, caster in enumerate(robot.casters, start=1))
    tendons = "".join(_tendons(number, caster, robot.driven) for number, caster in enumerate(robot.casters, start=1))
    motors = "".join(_motors(number, caster, robot.driven) for number, caster in enumerate(robot.casters, start=1))
    p = robot.platform
    top = max(caster.radius for caster in robot.casters) + DRAWN_HEIGHT
    asset, outline = _outline(p.footprint, top)
    notes = _what_belongs_together(time_step, friction) + _note_on_dry_friction(robot)
    return f"""<mujoco model={quoteattr(robot.name)}>{notes}
  <compiler angle="radian" autolimits="true"/>
  <option timestep="{_numbers(time_step)}" integrator="implicitfast" cone="elliptic"
          impratio="{_numbers(FRICTION_STIFFNESS)}"
          solver="Newton" tolerance="1e-14" iterations="100" gravity="0 0 {_numbers(-GRAVITY)}"/>
  <default>
    <geom condim="3" friction="{_numbers(friction)} 0 0" solref="{_numbers(CONTACT_STEPS * time_step)} 1"/>
  </default>{asset}
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="0 0 1" contype="1" conaffinity="2" rgba="0.95 0.95 0.96 1"/>
    <body name="platform">
      {_platform_joints(tips)}
      {_inertial(p.mass, (*p.com, p.height if tips else 0.0), (p.inertia, p.inertia, p.inertia))}
      {outline}{casters}
    </body>
  </worldbody>{
        tendons
        and f'''
  <tendon>{tendons}
  </tendon>'''
    }
  <actuator>{motors}
  </actuator>
</mujoco>
"""


def _platform_joints(tips: bool) -> str:
    """How the platform moves: x, y, z and yaw, and with `tips` about its own y-axis and x-axis, in that order."""
    slides = [f'<joint name="{name}" type="slide" axis="{axis}"/>' for name, axis in zip("xyz", _AXES, strict=True)]
    hinges = [f'<joint name="{name}" type="hinge" axis="{axis}"/>' for name, axis in _TURNS[: 3 if tips else 1]]
    return "\n      ".join([*slides, *hinges])


def _what_belongs_together(time_step: float, friction: float) -> str:
    """A comment for whoever puts the model into a scene or changes a number of it."""
    return f"""
  <!-- What belongs together:
       - friction {friction:g} needs the elliptic cone. A scene that this model is attached to keeps its own cone, by
         default the pyramidal one, into which wheels sink the deeper the greater the friction; at friction 1 both
         cones carry alike. Give the scene cone="elliptic" and impratio="{FRICTION_STIFFNESS:g}", or write this model
         with friction 1.
       - solref is {CONTACT_STEPS:g} time steps of {time_step:g} s. Write the model anew for another timestep. -->"""


def _note_on_dry_friction(robot: Robot) -> str:
    """A comment on what MuJoCo does otherwise, for a robot with dry friction."""
    if not any(motor.coulomb for motor in robot.motors):
        return ""
    creep = 1e3 * robot.coulomb_speed * max(caster.radius for caster in robot.casters) / 3.0**0.5
    return f"""
  <!-- frictionloss holds a joint below its breakaway torque. In caster_gym dry friction passes smoothly through zero,
       and half of that torque lets wheels creep at {creep:.2g} mm/s; a smaller coulomb_speed in the robot's file than
       {robot.coulomb_speed:g} rad/s makes that less, with shorter time steps. -->"""


def _outline(footprint: Footprint, top: float) -> tuple[str, str]:
    """The platform to be seen: an asset, if it needs one, and its shape."""
    look = f'{_SEEN} rgba="0.2 0.36 0.55 0.5"'
    if footprint.disc is not None:
        size = _numbers(footprint.disc, 0.5 * DRAWN_HEIGHT)
        return "", f'<geom type="cylinder" size="{size}" pos="0 0 {_numbers(top)}" {look}/>'
    corners = footprint.polygon or ()
    low, high = top - 0.5 * DRAWN_HEIGHT, top + 0.5 * DRAWN_HEIGHT
    vertices = " ".join(_numbers(x, y, z) for z in (low, high) for x, y in corners)
    n = len(corners)
    around = [(i, (i + 1) % n) for i in range(n)]
    triangles = [(0, i + 1, i) for i in range(1, n - 1)] + [(n, n + i, n + i + 1) for i in range(1, n - 1)]
    triangles += [corner for a, b in around for corner in ((a, b, n + b), (a, n + b, n + a))]
    faces = " ".join(str(corner) for triangle in triangles for corner in triangle)  # seen from outside: to the left
    asset = f'\n  <asset><mesh name="platform" inertia="shell" vertex="{vertices}" face="{faces}"/></asset>'
    return asset, f'<geom type="mesh" mesh="platform" {look}/>'


def _caster_body(number: int, caster: Caster) -> str:
    """Steering link and wheel; the link's x-axis is the rolling direction, its origin the pivot at wheel height."""
    link, wheel, (behind, left) = caster.link, caster.wheel, caster.link.com
    centre = _numbers(-caster.trail, caster.offset, 0.0)
    width = _numbers(caster.radius, 0.2 * caster.radius)
    return f"""
      <body name="link_{number}" pos="{_numbers(caster.x, caster.y, caster.radius)}">
        {_hinge(f"steer_{number}", "0 0 1", caster, 1)}
        {_inertial(link.mass, (-behind, left, 0.0), (link.inertia, link.inertia, link.inertia))}
        <geom type="capsule" fromto="0 0 0 {centre}" size="{_numbers(0.15 * caster.radius)}" {_SEEN}/>
        <body name="wheel_{number}" pos="{centre}">
          {_hinge(f"roll_{number}", "0 1 0", caster, 0)}
          {_inertial(wheel.mass, (0.0, 0.0, 0.0), (wheel.yaw_inertia, wheel.spin_inertia, wheel.yaw_inertia))}
          <geom type="sphere" size="{_numbers(caster.radius)}" contype="2" conaffinity="1" group="3"/>
          <geom type="cylinder" size="{width}" euler="1.5707963267948966 0 0" rgba="0.15 0.17 0.2 1" {_SEEN}/>
        </body>
      </body>"""


def _hinge(name: str, axis: str, caster: Caster, joint: int) -> str:
    """The rolling joint, 0, or the steering joint, 1, with the rotors of motors that turn it alone."""
    motor = caster.motors[joint]
    alone = (
        one.rotor * ratios[joint] ** 2
        for one, ratios in zip(caster.motors, caster.gear, strict=True)
        if ratios[joint] and not ratios[1 - joint]
    )
    armature = _numbers(motor.armature + sum(alone))
    friction = f'damping="{_numbers(motor.viscous)}" frictionloss="{_numbers(motor.coulomb)}"'
    return f'<joint name="{name}" type="hinge" axis="{axis}" armature="{armature}" {friction}/>'


def _inertial(mass: float, position: Sequence[float], diagonal: Sequence[float]) -> str:
    return f'<inertial mass="{_numbers(mass)}" pos="{_numbers(*position)}" diaginertia="{_numbers(*diagonal)}"/>'


def _tendons(number: int, caster: Caster, driven: Sequence[str]) -> str:
    """What each motor of both joints has turned, if it is driven or has a rotor; with scrub also the wheel's yaw over
    ground, that of platform and steering."""
    turned = ""
    for kind, motor, (roll, steer) in zip(_KINDS, caster.motors, caster.gear, strict=True):
        if roll and steer and (motor.rotor or f"{kind}_{number}" in driven):
            rotor = f' armature="{_numbers(motor.rotor)}"' if motor.rotor else ""
            turned += (
                f'\n    <fixed name="motor_{kind}_{number}"{rotor}>'
                f'<joint joint="roll_{number}" coef="{_numbers(roll)}"/>'
                f'<joint joint="steer_{number}" coef="{_numbers(steer)}"/></fixed>'
            )
    if not caster.scrub:
        return turned
    joints = f'<joint joint="yaw" coef="1"/><joint joint="steer_{number}" coef="1"/>'
    return f'{turned}\n    <fixed name="yaw_{number}" damping="{_numbers(caster.scrub)}">{joints}</fixed>'


def _motors(number: int, caster: Caster, driven: Sequence[str]) -> str:
    """The driven motors of a caster, each on the joint that it turns or, if it turns both, on its tendon."""
    motors = ""
    for kind, motor, ratios in zip(_KINDS, caster.motors, caster.gear, strict=True):
        name, span = f"{kind}_{number}", _numbers(-motor.max_torque, motor.max_torque)
        if name not in driven:
            continue
        turned = [(joint, ratio) for joint, ratio in zip(_KINDS, ratios, strict=True) if ratio]
        if len(turned) == 1:
            (joint, ratio), *_ = turned
            gear = "" if ratio == 1.0 else f' gear="{_numbers(ratio)}"'
            place = f'joint="{joint}_{number}"{gear}'
        else:
            place = f'tendon="motor_{name}"'
        motors += f'\n    <motor name="{name}" {place} ctrllimited="true" ctrlrange="{span}"/>'
    return motors


def _check_solid(number: int, caster: Caster) -> None:
    """Refuse what MuJoCo would: bodies without mass, and a wheel flatter than a disc."""
    wheel, link = caster.wheel, caster.link
    for name, value in (("wheel.mass", wheel.mass), ("wheel.yaw_inertia", wheel.yaw_inertia), ("link.mass", link.mass)):
        if value <= 0.0:
            raise ValueError(f"caster {number}: {name} must be positive for a model of solid bodies, got {value:g}")
    if wheel.spin_inertia > 2.0 * wheel.yaw_inertia * (1.0 + 1e-9):
        raise ValueError(
            f"caster {number}: a solid wheel has a spin_inertia of at most twice its yaw_inertia, "
            f"got {wheel.spin_inertia:g} and {wheel.yaw_inertia:g} kg m²"
        )


def _numbers(*values: float) -> str:
    return " ".join(f"{value:.17g}" for value in values)
