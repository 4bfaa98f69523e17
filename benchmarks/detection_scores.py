"""What scores that count outlines and key-points, and key-points that expect most of OKS, are worth.

    python benchmarks/detection_scores.py --bundle sim-fast --data berries/validation --images 250

The same raw detections are decoded in several ways: scores of the class alone with key-points at the highest cells (as
Mask R-CNN has it), key-points where most of OKS is expected, and then scores times powers of the IoU and OKS that can be
expected. Average precision by class, and the best F1 over thresholds of "is a berry" and of "is a berry of that class". Data on
which the powers are chosen should be in no test. Nothing here is random.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

import numpy as np
import torch
from numpy.typing import NDArray
from torchvision.models.detection.roi_heads import heatmaps_to_keypoints
from tqdm import tqdm

from punnet.data.dataset import AnnotatedImage
from punnet.data.formats import read_dataset
from punnet.perception import LearnedDetector, decoding
from punnet.perception.coco_scoring import Collection
from punnet.perception.comparing import truth_of_image
from punnet.perception.evaluation import UNSURE_SCORE
from punnet.perception.matching import match_masks
from punnet.perception.metrics import ScoreSettings, score_detections

POWERS = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.25), (0.5, 0.25), (1.0, 0.5), (1.0, 1.0))


def main() -> None:
    """Print a table, a row a way of decoding."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bundle", default="sim-fast")
    parser.add_argument("--data", required=True)
    parser.add_argument("--images", type=int, default=250)
    arguments = parser.parse_args()
    detector = LearnedDetector.from_bundle(arguments.bundle, unsure_score=UNSURE_SCORE)
    images = read_dataset(arguments.data).images[: arguments.images]
    print(f"{arguments.bundle}, {len(images)} images of {arguments.data}")
    print(
        "| score | masks pluckable | unpluckable | key-points pluckable | unpluckable | F1 berry | F1 class |"
    )
    print("|---|---|---|---|---|---|---|")
    with highest_cells():
        print(row("class, highest cells", detector, images, (0.0, 0.0)))
    for powers in POWERS:
        print(row(f"class · IoU^{powers[0]:g} · OKS^{powers[1]:g}", detector, images, powers))


@contextmanager
def highest_cells() -> Iterator[None]:
    """Key-points as torchvision reads them."""

    def place(
        heatmaps: NDArray[np.float32], regions: NDArray[np.float32], *_: object
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        points, _scores = heatmaps_to_keypoints(torch.from_numpy(heatmaps), torch.from_numpy(regions))
        return points[:, :, :2].double().numpy(), np.ones(heatmaps.shape[:2])

    with mock.patch.object(decoding, "place_keypoints", place):
        yield


def row(
    name: str, detector: LearnedDetector, images: list[AnnotatedImage], powers: tuple[float, float]
) -> str:
    """One way of decoding, measured."""
    collection, answers, berries = Collection(), [], 0
    with mock.patch.object(decoding, "POWERS", powers):
        for image in tqdm(images, desc=name, leave=False):
            truth, _ = truth_of_image(image)
            found = detector.detect(image.frame())
            entries = collection.add(truth, found)
            matching = match_masks(entries, score=0.0, iou=0.5)
            berries += len(truth.berries)
            for index in np.flatnonzero(~matching.overlooked):
                match = matching.truth_of[index]
                named = match >= 0 and truth.berries.classes[match] == found.classes[index]
                answers.append((found.scores[index], match >= 0, named))
    scored = score_detections(collection, ScoreSettings()).to_json()["classes"][:2]
    cells = [
        " / ".join(f"{100 * value:.1f}" for value in one[kind].values())
        for kind in ("mask_ap", "keypoint_ap")
        for one in scored
    ]
    return f"| {name} | " + " | ".join((*cells, *best_f1(np.array(answers), berries))) + " |"


def best_f1(answers: NDArray[np.float64], berries: int) -> list[str]:
    """Highest F1 of being a berry, and of being one of that class, with the score at which it is reached."""
    ordered = answers[np.argsort(-answers[:, 0], kind="stable")]
    found = np.arange(1, len(ordered) + 1)
    texts = []
    for right in (1, 2):
        f1 = 2 * np.cumsum(ordered[:, right]) / (found + berries)
        best = int(f1.argmax())
        texts.append(f"{100 * f1[best]:.1f} at {ordered[best, 0]:.2f}")
    return texts


if __name__ == "__main__":
    main()
