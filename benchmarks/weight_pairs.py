"""What a weight estimator says of labelled berries, one row a berry: the input of `punnet benchmark packing`.

    python benchmarks/weight_pairs.py simulated --masks sim-fast --out pairs.csv

Ripe berries with a weight. A berry that the estimator refuses, or the detector misses, has no estimate in its row.
"""

from __future__ import annotations

import argparse
import csv
import io
from pathlib import Path

import numpy as np

from punnet.data.formats import read_dataset
from punnet.outputs import write_text
from punnet.perception.choosing import load_detector
from punnet.weight.choosing import load_weight_estimator
from punnet.weight.evaluation import weigh_samples
from punnet.weight.sample_split import PARTS, images_of_part
from punnet.weight.samples import collect_samples

COLUMNS = ("true_g", "estimate_g", "low_g", "high_g")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, help="labelled images with depth and weights")
    parser.add_argument(
        "--estimator", help="ellipsoid, a bundle's name or its folder; what is shipped without it"
    )
    parser.add_argument("--masks", help="a detector; the true masks without it")
    parser.add_argument(
        "--part", default="all", choices=PARTS, help="plants of the set, as punnet evaluate weight has them"
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--force", action="store_true")
    arguments = parser.parse_args()
    estimator = load_weight_estimator(arguments.estimator)
    detector = None if arguments.masks is None else load_detector(arguments.masks)
    images = images_of_part(read_dataset(arguments.data), arguments.part)
    samples = collect_samples(images, detector=detector)
    estimates = weigh_samples(estimator, samples)
    table = np.column_stack((samples.grams, estimates.grams, estimates.intervals))
    missed = np.full((len(samples.missed), 4), np.nan)
    missed[:, 0] = [berry.grams for berry in samples.missed]
    table = np.vstack((table, missed))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([["" if np.isnan(grams) else f"{grams:.2f}" for grams in row] for row in table])
    write_text(arguments.out, text.getvalue(), force=arguments.force)
    print(
        f"{arguments.out}: {len(table)} berries, {np.isnan(table[:, 1]).sum()} without an estimate, by {estimator.name}"
    )


if __name__ == "__main__":
    main()
