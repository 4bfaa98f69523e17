"""Image files as people have them: right, or an error that names the file; never half an image."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from punnet.errors import FileFormatError
from punnet.scene import Frame, read_image
from tests.scene.pictures import boastful_png, encoded, turned_jpeg


@pytest.fixture
def picture(rng: np.random.Generator) -> np.ndarray:
    """(48, 64, 3) of large squares, so that JPEG keeps them."""
    return np.kron(rng.integers(0, 255, (6, 8, 3), dtype=np.uint8), np.ones((8, 8, 1), dtype=np.uint8))


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp", ".tiff", ".bmp"])
@pytest.mark.parametrize("share", [0.0, 0.05, 0.5, 0.98])
def test_a_file_that_ends_too_early_is_refused(
    tmp_path: Path, picture: np.ndarray, suffix: str, share: float, capfd: pytest.CaptureFixture[str]
) -> None:
    whole = encoded(picture, suffix)
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(FileFormatError, match=f"cut\\{suffix}: not an image, damaged"):
        read_image(path)
    assert "OpenCV" not in capfd.readouterr().err


@pytest.mark.parametrize(
    "content", [b"%PDF-1.4", b"<svg/>", b"\x00" * 64, b"GIF89a" + bytes(30), boastful_png()]
)
def test_what_is_no_image_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "photo.jpg"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match=r"photo\.jpg: not an image"):
        read_image(path)
    with pytest.raises(FileFormatError, match=r"photo\.jpg: not an image"):
        Frame.from_files(path)


@settings(max_examples=60, deadline=None)
@given(
    content=st.binary(max_size=400),
    head=st.sampled_from([b"", b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"II*\x00"]),
)
def test_any_bytes_give_an_image_or_an_error_of_ours(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, head: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "bytes.png"
    path.write_bytes(head + content)
    try:
        image = read_image(path)
    except FileFormatError:
        return
    assert (image.dtype, image.ndim) == (np.uint8, 3)


# EXIF 6: the top of the scene is at the right of the stored pixels; 8: at the left; 3: upside down.
@pytest.mark.parametrize(("orientation", "quarter_turns"), [(1, 0), (3, 2), (6, 3), (8, 1)])
def test_photographs_are_turned_as_their_exif_says(
    tmp_path: Path, picture: np.ndarray, orientation: int, quarter_turns: int
) -> None:
    path = tmp_path / "turned.jpg"
    path.write_bytes(turned_jpeg(picture, orientation))
    expected = np.rot90(picture, quarter_turns)
    read = read_image(path)
    assert read.shape == expected.shape
    assert np.abs(read.astype(int) - expected).mean() < 12


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 300, 3), (300, 1, 3)])
def test_the_smallest_images_are_images(tmp_path: Path, shape: tuple[int, ...]) -> None:
    path = tmp_path / "small.png"
    path.write_bytes(encoded(np.full(shape, 77, dtype=np.uint8)))
    assert (read_image(path) == np.full(shape, 77)).all()


def test_16_bits_grey_and_alpha_become_rgb(tmp_path: Path, picture: np.ndarray) -> None:
    deep = picture.astype(np.uint16) * 257
    alpha = np.dstack((picture, np.full(picture.shape[:2], 9, dtype=np.uint8)))
    grey_alpha = picture[:, :, 0].astype(np.uint16) * 257
    for name, image, expected in (
        ("deep", deep, picture),
        ("alpha", alpha, picture),
        ("grey", picture[:, :, 0], picture[:, :, [0, 0, 0]]),
        ("deep grey", grey_alpha, picture[:, :, [0, 0, 0]]),
    ):
        (tmp_path / f"{name}.png").write_bytes(encoded(image))
        assert np.abs(read_image(tmp_path / f"{name}.png").astype(int) - expected).max() <= 1, name
