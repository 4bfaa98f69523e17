"""Smooth random fields for painted surfaces."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["tiling_noise"]


def tiling_noise(rng: np.random.Generator, shape: tuple[int, int], sigma: float) -> NDArray[np.float32]:
    """Draw noise (H, W) of zero mean and unit deviation, smooth over ``sigma`` pixels, without a seam.

    Smooth fields are drawn on a coarser grid and enlarged: the blur would have removed the detail.
    """
    step = max(1, int(sigma // 3))
    coarse = (max(shape[0] // step, 4), max(shape[1] // step, 4))
    field = rng.standard_normal(coarse, dtype=np.float32)
    pad = min(int(3 * sigma / step) + 1, *coarse)
    wide = cv2.copyMakeBorder(field, pad, pad, pad, pad, cv2.BORDER_WRAP)
    smooth = cv2.GaussianBlur(wide, (0, 0), max(sigma / step, 0.5))
    if step > 1:
        size = (wide.shape[1] * shape[1] // coarse[1], wide.shape[0] * shape[0] // coarse[0])
        smooth = cv2.resize(smooth, size, interpolation=cv2.INTER_LINEAR)
        top, left = pad * shape[0] // coarse[0], pad * shape[1] // coarse[1]
        smooth = smooth[top : top + shape[0], left : left + shape[1]]
    else:
        smooth = smooth[pad : pad + shape[0], pad : pad + shape[1]]
    return np.asarray((smooth - smooth.mean()) / smooth.std(), dtype=np.float32)
