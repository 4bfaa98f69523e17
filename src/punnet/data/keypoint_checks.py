"""What can be wrong with the five key-points of one annotation of a COCO file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.raw_values import EDGE_TOLERANCE, Finding, Surroundings, is_number, lacks_number, numbers_of
from punnet.scene import KEYPOINTS, Visibility

__all__ = ["COCO_CODES", "check_keypoints"]

COCO_CODES = {0: 0, 1: 1, 2: 2, 3: 1}
"""COCO's v of each of Punnet's codes of visibility."""


def check_keypoints(annotation: dict[str, Any], around: Surroundings) -> Iterator[Finding]:
    """Yield (code, message) of each fault of an annotation's key-points."""
    depths = annotation.get("keypoint_depths_m")
    if depths is not None and not _are_depths(depths):
        yield (
            "keypoint-count",
            f"keypoint_depths_m is {depths!r:.40}; {len(KEYPOINTS)} numbers or nulls are needed",
        )
    if "keypoints" not in annotation or annotation["keypoints"] in ([], None):
        if annotation.get("visibility_detail"):
            yield "visibility-contradiction", "visibility_detail without keypoints; give both or neither"
        return
    given = annotation["keypoints"]
    if not isinstance(given, list) or len(given) != 3 * len(KEYPOINTS):
        count = f"{len(given)} numbers" if isinstance(given, list) else repr(given)[:40]
        yield (
            "keypoint-count",
            f"keypoints has {count}; {len(KEYPOINTS)} × (x, y, v) = {3 * len(KEYPOINTS)} are needed: {', '.join(KEYPOINTS)}",
        )
        return
    values = numbers_of(given, 3 * len(KEYPOINTS))
    if values is None:
        if not lacks_number(given):
            yield "keypoint-count", "keypoints holds something that is no number; give x, y, v of each"
        return
    table = values.reshape(len(KEYPOINTS), 3)
    if strange := sorted(set(table[:, 2]) - set(COCO_CODES.values())):
        yield (
            "keypoint-code",
            f"v is {strange[0]:g}; 0 absent, 1 hidden, 2 visible; more goes to visibility_detail",
        )
        return
    yield from _places(annotation, table, around)
    yield from _visibility(annotation, table)


def _places(
    annotation: dict[str, Any], table: NDArray[np.float64], around: Surroundings
) -> Iterator[Finding]:
    given = table[:, 2] > 0
    total = annotation.get("num_keypoints")
    if total is not None and total != int(given.sum()):
        yield "keypoint-total", f"num_keypoints is {total!r}, {int(given.sum())} are given; correct it"
    box = numbers_of(annotation.get("bbox"), 4)
    if box is not None:
        low, high = box[:2] - EDGE_TOLERANCE, box[:2] + box[2:] + EDGE_TOLERANCE
        outside = given & ((table[:, :2] < low) | (table[:, :2] > high)).any(axis=1)
        if outside.any():
            yield (
                "keypoint-outside-box",
                f"{_names(outside)} outside the box; expand the box, or no detector looks there",
            )
    if around.width is not None and around.height is not None:
        limits = np.array([around.width, around.height]) + EDGE_TOLERANCE
        beyond = given & ((table[:, :2] < -EDGE_TOLERANCE) | (table[:, :2] > limits)).any(axis=1)
        if beyond.any():
            yield "keypoint-outside-image", f"{_names(beyond)} outside the image; mark as absent (0, 0, 0)"


def _visibility(annotation: dict[str, Any], table: NDArray[np.float64]) -> Iterator[Finding]:
    if "visibility_detail" not in annotation:
        return
    detail = annotation["visibility_detail"]
    if not isinstance(detail, list) or len(detail) != len(KEYPOINTS):
        yield (
            "visibility-contradiction",
            f"visibility_detail is {detail!r:.40}; {len(KEYPOINTS)} codes are needed",
        )
        return
    if strange := [code for code in detail if not is_number(code) or code not in set(Visibility)]:
        yield "visibility-contradiction", f"visibility_detail has {strange[0]!r}; codes are 0, 1, 2 and 3"
        return
    differ = [k for k, code in enumerate(detail) if table[k, 2] != COCO_CODES[int(code)]]
    if differ:
        k = differ[0]
        yield (
            "visibility-contradiction",
            f"{KEYPOINTS[k]} has v {table[k, 2]:g} but visibility_detail {detail[k]}; make them agree",
        )


def _are_depths(depths: Any) -> bool:
    """Whether it is five numbers or nulls; NaN and infinity are told elsewhere."""
    if not isinstance(depths, list) or len(depths) != len(KEYPOINTS):
        return False
    return all(depth is None or is_number(depth) or lacks_number(depth) for depth in depths)


def _names(chosen: NDArray[np.bool_]) -> str:
    names = [KEYPOINTS[k] for k in np.flatnonzero(chosen)]
    return f"{', '.join(names)} {'lies' if len(names) == 1 else 'lie'}"
