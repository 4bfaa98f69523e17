"""Which pixels could be berry: red and pale flesh by Lab colour, guarded Otsu threshold (thesis 3.1.1).

Lab is used as CIE defines it: L in 0…100, a (green − … red +) and b (blue − … yellow +) around 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError

__all__ = ["BerryPixels", "ColourThresholds", "berry_pixels", "guarded_otsu", "lab_planes", "pixel_ripeness"]


@dataclass(frozen=True, slots=True)
class ColourThresholds:
    """Bounds in Lab. The defaults were set on ``psd/dc_train`` (docs/perception-baseline.md).

    Parameters
    ----------
    red_lowest, red_highest
        The Otsu threshold on a* is kept between these, so that a picture without berries gives none and one
        full of berries does not lose the darker ones.
    red_growth
        From pixels above the threshold, regions grow down to this share of it (hysteresis): shaded flanks.
    red_hue_deg
        Largest hue angle atan2(b, a) of red flesh; soil and dead leaves lie above.
    pale_lightness, pale_chroma
        Smallest L and chroma of green-white and turning flesh.
    pale_hue_deg
        Range of hue angles of green-white and turning flesh; leaves lie above, red flesh below.
    leaf_hue_deg
        Smallest hue angle of calyx and leaf.
    leaf_chroma
        Smallest chroma of calyx and leaf.

    Raises
    ------
    ConfigurationError
        If bounds are not finite or out of order.
    """

    red_lowest: float = 10.0
    red_highest: float = 18.0
    red_growth: float = 0.45
    red_hue_deg: float = 70.0
    pale_lightness: float = 36.0
    pale_chroma: float = 13.5
    pale_hue_deg: tuple[float, float] = (60.0, 110.0)
    leaf_hue_deg: float = 105.0
    leaf_chroma: float = 10.0

    def __post_init__(self) -> None:
        if not 0 < self.red_lowest <= self.red_highest < 128:
            raise ConfigurationError(
                "colour thresholds: need 0 < red_lowest ≤ red_highest < 128, got "
                f"{self.red_lowest}, {self.red_highest}"
            )
        if not 0 < self.red_growth <= 1:
            raise ConfigurationError(
                f"colour thresholds: red_growth must lie in (0, 1], got {self.red_growth}"
            )
        if not 0 <= self.pale_hue_deg[0] < self.pale_hue_deg[1] <= 180:
            raise ConfigurationError(
                f"colour thresholds: pale_hue_deg must rise within 0…180, got {self.pale_hue_deg}"
            )


@dataclass(frozen=True, slots=True)
class BerryPixels:
    """Masks (H, W) uint8 0/1 at working size.

    Parameters
    ----------
    red
        Ripe flesh.
    pale
        Green-white and turning flesh, as far as colour can tell it from leaves.
    leaf
        Calyx, leaves and stems.
    threshold
        The a* threshold that Otsu chose within its guard.
    """

    red: NDArray[np.uint8]
    pale: NDArray[np.uint8]
    leaf: NDArray[np.uint8]
    threshold: float


def lab_planes(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """RGB (H, W, 3) to 8-bit Lab planes (3, H, W): L · 2.55, a + 128, b + 128, lightly smoothed."""
    lab = cv2.cvtColor(cv2.GaussianBlur(rgb, (3, 3), 0), cv2.COLOR_RGB2LAB)
    return np.ascontiguousarray(lab.transpose(2, 0, 1))


def guarded_otsu(values: NDArray[np.uint8], lowest: float, highest: float) -> float:
    """Otsu's threshold of 8-bit ``values``, kept within ``lowest`` … ``highest``.

    Otsu divides any picture in two, berries or not; the guard is what makes an empty picture empty. Without
    values the answer is ``highest``.
    """
    if values.size == 0:
        return highest
    threshold, _ = cv2.threshold(values.reshape(1, -1), 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    return float(np.clip(threshold, lowest, highest))


def _hue_and_chroma() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    a, b = np.meshgrid(np.arange(256.0) - 128, np.arange(256.0) - 128, indexing="ij")
    return np.degrees(np.arctan2(b, a)).astype(np.float32), np.hypot(a, b).astype(np.float32)


_HUE, _CHROMA = _hue_and_chroma()
_RIPE_HUE, _GREEN_HUE = 35.0, 75.0
# Grey pixels have no hue: highlights and achenes count little in the mean over a berry.
_RIPENESS_WEIGHT = np.clip((_CHROMA - 6.0) / 12.0, 0.0, 1.0)
_RIPENESS = np.clip((_GREEN_HUE - _HUE) / (_GREEN_HUE - _RIPE_HUE), 0.0, 1.0) * (_HUE > -40)


def pixel_ripeness(lab: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Ripeness 0 (hue ≥ 75°, green-white) … 1 (hue ≤ 35°, red) of Lab planes (3, ...), and pixel weights."""
    a, b = lab[1], lab[2]
    return _RIPENESS[a, b].astype(np.float32), _RIPENESS_WEIGHT[a, b].astype(np.float32)


def berry_pixels(lab: NDArray[np.uint8], thresholds: ColourThresholds) -> BerryPixels:
    """Divide an image's pixels into red flesh, pale flesh and leaf.

    Parameters
    ----------
    lab
        Planes of :func:`lab_planes`.
    thresholds
        Bounds.
    """
    lightness, a, b = lab
    warm = a[a > 128 + thresholds.red_lowest / 2] - np.uint8(128)
    threshold = guarded_otsu(warm, thresholds.red_lowest, thresholds.red_highest)
    red = _grow(
        _table(a, b, (thresholds.red_hue_deg >= _HUE) & _redder_than(threshold)),
        _table(a, b, (thresholds.red_hue_deg >= _HUE) & _redder_than(threshold * thresholds.red_growth)),
    )
    lowest, highest = thresholds.pale_hue_deg
    pale = _table(a, b, (lowest <= _HUE) & (highest >= _HUE) & (thresholds.pale_chroma <= _CHROMA))
    pale &= (lightness >= thresholds.pale_lightness * 2.55).astype(np.uint8)
    pale &= 1 - red
    leaf = _table(a, b, (thresholds.leaf_hue_deg <= _HUE) & (thresholds.leaf_chroma <= _CHROMA))
    return BerryPixels(red, pale, leaf, threshold)


def _redder_than(threshold: float) -> NDArray[np.bool_]:
    a = np.arange(256.0)[:, None] - 128
    b = np.arange(256.0)[None, :] - 128
    # Magenta petals and plastic lie at b < 0; red flesh does not.
    return (a >= threshold) & (b > -0.3 * a)


def _table(a: NDArray[np.uint8], b: NDArray[np.uint8], allowed: NDArray[np.bool_]) -> NDArray[np.uint8]:
    index = (a.astype(np.uint16) << np.uint16(8)) | b
    return np.take(allowed.astype(np.uint8).ravel(), index)


def _grow(seeds: NDArray[np.uint8], region: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Keep the connected parts of ``region`` that hold a seed."""
    count, labels = cv2.connectedComponents(region, connectivity=4)
    keep = np.zeros(count, dtype=np.uint8)
    keep[labels[seeds > 0]] = 1
    keep[0] = 0
    return np.asarray(keep[labels])
