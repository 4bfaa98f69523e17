"""One annotated photograph as a picture of a given size, for contact sheets and the viewer."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage
from punnet.errors import PunnetError
from punnet.scene import CLASSES, Strawberries, read_image
from punnet.scene.overlay import draw_overlay

__all__ = ["draw_annotated", "write_line"]

GREY = (170, 170, 170)
WHITE = (255, 255, 255)
MISSING_COLOUR = (52, 48, 46)
LABELLED_IN_FULL = 900


def draw_annotated(image: AnnotatedImage, longest_side: int) -> NDArray[np.uint8]:
    """Photograph with masks, boxes, key-points and ids, no larger than the photograph.

    Drawn at the size asked for, so that points and words are as large in a thumbnail. Crowd annotations are grey. What
    can't be read is not raised but written in the picture.

    Parameters
    ----------
    image
        The photograph need not have the size that is annotated; it is stretched to it.
    longest_side
        Pixels.

    Returns
    -------
    picture
        (H, W, 3) uint8 RGB.
    """
    scale = min(1.0, longest_side / max(image.width, image.height))
    width, height = (max(1, round(side * scale)) for side in (image.width, image.height))
    try:
        photograph = read_image(image.path)
    except PunnetError:
        picture = np.full((height, width, 3), MISSING_COLOUR, dtype=np.uint8)
        write_line(picture, "no photograph", height // 2)
    else:
        smaller = photograph.shape[0] * photograph.shape[1] > width * height
        filtering = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
        picture = np.asarray(cv2.resize(photograph, (width, height), interpolation=filtering), dtype=np.uint8)
    try:
        return _with_annotations(picture, image)
    except PunnetError:
        write_line(picture, "masks can't be read", height - 12)
        return picture


def _with_annotations(picture: NDArray[np.uint8], image: AnnotatedImage) -> NDArray[np.uint8]:
    crowd = [annotation for annotation in image.annotations if annotation.crowd]
    size = (picture.shape[0], picture.shape[1])
    scale = np.array([size[1] / image.width, size[0] / image.height])
    for annotation, mask in zip(crowd, image.masks(crowd), strict=True):
        _outline(picture, annotation.box * np.tile(scale, 2), None if mask is None else _resized(mask, size))
    berries = image.berries()
    masks = berries.masks
    smaller = Strawberries(
        image_size=size,
        boxes=berries.boxes * np.tile(scale, 2),
        scores=berries.scores,
        classes=berries.classes,
        masks=None if masks is None else np.stack([_resized(mask, size) for mask in masks]),
        keypoints=None if berries.keypoints is None else berries.keypoints * scale,
        visibility=berries.visibility,
        ripeness=berries.ripeness,
        ids=berries.ids,
    )
    return draw_overlay(picture, smaller, labels=_labels(smaller))


def _labels(berries: Strawberries) -> list[str]:
    """Ids; in a large picture with class and ripeness."""
    if max(berries.image_size) < LABELLED_IN_FULL:
        return [str(identity) for identity in berries.ids]
    return [
        f"{identity} {CLASSES[kind]}" + (f" {ripeness:.0%}" if np.isfinite(ripeness) else "")
        for identity, kind, ripeness in zip(berries.ids, berries.classes, berries.ripeness, strict=True)
    ]


def _resized(mask: NDArray[np.bool_], size: tuple[int, int]) -> NDArray[np.bool_]:
    if mask.shape == size:
        return mask
    covered = cv2.resize(mask.astype(np.uint8) * 255, size[::-1], interpolation=cv2.INTER_AREA)
    return np.asarray(covered > 127)


def _outline(picture: NDArray[np.uint8], box: NDArray[np.float64], mask: NDArray[np.bool_] | None) -> None:
    if mask is None:
        (u0, v0), (u1, v1) = np.rint(box[:2]).astype(int), np.rint(box[2:]).astype(int)
        cv2.rectangle(picture, (int(u0), int(v0)), (int(u1), int(v1)), GREY, 1, cv2.LINE_AA)
        return
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outlines, -1, GREY, 1, cv2.LINE_AA)


def write_line(picture: NDArray[np.uint8], text: str, baseline: int, size: float = 0.42) -> None:
    """Write a line of text at the left edge; what OpenCV's font has no letter for becomes a question mark."""
    plain = text.encode("ascii", "replace").decode()
    cv2.putText(picture, plain, (6, baseline), cv2.FONT_HERSHEY_SIMPLEX, size, WHITE, 1, cv2.LINE_AA)
