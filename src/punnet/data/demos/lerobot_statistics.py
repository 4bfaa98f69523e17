"""The statistics that LeRobot keeps of every feature, an episode and in all."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["episode_statistics", "joined_statistics", "picture_statistics"]

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
_STRIDE = 4  # of pixels: statistics of a picture need not look at each
Statistics = dict[str, dict[str, Any]]


def episode_statistics(columns: dict[str, NDArray[Any]]) -> Statistics:
    """Minimum, maximum, mean, spread and quantiles of each feature (T,) or (T, D); what is not known counts as 0."""
    told = {}
    for key, values in columns.items():
        rows = values.reshape(len(values), -1).astype(np.float64)
        told[key] = _of(np.nan_to_num(rows), len(rows))
    return told


def picture_statistics(rgb: NDArray[np.uint8]) -> dict[str, Any]:
    """The same of the colours, in [0, 1], each (3, 1, 1)."""
    pixels = rgb[::_STRIDE, ::_STRIDE].reshape(-1, 3).astype(np.float64) / 255.0
    told = _of(pixels, 1)
    return {name: value if name == "count" else [[[one]] for one in value] for name, value in told.items()}


def _of(rows: NDArray[np.float64], count: int) -> dict[str, Any]:
    told: dict[str, Any] = {
        "min": rows.min(axis=0).tolist(),
        "max": rows.max(axis=0).tolist(),
        "mean": rows.mean(axis=0).tolist(),
        "std": rows.std(axis=0).tolist(),
        "count": [count],
    }
    levels = np.quantile(rows, list(QUANTILES.values()), axis=0)
    return told | {name: level.tolist() for name, level in zip(QUANTILES, levels, strict=True)}


def joined_statistics(episodes: list[Statistics]) -> Statistics:
    """Those of all episodes together; quantiles as the mean of the episodes', weighted by their lengths."""
    joined: Statistics = {}
    for key in episodes[0]:
        told = [episode[key] for episode in episodes]
        counts = np.array([one["count"][0] for one in told], dtype=np.float64)
        share = counts / counts.sum()
        means, stds = (np.array([one[name] for one in told]) for name in ("mean", "std"))
        weight = share.reshape(-1, *[1] * (means.ndim - 1))
        mean = (weight * means).sum(axis=0)
        variance = (weight * (np.square(stds) + np.square(means - mean))).sum(axis=0)
        joined[key] = {
            "min": np.min([one["min"] for one in told], axis=0).tolist(),
            "max": np.max([one["max"] for one in told], axis=0).tolist(),
            "mean": mean.tolist(),
            "std": np.sqrt(variance).tolist(),
            "count": [int(counts.sum())],
        }
        for name in QUANTILES:
            joined[key][name] = (weight * np.array([one[name] for one in told])).sum(axis=0).tolist()
    return joined
