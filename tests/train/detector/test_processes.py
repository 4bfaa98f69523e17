"""Two processes train one detector."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from punnet.data.coco import read_coco, write_coco  # noqa: E402
from punnet.data.dataset import Dataset  # noqa: E402
from punnet.train.detector.config import Source  # noqa: E402
from punnet.train.detector.samples import Draws, Samples, open_sources  # noqa: E402
from tests.train.detector.berries import SMALL, small_training, write_set  # noqa: E402

PROGRAM = Path(__file__).with_name("two_processes.py")
ROOT = Path(__file__).resolve().parents[3]
STEPS = 4


def test_two_processes_train_one_detector_even_where_one_sees_no_berry(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", images=2)
    full = read_coco(folder / "annotations.json")
    half = Dataset((full[0], replace(full[1], annotations=())), "half")
    write_coco(half, folder / "annotations.json", force=True)
    training = small_training(steps=STEPS, batch=1)
    samples = Samples(open_sources([Source(folder)]), training)
    counts = []
    for epoch in range(STEPS // training.validate_every):
        for rank in range(2):
            draws = Draws(training, rank, 2)
            draws.set_epoch(epoch)
            counts.append([len(samples[k][1]["boxes"]) for k in draws])
    pairs = [pair for e in range(0, len(counts), 2) for pair in zip(counts[e], counts[e + 1], strict=True)]
    assert any(bool(one) != bool(other) for one, other in pairs), "in some step one process sees no berry"

    config = tmp_path / "config.json"
    settings = {
        "steps": STEPS,
        "batch": 1,
        "crop": [64, 96],
        "warm_up": 1,
        "validate_every": 2,
        "averaging": 0.5,
    }
    config.write_text(json.dumps({"detector": SMALL, "training": settings}))
    command = [
        sys.executable,
        str(PROGRAM),
        "train",
        "detector",
        "--config",
        str(config),
        "--data",
        str(folder),
    ]
    command += ["--validation", f"{folder},split={listed(tmp_path)}:some", "--out", str(tmp_path / "run")]
    command += ["--processes", "2", "--threads", "1", "--json"]
    environment = os.environ | {"LEAVE_WEIGHTS_IN": str(tmp_path), "OMP_NUM_THREADS": "1"}
    environment["PYTHONPATH"] = os.pathsep.join((str(ROOT / "src"), str(ROOT)))
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=900, check=False)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)  # one document: only the first process tells
    assert summary["validation"]["step"] == STEPS
    one, other = (torch.load(tmp_path / f"{rank}.pt", weights_only=True) for rank in range(2))
    assert one.keys() == other.keys()
    for name, value in one.items():
        if "running_" not in name and "num_batches" not in name:  # batch statistics are each process' own
            assert value.isfinite().all(), name
            torch.testing.assert_close(value, other[name], rtol=0, atol=1e-7, msg=name)


def listed(folder: Path) -> Path:
    """A split whose part names the image with berries."""
    path = folder / "split.json"
    path.write_text('{"schema": "punnet-split/1", "parts": {"some": ["0.png"]}}')
    return path
