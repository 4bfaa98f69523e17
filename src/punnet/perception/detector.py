"""The interface of every detector, classical or learned."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from punnet.scene import Frame, Strawberries

__all__ = ["Detector", "RegionDetector"]


@runtime_checkable
class Detector(Protocol):
    """Finds the berries of a frame."""

    name: str

    def detect(self, frame: Frame) -> Strawberries:
        """Boxes, scores, classes, masks, key-points with visibility and ripeness of the berries in ``frame``.

        An image without berries gives an empty container, never an error.
        """
        ...


@runtime_checkable
class RegionDetector(Detector, Protocol):
    """A detector that takes less time where it need not look at the whole frame."""

    def detect_in(self, frame: Frame, region: NDArray[np.float64]) -> Strawberries:
        """The berries in ``region`` (4,), xyxy pixels of ``frame``, as if the image ended there.

        They are in the pixels of the whole frame, as from :meth:`detect`.
        """
        ...
