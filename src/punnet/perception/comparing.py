"""One annotated image beside what a detector says of it: a record a berry, from which all else is counted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage, Annotation
from punnet.geometry import back_project, transform_points
from punnet.perception.coco_scoring import Truth
from punnet.perception.matching import Matching
from punnet.perception.picking_points import locate_picking_points
from punnet.scene import KEYPOINTS, Frame, Strawberries, Visibility

__all__ = ["BerryRecord", "ImageRecord", "compare_image", "truth_of_image"]

MILLIMETRES = 1000.0
PICKING_POINT = KEYPOINTS.index("picking_point")


@dataclass(frozen=True, slots=True, eq=False)
class BerryRecord:
    """What became of one annotated berry. ``found_…`` fields are None where it was missed.

    Parameters
    ----------
    berry_class, stage, ripeness, occlusion
        As annotated; None or NaN where not known.
    size
        √(mask area), pixels: the scale s of Eq. 3.7.
    visibility
        (5,) annotated codes; all absent for a berry without key-points.
    found_class, found_ripeness, found_visibility
        Of the detection it was matched with.
    keypoint_errors
        (5,) pixels between annotated and found key-point; NaN where either is absent.
    keypoint_errors_mm
        (5,) the same in the plane through the annotated key-point that faces the camera; NaN without depth or camera.
    picking_error_mm
        Distance in space of the picking points; NaN unless depth, camera and pose are known.
    """

    berry_class: int
    stage: str | None
    ripeness: float
    occlusion: float
    size: float
    visibility: NDArray[np.int64]
    found_class: int | None = None
    found_ripeness: float = math.nan
    found_visibility: NDArray[np.int64] | None = None
    keypoint_errors: NDArray[np.float64] | None = None
    keypoint_errors_mm: NDArray[np.float64] | None = None
    picking_error_mm: float = math.nan


@dataclass(frozen=True, slots=True, eq=False)
class ImageRecord:
    """What became of one image.

    Parameters
    ----------
    index
        Its place in the data set.
    path
        The photograph.
    berries
        One record an annotated berry that counts.
    false_classes
        Classes of the detections that are no annotated berry.
    """

    index: int
    path: Path
    berries: tuple[BerryRecord, ...]
    false_classes: tuple[int, ...]

    @property
    def missed(self) -> int:
        """Annotated berries without a detection."""
        return sum(berry.found_class is None for berry in self.berries)

    @property
    def misnamed(self) -> int:
        """Berries that were found and given the wrong class."""
        return sum(berry.found_class not in (None, berry.berry_class) for berry in self.berries)

    @property
    def mistakes(self) -> int:
        """Missed, misnamed and false."""
        return self.missed + self.misnamed + len(self.false_classes)


def truth_of_image(image: AnnotatedImage) -> tuple[Truth, list[Annotation]]:
    """What counts in an image, and the annotation of each berry that does.

    Crowd annotations are ignored, and so are those of a box without a mask, over the whole of their box: that
    there is a berry is known, but not which pixels it has.

    Raises
    ------
    FileFormatError
        If a mask is damaged.
    """
    counted = [annotation for annotation in image.annotations if not annotation.crowd]
    crowd = [annotation for annotation in image.annotations if annotation.crowd]
    berries = image.berries()
    if berries.masks is None:
        berries = berries.with_fields(masks=np.zeros((len(berries), *image.size), dtype=np.bool_))
    assert berries.masks is not None
    has_mask: NDArray[np.bool_] = np.asarray(berries.masks.any(axis=(1, 2)))
    unclear = [counted[i] for i in np.flatnonzero(~has_mask)] + crowd
    regions = [None] * (len(unclear) - len(crowd)) + image.masks(crowd)
    ignored = Strawberries.empty(image.size)
    if unclear:
        ignored = Strawberries(
            image_size=image.size,
            boxes=np.stack([annotation.box for annotation in unclear]),
            classes=np.array([annotation.class_index for annotation in unclear]),
            masks=np.stack(
                [
                    _box_region(annotation.box, image.size) if region is None else region
                    for annotation, region in zip(unclear, regions, strict=True)
                ]
            ),
        )
    return Truth(berries[has_mask], ignored), [counted[i] for i in np.flatnonzero(has_mask)]


def compare_image(
    index: int,
    image: AnnotatedImage,
    frame: Frame,
    truth: Strawberries,
    annotations: list[Annotation],
    found: Strawberries,
    matching: Matching,
) -> ImageRecord:
    """Records of one image, from the pairs of :func:`punnet.perception.matching.match_masks`.

    Parameters
    ----------
    index, image
        The image and its place in the data set.
    frame
        What the detector was given.
    truth, annotations
        The berries that count, and their annotations in the same order.
    found
        All detections.
    matching
        Which of them is which berry.
    """
    found_as = matching.found_as(len(truth))
    matched = np.flatnonzero(found_as >= 0)
    located = locate_picking_points(frame, found[found_as[matched]]).picking_points
    records = []
    for berry, annotation in enumerate(annotations):
        record = _missed(truth, berry, annotation)
        if found_as[berry] >= 0:
            place = located[int(np.flatnonzero(matched == berry)[0])]
            record = _found(record, truth, berry, annotation, found, int(found_as[berry]), frame, place)
        records.append(record)
    false = (matching.truth_of < 0) & ~matching.overlooked
    return ImageRecord(
        index=index,
        path=image.path,
        berries=tuple(records),
        false_classes=tuple(int(value) for value in found.classes[false]),
    )


def _box_region(box: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.bool_]:
    region = np.zeros(size, dtype=np.bool_)
    left, top = (max(int(value), 0) for value in np.floor(box[:2]))
    right, bottom = (max(int(value), 0) for value in np.ceil(box[2:]))
    region[top:bottom, left:right] = True
    return region


def _missed(truth: Strawberries, berry: int, annotation: Annotation) -> BerryRecord:
    assert truth.masks is not None
    absent = np.full(len(KEYPOINTS), int(Visibility.ABSENT))
    return BerryRecord(
        berry_class=int(truth.classes[berry]),
        stage=annotation.stage,
        ripeness=float(truth.ripeness[berry]),
        occlusion=float(annotation.occlusion),
        size=math.sqrt(float(np.count_nonzero(truth.masks[berry]))),
        visibility=absent if truth.visibility is None else truth.visibility[berry],
    )


def _found(
    record: BerryRecord,
    truth: Strawberries,
    berry: int,
    annotation: Annotation,
    found: Strawberries,
    detection: int,
    frame: Frame,
    picking_point: NDArray[np.float64],
) -> BerryRecord:
    errors = np.full(len(KEYPOINTS), np.nan)
    metric = errors.copy()
    codes = np.full(len(KEYPOINTS), int(Visibility.ABSENT))
    if truth.keypoints is not None and found.keypoints is not None and found.visibility is not None:
        codes = found.visibility[detection]
        errors = np.linalg.norm(truth.keypoints[berry] - found.keypoints[detection], axis=1)
        if annotation.keypoint_depths is not None and frame.camera is not None:
            metric = MILLIMETRES * errors * annotation.keypoint_depths / frame.camera.fx
    return BerryRecord(
        berry_class=record.berry_class,
        stage=record.stage,
        ripeness=record.ripeness,
        occlusion=record.occlusion,
        size=record.size,
        visibility=record.visibility,
        found_class=int(found.classes[detection]),
        found_ripeness=float(found.ripeness[detection]),
        found_visibility=codes,
        keypoint_errors=errors,
        keypoint_errors_mm=metric,
        picking_error_mm=_picking_error_mm(truth, berry, annotation, frame, picking_point),
    )


def _picking_error_mm(
    truth: Strawberries, berry: int, annotation: Annotation, frame: Frame, point: NDArray[np.float64]
) -> float:
    if (
        annotation.keypoint_depths is None
        or truth.keypoints is None
        or frame.camera is None
        or frame.T_base_camera is None
    ):
        return math.nan
    pixel, depth = truth.keypoints[berry, PICKING_POINT], annotation.keypoint_depths[PICKING_POINT]
    true_point = transform_points(frame.T_base_camera, back_project(frame.camera, pixel, depth))
    return MILLIMETRES * float(np.linalg.norm(true_point - point))
