"""Weight from geometry alone: silhouette and depth to an ellipsoid-like volume, times density.

The outline's area A is measured at the berry's distance (:class:`BerryObservation`). The volume is
V = f · ⅔ A T with T the extent along the line of sight (an ellipsoid has f = 1 exactly). T can't be seen;
it is guessed from the outline, and corrected by how much the cloud bulges towards the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

from punnet.errors import ConfigurationError
from punnet.scene import Frame, Strawberries
from punnet.weight.estimator import WeightEstimates, gather_estimates
from punnet.weight.observation import BerryObservation, observe

__all__ = ["EllipsoidConfig", "EllipsoidEstimator"]

_GRAMS_PER_CUBIC_METRE = 1e6


@dataclass(frozen=True)
class EllipsoidConfig:
    """Constants of :class:`EllipsoidEstimator`; ``benchmarks/weight_constants.py`` prints the fitted ones.

    Parameters
    ----------
    density
        Grams per cubic centimetre (strawberries float: .85 … 1).
    shape_factor
        f in V = f · ⅔ A T: how much less a berry holds than an ellipsoid of the same outline.
    thickness_factor, elongation_exponent
        T = factor · √(length · width) · (length / width)^exponent of the outline, before the cloud is asked. A body of
        revolution would have 1 and −½; a berry that looks broad is more often a wedge seen from its broad side. The
        calyx hides some of the length, so the factor from pictures is above the one from meshes.
    thickness_spread, relief_spread
        Relative standard deviations of that guess and of what the cloud's bulge says: who is believed.
    relief_gain
        Bulge that the camera shows of a berry's true half extent: stereo smooths it.
    shape_spread
        Relative standard deviation of shape and density together.
    calyx_share
        Share of the outline that the berry's own calyx and stem may cover without anything being hidden.
    hidden_gain
        Logarithm of the weight that is missed for each share of the outline hidden beyond that.
    coverage
        Nominal coverage of the interval.

    Raises
    ------
    ConfigurationError
        If a constant is out of its range.
    """

    density: float = 0.92
    shape_factor: float = 0.960
    thickness_factor: float = 1.04
    elongation_exponent: float = -0.42
    thickness_spread: float = 0.10
    relief_spread: float = 0.15
    relief_gain: float = 0.93
    shape_spread: float = 0.045
    calyx_share: float = 0.15
    hidden_gain: float = 0.6
    coverage: float = 0.9

    def __post_init__(self) -> None:
        for name in (
            "density",
            "shape_factor",
            "thickness_factor",
            "thickness_spread",
            "relief_spread",
            "relief_gain",
            "shape_spread",
            "hidden_gain",
        ):
            if not 0 < getattr(self, name) < math.inf:
                raise ConfigurationError(f"ellipsoid: {name} must be positive, got {getattr(self, name)}")
        if not 0 < self.coverage < 1:
            raise ConfigurationError(f"ellipsoid: coverage must lie in (0, 1), got {self.coverage}")


class EllipsoidEstimator:
    """Weighs by silhouette, depth and an ellipsoid-like volume; needs no training.

    Parameters
    ----------
    config
        Constants; defaults if None.
    """

    name = "ellipsoid"

    def __init__(self, config: EllipsoidConfig | None = None) -> None:
        self.config = config or EllipsoidConfig()

    def estimate(self, frame: Frame, berries: Strawberries) -> WeightEstimates:
        """Grams with an interval for each of ``berries``; NaN with a reason where the frame can't tell."""
        answers = [seen if isinstance(seen, str) else self.weigh(seen) for seen in observe(frame, berries)]
        return gather_estimates(answers, self.config.coverage)

    def weigh(self, berry: BerryObservation) -> tuple[float, float, float]:
        """Grams, lower and upper bound of one berry."""
        config = self.config
        hidden = max(0.0, berry.hidden - config.calyx_share) / (1.0 - config.calyx_share)
        thickness, spread = self._thickness(berry, hidden)
        area = berry.outline.area * berry.scale**2
        volume = config.shape_factor * 2.0 / 3.0 * area * thickness
        weight = volume * _GRAMS_PER_CUBIC_METRE * config.density * math.exp(config.hidden_gain * hidden)
        pixels = math.sqrt(berry.outline.area) * berry.camera.fx
        return weight, *self._interval(weight, spread, pixels, hidden)

    def _thickness(self, berry: BerryObservation, hidden: float) -> tuple[float, float]:
        """Extent along the line of sight in metres, and its relative standard deviation."""
        config, outline = self.config, berry.outline
        # Longer or broader than that, part of the outline is missing.
        elongation = min(max(outline.length / outline.width, 0.8), 1.6)
        guess = config.thickness_factor * elongation**config.elongation_exponent
        guess *= math.sqrt(outline.length * outline.width) * berry.scale
        bulge = 2.0 * berry.relief / config.relief_gain
        if math.isnan(bulge):
            return guess, config.thickness_spread
        bulge = min(max(bulge, 0.7 * guess), 1.4 * guess)
        # A dome that is partly hidden is fitted off its middle: believe it less.
        doubt = config.relief_spread * (1.0 + 4.0 * hidden)
        share = config.thickness_spread**2 / (config.thickness_spread**2 + doubt**2)
        spread = 1.0 / math.sqrt(config.thickness_spread**-2 + doubt**-2)
        return guess * (bulge / guess) ** share, spread

    def _interval(self, weight: float, thickness: float, pixels: float, hidden: float) -> tuple[float, float]:
        """Log-normal interval; what is hidden can only add weight, so it widens the upper side most."""
        outline = 1.5 * 2.0 / pixels  # the outline is known to about a pixel all around
        known = math.hypot(self.config.shape_spread, thickness, outline, _DISTANCE_SPREAD)
        quantile = NormalDist().inv_cdf(0.5 + self.config.coverage / 2.0)
        below = quantile * math.hypot(known, self.config.hidden_gain * hidden)
        above = quantile * math.hypot(known, 4.0 * self.config.hidden_gain * hidden)
        return weight * math.exp(-below), weight * math.exp(above)


_DISTANCE_SPREAD = 0.02
"""Relative error of the weight by the distance's: V grows with its cube, and stereo is good to 2–3 mm."""
