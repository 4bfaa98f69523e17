"""Normalised Gaussian basis functions of a movement primitive (thesis section 5.2, figure 5.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
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

    The centres c_i lie evenly on [0, 1]. The width h decides how well weights are determined: with 8
    functions h = 0.02 gives cond(Φ) = 47; the h = 0.07 of the recorded data gives 2·10⁴ and weights of
    hundreds of radians.

    Parameters
    ----------
    count
        Number of functions B, at least 2.
    width
        The h of the formula (a variance, in squared phase), positive.

    Raises
    ------
    ConfigurationError
        If count or width is out of range.
    """

    count: int = 8
    width: float = 0.02

    def __post_init__(self) -> None:
        if self.count < 2:
            raise ConfigurationError(f"basis: count must be at least 2, got {self.count}")
        if not (math.isfinite(self.width) and self.width > 0):
            raise ConfigurationError(f"basis: width must be positive and finite, got {self.width}")

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

    @property
    def centres(self) -> NDArray[np.float64]:
        """Centres c_i, (B,), on [0, 1]."""
        return np.linspace(0.0, 1.0, self.count)

    def phi(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Values Φ (T, B) at phases (T,); every row sums to one. Phases outside [0, 1] extrapolate.

        Raises
        ------
        ShapeError
            If the phases are not a finite vector.
        """
        offsets = self._offsets(phase)
        exponents = -(offsets**2) / (2.0 * self.width)
        bumps = np.exp(exponents - exponents.max(axis=1, keepdims=True))
        return np.asarray(bumps / bumps.sum(axis=1, keepdims=True), dtype=np.float64)

    def phi_derivative(self, phase: ArrayLike) -> NDArray[np.float64]:
        """First derivative of :meth:`phi` with respect to phase, (T, B); rows sum to zero."""
        values, slopes = self.phi(phase), -self._offsets(phase) / self.width
        centred = slopes - (values * slopes).sum(axis=1, keepdims=True)
        return np.asarray(values * centred, dtype=np.float64)

    def phi_second_derivative(self, phase: ArrayLike) -> NDArray[np.float64]:
        """Second derivative of :meth:`phi` with respect to phase, (T, B); rows sum to zero."""
        values, slopes = self.phi(phase), -self._offsets(phase) / self.width
        centred = slopes - (values * slopes).sum(axis=1, keepdims=True)
        first = values * centred
        # Every log-slope falls by 1/h, which cancels; only the change of their mean is left.
        return np.asarray(
            first * centred - values * (first * slopes).sum(axis=1, keepdims=True), dtype=np.float64
        )

    def derivative(self, phase: ArrayLike, order: int) -> NDArray[np.float64]:
        """Φ (order 0), its first or its second derivative with respect to phase, (T, B)."""
        if order not in (0, 1, 2):
            raise ConfigurationError(f"basis: derivative order must be 0, 1 or 2, got {order}")
        return (self.phi, self.phi_derivative, self.phi_second_derivative)[order](phase)

    def _offsets(self, phase: ArrayLike) -> NDArray[np.float64]:
        phases = np.atleast_1d(np.asarray(phase, dtype=np.float64))
        if phases.ndim != 1 or not np.isfinite(phases).all():
            raise ShapeError(f"basis: phase must be finite numbers (T,), got shape {phases.shape}")
        return phases[:, None] - self.centres

    def to_json(self) -> dict[str, Any]:
        """Plain numbers."""
        return {"kind": "gaussian", "count": self.count, "width": self.width}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> GaussianBasis:
        """Read what :meth:`to_json` wrote.

        Raises
        ------
        FileFormatError
            If it describes another kind of basis or a field is missing.
        """
        if not isinstance(data, dict) or data.get("kind") != "gaussian":
            raise FileFormatError(f"basis JSON: kind must be 'gaussian', got {data!r}")
        try:
            return cls(count=int(data["count"]), width=float(data["width"]))
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"basis JSON: count or width missing or wrong ({error!r})") from error
