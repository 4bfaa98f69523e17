"""The berries of a frame: one validated, sliceable container that every room speaks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError, ShapeError
from punnet.scene.masks import decode_mask, encode_mask

__all__ = ["CLASSES", "KEYPOINTS", "PLUCKABLE", "UNPLUCKABLE", "Strawberries", "Visibility"]

CLASSES = ("pluckable", "unpluckable")
PLUCKABLE, UNPLUCKABLE = 0, 1
KEYPOINTS = ("picking_point", "top", "bottom", "left_grasp", "right_grasp")
STRAWBERRIES_SCHEMA = "punnet-strawberries/1"
_FILLED_IN: Any = None  # a default that __post_init__ replaces by an array of the right length

_PER_BERRY = (
    "boxes",
    "scores",
    "classes",
    "masks",
    "keypoints",
    "visibility",
    "ripeness",
    "picking_points",
    "weights",
    "weight_intervals",
    "ids",
)


class Visibility(IntEnum):
    """How a key-point shows in the image (DESIGN.md section 4)."""

    ABSENT = 0
    HIDDEN_BY_ITSELF = 1
    VISIBLE = 2
    HIDDEN_BY_OTHER = 3


Index = int | slice | Sequence[int] | NDArray[np.integer[Any]] | NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Strawberries:
    """N berries in an image of ``image_size`` = (H, W).

    Parameters
    ----------
    image_size
        (H, W) pixels.
    boxes
        (N, 4) float, xyxy pixels.
    scores
        (N,) float in [0, 1]; ones if not given.
    classes
        (N,) int, 0 pluckable, 1 unpluckable; zeros if not given.
    masks
        (N, H, W) bool, or None.
    keypoints
        (N, 5, 2) float pixels (u, v) in the order of :data:`KEYPOINTS`, or None; NaN where absent.
    visibility
        (N, 5) int of :class:`Visibility`; given with ``keypoints``.
    ripeness
        (N,) float, 0 green … 1 fully ripe, NaN unknown.
    picking_points
        (N, 3) float metres in the robot's base frame, NaN unknown.
    weights
        (N,) float grams, NaN unknown.
    weight_intervals
        (N, 2) float grams, lower and upper bound, NaN unknown.
    ids
        (N,) int, stable names of the berries within a scene; 0 … N−1 if not given.

    Raises
    ------
    ShapeError
        If an array has another shape than stated, or a value out of its range.
    """

    image_size: tuple[int, int]
    boxes: NDArray[np.float64]
    scores: NDArray[np.float64] = field(default=_FILLED_IN)
    classes: NDArray[np.int64] = field(default=_FILLED_IN)
    masks: NDArray[np.bool_] | None = None
    keypoints: NDArray[np.float64] | None = None
    visibility: NDArray[np.int64] | None = None
    ripeness: NDArray[np.float64] = field(default=_FILLED_IN)
    picking_points: NDArray[np.float64] = field(default=_FILLED_IN)
    weights: NDArray[np.float64] = field(default=_FILLED_IN)
    weight_intervals: NDArray[np.float64] = field(default=_FILLED_IN)
    ids: NDArray[np.int64] = field(default=_FILLED_IN)

    def __post_init__(self) -> None:
        height, width = (int(size) for size in self.image_size)
        if height < 1 or width < 1:
            raise ShapeError(
                f"strawberries: image_size must be (H, W) of positive pixels, got {self.image_size}"
            )
        object.__setattr__(self, "image_size", (height, width))
        boxes = (
            np.asarray(self.boxes, dtype=np.float64).reshape(-1, 4)
            if np.size(self.boxes) == 0
            else self.boxes
        )
        boxes = np.array(boxes, dtype=np.float64)
        if boxes.ndim != 2 or boxes.shape[1] != 4:
            raise ShapeError(f"strawberries: boxes must be (N, 4) xyxy, got {boxes.shape}")
        if not np.isfinite(boxes).all() or (boxes[:, 2:] < boxes[:, :2]).any():
            raise ShapeError("strawberries: boxes must be finite with x0 ≤ x1 and y0 ≤ y1")
        object.__setattr__(self, "boxes", boxes)
        n = len(boxes)
        self._fill("scores", np.float64, (n,), 1.0)
        self._fill("classes", np.int64, (n,), 0)
        self._fill("ripeness", np.float64, (n,), np.nan)
        self._fill("picking_points", np.float64, (n, 3), np.nan)
        self._fill("weights", np.float64, (n,), np.nan)
        self._fill("weight_intervals", np.float64, (n, 2), np.nan)
        if getattr(self, "ids", None) is None:
            object.__setattr__(self, "ids", np.arange(n))
        self._fill("ids", np.int64, (n,), 0)
        if self.masks is not None:
            self._fill("masks", np.bool_, (n, height, width), False)
        if (self.keypoints is None) != (self.visibility is None):
            raise ShapeError("strawberries: keypoints and visibility go together; one of them is missing")
        if self.keypoints is not None:
            self._fill("keypoints", np.float64, (n, len(KEYPOINTS), 2), np.nan)
            self._fill("visibility", np.int64, (n, len(KEYPOINTS)), 0)
        self._check_values()

    def _fill(self, name: str, dtype: Any, shape: tuple[int, ...], default: float) -> None:
        value = getattr(self, name)
        array = np.full(shape, default, dtype=dtype) if value is None else np.asarray(value, dtype=dtype)
        if array.size == 0 and shape[0] == 0:
            array = array.reshape(shape)
        if array.shape != shape:
            raise ShapeError(f"strawberries: {name} must be {shape}, got {array.shape}")
        object.__setattr__(self, name, array)

    def _check_values(self) -> None:
        if not ((self.scores >= 0) & (self.scores <= 1)).all():
            raise ShapeError("strawberries: scores must lie in [0, 1]")
        if not np.isin(self.classes, (PLUCKABLE, UNPLUCKABLE)).all():
            raise ShapeError(f"strawberries: classes must be 0 ({CLASSES[0]}) or 1 ({CLASSES[1]})")
        if self.visibility is not None and not np.isin(self.visibility, [int(v) for v in Visibility]).all():
            raise ShapeError(
                "strawberries: visibility must be 0 absent, 1 hidden by itself, 2 visible, 3 hidden by other"
            )
        if len(np.unique(self.ids)) != len(self.ids):
            raise ShapeError("strawberries: ids must be unique")

    @classmethod
    def empty(cls, image_size: tuple[int, int]) -> Strawberries:
        """No berries in an image of ``image_size`` = (H, W)."""
        return cls(image_size=image_size, boxes=np.zeros((0, 4)))

    def __len__(self) -> int:
        return len(self.boxes)

    def __iter__(self) -> Iterator[Strawberries]:
        return (self[i] for i in range(len(self)))

    def __getitem__(self, index: Index) -> Strawberries:
        """Select berries by position, slice, list of positions or boolean mask; the result is a container again."""
        if isinstance(index, int | np.integer):
            if not -len(self) <= index < len(self):
                raise IndexError(f"berry {index} of {len(self)}")
            index = [int(index)]
        selection: Any = index if isinstance(index, slice) else np.asarray(index)
        if not isinstance(selection, slice) and selection.size == 0:
            selection = np.zeros(0, dtype=np.int64)
        chosen: dict[str, Any] = {
            name: None if getattr(self, name) is None else getattr(self, name)[selection]
            for name in _PER_BERRY
        }
        return replace(self, **chosen)

    @property
    def pluckable(self) -> NDArray[np.bool_]:
        """(N,) whether each berry is of class pluckable."""
        return np.asarray(self.classes == PLUCKABLE)

    @property
    def box_centres(self) -> NDArray[np.float64]:
        """(N, 2) box centres in pixels (u, v)."""
        return (self.boxes[:, :2] + self.boxes[:, 2:]) / 2.0

    def with_fields(self, **changes: Any) -> Strawberries:
        """A copy with some fields replaced, validated again."""
        return replace(self, **changes)

    def placed(self, image_size: tuple[int, int], corner: tuple[int, int]) -> Strawberries:
        """The same berries in the pixels of an image of (H, W), of which theirs is the part that begins at ``corner`` (u, v).

        Raises
        ------
        ShapeError
            If their image is no part of that one.
        """
        (height, width), (left, top) = self.image_size, corner
        bottom, right = top + height, left + width
        if min(left, top) < 0 or bottom > image_size[0] or right > image_size[1]:
            raise ShapeError(
                f"strawberries: an image of {height}×{width} from {corner} is no part of one of {image_size}"
            )
        masks = None
        if self.masks is not None:
            masks = np.zeros((len(self), *image_size), dtype=np.bool_)
            masks[:, top:bottom, left:right] = self.masks
        return self.with_fields(
            image_size=image_size,
            boxes=self.boxes + np.tile(corner, 2),
            masks=masks,
            keypoints=None if self.keypoints is None else self.keypoints + np.array(corner),
        )

    def to_json(self) -> dict[str, Any]:
        """Plain JSON: masks as COCO run lengths, absent numbers as null."""
        berries = []
        for i in range(len(self)):
            berry: dict[str, Any] = {
                "id": int(self.ids[i]),
                "class": CLASSES[self.classes[i]],
                "score": float(self.scores[i]),
                "box": self.boxes[i].tolist(),
                "ripeness": _nullable(self.ripeness[i]),
                "picking_point": _nullable(self.picking_points[i]),
                "weight_g": _nullable(self.weights[i]),
                "weight_interval_g": _nullable(self.weight_intervals[i]),
            }
            if self.masks is not None:
                berry["segmentation"] = encode_mask(self.masks[i])
            if self.keypoints is not None and self.visibility is not None:
                berry["keypoints"] = {
                    name: {"uv": _nullable(self.keypoints[i, k]), "visibility": int(self.visibility[i, k])}
                    for k, name in enumerate(KEYPOINTS)
                }
            berries.append(berry)
        return {"schema": STRAWBERRIES_SCHEMA, "image_size": list(self.image_size), "berries": berries}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Strawberries:
        """Read what :meth:`to_json` wrote.

        Raises
        ------
        FileFormatError
            If the schema is unknown or a field is missing or of the wrong kind.
        """
        if not isinstance(data, dict) or data.get("schema") != STRAWBERRIES_SCHEMA:
            found = data.get("schema") if isinstance(data, dict) else type(data).__name__
            raise FileFormatError(f"strawberries JSON: schema must be '{STRAWBERRIES_SCHEMA}', got {found!r}")
        try:
            return cls._from_checked_json(data)
        except (KeyError, TypeError, ValueError, IndexError) as error:
            if isinstance(error, FileFormatError | ShapeError):
                raise
            raise FileFormatError(
                f"strawberries JSON: field missing or of the wrong kind ({error!r})"
            ) from error

    @classmethod
    def _from_checked_json(cls, data: dict[str, Any]) -> Strawberries:
        berries = data["berries"]
        size = (int(data["image_size"][0]), int(data["image_size"][1]))
        n = len(berries)
        with_masks = n > 0 and all("segmentation" in berry for berry in berries)
        with_keypoints = n > 0 and all("keypoints" in berry for berry in berries)
        return cls(
            image_size=size,
            boxes=np.array([berry["box"] for berry in berries], dtype=np.float64).reshape(n, 4),
            scores=np.array([berry["score"] for berry in berries], dtype=np.float64),
            classes=np.array([CLASSES.index(berry["class"]) for berry in berries], dtype=np.int64),
            masks=np.array([decode_mask(berry["segmentation"]) for berry in berries]) if with_masks else None,
            keypoints=np.array([[_floats(b["keypoints"][k]["uv"], 2) for k in KEYPOINTS] for b in berries])
            if with_keypoints
            else None,
            visibility=np.array([[int(b["keypoints"][k]["visibility"]) for k in KEYPOINTS] for b in berries])
            if with_keypoints
            else None,
            ripeness=np.array([_floats(berry["ripeness"], 1)[0] for berry in berries]),
            picking_points=np.array([_floats(berry["picking_point"], 3) for berry in berries]).reshape(n, 3),
            weights=np.array([_floats(berry["weight_g"], 1)[0] for berry in berries]),
            weight_intervals=np.array([_floats(berry["weight_interval_g"], 2) for berry in berries]).reshape(
                n, 2
            ),
            ids=np.array([int(berry["id"]) for berry in berries], dtype=np.int64),
        )


def _nullable(value: Any) -> Any:
    array = np.asarray(value, dtype=np.float64)
    if not np.isfinite(array).all():
        return None
    return float(array) if array.ndim == 0 else array.tolist()


def _floats(value: Any, count: int) -> list[float]:
    if value is None:
        return [float("nan")] * count
    values = [float(v) for v in value] if isinstance(value, list) else [float(value)]
    if len(values) != count:
        raise ValueError(f"expected {count} numbers, got {len(values)}")
    return values
