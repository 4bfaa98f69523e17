"""The interface of every detector, classical or learned."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from punnet.scene import Frame, Strawberries

__all__ = ["Detector"]


@runtime_checkable
class Detector(Protocol):
    """Finds the berries of a frame."""

    name: str

    def detect(self, frame: Frame) -> Strawberries:
        """Boxes, scores, classes, masks, key-points with visibility and ripeness of the berries in ``frame``.

        An image without berries gives an empty container, never an error.
        """
        ...
