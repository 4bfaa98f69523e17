"""An evaluation on disk: ``evaluation.json``, ``scores.png`` and, if there were mistakes, ``worst.png``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2

from punnet.data.dataset import AnnotatedImage
from punnet.errors import FileFormatError
from punnet.perception.detector import Detector
from punnet.perception.evaluation import EVALUATION_SCHEMA, Evaluation
from punnet.perception.evaluation_figure import draw_evaluation_figure
from punnet.perception.worst_images import draw_worst_images

__all__ = ["EVALUATION_FILE", "read_evaluation", "write_evaluation"]

EVALUATION_FILE = "evaluation.json"


def write_evaluation(
    folder: Path,
    evaluation: Evaluation,
    figures: Mapping[str, Any],
    images: Sequence[AnnotatedImage],
    detector: Detector,
) -> None:
    """Write the three files into a folder that exists.

    Parameters
    ----------
    folder
        Where to.
    evaluation
        What came of it.
    figures
        Its JSON.
    images, detector
        What was evaluated: the worst images are searched once more for the picture.
    """
    (folder / EVALUATION_FILE).write_text(json.dumps(figures, indent=2, allow_nan=False) + "\n")
    draw_evaluation_figure(evaluation, folder / "scores.png")
    if worst := evaluation.worst():
        sheet = draw_worst_images(images, worst, detector, evaluation.settings.user_score)
        _, encoded = cv2.imencode(".png", sheet[:, :, ::-1])
        (folder / "worst.png").write_bytes(encoded.tobytes())


def read_evaluation(path: Path) -> dict[str, Any]:
    """Read an evaluation's JSON: the file, or the folder that holds it.

    Raises
    ------
    FileFormatError
        If it is missing, no JSON, or no evaluation.
    """
    if path.is_dir():
        path = path / EVALUATION_FILE
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise FileFormatError(f"{path}: no such file; punnet evaluate detector --out makes it") from error
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    if not isinstance(data, dict) or data.get("schema") != EVALUATION_SCHEMA:
        found = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise FileFormatError(f"{path}: schema must be '{EVALUATION_SCHEMA}', got {found!r}")
    return data
