"""A plant that only stands to be photographed: no robot, no physics, and surroundings of every kind.

The cluster is grown and written into the model by the code that the harvest's world uses; what is around it, and
the light, vary far more. Nothing moves, so the plant hangs as it was grown.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.geometry import CameraIntrinsics, invert_transform
from punnet.robot.tool import T_FLANGE_CAMERA
from punnet.sim.backdrops import FAR_VIEWS, NEAR_SURFACES, Painter
from punnet.sim.cluster import Cluster, grow_cluster
from punnet.sim.layers import SCENERY, TOUCHES_NOTHING
from punnet.sim.lighting import Light, add_lights, add_varied_lights, set_night, set_render_quality
from punnet.sim.mesh_assets import MeshAsset
from punnet.sim.orientation import mujoco_quaternion
from punnet.sim.plant import PlantedBerry, add_cluster, add_drawn_mesh, add_leaves, add_petiole, leaf_pose
from punnet.sim.protocols import VARIED, Protocol
from punnet.sim.scenery import SceneryLayout, add_gutter
from punnet.sim.solids import Point, add_card, add_painted_material
from punnet.sim.surroundings import add_surroundings

__all__ = ["PHOTO_CAMERA", "PHOTO_INTRINSICS", "SETTINGS", "StillScene", "build_still_scene"]

PHOTO_CAMERA = "photo"
PHOTO_INTRINSICS = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
"""The wrist camera's: a D435i's colour stream, to which depth is aligned."""

SETTINGS = {"tunnel": 0.30, "gutter": 0.15, "bed": 0.33, "open": 0.22}
"""Share of each kind of surroundings: rows in a tunnel; a gutter before a painted view; film, straw or soil close
behind the fruit; nothing but a painted view."""

_LAYOUT = SceneryLayout()
_LAMP = "lamp"  # the body that carries the lamp where the camera goes
_T_CAMERA_FLANGE = invert_transform(T_FLANGE_CAMERA)


@dataclass(frozen=True, eq=False)
class StillScene:
    """A plant in a compiled model, placed and lit; a :class:`punnet.sim.truth.GrownPlant`.

    Parameters
    ----------
    setting
        Which of :data:`SETTINGS` surrounds it.
    targets
        Indices of the berries that a camera may aim at.
    light
        The protocol's.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    cluster: Cluster
    planted: list[PlantedBerry]
    setting: str
    targets: tuple[int, ...]
    light: Light

    @property
    def berries(self) -> int:
        """Number of berries."""
        return len(self.planted)

    def berry_poses(self) -> NDArray[np.float64]:
        """``T_base_berry`` (N, 4, 4): origin at the calyx, z along the stem upwards."""
        return np.stack([berry.T_base_berry for berry in self.cluster.berries])

    def attached(self) -> NDArray[np.bool_]:
        """(N,) all true."""
        return np.ones(self.berries, dtype=np.bool_)

    def place_camera(self, T_base_camera: NDArray[np.float64]) -> None:
        """Move the camera :data:`PHOTO_CAMERA` to a pose (4, 4) of the optical frame."""
        number = self.model.camera(PHOTO_CAMERA).id
        self.model.cam_pos[number] = T_base_camera[:3, 3]
        # MuJoCo's cameras look along −z with y up, the optical frame along z with y down.
        self.model.cam_quat[number] = mujoco_quaternion(T_base_camera[:3, :3] * (1.0, -1.0, -1.0))
        if self.light == "lamp":
            T = T_base_camera @ _T_CAMERA_FLANGE
            self.model.body(_LAMP).pos = T[:3, 3]
            self.model.body(_LAMP).quat = mujoco_quaternion(T[:3, :3])
            mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)


def build_still_scene(rng: np.random.Generator, protocol: Protocol = VARIED) -> StillScene:
    """Grow a plant as ``protocol`` has it and put it somewhere: everything is drawn from ``rng``."""
    mujoco.set_mju_user_warning(lambda text: None)
    cluster = grow_cluster(rng, protocol.draw_config(rng))
    while not protocol.accepts(cluster):
        cluster = grow_cluster(rng, protocol.draw_config(rng))
    targets = protocol.draw_targets(rng, cluster)
    setting = str(rng.choice(list(SETTINGS), p=list(SETTINGS.values())))
    spec = mujoco.MjSpec()
    planted = add_cluster(spec, rng, cluster)
    variants = add_leaves(spec, rng, cluster)
    if rng.random() < 0.5:
        _add_leaf_veil(spec, rng, cluster, variants)
    _tint_plant(spec, rng)
    set_render_quality(spec)
    _add_setting(spec, rng, setting, cluster, variants)
    if rng.random() < (0.4 if setting == "tunnel" else 0.1):
        add_lights(spec, rng)
    else:
        add_varied_lights(spec, rng, np.mean([berry.centre for berry in cluster.berries], axis=0))
    if protocol.light == "lamp":
        set_night(spec, rng, spec.worldbody.add_body(name=_LAMP))
    fovy = float(np.degrees(2.0 * np.arctan(PHOTO_INTRINSICS.height / 2.0 / PHOTO_INTRINSICS.fy)))
    spec.worldbody.add_camera(name=PHOTO_CAMERA, fovy=fovy)
    spec.visual.global_.offwidth = PHOTO_INTRINSICS.width
    spec.visual.global_.offheight = PHOTO_INTRINSICS.height
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    return StillScene(model, data, cluster, planted, setting, targets, protocol.light)


def _tint_plant(spec: mujoco.MjSpec, rng: np.random.Generator) -> None:
    """Give this plant's leaves and stems a green of their own."""
    for material in spec.materials:
        if material.name.startswith("leaf"):
            tone = rng.uniform(0.62, 1.0)
            material.emission = rng.uniform(0.0, 0.45)  # light that shines through
            material.rgba = (*np.clip(tone * rng.normal((1.0, 1.0, 0.92), 0.05), 0.0, 1.0), 1.0)
        elif material.name == "stem":
            green, red = np.array((0.50, 0.60, 0.29)), np.array((0.62, 0.42, 0.32))
            mix = green + rng.beta(1.0, 4.0) * (red - green)
            material.rgba = (*np.clip(mix * rng.uniform(0.75, 1.25), 0.0, 1.0), 1.0)


def _add_setting(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    setting: str,
    cluster: Cluster,
    variants: list[list[tuple[MeshAsset, float]]],
) -> None:
    if setting in ("tunnel", "gutter"):
        add_gutter(spec, rng, _LAYOUT)
    if setting == "tunnel":
        add_surroundings(
            spec,
            rng,
            ground=_LAYOUT.ground,
            gutter=(_LAYOUT.front, _LAYOUT.bottom, _LAYOUT.lip),
            next_rows=_LAYOUT.next_rows,
        )
        return
    back = max(float(berry.centre[0]) + berry.radius for berry in cluster.berries)
    if setting == "bed":
        _add_bed(spec, rng, cluster)
    elif rng.random() < 0.6:
        _add_leaf_wall(spec, rng, back, variants)
    if setting != "bed":
        _add_things(spec, rng, back)
    _add_view(spec, rng, back + float(rng.uniform(0.25, 1.5)))


def _add_view(spec: mujoco.MjSpec, rng: np.random.Generator, x: float) -> None:
    """A painted view across the whole image, ``x`` metres away from the base."""
    away = x - 0.2
    half_width, half_height = 1.9 * away + 0.2, 1.5 * away + 0.2
    picture = _drawn(rng, FAR_VIEWS)(rng)
    height, width = picture.shape[:2]
    # mirrored to both sides it tiles; one copy fills about the image
    picture = np.concatenate((picture, picture[:, ::-1]), axis=1)
    picture = np.concatenate((picture, picture[::-1]), axis=0)
    tile = 2.0 * away * float(rng.uniform(0.45, 1.1))
    repeat = (1.0 / tile, width / height / tile)
    add_painted_material(spec, "view", picture, repeat=repeat, emission=float(rng.uniform(0.0, 0.5)))
    upright = ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
    add_card(spec, "view", (x, -0.09, 0.78), (half_width, half_height), *upright, "view")


def _drawn(rng: np.random.Generator, painters: dict[str, tuple[float, Painter]]) -> Painter:
    names = list(painters)
    name = names[rng.choice(len(names), p=[painters[name][0] for name in names])]
    return painters[name][1]


def _add_bed(spec: mujoco.MjSpec, rng: np.random.Generator, cluster: Cluster) -> None:
    """A surface that leans back, close behind the fruit, like the flank of a raised bed."""
    lean = float(rng.uniform(0.0, 0.75))
    normal = np.array((-np.cos(lean), 0.0, np.sin(lean)))
    up = np.array((np.sin(lean), 0.0, np.cos(lean)))
    reach = max(float(-normal @ berry.centre) + berry.radius for berry in cluster.berries)
    top = np.array((0.0, -0.09, rng.uniform(0.90, 1.0)))
    # slide the top edge along x onto the plane that clears every berry
    top[0] = (reach + rng.uniform(0.003, 0.04) + normal[2] * top[2]) / np.cos(lean)
    scale = float(rng.uniform(2.0, 4.5))
    gloss = float(rng.uniform(0.0, 0.5))
    add_painted_material(
        spec, "bed", _drawn(rng, NEAR_SURFACES)(rng), repeat=(scale, scale), specular=gloss, shininess=0.4
    )
    middle = top - 0.6 * up
    right = np.cross(up, normal)
    add_card(spec, "bed", _point(middle), (1.2, 0.6), _point(right), _point(up), "bed")


def _point(vector: NDArray[np.float64]) -> Point:
    return (float(vector[0]), float(vector[1]), float(vector[2]))


def _add_leaf_veil(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    cluster: Cluster,
    variants: list[list[tuple[MeshAsset, float]]],
) -> None:
    """Leaves that hang before some of the fruit and hide a part of it."""
    for number in range(int(rng.integers(1, 4))):
        hidden = cluster.berries[rng.integers(len(cluster.berries))]
        sizes = variants[rng.integers(len(variants))]
        asset, size = sizes[rng.integers(len(sizes))]
        droop = rng.uniform(0.7, 1.5)
        above = size * rng.uniform(0.6, 1.6)
        before = hidden.radius + rng.uniform(0.006, 0.05)
        place = hidden.centre + np.array((-before, rng.normal(0.0, 0.032), above))
        azimuth = np.pi * rng.choice((0.0, 1.0)) + rng.normal(0.0, 0.8)
        # a leaf that points back to the plant must not grow through the fruit
        place[0] -= max(0.0, np.cos(azimuth)) * np.cos(droop) * size
        pose = leaf_pose(azimuth, droop=droop, roll=rng.normal(0.0, 0.4))
        body = spec.worldbody.add_body(name=f"veil{number}", pos=place, quat=mujoco_quaternion(pose))
        add_drawn_mesh(body, f"veil{number}", asset)
        crown = np.array((0.82, place[1] + rng.normal(0.0, 0.05), rng.uniform(0.91, 0.96)))
        add_petiole(spec.worldbody, f"veil{number}", crown, place)


def _add_leaf_wall(
    spec: mujoco.MjSpec,
    rng: np.random.Generator,
    back: float,
    variants: list[list[tuple[MeshAsset, float]]],
) -> None:
    """Leaves behind the fruit."""
    for number in range(int(rng.integers(6, 30))):
        sizes = variants[rng.integers(len(variants))]
        asset, size = sizes[rng.integers(len(sizes))]
        place = (back + size + rng.uniform(0.0, 0.12), rng.uniform(-0.38, 0.20), rng.uniform(0.55, 0.98))
        pose = leaf_pose(np.pi + rng.normal(0.0, 0.9), droop=rng.uniform(0.6, 1.5), roll=rng.normal(0.0, 0.5))
        body = spec.worldbody.add_body(name=f"wall{number}", pos=place, quat=mujoco_quaternion(pose))
        add_drawn_mesh(body, f"wall{number}", asset)


def _add_things(spec: mujoco.MjSpec, rng: np.random.Generator, back: float) -> None:
    """Posts, boxes and balls behind the fruit, red ones among them: red alone makes no berry."""
    kinds = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE)
    for number in range(int(rng.integers(0, 5))):
        red = rng.random() < 0.4
        colour = rng.uniform((0.55, 0.0, 0.0), (0.95, 0.18, 0.15)) if red else rng.uniform(0.0, 1.0, 3)
        size = rng.uniform((0.004, 0.01, 0.005), (0.03, 0.12, 0.04))
        axis = rng.normal(size=3)
        rotation, _ = np.linalg.qr(np.column_stack((axis, rng.normal(size=(3, 2)))))
        if np.linalg.det(rotation) < 0:
            rotation[:, 0] *= -1.0
        spec.worldbody.add_geom(
            name=f"thing{number}",
            type=kinds[rng.integers(len(kinds))],
            size=size,
            pos=(back + rng.uniform(0.14, 0.5), rng.uniform(-0.4, 0.2), rng.uniform(0.5, 1.0)),
            quat=mujoco_quaternion(rotation),
            rgba=(*colour, 1.0),
            contype=TOUCHES_NOTHING[0],
            conaffinity=TOUCHES_NOTHING[1],
            group=SCENERY,
        )
