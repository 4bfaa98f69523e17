"""Triangle meshes as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError

__all__ = ["Mesh"]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh, metres, faces counter-clockwise seen from outside.

    Parameters
    ----------
    vertices
        (V, 3) float.
    faces
        (F, 3) int, indices into ``vertices``.
    uv
        (V, 2) float texture coordinates in [0, 1], or None. A seam needs its vertices twice.

    Raises
    ------
    ShapeError
        If shapes disagree or an index is out of range.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.vertices.ndim != 2 or self.vertices.shape[1] != 3 or not np.isfinite(self.vertices).all():
            raise ShapeError(f"mesh: vertices must be finite (V, 3), got {self.vertices.shape}")
        if self.faces.ndim != 2 or self.faces.shape[1] != 3:
            raise ShapeError(f"mesh: faces must be (F, 3), got {self.faces.shape}")
        if self.faces.size and (self.faces.min() < 0 or self.faces.max() >= len(self.vertices)):
            raise ShapeError("mesh: a face names a vertex that is not there")
        if self.uv is not None and self.uv.shape != (len(self.vertices), 2):
            raise ShapeError(f"mesh: uv must be ({len(self.vertices)}, 2), got {self.uv.shape}")

    @property
    def volume(self) -> float:
        """Enclosed volume in cubic metres (exact if the mesh is watertight, outward faces)."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    def transformed(self, T: NDArray[np.float64]) -> Mesh:
        """The mesh moved by a rigid (4, 4) transform."""
        return Mesh(self.vertices @ T[:3, :3].T + T[:3, 3], self.faces, self.uv)

    @classmethod
    def joined(cls, meshes: list[Mesh]) -> Mesh:
        """One mesh of several; texture coordinates are kept only if all have them."""
        offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
        return cls(
            np.concatenate([mesh.vertices for mesh in meshes]),
            np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=True)]),
            np.concatenate([m.uv for m in meshes if m.uv is not None])
            if all(m.uv is not None for m in meshes)
            else None,
        )
