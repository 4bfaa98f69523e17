"""What is lost when a perfect mask goes through a detector's 56 × 56 cells and back: IoU with the annotated outline.

    python benchmarks/mask_resampling.py --data ../shared/data/strawdi/test [--longest-side 640]

Each annotated berry is shown to RoIAlign as in training, in a box that is off by 3%, and laid over the image again: by
torchvision's `paste_masks_in_image`, which rounds regions to whole pixels, and by `punnet.perception.decoding.paste_mask`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import torch
from torchvision.models.detection.roi_heads import paste_masks_in_image, project_masks_on_boxes

from punnet.perception.decoding import paste_mask

CELLS, MARGIN, STEM, JITTER = 56, 0.12, 0.3, 0.03
LEAST_AREA = 60  # pixels; of less there is no outline to speak of


def outlines(folder: Path, limit: int | None, longest_side: int) -> Iterator[np.ndarray]:
    """Masks (H, W) of the berries in StrawDI's instance-label images."""
    for path in sorted((folder / "label").glob("*.png"))[:limit]:
        labels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        scale = min(1.0, longest_side / max(labels.shape))
        labels = cv2.resize(labels, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
        for value in np.unique(labels)[1:]:
            if np.count_nonzero(labels == value) >= LEAST_AREA:
                yield labels == value


def region_of(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The region (4,) that a good detection would have: the box with the stem, a little off, enlarged."""
    v, u = np.nonzero(mask)
    box = np.array([u.min(), v.min(), u.max() + 1, v.max() + 1], dtype=float)
    extent = box[2:] - box[:2]
    box[1] -= STEM * extent[1]
    box += rng.normal(size=4) * JITTER * np.tile(extent, 2)
    edge = (box[2:] - box[:2]) * MARGIN / 2
    return np.concatenate((box[:2] - edge, box[2:] + edge)).astype(np.float32)


def overlap(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / (one | other).sum())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of StrawDI with label/*.png")
    parser.add_argument(
        "--longest-side", type=int, default=1024, help="images are reduced to it [%(default)s]"
    )
    parser.add_argument("--limit", type=int, default=40, help="only the first so many images [%(default)s]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the table")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    results: dict[str, list[float]] = {"torchvision": [], "punnet": []}
    for mask in outlines(arguments.data, arguments.limit, arguments.longest_side):
        region = region_of(mask, rng)
        shown = project_masks_on_boxes(
            torch.tensor(mask[None].astype(np.float32)),
            torch.tensor(region[None]),
            torch.zeros(1).long(),
            CELLS,
        )
        pasted = paste_masks_in_image(shown[:, None], torch.tensor(region[None]), mask.shape)
        results["torchvision"].append(overlap(pasted[0, 0].numpy() > 0.5, mask))
        patch = paste_mask(shown[0].numpy(), region.astype(np.float64), mask.shape, 0.5)
        back = np.zeros_like(mask)
        back[patch.window()] = patch.inside
        results["punnet"].append(overlap(back, mask))
    figures = {
        name: {
            "mean_iou": round(float(np.mean(v)), 4),
            "share_below_0.9": round(float(np.mean(np.array(v) < 0.9)), 4),
        }
        for name, v in results.items()
    }
    if arguments.json:
        print(json.dumps({"berries": len(results["punnet"]), **figures}, indent=2))
        return
    print(f"{len(results['punnet'])} berries, longest side {arguments.longest_side}")
    for name, row in figures.items():
        print(f"  {name:12} mean IoU {row['mean_iou']:.4f}   below .9: {100 * row['share_below_0.9']:.1f}%")


if __name__ == "__main__":
    main()
