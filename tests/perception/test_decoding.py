"""Masks and key-points come back where training showed them, and in the frame's own pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from punnet.perception.decoding import (
    Patch,
    decode_detections,
    paste_mask,
    without_duplicates,
)
from punnet.perception.expectation import expected_iou, place_keypoints
from punnet.perception.metrics import KEYPOINT_SIGMAS as SIGMAS
from punnet.perception.network import RawDetections
from punnet.scene import PLUCKABLE, UNPLUCKABLE, Visibility

SIZE = (480, 640)


def random_detections(
    rng: np.random.Generator, count: int, cells: int = 28, side: float = 80
) -> RawDetections:
    """Blobs of masks and maps, some of them over the image's edge."""
    centres = rng.uniform((0, 0), SIZE[::-1], (count, 2))
    half = rng.uniform(0.2, 1.0, (count, 2)) * side / 2
    boxes = np.concatenate((centres - half, centres + half), axis=1)
    v, u = np.mgrid[:cells, :cells] / cells - 0.5
    masks = 1 / (1 + np.exp(30 * (np.hypot(u, v)[None] - rng.uniform(0.2, 0.4, (count, 1, 1)))))
    return RawDetections(
        boxes=boxes.astype(np.float32),
        scores=np.sort(rng.uniform(0.1, 1, count))[::-1].astype(np.float32),
        labels=rng.integers(0, 2, count),
        regions=(boxes + 0.2 * side * np.array([-1, -1, 1, 1]) * rng.uniform(size=boxes.shape)).astype(
            np.float32
        ),
        masks=masks.astype(np.float32),
        heatmaps=rng.normal(size=(count, 5, cells, cells)).astype(np.float32),
        visibility=rng.dirichlet(np.ones(4), (count, 5)).astype(np.float32),
        ripeness=rng.uniform(0, 1, count).astype(np.float32),
    )


def full(patch: Patch, size: tuple[int, int] = SIZE) -> np.ndarray:
    mask = np.zeros(size, dtype=bool)
    mask[patch.window()] = patch.inside
    return mask


def block(top: int, left: int, height: int, width: int) -> Patch:
    return Patch(top, left, np.ones((height, width), dtype=bool))


@pytest.mark.parametrize("side", [6.0, 80.0, 700.0])
def test_masks_lie_where_an_exact_resampling_puts_them(rng: np.random.Generator, side: float) -> None:
    torch = pytest.importorskip("torch")
    raw = random_detections(rng, 40, side=side)
    v, u = np.mgrid[: SIZE[0], : SIZE[1]]
    for mask, region in zip(raw.masks, raw.regions, strict=True):
        # grid_sample's own coordinates: -1 and 1 are the region's edges.
        places = np.stack(
            (
                2 * (u - region[0]) / (region[2] - region[0]) - 1,
                2 * (v - region[1]) / (region[3] - region[1]) - 1,
            ),
            axis=2,
        )
        sampled = torch.nn.functional.grid_sample(
            torch.tensor(mask[None, None]), torch.tensor(places[None].astype(np.float32)), align_corners=False
        )
        reference = sampled[0, 0].numpy() > 0.5
        ours = full(paste_mask(mask, region, SIZE, 0.5))
        assert (ours & reference).sum() >= 0.999 * (ours | reference).sum()


def test_masks_are_interpolated_without_rounding(rng: np.random.Generator) -> None:
    v, u = np.mgrid[: SIZE[0], : SIZE[1]]
    for _ in range(5):
        mask = rng.random((14, 14), dtype=np.float32)
        corner, side = rng.uniform(-20, 200, 2), rng.uniform(20, 150, 2)
        region = np.concatenate((corner, corner + side))
        cells = ((v - corner[1]) * 14 / side[1] - 0.5, (u - corner[0]) * 14 / side[0] - 0.5)
        reference = ndimage.map_coordinates(mask.astype(np.float64), cells, order=1, mode="grid-constant")
        clear = np.abs(reference - 0.5) > 1e-5
        assert (full(paste_mask(mask, region, SIZE, 0.5)) == (reference > 0.5))[clear].all()
        assert clear.mean() > 0.999


@pytest.mark.parametrize(("radius", "share"), [(6, 0.95), (12, 0.97), (60, 0.99)])
def test_a_mask_as_it_is_shown_in_training_comes_back_whole(
    rng: np.random.Generator, radius: float, share: float
) -> None:
    torch = pytest.importorskip("torch")
    from torchvision.models.detection.roi_heads import project_masks_on_boxes

    v, u = np.mgrid[: SIZE[0], : SIZE[1]]
    for centre in rng.uniform(100, 300, (20, 2)):
        berry = np.hypot(u - centre[0], v - centre[1]) < radius
        region = np.concatenate((centre - 1.3 * radius, centre + 1.3 * radius)) + rng.uniform(-2, 2, 4)
        shown = project_masks_on_boxes(
            torch.tensor(berry[None].astype(np.float32)),
            torch.tensor(region[None].astype(np.float32)),
            torch.zeros(1, dtype=torch.long),
            56,
        )
        back = full(paste_mask(shown[0].numpy(), region, SIZE, 0.5))
        assert (back & berry).sum() >= share * (back | berry).sum()


def test_a_mask_outside_the_image_is_empty(rng: np.random.Generator) -> None:
    mask = np.ones((14, 14), dtype=np.float32)
    for region in ((-50, -50, -10, -10), (700, 100, 760, 200), (10, 500, 60, 560)):
        assert paste_mask(mask, np.array(region, dtype=np.float32), SIZE, 0.5).area == 0


def test_one_berry_as_both_classes_is_kept_as_the_better() -> None:
    patches = [block(10, 10, 40, 40), block(12, 10, 40, 40), block(10, 200, 40, 40), block(10, 230, 40, 40)]
    both = np.array([PLUCKABLE, UNPLUCKABLE, UNPLUCKABLE, PLUCKABLE])
    assert without_duplicates(patches, both).tolist() == [0, 2, 3]
    # What overlaps within a class was the graph's to sort out.
    assert without_duplicates(patches[:2], both[[0, 0]]).tolist() == [0, 1]
    # A small berry before a large one shares its place, not its pixels.
    assert without_duplicates([block(10, 10, 40, 40), block(10, 10, 25, 25)], both[:2]).tolist() == [0, 1]
    assert without_duplicates([block(0, 0, 0, 0), block(5, 5, 3, 3)], both[:2]).tolist() == [1]


def test_an_unsure_berry_may_be_either_class(rng: np.random.Generator) -> None:
    one = random_detections(rng, 8)[np.arange(4)]
    raw = RawDetections(**{name: getattr(one, name)[[0, 0, 1, 1]] for name in vars(one)})
    raw = replace(
        raw,
        boxes=np.repeat(np.array([[100, 100, 180, 180], [300, 100, 380, 180]], np.float32), 2, axis=0),
        regions=np.repeat(np.array([[90, 90, 190, 190], [290, 90, 390, 190]], np.float32), 2, axis=0),
        scores=np.array([0.9, 0.6, 0.4, 0.3], np.float32),
        labels=np.array([PLUCKABLE, UNPLUCKABLE, PLUCKABLE, UNPLUCKABLE]),
    )
    best, second = decode_detections(raw, SIZE, SIZE, 0.5, SIGMAS).scores
    assert (second / best, best) == (pytest.approx(4 / 9, rel=0.3), pytest.approx(0.45, abs=0.2))
    found = decode_detections(raw, SIZE, SIZE, 0.5, SIGMAS, unsure_below=0.6 * best)
    assert found.scores.tolist() == pytest.approx([best, second, 0.75 * second])
    assert found.classes.tolist() == [PLUCKABLE, PLUCKABLE, UNPLUCKABLE]
    assert found.masks is not None
    assert found.masks.any(axis=(1, 2)).all()
    assert len(decode_detections(raw, SIZE, SIZE, 0.5, SIGMAS, unsure_below=0.95)) == 4


def test_a_score_counts_class_outline_and_points(rng: np.random.Generator) -> None:
    raw = random_detections(rng, 30)
    extents = (raw.regions[:, 2:] - raw.regions[:, :2]).astype(np.float64)
    areas = (raw.masks > 0.5).mean(axis=(1, 2)) * extents.prod(axis=1)
    _, similarity = place_keypoints(raw.heatmaps, raw.regions, areas, SIGMAS)
    there = 1 - raw.visibility[:, :, Visibility.ABSENT]
    oks = (similarity * there).sum(axis=1) / there.sum(axis=1)
    expected = np.sort(raw.scores * expected_iou(raw.masks, 0.5) ** 0.5 * oks**0.25)[::-1]
    single = replace(raw, labels=np.zeros(30, dtype=np.int64))
    assert decode_detections(single, SIZE, SIZE, 0.5, SIGMAS).scores == pytest.approx(expected, rel=1e-5)
    some = decode_detections(single, SIZE, SIZE, 0.5, SIGMAS, least_score=float(np.median(expected)))
    assert some.scores == pytest.approx(expected[:15], rel=1e-5)


def test_no_detection_is_no_berry(rng: np.random.Generator) -> None:
    none = random_detections(rng, 3)[np.arange(0)]
    assert len(decode_detections(none, SIZE, SIZE, 0.5, SIGMAS)) == 0


def test_results_hold_what_a_container_of_berries_promises(rng: np.random.Generator) -> None:
    raw = random_detections(rng, 60)
    berries = decode_detections(raw, SIZE, SIZE, 0.5, SIGMAS)
    assert 0 < len(berries) <= 60
    assert (np.diff(berries.scores) <= 0).all()
    assert berries.masks is not None
    assert berries.keypoints is not None
    assert berries.masks.any(axis=(1, 2)).all()
    absent = berries.visibility == Visibility.ABSENT
    assert absent.any()
    assert (np.isnan(berries.keypoints).all(axis=2) == absent).all()
    low, high = berries.boxes[:, None, :2], berries.boxes[:, None, 2:]
    inside = (berries.keypoints >= low - 0.5) & (berries.keypoints <= high)
    assert (inside.all(axis=2) | absent).all()
    assert berries.boxes.min() >= 0
    assert (berries.boxes[:, 2:] <= SIZE[::-1]).all()


def test_a_reduced_image_gives_the_same_berries_in_the_frame(rng: np.random.Generator) -> None:
    raw = random_detections(rng, 12)
    small = decode_detections(raw, SIZE, SIZE, 0.5, SIGMAS)
    large = decode_detections(raw, SIZE, (960, 1280), 0.5, SIGMAS)
    both = np.isfinite(small.keypoints) & np.isfinite(large.keypoints)
    assert both.sum() > 40
    expected = 2 * (small.keypoints + 0.5) - 0.5
    assert np.allclose(large.keypoints[both], expected[both])
    shares = large.masks.sum(axis=(1, 2)) / small.masks.sum(axis=(1, 2))
    assert np.median(shares) == pytest.approx(4, rel=0.1)


def test_a_huge_image_holds_as_many_masks_as_fit(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("punnet.perception.decoding.MASK_BYTES", 3 * SIZE[0] * SIZE[1])
    berries = decode_detections(random_detections(rng, 12), SIZE, SIZE, 0.5, SIGMAS)
    assert len(berries) == 3
    assert "give a smaller image" in caplog.text


@pytest.mark.parametrize("side", [6.0, 80.0, 700.0])
def test_masks_are_resampled_only_where_the_berries_are(rng: np.random.Generator, side: float) -> None:
    """However large the image; milliseconds are for benchmarks/perception.py."""
    raw = random_detections(rng, 40, side=side)
    for mask, region in zip(raw.masks, raw.regions, strict=True):
        patch = paste_mask(mask, region, SIZE, 0.5)
        first, end = np.clip(region[:2], 0, SIZE[::-1]), np.clip(region[2:], 0, SIZE[::-1])
        height, width = patch.inside.shape
        assert width <= end[0] - first[0] + 3
        assert height <= end[1] - first[1] + 3
        larger = paste_mask(mask, region, (16 * SIZE[0], 16 * SIZE[1]), 0.5)
        assert larger.inside.size <= (region[2] - region[0] + 3) * (region[3] - region[1] + 3)
