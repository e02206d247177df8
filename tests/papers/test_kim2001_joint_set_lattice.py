"""The picture of all joint sets: its squares say which joints are driven and how singular the set is."""

from collections import Counter

from matplotlib.colors import to_hex
from matplotlib.patches import Rectangle

from caster_gym import load_robot
from papers.analysis.joint_sets import classify_all, set_types
from papers.kim2001.joint_set_lattice import CLASS_COLOURS, CLASSES, joint_set_lattice


def test_filled_squares_are_the_driven_joints_of_all_types():
    robot = load_robot("chung2008")
    sets = classify_all(robot)
    (axis,) = joint_set_lattice(robot, sets).axes
    squares = Counter(to_hex(patch.get_facecolor()).upper() for patch in axis.patches if isinstance(patch, Rectangle))
    kinds = [kind[0] for kind in set_types(robot, sets)]
    for verdict in CLASSES:
        driven = sum(len(one.joints) for one in kinds if one.singular == verdict)
        assert squares[CLASS_COLOURS[verdict].upper()] == driven
    assert squares["#FFFFFF"] == 6 * len(kinds) - sum(len(one.joints) for one in kinds)
