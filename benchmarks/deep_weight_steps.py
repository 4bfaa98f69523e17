"""How long the deep weight estimators train: seconds a step, and what ``--quick`` and the default settings come to.

    python benchmarks/deep_weight_steps.py DATA [--models pointnet gcn …] [--quick] [--threads 2] [--berries 1330]

Trains each model for three epochs on 192 berries of DATA, a labelled set with depth and weights, and takes the
shorter of the last two; processor seconds count all threads, so they hold on a busy machine too.
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import torch

from punnet.data.formats import read_dataset
from punnet.train.weight.registry import MODELS, model_spec
from punnet.weight.samples import WeightSamples, collect_samples

TRAINED, VALIDATED = 192, 48
NOT_DEEP = {"forest", "forest_pca", "shape"}


def samples_of(path: str) -> WeightSamples:
    """The first berries of a set."""
    dataset = read_dataset(path)
    count = TRAINED + VALIDATED
    images = len(dataset.images)
    share = 120
    while True:
        samples = collect_samples(dataclasses.replace(dataset, images=dataset.images[:share]))
        if len(samples) >= count:
            return samples.subset(range(count))
        if share >= images:
            raise SystemExit(f"{path}: only {len(samples)} berries, {count} needed")
        share = min(images, 2 * share)


def epoch_times(name: str, config: object, samples: WeightSamples) -> tuple[float, float]:
    """Wall-clock and processor seconds of an epoch of ``TRAINED`` berries, its validation included."""
    marks: list[tuple[float, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        model_spec(name).fit(
            samples.subset(range(TRAINED)),
            samples.subset(range(TRAINED, TRAINED + VALIDATED)),
            dataclasses.replace(config, epochs=3, patience=0),  # type: ignore[type-var]
            seed=0,
            progress=lambda line: marks.append((time.perf_counter(), time.process_time())),
            folder=Path(folder),
        )
    wall, processor = zip(*[(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(marks)], strict=True)
    return min(wall), min(processor)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("data")
    parser.add_argument("--models", nargs="+", default=[name for name in MODELS if name not in NOT_DEEP])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--berries", type=int, default=1330, help="trained on, for the minutes in all")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    samples = samples_of(arguments.data)
    print("| model | s a step | processor s a step | epochs | minutes in all |")
    print("|---|---|---|---|---|")
    total = 0.0
    for name in arguments.models:
        spec = model_spec(name)
        config = spec.config(**(spec.quick if arguments.quick else {}))
        wall, processor = epoch_times(name, config, samples)
        steps = TRAINED // config.batch
        minutes = config.epochs * wall * arguments.berries / TRAINED / 60
        total += minutes
        print(
            f"| `{name}` | {wall / steps:.3f} | {processor / steps:.3f} | {config.epochs} | {minutes:.1f} |",
            flush=True,
        )
    print(f"{total:.0f} minutes for {arguments.berries} berries")


if __name__ == "__main__":
    main()
