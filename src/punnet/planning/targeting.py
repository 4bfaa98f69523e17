"""Which berry a plan is for, and where the camera was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import PlanningError, ShapeError
from punnet.robot import T_FLANGE_CAMERA, Arm, Panda
from punnet.scene import Frame, Strawberries, Target

__all__ = ["as_seen_from", "choose_target"]


def as_seen_from(frame: Frame, joints: ArrayLike, arm: Arm | None = None) -> Frame:
    """Return the frame with ``T_base_camera``, which is computed from ``joints`` (J,) where it is not known.

    The camera is taken to sit where :data:`~punnet.robot.T_FLANGE_CAMERA` says.
    """
    if frame.T_base_camera is not None:
        return frame
    flange = (arm or Panda()).forward_kinematics(np.asarray(joints, dtype=np.float64))
    return replace(frame, T_base_camera=flange @ T_FLANGE_CAMERA)


def choose_target(berries: Strawberries, box: ArrayLike | None = None) -> Target:
    """Take the berry under ``box``; without a box, the surest pluckable berry that has a picking point.

    Parameters
    ----------
    berries
        With picking points where depth gives one.
    box
        (4,) xyxy pixels; the berry whose own box overlaps it most (intersection over union) is taken.

    Raises
    ------
    ShapeError
        If the box is not x0 < x1, y0 < y1.
    PlanningError
        If no berry is there, or none can be located in space.
    """
    if box is not None:
        index = _under(berries, np.asarray(box, dtype=np.float64))
    else:
        located = np.isfinite(berries.picking_points).all(axis=1)
        if not (berries.pluckable & located).any():
            raise PlanningError(
                f"no target: of {len(berries)} berries {int(berries.pluckable.sum())} are pluckable, "
                f"{int((berries.pluckable & located).sum())} of those have depth; name another by its box"
            )
        index = int(np.argmax(np.where(berries.pluckable & located, berries.scores, -1.0)))
    point = berries.picking_points[index]
    if not np.isfinite(point).all():
        raise PlanningError(
            f"no depth: berry {berries.ids[index]} can't be located in space; depth has a hole there"
        )
    return Target(box=berries.boxes[index], picking_point=point, berry_id=int(berries.ids[index]))


def _under(berries: Strawberries, box: NDArray[np.float64]) -> int:
    if box.shape != (4,) or not np.isfinite(box).all() or (box[2:] <= box[:2]).any():
        raise ShapeError(
            f"target box: four pixels x0,y0,x1,y1 with x0 < x1 and y0 < y1 are needed, got {box.tolist()}"
        )
    low = np.maximum(berries.boxes[:, :2], box[:2])
    high = np.minimum(berries.boxes[:, 2:], box[2:])
    common = np.prod(np.clip(high - low, 0.0, None), axis=1)
    union = np.prod(berries.boxes[:, 2:] - berries.boxes[:, :2], axis=1) + np.prod(box[2:] - box[:2]) - common
    if not (common > 0).any():
        raise PlanningError(
            f"no target: none of the {len(berries)} berries found lies in the box {box.tolist()}"
        )
    return int(np.argmax(common / union))
