"""Which detection is which annotated berry, decided by masks alone, as COCO does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.perception.coco_scoring import ImageEntries

__all__ = ["Matching", "match_masks"]


@dataclass(frozen=True, eq=False)
class Matching:
    """Pairs of an image.

    Parameters
    ----------
    truth_of
        (D,) index of the annotated berry that each detection is, −1 for none.
    overlooked
        (D,) whether a detection counts neither as right nor as wrong: too unsure, or on an ignored annotation.
    """

    truth_of: NDArray[np.int64]
    overlooked: NDArray[np.bool_]

    def found_as(self, truths: int) -> NDArray[np.int64]:
        """(T,) index of the detection of each annotated berry, −1 where it was missed."""
        found = np.full(truths, -1, dtype=np.int64)
        matched = np.flatnonzero(self.truth_of >= 0)
        found[self.truth_of[matched]] = matched
        return found


def match_masks(entries: ImageEntries, *, score: float, iou: float) -> Matching:
    """Pair detections, the surest first, each with the free annotated berry that it overlaps most.

    Classes are not looked at: a ripe berry that is called unripe was found, and named wrongly.

    Parameters
    ----------
    entries
        Annotations and detections of one image.
    score
        Detections below it are overlooked.
    iou
        Least intersection over union of a pair. Of an ignored annotation it is the share of the detection that
        lies on it.
    """
    truths, ignored = len(entries.truths), len(entries.ignored)
    scores = np.array([entry["score"] for entry in entries.detections])
    truth_of = np.full(len(scores), -1, dtype=np.int64)
    overlooked: NDArray[np.bool_] = np.asarray(scores < score)
    overlaps = _overlaps(entries)
    free = np.ones(truths, dtype=np.bool_)
    for detection in np.argsort(-scores, kind="stable"):
        if overlooked[detection]:
            continue
        candidates = np.where(free, overlaps[detection, :truths], -1.0)
        if truths and candidates.max() >= iou:
            truth_of[detection] = candidates.argmax()
            free[truth_of[detection]] = False
        elif ignored and overlaps[detection, truths:].max() >= iou:
            overlooked[detection] = True
    return Matching(truth_of, overlooked)


def _overlaps(entries: ImageEntries) -> NDArray[np.float64]:
    """(D, T + ignored): IoU, of ignored annotations intersection over the detection."""
    from faster_coco_eval.core import mask as run_lengths

    annotated = entries.truths + entries.ignored
    if not annotated or not entries.detections:
        return np.zeros((len(entries.detections), len(annotated)))
    overlaps = run_lengths.iou(
        [entry["segmentation"] for entry in entries.detections],
        [entry["segmentation"] for entry in annotated],
        [entry["iscrowd"] for entry in annotated],
    )
    return np.asarray(overlaps, dtype=np.float64).reshape(len(entries.detections), len(annotated))
