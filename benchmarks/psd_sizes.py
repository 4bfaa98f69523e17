"""Widths of real farm berries in millimetres, from PSD's polygons and the depth that some of them have.

    python benchmarks/psd_sizes.py ../shared/data/psd/rh_test [--focal 900]

PSD's ``depth_mm`` is the mean raw depth on a berry; neither its unit nor the camera's focal length is documented: 900
pixels at 1280×720 is what a RealSense has about, and millimetres are what the values fit. The width is that of
the polygon across its longest extent, at that depth as `punnet weigh` takes sizes: on the plane across the line of
sight, where the outline is. Ripe berries that are hardly hidden (ripeness 3, hardness at most 1) count; their median is held
against 30 mm, and should be within 15% of it.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage
from punnet.data.psd import read_psd
from punnet.geometry import CameraIntrinsics
from punnet.weight.silhouette import measure_silhouette

EXPECTED_MM, TOLERANCE = 30.0, 0.15
RIPE, MOST_HARDNESS = 3, 1


def depths_of(folder: Path) -> dict[int, float]:
    """Metres by the id of the annotation, of those that have a depth."""
    annotations = json.loads((folder / "coco.json").read_text(encoding="utf-8"))["annotations"]
    found = {entry["id"]: entry.get("depth_mm") for entry in annotations}
    return {identity: depth / 1000.0 for identity, depth in found.items() if depth}


def widths_of(image: AnnotatedImage, depths: dict[int, float], focal: float) -> list[float]:
    """Millimetres, of the ripe berries with depth that are hardly hidden."""
    height, width = image.size
    camera = CameraIntrinsics(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2)
    wanted = [
        index
        for index, annotation in enumerate(image.annotations)
        if annotation.id in depths
        and annotation.extra.get("ripeness_code") == RIPE
        and annotation.extra.get("hardness", 0) <= MOST_HARDNESS
    ]
    if not wanted:
        return []
    masks = image.berries().masks
    assert masks is not None
    return [
        1000.0 * width_at(camera, masks[index], depths[image.annotations[index].id])
        for index in wanted
        if masks[index].any()
    ]


def width_at(camera: CameraIntrinsics, mask: NDArray[np.bool_], depth: float) -> float:
    """Metres across the longest extent of a mask whose front is ``depth`` away on the mean."""
    outline = measure_silhouette(camera, mask)
    sine = math.sin(math.atan(math.sqrt(outline.area / math.pi)))
    middle = depth / (1.0 - math.sqrt(0.5) * sine)
    return outline.width * middle * math.sqrt(1.0 - sine**2)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="a folder of PSD")
    parser.add_argument("--focal", type=float, default=900.0, help="pixels")
    arguments = parser.parse_args()
    depths = depths_of(arguments.data)
    if not depths:
        raise SystemExit(f"{arguments.data}: no berry has depth_mm; of PSD's parts only rh_test has")
    widths = [
        width for image in read_psd(arguments.data) for width in widths_of(image, depths, arguments.focal)
    ]
    if not widths:
        raise SystemExit(f"{arguments.data}: {len(depths)} berries have depth, none of them ripe and free")
    median = float(np.median(widths))
    off = median / EXPECTED_MM - 1.0
    print(
        f"{len(widths)} ripe berries of {len(depths)} with depth: median width {median:.1f} mm, middle half "
        f"{np.percentile(widths, 25):.1f} to {np.percentile(widths, 75):.1f}; {100 * off:+.0f}% of {EXPECTED_MM:.0f} mm, "
        f"{'within' if abs(off) <= TOLERANCE else 'NOT within'} {100 * TOLERANCE:.0f}%"
    )


if __name__ == "__main__":
    main()
