"""YOLO label files written: segmentation or pose, with a list of what they can't hold."""

from __future__ import annotations

import math
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage, Annotation, Dataset
from punnet.errors import ConfigurationError, FileFormatError
from punnet.outputs import OutputFolder
from punnet.scene import CLASSES, KEYPOINTS, Visibility
from punnet.scene.windows import mask_box

__all__ = ["YoloTask", "write_yolo"]

YoloTask = Literal["segment", "pose"]
TASKS = ("segment", "pose")
PARTS = ("train", "val", "test")
DECIMALS = 6
# Outlines run along pixels' edges: traced in a picture so many times as large, then thinned out to this many pixels.
FINER, THINNING = 4, 0.3
# Key-points seen in a mirror change sides.
FLIPPED = [0, 1, 2, 4, 3]


def write_yolo(
    parts: Dataset | Mapping[str, Dataset], folder: str | Path, task: YoloTask, *, force: bool = False
) -> list[str]:
    """Write ``data.yaml``, ``images/<part>/`` (copies) and ``labels/<part>/``.

    Parameters
    ----------
    parts
        Data sets by part: ``train``, ``val``, ``test``; of a data set alone, images go to the part that their field
        ``split`` names, as :func:`~punnet.data.yolo.read_yolo` leaves it, else to ``train``.
    folder
        Where to.
    task
        ``segment``: class and outline, of a berry without mask its box as an outline. ``pose``: class, box and five
        key-points; of a berry without key-points they are all absent.
    force
        Replace a folder that Punnet made earlier.

    Returns
    -------
    list of str
        What was lost, one line each with how many berries it concerns, and a line if there is no ``val``: Ultralytics
        does not train without one, so ``data.yaml`` names the first part's images. Empty if nothing is to be said.

    Raises
    ------
    OutputExistsError
        If the folder exists and ``force`` is not set.
    FileFormatError
        If a photograph or a mask is missing.
    """
    named = _by_part(parts) if isinstance(parts, Dataset) else dict(parts)
    if task not in TASKS or not named or set(named) - set(PARTS):
        raise ConfigurationError(
            f"YOLO: task must be one of {', '.join(TASKS)}, parts some of {', '.join(PARTS)}; "
            f"got {task!r} and {', '.join(named) or 'none'}"
        )
    losses: Counter[str] = Counter()
    with OutputFolder(folder, force=force) as output:
        for part, dataset in named.items():
            for kind in ("images", "labels"):
                (output.path / kind / part).mkdir(parents=True)
            taken: set[str] = set()
            for image in dataset:
                name = _free_name(image.path, taken)
                _copy(image, output.path / "images" / part / name)
                lines = _lines(image, task, losses)
                label = (output.path / "labels" / part / name).with_suffix(".txt")
                label.write_text("".join(f"{line}\n" for line in lines))
        (output.path / "data.yaml").write_text(_yaml([*named], task))
    told = [f"{count} × {loss}" for loss, count in sorted(losses.items())]
    if "val" not in named:
        told.append(
            f"no part val was given: data.yaml names the images of {next(iter(named))} in its place, so that it can be "
            "trained with; scores on those say nothing of other plants"
        )
    return told


def _by_part(dataset: Dataset) -> dict[str, Dataset]:
    """Its images by the part that they say they belong to."""
    found: dict[str, list[int]] = {}
    for index, image in enumerate(dataset):
        part = image.extra.get("split")
        found.setdefault(part if part in PARTS else PARTS[0], []).append(index)
    return {part: dataset.subset(found[part]) for part in PARTS if part in found} or {PARTS[0]: dataset}


def _free_name(path: Path, taken: set[str]) -> str:
    """Name of a copy whose stem no other one has, since labels are named by it."""
    stem, number = path.stem, 1
    while stem in taken:
        number += 1
        stem = f"{path.stem}-{number}"
    taken.add(stem)
    return f"{stem}{path.suffix}"


def _copy(image: AnnotatedImage, place: Path) -> None:
    try:
        shutil.copyfile(image.path, place)
    except OSError as error:
        raise FileFormatError(f"{image.path}: the photograph can't be copied ({error.strerror})") from error


def _yaml(parts: list[str], task: YoloTask) -> str:
    lines = [f"{part}: images/{part}" for part in parts]
    if "val" not in parts:
        # Ultralytics asks for one.
        lines.append(f"val: images/{parts[0]}")
    lines += ["names:", *(f"  {index}: {name}" for index, name in enumerate(CLASSES))]
    if task == "pose":
        lines += [f"kpt_shape: [{len(KEYPOINTS)}, 3]", f"flip_idx: {FLIPPED}"]
        lines += ["kpt_names:", *(f"  {index}: [{', '.join(KEYPOINTS)}]" for index in range(len(CLASSES)))]
    return "\n".join(lines) + "\n"


def _lines(image: AnnotatedImage, task: YoloTask, losses: Counter[str]) -> Iterator[str]:
    masks = image.masks(image.annotations) if task == "segment" else [None] * len(image.annotations)
    for annotation, mask in zip(image.annotations, masks, strict=True):
        if annotation.crowd:
            losses["crowd (iscrowd), left out"] += 1
            continue
        _count_losses(annotation, task, losses)
        if task == "pose":
            values = [*_box(annotation, image), *_keypoints(annotation, image, losses)]
        else:
            values = _outline(annotation, mask, image, losses)
        yield " ".join([str(annotation.class_index), *(f"{value:.{DECIMALS}g}" for value in values)])


def _count_losses(annotation: Annotation, task: YoloTask, losses: Counter[str]) -> None:
    for name, value in (
        ("ripeness", annotation.ripeness),
        ("occlusion", annotation.occlusion),
        ("weight", annotation.weight),
    ):
        losses[f"{name}, not written"] += not math.isnan(value)
    losses["stage of ripeness, not written"] += annotation.stage is not None
    losses["depths of key-points, not written"] += annotation.keypoint_depths is not None
    losses["other fields, not written"] += bool(annotation.extra)
    if task == "segment":
        losses["key-points, not written (task pose has them)"] += annotation.keypoints is not None
    else:
        losses["mask, not written (task segment has it)"] += annotation.segmentation is not None
        losses["without key-points, written as absent"] += annotation.keypoints is None
        codes = annotation.visibility
        losses["hidden by something else, written as hidden (1)"] += bool(
            codes is not None and (codes == Visibility.HIDDEN_BY_OTHER).any()
        )
    for name in [name for name, count in losses.items() if not count]:
        del losses[name]


def _box(annotation: Annotation, image: AnnotatedImage) -> list[float]:
    """Centre and size of the box as far as it is in the image, in shares of that."""
    scale = np.array([image.width, image.height, image.width, image.height], dtype=np.float64)
    left, top, right, bottom = np.clip(annotation.box / scale, 0.0, 1.0).tolist()
    return [(left + right) / 2, (top + bottom) / 2, right - left, bottom - top]


def _keypoints(annotation: Annotation, image: AnnotatedImage, losses: Counter[str]) -> list[float]:
    if annotation.keypoints is None or annotation.visibility is None:
        return [0.0] * (3 * len(KEYPOINTS))
    shares = annotation.keypoints / (image.width, image.height)
    inside = ((shares >= 0) & (shares <= 1)).all(axis=1)
    known = annotation.visibility != Visibility.ABSENT
    if (known & ~inside).any():
        losses["key-point outside of the image, written as absent"] += 1
    values: list[float] = []
    for (u, v), code, written in zip(
        shares.tolist(), annotation.visibility.tolist(), (known & inside).tolist(), strict=True
    ):
        flag = 1 if code == Visibility.HIDDEN_BY_OTHER else code
        values += [u, v, flag] if written else [0.0, 0.0, 0]
    return values


def _outline(
    annotation: Annotation, mask: NDArray[np.bool_] | None, image: AnnotatedImage, losses: Counter[str]
) -> list[float]:
    given = annotation.segmentation
    if isinstance(given, list) and len(given) == 1:
        corners = np.array(given[0]).reshape(-1, 2)
    elif mask is not None and mask.any():
        parts = _trace(mask)
        if len(parts) > 1:
            losses["mask of several parts or with holes, joined by lines without width"] += 1
        corners = _joined(parts)
    else:
        losses["without mask, its box written as an outline"] += 1
        left, top, right, bottom = annotation.box.tolist()
        corners = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
    shares: list[float] = np.clip(corners / (image.width, image.height), 0.0, 1.0).ravel().tolist()
    return shares


def _trace(mask: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """Outlines (n, 2) of the parts of a mask and of the holes in them, along the edges of its pixels."""
    left, top, right, bottom = mask_box(mask)
    part = mask[top:bottom, left:right].astype(np.uint8)
    large = cv2.resize(part, None, fx=FINER, fy=FINER, interpolation=cv2.INTER_NEAREST)
    found, _ = cv2.findContours(large, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outlines = []
    for contour in found:
        thinned = cv2.approxPolyDP(contour, THINNING * FINER, closed=True).reshape(-1, 2)
        if len(thinned) < 3:
            (u0, v0), (u1, v1) = contour.min(axis=0)[0], contour.max(axis=0)[0]
            thinned = np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]])
        outlines.append((thinned + 0.5) / FINER + (left, top))
    return outlines


def _joined(parts: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """One outline through all parts: to the nearest corner of the next one, around it and back.

    Filled as a polygon is, where an odd number of edges lies to one side, the ways there and back cancel out, and holes
    stay open.
    """
    whole, *rest = sorted(parts, key=len, reverse=True)
    for part in rest:
        distances = np.linalg.norm(whole[:, None] - part[None], axis=2)
        here, there = np.unravel_index(int(distances.argmin()), distances.shape)
        around = np.roll(part, -int(there), axis=0)
        whole = np.concatenate((whole[: here + 1], around, around[:1], whole[here:]))
    return whole
