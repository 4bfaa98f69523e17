"""From berry-coloured pixels to one region a berry: cleaning, splitting, joining two-coloured fruit."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError
from punnet.perception.segmentation import BerryPixels
from punnet.perception.watershed import region_contacts, solidity, split_touching

__all__ = ["RegionConfig", "berry_regions", "depth_edges"]

Window = tuple[slice, slice]


@dataclass(frozen=True, slots=True)
class RegionConfig:
    """How regions are cleaned, split and joined. Lengths are shares of the shorter side of the working image.

    Parameters
    ----------
    red_opening, pale_opening
        Thickness of strands that are removed: red veins and stems; pale stems and petals are thicker.
    closing
        Gaps closed within a region: achenes, highlights.
    smallest_area
        Smallest region, as a share of the working image's area.
    neck
        A neck narrower than this share of the smaller candidate always parts two berries (watershed).
    convex
        Two candidates are one berry if their union fills at least this share of its convex hull.
    joined_solidity
        A red and a pale region are one turning berry if their union fills at least this share of its convex
        hull.
    depth_jump
        Metres between neighbouring pixels that part two berries.

    Raises
    ------
    ConfigurationError
        If a share leaves (0, 1].
    """

    red_opening: float = 0.008
    pale_opening: float = 0.018
    closing: float = 0.006
    smallest_area: float = 5e-4
    neck: float = 0.85
    convex: float = 0.87
    joined_solidity: float = 0.9
    depth_jump: float = 0.012

    def __post_init__(self) -> None:
        for name in (
            "red_opening",
            "pale_opening",
            "closing",
            "smallest_area",
            "neck",
            "convex",
            "joined_solidity",
        ):
            if not 0 < getattr(self, name) <= 1:
                raise ConfigurationError(f"regions: {name} must lie in (0, 1], got {getattr(self, name)}")


def depth_edges(depth: NDArray[np.float32], jump: float) -> NDArray[np.uint8]:
    """(H, W) 0/1: pixels at which the readings within one pixel differ by more than ``jump`` metres."""
    window = np.ones((3, 3), np.uint8)
    farthest = cv2.dilate(depth, window)
    # A pixel without reading is no edge: lift it out of the minimum.
    nearest = cv2.erode(np.where(depth > 0, depth, np.float32(1e6)), window)
    return ((farthest - nearest > jump) & (nearest < 1e6)).astype(np.uint8)


def berry_regions(
    pixels: BerryPixels, config: RegionConfig, depth: NDArray[np.float32] | None = None
) -> NDArray[np.int32]:
    """Label image (H, W): 0 background, 1 … n one berry each.

    Parameters
    ----------
    pixels
        Red, pale and leaf masks at working size.
    config
        Sizes and shares.
    depth
        (H, W) metres at working size, or None.
    """
    side = min(pixels.red.shape)
    edges = None if depth is None else depth_edges(depth, config.depth_jump)
    red = _clean(pixels.red, config.red_opening * side, config.closing * side)
    pale = _clean(pixels.pale & (1 - red), config.pale_opening * side, config.closing * side) & (1 - red)
    smallest = config.smallest_area * red.size
    labels, count = _split(red, edges, smallest, config)
    pale_labels, pale_count = _split(pale, edges, smallest, config)
    labels = np.where(pale_labels > 0, pale_labels + count, labels).astype(np.int32)
    if count and pale_count:
        labels = _join_two_coloured(labels, count, config, side)
    return labels


def _clean(mask: NDArray[np.uint8], opening: float, closing: float) -> NDArray[np.uint8]:
    closed = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(closing))
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, _disc(opening))
    return np.asarray(opened, dtype=np.uint8)


def _disc(diameter: float) -> NDArray[np.uint8]:
    size = 2 * round(diameter / 2) + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), dtype=np.uint8)


def _split(
    mask: NDArray[np.uint8], edges: NDArray[np.uint8] | None, smallest: float, config: RegionConfig
) -> tuple[NDArray[np.int32], int]:
    count, components, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=4)
    labels = np.zeros(mask.shape, np.int32)
    used = 0
    for component in range(1, count):
        left, top, width, height, area = (int(value) for value in stats[component])
        if area < smallest:
            continue
        window = (slice(top, top + height), slice(left, left + width))
        region = _fill_holes((components[window] == component).astype(np.uint8))
        near_edges = None if edges is None else np.pad(edges[window], 1)
        padded = split_touching(np.pad(region, 1), neck=config.neck, convex=config.convex, edges=near_edges)
        parts = padded[1:-1, 1:-1]
        # What is left of strands and corners is no berry of its own.
        large = np.bincount(parts.ravel()) >= smallest
        large[0] = False
        numbers = np.where(large, np.cumsum(large) + used, 0).astype(np.int32)
        free = (numbers[parts] > 0) & (labels[window] == 0)
        labels[window][free] = numbers[parts][free]
        used += int(large.sum())
    return labels, used


def _fill_holes(region: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Fill what the outline encloses, unless that is a large part: a ring of berries encloses leaves."""
    outlines, _ = cv2.findContours(region, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = cv2.drawContours(np.zeros_like(region), outlines, -1, 1, cv2.FILLED)
    return np.asarray(filled, dtype=np.uint8) if int(filled.sum()) <= 1.3 * int(region.sum()) else region


def _join_two_coloured(
    labels: NDArray[np.int32], red_count: int, config: RegionConfig, side: int
) -> NDArray[np.int32]:
    """Join a red region with the pale one that continues it, best-filling pairs first, each region once."""
    step = max(1, round(config.closing * side / 2) + 1)
    windows = _windows(labels)
    pairs: list[tuple[float, int, int]] = []
    for (red, pale), contact in region_contacts(labels, step).items():
        if not red <= red_count < pale:
            continue
        areas = [int((labels[windows[label]] == label).sum()) for label in (red, pale)]
        # They must share a good part of the smaller one's breadth, not a corner.
        if contact < 0.8 * step * np.sqrt(min(areas)):
            continue
        solidity = _union_solidity(labels, windows, red, pale)
        if solidity >= config.joined_solidity:
            pairs.append((solidity, red, pale))
    joined: set[int] = set()
    for _, red, pale in sorted(pairs, reverse=True):
        if red in joined or pale in joined:
            continue
        joined |= {red, pale}
        window = windows[pale]
        labels[window][labels[window] == pale] = red
    return labels


def _windows(labels: NDArray[np.int32]) -> dict[int, Window]:
    windows: dict[int, Window] = {}
    v, u = np.nonzero(labels)
    found = labels[v, u]
    order = np.argsort(found, kind="stable")
    for part in np.split(order, np.flatnonzero(np.diff(found[order])) + 1):
        if len(part):
            rows, columns = v[part], u[part]
            windows[int(found[part[0]])] = (
                slice(int(rows.min()), int(rows.max()) + 1),
                slice(int(columns.min()), int(columns.max()) + 1),
            )
    return windows


def _union_solidity(labels: NDArray[np.int32], windows: dict[int, Window], one: int, two: int) -> float:
    rows = slice(
        min(windows[one][0].start, windows[two][0].start), max(windows[one][0].stop, windows[two][0].stop)
    )
    columns = slice(
        min(windows[one][1].start, windows[two][1].start), max(windows[one][1].stop, windows[two][1].stop)
    )
    union = np.isin(labels[rows, columns], (one, two)).astype(np.uint8)
    closed = cv2.morphologyEx(np.pad(union, 3), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return solidity(np.asarray(closed, dtype=np.uint8))
