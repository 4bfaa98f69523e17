"""What a training run does between its steps: scores the network, and says how it gets on."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import lightning
from lightning.pytorch.callbacks import Callback, RichProgressBar, WeightAveraging
from torch import Tensor

from punnet.data.dataset import AnnotatedImage
from punnet.train.detector.module import VALIDATED, DetectorModule
from punnet.train.detector.network import BerryDetector
from punnet.train.detector.validation import score_network

__all__ = ["SCORES_FILE", "Averaging", "Progress", "Tell", "Validation", "averaged", "progress"]

SCORES_FILE = "validation.jsonl"
STEPS_A_LINE = 50

Tell = Callable[[str], None]


class Validation(Callback):
    """Scores the averaged weights at the end of each epoch; a line of ``validation.jsonl`` each time.

    Parameters
    ----------
    images
        To score on.
    tell
        Is given one line a time.
    """

    def __init__(self, images: Sequence[AnnotatedImage], tell: Tell) -> None:
        self.images = images
        self.tell = tell

    def on_train_epoch_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Score on the first process; all processes log the same, so that all stop early or none."""
        assert isinstance(module, DetectorModule)
        scores: dict[str, float] = {}
        if trainer.is_global_zero:
            result = score_network(averaged(trainer, module), self.images)
            for row in result.rows[:3]:
                scores |= {f"validation/{row.name}_mask_ap{t:g}": value for t, value in row.mask_ap.items()}
                scores |= {f"validation/{row.name}_keypoint_ap{t:g}": v for t, v in row.keypoint_ap.items()}
            scores[VALIDATED] = result["mean"].mask_ap_mean
            scores = {name: value for name, value in scores.items() if value == value}
        scores = trainer.strategy.broadcast(scores)
        module.train()
        module.log_dict(scores, rank_zero_only=True)
        if trainer.is_global_zero:
            with (Path(trainer.default_root_dir) / SCORES_FILE).open("a", encoding="utf-8") as file:
                file.write(json.dumps({"step": trainer.global_step, **scores}) + "\n")
            self.tell(
                f"step {trainer.global_step}: mask AP {100 * scores.get(VALIDATED, 0.0):.1f} on validation"
            )


class Averaging(WeightAveraging):
    """An exponential moving average of the weights that a short run forgets its beginning in, too.

    Parameters
    ----------
    decay
        In the long run. After n steps it is at most (1 + n) / (10 + n), so that the average reaches back over a tenth of
        the steps and not to where the run started.
    """

    def __init__(self, decay: float) -> None:
        def moved(average: Tensor, current: Tensor, steps: Tensor | int) -> Tensor:
            kept = min(decay, (1 + float(steps)) / (10 + float(steps)))
            return average * kept + current * (1 - kept)

        super().__init__(avg_fn=moved)


def averaged(trainer: lightning.Trainer, module: DetectorModule) -> BerryDetector:
    """The exponential moving average of the network if there is one, else the network."""
    for callback in trainer.callbacks:  # type: ignore[attr-defined]
        average = getattr(callback, "_average_model", None)
        if isinstance(callback, Averaging) and average is not None:
            network: BerryDetector = average.module.network
            return network
    return module.network


class Progress(Callback):
    """A line now and then, for logs: step of how many, loss, time left."""

    def __init__(self, steps: int, tell: Tell) -> None:
        self.steps, self.tell = steps, tell
        self.began = time.monotonic()
        self.first = 0

    def on_train_start(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Time runs from here."""
        self.began, self.first = time.monotonic(), trainer.global_step

    def on_train_batch_end(
        self,
        trainer: lightning.Trainer,
        module: lightning.LightningModule,
        outputs: Any,
        batch: Any,
        batch_idx: int,
    ) -> None:
        """Tell step, loss and the time that is left."""
        step, steps = trainer.global_step, self.steps
        if trainer.is_global_zero and (step % STEPS_A_LINE == 0 or step == steps):
            pace = (time.monotonic() - self.began) / (step - self.first)
            minutes = pace * (steps - step) / 60
            self.tell(f"step {step} of {steps}: loss {float(outputs['loss']):.2f}, {minutes:.0f} min left")


class _Bar(RichProgressBar):
    """A bar from one validation to the next."""

    def __init__(self, steps: int) -> None:
        super().__init__(refresh_rate=5, console_kwargs={"stderr": True})
        self.steps = steps

    def _get_train_description(self, current_epoch: int) -> str:
        to_step = min((current_epoch + 1) * int(self.trainer.num_training_batches), self.steps)
        return f"to step {to_step} of {self.steps}"


def progress(steps: int, tell: Tell) -> Callback:
    """A bar on a terminal, lines elsewhere."""
    return _Bar(steps) if sys.stderr.isatty() else Progress(steps, tell)
