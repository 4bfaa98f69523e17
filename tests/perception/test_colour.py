"""The colour detector on drawn scenes with known answers, on bad input and on real photographs."""

from __future__ import annotations

import resource
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy import ndimage

from punnet.errors import ConfigurationError, FileFormatError
from punnet.geometry import CameraIntrinsics, make_transform, rotation_from_vector
from punnet.perception import ColourConfig, ColourDetector, Detector
from punnet.perception.colour import box_around, gravity_up
from punnet.scene import KEYPOINTS, PLUCKABLE, UNPLUCKABLE, Frame, Strawberries, Visibility, read_image
from tests.perception.drawings import GRAVEL, LEAF, PALE, RIPE, TURNING, gravel, hang_berry, iou
from tests.timing import times_as_long

CAMERA = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
PICKING, TOP, BOTTOM, LEFT, RIGHT = range(len(KEYPOINTS))


def detect(image: np.ndarray, **frame: object) -> Strawberries:
    return ColourDetector().detect(Frame(rgb=image, **frame))


def test_is_a_detector() -> None:
    assert isinstance(ColourDetector(), Detector)


def test_finds_a_ripe_berry_with_mask_and_class() -> None:
    image = gravel()
    fruit = hang_berry(image, (320, 240))
    berries = detect(image)
    assert len(berries) == 1
    assert iou(berries.masks[0], fruit) > 0.9
    assert berries.classes[0] == PLUCKABLE
    assert berries.ripeness[0] > 0.9
    assert berries.scores[0] > 0.5


@pytest.mark.parametrize(("colour", "ripest"), [(TURNING, 0.8), (PALE, 0.1)])
def test_turning_and_green_berries_are_unpluckable(colour: tuple[int, int, int], ripest: float) -> None:
    image = gravel()
    fruit = hang_berry(image, (320, 240), colour=colour)
    berries = detect(image)
    assert len(berries) == 1
    assert berries.classes[0] == UNPLUCKABLE
    assert berries.ripeness[0] <= ripest
    assert iou(berries.masks[0], fruit) > 0.8


def test_two_coloured_berry_is_one_berry() -> None:
    image = gravel()
    fruit = hang_berry(image, (320, 240), length=80, width=62)
    upper = fruit.copy()
    upper[240:] = False
    image[upper] = PALE
    berries = detect(image)
    assert len(berries) == 1
    assert iou(berries.masks[0], fruit) > 0.85
    assert 0.2 < berries.ripeness[0] < 0.8


def test_touching_berries_are_parted() -> None:
    image = gravel()
    masks = [hang_berry(image, centre) for centre in ((290, 240), (333, 246), (312, 296))]
    berries = detect(image)
    assert len(berries) == 3
    for mask in masks:
        assert max(iou(mask, found) for found in berries.masks) > 0.75


@pytest.mark.parametrize("tilt", [-35.0, 0.0, 35.0])
def test_keypoints_follow_the_berry(tilt: float) -> None:
    image = gravel()
    hang_berry(image, (320, 240), length=80, width=58, tilt_deg=tilt)
    points = detect(image).keypoints[0]
    turn = np.radians(tilt)
    up = np.array([-np.sin(turn), -np.cos(turn)])
    assert np.linalg.norm(points[BOTTOM] - (np.array([320, 240]) - 40 * up)) < 12
    assert np.linalg.norm(points[TOP] - (np.array([320, 240]) + 40 * up)) < 12
    assert points[LEFT, 0] < points[TOP, 0] + 5 < points[RIGHT, 0] + 10
    assert points[PICKING, 1] < points[TOP, 1]


def test_picking_point_lies_on_the_stem_and_is_visible() -> None:
    image = gravel()
    hang_berry(image, (320, 240), length=80, width=58)
    berries = detect(image)
    assert abs(berries.keypoints[0, PICKING, 0] - 320) < 2.5
    assert (berries.visibility[0] == Visibility.VISIBLE).all()


def test_picking_height_is_metric_with_depth() -> None:
    image = gravel()
    hang_berry(image, (320, 240))
    for distance in (0.35, 0.6):
        berries = detect(image, depth=np.full((480, 640), distance, np.float32), camera=CAMERA)
        height = np.linalg.norm(berries.keypoints[0, PICKING] - berries.keypoints[0, TOP])
        assert height * distance / CAMERA.fy == pytest.approx(0.015, abs=0.0025)


def test_boxes_contain_mask_and_keypoints() -> None:
    image = gravel()
    for centre in ((100, 200), (300, 240), (560, 420), (620, 60)):
        hang_berry(image, centre)
    berries = detect(image)
    assert len(berries) == 4
    for box, mask, points in zip(berries.boxes, berries.masks, berries.keypoints, strict=True):
        v, u = np.nonzero(mask)
        known = points[np.isfinite(points).all(axis=1)]
        assert box[0] <= min(u.min(), known[:, 0].min())
        assert box[1] <= min(v.min(), known[:, 1].min())
        assert box[2] >= max(u.max(), known[:, 0].max())
        assert box[3] >= max(v.max(), known[:, 1].max())
        assert (box >= 0).all()
        assert (box <= [640, 480, 640, 480]).all()


def test_keypoint_outside_the_image_is_absent() -> None:
    image = gravel()
    hang_berry(image, (320, 32))
    berries = detect(image)
    assert berries.visibility[0, PICKING] == Visibility.ABSENT
    assert np.isnan(berries.keypoints[0, PICKING]).all()
    assert np.isfinite(berries.keypoints[0, BOTTOM]).all()


def test_far_berries_are_dropped_with_depth() -> None:
    image = gravel()
    hang_berry(image, (200, 240))
    hang_berry(image, (440, 240))
    depth = np.full((480, 640), 0.5, np.float32)
    depth[:, 320:] = 1.5
    berries = detect(image, depth=depth, camera=CAMERA)
    assert len(berries) == 1
    assert berries.box_centres[0, 0] < 320


def test_depth_parts_what_colour_cannot() -> None:
    image = gravel()
    cv2.ellipse(image, (320, 240), (48, 40), 0, 0, 360, RIPE, cv2.FILLED)
    depth = np.full((480, 640), 0.9, np.float32)
    red = (image == RIPE).all(axis=2)
    depth[red] = 0.50
    depth[red & (np.arange(640) >= 325)] = 0.56
    assert len(detect(image)) == 1
    assert len(detect(image, depth=depth, camera=CAMERA)) == 2


def test_nothing_in_front_is_hidden_and_something_is() -> None:
    image = gravel()
    hang_berry(image, (320, 240), length=80, width=58)
    depth = np.full((480, 640), 0.5, np.float32)
    assert detect(image, depth=depth, camera=CAMERA).visibility[0, LEFT] == Visibility.VISIBLE
    depth[:, 285:303] = 0.3
    assert detect(image, depth=depth, camera=CAMERA).visibility[0, LEFT] == Visibility.HIDDEN_BY_OTHER


def test_camera_pose_tells_where_up_is() -> None:
    level = make_transform(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.zeros(3))
    image = gravel()
    assert gravity_up(Frame(rgb=image, T_base_camera=level)) == pytest.approx([0.0, -1.0])
    # Rolled by a quarter turn about its optical axis, the camera sees the plant lying on its side.
    roll = make_transform(rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])), np.zeros(3))
    assert gravity_up(Frame(rgb=image, T_base_camera=level @ roll)) == pytest.approx([-1.0, 0.0])


def test_box_around_ignores_unknown_keypoints() -> None:
    points = np.full((5, 2), np.nan)
    assert box_around(np.array([10.0, 20, 30, 40]), points, (480, 640)).tolist() == [10, 20, 30, 40]
    points[0] = (12, 5)
    assert box_around(np.array([10.0, 20, 30, 40]), points, (480, 640)).tolist() == [10, 5, 30, 40]


def empty_pictures() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    sky = np.tile(np.linspace(150, 250, 480)[:, None, None], (1, 640, 3)).astype(np.uint8)
    return {
        "black": np.zeros((480, 640, 3), np.uint8),
        "white": np.full((480, 640, 3), 255, np.uint8),
        "red": np.full((480, 640, 3), RIPE, np.uint8),
        "leaf": np.full((480, 640, 3), LEAF, np.uint8),
        "ground": np.full((480, 640, 3), GRAVEL, np.uint8),
        "gravel": gravel(),
        "sky": sky,
        "grey noise": np.repeat(rng.integers(0, 256, (480, 640, 1)), 3, axis=2).astype(np.uint8),
        "one pixel": np.full((1, 1, 3), RIPE, np.uint8),
        "one row": np.full((1, 900, 3), RIPE, np.uint8),
        "sliver": np.full((900, 20, 3), GRAVEL, np.uint8),
    }


@pytest.mark.parametrize("name", list(empty_pictures()))
def test_picture_without_berries_gives_none(name: str) -> None:
    image = empty_pictures()[name]
    berries = detect(image)
    assert len(berries) == 0
    assert berries.image_size == image.shape[:2]


def test_long_narrow_picture_works() -> None:
    image = gravel(100, 4000)
    hang_berry(image, (2000, 60), length=50, width=40)
    assert len(detect(image)) == 1


def test_same_picture_same_answer() -> None:
    image = gravel()
    hang_berry(image, (320, 240))
    one, two = detect(image), detect(image)
    assert one.to_json() == two.to_json()


@pytest.mark.parametrize("kind", ["grey", "alpha", "16 bit"])
def test_every_kind_of_file_is_read(tmp_path: Path, kind: str) -> None:
    image = gravel()
    hang_berry(image, (320, 240))
    stored = {
        "grey": cv2.cvtColor(image, cv2.COLOR_RGB2GRAY),
        "alpha": cv2.cvtColor(image, cv2.COLOR_RGB2BGRA),
        "16 bit": image[:, :, ::-1].astype(np.uint16) * 257,
    }[kind]
    path = tmp_path / "photo.png"
    cv2.imwrite(str(path), stored)
    berries = detect(read_image(path))
    assert len(berries) == (0 if kind == "grey" else 1)


def test_truncated_photograph_is_told(tmp_path: Path) -> None:
    path = tmp_path / "photo.jpg"
    cv2.imwrite(str(path), gravel())
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(FileFormatError, match=r"photo\.jpg"):
        read_image(path)


def test_huge_photograph_in_bounded_memory() -> None:
    tile = np.full((1000, 400, 3), GRAVEL, np.uint8)
    hang_berry(tile, (200, 600), length=300, width=240)
    image = np.tile(tile, (6, 20, 1))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    berries = detect(image)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    # 48 MB a mask: the best that fit in 4 GB of address space are kept, of which only the fruit takes memory.
    assert len(berries) == 83
    assert grown < 1200


def test_most_berries_keeps_the_best() -> None:
    image = gravel()
    for column in range(5):
        hang_berry(image, (80 + 115 * column, 240), length=40 + 8 * column, width=32 + 6 * column)
    every = detect(image)
    two = ColourDetector(ColourConfig(most_berries=2)).detect(Frame(rgb=image))
    assert len(every) == 5
    assert two.scores.tolist() == every.scores[:2].tolist() == sorted(every.scores)[-1:-3:-1]


@pytest.mark.parametrize(
    "settings", [{"ripe": 0.0}, {"ripe": 1.0}, {"score": 1.0}, {"working_pixels": 10}, {"most_berries": 0}]
)
def test_settings_out_of_range_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigurationError, match="colour detector"):
        ColourConfig(**settings)


@pytest.mark.parametrize("folder", ["psd/dc_train", "psd/rh_train", "strawdi/test"])
def test_real_photographs_have_ripe_berries(shared_data: Path, folder: str) -> None:
    detector = ColourDetector()
    photographs = sorted((shared_data / folder / "img").glob("*.jpg"))[::40]
    found = sum(int(detector.detect(Frame(rgb=read_image(path))).pluckable.sum()) for path in photographs)
    assert found >= len(photographs) / 2


def test_quick_enough_for_a_camera() -> None:
    image = gravel()
    for column in range(6):
        for row in range(2):
            hang_berry(image, (60 + 100 * column, 150 + 190 * row))
    frame = Frame(rgb=image)
    detector, floats = ColourDetector(), image.astype(np.float32)
    # Four to five times as long as a blur of the image; 55 ms on one core, where the bar is 60.
    assert (
        times_as_long(lambda: detector.detect(frame), lambda: ndimage.gaussian_filter(floats, (2, 2, 0))) < 9
    )
