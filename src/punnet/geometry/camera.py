"""Pinhole intrinsics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from punnet.errors import FileFormatError, ShapeError

__all__ = ["CameraIntrinsics"]


@dataclass(frozen=True, slots=True)
class CameraIntrinsics:
    """A pinhole camera without distortion (an aligned RealSense stream is rectified).

    Parameters
    ----------
    width, height
        Image size in pixels.
    fx, fy
        Focal lengths in pixels.
    cx, cy
        Principal point in pixels; the centre of the top-left pixel is (0, 0).

    Raises
    ------
    ShapeError
        If a size or focal length is not positive and finite.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ShapeError(f"camera: image size must be positive, got {self.width}×{self.height}")
        if not (math.isfinite(self.fx) and math.isfinite(self.fy) and self.fx > 0 and self.fy > 0):
            raise ShapeError(f"camera: focal lengths must be positive pixels, got fx={self.fx}, fy={self.fy}")
        if not (math.isfinite(self.cx) and math.isfinite(self.cy)):
            raise ShapeError(f"camera: principal point must be finite, got ({self.cx}, {self.cy})")

    def to_json(self) -> dict[str, Any]:
        """Plain numbers under the names of the fields."""
        return {name: getattr(self, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}

    @classmethod
    def from_json(cls, data: dict[str, Any], *, where: str = "camera JSON") -> CameraIntrinsics:
        """Read what :meth:`to_json` wrote; also ``ppx``/``ppy``, as RealSense tools name the principal point.

        Raises
        ------
        FileFormatError
            If a field is missing or not a number; ``where`` names the source in the message.
        """
        names = {"cx": ("cx", "ppx"), "cy": ("cy", "ppy")}
        values: dict[str, Any] = {}
        for name in ("width", "height", "fx", "fy", "cx", "cy"):
            found = next((key for key in names.get(name, (name,)) if key in data), None)
            if found is None or isinstance(data[found], bool) or not isinstance(data[found], int | float):
                raise FileFormatError(
                    f"{where}: '{name}' is missing or not a number; needed: width height fx fy cx cy"
                )
            values[name] = int(data[found]) if name in ("width", "height") else float(data[found])
        return cls(**values)
