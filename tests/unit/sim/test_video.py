"""Files of every kind, read back; a file is complete or does not exist."""

import itertools
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import av
import av.codec
import numpy as np
import pytest
from PIL import Image

from sim import video
from sim.video import OutputError, Pixels, codec_for_mp4, durations, refuse_bad_output, write

FRAMES = 6
FPS = 12.5


def frames(count: int = FRAMES) -> Iterator[Pixels]:
    """A light square that moves over a dark background."""
    for number in range(count):
        picture = np.full((48, 64, 3), (20, 40, 90), np.uint8)
        picture[16:32, 6 * number : 6 * number + 16] = (230, 160, 30)
        yield picture


def read(path: Path) -> tuple[list[Pixels], float]:
    """Return all frames, and their duration [s]."""
    if path.suffix == ".mp4":
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            pictures = [
                np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in container.decode(stream)
            ]
            assert stream.duration is not None
            assert stream.time_base is not None
            return pictures, float(stream.duration * stream.time_base)
    with Image.open(path) as image:
        total_s, pictures = 0.0, list[Pixels]()
        for number in range(getattr(image, "n_frames", 1)):
            image.seek(number)
            pictures.append(np.asarray(image.convert("RGB")))
            total_s += image.info.get("duration", 0) / 1000.0
        return pictures, total_s


@pytest.mark.parametrize("suffix", [".webp", ".gif", ".mp4", ".MP4"])
def test_an_animation_has_every_frame_in_its_size_and_order_and_lasts_as_long_as_it_should(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"animation{suffix}"
    write(path, frames(), FPS)
    pictures, duration_s = read(path.rename(path.with_suffix(suffix.lower())))
    assert len(pictures) == FRAMES
    assert duration_s == pytest.approx(FRAMES / FPS, abs=0.001)
    for picture, wanted in zip(pictures, frames(), strict=True):
        assert picture.shape == (48, 64, 3)
        assert np.abs(picture.astype(int) - wanted).mean() < 8
    for a, b in itertools.pairwise(pictures):
        assert np.abs(a.astype(int) - b).max() > 60


def test_a_picture_reads_back_pixel_for_pixel_and_is_the_first_frame(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (17, 16, 3), dtype=np.uint8)
    write(tmp_path / "picture.png", iter([pixels, np.zeros_like(pixels)]), 1.0)
    (picture,), _ = read(tmp_path / "picture.png")
    np.testing.assert_array_equal(picture, pixels)


@pytest.mark.parametrize("suffix", video.SUFFIXES)
def test_what_fails_half_way_leaves_nothing_and_the_old_file_as_it_was(tmp_path: Path, suffix: str) -> None:
    def broken() -> Iterator[Pixels]:
        if suffix != ".png":
            yield from frames(2)
        raise KeyboardInterrupt

    path = tmp_path / f"old{suffix}"
    path.write_text("as it was")
    with pytest.raises(KeyboardInterrupt):
        write(path, broken(), FPS)
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [(path.name, "as it was")]


def test_a_disk_that_takes_nothing_is_reported_in_one_sentence() -> None:
    with pytest.raises(OutputError, match=r"^/proc/picture\.png cannot be written: .+\.$"):
        write(Path("/proc/picture.png"), frames(), FPS)


@pytest.mark.parametrize(
    ("name", "size", "count", "why"),
    [
        ("picture.bmp", (64, 64), 1, "ends in none of .png, .webp, .gif, .mp4"),
        ("picture", (64, 64), 1, "ends in none of"),
        ("no/picture.png", (64, 64), 1, "There is no directory .*no; make it first"),
        ("directory.png", (64, 64), 1, "is a directory"),
        ("picture.png", (video.SMALLEST - 1, 64), 1, "16 to 4096 pixels a side, not 15x64"),
        ("picture.png", (64, video.LARGEST + 1), 1, "not 64x4097"),
        ("film.mp4", (65, 64), 1, "even width and height, not 65x64"),
        ("film.webp", (1000, 1000), 301, "301 frames of 1000x1000 are too much for .webp"),
        ("film.gif", (1000, 1000), 301, "or write an .mp4"),
    ],
)
def test_what_cannot_be_is_refused_before_the_work_begins(
    tmp_path: Path, name: str, size: tuple[int, int], count: int, why: str
) -> None:
    (tmp_path / "directory.png").mkdir()
    with pytest.raises(OutputError, match=why):
        refuse_bad_output(tmp_path / name, *size, count)


@pytest.mark.parametrize("name", ["a.png", "a.WEBP", "a.gif", "a.mp4"])
def test_what_can_be_is_not_refused(tmp_path: Path, name: str) -> None:
    refuse_bad_output(tmp_path / name, video.SMALLEST, video.LARGEST, 300)


def test_without_pyav_an_mp4_is_refused_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)  # how Python marks what cannot be imported
    with pytest.raises(OutputError, match=r"An \.mp4 needs PyAV: install lifeline\[video\].*\.webp"):
        refuse_bad_output(tmp_path / "film.mp4", 64, 64, 1)
    refuse_bad_output(tmp_path / "film.webp", 64, 64, 1)


@pytest.mark.parametrize("name", video.CODECS)
def test_every_encoder_that_is_here_makes_a_film_that_reads_back_and_gives_this_process_no_priority(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    try:
        av.codec.Codec(name, "w")
    except ValueError:
        pytest.skip(f"this PyAV has no {name}")
    monkeypatch.setattr(video, "CODECS", {"no-such-encoder": {}, name: video.CODECS[name]})
    assert codec_for_mp4() == name
    path = tmp_path / "film.mp4"
    policy = os.sched_getscheduler(0)
    write(path, frames(), FPS)
    assert os.sched_getscheduler(0) == policy
    pictures, _ = read(path)
    assert len(pictures) == FRAMES
    assert np.abs(pictures[3].astype(int) - next(itertools.islice(frames(), 3, None))).mean() < 12


def test_a_pyav_without_any_encoder_for_browsers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "CODECS", {"no-such-encoder": {}})
    with pytest.raises(OutputError, match=r"none of the encoders no-such-encoder.*\.webp"):
        codec_for_mp4()


@pytest.mark.parametrize("fps", [1.0, 7.0, 15.0, 24.0, 60.0])
@pytest.mark.parametrize("step_ms", [1, 10])
def test_frames_end_when_they_should_to_the_nearest_step_and_none_is_empty(fps: float, step_ms: int) -> None:
    shown_ms = durations(100, fps, step_ms)
    for end_ms, number in zip(itertools.accumulate(shown_ms), range(100), strict=True):
        assert abs(end_ms - 1000.0 * (number + 1) / fps) <= 0.5 * step_ms + 1e-6
    assert min(shown_ms) > 0
    assert all(duration_ms % step_ms == 0 for duration_ms in shown_ms)
