"""A set of labelled images, whatever the files they came from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.segmentation import (
    LabelPixels,
    Segmentation,
    check_segmentation,
    decode_segmentation,
    read_labels,
)
from punnet.errors import ConfigurationError, ShapeError
from punnet.geometry import CameraIntrinsics
from punnet.scene import CLASSES, KEYPOINTS, Frame, Strawberries, Visibility
from punnet.scene.masks import MOST_PIXELS

__all__ = ["STAGES", "AnnotatedImage", "Annotation", "Dataset", "LabelPixels", "Segmentation"]

STAGES = ("green", "white", "turning", "ripe", "overripe", "rotten")
"""Stages of colour, in the order in which a berry goes through them."""
NAN = float("nan")
MILLIMETRE = 0.001
VISIBILITIES = frozenset(int(code) for code in Visibility)


@dataclass(frozen=True, eq=False)
class Annotation:
    """One berry in one image.

    Parameters
    ----------
    id
        Unique in its data set.
    class_index
        0 pluckable, 1 unpluckable.
    box
        (4,) xyxy pixels; expanded here to hold the key-points.
    segmentation
        Polygons (lists of x, y, x, y …), COCO run lengths, or :class:`LabelPixels`; None if only the box is known.
    keypoints
        (5, 2) pixels in the order of :data:`~punnet.scene.KEYPOINTS`, NaN where absent; None if not annotated.
    visibility
        (5,) codes of :class:`~punnet.scene.Visibility`; given with ``keypoints``, 0 where those are NaN.
    crowd
        Too little shows to be counted (``iscrowd``): ignored in training and scoring.
    ripeness
        0 green … 1 ripe all over, NaN unknown.
    stage
        One of :data:`STAGES`, None unknown.
    occlusion
        Share of the fruit's outline that something else hides, 0 … 1, NaN unknown.
    weight
        Grams, NaN unknown.
    keypoint_depths
        (5,) metres along the optical axis, NaN unknown; None if not annotated.
    extra
        Every other field of the file, written again as it was.

    Raises
    ------
    ShapeError
        If a field has another shape than stated, or a value out of its range.
    """

    id: int
    class_index: int
    box: NDArray[np.float64]
    segmentation: Segmentation = None
    keypoints: NDArray[np.float64] | None = None
    visibility: NDArray[np.int64] | None = None
    crowd: bool = False
    ripeness: float = NAN
    stage: str | None = None
    occlusion: float = NAN
    weight: float = NAN
    keypoint_depths: NDArray[np.float64] | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = f"annotation {self.id}"
        if self.class_index not in range(len(CLASSES)):
            raise ShapeError(f"{where}: class must be 0 ({CLASSES[0]}) or 1 ({CLASSES[1]})")
        box = _numbers(self.box, (4,), f"{where}: box")
        x0, y0, x1, y1 = box.tolist()
        if not (math.isfinite(x0 + y0 + x1 + y1) and x0 <= x1 and y0 <= y1):
            raise ShapeError(
                f"{where}: box must be finite with x0 ≤ x1 and y0 ≤ y1, got {box.tolist()} (xyxy)"
            )
        if (self.keypoints is None) != (self.visibility is None):
            raise ShapeError(f"{where}: keypoints and visibility go together; one of them is missing")
        if self.keypoints is not None:
            box = self._check_keypoints(box, where)
        object.__setattr__(self, "box", box)
        for name, highest in (("ripeness", 1.0), ("occlusion", 1.0), ("weight", math.inf)):
            value = getattr(self, name)
            if not (math.isnan(value) or 0.0 <= value <= highest) or math.isinf(value):
                raise ShapeError(f"{where}: {name} must be NaN or 0 … {highest:g}, got {value}")
        if self.stage is not None and self.stage not in STAGES:
            raise ShapeError(f"{where}: stage must be one of {', '.join(STAGES)}, got {self.stage!r}")
        if self.keypoint_depths is not None:
            depths = _numbers(self.keypoint_depths, (len(KEYPOINTS),), f"{where}: keypoint_depths")
            object.__setattr__(self, "keypoint_depths", depths)

    def _check_keypoints(self, box: NDArray[np.float64], where: str) -> NDArray[np.float64]:
        """Set both arrays; return the box that holds the key-points."""
        points = _numbers(self.keypoints, (len(KEYPOINTS), 2), f"{where}: keypoints")
        codes = np.asarray(self.visibility)
        # Plain numbers: NumPy's start-up time an operation would be most of what reading a file takes.
        if codes.shape != (len(KEYPOINTS),) or not all(code in VISIBILITIES for code in codes.tolist()):
            raise ShapeError(f"{where}: visibility must be {len(KEYPOINTS)} codes of 0 … 3")
        known = []
        for (u, v), code in zip(points.tolist(), codes.tolist(), strict=True):
            if math.isinf(u) or math.isinf(v) or math.isnan(u + v) != (code == Visibility.ABSENT):
                raise ShapeError(f"{where}: a key-point is NaN if and only if its visibility is 0 (absent)")
            if code != Visibility.ABSENT:
                known.append((u, v))
        points[codes == Visibility.ABSENT] = np.nan
        object.__setattr__(self, "keypoints", points)
        object.__setattr__(self, "visibility", codes.astype(np.int64))
        if not known:
            return box
        x0, y0, x1, y1 = box.tolist()
        us, vs = zip(*known, strict=True)
        return np.array([min(x0, *us), min(y0, *vs), max(x1, *us), max(y1, *vs)])


@dataclass(frozen=True, eq=False)
class AnnotatedImage:
    """One image and the berries in it; files are opened when they are asked for.

    Parameters
    ----------
    id
        Unique in its data set.
    path
        The photograph.
    width, height
        Its size in pixels.
    annotations
        The berries, crowd included.
    depth_path
        16-bit PNG aligned to the photograph, ``extra["depth_scale"]`` metres a count, millimetres if not said.
    camera
        Intrinsics, None unknown.
    group
        Plant or scene; what shares a group never stands on both sides of a split.
    extra
        Every other field of the file, ``T_base_camera`` among them.

    Raises
    ------
    ShapeError
        If the size is impossible, a segmentation damaged or of another size, or an id given twice.
    """

    id: int
    path: Path
    width: int
    height: int
    annotations: tuple[Annotation, ...] = ()
    depth_path: Path | None = None
    camera: CameraIntrinsics | None = None
    group: str | None = None
    extra: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or self.width * self.height > MOST_PIXELS:
            raise ShapeError(f"image {self.id}: size {self.width}×{self.height} is not possible")
        checked = []
        for annotation in self.annotations:
            try:
                segmentation = check_segmentation(annotation.segmentation, self.size)
            except ShapeError as error:
                raise ShapeError(f"annotation {annotation.id}: {error}") from error
            same = segmentation is annotation.segmentation
            checked.append(annotation if same else replace(annotation, segmentation=segmentation))
        object.__setattr__(self, "annotations", tuple(checked))

    @property
    def size(self) -> tuple[int, int]:
        """(H, W)."""
        return self.height, self.width

    def mask(self, index: int) -> NDArray[np.bool_] | None:
        """(H, W) bool of annotation ``index``, None if it has no segmentation.

        Raises
        ------
        FileFormatError
            If the mask is in a file that is missing or damaged.
        """
        return decode_segmentation(self.annotations[index].segmentation, self.size)

    def masks(self, annotations: Iterable[Annotation]) -> list[NDArray[np.bool_] | None]:
        """Masks of some of the annotations; a PNG that several share is read once."""
        labels: dict[Path, NDArray[np.integer[Any]]] = {}
        masks: list[NDArray[np.bool_] | None] = []
        for annotation in annotations:
            segmentation = annotation.segmentation
            if isinstance(segmentation, LabelPixels):
                if segmentation.path not in labels:
                    labels[segmentation.path] = read_labels(segmentation.path, self.size)
                masks.append(np.asarray(labels[segmentation.path] == segmentation.value))
            else:
                masks.append(decode_segmentation(segmentation, self.size))
        return masks

    def berries(self) -> Strawberries:
        """The annotations without crowd as a container.

        Masks and key-points are None only if no annotation has any; one that lacks them has an empty mask, or
        absent key-points. Scores are those of the file, 1 if it has none.

        Raises
        ------
        FileFormatError
            If a mask is in a file that is missing or damaged.
        """
        chosen = [annotation for annotation in self.annotations if not annotation.crowd]
        if not chosen:
            return Strawberries.empty(self.size)
        masks = self.masks(chosen)
        absent = np.full((len(KEYPOINTS), 2), np.nan)
        with_keypoints = any(annotation.keypoints is not None for annotation in chosen)
        nothing = np.zeros(self.size, dtype=np.bool_)
        return Strawberries(
            image_size=self.size,
            boxes=np.stack([annotation.box for annotation in chosen]),
            scores=np.array([_score(annotation) for annotation in chosen]),
            classes=np.array([annotation.class_index for annotation in chosen]),
            masks=np.stack([nothing if mask is None else mask for mask in masks])
            if any(mask is not None for mask in masks)
            else None,
            keypoints=np.stack([absent if a.keypoints is None else a.keypoints for a in chosen])
            if with_keypoints
            else None,
            visibility=np.stack(
                [np.zeros(len(KEYPOINTS), np.int64) if a.visibility is None else a.visibility for a in chosen]
            )
            if with_keypoints
            else None,
            ripeness=np.array([annotation.ripeness for annotation in chosen]),
            weights=np.array([annotation.weight for annotation in chosen]),
            ids=np.array([annotation.id for annotation in chosen]),
        )

    def frame(self) -> Frame:
        """The photograph with what is known of depth, camera and pose.

        Raises
        ------
        FileFormatError
            If a file is missing or damaged.
        ShapeError
            If the photograph, its depth or its camera is of another size than the annotations.
        """
        frame = Frame.from_files(self.path, depth=self.depth_path, name=self.path.stem)
        if (frame.height, frame.width) != self.size:
            raise ShapeError(
                f"{self.path}: is {frame.width}×{frame.height}, its annotations are for {self.width}×{self.height}"
            )
        scale = self.extra.get("depth_scale", MILLIMETRE)
        if not isinstance(scale, int | float) or not 0 < scale < 1:
            raise ShapeError(f"image {self.id}: depth_scale must be metres a count, in (0, 1), got {scale!r}")
        pose = self.extra.get("T_base_camera")
        try:
            T_base_camera = None if pose is None else np.asarray(pose, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise ShapeError(f"image {self.id}: T_base_camera must be 4×4 numbers") from error
        return replace(
            frame,
            depth=None if frame.depth is None else frame.depth * np.float32(scale / MILLIMETRE),
            camera=self.camera,
            T_base_camera=T_base_camera,
        )


@dataclass(frozen=True, eq=False)
class Dataset:
    """Annotated images in the order of the file.

    Parameters
    ----------
    images
        The images.
    name
        What to call the set in tables and messages.
    info, licences
        The file's ``info`` and ``licenses``.
    extra
        Every other field of the file.

    Raises
    ------
    ShapeError
        If two images, or two annotations, share an id.
    """

    images: tuple[AnnotatedImage, ...]
    name: str = "dataset"
    info: dict[str, Any] = field(default_factory=dict)
    licences: list[Any] = field(default_factory=list)
    extra: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "images", tuple(self.images))
        _require_unique((image.id for image in self.images), f"{self.name}: image id")
        annotations = (annotation for image in self.images for annotation in image.annotations)
        _require_unique((annotation.id for annotation in annotations), f"{self.name}: annotation id")

    def __len__(self) -> int:
        return len(self.images)

    def __iter__(self) -> Iterator[AnnotatedImage]:
        return iter(self.images)

    def __getitem__(self, index: int) -> AnnotatedImage:
        return self.images[index]

    def subset(self, indices: Iterable[int]) -> Dataset:
        """The images at ``indices``, in that order.

        Raises
        ------
        ConfigurationError
            If an index is out of range.
        """
        chosen = [int(index) for index in indices]
        if outside := [index for index in chosen if not 0 <= index < len(self)]:
            raise ConfigurationError(f"{self.name}: no image {outside[0]}; there are {len(self)}")
        return replace(self, images=tuple(self.images[index] for index in chosen))


def _numbers(value: Any, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ShapeError(f"{what} must be {shape} numbers, got {value!r:.80}") from error
    if array.shape != shape:
        raise ShapeError(f"{what} must be {shape} numbers, got {array.shape}")
    return array


def _score(annotation: Annotation) -> float:
    score = annotation.extra.get("score", 1.0)
    if isinstance(score, bool) or not isinstance(score, int | float) or not 0 <= score <= 1:
        raise ShapeError(f"annotation {annotation.id}: score must lie in [0, 1], got {score!r:.80}")
    return float(score)


def _require_unique(ids: Iterable[int], what: str) -> None:
    seen: set[int] = set()
    for number in ids:
        if number in seen:
            raise ShapeError(f"{what} {number} is given twice")
        seen.add(number)
