"""Is a region a berry? Its size, shape and colour, a plausibility test and a score."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from punnet.errors import ConfigurationError
from punnet.perception.segmentation import pixel_ripeness
from punnet.perception.watershed import solidity

__all__ = ["Blob", "BlobConfig", "describe_blobs", "plausible", "score"]


@dataclass(frozen=True, slots=True)
class BlobConfig:
    """What a berry may look like.

    Parameters
    ----------
    largest_area
        Largest region, as a share of the image.
    solidity
        Smallest share of the convex hull that is filled.
    aspect
        Largest ratio of length to breadth.
    colourfulness
        Smallest median chroma.
    farthest
        Metres: berries beyond hang in the next row. Only with depth.
    diameter
        Metres, range of the diameter of the circle of equal area. Only with depth and intrinsics.

    Raises
    ------
    ConfigurationError
        If a range is empty.
    """

    largest_area: float = 0.45
    solidity: float = 0.65
    aspect: float = 3.0
    colourfulness: float = 13.0
    farthest: float = 1.2
    diameter: tuple[float, float] = (0.006, 0.09)

    def __post_init__(self) -> None:
        if not (
            0 < self.largest_area <= 1 and 0 < self.solidity <= 1 and self.aspect >= 1 and self.farthest > 0
        ):
            raise ConfigurationError(f"blobs: a bound is out of its range in {self}")
        if not 0 < self.diameter[0] < self.diameter[1]:
            raise ConfigurationError(f"blobs: diameter must rise, got {self.diameter}")


@dataclass(frozen=True, slots=True)
class Blob:
    """One region, measured at working size.

    Parameters
    ----------
    window
        Rows and columns of the bounding box.
    mask
        uint8 0/1 within ``window``.
    area, area_share
        Pixels; share of the image.
    solidity, aspect
        Share of the convex hull filled; length over breadth of the smallest enclosing rectangle.
    chroma
        Median chroma.
    contrast
        How far, in Lab, the region's median colour lies from its surroundings'.
    ripeness
        0 green-white … 1 red all over.
    cut
        Whether it reaches the image's edge.
    depth
        Median metres, NaN without.
    diameter
        Metres of the circle of equal area, NaN without depth and intrinsics.
    """

    window: tuple[slice, slice]
    mask: NDArray[np.uint8]
    area: int
    area_share: float
    solidity: float
    aspect: float
    chroma: float
    contrast: float
    ripeness: float
    cut: bool
    depth: float
    diameter: float


def describe_blobs(
    labels: NDArray[np.int32],
    lab: NDArray[np.uint8],
    depth: NDArray[np.float32] | None = None,
    focal: float | None = None,
) -> list[Blob]:
    """Measure every region of a label image.

    Parameters
    ----------
    labels
        (H, W) 0 background, regions from 1.
    lab
        (3, H, W) planes of :func:`~punnet.perception.segmentation.lab_planes`.
    depth
        (H, W) metres, 0 = no reading.
    focal
        Focal length in working-size pixels.
    """
    blobs = []
    for label, window in enumerate(ndimage.find_objects(labels), start=1):
        if window is not None:
            blobs.append(_describe(labels, label, window, lab, depth, focal))
    return blobs


def _describe(
    labels: NDArray[np.int32],
    label: int,
    window: tuple[slice, slice],
    lab: NDArray[np.uint8],
    depth: NDArray[np.float32] | None,
    focal: float | None,
) -> Blob:
    mask = _largest_part((labels[window] == label).astype(np.uint8))
    inside = mask > 0
    area = int(mask.sum())
    colours = lab[:, window[0], window[1]][:, inside]
    median = np.median(colours, axis=1)
    readings = np.zeros(0) if depth is None else depth[window][inside]
    readings = readings[readings > 0]
    distance = float(np.median(readings)) if len(readings) >= 0.1 * area and len(readings) else float("nan")
    return Blob(
        window=window,
        mask=mask,
        area=area,
        area_share=area / labels.size,
        solidity=solidity(mask),
        aspect=_aspect(mask),
        chroma=float(np.hypot(median[1] - 128, median[2] - 128)),
        contrast=_contrast(labels, label, window, lab, median),
        ripeness=_ripeness(mask, lab[:, window[0], window[1]]),
        cut=_at_edge(window, labels.shape),
        depth=distance,
        diameter=float("nan") if focal is None else distance / focal * 2.0 * float(np.sqrt(area / np.pi)),
    )


def _ripeness(mask: NDArray[np.uint8], lab: NDArray[np.uint8]) -> float:
    """Mean over the flesh without its rim, where calyx, leaves and background mix in."""
    reach = max(3, int(0.12 * np.sqrt(mask.sum())) | 1)
    core = cv2.erode(np.pad(mask, 1), np.ones((reach, reach), np.uint8))[1:-1, 1:-1] > 0
    inside = core if core.any() else mask > 0
    ripe, weight = pixel_ripeness(lab[:, inside])
    return float((ripe * weight).sum() / max(float(weight.sum()), 1e-6))


def _at_edge(window: tuple[slice, slice], shape: tuple[int, ...]) -> bool:
    return any(part.start == 0 or part.stop == size for part, size in zip(window, shape, strict=True))


def _largest_part(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    count, parts, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    if count <= 2:
        return mask
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    return np.asarray(parts == largest, dtype=np.uint8)


def _aspect(mask: NDArray[np.uint8]) -> float:
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    (_, (width, height), _) = cv2.minAreaRect(np.concatenate(outlines))
    return (max(width, height) + 1) / (min(width, height) + 1)


def _contrast(
    labels: NDArray[np.int32],
    label: int,
    window: tuple[slice, slice],
    lab: NDArray[np.uint8],
    median: NDArray[np.float64],
) -> float:
    reach = max(3, round(0.25 * max(window[0].stop - window[0].start, window[1].stop - window[1].start)))
    rows = slice(max(0, window[0].start - reach), window[0].stop + reach)
    columns = slice(max(0, window[1].start - reach), window[1].stop + reach)
    around = labels[rows, columns] == 0
    if not around.any():
        return 0.0
    outside = np.median(lab[:, rows, columns][:, around], axis=1)
    difference = (median - outside) * np.array([1 / 2.55, 1.0, 1.0])
    return float(np.linalg.norm(difference))


def plausible(blob: Blob, config: BlobConfig) -> bool:
    """Whether a blob passes for a berry."""
    if (
        blob.area_share > config.largest_area
        or blob.solidity < config.solidity
        or blob.aspect > config.aspect
    ):
        return False
    if blob.chroma < config.colourfulness:
        return False
    # Unknown depth and diameter are NaN, which no comparison refuses.
    smallest, largest = config.diameter
    return not (blob.depth > config.farthest or blob.diameter < smallest or blob.diameter > largest)


def score(blob: Blob) -> float:
    """Confidence in [0, 1]: a logistic model of size, shape, colour and place.

    Fitted to which detections on ``psd/dc_train`` match an annotation of their class at IoU .5 (area under
    its ROC curve there .89). Size and contrast count up to what is common there, so that close-ups are no
    surer than they should be; a berry of mixed colour may be of either class.
    """
    evidence = (
        -0.4
        + 14.0 * blob.solidity
        + 2.2 * float(np.log(min(blob.area_share, 0.011)))
        - 3.2 * float(np.log(blob.aspect))
        + 0.06 * min(blob.contrast, 40.0)
        - 0.85 * blob.cut
        + 3.7 * abs(blob.ripeness - 0.65)
    )
    return float(1.0 / (1.0 + np.exp(-evidence)))
