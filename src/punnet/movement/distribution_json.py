"""A trajectory distribution as plain JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from punnet.errors import FileFormatError
from punnet.movement.basis import GaussianBasis
from punnet.movement.pose_chart import PoseChart
from punnet.movement.via_point import ViaPoint

if TYPE_CHECKING:
    from punnet.movement.distribution import TrajectoryDistribution

__all__ = ["distribution_to_json", "fields_from_json"]

SCHEMA = "punnet-trajectory-distribution/1"


def distribution_to_json(distribution: TrajectoryDistribution) -> dict[str, Any]:
    """Plain JSON; ``reference`` (of the chart) in task space only."""
    chart = distribution.chart
    return {
        "schema": SCHEMA,
        "space": distribution.space,
        "names": list(distribution.names),
        "duration": distribution.duration,
        "basis": distribution.basis.to_json(),
        "weight_mean": distribution.weight_mean.tolist(),
        "weight_covariance": distribution.weight_covariance.tolist(),
        "observation_std": np.asarray(distribution.observation_std).tolist(),
        "via_points": [point.to_json() for point in distribution.via_points],
        **({} if chart is None else {"reference": chart.reference.tolist()}),
    }


def fields_from_json(data: dict[str, Any]) -> dict[str, Any]:
    """Arguments of :class:`~punnet.movement.TrajectoryDistribution` from what :func:`distribution_to_json` gave.

    Raises
    ------
    FileFormatError
        If the schema is unknown, or a field is missing or of the wrong kind.
    """
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        found = data.get("schema") if isinstance(data, dict) else type(data).__name__
        raise FileFormatError(f"trajectory distribution JSON: schema must be '{SCHEMA}', got {found!r}")
    try:
        return {
            "basis": GaussianBasis.from_json(data["basis"]),
            "weight_mean": np.asarray(data["weight_mean"], dtype=np.float64),
            "weight_covariance": np.asarray(data["weight_covariance"], dtype=np.float64),
            "duration": float(data["duration"]),
            "names": tuple(str(name) for name in data["names"]),
            "space": data["space"],
            "observation_std": np.asarray(data["observation_std"], dtype=np.float64),
            "via_points": tuple(ViaPoint.from_json(point) for point in data["via_points"]),
            "chart": PoseChart(np.asarray(data["reference"])) if data["space"] == "task" else None,
        }
    except FileFormatError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise FileFormatError(f"trajectory distribution JSON: {error}") from error
