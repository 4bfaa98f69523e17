"""Mask and key-point average precision of the colour baseline on annotated photographs.

    python benchmarks/colour_baseline.py --data ../shared/data/strawdi/test --format strawdi

The figures are in docs/perception-baseline.md.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from itertools import islice

import cv2
import numpy as np

from punnet.data import CocoDataset, read_psd, read_strawdi
from punnet.perception import ColourConfig, ColourDetector
from punnet.perception.metrics import evaluate_detections
from punnet.scene import Frame, Strawberries, read_image

READERS = {"strawdi": read_strawdi, "psd": read_psd}


def detect_all(
    dataset: CocoDataset, detector: ColourDetector, limit: int | None, seconds: list[float]
) -> Iterator[Strawberries]:
    for item in islice(dataset, limit):
        frame = Frame(rgb=read_image(item.image_path), name=item.image_path.stem)
        start = time.perf_counter()
        yield detector.detect(frame)
        seconds.append(time.perf_counter() - start)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", required=True, help="folder of the data set")
    parser.add_argument("--format", required=True, choices=sorted(READERS))
    parser.add_argument("--limit", type=int, help="only the first so many images")
    parser.add_argument(
        "--ripe",
        type=float,
        default=ColourConfig().ripe,
        help="ripeness from which a berry is pluckable [%(default)s]",
    )
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the table")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    config = ColourConfig(ripe=arguments.ripe)
    dataset = READERS[arguments.format](arguments.data)
    seconds: list[float] = []
    truth = (item.berries for item in islice(dataset, arguments.limit))
    scores = evaluate_detections(truth, detect_all(dataset, ColourDetector(config), arguments.limit, seconds))
    if arguments.json:
        summary = {
            "data": arguments.data,
            "median_seconds_an_image": float(np.median(seconds)),
            **scores.to_json(),
        }
        print(json.dumps(summary, indent=2))
        return
    milliseconds = 1000 * np.median(seconds)
    print(f"{arguments.data}: {scores.images} images, {milliseconds:.0f} ms an image (median, one core)")
    print(scores.table())


if __name__ == "__main__":
    main()
