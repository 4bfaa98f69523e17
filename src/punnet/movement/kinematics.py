"""What movement primitives need to know of an arm: where it is, and how that changes with its joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["ForwardKinematics"]


@dataclass(frozen=True, eq=False)
class ForwardKinematics:
    """Forward kinematics of any arm (or chart) as two functions over batches.

    Parameters
    ----------
    pose
        Takes coordinates (T, D) to poses ``T_base_end`` (T, 4, 4).
    jacobian
        Takes coordinates (T, D) to geometric Jacobians (T, 6, D): rows 0–2 linear velocity of the frame's
        origin, rows 3–5 angular velocity, both in the base frame.
    """

    pose: Callable[[NDArray[np.float64]], NDArray[np.float64]]
    jacobian: Callable[[NDArray[np.float64]], NDArray[np.float64]]
