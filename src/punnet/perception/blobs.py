"""Is a region a berry? Its size, shape and colour, a plausibility test and a score."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from punnet.errors import ConfigurationError
from punnet.perception.segmentation import pixel_ripeness

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
    solidity: float = 0.75
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
    chroma, texture
        Median chroma; mean absolute Laplacian of L (leaf veins and gravel are rough, fruit is not).
    contrast
        How far, in Lab, the region's median colour lies from its surroundings'.
    ripeness
        0 green-white … 1 red all over.
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
    texture: float
    contrast: float
    ripeness: float
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
    roughness = np.abs(cv2.Laplacian(lab[0], cv2.CV_16S, ksize=3))
    blobs = []
    for label, window in enumerate(ndimage.find_objects(labels), start=1):
        if window is not None:
            blobs.append(_describe(labels, label, window, lab, roughness, depth, focal))
    return blobs


def _describe(
    labels: NDArray[np.int32],
    label: int,
    window: tuple[slice, slice],
    lab: NDArray[np.uint8],
    roughness: NDArray[np.int16],
    depth: NDArray[np.float32] | None,
    focal: float | None,
) -> Blob:
    mask = _largest_part((labels[window] == label).astype(np.uint8))
    inside = mask > 0
    area = int(mask.sum())
    colours = lab[:, window[0], window[1]][:, inside]
    ripe, weight = pixel_ripeness(colours)
    median = np.median(colours, axis=1)
    solidity, aspect = _shape(mask, area)
    readings = np.zeros(0) if depth is None else depth[window][inside]
    readings = readings[readings > 0]
    distance = float(np.median(readings)) if len(readings) >= 0.1 * area and len(readings) else float("nan")
    return Blob(
        window=window,
        mask=mask,
        area=area,
        area_share=area / labels.size,
        solidity=solidity,
        aspect=aspect,
        chroma=float(np.hypot(median[1] - 128, median[2] - 128)),
        texture=float(roughness[window][inside].mean()),
        contrast=_contrast(labels, label, window, lab, median),
        ripeness=float((ripe * weight).sum() / max(float(weight.sum()), 1e-6)),
        depth=distance,
        diameter=float("nan") if focal is None else distance / focal * 2.0 * float(np.sqrt(area / np.pi)),
    )


def _largest_part(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    count, parts, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    if count <= 2:
        return mask
    return (parts == 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))).astype(np.uint8)


def _shape(mask: NDArray[np.uint8], area: int) -> tuple[float, float]:
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=len)
    hull = cv2.convexHull(outline)
    # contourArea measures between pixel centres: half the perimeter and a pixel make it comparable with a
    # count.
    hull_area = cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1
    (_, (width, height), _) = cv2.minAreaRect(outline)
    return min(1.0, area / hull_area), (max(width, height) + 1) / (min(width, height) + 1)


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
    """Confidence in [0, 1]: a logistic model of shape, size, colour and texture."""
    evidence = 12.0 * (blob.solidity - 0.88) + 0.05 * (blob.contrast - 20.0) + 2.0 * (blob.ripeness - 0.5)
    return float(1.0 / (1.0 + np.exp(-evidence)))
