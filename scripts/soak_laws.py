"""What must hold of robots at every instant, whatever they do: finite, inside, and no energy from nowhere."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from caster_gym.arena.arena import read_arena
from caster_gym.arrays import Array, Flags
from caster_gym.envs.native.engine import TaskEngine
from caster_gym.mechanics.contact_impulses import RESTING, SETTLED
from caster_gym.mechanics.dynamics import kinetic_energy
from caster_gym.mechanics.free_casters import slip_energy
from caster_gym.mechanics.grip_or_slip import own_joint_rates
from caster_gym.mechanics.integration import State, unpack_state
from caster_gym.mechanics.motors import motor_speeds
from caster_gym.mechanics.parameters import unpack_parameters
from caster_gym.mechanics.slip_state import rolling_state, unpack_slip_state
from scripts.soak_scenes import Leg

DEEPEST = 1e-4  # [m] that a robot may sink into an obstacle: five times what one segment of a time step may add
STILL = 1e-9  # [J] smaller energies are those of robots at rest
EXPLAINED = 1e-9  # [-] share of an energy that rounding may add: some hundred products, each exact to 1e-16


def not_finite(name: str, value: Any) -> Iterator[str]:
    """Names of numbers that are not finite, anywhere in what an environment returns."""
    if isinstance(value, Mapping):
        for key, part in value.items():
            yield from not_finite(f"{name}[{key!r}]", part)
    elif isinstance(value, np.ndarray) and value.dtype == object:
        for part in value:
            yield from not_finite(name, part)
    elif value is not None and not np.isfinite(value).all():
        yield name


class Inside:
    """Gaps between robots and the walls of their room, worked out anew from poses and the footprint alone."""

    def __init__(self, leg: Leg, engine: TaskEngine) -> None:
        room = read_arena(leg.settings["arena"]).room
        assert room is not None
        self.low, self.high = np.array(room)
        outline = engine.robot.platform.footprint.outline
        self.corners, self.radius = np.array(outline.corners), outline.radius

    def least_gaps(self, pose: Array) -> Array:
        """Of robots (robots,) at poses (robots, 4): x, y, cos β, sin β. [m]"""
        x, y, c, s = (pose[:, i, None] for i in range(4))
        px, py = self.corners.T
        place = np.stack((x + c * px - s * py, y + s * px + c * py))
        low, high = self.low[:, None, None], self.high[:, None, None]
        gaps: Array = np.minimum(place - low, high - place).min(axis=(0, 2)) - self.radius
        return gaps

    def has_centre(self, pose: Array) -> Flags:
        """Whose point C is between the walls (robots,)."""
        inside: Flags = ((pose[:, :2] > self.low) & (pose[:, :2] < self.high)).all(axis=1)
        return inside


class Energy:
    """Kinetic energy of robots, and how far it rises beyond the work that was done on them.

    Floor, friction and impacts only take energy, so that K₁ − K₀ ≤ A + W in each control period, with A the work of the
    motors and W that of a push. The environment tells A by the trapezoidal rule, time step h by time step: where a
    motor's speed changes steadily by Δ while its torque τ is held, that misses ½ τ |Δ| h at most. W is told here by the
    same rule over the whole period T, which misses ½ |F| |Δv| T. Impulses J of contacts are found to SETTLED, so that
    they may work at speeds as small, by (1 + μ) J SETTLED in normal and tangential direction; of robots that are held
    against a wall, that is all the energy there is. These three are the slack. All that robots can ever have is thus
    what motors and pushes gave them in their episode.

    Robots that lie against something bounce within a time step, to and fro at less than RESTING: what the speeds at its
    ends tell of the work between may be wrong altogether. Theirs counts as any up to ½ τ (|ω₀| + |ω₁|) T.
    """

    def __init__(self, engine: TaskEngine, time_step: float, friction: float) -> None:
        self.engine, self.time_step = engine, time_step
        outline = engine.robot.platform.footprint.outline
        self.radius = float(np.hypot(*np.array(outline.corners).T).max()) + outline.radius  # [m] about C
        self.contact = (1.0 + friction) * SETTLED  # [m/s] at which a normal impulse may work
        self.look()

    def look(self) -> None:
        """See where all robots are, and of what kind, after some have been placed anew."""
        self.read_parameters()
        self._store(self._state())

    def read_parameters(self) -> None:
        """See of what kind robots are, once some have started an episode."""
        self.robot = unpack_parameters(tuple(self.engine.parameters.T.copy()))
        self.torques = np.array([(one.roll_max_torque, one.steer_max_torque) for one in self.robot.casters])

    def excess(self, power: Array, impulse: Array) -> Array:
        """How far each robot's energy rose beyond work and slack in the period that has passed, as a share of it. [-]

        power: mean of the motors [W] (robots,). impulse: of all contacts, normal to them [N s] (robots,). The share is
        below zero where the law holds.
        """
        before, kinetic, speeds = self.state, self.kinetic, self.speeds
        after = self._state()
        self._store(after)
        period, wrench = self.engine.control_period, self.engine.wrenches.T
        v0, v1 = np.array(before.twist), np.array(after.twist)
        work = period * (power + 0.5 * (wrench * (v0 + v1)).sum(axis=0))
        slack = 0.5 * self.time_step * (self.torques * abs(self.speeds - speeds)).sum(axis=(0, 1))
        slack = slack + 0.5 * period * (abs(wrench) * abs(v1 - v0)).sum(axis=0)
        slack = slack + self.contact * impulse
        lying = (impulse > 0.0) & self._is_slow(before) & self._is_slow(after)
        told = 0.5 * period * (self.torques * (abs(speeds) + abs(self.speeds))).sum(axis=(0, 1))
        slack = slack + np.where(lying, told, 0.0)
        size = kinetic + self.kinetic + abs(work)
        share: Array = (self.kinetic - kinetic - work - slack) / np.maximum(size, STILL)
        return share

    def _is_slow(self, state: State) -> Flags:
        """Whose platform moves slower than RESTING everywhere."""
        vx, vy, omega = np.array(state.twist)
        slow: Flags = np.hypot(vx, vy) + self.radius * abs(omega) < RESTING
        return slow

    def _store(self, state: State) -> None:
        self.state, self.kinetic = state, self._kinetic(state)
        rates = zip(state.rates, self.robot.casters, strict=True)
        self.speeds = np.array([motor_speeds(own_joint_rates(state.twist[2], one), caster) for one, caster in rates])

    def _state(self) -> State:
        flat = tuple(self.engine.states.T.copy())
        return unpack_slip_state(flat) if self.engine.slipping else rolling_state(unpack_state(flat), self.robot)

    def _kinetic(self, state: State) -> Array:
        if self.engine.slipping:
            energy: Array = slip_energy(state.twist, state.directions, state.rates, self.robot)
        else:
            energy = kinetic_energy(state.twist, state.directions, self.robot)
        return energy
