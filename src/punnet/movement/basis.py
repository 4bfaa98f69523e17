"""Normalised Gaussian basis functions of a movement primitive (thesis section 5.2, figure 5.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, FileFormatError, ShapeError

__all__ = ["GaussianBasis"]

RECORDED_WIDTH = 0.07
WIDTH_TIMES_SPACING = 0.98  # width = this / (count − 1)²: 0.02 for 8 functions, cond(Φ) ≈ 47 for any count


@dataclass(frozen=True, slots=True)
class GaussianBasis:
    """Basis functions ``ψ_i(z) = b_i(z) / Σ_j b_j(z)`` with ``b_i(z) = exp(−(z − c_i)² / (2 h))``.

    The width h decides how well weights are determined: with 8 functions h = 0.02 gives cond(Φ) = 47; the
    h = 0.07 of the recorded data gives 2·10⁴ and weights of hundreds of radians.

    Parameters
    ----------
    count
        Number of functions B, at least 2.
    width
        The h of the formula (a variance, in squared phase), positive.
    centres
        The B centres c_i in rising order; evenly on [0, 1] if not given.

    Raises
    ------
    ConfigurationError
        If count or width is out of range, or the centres are not B rising numbers.
    """

    count: int = 8
    width: float = 0.02
    centres: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.count < 2:
            raise ConfigurationError(f"basis: count must be at least 2, got {self.count}")
        if not (math.isfinite(self.width) and self.width > 0):
            raise ConfigurationError(f"basis: width must be positive and finite, got {self.width}")
        placed = tuple(float(centre) for centre in self.centres) or tuple(
            np.linspace(0, 1, self.count).tolist()
        )
        rising = all(a < b for a, b in pairwise(placed))
        if len(placed) != self.count or not rising or not all(map(math.isfinite, placed)):
            raise ConfigurationError(f"basis: centres must be {self.count} rising numbers, got {placed}")
        object.__setattr__(self, "centres", placed)

    @classmethod
    def recorded(cls) -> GaussianBasis:
        """Basis of the lab's recorded weights: 8 functions, h = 0.07. For reading that data only."""
        return cls(count=8, width=RECORDED_WIDTH)

    @classmethod
    def spaced(cls, count: int) -> GaussianBasis:
        """``count`` functions whose width follows their spacing, as well conditioned as the default."""
        if count < 2:
            raise ConfigurationError(f"basis: count must be at least 2, got {count}")
        return cls(count=count, width=WIDTH_TIMES_SPACING / (count - 1) ** 2)

    def phi(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Values Φ (T, B) at phases (T,); every row sums to one. Phases outside [0, 1] extrapolate.

        Raises
        ------
        ShapeError
            If the phases are not a finite vector.
        """
        return self._values(self._offsets(phase))

    def derivative(self, phase: ArrayLike, order: int) -> NDArray[np.float64]:
        """Φ (order 0), its first (velocity) or second (acceleration) derivative by phase, (T, B).

        Rows of derivatives sum to zero. By time, divide by ``duration**order``.

        Raises
        ------
        ConfigurationError
            If the order is not 0, 1 or 2.
        """
        if order not in (0, 1, 2):
            raise ConfigurationError(f"basis: derivative order must be 0, 1 or 2, got {order}")
        offsets = self._offsets(phase)
        values = self._values(offsets)
        if order == 0:
            return values
        slopes = -offsets / self.width
        centred = slopes - (values * slopes).sum(axis=1, keepdims=True)
        first = values * centred
        if order == 1:
            return np.asarray(first, dtype=np.float64)
        # Every log-slope falls by 1/h, which cancels; only the change of their mean is left.
        change = (first * slopes).sum(axis=1, keepdims=True)
        return np.asarray(first * centred - values * change, dtype=np.float64)

    def condition_number(self, samples: int = 150) -> float:
        """cond(Φ) over evenly spaced phases: by how much noise in a trajectory grows in its weights."""
        return float(np.linalg.cond(self.phi(np.linspace(0.0, 1.0, samples))))

    def _offsets(self, phase: ArrayLike) -> NDArray[np.float64]:
        phases = np.array(phase, dtype=np.float64, ndmin=1)
        # The sum of squares is finite if all are, and takes a fifth of the time of asking each.
        if phases.ndim != 1 or not math.isfinite(np.vdot(phases, phases)):
            raise ShapeError(f"basis: phase must be finite numbers (T,), got shape {phases.shape}")
        return np.asarray(phases[:, None] - np.array(self.centres), dtype=np.float64)

    def _values(self, offsets: NDArray[np.float64]) -> NDArray[np.float64]:
        exponents = offsets * offsets
        exponents *= -0.5 / self.width
        exponents -= np.maximum.reduce(exponents, axis=1, keepdims=True)
        bumps = np.exp(exponents)
        bumps /= np.add.reduce(bumps, axis=1, keepdims=True)
        return np.asarray(bumps)

    def to_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {
            "kind": "gaussian",
            "count": self.count,
            "width": self.width,
            "centres": list(self.centres),
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> GaussianBasis:
        """Read what :meth:`to_json` wrote; without ``centres`` they lie evenly.

        Raises
        ------
        FileFormatError
            If it describes another kind of basis or a field is missing.
        """
        if not isinstance(data, dict) or data.get("kind") != "gaussian":
            raise FileFormatError(f"basis JSON: kind must be 'gaussian', got {data!r}")
        try:
            return cls(int(data["count"]), float(data["width"]), tuple(data.get("centres", ())))
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"basis JSON: a field is missing or wrong ({error!r})") from error
