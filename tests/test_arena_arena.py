"""caster_gym.arena.arena and .outlines: reading arenas, and saying what is wrong with one."""

from typing import Any, cast

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.arena import Arena, distances, read_arena
from caster_gym.arena.arena import Point
from caster_gym.arena.obstacle import Obstacle
from caster_gym.configuration import ConfigurationError, Frozen, parse
from caster_gym.outlines import Outline, convex
from caster_gym.robot import load_robot

FULL: dict[str, Any] = {
    "room": [[-2, -1], [2, 1]],
    "half_planes": [{"point": [0.0, -3.0], "normal": [3.0, 4.0]}],
    "walls": [{"start": [0, 0], "end": [1, 0]}, {"start": [0, 0], "end": [0, 2], "thickness": 0.1}],
    "pillars": [{"centre": [0.5, 0.5], "radius": 0.2}],
    "polygons": [{"corners": [[0, 0], [1, 0], [1, 1], [0, 1]]}],
    "beside": {"pillars": 1},
    "restitution": 0.3,
    "friction": 0.1,
    "impact_law": "chatterjee_ruina",
}


def test_nothing_means_an_arena_without_obstacles():
    assert read_arena(None) == read_arena({}) == Arena()
    assert Arena().obstacles == ()


def test_an_arena_can_be_a_yaml_file(tmp_path):
    file = tmp_path / "ARENA.YAML"  # suffixes count in upper case, too
    file.write_text("{pillars: [{centre: [1e0, 2], radius: 2e-1}], restitution: 0.9}", encoding="utf-8")
    expected = read_arena({"pillars": [{"centre": [1.0, 2.0], "radius": 0.2}], "restitution": 0.9})
    assert read_arena(str(file)) == read_arena(file) == expected


def test_arenas_are_hashable_and_survive_a_dump():
    arena = read_arena(FULL)
    assert read_arena(arena) is arena
    assert read_arena(arena.model_dump(mode="json")) == arena
    assert len({arena, read_arena(FULL)}) == 1


def test_normals_have_unit_length():
    assert_allclose(read_arena(FULL).half_planes[0].normal, (0.6, 0.8), rtol=1e-15)


def test_every_obstacle_has_a_name_that_tells_it_from_the_others():
    names = [name for name, _ in read_arena(FULL).obstacles]
    assert len(set(names)) == len(names) == 9
    assert names[:4] == [f"the room's side {end}" for end in ("x_min", "y_min", "x_max", "y_max")]
    assert names[6] == "wall 2 from (0, 0) m to (0, 2) m"
    assert names[7] == "pillar 1 at (0.5, 0.5) m"


def test_a_room_is_free_inside_and_nowhere_else():
    """Each side is a half-plane whose face has the free side in front."""
    sides = read_arena({"room": [[-2, -1], [2, 1]]}).sides
    faces = np.array([side.outline.faces[0] for side in sides])
    points = np.random.default_rng(0).uniform(-3.0, 3.0, (500, 2))
    in_front = (points @ faces[:, :2].T > faces[:, 2]).all(1)
    np.testing.assert_array_equal(in_front, (np.abs(points) < [2.0, 1.0]).all(1))


def test_a_wall_is_as_thick_as_it_says_and_ends_where_it_says():
    """A wall along (3, 4): what lies in it, by coordinates along and across."""
    wall = read_arena({"walls": [{"start": [1, 1], "end": [4, 5], "thickness": 0.5}]}).walls[0]
    faces = np.array(wall.outline.faces)
    points = np.random.default_rng(1).uniform(0.0, 6.0, (2000, 2))
    inside = (points @ faces[:, :2].T < faces[:, 2]).all(1)
    along, across = (points - 1.0) @ [0.6, 0.8], (points - 1.0) @ [-0.8, 0.6]
    np.testing.assert_array_equal(inside, (along > 0.0) & (along < 5.0) & (abs(across) < 0.25))
    assert inside.sum() > 20


def test_regular_polygons_of_any_size_are_convex():
    for count in (3, 4, 17, 100):
        around = np.exp(2j * np.pi * np.arange(count) / count)
        for size in (1e-3, 1.0, 1e3):
            corners = [[size * p.real, size * p.imag] for p in around]
            assert len(read_arena({"polygons": [{"corners": corners}]}).polygons[0].outline.faces) == count


STAR = [[np.cos(angle), np.sin(angle)] for angle in 4.0 * np.pi * np.arange(5) / 5]  # turns left at every corner


@pytest.mark.parametrize(
    ("arena", "message"),
    [
        (
            {"polygons": [{"corners": [[0, 0], [1, 0], [0.2, 0.2], [0, 1]]}]},
            r"polygon 1: 'corners' must be convex, but it bends inwards at corner 3 at \(0\.2, 0\.2\) m",
        ),
        (
            {"polygons": [*FULL["polygons"], {"corners": [[0, 0], [2, 2], [2, 0], [0, 2]]}]},
            r"polygon 2: .* must not cross itself, but its edges from corner 1 and from corner 3 cross at \(1, 1\) m",
        ),
        ({"polygons": [{"corners": STAR}]}, "must not cross itself, but its edges from corner 1 and from corner 3"),
        (
            {"polygons": [{"corners": [[0, 0], [0, 1], [1, 0]]}]},
            "must be listed counter-clockwise, these run clockwise",
        ),
        (
            {"polygons": [{"corners": [[0, 0], [0.5, 0], [1, 0], [1, 1]]}]},
            r"it runs straight on at corner 2 at \(0\.5, 0\) m; leave that one out",
        ),
        (
            {"polygons": [{"corners": [[0, 0], [1, 0], [1, 1], [0, 0]]}]},
            r"must all differ, but corner 4 at \(0, 0\) m is the same as corner 1",
        ),
        ({"polygons": [{"corners": [[0, 0], [1, 0]]}]}, "'corners' should have at least 3 items, got 2"),
        ({"half_planes": [{"point": [0, 0], "normal": [0, 0]}]}, "arena: half-plane 1: 'normal' must have a direction"),
        ({"walls": [{"start": [1, 2], "end": [1, 2]}]}, r"wall 1: 'start' and 'end' must differ, got \(1, 2\) m"),
        ({"walls": [{"start": [1, 2], "end": [1, "b"]}]}, "wall 1: number 2 of 'end' should be a number, got 'b'"),
        ({"pillars": [{"centre": [0, 0], "radius": 0}]}, "pillar 1: 'radius' should be greater than 0, got 0"),
        ({"pillars": [{"centre": [0, 0], "radios": 1}]}, "unknown key 'radios'; did you mean 'radius'"),
        ({"pillars": [{"centre": [2e6, 0]}]}, "should be less than or equal to 1000000, got 2000000"),
        ({"room": [[0, 0], [0, 1]]}, "'room' must be .* each minimum below its maximum"),
        ({"beside": {"gap": [0.2, 0.1]}}, r"'beside\.gap' must be the least and the greatest value, in this order"),
        ({"beside": {"gap": [0.0, 0.1]}}, r"'beside\.gap' should be greater than or equal to 0\.001, got 0"),
        ({"restitution": 1.2}, "'restitution' should be less than or equal to 1, got 1.2"),
        ({"impact_law": "newton"}, "'impact_law' should be 'stronge' or 'chatterjee_ruina', got 'newton'"),
        ({"pilars": []}, "arena: unknown key 'pilars'; did you mean 'pillars'"),
        (
            {"obstacles": []},
            "unknown key 'obstacles'; they stand by their kinds: 'room', "
            + ", ".join(map(repr, [name for name, value in Arena() if value == ()])),
        ),
        ("nowhere.yaml", r"there is no file 'nowhere\.yaml'"),
        ("room", "an arena is a mapping or the name of a YAML file, got 'room'"),
        (3, "an arena is a mapping or the name of a YAML file, got 3"),
    ],
)
def test_what_is_no_arena_is_refused_by_name(arena, message):
    with pytest.raises(ConfigurationError, match=message):
        read_arena(arena)


def yard(outline, words="at the gate"):
    """An arena with one obstacle of a kind of one's own, which has this outline and is in this place."""

    class Crate(Obstacle):
        @property
        def outline(self):
            return outline()

        def __str__(self):
            return words

    class Yard(Arena):
        crates: tuple[Crate, ...] = (Crate(),)

    return Yard


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        (lambda: None, r"its outline must be an Outline, as convex\(\(corner, corner, …\)\) gives, got None"),
        (lambda: 0.2, "its outline must be an Outline, .* got 0.2"),
        (lambda: convex(((0, 0), (0, 1), (1, 0))), "its outline has corners that must be listed counter-clockwise"),
        (lambda: convex(((0, 0), (2, 0), (1, 0.5), (0, 2))), r"it bends inwards at corner 3 at \(1, 0\.5\) m"),
        (lambda: convex(((1, 1), (1, 1))), r"must all differ, but corner 1 at \(1, 1\) m is the same as corner 2"),
        (lambda: convex(((1, 1),)), "its outline must have two corners or more, got 1"),
        (lambda: convex(((0, 0), (1, 0), (np.nan, 1))), "must be finite numbers, got corner 3 at"),
        (lambda: Outline((), ((np.nan, 0.0),), 0.1), "must have finite numbers and no negative radius"),
        (lambda: Outline((), ((0.0, 0.0),), np.nan), "must have finite numbers and no negative radius"),
        (lambda: Outline((), ((0.0, 0.0),), -0.1), "must have finite numbers and no negative radius"),
        (lambda: Outline((), cast(Any, [3.0]), 0.1), r"must have faces \(n_x, n_y, offset\), corners \(x, y\)"),
        (lambda: Outline((), (), 0.1), "must have a face or a corner, got neither"),
        (lambda: Outline(((3.0, 4.0, 0.0),), (), 0.0), "must have normals of unit length"),
        (lambda: Outline(((1.0, 0.0, 0.0),), ((0.5, 0.0),), 0.0), "corner 1 lies 0.5 m in front of face 1"),
        (
            lambda: 1 / 0,
            r"cannot be worked out: ZeroDivisionError: division by zero \(.*test_arena_arena.py, line \d+\)",
        ),
    ],
)
def test_an_obstacle_of_ones_own_without_a_convex_outline_is_refused_by_name(outline, message):
    with pytest.raises(ConfigurationError, match=f"arena: crate 1 at the gate: .*{message}"):
        parse(yard(outline), {}, "arena")


def attribute_missing():
    return cast(Any, None).corner


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (
            yard(attribute_missing),
            "crate 1 at the gate: its outline cannot be worked out: AttributeError: 'NoneType' object has no attribute "
            r"'corner' \(.*test_arena_arena.py, line \d+\)",
        ),
        (
            yard(lambda: convex(((0, 0), (0, 1))), words=None),
            r"crate 1: its place cannot be told in words: TypeError: __str__ returned non-string .*, line \d+\)",
        ),
    ],
)
def test_what_the_code_of_an_obstacle_raises_is_told_with_its_line(kind, message):
    with pytest.raises(ConfigurationError, match=f"arena: {message}"):
        parse(kind, {}, "arena")


def test_numbers_that_give_no_outline_are_told_by_the_obstacle_alone():
    """They are no fault of the code, whose lines are not named."""
    said = r"crate 1 at the gate: its outline has corners that must all differ, .* is the same as corner 2$"
    with pytest.raises(ConfigurationError, match=said):
        parse(yard(lambda: convex(((1, 1), (1, 1)))), {}, "arena")


class Plain:
    outline = Outline((), ((0.0, 0.0),), 0.1)


class Flat(Obstacle):
    height: float = 0.0


@pytest.mark.parametrize(
    ("field", "message"),
    [
        (tuple[Plain, ...], r"Yard\.things holds Plain, which must be a subclass of .*\.Obstacle to stand in an arena"),
        (tuple[Frozen, ...], r"Yard\.things holds Frozen, which must be a subclass of .*\.Obstacle"),
        (tuple[Flat, ...] | None, r"Yard\.things holds Flat, which needs a property `outline`, such as `return convex"),
    ],
)
def test_fields_of_things_that_are_no_obstacles_are_refused_with_their_class(field, message):
    with pytest.raises(TypeError, match=message):
        type("Yard", (Arena,), {"__annotations__": {"things": field}, "things": (), "__module__": __name__})


def test_all_fields_of_obstacles_are_in_the_way():
    """Whatever holds them; in words, an obstacle is at its first point unless its kind says more."""

    class BigCrate(Obstacle):
        left_corner: Point

        @property
        def outline(self):
            return Outline((), (self.left_corner,), 0.1)

    class Yard(Arena):
        crates: tuple[BigCrate, ...] = ()
        last: BigCrate | None = None

    crate = {"left_corner": [1, 2]}
    names = [name for name, _ in parse(Yard, {**FULL, "crates": [crate, crate], "last": crate}, "arena").obstacles]
    place = "with its left corner at (1, 2) m"
    assert names[9:] == [f"big-crate 1 {place}", f"big-crate 2 {place}", f"big-crate 3 {place}"]


def test_walls_of_any_thickness_are_where_they_say():
    """Too thin to be told from a line, a wall is one; the gap of a disc of 0.15 m beside it, by hand."""
    robot = load_robot("chung2008")
    for thickness in (0.0, 1e-12, 5e-7, 1e-6, 1e-3, 1.0):
        arena = read_arena({"walls": [{"start": [2, -3], "end": [2, 3], "thickness": thickness}]})
        gaps, _ = distances(arena, robot, [[0.0, 0.0, 0.0]])
        assert_allclose(gaps[0, 0], 2.0 - 0.15 - thickness / 2, atol=1e-6)  # half of what is too thin to be told


def test_obstacles_are_named_alike_wherever_the_arena_stands():
    class Scene(Frozen):
        arena: Arena

    wrong = {"half_planes": [{"point": [0, 0], "normal": [0, 0]}], "pillars": [{"centre": [0, 0], "radius": 0}]}
    with pytest.raises(
        ConfigurationError, match=r"scene: arena: half-plane 1: 'normal' must .*; arena: pillar 1: 'rad"
    ):
        parse(Scene, {"arena": wrong}, "scene")
