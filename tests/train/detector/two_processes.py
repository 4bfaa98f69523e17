"""Run by test_processes.py: the command line as it is, but each process leaves its weights behind."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import torch

from punnet.cli import main
from punnet.train.detector.module import DetectorModule


def leave_weights(module: DetectorModule) -> None:
    folder = Path(os.environ["LEAVE_WEIGHTS_IN"])
    torch.save(module.network.state_dict(), folder / f"{module.global_rank}.pt")


if __name__ == "__main__":
    DetectorModule.on_train_end = leave_weights  # type: ignore[method-assign]
    sys.exit(main())
