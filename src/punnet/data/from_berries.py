"""What a detector found, or any other :class:`~punnet.scene.Strawberries`, as an annotated image."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from punnet.data.dataset import AnnotatedImage, Annotation
from punnet.scene import Strawberries, Visibility
from punnet.scene.masks import encode_mask

__all__ = ["annotate_image", "to_annotations"]


def annotate_image(
    berries: Strawberries, path: Path, *, identity: int = 1, first_annotation: int = 1, **known: Any
) -> AnnotatedImage:
    """Berries as the annotations of the photograph at ``path``.

    Parameters
    ----------
    berries
        What is in it.
    path
        The photograph.
    identity, first_annotation
        Ids of the image and of its first annotation; the others count on from there.
    known
        Other fields of :class:`~punnet.data.dataset.AnnotatedImage`: depth_path, camera, group, extra.
    """
    height, width = berries.image_size
    return AnnotatedImage(identity, path, width, height, to_annotations(berries, first_annotation), **known)


def to_annotations(berries: Strawberries, first: int = 1) -> tuple[Annotation, ...]:
    """Berries as annotations with ids from ``first`` on.

    Scores, names within the scene, picking points and intervals of weight go to the extra fields ``score``,
    ``berry_id``, ``picking_point_m`` (base frame) and ``weight_interval_g``. A key-point whose place is not known is
    absent, and so is the place of an absent one.
    """
    return tuple(_annotation(berries, position, first + position) for position in range(len(berries)))


def _annotation(berries: Strawberries, position: int, identity: int) -> Annotation:
    keypoints = visibility = None
    if berries.keypoints is not None and berries.visibility is not None:
        codes = berries.visibility[position]
        known = np.isfinite(berries.keypoints[position]).all(axis=1) & (codes != Visibility.ABSENT)
        keypoints = np.where(known[:, None], berries.keypoints[position], np.nan)
        visibility = np.where(known, codes, int(Visibility.ABSENT))
    extra: dict[str, Any] = {
        "score": float(berries.scores[position]),
        "berry_id": int(berries.ids[position]),
    }
    for name, values in (
        ("picking_point_m", berries.picking_points[position]),
        ("weight_interval_g", berries.weight_intervals[position]),
    ):
        if np.isfinite(values).all():
            extra[name] = values.tolist()
    return Annotation(
        id=identity,
        class_index=int(berries.classes[position]),
        box=berries.boxes[position],
        segmentation=None if berries.masks is None else encode_mask(berries.masks[position]),
        keypoints=keypoints,
        visibility=visibility,
        ripeness=float(berries.ripeness[position]),
        weight=float(berries.weights[position]),
        extra=extra,
    )
