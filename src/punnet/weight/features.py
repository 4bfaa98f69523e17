"""Feature vectors of berries for trained weight estimators: named groups of numbers, those of the thesis among them.

The thesis (section 4.3.1) takes the area of the mask's box, the area of the mask, a histogram of depth with
twelve bins, and the principal components of the convex hull of the berry's cloud: groups ``box``, ``mask``,
``histogram`` and ``components``. Its areas are in pixels; ours are in square metres at the berry's distance, since few
trees can learn to multiply by the square of a distance. The others (:mod:`punnet.weight.shape_features`) are physical sizes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.weight.hull import hull_components
from punnet.weight.observation import BerryObservation
from punnet.weight.shape_features import SHAPE_FEATURES, shape_features

__all__ = [
    "FEATURES",
    "FOREST_GROUPS",
    "FOREST_PCA_GROUPS",
    "SHAPE_GROUPS",
    "feature_matrix",
    "feature_names",
]

_BINS = 12
_BIN_DEPTH = 0.002
"""Metres: with twelve, the histogram spans 24 mm from the nearest point, the front half of the thickest berries."""
_NEAREST_SHARE = 0.01

FEATURES: dict[str, dict[str, str]] = {
    "box": {"box_area_m2": "area of the box around berry and key-points, hidden parts too, at its distance"},
    "mask": {"mask_area_m2": "area of the mask at its distance"},
    "histogram": {
        "nearest_m": "range at which the histogram begins: one point in a hundred is nearer",
        **{
            f"depth_{k}": f"share of the points {2 * k} to {2 * k + 2} mm behind that"
            + (", or further" if k == _BINS - 1 else "")
            for k in range(_BINS)
        },
    },
    "components": {
        **{
            f"component_{k}_m": f"standard deviation of the hull's surface along component {k}"
            for k in range(3)
        },
        **{f"extent_{k}_m": f"extent of the hull along component {k}" for k in range(3)},
        **{
            f"direction_{k}_{axis}": f"component {k} along {axis} of the view: right, down, away along the line of sight"
            for k in range(2)
            for axis in "xyz"
        },
    },
    **SHAPE_FEATURES,
}
"""Every feature and what it is, by group; the unit is the end of its name, none if it has none."""

FOREST_GROUPS = ("box", "mask", "histogram")
"""The thesis' vector without principal components."""
FOREST_PCA_GROUPS = (*FOREST_GROUPS, "components")
"""The thesis' vector."""
SHAPE_GROUPS = (*SHAPE_FEATURES, "box", "components")
"""Physical features, the area of the box that holds hidden ends too, and the principal components."""


def feature_names(groups: Sequence[str]) -> tuple[str, ...]:
    """Names of the columns of :func:`feature_matrix`.

    Raises
    ------
    ConfigurationError
        If a group is unknown or given twice, or there are none.
    """
    unknown = [group for group in groups if group not in FEATURES]
    if unknown or not groups or len(set(groups)) != len(groups):
        raise ConfigurationError(
            f"weight features: groups must be some of {', '.join(FEATURES)}, each once, got {list(groups)}"
        )
    return tuple(name for group in groups for name in FEATURES[group])


def feature_matrix(observations: Sequence[BerryObservation], groups: Sequence[str]) -> NDArray[np.float32]:
    """Features (N, F) of N berries, one column a name of :func:`feature_names`; all finite.

    Where in the image a cloud sits does not count: sizes are taken and directions given in the view along the line of
    sight to the berry. Neither does the order of the points.

    Raises
    ------
    ConfigurationError
        If a group is unknown or given twice, or there are none.
    ShapeError
        If an observation's cloud has no hull or its numbers are not finite, which :func:`~punnet.weight.observe`
        lets through under no circumstances.
    """
    names = feature_names(groups)
    rows = [_row(berry, groups) for berry in observations]
    matrix = np.array([[row[name] for name in names] for row in rows], dtype=np.float64)
    matrix = matrix.reshape(len(observations), len(names))
    if not np.isfinite(matrix).all():
        bad = sorted({names[column] for column in np.nonzero(~np.isfinite(matrix))[1]})
        raise ShapeError(f"weight features: {', '.join(bad)} not finite; is the observation damaged?")
    return matrix.astype(np.float32)


def _row(berry: BerryObservation, groups: Sequence[str]) -> dict[str, float]:
    row: dict[str, float] = {}
    if "box" in groups:
        row["box_area_m2"] = _box_pixels(berry) * berry.pixel_area
    if "mask" in groups:
        row["mask_area_m2"] = int(np.count_nonzero(berry.mask)) * berry.pixel_area
    if "histogram" in groups:
        row |= _histogram(berry)
    if "components" in groups:
        row |= _components(berry)
    if not SHAPE_FEATURES.keys().isdisjoint(groups):
        row |= shape_features(berry)
    return row


def _box_pixels(berry: BerryObservation) -> float:
    """Pixels of the box together with the mask's own; of the latter alone if the box lies elsewhere."""
    rows, columns = berry.window
    shown = np.array((columns.start, rows.start, columns.stop, rows.stop), dtype=np.float64)
    middle = (shown[:2] + shown[2:]) / 2.0
    box = berry.box if (berry.box[:2] < middle).all() and (middle < berry.box[2:]).all() else shown
    return float(np.prod(np.maximum(box, shown)[2:] - np.minimum(box, shown)[:2]))


def _histogram(berry: BerryObservation) -> dict[str, float]:
    """Twelve steps of 2 mm from the nearest point on, along the line of sight.

    Steps are of fixed size and counted from the berry, so that the shares tell its shape wherever it hangs; the
    distance is where they begin.
    """
    ranges = berry.ranges
    position = int(_NEAREST_SHARE * len(ranges))
    nearest = float(np.partition(ranges, position)[position])
    bins = np.clip(((ranges - nearest) / _BIN_DEPTH).astype(np.int64), 0, _BINS - 1)
    shares = np.bincount(bins, minlength=_BINS) / len(ranges)
    return {"nearest_m": nearest, **{f"depth_{k}": float(share) for k, share in enumerate(shares)}}


def _components(berry: BerryObservation) -> dict[str, float]:
    hull = hull_components(berry.cloud, berry.outline.R_view_camera)
    return {
        **{f"component_{k}_m": float(hull.deviations[k]) for k in range(3)},
        **{f"extent_{k}_m": float(hull.extents[k]) for k in range(3)},
        **{
            f"direction_{k}_{axis}": float(hull.directions[k, column])
            for k in range(2)
            for column, axis in enumerate("xyz")
        },
    }
