"""The picture: a PNG that others can read, and one sentence where nothing can be drawn."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sim import render


def test_a_written_picture_reads_back_pixel_for_pixel(tmp_path: Path) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (7, 5, 3), dtype=np.uint8)
    render.write_png(tmp_path / "new" / "picture.png", pixels)
    with Image.open(tmp_path / "new" / "picture.png") as image:
        np.testing.assert_array_equal(np.asarray(image), pixels)


def test_without_gl_it_says_so_in_one_sentence_and_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_gl(width: int, height: int) -> None:
        raise RuntimeError("no GL to draw with")

    monkeypatch.setattr(render, "render", no_gl)
    assert render.main(["--out", str(tmp_path / "picture.png")]) == 1
    assert capsys.readouterr().err == "The warehouse cannot be drawn here: no GL to draw with.\n"
    assert not (tmp_path / "picture.png").exists()
