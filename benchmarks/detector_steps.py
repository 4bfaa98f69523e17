"""Seconds and page faults of a training step of the detector, with freed memory kept and without.

    python benchmarks/detector_steps.py --data berries/train --steps 60

Each way trains in a fresh process, from the preset `sim-fast`; they take turns, the first ten steps do not count. Seed 0.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from contextlib import nullcontext
from pathlib import Path
from statistics import median
from unittest import mock

WARM_UP = 10


def main() -> None:
    """Take turns, print the medians as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--turns", type=int, default=2)
    parser.add_argument("--way", choices=("kept", "given back"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.way:
        train(arguments)
        return
    found: dict[str, list[dict[str, float]]] = {"kept": [], "given back": []}
    for _ in range(arguments.turns):
        for way, turns in found.items():
            command = [sys.executable, __file__, *sys.argv[1:], "--way", way]
            printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            turns.append(json.loads(printed.splitlines()[-1]))
    print(
        json.dumps({way: {k: median(t[k] for t in turns) for k in turns[0]} for way, turns in found.items()})
    )


def train(arguments: argparse.Namespace) -> None:
    """One way: steps of a run in a scratch folder."""
    from lightning.pytorch.callbacks import Callback

    from punnet.train import loops
    from punnet.train.detector import training
    from punnet.train.detector.config import DetectorConfig, DetectorTraining, Source

    class Clock(Callback):
        """Notes the time and the faults after each step."""

        def __init__(self) -> None:
            self.seconds, self.faults = [], []

        def on_train_batch_end(self, *_: object) -> None:
            self.seconds.append(time.perf_counter())
            self.faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)

    clock, usual = Clock(), training._trainer

    def with_clock(*given: object) -> object:
        trainer = usual(*given)
        trainer.callbacks.append(clock)
        return trainer

    settings = DetectorTraining(
        steps=arguments.steps,
        batch=4,
        crop=(320, 416),
        learning_rate=8e-4,
        precision="bf16-mixed",
        validate_every=arguments.steps,
    )
    giving_back = mock.patch.object(loops, "_keep_freed_memory")
    with (
        tempfile.TemporaryDirectory() as scratch,
        mock.patch.object(training, "_trainer", with_clock),
        giving_back if arguments.way == "given back" else nullcontext(),
    ):
        run = training.TrainingRun(
            Path(scratch) / "run", (Source(arguments.data),), threads=arguments.threads
        )
        training.train_detector(DetectorConfig(), settings, run)
    steps = len(clock.seconds) - 1 - WARM_UP
    print(
        json.dumps(
            {
                "seconds_a_step": round((clock.seconds[-1] - clock.seconds[WARM_UP]) / steps, 3),
                "page_faults_a_step": round((clock.faults[-1] - clock.faults[WARM_UP]) / steps),
                "peak_megabytes": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
            }
        )
    )


if __name__ == "__main__":
    main()
