"""Write image files atomically: PNG, animated WebP and GIF with pillow, MP4 with PyAV."""

import importlib
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wire.host.installation import how_to_install

Pixels = NDArray[np.uint8]
"""RGB, shape (height, width, 3)."""

SUFFIXES = (".png", ".webp", ".gif", ".mp4")
SMALLEST, LARGEST = 16, 4096
"""Minimum and maximum width and height of a picture, in pixels."""
MAX_MEGAPIXELS = 300
"""Maximum size of all frames of a WebP or GIF together: pillow holds them in memory, with three bytes per pixel."""

# In the order of browser support; not every build of PyAV has all of them. Not libsvtav1: under root it gives the calling thread the real-time
# priority SCHED_FIFO 99, and a process that draws then delays the supervisor on the same computer.
CODECS = {
    "libx264": {"preset": "slow", "crf": "23"},
    "libopenh264": {},
    "libvpx-vp9": {"crf": "32", "b": "0", "row-mt": "1"},
}


class OutputError(ValueError):
    """The file cannot be written; the message says why, and what to do."""


def refuse_bad_output(path: Path, width: int, height: int, frames: int) -> None:
    """Check the output before any frame is rendered.

    Raises:
        OutputError: The file's name, its directory or the picture's size is wrong, or an encoder is missing.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise OutputError(f"{path} ends in none of {', '.join(SUFFIXES)}.")
    if path.is_dir():
        raise OutputError(f"{path} is a directory.")
    directory = path.parent
    if not directory.is_dir():
        raise OutputError(f"There is no directory {directory}; make it first.")
    if not os.access(directory, os.W_OK | os.X_OK):
        raise OutputError(f"The directory {directory} may not be written to.")
    if not (SMALLEST <= width <= LARGEST and SMALLEST <= height <= LARGEST):
        raise OutputError(f"A picture has {SMALLEST} to {LARGEST} pixels a side, not {width}x{height}.")
    if suffix == ".mp4":
        if width % 2 or height % 2:
            raise OutputError(f"An .mp4 needs an even width and height, not {width}x{height}.")
        codec_for_mp4()
    elif suffix != ".png" and frames * width * height > MAX_MEGAPIXELS * 1_000_000:
        raise OutputError(
            f"{frames} frames of {width}x{height} are too much for {suffix}: "
            "make it smaller or shorter, or write an .mp4."
        )


def write(path: Path, frames: Iterable[Pixels], fps: float) -> None:
    """Write frames of equal size to a file; a PNG contains only the first frame.

    Raises:
        OutputError: The file cannot be written; no partial file remains, and an existing file is unchanged.
    """
    suffix = path.suffix.lower()
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{suffix}")
    writers: dict[str, Callable[[Path, Iterable[Pixels], float], None]] = {
        ".png": _write_png,
        ".webp": _write_webp,
        ".gif": _write_gif,
        ".mp4": _write_mp4,
    }
    try:
        writers[suffix](partial, frames, fps)
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from error
    finally:
        with suppress(OSError):
            partial.unlink()


def codec_for_mp4() -> str:
    """Return the best available encoder of PyAV for MP4.

    Raises:
        OutputError: PyAV is missing, or has no encoder that browsers support.
    """
    av = _av()
    for name in CODECS:
        with suppress(ValueError):  # PyAV raises this for a missing encoder
            av.codec.Codec(name, "w")
            return name
    raise OutputError(f"PyAV has none of the encoders {', '.join(CODECS)} here; write a .webp instead.")


def _av() -> Any:  # noqa: ANN401 - an optional package that the type checker may not find
    try:
        return importlib.import_module("av")
    except ImportError as error:
        raise OutputError(
            f"An .mp4 needs PyAV: {how_to_install('video')}, or write a .webp instead."
        ) from error


def _write_png(path: Path, frames: Iterable[Pixels], _: float) -> None:
    Image.fromarray(next(iter(frames))).save(path, format="PNG", optimize=True)


def _write_webp(path: Path, frames: Iterable[Pixels], fps: float) -> None:
    first, *others = [Image.fromarray(frame) for frame in frames]
    durations_ms = durations(1 + len(others), fps, step_ms=1)
    first.save(
        path,
        format="WEBP",
        save_all=True,
        append_images=others,
        duration=durations_ms,
        loop=0,
        quality=70,
        method=4,
    )


def _write_gif(path: Path, frames: Iterable[Pixels], fps: float) -> None:
    """Write a GIF with one palette for all frames and no dithering, so that static areas take no bytes."""
    pictures = [Image.fromarray(frame) for frame in frames]
    middle = pictures[len(pictures) // 2].quantize(256, Image.Quantize.MEDIANCUT)
    first, *others = [picture.quantize(palette=middle, dither=Image.Dither.NONE) for picture in pictures]
    durations_ms = durations(len(pictures), fps, step_ms=10)
    first.save(path, format="GIF", save_all=True, append_images=others, duration=durations_ms, loop=0)


def durations(frames: int, fps: float, step_ms: int) -> list[int]:
    """Return the duration of each frame in ms, in whole steps, so that each frame ends on time to the nearest step."""
    ends_ms = [step_ms * round(1000.0 * (number + 1) / fps / step_ms) for number in range(frames)]
    return [end_ms - begin_ms for begin_ms, end_ms in zip([0, *ends_ms], ends_ms, strict=False)]


def _write_mp4(path: Path, frames: Iterable[Pixels], fps: float) -> None:
    av, name = _av(), codec_for_mp4()
    with av.open(str(path), "w", options={"movflags": "+faststart"}) as container:
        stream: Any = None
        for frame in frames:
            if stream is None:
                stream = container.add_stream(name, rate=Fraction(fps).limit_denominator(1000))
                stream.height, stream.width = frame.shape[:2]
                stream.pix_fmt, stream.options = "yuv420p", CODECS[name]
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        if stream is not None:
            container.mux(stream.encode())
