"""How ripe a berry has to look to be picked: what each rule takes and leaves, on labelled images.

    python benchmarks/ripeness_rule.py --bundle sim-fast --data berries/validation

A rule is a least ripeness, and by how much less is enough from a score on. Counted are the detections called pluckable that it
lets pass: berries to be picked, berries to be left, and what is no berry. Nothing here is random.
"""

from __future__ import annotations

import argparse
from itertools import product

import numpy as np
from tqdm import tqdm

from punnet.data.formats import read_dataset
from punnet.perception import LearnedDetector
from punnet.perception.coco_scoring import Collection
from punnet.perception.comparing import truth_of_image
from punnet.perception.matching import match_masks
from punnet.scene import PLUCKABLE, UNPLUCKABLE

NO_BERRY = -1
LEAST = (0.0, 0.8, 0.85, 0.9, 0.93)
SURE = (0.65, 0.72)
LENIENT = (0.0, 0.05, 0.1)


def main() -> None:
    """Print a table, a row a rule."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bundle", default="sim-fast")
    parser.add_argument("--data", required=True)
    arguments = parser.parse_args()
    detector = LearnedDetector.from_bundle(arguments.bundle)
    rows, ripe = [], 0
    for image in tqdm(read_dataset(arguments.data).images):
        truth, _ = truth_of_image(image)
        found = detector.detect(image.frame())
        matching = match_masks(Collection().add(truth, found), score=0.0, iou=0.5)
        ripe += int(np.count_nonzero(truth.berries.classes == PLUCKABLE))
        for index in np.flatnonzero(found.pluckable & ~matching.overlooked):
            match = matching.truth_of[index]
            kind = truth.berries.classes[match] if match >= 0 else NO_BERRY
            rows.append((found.scores[index], found.ripeness[index], kind))
    scores, ripeness, kinds = np.array(rows).T
    print(f"{arguments.bundle} on {arguments.data}: {ripe} berries to be picked")
    print("| least ripe | less by | from score | to be picked | to be left | no berry |")
    print("|---|---|---|---|---|---|")
    for least, lenient, sure in product(LEAST, LENIENT, SURE):
        if (lenient == 0.0 or least == 0.0) and (sure != SURE[0] or lenient != LENIENT[0]):
            continue
        passes = ripeness >= least - np.where(scores >= sure, lenient, 0.0)
        counts = [int(np.count_nonzero(kinds[passes] == of)) for of in (PLUCKABLE, UNPLUCKABLE, NO_BERRY)]
        print(f"| {least:g} | {lenient:g} | {sure:g} | " + " | ".join(map(str, counts)) + " |")


if __name__ == "__main__":
    main()
