"""caster_gym.render.recording: films that can be read again, whole or not there."""

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled
from PIL import Image

from caster_gym.render import recording as module
from caster_gym.render.recording import check_target, recording


def frames(count, size=(48, 64)):
    """A bright square that moves to the right on a dark ground."""
    film = np.full((count, *size, 3), (20, 40, 60), dtype=np.uint8)
    for i, frame in enumerate(film):
        frame[16:32, i : i + 16] = (250, 180, 20)
    return film


def save(file, film, fps=50.0, **settings):
    with recording(file, fps, **settings) as writer:
        for frame in film:
            writer.add(frame)


def test_an_mp4_holds_every_frame(tmp_path):
    film = frames(12)
    save(tmp_path / "run.mp4", film)
    read = iio.imread(tmp_path / "run.mp4")
    assert read.shape == film.shape
    assert np.abs(read.astype(int) - film).mean() < 8  # H.264 halves the resolution of colours
    assert iio.immeta(tmp_path / "run.mp4")["fps"] == pytest.approx(50.0)
    assert [file.name for file in tmp_path.iterdir()] == ["run.mp4"]


@pytest.mark.parametrize(("fps", "count", "delay"), [(50.0, 6, 40), (25.0, 12, 40), (10.0, 12, 100)])
def test_a_gif_takes_at_most_25_frames_a_second(tmp_path, fps, count, delay):
    film = frames(12)
    save(tmp_path / "run.gif", film, fps)
    with Image.open(tmp_path / "run.gif") as picture:
        assert picture.n_frames == count
        assert picture.info["duration"] == delay
        assert picture.info["loop"] == 0
        picture.seek(count - 1)
        last = np.asarray(picture.convert("RGB")).astype(int)
    assert np.abs(last - film[:: 12 // count][-1]).max() <= 8  # the palette's


def test_a_gif_keeps_colours_that_appear_late(tmp_path):
    film = frames(40)
    film[30:, :10, :10] = (213, 62, 40)
    save(tmp_path / "run.gif", film, 25.0)
    with Image.open(tmp_path / "run.gif") as picture:
        picture.seek(39)
        assert np.abs(np.array(picture.convert("RGB").getpixel((5, 5))) - (213, 62, 40)).max() <= 8


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_an_interrupted_film_leaves_nothing(tmp_path, suffix, error):
    (tmp_path / f"run{suffix}").write_text("an older film", encoding="utf-8")
    with pytest.raises(error), recording(tmp_path / f"run{suffix}", 50.0, overwrite=True) as writer:
        for frame in frames(3):
            writer.add(frame)
        raise error
    assert [file.name for file in tmp_path.iterdir()] == [f"run{suffix}"]
    assert (tmp_path / f"run{suffix}").read_text(encoding="utf-8") == "an older film"


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_film_without_frames_is_refused(tmp_path, suffix):
    with pytest.raises(ValueError, match="a video needs at least one frame"), recording(tmp_path / f"a{suffix}", 50.0):
        pass
    assert list(tmp_path.iterdir()) == []


def test_an_mp4_of_odd_size_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"an \.mp4 needs an even width and height, got 63 × 48"):
        save(tmp_path / "run.mp4", frames(2, (48, 63)))


@pytest.mark.parametrize("name", ["run.avi", "run", "run.png"])
def test_an_unknown_suffix_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match=rf"a video must be saved as .mp4 or .gif, got '{name}'"):
        check_target(tmp_path / name)


def test_a_missing_folder_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"there is no folder .* to save run\.mp4 in"):
        check_target(tmp_path / "nowhere" / "run.mp4")


def test_a_film_is_overwritten_only_if_told_to(tmp_path):
    file = tmp_path / "run.gif"
    file.write_text("precious", encoding="utf-8")
    with pytest.raises(FileExistsError, match="is there already; choose another name or give --overwrite"):
        check_target(file)
    check_target(file, overwrite=True)
    assert file.read_text(encoding="utf-8") == "precious"
    save(file, frames(2), overwrite=True)
    assert iio.imread(file).shape[-1] == 3


def test_a_folder_of_that_name_is_refused(tmp_path):
    (tmp_path / "run.gif").mkdir()
    with pytest.raises(FileExistsError, match="is there already"):
        check_target(tmp_path / "run.gif", overwrite=True)


def test_a_folder_that_cannot_be_written_is_refused(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)  # not by its mode, since root may write anywhere
    with pytest.raises(OSError, match=r"cannot write to folder .*: Permission denied"):
        check_target(tmp_path / "run.mp4")


def test_a_missing_encoder_is_named_before_anything_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    with pytest.raises(
        DependencyNotInstalled, match=r"saving .mp4 needs imageio_ffmpeg: pip install 'caster_gym\[render\]'"
    ):
        check_target(tmp_path / "run.mp4")
