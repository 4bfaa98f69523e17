"""Estimate COCO's σ of the five key-points from annotated berries (the k of thesis Eq. 3.7 is 2σ).

    python benchmarks/keypoint_constants.py --data ../shared/data/strawdi/test

COCO defines σ by the spread of several people's annotations of one object, in units of √area. Here everyone
annotated once, so the spread is what the outline does not explain: each key-point of the fully visible berries is
written in the berry's own axes (tip to calyx, and across), regressed on how far the outline reaches in the four
directions, and σ is the robust standard deviation (1.48 × median absolute deviation) of the residuals, root mean
square over both axes.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from punnet.data import read_strawdi
from punnet.perception.metrics import KEYPOINT_SIGMAS
from punnet.scene import KEYPOINTS, Strawberries, Visibility

TOP, BOTTOM = KEYPOINTS.index("top"), KEYPOINTS.index("bottom")
SMALLEST_SIDE = 25.0


def in_berry_axes(
    mask: NDArray[np.bool_], points: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Outline reach (4,) and key-points (5, 2), across and along the berry's axis, in units of √area."""
    v, u = np.nonzero(mask)
    pixels = np.column_stack((u, v)).astype(np.float64)
    up = points[TOP] - points[BOTTOM]
    up /= np.linalg.norm(up)
    axes = np.column_stack((np.array([up[1], -up[0]]), up)) / np.sqrt(len(pixels))
    outline = (pixels - pixels.mean(axis=0)) @ axes
    reach = np.concatenate((outline.max(axis=0), outline.min(axis=0)))
    return reach, (points - pixels.mean(axis=0)) @ axes


def fully_visible(berries: Strawberries) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    if berries.masks is None or berries.keypoints is None or berries.visibility is None:
        return []
    chosen = (berries.visibility == Visibility.VISIBLE).all(axis=1)
    chosen &= np.sqrt(berries.masks.sum(axis=(1, 2))) >= SMALLEST_SIDE
    return [in_berry_axes(berries.masks[i], berries.keypoints[i]) for i in np.flatnonzero(chosen)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", required=True, help="StrawDI folder with key-points")
    arguments = parser.parse_args()
    measured = [pair for image in read_strawdi(arguments.data) for pair in fully_visible(image.berries())]
    reaches = np.column_stack((np.ones(len(measured)), np.array([reach for reach, _ in measured])))
    points = np.array([found for _, found in measured]).reshape(len(measured), -1)
    residuals = points - reaches @ np.linalg.lstsq(reaches, points, rcond=None)[0]
    spread = 1.48 * np.median(np.abs(residuals), axis=0).reshape(len(KEYPOINTS), 2)
    print(f"{len(measured)} fully visible berries")
    for name, sigma, used in zip(KEYPOINTS, np.sqrt((spread**2).mean(axis=1)), KEYPOINT_SIGMAS, strict=True):
        print(f"{name:14} σ {sigma:.3f}   in use {used:.3f}")


if __name__ == "__main__":
    main()
