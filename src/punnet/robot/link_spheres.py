"""Spheres that hold a link, from the surfaces that its model draws: slices along its longest direction, a sphere each."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import mujoco

__all__ = ["spheres_of_points", "surface_points"]

Array = NDArray[np.float64]

SLICE = 0.04
"""Metres of a link that one sphere holds."""
SPACING = 0.015
"""Metres between points on a large face, at most."""
FINEST = 24


def surface_points(model: mujoco.MjModel, geom: int) -> tuple[Array, float] | None:
    """Points (N, 3) in a geometry's own frame and the radius about them that it fills; None for planes and the like."""
    import mujoco

    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        start, faces = int(model.mesh_vertadr[mesh]), int(model.mesh_faceadr[mesh])
        vertices = model.mesh_vert[start : start + model.mesh_vertnum[mesh]].astype(np.float64)
        corners = vertices[model.mesh_face[faces : faces + model.mesh_facenum[mesh]]]
        return _on_triangles(corners), 0.0
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER):
        count = max(2, round(2 * float(size[1]) / SPACING) + 1)
        along = np.linspace(-size[1], size[1], count)
        return np.stack((np.zeros(count), np.zeros(count), along), axis=1), float(size[0])
    if kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        counts = [max(2, round(2 * float(half) / SPACING) + 1) for half in size]
        grid = np.meshgrid(*(np.linspace(-half, half, n) for half, n in zip(size, counts, strict=True)))
        return np.stack([axis.ravel() for axis in grid], axis=1), 0.0
    return None


def _on_triangles(corners: Array) -> Array:
    """Points on triangles (F, 3, 3), their corners among them, closer together than :data:`SPACING` unless they are huge."""
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(edges / SPACING), 1, FINEST).astype(int)
    points = []
    for count in np.unique(steps):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        weights = np.stack((i[inside], j[inside], count - i[inside] - j[inside]), axis=1) / count
        points.append(np.einsum("pc,fcd->fpd", weights, corners[steps == count]).reshape(-1, 3))
    return np.concatenate(points)


def spheres_of_points(clouds: list[tuple[Array, float]]) -> tuple[Array, Array]:
    """Centres (S, 3) and radii (S,) of spheres that hold all points (N, 3) and the radius about each; S = 0 without any."""
    if not clouds:
        return np.zeros((0, 3)), np.zeros(0)
    points = np.concatenate([cloud for cloud, _ in clouds])
    about = np.concatenate([np.full(len(cloud), radius) for cloud, radius in clouds])
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2] if len(points) > 2 else np.eye(3)
    local = (points - middle) @ axes.T
    low, high = float(local[:, 0].min()), float(local[:, 0].max())
    count = max(1, round((high - low) / SLICE))
    index = np.clip(((local[:, 0] - low) / max(high - low, 1e-9) * count).astype(int), 0, count - 1)
    centres, radii = [], []
    for which in np.unique(index):
        part, room = local[index == which], about[index == which]
        centre = (part.min(axis=0) + part.max(axis=0)) / 2
        centres.append(centre @ axes + middle)
        radii.append(float((np.linalg.norm(part - centre, axis=1) + room).max()))
    return np.stack(centres), np.maximum(np.array(radii), 1e-3)
