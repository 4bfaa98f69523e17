"""The berry that a plan is for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.scene.strawberries import Strawberries

__all__ = ["Target"]


@dataclass(frozen=True, eq=False)
class Target:
    """One berry to reach for.

    Parameters
    ----------
    box
        (4,) xyxy pixels in the frame that the plan is made from.
    picking_point
        (3,) metres in the robot's base frame: the point on the stem to cut at. None if depth gave none; planners
        that work from the picture alone need only the box.
    approach
        (3,) unit vector in the base frame along which the tool comes in; None leaves it to the planner.
    berry_id
        Id of the berry in its :class:`~punnet.scene.Strawberries`.
    among
        All berries that were seen in the same frame, the target among them; None if only the target is known.

    Raises
    ------
    ShapeError
        If a field has the wrong shape or is not finite, or ``among`` has no berry of that id.
    """

    box: NDArray[np.float64]
    picking_point: NDArray[np.float64] | None = None
    approach: NDArray[np.float64] | None = None
    berry_id: int = 0
    among: Strawberries | None = None

    def __post_init__(self) -> None:
        for name, size in (("box", 4), ("picking_point", 3), ("approach", 3)):
            value = getattr(self, name)
            if value is None:
                continue
            array = np.asarray(value, dtype=np.float64)
            if array.shape != (size,) or not np.isfinite(array).all():
                raise ShapeError(f"target: {name} must be {size} finite numbers, got {array.shape} {value!r}")
            object.__setattr__(self, name, array)
        if self.approach is not None and not np.isclose(np.linalg.norm(self.approach), 1.0, atol=1e-6):
            raise ShapeError("target: approach must be a unit vector")
        if self.among is not None and self.berry_id not in self.among.ids:
            raise ShapeError(
                f"target: among the {len(self.among)} berries seen there is none of id {self.berry_id}"
            )
