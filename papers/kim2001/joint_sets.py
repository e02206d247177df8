"""kim2001, III: where each set of driven joints is singular, all sets of it, for three casters and for four."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from caster_gym.design.joint_sets import JointSet, kind_and_caster
from caster_gym.robot import Robot, load_robot
from papers.analysis.action_lines import smallest_singular_value
from papers.analysis.joint_sets import Bracket, classify_all, proved_brackets, rounded_down, set_types
from papers.kim2001.joint_set_lattice import CLASSES, joint_set_lattice
from papers.notation import KIM2001, in_letters, in_words, kim2001_robot
from papers.page import Check, Difference, Picture, Section, Table

ROBOTS = ("chung2008", "xr4000", "tidybot2")
ADMISSIBLE = ("θ_1 φ_1 θ_2 φ_2", "θ_1 φ_1 θ_3 φ_3", "θ_2 φ_2 θ_3 φ_3")  # as printed
ROUNDING = 1e-12  # [-] smallest singular values at configurations that geometry makes singular


class Classified(NamedTuple):
    """A robot, all its sets of joints, their types, and the least σ of those that are never singular."""

    robot: Robot
    sets: tuple[JointSet, ...]
    types: tuple[tuple[JointSet, ...], ...]
    least: dict[tuple[str, ...], Bracket]


def classified(name: str) -> Classified:
    """Everything about the joint sets of a robot that comes with the package."""
    robot = load_robot(name)
    sets = classify_all(robot)
    return Classified(robot, sets, set_types(robot, sets), proved_brackets(robot, sets))


def section() -> Section:
    """All sets of driven joints of a robot of the paper's shape and of two with four casters."""
    robots = tuple(classified(name) for name in ROBOTS)
    three, *four = robots
    return Section(
        "Which joints to drive",
        _text(three, four),
        _checks(three),
        (_count_table(robots), *map(_type_table, robots), *map(_set_table, robots)),
        tuple(_picture(one) for one in robots),
        _differences(three),
    )


def _text(three: Classified, four: Sequence[Classified]) -> str:
    types_of_four = " and ".join(f"{len(one.types)} for {one.robot.name}" for one in four)
    never = [len(one.joints) for one in four[0].sets if one.singular == "never"]
    five = [one.singular for one in four[0].sets if len(one.joints) == 5]
    return f"""
The paper looks for configurations of a few sets. The lines answer for all sets of any robot at once, exactly: a driven
rolling joint alone can put its line through every point, a steering joint alone through every point at least a trail
away from its pivot, both joints of one caster only through points that the wheel's centre can reach; and parallel lines
need all casters to have at most one driven joint. So a set is singular somewhere exactly if its casters can agree on a
point or a direction, which takes no search (docs/analysis.md, section L). Each "somewhere" comes with a configuration
and its smallest singular value σ, each "never" with a bound on σ over all steering angles, proved by branch and bound,
and with the least σ that was found; the truth lies between the two. Bounds of large sets of four casters are those of
sets within them, since a search would take hours. "always" are here the sets of fewer than three joints.

The {len(three.sets)} sets of the robot of chung2008, which has the shape of this paper's, are of {len(three.types)}
types under its symmetry. The statements of section III hold: all sets of three joints are singular somewhere, and of
those of four all but both joints on each of two wheels, the sets in which the paper recognises the minimal admissible
motorisations of Campion et al. (1996). What decides is whether two or more casters have both joints driven; a fifth and
a sixth motor change nothing about it.

The same holds for two robots with four casters, each with {len(four[0].sets)} sets (types: {types_of_four}):
{min(never)} motors are enough, yet {five.count("somewhere")} of the {len(five)} sets of five joints are singular
somewhere, those with both joints on one caster and one on each other. On these two robots the drive motor turns with
the steering as well: a set with one joint of a caster means that joint, not a motor.
"""


def _checks(three: Classified) -> tuple[Check, ...]:
    of_three, of_four = ([one for one in three.sets if len(one.joints) == count] for count in (3, 4))
    mixed = [one for one in of_four if _whole_casters(one) == 1]
    never = [in_letters(one.joints) for one in of_four if one.singular == "never"]
    printed = [in_letters(in_words(letters)) for letters in ADMISSIBLE]
    enough = min(_whole_casters(one) for one in three.sets if one.singular == "never")
    what = "wheels with two active joints that it takes to avoid singularities (abstract, section V)"
    remark = 'E22: "two or more" is meant, as section III says and section V does' if enough == 2 else ""
    return (
        _somewhere("sets of three joints", three.robot, of_three, "with equal trails"),
        _somewhere("sets of four, both joints on one wheel, one on each other", three.robot, mixed, "as in Fig. 4"),
        Check(
            "sets of four without singularity", ", ".join(printed), ", ".join(never), never == printed, "d < l/2 (E10)"
        ),
        Check(what, "more than two", f"{enough} or more", enough > 2, remark),
        Check("kinds of sets of three joints, by symmetry (section IV)", "six", *_three_joint_types()),
    )


def _differences(three: Classified) -> tuple[Difference, ...]:
    two_wheels = next(one for one in three.sets if one.singular == "never")
    number, _ = _three_joint_types()
    bound = rounded_down(three.least[two_wheels.joints].lower)
    return (
        Difference(
            "E22",
            "abstract and section V",
            "no singularity with more than two wheels that have two active joints",
            "with two or more, as section III says",
            f"{in_letters(two_wheels.joints)}, as in section V: σ ≥ {bound} everywhere",
        ),
        Difference(
            "E23",
            "section IV, list of sets of three joints",
            "six sets, of which five are listed",
            "the one not listed is (θ_1, φ_1, θ_2), type 4 of Table 1",
            f"the sets of three joints are of {number} types under the symmetry of the robot",
            nature="scan, probably",
        ),
    )


def _count_table(robots: Sequence[Classified]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for one in robots:
        for number in range(1, 2 * one.robot.caster_count + 1):
            counts = Counter(each.singular for each in one.sets if len(each.joints) == number)
            rows.append((one.robot.name, number, counts.total(), *(counts[kind] for kind in CLASSES)))
    columns = ("robot", "driven joints", "sets", "always singular", "somewhere", "never")
    return Table("joint_sets_counts", "How many sets of joints are singular always, somewhere, never.", columns, rows)


_EVIDENCE = ("lines meet at x, y [m]", "σ there", "σ everywhere ≥", "least σ found")


def _type_table(one: Classified) -> Table:
    rows = [
        (in_letters(first.joints), len(first.joints), 1 + len(others), first.singular, *_evidence(one, first))
        for first, *others in one.types
    ]
    columns = ("one of them", "driven joints", "sets", "singular", *_EVIDENCE)
    return Table(f"joint_sets_types_{one.robot.name}", f"{one.robot.name}: types of sets.", columns, rows)


def _set_table(one: Classified) -> Table:
    rows = [
        (in_letters(each.joints), len(each.joints), each.singular, _angles(each), *_evidence(one, each))
        for each in one.sets
    ]
    columns = ("joints", "driven joints", "singular", "φ there [deg]", *_EVIDENCE)
    return Table(f"joint_sets_{one.robot.name}", f"{one.robot.name}: all {len(rows)} sets.", columns, rows)


def _picture(one: Classified) -> Picture:
    caption = (
        f"{one.robot.name} from above, its {len(one.sets)} sets of driven joints, one drawn for each type under its "
        "symmetry (×: sets of the type). The left cell at a pivot is the rolling joint, the right one the steering "
        "joint, filled if driven."
    )
    return Picture(
        f"joint_sets_{one.robot.name}",
        f"Types of joint sets of {one.robot.name}",
        caption,
        joint_set_lattice(one.robot, one.sets),
    )


def _somewhere(what: str, robot: Robot, sets: Sequence[JointSet], remark: str) -> Check:
    values = [_value(robot, one) for one in sets if one.singular == "somewhere"]
    agrees = len(values) == len(sets) and max(values) < ROUNDING
    return Check(
        what, "each singular somewhere", f"{len(values)} of {len(sets)}, σ ≤ {max(values):.0e}", agrees, remark
    )


def _three_joint_types() -> tuple[str, bool]:
    """How many types of sets of three joints the paper's robot has, and whether these are six."""
    robot = kim2001_robot(radius=0.1, trail=0.1)
    number = len(set_types(robot, [one for one in classify_all(robot) if len(one.joints) == 3]))
    return str(number), number == 6


def _whole_casters(one: JointSet) -> int:
    """Number of casters with both joints driven."""
    return sum(count == 2 for count in Counter(kind_and_caster(joint)[1] for joint in one.joints).values())


def _evidence(one: Classified, joint_set: JointSet) -> tuple[str, str, str, str]:
    """Where the lines meet, σ there, the proved bound below σ everywhere, and the least σ found, as words."""
    if joint_set.singular == "never":
        bracket = one.least[joint_set.joints]
        return "", "", rounded_down(bracket.lower), f"{bracket.upper:.3f}"
    if joint_set.singular == "always":
        return "", "0", "", ""
    where = "parallel" if joint_set.point is None else f"{joint_set.point[0]:.4f}, {joint_set.point[1]:.4f}"
    return where, f"{_value(one.robot, joint_set):.0e}", "", ""


def _value(robot: Robot, one: JointSet) -> float:
    """σ where the set is singular."""
    return float(smallest_singular_value(robot, one.steering or (), one.joints))


def _angles(one: JointSet) -> str:
    if one.singular != "somewhere":
        return ""
    return "(" + ", ".join(f"{np.degrees(angle) % 360.0:.1f}" for angle in KIM2001.steering(one.steering or ())) + ")"
