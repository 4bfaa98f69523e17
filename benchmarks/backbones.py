"""The two backbones for CPUs side by side: the same steps on the same images, then accuracy and time.

python benchmarks/backbones.py --train runs/sim/train --test runs/sim/test --steps 400 --out runs/backbones
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from punnet.data.formats import read_dataset
from punnet.outputs import write_text
from punnet.perception.learned import MODEL_FILE
from punnet.train.detector.bundling import Terms, bundle_run, network_of_checkpoint
from punnet.train.detector.config import SLIM, DetectorConfig, Source
from punnet.train.detector.network import count_parameters
from punnet.train.detector.presets import read_config
from punnet.train.detector.training import TrainingRun, train_detector
from punnet.train.detector.validation import score_network

IMAGE = (480, 640)
RUNS = 30


def main() -> None:
    """Train both, score both, time both; print a table and write it as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--train", type=Path, required=True)
    parser.add_argument("--test", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=400, help="of each [%(default)s]")
    parser.add_argument("--images", type=int, default=100, help="of the test set")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    _, training = read_config("sim-fast", {"steps": arguments.steps})
    training = replace(
        training,
        validate_every=arguments.steps,
        warm_up=min(training.warm_up, arguments.steps // 4),
    )
    test = read_dataset(arguments.test).images[: arguments.images]
    rows = []
    for backbone in SLIM:
        folder = arguments.out / backbone
        began = time.perf_counter()
        checkpoint = train_detector(
            DetectorConfig.for_backbone(backbone), training, TrainingRun(folder, (Source(arguments.train),))
        )
        seconds = time.perf_counter() - began
        bundle_run(folder, folder / "bundle", name=backbone, terms=Terms(), results={}, force=True)
        network = network_of_checkpoint(checkpoint)
        scores = score_network(network, test)
        rows.append(
            {
                "backbone": backbone,
                "parameters_million": count_parameters(network) / 1e6,
                "training_seconds": seconds,
                **{f"{row.name}_mask_ap{t:g}": v for row in scores.rows[:3] for t, v in row.mask_ap.items()},
                **{
                    f"{row.name}_oks_ap{t:g}": v
                    for row in scores.rows[:3]
                    for t, v in row.keypoint_ap.items()
                },
            }
        )
    for row, milliseconds in zip(rows, latencies([arguments.out / b / "bundle" for b in SLIM]), strict=True):
        row["milliseconds"] = milliseconds
    plain = [{key: None if value != value else value for key, value in row.items()} for row in rows]
    write_text(arguments.out / "backbones.json", json.dumps(plain, indent=1) + "\n", force=True)
    for key in rows[0]:
        values = [row[key] for row in rows]
        print(f"{key:28}", *(f"{v:>26.3f}" if isinstance(v, float) else f"{v:>26}" for v in values))


def latencies(bundles: list[Path]) -> list[float]:
    """Median milliseconds of each graph on two threads, 640×480, an image without berries; they take turns."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 2
    sessions = [
        onnxruntime.InferenceSession(str(bundle / MODEL_FILE), options, ["CPUExecutionProvider"])
        for bundle in bundles
    ]
    image = np.random.default_rng(0).integers(0, 256, (1, *IMAGE, 3), dtype=np.uint8)
    feeds = {"image": image, "score_threshold": np.array(0.5, dtype=np.float32)}
    times = np.zeros((RUNS, len(sessions)))
    for turn in times:
        for k, session in enumerate(sessions):
            began = time.perf_counter()
            session.run(None, feeds)
            turn[k] = time.perf_counter() - began
    return [float(t) for t in np.median(times, axis=0) * 1e3]


if __name__ == "__main__":
    main()
