"""The mechanics on NumPy arrays."""

import operator
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.engines.model_inputs import ModelInputs, Numbers
from caster_gym.engines.time_step import check_rows, check_time_step
from caster_gym.floor import Floor, FloorLike, load_floor
from caster_gym.mechanics import actuation, caster, dynamics, ground, impulse
from caster_gym.mechanics.contact import guarded_step
from caster_gym.mechanics.floor import FloorTable, check_floor, floor_table, on_floor, surface_under
from caster_gym.mechanics.grip_or_slip import free_step
from caster_gym.mechanics.impulse import ImpactLaw
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import Dynamics, RobotParameters, pack_parameters, robot_parameters
from caster_gym.mechanics.scalars import each, flatten, pairs
from caster_gym.mechanics.separation import Hull, Obstacles, Surroundings
from caster_gym.mechanics.slip_state import rolling_state
from caster_gym.robot import Robot, check_joints

ROUGHEST = 1e6  # [-] between hull and obstacles: a contact sticks long before


class RobotModel(ModelInputs[Numbers]):
    """The mechanics of a robot on any kind of arrays, as `Model` describes them."""

    def __init__(self, robot: Robot, dynamics: Dynamics = "exact", parameters: RobotParameters | None = None) -> None:
        if not isinstance(robot, Robot):
            raise TypeError(f"robot must be a Robot, such as caster_gym.load_robot gives, got {robot!r}")
        self.robot = robot
        self.dynamics = dynamics
        self._parameters = robot_parameters(robot, dynamics) if parameters is None else parameters
        self._rows = None if parameters is None else self._replaced(parameters)  # (robots, fields)

    def rates(self, steering: ArrayLike, twist: ArrayLike) -> tuple[Numbers, Numbers, Numbers]:
        """Yaw rates over ground η̇, rolling rates θ̇, steering rates δ̇, each (..., N). [rad/s]"""
        directions, v = self._directions(steering), self._vector("twist", twist)
        eta, theta, delta = zip(*each(caster.rates, (v,), directions, self._parameters.casters), strict=True)
        return self._stack(eta), self._stack(theta), self._stack(delta)

    def jacobian(self, steering: ArrayLike, joints: str | Sequence[str] = "all") -> Numbers:
        """Rows (..., J, 3) that give the rates of the named joints from the twist; joints in the order given."""
        directions = self._directions(steering)
        listed = (joints,) if isinstance(joints, str) else tuple(joints)
        names = self.robot.joints if joints == "all" else check_joints(listed, self.robot.caster_count)
        rows = each(caster.rate_rows, (), directions, self._parameters.casters)
        chosen = [rows[j // 2][1 + j % 2] for j in map(self.robot.joints.index, names)]
        return self._stack([self._stack(row) for row in chosen], -2)

    def inertia(self, steering: ArrayLike) -> Numbers:
        """Inertia matrix M (..., 3, 3) of the whole robot at C, in B."""
        xx, xy, xz, yy, yz, zz = dynamics.inertia(self._directions(steering), self._parameters)
        rows = [self._stack(row) for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))]
        return self._stack(rows, -2)

    def bias(self, steering: ArrayLike, twist: ArrayLike) -> Numbers:
        """Coriolis and centrifugal force h (..., 3) at C, in B."""
        return self._stack(dynamics.bias(self._vector("twist", twist), self._directions(steering), self._parameters))

    def friction(self, steering: ArrayLike, twist: ArrayLike) -> Numbers:
        """Friction of joints and contact patches (..., 3) at C, in B, as the force that overcomes it."""
        return self._stack(
            dynamics.resistance(self._vector("twist", twist), self._directions(steering), self._parameters)
        )

    def forward_dynamics(
        self, steering: ArrayLike, twist: ArrayLike, torque: ArrayLike, wrench: ArrayLike | None = None
    ) -> Numbers:
        """Twist rate (..., 3): derivative of the components of the twist in B. wrench (..., 3) acts at C, in B."""
        directions, v = self._directions(steering), self._vector("twist", twist)
        force, torques = self._wrench(wrench), self._torques(torque)
        return self._stack(dynamics.forward_dynamics(v, directions, torques, force, self._parameters))

    def inverse_dynamics(self, steering: ArrayLike, twist: ArrayLike, twist_rate: ArrayLike) -> Numbers:
        """Generalised force (..., 3) at C, in B, that drives and wrench must supply together, friction included."""
        directions, v = self._directions(steering), self._vector("twist", twist)
        return self._stack(
            dynamics.inverse_dynamics(v, directions, self._vector("twist_rate", twist_rate), self._parameters)
        )

    def kinetic_energy(self, steering: ArrayLike, twist: ArrayLike) -> Numbers:
        """Kinetic energy (...) of all bodies. [J]"""
        directions, v = self._directions(steering), self._vector("twist", twist)
        return self._scalar(dynamics.kinetic_energy(v, directions, self._parameters))

    def ground_forces(
        self, steering: ArrayLike, twist: ArrayLike, torque: ArrayLike, wrench: ArrayLike | None = None
    ) -> Numbers:
        """Forces (..., N, 2) of the floor on each wheel along f and f⊥. [N]

        Under joint torques and all else that pushes the robot: wrench (..., 3) at C, in B.
        """
        directions, v, torques = self._directions(steering), self._vector("twist", twist), self._torques(torque)
        v_rate = dynamics.forward_dynamics(v, directions, torques, self._wrench(wrench), self._parameters)
        shared = v, v_rate, self._parameters.platform.coulomb_speed
        forces = each(ground.ground_force, shared, directions, self._parameters.casters, torques)
        return self._stack([self._stack(force) for force in forces], -2)

    def wheel_loads(
        self,
        steering: ArrayLike,
        twist: ArrayLike | None = None,
        torque: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> Numbers:
        """Normal forces (..., N) under the wheels: at rest, or of a robot that moves under torques and a wrench. [N]

        The wrench (..., 3) at C, in B, acts at the height of the platform's mass centre. A wheel that lifts has no
        load; a negative load says that the robot tips over.
        """
        directions = self._directions(steering)
        if twist is None and torque is None and wrench is None:
            return self._stack(ground.wheel_loads(directions, (0.0, 0.0), self._parameters))
        v = (0.0, 0.0, 0.0) if twist is None else self._vector("twist", twist)
        none = ((0.0, 0.0),) * self.robot.caster_count
        torques, force = none if torque is None else self._torques(torque), self._wrench(wrench)
        v_rate = dynamics.forward_dynamics(v, directions, torques, force, self._parameters)
        tilted = ground.tilt(v, v_rate, directions, force, self._parameters)
        return self._stack(ground.wheel_loads(directions, tilted, self._parameters))

    @property
    def characteristic_length(self) -> float:
        """Length that makes moments comparable with forces: root mean square distance of the pivots from C. [m]"""
        return float(actuation.characteristic_length(self._parameters))

    def motor_wrenches(self, steering: ArrayLike) -> Numbers:
        """Wrenches (..., 3, driven) at C, in B, of the driven motors, each at its greatest torque. [N, N, N m]"""
        wrenches = flatten(each(actuation.motor_wrenches, (), self._directions(steering), self._parameters.casters))
        return self._stack([self._stack(wrenches[j]) for j in self.robot.driven_indices])

    def conditioning(self, steering: ArrayLike) -> Numbers:
        """σ_min / σ_max (...) of the wrenches of the driven motors; 0 where they cannot push the robot somewhere."""
        return self._scalar(actuation.conditioning(self._directions(steering), self._parameters))

    def collide(
        self,
        steering: ArrayLike,
        twist: ArrayLike,
        point: ArrayLike,
        normal: ArrayLike,
        restitution: ArrayLike,
        friction: ArrayLike = 0.0,
        law: ImpactLaw = "stronge",
    ) -> tuple[Numbers, Numbers]:
        """Impulse (..., 2), normal and tangential [N s], and the twist (..., 3) after an impact.

        point (..., 2) [m] and normal (..., 2), a unit vector from the obstacle into the robot, in B. The tangent is
        the normal turned by +90°. Nothing happens at a contact that separates. law: "stronge" integrates along the
        impulse, with restitution of energy; "chatterjee_ruina" is algebraic, with restitution of velocity. Without
        friction both are the same.
        """
        if law not in impulse.LAWS:
            raise ValueError(f"law must be one of {', '.join(impulse.LAWS)}, got {law!r}")
        p, n = self._components("point", point, 2), self._components("normal", normal, 2)
        length = n[0] * n[0] + n[1] * n[1]
        wrong = abs(length - 1.0) > 1e-6
        if bool(wrong.any()):
            raise ValueError(f"normal must be a unit vector, got a length of {float(length[wrong][0]) ** 0.5:g}")
        e = self._in_range("restitution", restitution, 0.0, 1.0)
        mu = self._in_range("friction", friction, 0.0, ROUGHEST)
        directions, v = self._directions(steering), self._vector("twist", twist)
        m = dynamics.inertia(directions, self._parameters)
        j_n, j_t, after = impulse.collide(v, m, p, n, e, mu, impulse.LAWS[law])
        return self._stack((j_n, j_t)), self._stack(after)

    def simulate(
        self,
        state: ArrayLike,
        torque: ArrayLike,
        dt: float,
        steps: int,
        around: Surroundings | None = None,
        *,
        floor: FloorLike = None,
        checked: bool = False,
    ) -> Numbers:
        """States (steps + 1, ..., 6 + N) from the given one on, by RK4 under joint torques.

        torque (..., 2 N) is constant, or (steps, ..., 2 N), one axis more than state, changes from step to step.
        around: obstacles, from `caster_gym.arena.packing.surroundings`, off which the robot bounces.
        floor: one of finite friction, on which wheels may slip, as the environments take it: a `caster_gym.floor.Floor`
        or a mapping. States are then (steps + 1, ..., 6 + 3 N), with η̇ and θ̇ of each caster [rad/s] behind
        the steering; a state (..., 6 + N) starts rolling. Loads start as at rest.
        Angles are continuous in time. Raises ValueError if dt [s] cannot follow the robot, be it of its own numbers or
        of plain ones given in their place; not if the caller has `checked`, or looks for states that are not finite.
        """
        if not checked:
            self._check_time_step(dt)
        steps = operator.index(steps)
        if steps < 0:
            raise ValueError(f"steps must be 0 or more, got {steps}")
        below, n = load_floor(floor), self.robot.caster_count
        parameters = self._on(below)
        with_rates = self._with_rates(state, below is not None)
        x, y, beta, *others = self._components("state", state, 6 + (3 * n if with_rates else n))
        twist, steering, rates = (others[0], others[1], others[2]), others[3 : 3 + n], pairs(tuple(others[3 + n :]))
        torques = self._array("torque", torque, 2 * self.robot.caster_count)
        changing = torques.ndim > x.ndim + 1
        if changing and len(torques) != steps:
            raise ValueError(f"torque must hold {steps} steps along its first axis, got {len(torques)}")
        now = State((x, y), self._unit(beta), twist, tuple(self._unit(angle) for angle in steering))
        if below is not None:
            rolling = rolling_state(now, parameters)
            now = rolling._replace(rates=rates) if with_rates else rolling
        table = None if below is None else floor_table(below)
        angles = [beta, *steering]
        states = [self._stack((x, y, beta, *twist, *steering, *flatten(now.rates)))]
        for step in range(steps):
            given = self._torques(torques[step] if changing else torques)
            now = self._step(now, given, dt, around, parameters, table)
            angles = [self._follow(a, f) for a, f in zip(angles, (now.heading, *now.directions), strict=True)]
            states.append(self._stack((*now.position, angles[0], *now.twist, *angles[1:], *flatten(now.rates))))
        return self._stack(states, 0)

    def _with_rates(self, state: Any, slippery: bool) -> bool:
        """Whether states hold rates of the casters, as those on a floor of finite friction may."""
        shape, n = tuple(self._numbers("state", state).shape), self.robot.caster_count
        if shape[-1:] not in ((6 + n,), (6 + 3 * n,)):
            longer = f", or of {6 + 3 * n} with yaw and rolling rates of the {n} casters" if slippery else ""
            raise ValueError(f"state must have a last axis of {6 + n}{longer}, got shape {shape}")
        if shape[-1] == 6 + 3 * n and not slippery:
            raise ValueError(
                f"state must have a last axis of {6 + n}, got shape {shape}: {6 + 3 * n} numbers are a state on a "
                "floor of finite friction, such as floor={'friction': 0.7}"
            )
        return bool(shape[-1] == 6 + 3 * n)

    def _check_time_step(self, dt: float) -> None:
        if self._rows is None:
            check_time_step(self.robot, dt)
        else:
            check_rows(f"robots like {self.robot.name!r} whose numbers were replaced", self._rows, dt)

    def _on(self, floor: Floor | None) -> RobotParameters:
        """The numbers of the robot on a floor."""
        if floor is None:
            return self._parameters
        check_floor(self.robot, self.dynamics)
        return on_floor(self._parameters, floor)

    @staticmethod
    def _step(
        now: State,
        torques: tuple[tuple[Any, Any], ...],
        dt: float,
        around: Surroundings | None,
        robot: RobotParameters,
        floor: FloorTable | None,
    ) -> State:
        """The state after one step of dt seconds."""
        surface = surface_under(now, robot, floor)
        if around is None or len(around.obstacles.radii) == 0:
            return free_step(now, torques, (0.0, 0.0, 0.0), dt, robot, surface)
        hull, obstacles = Hull(*map(_listed_table, around.hull)), Obstacles(*map(_listed_table, around.obstacles))
        count = len(obstacles.radii)
        state, _ = guarded_step(now, torques, (0.0, 0.0, 0.0), dt, robot, hull, obstacles, 0, count, surface)
        return state

    def _replaced(self, parameters: RobotParameters) -> Array | None:
        columns = np.broadcast_arrays(*pack_parameters(parameters))
        return np.stack([np.ravel(column) for column in columns], axis=1)


class Model(RobotModel[Array]):
    """Kinematics, dynamics, ground forces and impacts of a robot, on arrays whose leading axes are a batch.

    steering (..., N): angles δ from the body x-axis to each rolling direction [rad]
    twist (..., 3): vx, vy, ω at C in the body frame [m/s, m/s, rad/s]
    torque (..., 2 N): at the joints roll_1, steer_1, roll_2, steer_2, … [N m]; given to every joint, driven or not
    state (..., 6 + N): x, y [m], β [rad] in the world, twist, steering

    dynamics="chung2008" leaves the term (D1) out of the bias, as that paper prints the model. parameters replaces the
    robot's own numbers, for instance by arrays with one value per robot of the batch.
    Source: docs/equations.md. Raises ValueError for arrays of the wrong last axis and for values that are not finite.

    >>> import caster_gym, numpy as np
    >>> model = caster_gym.Model(caster_gym.load_robot("chung2008"))
    >>> model.inertia([0.0, 0.0, 0.0]).diagonal().round(3)  # all wheels ahead [kg, kg, kg m²]
    array([7.55 , 5.421, 0.04 ])
    >>> states = model.simulate(np.zeros(9), [0.1, 0, 0.1, 0, 0.1, 0], dt=0.005, steps=200)
    >>> states.shape, states[-1, :3].round(3)  # 1 s later: x, y [m], β [rad]
    ((201, 9), array([0.795, 0.   , 0.   ]))
    """

    def _scalar(self, value: Any) -> Array:
        return np.asarray(value)

    def _stack(self, parts: Any, axis: int = -1) -> Array:
        return np.stack(np.broadcast_arrays(*parts), axis)


def _listed_table(part: Any) -> Any:
    """A table as lists of plain numbers, which every kind of scalar can be multiplied by."""
    return part.tolist() if isinstance(part, np.ndarray) else part
