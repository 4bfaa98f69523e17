"""What all training loops share: batches that tell by seed and epoch alone, and a trainer that can be stopped."""

from __future__ import annotations

import logging
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import lightning
import numpy as np
from numpy.typing import NDArray
from torch.utils.data import DataLoader, Sampler

from punnet.outputs import Interrupted

__all__ = ["BatchDraws", "fit_resumably", "quiet_lightning"]


class BatchDraws(Sampler[tuple[int, NDArray[np.int64]]]):
    """Batches of an epoch: a seed for what is drawn, and the rows. Tells nothing but by seed and epoch.

    Every row comes once an epoch, but for those left over by the last full batch, other ones each time.
    """

    def __init__(self, rows: int, batch: int, seed: int) -> None:
        self.rows = rows
        self.batch = min(batch, rows)
        self.seed = seed
        self.epoch = 0

    def set_epoch(self, epoch: int) -> None:
        """Called by Lightning, after a resumption too."""
        self.epoch = epoch

    def __len__(self) -> int:
        return self.rows // self.batch

    def __iter__(self) -> Iterator[tuple[int, NDArray[np.int64]]]:
        generator = np.random.default_rng((self.seed, self.epoch))
        order = generator.permutation(self.rows)
        for index in range(len(self)):
            chosen = order[index * self.batch : (index + 1) * self.batch]
            yield int(generator.integers(2**31)), chosen


def fit_resumably(
    trainer: lightning.Trainer,
    module: lightning.LightningModule,
    batches: DataLoader[Any],
    validation: DataLoader[Any] | None,
    last: Path,
) -> None:
    """Train, from the checkpoint ``last`` if there is one.

    Raises
    ------
    Interrupted
        At Ctrl-C, with the last checkpoint.
    """
    at_interrupt = signal.getsignal(signal.SIGINT)
    try:
        trainer.fit(
            module,
            batches,
            validation,
            ckpt_path=str(last) if last.exists() else None,
            weights_only=True,
        )
    except SystemExit as stopped:
        if not trainer.interrupted:
            raise
        signal.signal(signal.SIGINT, at_interrupt)
        raise Interrupted(last if last.exists() else None) from stopped


@contextmanager
def quiet_lightning() -> Iterator[None]:
    """Lightning without its advice on hardware, loaders and checkpoints."""
    loggers = [logging.getLogger(name) for name in ("lightning.pytorch", "lightning.fabric")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="lightning")
            warnings.filterwarnings("ignore", module="torch")
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
