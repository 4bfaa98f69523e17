"""Berries to and from the containers of `supervision <https://supervision.roboflow.com>`_, which is optional."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from punnet.data.class_names import ClassMap, classify
from punnet.errors import ConfigurationError, ShapeError
from punnet.scene import CLASSES, KEYPOINTS, Strawberries, Visibility

if TYPE_CHECKING:
    import supervision

__all__ = ["from_supervision", "to_supervision"]

# Names in ``data``; the class's name is supervision's own custom.
CLASS_NAME, VISIBILITY = "class_name", "visibility"
# Field of Strawberries → name in ``data``, and numbers a berry.
DATA = {
    "ripeness": ("ripeness", ()),
    "weights": ("weight_g", ()),
    "weight_intervals": ("weight_interval_g", (2,)),
    "picking_points": ("picking_point_m", (3,)),
}


def to_supervision(
    berries: Strawberries,
) -> tuple[supervision.Detections, supervision.KeyPoints | None]:
    """Give berries as supervision's detections and key-points, for its annotators, trackers and zones.

    Classes are in ``class_id`` and ``data["class_name"]``, ids in ``tracker_id``; ``data`` has ``ripeness``,
    ``weight_g`` and ``weight_interval_g`` (grams) and ``picking_point_m`` (metres, base frame), NaN unknown.

    Returns
    -------
    detections
        N boxes, with masks if the berries have them.
    key_points
        (N, 5), absent ones at (0, 0) as is its custom, codes of visibility in ``data``; None without key-points.

    Raises
    ------
    ConfigurationError
        If supervision is not installed.
    """
    sv = _supervision()
    names = np.array(CLASSES)[berries.classes]
    detections = sv.Detections(
        xyxy=berries.boxes.copy(),
        mask=None if berries.masks is None else berries.masks.copy(),
        confidence=berries.scores.copy(),
        class_id=berries.classes.copy(),
        tracker_id=berries.ids.copy(),
        data={
            CLASS_NAME: names,
            **{name: getattr(berries, field).copy() for field, (name, _) in DATA.items()},
        },
    )
    if berries.keypoints is None or berries.visibility is None:
        return detections, None
    known = np.isfinite(berries.keypoints).all(axis=2) & (berries.visibility != Visibility.ABSENT)
    points = np.where(known[:, :, None], berries.keypoints, 0.0)
    codes = np.where(known, berries.visibility, int(Visibility.ABSENT))
    key_points = sv.KeyPoints(
        xy=points.astype(np.float32),
        class_id=berries.classes.copy(),
        data={CLASS_NAME: names, VISIBILITY: codes},
    )
    return detections, key_points


def from_supervision(
    detections: supervision.Detections,
    key_points: supervision.KeyPoints | None = None,
    *,
    image_size: tuple[int, int] | None = None,
    class_map: ClassMap | None = None,
) -> Strawberries:
    """Berries out of supervision's detections, whatever model they came from.

    Parameters
    ----------
    detections
        N boxes. The class is ``data["class_name"]``, or else ``class_id`` (0 pluckable, 1 unpluckable).
    key_points
        (N, 5) in the order of :data:`~punnet.scene.KEYPOINTS`, the same berries in the same order. Points at (0, 0),
        NaN, or not ``visible`` are absent; others are visible unless ``data["visibility"]`` has their codes.
    image_size
        (H, W) pixels; may be left out if the detections have masks.
    class_map
        What class names, or numbers as text, mean; detections of classes that it ignores are left out.

    Raises
    ------
    ConfigurationError
        If supervision is not installed, the image size can't be known, or the class map leads to no class.
    FileFormatError
        If a class is not known.
    ShapeError
        If arrays do not fit together.
    """
    _supervision()
    count = len(detections)
    masks = None if detections.mask is None else np.asarray(detections.mask, dtype=np.bool_)
    if image_size is None:
        if masks is None:
            raise ConfigurationError(
                "from_supervision: without masks the image's size is not known; pass image_size=(H, W)"
            )
        image_size = (int(masks.shape[1]), int(masks.shape[2]))
    classes = [_class(detections, position, class_map) for position in range(count)]
    points, codes = (None, None) if key_points is None else _keypoints(key_points, count)
    tracked = detections.tracker_id
    berries = Strawberries(
        image_size=image_size,
        boxes=np.asarray(detections.xyxy, dtype=np.float64),
        scores=np.ones(count) if detections.confidence is None else _scores(detections.confidence),
        classes=np.array([index or 0 for index in classes], dtype=np.int64),
        masks=masks,
        keypoints=points,
        visibility=codes,
        ids=np.arange(count) if tracked is None else np.asarray(tracked, dtype=np.int64),
        **{
            field: _data(detections.data, name, (count, *shape))
            for field, (name, shape) in DATA.items()
            if name in detections.data
        },
    )
    return berries[np.array([index is not None for index in classes], dtype=np.bool_)]


def _supervision() -> Any:
    try:
        import supervision as sv
    except ImportError as error:
        raise ConfigurationError(
            "supervision is not installed; it is needed here alone: pip install supervision"
        ) from error
    return sv


def _class(detections: supervision.Detections, position: int, class_map: ClassMap | None) -> int | None:
    where = f"from_supervision: detection {position}"
    names = detections.data.get(CLASS_NAME)
    if names is not None:
        return classify(str(names[position]), class_map, where)
    if detections.class_id is None:
        raise ConfigurationError(
            f"{where}: has neither data['{CLASS_NAME}'] nor class_id; its class is not known"
        )
    number = int(detections.class_id[position])
    return classify(
        str(number), {str(k): name for k, name in enumerate(CLASSES)} | dict(class_map or {}), where
    )


def _scores(confidence: Any) -> NDArray[np.float64]:
    return np.asarray(confidence, dtype=np.float64)


def _data(data: Any, name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    try:
        return np.asarray(data[name], dtype=np.float64).reshape(shape)
    except (TypeError, ValueError) as error:
        raise ShapeError(f"from_supervision: data['{name}'] must be {shape} numbers ({error})") from error


def _keypoints(
    key_points: supervision.KeyPoints, count: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    points = np.array(key_points.xy, dtype=np.float64)
    if points.size == 0 and count == 0:
        points = points.reshape(0, len(KEYPOINTS), 2)
    if points.shape != (count, len(KEYPOINTS), 2):
        raise ShapeError(
            f"from_supervision: key_points.xy must be {(count, len(KEYPOINTS), 2)}, a row a detection in the same "
            f"order, got {points.shape}; the five are {', '.join(KEYPOINTS)}"
        )
    known = np.isfinite(points).all(axis=2) & (points != 0).any(axis=2)
    if getattr(key_points, "visible", None) is not None:
        known &= np.asarray(key_points.visible, dtype=np.bool_)
    codes = np.full(known.shape, int(Visibility.VISIBLE))
    if VISIBILITY in (key_points.data or {}):
        codes = np.asarray(key_points.data[VISIBILITY], dtype=np.int64).reshape(known.shape)
        known &= codes != Visibility.ABSENT
    return np.where(known[:, :, None], points, np.nan), np.where(known, codes, int(Visibility.ABSENT))
