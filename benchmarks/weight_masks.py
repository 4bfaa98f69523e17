"""Where a detector costs a weight estimator its accuracy: one thing at a time is taken from it, the rest is true.

    python benchmarks/weight_masks.py dataset-1 [--detector sim-fast] [--estimator weight-shape]

The plants of DATA that trainings set aside; berries that can't be weighed or are not found count as wrong.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from punnet.data.formats import read_dataset
from punnet.perception.choosing import load_detector
from punnet.perception.coco_scoring import Collection
from punnet.perception.matching import match_masks
from punnet.scene import PLUCKABLE, Strawberries
from punnet.weight.choosing import load_weight_estimator
from punnet.weight.sample_split import images_of_part
from punnet.weight.samples import LEAST_OVERLAP


def mixtures(true: Strawberries, found: Strawberries) -> dict[str, Strawberries]:
    """One berry as annotated and as found, by what is taken from the detector."""
    points = {"keypoints": found.keypoints, "visibility": found.visibility}
    return {
        "nothing": true,
        "mask": replace(true, masks=found.masks),
        "key-points": replace(true, keypoints=found.keypoints),
        "visibility": replace(true, visibility=found.visibility),
        "ripeness": replace(true, ripeness=found.ripeness),
        "key-points and visibility": replace(true, **points),
        "all but these": replace(found, keypoints=true.keypoints, visibility=true.visibility),
        "all": found,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data")
    parser.add_argument("--detector", default="sim-fast")
    parser.add_argument("--estimator", help="a bundle's name or folder; what is shipped without it")
    arguments = parser.parse_args()
    detector, estimator = load_detector(arguments.detector), load_weight_estimator(arguments.estimator)
    off: dict[str, list[float]] = {}
    count = 0
    for image in images_of_part(read_dataset(arguments.data), "test"):
        counted = [annotation for annotation in image.annotations if not annotation.crowd]
        frame, truth = image.frame(), image.berries()
        found = detector.detect(frame)
        matching = match_masks(Collection().add(truth, found), score=0.0, iou=LEAST_OVERLAP)
        for row, match in enumerate(matching.found_as(len(truth)).tolist()):
            if counted[row].class_index != PLUCKABLE or not counted[row].weight > 0:
                continue
            count += 1
            seen = mixtures(truth[[row]], found[[match]]) if match >= 0 else {"nothing": truth[[row]]}
            for name, berry in seen.items():
                told = float(estimator.estimate(frame, berry).grams[0])
                off.setdefault(name, []).append(abs(told / counted[row].weight - 1.0))
    print(
        f"{count} views, {estimator.name}, {arguments.detector}; taken from the detector: % within 20%, mean error"
    )
    for name, values in off.items():
        errors = np.array(values)
        print(
            f"  {name:26} {100 * float((errors < 0.2).sum()) / count:5.1f} {100 * np.nanmean(errors):6.1f}%"
        )


if __name__ == "__main__":
    main()
