"""kim2001, III and V, where the statements on singular joint sets end: trails that are long, and trails that differ."""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from caster_gym.design.joint_sets import JointSet, classify
from caster_gym.report.figures import COLOURS, new_figure
from caster_gym.robot import Robot
from papers.analysis.action_lines import smallest_singular_value
from papers.analysis.joint_sets import Bracket, least_singular_value
from papers.line_drawing import LEGEND, draw_lines
from papers.notation import KIM2001, in_letters, in_words, kim2001_robot
from papers.page import Check, Difference, Picture, Section, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TWO_WHEELS = in_words("θ_1 φ_1 θ_2 φ_2")
THREE_MOTORS = in_words("θ_1 φ_1 φ_2")
TABLE_2_TRAILS = (0.1, 0.2, 0.9, 1.0, 6.3, 10.0)  # [a] of the optima of Table 2, as printed
CLEARANCE = 1.2  # longer trail of `unequal_robot`, in shares of the least that rules out singularities


def unequal_robot() -> Robot:
    """The paper's robot with caster 2 on a link so long that its axle never reaches wheel 1."""
    robot = kim2001_robot(radius=0.25, trail=0.5)
    first, second, third = robot.casters
    longer = second.model_copy(update={"trail": CLEARANCE * (_pivot_distance(robot) + first.trail)})
    return robot.model_copy(update={"casters": (first, longer, third)})


def section() -> Section:
    """E10, and robots of three motors that are never singular."""
    optima, unequal = _optima(), unequal_robot()
    three = least_singular_value(unequal, THREE_MOTORS)
    return Section(
        "Which joints to drive: long trails, unequal trails",
        _text(three),
        tuple(_check(*optimum) for optimum in optima),
        (_table(optima),),
        (
            Picture("joint_sets_trail", "Long trails are singular", _TRAIL_CAPTION, _trail_figure(optima)),
            Picture(
                "joint_sets_three_motors",
                "Three motors that suffice",
                _THREE_CAPTION,
                _three_motors_figure(unequal, three),
            ),
        ),
        _differences(optima),
    )


_TRAIL_CAPTION = (
    "E10. Left: the least value, over all steering angles, of the smallest singular value of (θ_1, φ_1, θ_2, φ_2), for "
    "trails d of the paper's robot: attained, and proved from below; crosses are the trails of Table 2's optima. "
    "Beyond half the distance l of the pivots it is zero. Right: at the first of them beyond it both wheels can stand "
    f"on one point, where all four lines meet. {LEGEND}"
)
_THREE_CAPTION = (
    "Three motors that are never singular, drawn where the lines come nearest to meeting: the axle of caster 2 always "
    "touches the outer circle, and wheel 1, in whose centre the two lines of caster 1 meet, stays within, on the inner "
    "one. Lines as before."
)


def _text(three: Bracket) -> str:
    return f"""
The statements above rest on trails that are short and alike.

*Long trails* (E10). Both joints on each of two wheels are singular where the two wheel centres coincide, which they
can once the trail is half the distance of the pivots. Two optima of Table 2 are of this kind. The least singular value
falls all the way towards that trail: in this measure the shortest trail is the best. Real wheels would collide before,
so that such a robot is spared the singularity, not its neighbourhood.

*Unequal trails*. Three motors are singular somewhere on the paper's robot, but not on every robot: if caster 2 has a
trail longer than the distance of the pivots plus the trail of caster 1, its axle cannot pass through wheel 1, where the
two lines of caster 1 meet, and {in_letters(THREE_MOTORS)} is never singular. With a trail {CLEARANCE:g} times as long
as that the least singular value is between {three.lower:.3f} and {three.upper:.3f}.
"""


def _check(trail: float, robot: Robot, one: JointSet) -> Check:
    what = f"{in_letters(TWO_WHEELS)} with d = {trail:g} a, of Table 2"
    if one.steering is None:
        return Check(what, "not singular", "not singular", True)
    angles = ", ".join(f"{np.degrees(angle) % 360.0:.1f}°" for angle in KIM2001.steering(one.steering)[:2])
    ours = f"σ = {_value(robot, one):.0e} at (φ_1, φ_2) = ({angles})"
    return Check(what, "not singular", ours, False, "E10: both wheels stand on one point")


def _differences(optima: list[tuple[float, Robot, JointSet]]) -> tuple[Difference, ...]:
    singular = [(trail, robot, one) for trail, robot, one in optima if one.steering is not None]
    half = 0.5 * _pivot_distance(kim2001_robot(radius=1.0, trail=1.0))
    trails = " and ".join(f"{trail:g} a" for trail, _, _ in singular)
    worst = max(_value(robot, one) for _, robot, one in singular)
    apart = max(_wheels_apart(robot, one) for _, robot, one in singular)
    return (
        Difference(
            "E10",
            "sections III and V",
            "both joints on each of two wheels are never singular",
            f"only while d is less than half the distance of the pivots, {half:.3f} a",
            f"at d = {trails}, of Table 2, the two wheel centres coincide to {apart:.0e} a and σ falls to {worst:.0e}",
        ),
    )


def _table(optima: list[tuple[float, Robot, JointSet]]) -> Table:
    rows = []
    for trail, robot, one in optima:
        least = _least(trail)
        apart = "" if one.steering is None else _wheels_apart(robot, one)
        rows.append((trail, trail / _pivot_distance(robot), one.singular, least.lower, least.upper, apart))
    columns = ("d [a]", "d/l", "singular", "σ everywhere ≥", "least σ found", "wheel centres apart there [a]")
    return Table("joint_sets_trails", f"{in_letters(TWO_WHEELS)} with the trails of Table 2.", columns, rows)


def _trail_figure(optima: list[tuple[float, Robot, JointSet]]) -> "Figure":
    figure = new_figure(1, 2, size=(4.9, 4.9))
    left, right = figure.axes
    half = 0.5 * _pivot_distance(kim2001_robot(radius=1.0, trail=1.0))
    trails = np.unique(np.concatenate([np.geomspace(0.1, 10.0, 17), half * np.linspace(0.85, 1.1, 9)]))
    found = [_least(trail) for trail in trails]
    lower, upper = [bracket.lower for bracket in found], [bracket.upper for bracket in found]
    left.fill_between(trails, lower, upper, color=COLOURS[1], label="proved, from below")
    left.plot(trails, upper, color=COLOURS[0], label="attained")
    crosses = [_least(trail).upper for trail in TABLE_2_TRAILS]
    left.plot(TABLE_2_TRAILS, crosses, "x", color=COLOURS[3], markersize=8, label="trails of Table 2", zorder=5)
    left.axvline(half, color="black", linestyle=":", label=f"d = l/2 = {half:.3f} a")
    left.set(xscale="log", xlabel="trail d [a]", ylabel=f"least σ of {in_letters(TWO_WHEELS)} [-]")
    left.legend()
    trail, robot, one = next(optimum for optimum in optima if optimum[2].steering is not None)
    draw_lines(right, robot, one.steering or (), TWO_WHEELS, reach=1.1 * trail)
    right.set(xlabel="x [a]", ylabel="y [a]", title=f"d = {trail:g} a: σ = {_value(robot, one):.0e}")
    return figure


def _three_motors_figure(robot: Robot, least: Bracket) -> "Figure":
    from matplotlib.patches import Circle

    figure = new_figure(size=(5.6, 5.9))
    (axis,) = figure.axes
    first, second, _ = robot.casters
    draw_lines(axis, robot, least.steering, THREE_MOTORS, reach=1.42 * second.trail)
    for caster, colour, label in ((first, COLOURS[0], "wheel 1 is here"), (second, COLOURS[3], "axle 2 touches this")):
        place, size = (caster.x, caster.y), caster.trail
        axis.add_patch(Circle(place, size, fill=False, color=colour, linestyle=":", linewidth=1.6, label=label))
    axis.legend(loc="upper left")
    axis.set(xlabel="x [a]", ylabel="y [a]", title=f"{in_letters(THREE_MOTORS)}: σ ≥ {least.lower:.3f} everywhere")
    return figure


def _optima() -> list[tuple[float, Robot, JointSet]]:
    """The trails of Table 2, the robots that have them, and where both joints on wheels 1 and 2 are singular."""
    robots = [kim2001_robot(radius=0.1, trail=trail) for trail in TABLE_2_TRAILS]
    return [(trail, robot, classify(robot, TWO_WHEELS)) for trail, robot in zip(TABLE_2_TRAILS, robots, strict=True)]


@lru_cache
def _least(trail: float) -> Bracket:
    """The least σ of both joints on wheels 1 and 2, on the paper's robot with a trail [a]."""
    robot = kim2001_robot(radius=0.1, trail=float(trail))
    one = classify(robot, TWO_WHEELS)
    if one.steering is not None:
        return Bracket(0.0, _value(robot, one), one.steering)
    return least_singular_value(robot, TWO_WHEELS, precision=0.01)


def _value(robot: Robot, one: JointSet) -> float:
    """σ where the set is singular."""
    return float(smallest_singular_value(robot, one.steering or (), one.joints))


def _pivot_distance(robot: Robot) -> float:
    first, second, *_ = robot.casters
    return float(np.hypot(first.x - second.x, first.y - second.y))


def _wheels_apart(robot: Robot, one: JointSet) -> float:
    """Distance of the wheel centres of casters 1 and 2, without lateral offsets, where the set is singular. [m]"""
    steering = one.steering or ()
    first, second = (
        np.array([c.x - c.trail * np.cos(angle), c.y - c.trail * np.sin(angle)])
        for c, angle in zip(robot.casters[:2], steering[:2], strict=True)
    )
    return float(np.hypot(*(first - second)))
