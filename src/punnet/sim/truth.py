"""Ground truth: the berries of a frame with exact masks, key-points, visibility, ripeness, weight and picking points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, invert_transform, project, transform_points
from punnet.scene import KEYPOINTS, PLUCKABLE, UNPLUCKABLE, Frame, Strawberries, Visibility
from punnet.sim.world import World

__all__ = ["PICKING_HEIGHT", "berry_of_geom", "true_picking_points", "true_strawberries"]

PICKING_HEIGHT = 0.014
"""Metres above the calyx at which the stem is gripped; the blade runs 6 mm higher."""

_LEAST_PIXELS = 30
_GRASP_INSET = 0.92  # of the way from the axis to the outline


def berry_of_geom(world: World) -> NDArray[np.int64]:
    """(ngeom,) index of the berry whose skin a geometry is, −1 for all else."""
    owner = np.full(world.model.ngeom, -1, dtype=np.int64)
    for berry in world.planted:
        owner[world.model.geom(f"{berry.body}_skin").id] = berry.index
    return owner


def true_picking_points(world: World) -> NDArray[np.float64]:
    """(N, 3) the point on each berry's stem to grip, metres in the base frame, where it is now."""
    T = world.berry_poses()
    return np.asarray(T[:, :3, 3] + PICKING_HEIGHT * T[:, :3, 2])


def true_strawberries(world: World, frame: Frame, segmentation: NDArray[np.int32]) -> Strawberries:
    """What a perfect detector would say of ``frame``: every berry of which at least 30 pixels show.

    Parameters
    ----------
    frame
        With camera and ``T_base_camera``.
    segmentation
        Geometry ids (H, W) of the same view.

    Notes
    -----
    ``ids`` are the berries' indices in the world. Detached berries are left out. A key-point is visible if its pixel
    shows the berry itself (the picking point: its own stem or nothing in front of it), hidden by itself if the
    berry's own fruit covers it, hidden by something else otherwise.
    """
    owner = berry_of_geom(world)
    shown = np.where(segmentation >= 0, owner[np.maximum(segmentation, 0)], -1)
    counts = np.bincount(shown[shown >= 0].ravel(), minlength=world.berries)
    chosen = np.flatnonzero((counts >= _LEAST_PIXELS) & world.attached())
    if not len(chosen) or frame.camera is None or frame.T_base_camera is None:
        return Strawberries.empty((frame.height, frame.width))
    masks = np.stack([shown == index for index in chosen])
    keypoints, visibility = _keypoints(world, frame.camera, frame.T_base_camera, chosen, segmentation)
    berries = [world.cluster.berries[index].berry for index in chosen]
    return Strawberries(
        image_size=(frame.height, frame.width),
        boxes=_boxes(masks, keypoints),
        classes=np.array([PLUCKABLE if b.stage.pluckable else UNPLUCKABLE for b in berries]),
        masks=masks,
        keypoints=keypoints,
        visibility=visibility,
        ripeness=np.array([b.stage.ripeness for b in berries]),
        picking_points=true_picking_points(world)[chosen],
        weights=np.array([b.mass for b in berries]),
        weight_intervals=np.repeat(np.array([b.mass for b in berries])[:, None], 2, axis=1),
        ids=chosen,
    )


def _keypoints(
    world: World,
    camera: CameraIntrinsics,
    T_base_camera: NDArray[np.float64],
    chosen: NDArray[np.int64],
    segmentation: NDArray[np.int32],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Pixels (N, 5, 2) and visibility (N, 5) of the key-points."""
    T_camera_base = invert_transform(T_base_camera)
    poses = world.berry_poses()
    picking = true_picking_points(world)
    pixels = np.full((len(chosen), len(KEYPOINTS), 2), np.nan)
    visibility = np.zeros((len(chosen), len(KEYPOINTS)), dtype=np.int64)
    body_of_geom = np.append(world.model.geom_bodyid, -1)
    for row, index in enumerate(chosen):
        berry = world.cluster.berries[index].berry
        across = _grasp_points(poses[index], T_base_camera, berry.mesh.vertices)
        points = np.concatenate(
            (
                picking[index][None],
                transform_points(
                    poses[index], np.stack((np.zeros(3), np.asarray(berry.keypoints["bottom"])))
                ),
                across,
            )
        )
        pixels[row] = project(camera, transform_points(T_camera_base, points))
        own = world.model.body(world.planted[index].body).id
        for which, (u, v) in enumerate(np.rint(pixels[row]).astype(int)):
            if not (0 <= u < camera.width and 0 <= v < camera.height):
                pixels[row, which] = np.nan
                continue
            seen = int(body_of_geom[segmentation[v, u]])
            visibility[row, which] = _visibility(seen == own, which, seen)
    return pixels, visibility


def _visibility(shows_itself: bool, which: int, seen: int) -> Visibility:
    if shows_itself:
        return Visibility.VISIBLE
    background = seen <= 0  # the world body: gutter and backdrop lie behind the cluster
    if background:
        return Visibility.VISIBLE if KEYPOINTS[which] == "picking_point" else Visibility.HIDDEN_BY_ITSELF
    return Visibility.HIDDEN_BY_OTHER


def _grasp_points(
    T_base_berry: NDArray[np.float64], T_base_camera: NDArray[np.float64], vertices: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Left and right grasp points (2, 3): the sides of the fruit as the camera sees them, just inside its outline."""
    surface = transform_points(T_base_berry, vertices)
    middle, axis = surface.mean(axis=0), T_base_berry[:3, 2]
    right = np.cross(middle - T_base_camera[:3, 3], axis)
    right = right / np.linalg.norm(right)
    sideways = (surface - middle) @ right
    outline = surface[[int(np.argmin(sideways)), int(np.argmax(sideways))]]
    on_axis = middle + ((outline - middle) @ axis)[:, None] * axis
    return np.asarray(on_axis + _GRASP_INSET * (outline - on_axis))


def _boxes(masks: NDArray[np.bool_], keypoints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Xyxy boxes (N, 4) that hold the mask and the key-points in view."""
    boxes = np.zeros((len(masks), 4))
    for row, (mask, points) in enumerate(zip(masks, keypoints, strict=True)):
        v, u = np.nonzero(mask)
        inside = points[np.isfinite(points).all(axis=1)]
        low = np.minimum((u.min(), v.min()), inside.min(axis=0, initial=np.inf))
        high = np.maximum((u.max() + 1, v.max() + 1), inside.max(axis=0, initial=-np.inf))
        boxes[row] = (*low, *high)
    return boxes
