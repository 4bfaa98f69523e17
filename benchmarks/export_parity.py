"""Does a bundle find in ONNX Runtime what its checkpoint finds in PyTorch? Both are given the same images.

python benchmarks/export_parity.py --bundle models/mine --checkpoint runs/mine/checkpoints/last.ckpt \
    --data berries/test --images 50
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from punnet.bundle import load_bundle
from punnet.data.formats import read_dataset
from punnet.perception import LearnedDetector
from punnet.perception.decoding import decode_detections
from punnet.perception.learned import DETECTOR_FILE, MODEL_FILE, DetectorSettings, prepare
from punnet.perception.network import Network, RawDetections
from punnet.scene import Strawberries, read_image
from punnet.train.detector.bundling import network_of_checkpoint
from punnet.train.detector.export import rounded
from punnet.train.detector.validation import TorchNetwork

MOST_PIXELS = 0.1
# Of a mask smaller than 1,000 pixels one pixel is more than that: float32 leaves pixels at the threshold to chance.
LEAST_IOU = 0.999
# The images as they are, and reduced to sizes that the export has not seen.
SCALES = (1.0, 0.6, 0.35)


def main() -> None:
    """Compare image by image; print the worst differences as JSON; fail if one is too large."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bundle", type=Path, required=True)
    parser.add_argument("--checkpoint", type=Path, required=True)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--images", type=int, default=50)
    arguments = parser.parse_args()
    bundle = load_bundle(arguments.bundle, kind="detector")
    detector = LearnedDetector.from_bundle(bundle)
    in_onnx = Network(bundle.path(MODEL_FILE), None)
    # The file holds weights in half precision; PyTorch calculates with the same.
    in_torch = TorchNetwork(rounded(network_of_checkpoint(arguments.checkpoint)))
    settings = DetectorSettings.from_json(
        bundle.read_json(DETECTOR_FILE), where=str(bundle.path(DETECTOR_FILE))
    )
    rows = []
    for number, image in enumerate(read_dataset(arguments.data).images[: arguments.images]):
        rgb = reduced(read_image(image.path), SCALES[number % len(SCALES)])
        pixels, size = prepare(rgb, settings.longest_side, settings.stride)
        one, other = (network.run(pixels, detector.score_threshold) for network in (in_onnx, in_torch))
        rows.append(differences(one, other, size, settings))
    summary = {
        "images": len(rows),
        "berries": sum(row["berries"] for row in rows),
        "images_with_another_count": sum(not row["same_count"] for row in rows),
        "box_px": max(row["box_px"] for row in rows),
        "mask_iou": min(row["mask_iou"] for row in rows),
        "masks_below": sum(row["masks_below"] for row in rows),
        "mask_pixels_in_those": max(row["pixels_below"] for row in rows),
        "keypoint_px": max(row["keypoint_px"] for row in rows),
    }
    print(json.dumps(summary, indent=2))
    good = (
        summary["berries"] > 0
        and summary["images_with_another_count"] == 0
        and summary["box_px"] <= MOST_PIXELS
        and summary["keypoint_px"] <= MOST_PIXELS
        and summary["mask_pixels_in_those"] <= 1
    )
    sys.exit(0 if good else 1)


def reduced(rgb: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """An image at another size."""
    import cv2

    if scale == 1.0:
        return rgb
    return np.asarray(cv2.resize(rgb, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def differences(
    one: RawDetections, other: RawDetections, size: tuple[int, int], settings: DetectorSettings
) -> dict[str, float]:
    """The worst differences between two lists of detections, both best first."""
    same = len(one) == len(other) and bool((one.labels == other.labels).all())
    row = {"berries": len(one), "same_count": same, "box_px": 0.0, "keypoint_px": 0.0}
    row |= {"mask_iou": 1.0, "masks_below": 0, "pixels_below": 0}
    if not same or not len(one):
        return row
    found, again = (
        decode_detections(raw, size, size, settings.mask_threshold, settings.keypoint_sigmas)
        for raw in (one, other)
    )
    row["box_px"] = float(np.abs(one.boxes - other.boxes).max())
    if len(found) != len(again):
        return row | {"same_count": False}
    return row | compared_masks(found, again) | {"keypoint_px": worst_keypoint(found, again)}


def compared_masks(one: Strawberries, other: Strawberries) -> dict[str, float]:
    """Least IoU of masks of the same berry; how many are below the bar, and the most pixels that one of those is off."""
    assert one.masks is not None
    assert other.masks is not None
    union = (one.masks | other.masks).sum(axis=(1, 2))
    shared = (one.masks & other.masks).sum(axis=(1, 2))
    iou = shared / np.maximum(union, 1)
    below = iou < LEAST_IOU
    return {
        "mask_iou": float(iou.min()),
        "masks_below": int(below.sum()),
        "pixels_below": int((union - shared)[below].max(initial=0)),
    }


def worst_keypoint(one: Strawberries, other: Strawberries) -> float:
    """Most pixels between key-points of the same berry; infinite where one has it and the other has not."""
    assert one.keypoints is not None
    assert other.keypoints is not None
    absent = np.isnan(one.keypoints), np.isnan(other.keypoints)
    if (absent[0] != absent[1]).any():
        return float("inf")
    return float(np.nanmax(np.abs(one.keypoints - other.keypoints), initial=0.0))


if __name__ == "__main__":
    main()
