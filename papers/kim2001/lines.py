"""kim2001, III: singularities seen as lines that meet, tested on robots of any kind against the Jacobian."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.design.joint_sets import turned_parallel, turned_towards
from caster_gym.engines.numpy_model import Model
from caster_gym.report.figures import COLOURS, new_figure
from caster_gym.robot import Robot
from papers.analysis.action_lines import MEETS, action_lines, meeting, smallest_singular_value
from papers.notation import kim2001_robot
from papers.page import Check, Picture, Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure


ROBOTS, CONFIGURATIONS = 200, 500  # robots drawn at random, configurations of each
STEPS = 20  # configurations around each singular one
SHOWN = 6000  # points that the picture shows of random configurations
ROUNDING = 1e-12  # [-] of lines whose directions and moments are of order 1


class Comparison(NamedTuple):
    """Geometry beside singular values: one entry a configuration."""

    gap: Array  # [-] how far the lines are from meeting
    met: Array  # 1 where the geometry alone says that they meet or are parallel, else 0
    singular_value: Array  # [-] least, of the Jacobian's rows as unit lines
    joints: Array  # their number

    @property
    def bounds(self) -> tuple[float, float]:
        """Least σ √3/gap and greatest σ/(√(J − 2) gap): (L4) says 1 or more, and 1 or less."""
        share = self.singular_value / self.gap
        return float(share.min() * np.sqrt(3.0)), float((share / np.sqrt(self.joints - 2.0)).max())


def compare_random(seed: int = 0, robots: int = ROBOTS, configurations: int = CONFIGURATIONS) -> Comparison:
    """Random robots of 2 to 5 casters, joint sets of three joints and more, and angles."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(robots):
        robot = _random_robot(rng, fewest=2)
        count = int(rng.integers(3, 2 * robot.caster_count + 1))
        joints = rng.permutation(robot.joints)[:count].tolist()
        found.append(_compared(robot, rng.uniform(-np.pi, np.pi, (configurations, robot.caster_count)), joints))
    return Comparison(*map(np.concatenate, zip(*found, strict=True)))


def compare_singular(seed: int = 1, robots: int = ROBOTS, away: bool = False) -> Comparison:
    """Configurations made singular by geometry; if away, each turned away in STEPS steps, from 1e-14 to 1 rad."""
    rng = np.random.default_rng(seed)
    sizes = np.logspace(-14.0, 0.0, STEPS)[:, None] if away else np.zeros((1, 1))
    found = [
        _compared(robot, steering + sizes * rng.uniform(-1.0, 1.0, (len(sizes), robot.caster_count)), joints)
        for robot, joints, steering in singular_configurations(rng, robots)
    ]
    return Comparison(*map(np.concatenate, zip(*found, strict=True)))


def singular_configurations(rng: np.random.Generator, count: int) -> Iterator[tuple[Robot, tuple[str, ...], Array]]:
    """Robots, joints and angles where all lines meet in a point, are parallel, or meet in a wheel's centre, by turns.

    The point is at 3 to 1,000 m. In the last case the caster of that wheel has both joints driven, and others, one at
    least, have one; in the first two, three casters or more have one.
    """
    for k in range(count):
        robot = _random_robot(rng, fewest=3)
        way, numbers = rng.uniform(-np.pi, np.pi), rng.permutation(robot.caster_count) + 1
        unit = np.array([np.cos(way), np.sin(way)])
        if k % 3 == 2:
            both, *others = numbers[: rng.integers(2, robot.caster_count + 1)]
            caster = robot.casters[both - 1]
            point = np.array([caster.x, caster.y]) + np.hypot(caster.trail, caster.offset) * unit
            named = [f"roll_{both}", f"steer_{both}", *(_joint_towards(rng, robot, i, point) for i in others)]
            yield robot, tuple(named), np.array(turned_towards(robot, named, point))
            continue
        some = numbers[: rng.integers(3, robot.caster_count + 1)]
        joints = tuple(f"{rng.choice(['roll', 'steer'])}_{i}" for i in some)
        if k % 3 == 0:
            point = 10.0 ** rng.uniform(0.5, 3.0) * unit
            yield robot, joints, np.array(turned_towards(robot, joints, point))
        else:
            yield robot, joints, np.array(turned_parallel(robot, joints, way))


def _joint_towards(rng: np.random.Generator, robot: Robot, number: int, point: Array) -> str:
    """A joint of a caster whose line can pass through a point; steering only where its axle reaches it."""
    caster = robot.casters[number - 1]
    near = np.hypot(point[0] - caster.x, point[1] - caster.y) < caster.trail
    return f"roll_{number}" if near else f"{rng.choice(['roll', 'steer'])}_{number}"


def section() -> Section:
    """The geometric reading of singularities, for any robot and any set of joints."""
    random, exact, near = compare_random(), compare_singular(), compare_singular(away=True)
    return Section(
        "Singularities: lines that meet, on any robot",
        _text(random, exact, near),
        _checks(random, exact),
        pictures=(Picture("singularity_lines", "Gap and singular value", _CAPTION, _figure(random, near)),),
    )


_CAPTION = (
    "Gap between the lines and smallest singular value, one point a configuration: random robots, joint sets and "
    "angles (blue), and configurations made singular by geometry, then turned away by 1e-14 to 1 rad (orange). The "
    "lines are the two bounds (L4): between them, the geometry of the lines and the rank say the same over all sizes."
)


def _text(random: Comparison, exact: Comparison, near: Comparison) -> str:
    low, high = random.bounds
    return f"""
The paper reads singularities off lines: that through the steering link for a driven rolling joint, that of the axle for
a driven steering joint; where all of them meet in a point or are parallel, the set is singular. It shows this on
examples with three casters. It holds for every number of casters and of driven joints, for casters that differ and for
wheels beside their pivots (docs/analysis.md, section L): a row of the Jacobian is its line times a positive number, and
a twist that no joint feels is a turn about a point of all lines, or a translation across parallel ones.

The test is made from the geometry alone. Of all pairs of lines the one that crosses best gives a point, near, far or at
infinity, and the *gap* is how far the other lines pass it by: the fastest of them along itself in a unit turn about it.
The gap bounds the smallest singular value σ of the Jacobian's rows, taken as unit lines, from both sides,
gap/√3 ≤ σ ≤ √(J − 2) gap for J joints (L4). Over {random.gap.size:,} random configurations of {ROBOTS} random robots
with 2 to 5 casters, σ √3/gap is {low:.3f} or more, σ/(√(J − 2) gap) is {high:.4f} or less, and the least gap is
{random.gap.min():.1e}. Over {exact.gap.size} configurations made singular by geometry (lines that meet far away, are
parallel, or meet in the centre of a wheel with both joints driven) the largest gap is {exact.gap.max():.0e} and the
largest σ {exact.singular_value.max():.0e}. The picture goes from the one to the other, with {near.gap.size:,}
configurations more.

This is about joints. A gear that couples the two motors of a caster makes one motor push along another line through
the wheel's centre, so that the statement then covers casters with both motors driven, or none.
"""


def _checks(random: Comparison, exact: Comparison) -> tuple[Check, ...]:
    low, high = random.bounds
    bounded = low >= 1.0 - ROUNDING and high <= 1.0 + ROUNDING
    largest, widest = float(exact.singular_value.max()), float(exact.gap.max())
    return (
        Check(
            f"lines that neither meet nor are parallel: {random.gap.size:,} random configurations",
            "not singular",
            f"least gap {random.gap.min():.1e}, σ ≥ {low / np.sqrt(3.0):.3f} gap, least σ "
            f"{random.singular_value.min():.1e}",
            bounded and not random.met.any(),
            f"lines are taken to meet up to a gap of {MEETS:g}",
        ),
        Check(
            f"lines that meet or are parallel: {exact.gap.size} configurations made so",
            "singular",
            f"{exact.met.sum():.0f} seen as such, gap ≤ {widest:.0e}; σ ≤ {largest:.0e}",
            bool(exact.met.all()) and max(largest, widest) < ROUNDING,
            "a third of them in the centre of a wheel with both joints driven; on some casters no joint is driven",
        ),
    )


def _figure(random: Comparison, near: Comparison) -> "Figure":
    figure = new_figure(size=(6.0, 4.4))
    (axis,) = figure.axes
    few = slice(None, None, max(1, random.gap.size // SHOWN))
    style = {"linestyle": "", "marker": ".", "markersize": 2.5}
    axis.loglog(near.gap, near.singular_value, color=COLOURS[2], label="around singular configurations", **style)
    axis.loglog(random.gap[few], random.singular_value[few], color=COLOURS[0], label="random configurations", **style)
    ends = np.array([1e-15, 3.0])
    joints = max(random.joints.max(), near.joints.max())
    most = float(np.sqrt(joints - 2.0))
    label = f"√(J − 2) gap = {most:.2f} gap for J = {joints:.0f}"
    axis.loglog(ends, ends * most, color="black", linewidth=1, linestyle="--", label=label)
    axis.loglog(ends, ends / np.sqrt(3.0), color="black", linewidth=1, label="gap/√3")
    axis.set(xlabel="gap between the lines [-]", ylabel="smallest singular value σ [-]")
    axis.set(xlim=(1e-15, 5.0), ylim=(3e-16, 10.0))
    axis.legend(markerscale=5)
    return figure


def _random_robot(rng: np.random.Generator, fewest: int) -> Robot:
    """Casters anywhere within a square of 2 m, with any trails and offsets to either side."""
    count = int(rng.integers(fewest, 6))
    numbers = rng.uniform((-1.0, -1.0, 0.05, -0.3), (1.0, 1.0, 1.0, 0.3), (count, 4)).tolist()
    robot = kim2001_robot(radius=0.1, trail=0.1)
    keys = ("x", "y", "trail", "offset")
    casters = tuple(robot.casters[0].model_copy(update=dict(zip(keys, one, strict=True))) for one in numbers)
    return robot.model_copy(update={"casters": casters})


def _compared(robot: Robot, steering: Array, joints: Sequence[str]) -> tuple[Array, Array, Array, Array]:
    met = meeting(action_lines(robot, steering, joints), Model(robot).characteristic_length)
    gap = met.gap
    return (
        gap,
        met.singular.astype(np.float64),
        smallest_singular_value(robot, steering, joints),
        np.full(len(steering), float(len(joints))),
    )
