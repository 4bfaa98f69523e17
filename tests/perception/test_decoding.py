"""Masks and key-points are read off as torchvision reads them, and in the frame's own pixels."""

from __future__ import annotations

import time

import numpy as np
import pytest

from punnet.perception.decoding import (
    Patch,
    decode_detections,
    decode_heatmaps,
    paste_mask,
    without_duplicates,
)
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


@pytest.mark.parametrize("side", [3.0, 80.0, 700.0])
def test_masks_lie_where_torchvision_pastes_them(rng: np.random.Generator, side: float) -> None:
    torch = pytest.importorskip("torch")
    from torchvision.models.detection.roi_heads import paste_masks_in_image

    raw = random_detections(rng, 40, side=side)
    expected = paste_masks_in_image(torch.tensor(raw.masks[:, None]), torch.tensor(raw.regions), SIZE)
    for mask, region, reference in zip(raw.masks, raw.regions, expected[:, 0].numpy() > 0.5, strict=True):
        ours = full(paste_mask(mask, region, SIZE, 0.5))
        assert (ours & reference).sum() >= 0.999 * (ours | reference).sum()


@pytest.mark.parametrize("side", [1.5, 80.0, 300.0])
def test_keypoints_are_those_that_torchvision_reads(rng: np.random.Generator, side: float) -> None:
    torch = pytest.importorskip("torch")
    from torchvision.models.detection.roi_heads import heatmaps_to_keypoints

    raw = random_detections(rng, 30, side=side)
    expected, _ = heatmaps_to_keypoints(torch.tensor(raw.heatmaps), torch.tensor(raw.regions))
    assert np.abs(decode_heatmaps(raw.heatmaps, raw.regions) - expected[:, :, :2].numpy()).max() < 0.01


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


def test_results_hold_what_a_container_of_berries_promises(rng: np.random.Generator) -> None:
    raw = random_detections(rng, 60)
    berries = decode_detections(raw, SIZE, SIZE, 0.5)
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
    small = decode_detections(raw, SIZE, SIZE, 0.5)
    large = decode_detections(raw, SIZE, (960, 1280), 0.5)
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
    berries = decode_detections(random_detections(rng, 12), SIZE, SIZE, 0.5)
    assert len(berries) == 3
    assert "give a smaller image" in caplog.text


def test_twelve_berries_take_five_milliseconds(rng: np.random.Generator) -> None:
    raw = random_detections(rng, 12)
    times = []
    for _ in range(20):
        begin = time.perf_counter()
        decode_detections(raw, SIZE, SIZE, 0.5)
        times.append(time.perf_counter() - begin)
    assert min(times) < 0.005
