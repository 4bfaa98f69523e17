"""A value that trajectories shall pass."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.errors import ConfigurationError, FileFormatError, ShapeError

__all__ = ["ViaPoint"]


@dataclass(frozen=True, eq=False)
class ViaPoint:
    """A value that trajectories shall pass at a phase.

    Parameters
    ----------
    phase
        Where along the movement, 0 start … 1 end; :meth:`at_time` takes seconds instead.
    values
        (k,) values in the unit of the degrees of freedom (per unit phase, or its square, with ``order`` 1, 2).
    degrees_of_freedom
        The k indices that the values are for; None for all, in order.
    std
        Standard deviation of the values, one number or (k,); 0 asks for the exact value.
    order
        0 for a position, 1 for a velocity and 2 for an acceleration with respect to phase.

    Raises
    ------
    ShapeError
        If the sizes disagree or a number is not finite.
    ConfigurationError
        If the phase lies outside [0, 1], an index repeats, a std is negative or the order unknown.
    """

    phase: float
    values: NDArray[np.float64]
    degrees_of_freedom: tuple[int, ...] | None = None
    std: float | NDArray[np.float64] = 0.0
    order: int = 0

    def __post_init__(self) -> None:
        values = np.array(self.values, dtype=np.float64, ndmin=1)
        phase = float(self.phase)
        # Via-points are small: plain numbers are quicker than arrays.
        if values.ndim != 1 or not all(map(math.isfinite, values.tolist())) or not math.isfinite(phase):
            raise ShapeError(
                f"via-point: phase and values (k,) must be finite, got {phase} and {values.tolist()}"
            )
        if not 0.0 <= phase <= 1.0:
            raise ConfigurationError(f"via-point: phase must lie in [0, 1], got {phase}")
        std: float | NDArray[np.float64] = 0.0
        if isinstance(self.std, float):
            std, right = self.std, 0.0 <= self.std < math.inf
        else:
            array = np.array(self.std, dtype=np.float64)
            if array.shape not in ((), values.shape):
                raise ShapeError(f"via-point: std must be one number or {values.shape}, got {array.shape}")
            right = all(0.0 <= entry < math.inf for entry in array.ravel().tolist())
            std = array if array.ndim else float(array)
        if not right:
            raise ConfigurationError(f"via-point: std must be finite and not negative, got {self.std}")
        if self.order not in (0, 1, 2):
            raise ConfigurationError(f"via-point: order must be 0, 1 or 2, got {self.order}")
        if self.degrees_of_freedom is not None:
            chosen = tuple(int(index) for index in self.degrees_of_freedom)
            if len(chosen) != len(values):
                raise ShapeError(f"via-point: {len(chosen)} degrees of freedom but {len(values)} values")
            if len(set(chosen)) != len(chosen):
                raise ConfigurationError(f"via-point: a degree of freedom repeats in {chosen}")
            object.__setattr__(self, "degrees_of_freedom", chosen)
        self.__dict__.update(phase=phase, values=values, std=std)

    @classmethod
    def at_time(
        cls,
        time: float,
        values: ArrayLike,
        duration: float,
        *,
        degrees_of_freedom: tuple[int, ...] | None = None,
        std: ArrayLike = 0.0,
        order: int = 0,
    ) -> ViaPoint:
        """Via-point at ``time`` seconds of a movement of ``duration`` seconds.

        Values and std are per second (squared) with ``order`` 1 (2), as a robot knows them.

        Raises
        ------
        ConfigurationError
            If the duration is not positive or the time not within it.
        """
        if not (duration > 0 and math.isfinite(duration) and 0.0 <= time <= duration):
            raise ConfigurationError(f"via-point: time {time} s is not within a duration of {duration} s")
        scale = duration**order
        scaled = np.array(values, dtype=np.float64, ndmin=1) * scale
        return cls(
            time / duration, scaled, degrees_of_freedom, np.asarray(std, dtype=np.float64) * scale, order
        )

    @property
    def variances(self) -> NDArray[np.float64]:
        """Noise variances (k,) of the values."""
        return np.full(len(self.values), self.std) ** 2

    def indices(self, dimensions: int) -> NDArray[np.int64]:
        """Give the indices (k,) of its degrees of freedom in a movement with ``dimensions`` of them.

        Raises
        ------
        ShapeError
            If it names a degree of freedom that does not exist, or has too few values for all.
        """
        if self.degrees_of_freedom is None:
            if len(self.values) != dimensions:
                raise ShapeError(f"via-point: {len(self.values)} values for {dimensions} degrees of freedom")
            return np.arange(dimensions)
        if any(not 0 <= index < dimensions for index in self.degrees_of_freedom):
            raise ShapeError(
                f"via-point: degrees of freedom {self.degrees_of_freedom} not all in 0…{dimensions - 1}"
            )
        return np.array(self.degrees_of_freedom, dtype=np.int64)

    def to_json(self) -> dict[str, Any]:
        """Plain numbers."""
        chosen = self.degrees_of_freedom
        return {
            "phase": self.phase,
            "values": self.values.tolist(),
            "degrees_of_freedom": None if chosen is None else list(chosen),
            "std": np.asarray(self.std).tolist(),
            "order": self.order,
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> ViaPoint:
        """Read what :meth:`to_json` wrote."""
        try:
            chosen = data["degrees_of_freedom"]
            return cls(
                phase=float(data["phase"]),
                values=np.asarray(data["values"], dtype=np.float64),
                degrees_of_freedom=None if chosen is None else tuple(chosen),
                std=np.asarray(data["std"], dtype=np.float64),
                order=int(data["order"]),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(
                f"via-point JSON: field missing or of the wrong kind ({error!r})"
            ) from error
