"""caster_gym.render: what is where on real frames."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.floor import Floor, Patch
from caster_gym.render import palette
from caster_gym.render.viewer import Viewer
from tests.scenes import centroid, obstacles, scene

SQUARE = (400, 400)
ONE_PIXEL = 1.0
SMOOTH = 0.3  # [px] shapes are drawn on a grid of a quarter of a pixel


def drawn(what, size=SQUARE, **settings):
    """The frame of one scene and its view."""
    viewer = Viewer("rgb_array", size, **settings)
    return viewer.show([what]), viewer.view()


def colour_at(frame, view, point):
    column, row = np.floor(view.pixels(point)).astype(int)
    return tuple(frame[row, column].tolist())


@pytest.mark.parametrize("size", [(400, 400), (640, 640), (960, 640), (500, 900)])
@pytest.mark.parametrize(("x", "y", "turn"), [(1.0, 0.0, 0.0), (-0.83, 0.41, 2.0), (0.1234, -1.0567, -2.9)])
def test_the_robot_is_where_its_state_says_to_a_pixel(size, x, y, turn):
    """Found by the colour of its reference point alone, in the map and not in the close-up."""
    frame, view = drawn(scene(x, y, turn), size)
    seen = frame[:, : int(view.area.width)]
    assert_allclose(centroid(seen, palette.CENTRE), view.pixels((x, y)), rtol=0, atol=ONE_PIXEL)


def test_a_robot_moved_by_a_metre_moves_by_the_scale():
    places = []
    for x in (-0.5, 0.5):
        frame, view = drawn(scene(x, 0.0))
        places.append(centroid(frame, palette.CENTRE))
    assert_allclose(places[1] - places[0], (view.scale, 0.0), rtol=0, atol=ONE_PIXEL)


def test_the_followed_robot_is_in_the_middle():
    frame, view = drawn(scene(0.3, 0.7), follow=1.5)
    assert_allclose(centroid(frame, palette.CENTRE), (200.0, 200.0), rtol=0, atol=ONE_PIXEL)
    assert view.scale == pytest.approx(400.0 / 1.5)


def test_the_front_points_along_the_heading():
    """Inside the outline only the mark of the front has the body's full colour."""
    for turn in (0.0, 1.0, 3.0, -1.6):
        frame, view = drawn(scene(0.0, 0.0, turn), follow=0.5)
        rows, columns = np.nonzero((frame == palette.BODY).all(axis=2))
        places = view.metres(np.stack([columns + 0.5, rows + 0.5], axis=1))
        inside = places[np.hypot(*places.T) < 0.9 * 0.15]  # of its radius
        assert len(inside) > 50
        x, y = inside.mean(axis=0)
        assert math.atan2(y, x) == pytest.approx(turn, abs=0.02)  # a pixel and a half at this distance


def test_a_wheel_trails_its_pivot():
    """P: the wheel's centre is at A − d f + s f⊥; the middle of its pixels is there, whatever the steering."""
    robot = load_robot("tidybot2")
    caster = robot.casters[0].model_copy(update={"trail": 0.08, "offset": 0.04, "radius": 0.03, "x": 0.0, "y": 0.0})
    far = caster.model_copy(update={"x": 5.0})  # its wheel lies outside the frame
    robot = robot.model_copy(update={"casters": (caster, far)})
    for delta in (0.0, 0.7, 2.5, -1.9):
        f = np.array([math.cos(delta), math.sin(delta)])
        what = scene(0.0, 0.0, robot=robot, directions=np.stack([f, f]))
        frame, view = drawn(what, follow=0.6)
        wheel = -0.08 * f + 0.04 * np.array([-f[1], f[0]])
        away = view.pixels(wheel) - 0.0
        near = np.array([[0, 0], [frame.shape[1], frame.shape[0]]])
        columns, rows = np.meshgrid(np.arange(near[1][0]) + 0.5, np.arange(near[1][1]) + 0.5)
        tyre = (frame == palette.WHEEL).all(axis=2) & (np.hypot(columns - away[0], rows - away[1]) < 0.033 * view.scale)
        middle = np.array([columns[tyre].mean(), rows[tyre].mean()])
        assert tyre.sum() > 0.4 * 0.06 * 0.0186 * view.scale**2  # the link hides some of it
        assert np.hypot(*(middle - away)) < 0.01 * view.scale


def test_a_force_is_drawn_at_its_wheel_along_its_direction():
    forces = np.zeros((3, 2))
    forces[1] = (0.0, 2.0)  # to the left of the second wheel, which rolls ahead
    frame, view = drawn(scene(0.0, 0.0, ground_forces=forces), follow=0.6)
    robot = scene().robot
    wheel = view.pixels((robot.casters[1].x - robot.casters[1].trail, robot.casters[1].y))
    along = centroid(frame, palette.FORCE) - wheel
    assert abs(along[0]) < ONE_PIXEL
    assert along[1] < -5.0  # up, which is left of ahead


def test_a_wheel_that_slips_has_an_arrow_along_its_slip():
    slip = np.zeros((3, 2))
    slip[1] = (0.0, 0.8)  # to the left of the second wheel, which rolls ahead
    frame, view = drawn(scene(0.0, 0.0, slip=slip), follow=0.6)
    robot = scene().robot
    wheel = view.pixels((robot.casters[1].x - robot.casters[1].trail, robot.casters[1].y))
    along = centroid(frame, palette.SLIP) - wheel
    assert abs(along[0]) < 2.0 * ONE_PIXEL  # its tread has the same colour, and the link hides some of that
    assert along[1] < -5.0  # up, which is left of ahead
    assert not (drawn(scene(0.0, 0.0), follow=0.6)[0] == palette.SLIP).all(axis=2).any()


def test_a_patch_of_the_floor_is_where_it_is_and_tells_ice_from_rough_ground():
    patches = (
        Patch(x=0.3, y=0.2, radius=0.25, friction=0.1),
        Patch(x=-0.6, y=0.5, radius=0.1, friction=0.9),
    )
    frame, view = drawn(scene(5.0, 5.0, floor=Floor(friction=0.7, patches=patches)), follow=None)
    for patch, colour in zip(patches, (palette.ICE, palette.ROUGH), strict=True):
        rows, columns = np.nonzero((frame == colour).all(axis=2))
        places = view.metres(np.stack([columns + 0.5, rows + 0.5], axis=1)) - (patch.x, patch.y)
        reach = np.hypot(*places.T).max()
        assert patch.radius - 4.0 / view.scale < reach <= patch.radius + 1.0 / view.scale  # within its edge


def test_a_pillar_ends_where_its_radius_says():
    """Where a row through its centre changes from floor to pillar, at half coverage of its edge."""
    what = scene(obstacles=obstacles(pillars=[(-0.2, 0.1, 0.3)]))
    frame, view = drawn(what, follow=2.5)
    assert colour_at(frame, view, (-0.2, 0.1)) == palette.SOLID
    frame, view = drawn(what)
    left, right = view.pixels([(-0.5, 0.1), (0.1, 0.1)])
    row = frame[int(left[1])].astype(float)[:, 0]
    floor, edge = palette.CORRIDOR[0], palette.SOLID_EDGE[0]
    dark = row < 0.5 * (floor + edge)
    start, end = int(left[0]) - 4, int(right[0]) + 5
    first = start + int(dark[start:end].argmax())
    last = end - 1 - int(dark[start:end][::-1].argmax())
    assert first == pytest.approx(left[0], abs=ONE_PIXEL)
    assert last + 1 == pytest.approx(right[0], abs=ONE_PIXEL)


@pytest.mark.parametrize(("normal", "offset"), [((0.0, -1.0), -0.9), ((1.0, 0.0), -0.7), ((-0.6, -0.8), -1.1)])
def test_a_half_plane_is_solid_behind_its_face(normal, offset):
    """Seen at many points at least 4 pixels from the edge: there it is darker than the floor, here it is not."""
    away = np.array([5.0, 5.0, 1.0, 0.0])
    what = scene(5.0, 5.0, reference=away, corridor=0.01, obstacles=obstacles(half_planes=[(*normal, offset)]))
    frame, view = drawn(what)
    points = np.random.default_rng(0).uniform(-1.15, 1.15, size=(400, 2))
    heights = points @ normal - offset
    clear = np.abs(heights) * view.scale > 4.0
    clear &= (np.abs(np.hypot(*points.T) - 1.0) > 0.05) & (points[:, 1] > -0.9)  # neither path nor letters
    solid = np.array([colour_at(frame, view, point)[0] <= palette.SOLID[0] for point in points[clear]])
    behind = heights[clear] < 0.0
    assert behind.sum() > 5
    assert solid[behind].all()
    assert not solid[~behind].any()


def test_a_polygon_is_filled_and_a_thin_wall_is_seen():
    block = [(-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4)]
    wall = [(-0.6, 0.6), (0.6, 0.6)]
    frame, view = drawn(scene(obstacles=obstacles(polygons=[block, wall])))
    for point in [(0.0, 0.0), (-0.45, -0.35), (0.45, 0.35)]:
        assert colour_at(frame, view, point) == palette.SOLID
    column, row = view.pixels((0.3, 0.6)).astype(int)
    assert frame[row - 1 : row + 2, column, 0].min() <= palette.SOLID_EDGE[0] + 5
    assert colour_at(frame, view, (0.3, 0.52)) in (palette.CORRIDOR, palette.GRID)


def test_the_corridor_is_as_wide_as_it_says():
    frame, view = drawn(scene(5.0, 5.0, corridor=0.3))
    assert colour_at(frame, view, (-1.28 * 0.8, 1.28 * 0.6)) == palette.CORRIDOR
    assert colour_at(frame, view, (-1.33 * 0.8, 1.33 * 0.6)) == palette.GROUND
    assert colour_at(frame, view, (-0.67 * 0.8, 0.67 * 0.6)) == palette.GROUND


def test_the_trace_is_where_the_robot_was():
    viewer = Viewer("rgb_array", SQUARE)
    for time in np.linspace(0.0, 1.0, 30):
        frame = viewer.show([scene(-1.0 + 2.0 * time, 0.3, time=float(time))])
    assert frame is not None
    for x in (-0.9, -0.3, 0.4):
        column, row = view_of = np.floor(viewer.view().pixels((x, 0.3))).astype(int)
        assert view_of.min() > 0
        assert (frame[row - 1 : row + 2, column] == palette.TRACE).all(axis=1).any()


def test_an_impact_flares_up_and_fades():
    viewer = Viewer("rgb_array", SQUARE)
    point = np.array([0.2, 0.1])

    def redness(frame):
        return float(np.clip(frame[..., 0].astype(int) - frame[..., 1] - 20, 0, None).sum())

    calm = redness(viewer.show([scene(0.0, 0.0)]))
    struck = redness(viewer.show([scene(0.0, 0.0, time=0.02, impulse=np.array([1.0, 0.0]), impact_point=point)]))
    later = redness(viewer.show([scene(0.0, 0.0, time=0.3)]))
    over = redness(viewer.show([scene(0.0, 0.0, time=2.0)]))
    assert struck > later > over
    assert over == pytest.approx(calm, rel=0.1)  # the trace's dot at the same place


def test_a_failed_robot_looks_failed():
    alive, _ = drawn(scene(0.0, 0.0), follow=0.6)
    failed, _ = drawn(scene(0.0, 0.0, failed=True), follow=0.6)
    assert not (alive == palette.FAILED).all(axis=2).any()
    assert (failed == palette.FAILED).all(axis=2).sum() > 100


def test_lines_are_as_wide_as_asked_and_smooth():
    from caster_gym.render.canvas import Canvas
    from caster_gym.render.pygame_loader import pygame

    for end in [(90.0, 50.0), (90.0, 77.0), (50.0, 95.0)]:
        canvas = Canvas(100, 100)
        canvas.fill((0, 0, 0))
        canvas.line([(10.0, 20.0), end], 5.0, (255, 255, 255))
        coverage = pygame.surfarray.array3d(canvas.finished())[..., 0] / 255.0
        length = math.hypot(end[0] - 10.0, end[1] - 20.0)
        assert coverage.sum() / length == pytest.approx(5.0, abs=SMOOTH)
        assert len(np.unique(coverage)) > 5  # steps of a sixteenth between dark and light


def test_translucent_shapes_let_what_is_below_shine_through():
    from caster_gym.render.canvas import Canvas
    from caster_gym.render.pygame_loader import pygame

    canvas = Canvas(40, 40)
    canvas.fill((200, 100, 0))
    canvas.disc((20.0, 20.0), 10.0, (0, 0, 200), opacity=0.25)
    picture = pygame.surfarray.array3d(canvas.finished())
    assert_allclose(picture[20, 20], (150, 75, 50), atol=2)  # rounding of eight bits
    assert_allclose(picture[2, 2], (200, 100, 0), atol=0)
    x, y = np.argwhere(picture[..., 2] > 25).mean(axis=0) + 0.5
    assert (x, y) == pytest.approx((20.0, 20.0), abs=SMOOTH)


def test_what_is_not_finite_is_left_out():
    nowhere = scene(np.nan, np.nan)
    frame, _ = drawn(nowhere)
    assert not (frame == palette.CENTRE).all(axis=2).any()
