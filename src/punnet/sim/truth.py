"""Ground truth: the berries of a frame with exact masks, key-points, visibility, ripeness, weight and picking points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, invert_transform, project, transform_points
from punnet.perception.picking_points import PICKING_HEIGHT
from punnet.scene import KEYPOINTS, PLUCKABLE, UNPLUCKABLE, Frame, Strawberries, Visibility
from punnet.scene.windows import berry_box
from punnet.sim.cluster import Cluster
from punnet.sim.layers import PLANT_VISUAL, SCENERY
from punnet.sim.plant import PlantedBerry

__all__ = [
    "LEAST_PIXELS",
    "PICKING_HEIGHT",
    "GrownPlant",
    "KeypointTruth",
    "berry_of_geom",
    "keypoint_boxes",
    "shown_berries",
    "silhouette",
    "true_keypoints",
    "true_picking_points",
    "true_strawberries",
]

LEAST_PIXELS = 30
"""A berry of which less shows is not there."""

_GRASP_INSET = 0.92  # of the way from the axis to the outline
_CALYX_HEIGHT = 0.003  # metres above the attachment at which the sepals part: seeing that is seeing the top
_TOUCHING = 0.003  # metres: a ray that ends this near to a point has reached it (half a stem, half a facet)
_SUBPIXEL_BITS = 4
_PICKING_POINT, _TOP, _BOTTOM = (KEYPOINTS.index(name) for name in ("picking_point", "top", "bottom"))


class GrownPlant(Protocol):
    """A plant in a MuJoCo model, in whatever world it stands."""

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model."""

    @property
    def data(self) -> mujoco.MjData:
        """Its state."""

    @property
    def cluster(self) -> Cluster:
        """What was grown."""

    @property
    def planted(self) -> list[PlantedBerry]:
        """Names of each berry in the model, by index."""

    @property
    def berries(self) -> int:
        """Number of berries."""

    def berry_poses(self) -> NDArray[np.float64]:
        """``T_base_berry`` (N, 4, 4)."""

    def attached(self) -> NDArray[np.bool_]:
        """(N,) whether each berry still hangs."""


def berry_of_geom(plant: GrownPlant) -> NDArray[np.int64]:
    """(ngeom,) index of the berry whose skin a geometry is, −1 for all else."""
    owner = np.full(plant.model.ngeom, -1, dtype=np.int64)
    for berry in plant.planted:
        owner[plant.model.geom(f"{berry.body}_skin").id] = berry.index
    return owner


def shown_berries(plant: GrownPlant, segmentation: NDArray[np.int32]) -> NDArray[np.int64]:
    """(H, W) index of the berry that each pixel shows, −1 for all else; from geometry ids (H, W)."""
    return np.asarray(np.append(berry_of_geom(plant), -1)[segmentation])  # the background, −1, takes the last


def true_picking_points(plant: GrownPlant) -> NDArray[np.float64]:
    """(N, 3) the point on each berry's stem to grip, metres in the base frame, where it is now."""
    T = plant.berry_poses()
    return np.asarray(T[:, :3, 3] + PICKING_HEIGHT * T[:, :3, 2])


def true_strawberries(plant: GrownPlant, frame: Frame, segmentation: NDArray[np.int32]) -> Strawberries:
    """What a perfect detector would say of ``frame``: every berry of which at least 30 pixels show.

    Parameters
    ----------
    frame
        With camera and ``T_base_camera``.
    segmentation
        Geometry ids (H, W) of the same view.

    Notes
    -----
    ``ids`` are the berries' indices in the world. Detached berries are left out. Visibility as in
    :func:`true_keypoints`.
    """
    shown = shown_berries(plant, segmentation)
    counts = np.bincount(shown[shown >= 0].ravel(), minlength=plant.berries)
    chosen = np.flatnonzero((counts >= LEAST_PIXELS) & plant.attached())
    if not len(chosen) or frame.camera is None or frame.T_base_camera is None:
        return Strawberries.empty((frame.height, frame.width))
    masks = np.stack([shown == index for index in chosen])
    keypoints = true_keypoints(plant, frame.camera, frame.T_base_camera, chosen)
    berries = [plant.cluster.berries[index].berry for index in chosen]
    return Strawberries(
        image_size=(frame.height, frame.width),
        boxes=keypoint_boxes(masks, keypoints.pixels),
        classes=np.array([PLUCKABLE if b.stage.pluckable else UNPLUCKABLE for b in berries]),
        masks=masks,
        keypoints=keypoints.pixels,
        visibility=keypoints.visibility,
        ripeness=np.array([b.ripeness for b in berries]),
        picking_points=true_picking_points(plant)[chosen],
        weights=np.array([b.mass for b in berries]),
        weight_intervals=np.repeat(np.array([b.mass for b in berries])[:, None], 2, axis=1),
        ids=chosen,
    )


@dataclass(frozen=True, eq=False)
class KeypointTruth:
    """Key-points of N berries as a camera sees them.

    Parameters
    ----------
    pixels
        (N, 5, 2); NaN outside the image.
    depths
        (N, 5) metres along the optical axis; NaN outside the image.
    visibility
        (N, 5) :class:`Visibility`.
    """

    pixels: NDArray[np.float64]
    depths: NDArray[np.float64]
    visibility: NDArray[np.int64]


def true_keypoints(
    plant: GrownPlant,
    camera: CameraIntrinsics,
    T_base_camera: NDArray[np.float64],
    chosen: NDArray[np.int64],
) -> KeypointTruth:
    """Where the key-points of the berries ``chosen`` (N,) are, and what, if anything, hides each from the camera.

    A ray goes from the camera to each point. What it meets first on the way decides: nothing, or the thing that the
    point belongs to, and it is visible; the berry's own fruit or calyx, and it is hidden by itself; anything
    else, and it is hidden by that. The picking point belongs to the stem, the top to calyx and stem (it counts as
    seen where the sepals part, 3 mm above the attachment), the bottom to the skin there; the grasp points, which
    lie just inside the outline, to the whole fruit. Outside the image a point is absent.
    """
    T_camera_base = invert_transform(T_base_camera)
    poses = plant.berry_poses()
    shape = (len(chosen), len(KEYPOINTS))
    pixels, depths = np.full((*shape, 2), np.nan), np.full(shape, np.nan)
    visibility = np.full(shape, int(Visibility.ABSENT), dtype=np.int64)
    for row, index in enumerate(chosen):
        points = _keypoints(plant, int(index), poses[index], T_base_camera)
        in_camera = transform_points(T_camera_base, points)
        projected = project(camera, in_camera)
        u, v = np.rint(projected).T
        inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height) & (in_camera[:, 2] > 0)
        pixels[row, inside], depths[row, inside] = projected[inside], in_camera[inside, 2]
        points[_TOP] += _CALYX_HEIGHT * poses[index][:3, 2]
        for which in np.flatnonzero(inside):
            visibility[row, which] = _visibility(plant, int(index), int(which), T_base_camera, points[which])
    return KeypointTruth(pixels, depths, visibility)


def _keypoints(
    plant: GrownPlant, index: int, pose: NDArray[np.float64], T_base_camera: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The five key-points (5, 3) of a berry, base frame."""
    berry = plant.cluster.berries[index].berry
    on_axis = np.stack(((0.0, 0.0, PICKING_HEIGHT), (0.0, 0.0, 0.0), berry.keypoints["bottom"]))
    across = _grasp_points(pose, T_base_camera, berry.mesh.vertices)
    return np.concatenate((transform_points(pose, on_axis), across))


# A camera draws scenery and plants; the arm is not in the wrist camera's way, and collision shapes are not drawn.
_DRAWN = np.array([group in (SCENERY, PLANT_VISUAL) for group in range(6)], dtype=np.uint8)


def _visibility(
    plant: GrownPlant,
    index: int,
    which: int,
    T_base_camera: NDArray[np.float64],
    point: NDArray[np.float64],
) -> Visibility:
    model = plant.model
    eye = np.ascontiguousarray(T_base_camera[:3, 3])
    way = point - eye
    reach = float(np.linalg.norm(way))
    met = np.full(1, -1, dtype=np.int32)
    distance = mujoco.mj_ray(model, plant.data, eye, way / reach, _DRAWN, 1, -1, met)
    geom = int(met[0])
    if geom < 0 or distance >= reach - _TOUCHING:
        return Visibility.VISIBLE
    berry = plant.planted[index]
    if model.geom_bodyid[geom] != model.body(berry.body).id:
        return Visibility.HIDDEN_BY_OTHER
    if which in (_PICKING_POINT, _TOP):
        name = model.geom(geom).name
        part_of_it = name in berry.stub or (which == _TOP and name == f"{berry.body}_calyx")
    else:
        part_of_it = which != _BOTTOM
    return Visibility.VISIBLE if part_of_it else Visibility.HIDDEN_BY_ITSELF


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


def keypoint_boxes(masks: NDArray[np.bool_], keypoints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Xyxy boxes (N, 4) that hold the mask, which must not be empty, and the key-points in view."""
    boxes = np.zeros((len(masks), 4))
    for row, (mask, points) in enumerate(zip(masks, keypoints, strict=True)):
        box = berry_box(mask, points)
        assert box is not None
        boxes[row] = box
    return boxes


def silhouette(
    plant: GrownPlant, index: int, camera: CameraIntrinsics, T_base_camera: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Pixels (H, W) that the fruit of berry ``index`` would cover with nothing in its way.

    The convex outline of its projected vertices: a berry is nearly convex, and this is a hundred times
    cheaper than drawing it alone.
    """
    surface = transform_points(
        invert_transform(T_base_camera) @ plant.berry_poses()[index],
        plant.cluster.berries[index].berry.mesh.vertices,
    )
    cover = np.zeros((camera.height, camera.width), dtype=np.uint8)
    if surface[:, 2].min() > 0.01:
        outline = cv2.convexHull(project(camera, surface).astype(np.float32))[:, 0]
        middle, radius = outline.mean(axis=0), np.sqrt(cv2.contourArea(outline) / np.pi)
        # OpenCV also fills the pixels that the outline only touches: half a pixel too much all around
        outline = middle + (outline - middle) * max(0.0, 1.0 - 0.5 / max(radius, 0.5))
        fine = np.rint(outline * 2**_SUBPIXEL_BITS).astype(np.int32)
        cv2.fillConvexPoly(cover, fine, 1, cv2.LINE_8, _SUBPIXEL_BITS)
    return cover.astype(np.bool_)
