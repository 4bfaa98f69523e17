"""How far found key-points lie from annotated ones: pixels, share of the berry's size, millimetres."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.perception.comparing import BerryRecord
from punnet.scene import KEYPOINTS, PLUCKABLE, Visibility

__all__ = ["KeypointErrors", "Spread", "measure_keypoints"]

SHOWN: dict[str, tuple[Visibility, ...]] = {
    "visible": (Visibility.VISIBLE,),
    "hidden": (Visibility.HIDDEN_BY_ITSELF, Visibility.HIDDEN_BY_OTHER),
}
PICKING_POINT = KEYPOINTS[0]
IN_SPACE = "picking_point in space"


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, mean and 90th percentile of errors."""

    median: float
    mean: float
    ninety: float

    @classmethod
    def of(cls, errors: NDArray[np.float64]) -> Spread | None:
        """Of the finite ones; None if there are none."""
        known = errors[np.isfinite(errors)]
        if not known.size:
            return None
        return cls(float(np.median(known)), float(known.mean()), float(np.percentile(known, 90)))

    def to_json(self) -> dict[str, float]:
        """Plain numbers."""
        return {
            "median": round(self.median, 4),
            "mean": round(self.mean, 4),
            "ninety_percent": round(self.ninety, 4),
        }


@dataclass(frozen=True, slots=True)
class KeypointErrors:
    """Errors of one key-point over the berries that were found.

    Parameters
    ----------
    keypoint
        Its name.
    berries
        ``all`` or ``pluckable``.
    shown
        ``visible`` or ``hidden`` (by the berry itself or by something else) in the annotation, ``any`` of a point in space.
    annotated
        How many found berries have it annotated.
    located
        How many of these the detector gave coordinates for; errors are of those.
    pixels, share, millimetres
        Of the image; of the berry's √(mask area); in the plane that faces the camera, or in space. None where not known.
    """

    keypoint: str
    berries: str
    shown: str
    annotated: int
    located: int
    pixels: Spread | None
    share: Spread | None
    millimetres: Spread | None

    def to_json(self) -> dict[str, Any]:
        """Plain JSON, null where not known."""
        spreads = {"pixels": self.pixels, "share_of_size": self.share, "millimetres": self.millimetres}
        return {
            "keypoint": self.keypoint,
            "berries": self.berries,
            "shown": self.shown,
            "annotated": self.annotated,
            "located": self.located,
            **{name: None if spread is None else spread.to_json() for name, spread in spreads.items()},
        }


def measure_keypoints(berries: Iterable[BerryRecord]) -> list[KeypointErrors]:
    """Errors of each key-point, visible and hidden apart, then of the picking point of pluckable berries alone.

    Rows for which nothing was annotated are left out.
    """
    found = [berry for berry in berries if berry.found_class is not None]
    pluckable = [berry for berry in found if berry.berry_class == PLUCKABLE]
    groups = [(name, "all", found) for name in KEYPOINTS] + [(PICKING_POINT, "pluckable", pluckable)]
    rows = [
        _errors(name, whose, shown, codes, chosen)
        for name, whose, chosen in groups
        for shown, codes in SHOWN.items()
    ]
    rows += [_in_space("all", found), _in_space("pluckable", pluckable)]
    return [row for row in rows if row.annotated]


def _errors(
    name: str, whose: str, shown: str, codes: Sequence[Visibility], berries: Sequence[BerryRecord]
) -> KeypointErrors:
    point = KEYPOINTS.index(name)
    chosen = [berry for berry in berries if berry.visibility[point] in codes]
    table = np.array(
        [
            (berry.keypoint_errors[point], berry.size, berry.keypoint_errors_mm[point])
            for berry in chosen
            if berry.keypoint_errors is not None and berry.keypoint_errors_mm is not None
        ]
    ).reshape(-1, 3)
    return KeypointErrors(
        keypoint=name,
        berries=whose,
        shown=shown,
        annotated=len(chosen),
        located=int(np.isfinite(table[:, 0]).sum()),
        pixels=Spread.of(table[:, 0]),
        share=Spread.of(table[:, 0] / table[:, 1]),
        millimetres=Spread.of(table[:, 2]),
    )


def _in_space(whose: str, berries: Sequence[BerryRecord]) -> KeypointErrors:
    errors = np.array([berry.picking_error_mm for berry in berries])
    located = int(np.isfinite(errors).sum())
    # A distance is known only where annotation and frame have depth: what is not located there is not counted.
    return KeypointErrors(IN_SPACE, whose, "any", located, located, None, None, Spread.of(errors))
