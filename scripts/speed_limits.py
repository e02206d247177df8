"""What limits each engine, in words, with the numbers that were measured."""

import math
from typing import Any

from caster_gym import Robot
from caster_gym.mechanics.integration import rk4_step, unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import pairs, register
from caster_gym.report.pages import paragraph
from scripts.speed_accuracy import Accuracy
from scripts.speed_growth import line
from scripts.speed_peers import MUJOCO_STEP
from scripts.speed_robots import RK4_STEP, SUBSTEPS
from scripts.speed_timing import Ratio, Values, middle, shown


class Counted(float):
    """A number that counts what is done to it and to those that come out of it."""

    done = 0


def _counting(name: str) -> Any:
    plain = getattr(float, name)

    def operation(self: Counted, *other: float) -> Counted:
        Counted.done += 1
        return Counted(plain(self, *other))

    return operation


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv", "neg", "abs"):
    setattr(Counted, f"__{_name}__", _counting(f"__{_name}__"))
register(Counted, lambda condition, yes, no: yes if condition else no, math.sqrt, bool)  # neither is counted


def operations_of_a_step(robot: Robot) -> int:
    """Additions, subtractions, multiplications, divisions and changes of sign in one RK4 step."""
    n = robot.caster_count
    state = unpack_state(_counted((0.0, 0.0, 1.0, 0.0, 0.3, 0.2, 0.1, *(0.6, 0.8) * n)))
    torques = pairs(_counted((0.01,) * (2 * n)))
    parameters = _counted(robot_parameters(robot))
    Counted.done = 0
    rk4_step(state, torques, _counted((0.0, 0.0, 0.0)), Counted(RK4_STEP), parameters)
    return Counted.done


def _counted(tree: Any) -> Any:
    """The same tuples with numbers that count."""
    if isinstance(tree, tuple):
        items = [_counted(item) for item in tree]
        return type(tree)(*items) if hasattr(tree, "_fields") else tuple(items)
    return Counted(tree)


def limits_text(measured: Values, accuracy: Accuracy, operations: int) -> str:
    """A paragraph for each engine."""
    value = {key: middle(values) for key, values in measured.items() if values}
    parts = [
        _bare(measured, value["bare"], operations),
        _environment(measured),
        _alone(value),
        _mujoco(value["mujoco"], accuracy),
        _growth(measured),
    ]
    if measured.get("torch"):
        parts.append(_torch(measured))
    return "\n\n".join(paragraph(part) for part in parts)


def _over(measured: Values, over: str, under: str) -> float:
    """Median over the turns of one row over another."""
    return middle(Ratio("", over, under).values(measured))


def _bare(measured: Values, rate: float, operations: int) -> str:
    kept = 100.0 * _over(measured, "bare_periods", "bare_cores")
    return f"""**Bare equations: limited by arithmetic.** An RK4 step of this robot consists of {operations:,}
        floating-point operations as written, so {shown(rate)} steps/s are {1e-9 * operations * rate:.0f} billion
        operations per second on one core, in float64 and strict IEEE order. Blocks of 32 robots stay in the cache over
        many steps. With new torques every {SUBSTEPS} steps, which pass through Python and a transposition, {kept:.0f} %
        of the speed is left."""


def _environment(measured: Values) -> str:
    share = 100.0 * SUBSTEPS * _over(measured, "env_cores", "bare_cores")
    face = 100.0 * _over(measured, "env_cores", "engine_cores")
    return f"""**Environments in a batch: limited by what surrounds the integration.** Integration as fast as that of
        the bare equations takes {share:.0f} % of a control period. The rest is observation, reward, report and resets,
        which are written to memory for every robot and step. Gymnasium's interface checks the actions, copies, and
        makes the dictionary of infos with its masks; it leaves {face:.0f} % of the engine's speed. Half as many
        substeps make {_over(measured, "env_fewer", "env_cores"):.2f} times as many control periods; integration alone
        would make twice as many."""


def _alone(value: dict[str, float]) -> str:
    equations = 1e6 * SUBSTEPS / value["bare_one"]
    return f"""**One robot: limited by calls.** {SUBSTEPS} RK4 steps of one robot take {equations:.1f} µs. With
        observation, reward, report, and the call from Python into compiled code, the engine takes
        {value["one_engine"]:.1f} µs. With checks and the dictionary of infos, a step takes {value["one_beneath"]:.1f}
        µs, and with Gymnasium's wrappers {value["one"]:.1f} µs. A loop over environments pays this for each of them;
        the native batch does not."""


def _mujoco(rate: float, accuracy: Accuracy) -> str:
    return f"""**MuJoCo: limited by the contact solver.** In a step of {1e6 / rate:.1f} µs, the solver iterates for the
        friction forces of all wheels, of bodies that may move in any way. Our equations know that the wheels roll.
        MuJoCo's error is proportional to its step: to be as accurate as ours at {1e3 * RK4_STEP:g} ms, its step would
        have to be {shown(middle(accuracy.over))} times smaller than {1e3 * MUJOCO_STEP:g} ms."""


def _growth(measured: Values) -> str:
    bare, environment = (_batches(measured, kind) for kind in ("bare", "env"))
    casters = {count: middle(values) for count, values in line(measured, "casters", "bare").items()}
    few, many = min(casters), max(casters)
    obstacles = {count: middle(values) for count, values in line(measured, "obstacles", "bare").items()}
    crowd = max(obstacles)
    slower, crowded = casters[few] / casters[many], obstacles[0] / obstacles[crowd]
    return f"""**Growth.** Batches of the bare equations {bare}; those of the environment {environment}. With {many}
        casters instead of {few}, a step takes {slower:.1f} times as long. Among {crowd} pillars, it takes {crowded:.1f}
        times as long as without pillars; robots check them only when one may be near."""


def _batches(measured: Values, kind: str) -> str:
    rates = {count: middle(values) for count, values in line(measured, "robots", kind).items()}
    best, most = max(rates, key=lambda count: rates[count]), max(rates)
    half = min(count for count in rates if rates[count] >= 0.5 * rates[best])
    return f"""reach half of their best speed with {half:,} robots, the best with {best:,}, and keep
        {100.0 * rates[most] / rates[best]:.0f} % of it with {most:,}"""


def _torch(measured: Values) -> str:
    bare, alone = _over(measured, "torch", "bare"), _over(measured, "torch_env_core", "env")
    whole, scaling = _over(measured, "torch_env", "env_cores"), _over(measured, "torch_env", "torch_env_core")
    text = f"""**Torch: limited by memory.** Each step is one fused kernel that reads and writes every state, whereas
        Numba keeps a block in the cache over many steps. In return, Torch works in float32, has gradients and runs on
        GPUs. On one core it makes {bare:.2f} times as many bare steps as Numba and {alone:.2f} times as many control
        periods, on two cores {whole:.2f} times as many. A second core makes it {scaling:.2f} times as fast, because its
        threads wait for each other after each kernel. Beside another busy process, one thread is the better choice."""
    if measured.get("cuda"):
        bare, whole = _over(measured, "cuda", "bare_cores"), _over(measured, "cuda_env", "env_cores")
        text += f""" The GPU makes {bare:.1f} times as many bare steps as both cores, and {whole:.1f} times as many
        control periods."""
    return text
