"""A bundle as a detector: scaling, padding, thresholds, and bundles that are not whole."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.bundle import load_bundle
from punnet.errors import BundleError, ConfigurationError
from punnet.perception import Detector, LearnedDetector, load_detector
from punnet.perception.detector import RegionDetector
from punnet.perception.learned import DETECTOR_FILE, MODEL_FILE, DetectorSettings, prepare
from punnet.scene import Frame
from tests.perception.toy_detector import PLACES, SETTINGS, VISIBILITY, write_toy_bundle


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toy_bundle(tmp_path_factory.mktemp("bundles") / "toy")


@pytest.fixture(scope="module")
def detector(bundle: Path) -> LearnedDetector:
    return LearnedDetector.from_bundle(bundle)


def photograph(height: int = 480, width: int = 640, centre: tuple[float, float] = (0.4, 0.5)) -> np.ndarray:
    """A red disc, a fifth of the height across."""
    rgb = np.full((height, width, 3), (90, 110, 80), dtype=np.uint8)
    cv2.circle(
        rgb, (round(centre[0] * width), round(centre[1] * height)), height // 10, (200, 20, 30), cv2.FILLED
    )
    return rgb


def test_it_is_a_detector_with_the_bundles_name(detector: LearnedDetector) -> None:
    assert isinstance(detector, Detector)
    assert detector.name == "toy"


# Sizes that are multiples of the stride, that are padded, that are reduced, and upright.
@pytest.mark.parametrize("size", [(480, 640), (301, 407), (1008, 756), (1500, 2000), (640, 480)])
def test_berries_come_in_the_frames_own_pixels(detector: LearnedDetector, size: tuple[int, int]) -> None:
    rgb = photograph(*size)
    berries = detector.detect(Frame(rgb))
    assert berries.image_size == size
    assert len(berries) == 1
    red = rgb[:, :, 0] > 150
    assert berries.masks is not None
    assert berries.keypoints is not None
    assert (berries.masks[0] & red).sum() > 0.9 * (berries.masks[0] | red).sum()
    v, u = np.nonzero(red)
    low, extent = np.array([u.min(), v.min()]), np.array([np.ptp(u), np.ptp(v)]) + 1
    expected = low + np.array(PLACES) * extent - 0.5
    cell = 2 * extent.max() / 28 + 2 * max(size) / 640
    seen = np.array(VISIBILITY) > 0
    assert np.abs(berries.keypoints[0, seen] - expected[seen]).max() < cell
    assert np.isnan(berries.keypoints[0, ~seen]).all()
    assert berries.visibility.tolist() == [list(VISIBILITY)]
    assert berries.ripeness[0] == pytest.approx(0.95)
    # The picking point lies above the fruit, and in the box all the same.
    assert berries.boxes[0, 1] == pytest.approx(berries.keypoints[0, 0, 1])


@pytest.mark.parametrize("size", [(480, 640), (1008, 756)])
def test_in_a_region_it_finds_what_the_whole_frame_shows_there(
    detector: LearnedDetector, size: tuple[int, int]
) -> None:
    assert isinstance(detector, RegionDetector)
    frame = Frame(photograph(*size))
    whole, (u, v), reach = detector.detect(frame), (0.4 * size[1], 0.5 * size[0]), 0.2 * size[0]
    there = detector.detect_in(frame, np.array([u - reach, v - reach, u + reach, v + reach]))
    assert (len(there), there.image_size) == (1, size)
    np.testing.assert_allclose(there.boxes, whole.boxes, atol=2)
    np.testing.assert_allclose(there.keypoints, whole.keypoints, atol=2)
    assert there.masks is not None
    assert whole.masks is not None
    assert (there.masks & whole.masks).sum() > 0.97 * (there.masks | whole.masks).sum()
    elsewhere = detector.detect_in(frame, np.array([u + reach, 0, size[1] + 99, size[0] + 99]))
    assert (len(elsewhere), elsewhere.image_size) == (0, size)


def test_a_region_beside_the_image_holds_no_berry(detector: LearnedDetector) -> None:
    frame = Frame(photograph())
    for region in ((640, 0, 700, 480), (-50, 100, -10, 200), (0, 480, 640, 480)):
        berries = detector.detect_in(frame, np.array(region, dtype=float))
        assert (len(berries), berries.image_size) == (0, (480, 640))


def test_the_shipped_network_sees_in_a_region_what_it_sees_in_the_whole_frame() -> None:
    from punnet.harvest.scenario import Scenario, Session
    from punnet.sim.world import WorldConfig

    with Session(Scenario(6, "oracle", WorldConfig(arm_visuals=False))) as session:
        frame = session.robot.look()
    sees = load_detector("sim-fast")
    whole = sees.detect(frame)
    margin = np.array([-64, -64, 64, 64])
    region = np.concatenate((whole.boxes[:, :2].min(axis=0), whole.boxes[:, 2:].max(axis=0))) + margin
    there = sees.detect_in(frame, region)
    assert len(there) == len(whole) > 1
    apart = np.linalg.norm(there.box_centres[None] - whole.box_centres[:, None], axis=2)
    there = there[apart.argmin(axis=1)]  # scores that are nearly the same may change places
    assert there.classes.tolist() == whole.classes.tolist()
    np.testing.assert_allclose(there.scores, whole.scores, atol=0.02)
    seen = np.isfinite(whole.keypoints) & np.isfinite(there.keypoints)
    assert np.abs(there.keypoints - whole.keypoints)[seen].max() < 1.5


def test_no_berry_is_an_empty_container(detector: LearnedDetector) -> None:
    for size in ((480, 640), (1, 1), (3, 2000), (31, 33)):
        berries = detector.detect(Frame(np.full((*size, 3), 90, dtype=np.uint8)))
        assert (len(berries), berries.image_size) == (0, size)


def test_a_single_red_pixel_is_no_error(detector: LearnedDetector) -> None:
    rgb = np.zeros((1, 1, 3), dtype=np.uint8)
    rgb[0, 0] = (200, 0, 0)
    assert detector.detect(Frame(rgb)).image_size == (1, 1)


def test_a_photograph_of_48_megapixels(detector: LearnedDetector) -> None:
    rgb = photograph(6000, 8000)
    berries = detector.detect(Frame(rgb))
    assert berries.masks is not None
    assert berries.masks.shape == (1, 6000, 8000)
    centre = berries.boxes[0].reshape(2, 2).mean(axis=0)
    assert abs(centre[0] - 3200) < 100


def test_the_score_threshold_is_the_bundles_unless_said(bundle: Path) -> None:
    frame = Frame(photograph())
    (score,) = LearnedDetector.from_bundle(bundle).detect(frame).scores
    below, above = score - 0.01, score + 0.01
    assert len(LearnedDetector.from_bundle(bundle, score_threshold=below).detect(frame)) == 1
    assert len(LearnedDetector.from_bundle(bundle, score_threshold=above).detect(frame)) == 0
    unsure = LearnedDetector.from_bundle(bundle, score_threshold=above, unsure_score=below)
    assert unsure.detect(frame).scores.tolist() == [score]
    assert unsure.score_threshold == above
    assert LearnedDetector.from_bundle(load_bundle(bundle)).score_threshold == SETTINGS.score_threshold
    with pytest.raises(ConfigurationError, match="score_threshold"):
        LearnedDetector.from_bundle(bundle, score_threshold=1.5)
    with pytest.raises(ConfigurationError, match="unsure_score"):
        LearnedDetector.from_bundle(bundle, unsure_score=-0.1)


def test_images_are_padded_right_and_below() -> None:
    rgb = np.full((50, 70, 3), 7, dtype=np.uint8)
    image, size = prepare(rgb, 640, 32)
    assert (image.shape, size) == ((1, 64, 96, 3), (50, 70))
    assert (image[0, :50, :70] == 7).all()
    assert image.sum() == rgb.sum(dtype=np.int64)
    image, size = prepare(np.zeros((3000, 2, 3), dtype=np.uint8), 640, 32)
    assert (image.shape, size) == ((1, 640, 32, 3), (640, 1))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"schema": "punnet-detector/9"}, "punnet-detector/9.*update punnet"),
        ({"longest_side": 0}, "longest_side"),
        ({"longest_side": "640"}, "longest_side"),
        ({"stride": 0}, "stride"),
        ({"mask_threshold": 1.5}, "mask_threshold"),
        ({"score_threshold": None}, "score_threshold"),
        ({"keypoint_sigmas": [0.1] * 4}, "five positive"),
        ({"keypoint_sigmas": "12345"}, "five positive"),
        ({"backbone": 3}, "backbone"),
    ],
)
def test_settings_are_checked(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    with pytest.raises(BundleError, match=f"detector\\.json: .*{words}"):
        LearnedDetector.from_bundle(write_toy_bundle(tmp_path / "toy", **changes))


def test_settings_survive_json_and_further_fields_are_left_alone() -> None:
    data = json.loads(json.dumps(SETTINGS.to_json())) | {"keypoint_temperature": 1.0}
    assert DetectorSettings.from_json(data, where="here") == SETTINGS
    del data["stride"]
    with pytest.raises(BundleError, match="here: fields missing"):
        DetectorSettings.from_json(data, where="here")


def test_bundles_that_are_not_whole_are_refused(tmp_path: Path) -> None:
    changed = write_toy_bundle(tmp_path / "changed")
    (changed / DETECTOR_FILE).write_text("{}")
    with pytest.raises(BundleError, match="checksum"):
        LearnedDetector.from_bundle(changed)
    missing = write_toy_bundle(tmp_path / "missing")
    (missing / MODEL_FILE).unlink()
    with pytest.raises(BundleError, match=r"model\.onnx.*missing"):
        LearnedDetector.from_bundle(missing)
    with pytest.raises(BundleError, match=r"kind 'promp'.*'detector' is needed"):
        LearnedDetector.from_bundle("promp-reach-sim")
    with pytest.raises(BundleError, match=r"model\.onnx"):
        LearnedDetector.from_bundle(write_toy_bundle(tmp_path / "corrupt", b"not a graph"))
