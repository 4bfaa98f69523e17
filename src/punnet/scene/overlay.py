"""A picture of what was found, drawn over the photograph."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.scene.strawberries import CLASSES, Strawberries, Visibility

__all__ = ["draw_overlay"]

Colour = tuple[int, int, int]

CLASS_COLOURS: tuple[Colour, Colour] = ((255, 45, 85), (255, 196, 0))
KEYPOINT_COLOURS: tuple[Colour, ...] = (
    (0, 229, 255),  # picking point
    (124, 255, 92),  # top
    (255, 255, 255),  # bottom
    (92, 160, 255),  # left grasp
    (208, 130, 255),  # right grasp
)
TINT = 0.35
LABELLED_SCORE = 0.5
DARK: Colour = (20, 20, 20)


def draw_overlay(
    rgb: NDArray[np.uint8], berries: Strawberries, *, labels: Sequence[str] | None = None
) -> NDArray[np.uint8]:
    """Draw masks, boxes, axes, key-points and labels over an image.

    Key-points are filled where visible, hollow where the fruit hides them itself, crossed where something
    else does. Labels tell class, score, ripeness and, if known, grams; where they would cover one another
    they move. Unpluckable berries go without where there is no room, or with a score under one half.

    Parameters
    ----------
    rgb
        (H, W, 3) uint8; left as it is.
    berries
        What was found in it.
    labels
        One a berry, to write in place of class, score, ripeness and grams; none is left out.

    Returns
    -------
    picture
        (H, W, 3) uint8 RGB.

    Raises
    ------
    ShapeError
        If the image has another size than the one the berries were found in, or the labels another count.
    """
    if rgb.shape[:2] != berries.image_size or rgb.shape[2:] != (3,) or rgb.dtype != np.uint8:
        raise ShapeError(
            f"overlay: image is {rgb.dtype} {rgb.shape}, the berries are of an image {berries.image_size}"
        )
    if labels is not None and len(labels) != len(berries):
        raise ShapeError(f"overlay: {len(labels)} labels for {len(berries)} berries")
    picture = rgb.copy()
    scale = max(0.5, min(rgb.shape[:2]) / 600.0)
    for box, berry_class, mask in zip(berries.boxes, berries.classes, _masks(berries), strict=True):
        if mask is not None:
            _tint(picture, mask, box, CLASS_COLOURS[berry_class], scale)
        _frame_box(picture, box, CLASS_COLOURS[berry_class], scale)
    if berries.keypoints is not None and berries.visibility is not None:
        for points, codes in zip(berries.keypoints, berries.visibility, strict=True):
            _keypoints(picture, points, codes, scale)
    _labels(picture, berries, labels, scale)
    return picture


def _masks(berries: Strawberries) -> list[NDArray[np.bool_] | None]:
    return [None] * len(berries) if berries.masks is None else list(berries.masks)


def _tint(
    picture: NDArray[np.uint8],
    mask: NDArray[np.bool_],
    box: NDArray[np.float64],
    colour: Colour,
    scale: float,
) -> None:
    u0, v0, u1, v1 = (int(edge) for edge in (*np.floor(box[:2]), *np.ceil(box[2:])))
    window = (slice(max(v0, 0), v1 + 1), slice(max(u0, 0), u1 + 1))
    inside = mask[window]
    if not inside.any():
        return
    part = picture[window]
    part[inside] = ((1 - TINT) * part[inside] + TINT * np.array(colour)).astype(np.uint8)
    outlines, _ = cv2.findContours(inside.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outlined = np.ascontiguousarray(part)
    cv2.drawContours(outlined, outlines, -1, colour, _thickness(scale, 1.2), cv2.LINE_AA)
    picture[window] = outlined


def _frame_box(picture: NDArray[np.uint8], box: NDArray[np.float64], colour: Colour, scale: float) -> None:
    limit = np.array([picture.shape[1] - 1, picture.shape[0] - 1])
    low, high = np.minimum(np.rint(box[:2]), limit), np.minimum(np.rint(box[2:]), limit)
    cv2.rectangle(picture, _pixel(low), _pixel(high), colour, _thickness(scale, 1.0), cv2.LINE_AA)


def _keypoints(
    picture: NDArray[np.uint8], points: NDArray[np.float64], codes: NDArray[np.int64], scale: float
) -> None:
    known: NDArray[np.bool_] = np.asarray(np.isfinite(points).all(axis=1))
    for one, two in ((0, 1), (1, 2), (3, 4)):
        if known[one] and known[two]:
            start, end = _pixel(points[one]), _pixel(points[two])
            cv2.line(picture, start, end, (245, 245, 245), _thickness(scale, 0.8), cv2.LINE_AA)
    # Small berries get small points, or nothing of them would be seen.
    extent = float(np.ptp(points[known], axis=0).max()) if known.any() else 0.0
    radius = max(1, round(min(3.0 * scale, 0.07 * extent)))
    for k in np.flatnonzero(known):
        centre, colour = _pixel(points[k]), KEYPOINT_COLOURS[k]
        if codes[k] == Visibility.VISIBLE:
            cv2.circle(picture, centre, radius + 1, DARK, cv2.FILLED, cv2.LINE_AA)
            cv2.circle(picture, centre, radius, colour, cv2.FILLED, cv2.LINE_AA)
        elif codes[k] == Visibility.HIDDEN_BY_ITSELF:
            cv2.circle(picture, centre, radius + 1, DARK, _thickness(scale, 2.2), cv2.LINE_AA)
            cv2.circle(picture, centre, radius + 1, colour, _thickness(scale, 1.2), cv2.LINE_AA)
        else:
            for line_colour, width in ((DARK, 2.6), (colour, 1.2)):
                for slope in (1, -1):
                    start = (centre[0] - radius, centre[1] - slope * radius)
                    end = (centre[0] + radius, centre[1] + slope * radius)
                    cv2.line(picture, start, end, line_colour, _thickness(scale, width), cv2.LINE_AA)


def _labels(
    picture: NDArray[np.uint8], berries: Strawberries, labels: Sequence[str] | None, scale: float
) -> None:
    taken: list[tuple[int, int, int, int]] = []
    if labels is not None:
        for number, label in enumerate(labels):
            _label(picture, berries, number, [label], taken, scale, crowding=1.0)
        return
    for i in np.flatnonzero(berries.pluckable):
        _label(picture, berries, int(i), _words(berries, int(i)), taken, scale, crowding=1.0)
    # What is not for picking must not be written over what is.
    taken += [(int(u0), int(v0), int(u1), int(v1)) for u0, v0, u1, v1 in berries.boxes[berries.pluckable]]
    for i in np.flatnonzero(~berries.pluckable & (berries.scores >= LABELLED_SCORE)):
        _label(picture, berries, int(i), _words(berries, int(i)), taken, scale, crowding=0.2)


def _label(
    picture: NDArray[np.uint8],
    berries: Strawberries,
    i: int,
    lines: list[str],
    taken: list[tuple[int, int, int, int]],
    scale: float,
    *,
    crowding: float,
) -> None:
    """Write a berry's label, unless more than ``crowding`` of it would lie over others (``taken``)."""
    font, size, weight = cv2.FONT_HERSHEY_SIMPLEX, 0.42 * scale**0.8, max(1, round(0.9 * scale))
    extents = [cv2.getTextSize(line, font, size, weight)[0] for line in lines]
    pad = max(2, round(3 * scale))
    line_height = max(extent[1] for extent in extents) + pad
    width = max(extent[0] for extent in extents) + 2 * pad
    height = line_height * len(lines) + pad
    place = _free_place(berries.boxes[i], (width, height), picture.shape[:2], taken, crowding)
    if place is None:
        return
    u, v = place
    taken.append((u, v, u + width, v + height))
    colour = CLASS_COLOURS[berries.classes[i]]
    plate = picture[v : v + height, u : u + width]
    plate[:] = (0.25 * plate + 0.75 * np.array(DARK)).astype(np.uint8)
    cv2.rectangle(picture, (u, v), (u + max(1, pad // 2), v + height - 1), colour, cv2.FILLED)
    for row, line in enumerate(lines):
        base = (u + pad + max(1, pad // 2), v + (row + 1) * line_height)
        cv2.putText(picture, line, base, font, size, (255, 255, 255), weight, cv2.LINE_AA)


def _words(berries: Strawberries, i: int) -> list[str]:
    first = f"{CLASSES[berries.classes[i]]} {berries.scores[i]:.2f}"
    known = []
    if np.isfinite(berries.ripeness[i]):
        known.append(f"ripe {berries.ripeness[i]:.0%}")
    if np.isfinite(berries.weights[i]):
        known.append(f"{berries.weights[i]:.0f} g")
    return [first, " ".join(known)] if known else [first]


def _free_place(
    box: NDArray[np.float64],
    extent: tuple[int, int],
    image_size: tuple[int, int],
    taken: list[tuple[int, int, int, int]],
    crowding: float,
) -> tuple[int, int] | None:
    """Top-left corner beside the box, the freest of eight places; None if that is too crowded."""
    width, height = extent
    if width >= image_size[1] or height >= image_size[0]:
        return None
    u0, v0, u1, v1 = (round(float(edge)) for edge in box)
    candidates = [
        (u0, v0 - height - 1), (u0, v1 + 2), (u1 + 2, v0), (u0 - width - 2, v0),
        (u1 + 2, v1 - height), (u0 - width - 2, v1 - height),
        (u1 - width, v0 - height - 1), (u1 - width, v1 + 2),
    ]  # fmt: skip
    limited = [
        (min(max(u, 0), image_size[1] - width - 1), min(max(v, 0), image_size[0] - height - 1))
        for u, v in candidates
    ]

    def overlap(place: tuple[int, int]) -> int:
        u, v = place
        return sum(
            max(0, min(u + width, other[2]) - max(u, other[0]))
            * max(0, min(v + height, other[3]) - max(v, other[1]))
            for other in taken
        )

    place = min(limited, key=overlap)
    return place if overlap(place) <= crowding * width * height else None


def _pixel(point: NDArray[np.float64]) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))


def _thickness(scale: float, width: float) -> int:
    return max(1, round(width * scale))
