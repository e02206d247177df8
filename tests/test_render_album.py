"""caster_gym.render.album: frames of many robots, each as a viewer of its own draws it."""

from numpy.testing import assert_array_equal

from caster_gym.render.album import Album
from caster_gym.render.viewer import Viewer
from tests.scenes import CIRCLE, scene

SMALL = (320, 240)


def test_each_robot_has_the_frame_of_a_viewer_of_its_own():
    """Its trace included, on paths that take turns, though all are drawn on the same canvases."""
    album, viewers = Album(SMALL), [Viewer("rgb_array", SMALL) for _ in range(3)]
    for step in range(4):
        places = [(0.1 * step, 0.0), (0.0, 0.2 * step), (0.3, 0.1 * step)]
        moment = [scene(x, y, time=0.02 * step, path=(1 + i % 2) * CIRCLE) for i, (x, y) in enumerate(places)]
        frames = album.show(moment)
        assert isinstance(frames, tuple)
        for frame, viewer, one in zip(frames, viewers, moment, strict=True):
            assert_array_equal(frame, viewer.show([one]))


def test_another_number_of_robots_starts_anew():
    album = Album(SMALL)
    album.show([scene(0.5, 0.0), scene(0.0, 0.0)])
    (frame,) = album.show([scene(0.1, 0.0)])
    assert_array_equal(frame, Viewer("rgb_array", SMALL).show([scene(0.1, 0.0)]))
