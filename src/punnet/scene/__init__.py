"""What a camera saw (:class:`Frame`) and what is in it (:class:`Strawberries`)."""

from punnet.scene.frame import Frame, read_image
from punnet.scene.strawberries import CLASSES, KEYPOINTS, PLUCKABLE, UNPLUCKABLE, Strawberries, Visibility
from punnet.scene.target import Target

__all__ = [
    "CLASSES",
    "KEYPOINTS",
    "PLUCKABLE",
    "UNPLUCKABLE",
    "Frame",
    "Strawberries",
    "Target",
    "Visibility",
    "read_image",
]
