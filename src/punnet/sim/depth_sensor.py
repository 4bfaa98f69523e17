"""What a stereo depth camera (Intel RealSense D435i, depth aligned to colour) makes of a true depth picture.

The camera finds, by matching small windows, how far a point of its left imager has moved in the right one:
the disparity d = f B / z. Its faults follow from that, and are made here in the same order:

1. *shadow*: a point that the right imager can't see has no match. Seen from the colour camera, left of both
   imagers, that is a band on the left of every near thing, as wide as its parallax against what is behind;
2. *fattening*: a window that straddles an edge takes the disparity of the nearer side, or finds none;
3. *no match* on glare and, now and then, anywhere;
4. *noise* of the matching, the same over about a window, so an error in depth that grows with z²;
5. *steps*: disparity in 1/32 of a pixel, and depth in whole millimetres in the 16-bit picture;
6. *range*: nearer than the search range of disparities, or farther than the limit, there is no reading.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from statistics import NormalDist

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, ShapeError

__all__ = ["StereoDepthModel"]

_NOISE_SIGMA = 1.5
"""Spread, in half-resolution pixels, of the blur that makes noise and failures come in patches."""
_INTERPOLATION_GAIN = 1.032

_TOUCHING = 0.01
"""Metres: nearer things lie far outside the search range, and their disparities need not be told apart."""


@dataclass(frozen=True)
class StereoDepthModel:
    """An error model of stereo depth; the defaults are the D435i's at 640×480.

    Parameters
    ----------
    baseline
        Metres between the imagers (datasheet 337029, D430 module: 50 mm).
    colour_offset
        Metres from the colour camera to the left imager, both looking the same way (15 mm to its right).
    imager_focal
        Focal length of the imagers in their pixels; sets the disparity (D430, 640×480: about 385).
    image_focal
        Focal length in pixels of the picture that is worked on, the colour camera's; sets the shadow's width.
    disparity_step
        Smallest difference of disparity, pixels.
    disparity_noise
        Standard deviation of the disparity on a well-textured surface, pixels.
    depth_unit
        Metres per count of the 16-bit picture; 0 leaves the steps of disparity alone.
    min_range, max_range
        Metres between which there are readings (datasheet: from 0.175 at 640×480, to about 10).
    edge_jump
        Disparity, pixels, between neighbours that makes an edge.
    fattening
        Share of the background within one pixel of a nearer thing that reads the nearer thing's depth.
    edge_holes
        Share of the background within three pixels of an edge that reads nothing, unless it is fattened.
    glare_level, glare_holes
        A pixel with all three channels at or above the level is glare; the share of those that read nothing.
    random_holes
        Share of all pixels that read nothing for no visible reason.

    Raises
    ------
    ConfigurationError
        If a setting is out of its range.
    """

    baseline: float = 0.050
    colour_offset: float = 0.015
    imager_focal: float = 385.0
    image_focal: float = 615.0
    disparity_step: float = 1.0 / 32.0
    disparity_noise: float = 0.08
    depth_unit: float = 0.001
    min_range: float = 0.175
    max_range: float = 10.0
    edge_jump: float = 1.0
    fattening: float = 0.6
    edge_holes: float = 0.5
    glare_level: int = 250
    glare_holes: float = 0.6
    random_holes: float = 0.001

    def __post_init__(self) -> None:
        for name in (field.name for field in fields(self)):
            if not math.isfinite(getattr(self, name)):
                raise ConfigurationError(f"depth sensor: {name} must be finite, got {getattr(self, name)}")
        for name in ("baseline", "imager_focal", "image_focal", "disparity_step", "min_range", "edge_jump"):
            if getattr(self, name) <= 0:
                raise ConfigurationError(f"depth sensor: {name} must be positive, got {getattr(self, name)}")
        for name in ("fattening", "edge_holes", "glare_holes", "random_holes"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigurationError(
                    f"depth sensor: {name} is a share in [0, 1], got {getattr(self, name)}"
                )
        for name in ("colour_offset", "disparity_noise", "depth_unit"):
            if getattr(self, name) < 0:
                raise ConfigurationError(f"depth sensor: {name} can't be negative, got {getattr(self, name)}")
        if self.max_range <= self.min_range:
            raise ConfigurationError(f"depth sensor: max_range must exceed min_range = {self.min_range}")

    def depth_error(self, depth: float) -> float:
        """Give the standard deviation in metres at ``depth`` metres before rounding: σ_d z² / (f B)."""
        return self.disparity_noise * depth * depth / (self.imager_focal * self.baseline)

    def apply(
        self, depth_true: NDArray[np.float32], rgb: NDArray[np.uint8], rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """Turn true depth (H, W) in metres, 0 = nothing there, into the camera's reading, 0 = no reading.

        ``rgb`` (H, W, 3) of the same view tells where glare blinds the imagers.

        Raises
        ------
        ShapeError
            If the pictures disagree in size, or the depth is negative or not finite.
        """
        depth = np.ascontiguousarray(depth_true, dtype=np.float32)
        if depth.ndim != 2 or rgb.shape != (*depth.shape, 3):
            raise ShapeError(
                f"depth sensor: need depth (H, W) and rgb (H, W, 3), got {depth.shape} and {rgb.shape}"
            )
        if not bool(np.isfinite(depth).all()) or depth.min(initial=0.0) < 0:
            raise ShapeError("depth sensor: true depth must be finite metres ≥ 0")
        scale = np.float32(self.imager_focal * self.baseline)
        clear = np.maximum(depth, np.float32(_TOUCHING))
        disparity = np.divide(scale, clear, out=np.zeros_like(depth), where=depth > 0)
        lost = self._shadow(disparity)
        failing = _patchy_normal(depth.shape, rng)
        lost |= self._glare(rgb) & (failing < _normal_quantile(self.glare_holes))
        lost |= failing > -_normal_quantile(self.random_holes)
        disparity = self._blur_edges(disparity, failing, lost)
        disparity += np.float32(self.disparity_noise) * _patchy_normal(depth.shape, rng)
        return self._read_out(disparity, lost)

    def _shadow(self, disparity: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Mask what the right imager can't see: warp the picture there, keep the nearest of each pixel."""
        height, width = disparity.shape
        parallax_per_disparity = (self.baseline + self.colour_offset) / self.baseline
        parallax = disparity * np.float32(parallax_per_disparity * self.image_focal / self.imager_focal)
        pad = math.ceil(float(parallax.max(initial=0.0))) + 1
        stride = width + pad + 1
        columns = np.arange(pad, pad + width, dtype=np.float32)
        landing = (columns - parallax).astype(np.int32)
        landing += (np.arange(height, dtype=np.int32) * stride)[:, None]
        landing = landing.ravel()
        nearest = np.zeros(height * stride + 1, dtype=np.float32)
        flat = parallax.ravel()
        # A surface stretches on its way to the other view: cover the next pixel too, or what is behind shows.
        np.maximum.at(nearest, landing, flat)
        np.maximum.at(nearest, landing + 1, flat)
        hidden: NDArray[np.bool_] = (nearest[landing] - flat > 1.5).reshape(height, width)
        return hidden

    def _glare(self, rgb: NDArray[np.uint8]) -> NDArray[np.bool_]:
        bright = cv2.inRange(rgb, (self.glare_level,) * 3, (255, 255, 255))
        return np.asarray(cv2.dilate(bright, np.ones((3, 3), np.uint8)) > 0)

    def _blur_edges(
        self, disparity: NDArray[np.float32], failing: NDArray[np.float32], lost: NDArray[np.bool_]
    ) -> NDArray[np.float32]:
        """Let near things spread over what is behind them, and mark the rest of the edge zone in ``lost``."""
        near_by = cv2.dilate(disparity, np.ones((7, 7), np.uint8))
        edge = near_by - disparity > self.edge_jump
        rows, columns = np.nonzero(edge)
        adjacent = cv2.dilate(disparity, np.ones((3, 3), np.uint8))[rows, columns]
        own, luck = disparity[rows, columns], failing[rows, columns]
        fat = (adjacent - own > self.edge_jump) & (luck < _normal_quantile(self.fattening))
        spread = disparity.copy()
        spread[rows[fat], columns[fat]] = adjacent[fat]
        lost[rows[fat], columns[fat]] = False
        hole = ~fat & (luck > -_normal_quantile(self.edge_holes))
        lost[rows[hole], columns[hole]] = True
        return spread

    def _read_out(self, disparity: NDArray[np.float32], lost: NDArray[np.bool_]) -> NDArray[np.float32]:
        scale = np.float32(self.imager_focal * self.baseline)
        step = np.float32(self.disparity_step)
        stepped = np.rint(disparity / step) * step
        nearest, farthest = scale / np.float32(self.min_range), scale / np.float32(self.max_range)
        lost = lost | (stepped < farthest) | (stepped > nearest)
        stepped[lost] = 1.0
        depth: NDArray[np.float32] = scale / stepped
        if self.depth_unit > 0:
            unit = np.float32(self.depth_unit)
            np.rint(depth / unit, out=depth)
            depth *= unit
        depth[lost] = 0.0
        return depth


def _patchy_normal(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw a standard normal for each pixel, alike within a matching window (correlation ½ at 5 pixels)."""
    height, width = shape
    coarse = rng.standard_normal(((height + 1) // 2 + 1, (width + 1) // 2 + 1), dtype=np.float32)
    smooth = cv2.GaussianBlur(coarse, (0, 0), _NOISE_SIGMA, borderType=cv2.BORDER_REFLECT)
    field = cv2.resize(smooth, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)[:height, :width]
    # Blurring white noise by a Gaussian leaves 1/(2σ√π) of its spread; interpolation takes 3% more.
    return np.asarray(field * np.float32(2.0 * _NOISE_SIGMA * math.sqrt(math.pi) * _INTERPOLATION_GAIN))


def _normal_quantile(share: float) -> float:
    """X with P(standard normal < x) = ``share``; ±∞ at 0 and 1."""
    if share <= 0:
        return -math.inf
    if share >= 1:
        return math.inf
    return NormalDist().inv_cdf(share)
