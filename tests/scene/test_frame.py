import json

import cv2
import numpy as np
import pytest

from punnet.errors import FileFormatError, OutputExistsError, ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.scene import Frame, read_image

CAMERA = CameraIntrinsics(32, 24, 30.0, 30.0, 15.5, 11.5)


def a_frame(rng, **changes):
    values = {
        "rgb": rng.integers(0, 255, (24, 32, 3), dtype=np.uint8),
        "depth": np.round(rng.uniform(0, 2, (24, 32)), 3).astype(np.float32),
        "camera": CAMERA,
        "T_base_camera": np.eye(4),
        "timestamp": 1.25,
        "name": "plant 7",
        **changes,
    }
    return Frame(**values)


def test_a_folder_holds_a_frame_without_loss(tmp_path, rng):
    frame = a_frame(rng)
    loaded = Frame.load(frame.save(tmp_path / "frame"))
    assert (loaded.rgb == frame.rgb).all()
    assert np.allclose(loaded.depth, frame.depth, atol=1e-6)
    assert (loaded.camera, loaded.timestamp, loaded.name) == (CAMERA, 1.25, "frame")
    assert np.allclose(loaded.T_base_camera, np.eye(4))


def test_depth_too_far_for_16_bits_becomes_no_reading(tmp_path, rng):
    depth = np.full((24, 32), 70.0, dtype=np.float32)
    assert (Frame.load(a_frame(rng, depth=depth).save(tmp_path / "f")).depth == 0).all()


def test_rgb_alone_is_a_frame(tmp_path, rng):
    bare = Frame(rng.integers(0, 255, (24, 32, 3), dtype=np.uint8))
    loaded = Frame.load(bare.save(tmp_path / "f"))
    assert loaded.depth is None
    assert loaded.camera is None


def test_nothing_is_overwritten_unless_told(tmp_path, rng):
    first, second = a_frame(rng), a_frame(rng)
    first.save(tmp_path / "f")
    with pytest.raises(OutputExistsError, match="--force"):
        second.save(tmp_path / "f")
    assert (Frame.load(tmp_path / "f").rgb == first.rgb).all()
    second.save(tmp_path / "f", force=True)
    assert (Frame.load(tmp_path / "f").rgb == second.rgb).all()
    assert [path.name for path in tmp_path.iterdir()] == ["f"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rgb": np.zeros((24, 32), np.uint8)}, "rgb must be uint8"),
        ({"rgb": np.zeros((24, 32, 3), np.float32)}, "rgb must be uint8"),
        ({"depth": np.zeros((12, 32), np.float32)}, "align the depth"),
        ({"depth": np.full((24, 32), -1, np.float32)}, "≥ 0"),
        ({"depth": np.full((24, 32), np.nan, np.float32)}, "finite"),
        ({"camera": CameraIntrinsics(64, 48, 30.0, 30.0, 1.0, 1.0)}, "camera is for 64×48"),
        ({"T_base_camera": 2 * np.eye(4)}, "rigid transform"),
    ],
)
def test_contradictions_are_refused(rng, changes, message):
    with pytest.raises(ShapeError, match=message):
        a_frame(rng, **changes)


def test_real_camera_files_with_their_own_depth_scale(tmp_path, rng):
    cv2.imwrite(str(tmp_path / "a.png"), rng.integers(0, 255, (24, 32, 3), dtype=np.uint8))
    cv2.imwrite(str(tmp_path / "d.png"), np.full((24, 32), 4000, np.uint16))
    flat = {"width": 32, "height": 24, "fx": 30.0, "fy": 30.0, "ppx": 15.5, "ppy": 11.5, "depth_scale": 1e-4}
    (tmp_path / "c.json").write_text(json.dumps(flat))
    frame = Frame.from_files(tmp_path / "a.png", depth=tmp_path / "d.png", camera=tmp_path / "c.json")
    assert np.allclose(frame.depth, 0.4)


def test_faulty_files_are_named(tmp_path, rng):
    good = tmp_path / "a.png"
    cv2.imwrite(str(good), rng.integers(0, 255, (24, 32, 3), dtype=np.uint8))
    (tmp_path / "cut.jpg").write_bytes(b"\xff\xd8\xff\xe0 not much of a JPEG")
    (tmp_path / "c.json").write_text("{")
    (tmp_path / "list.json").write_text("[]")
    cv2.imwrite(str(tmp_path / "d8.png"), np.zeros((24, 32), np.uint8))
    for path, message in (("none.png", "no such file"), (".", "is a folder"), ("cut.jpg", "damaged")):
        with pytest.raises(FileFormatError, match=message):
            read_image(tmp_path / path)
    with pytest.raises(FileFormatError, match="16-bit"):
        Frame.from_files(good, depth=tmp_path / "d8.png")
    with pytest.raises(FileFormatError, match="not readable as JSON"):
        Frame.from_files(good, camera=tmp_path / "c.json")
    with pytest.raises(FileFormatError, match="JSON object"):
        Frame.from_files(good, camera=tmp_path / "list.json")


def test_grey_16_bit_and_transparent_images_become_rgb(tmp_path):
    for name, image in (
        ("grey", np.full((4, 5), 200, np.uint8)),
        ("deep", np.full((4, 5, 3), 51400, np.uint16)),
        ("alpha", np.full((4, 5, 4), 200, np.uint8)),
    ):
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
        rgb = read_image(tmp_path / f"{name}.png")
        assert rgb.shape == (4, 5, 3)
        assert abs(int(rgb[0, 0, 0]) - 200) <= 1
