"""What the camera sees of a simulated demonstration: a plant before the arm at home, and which of its berries to reach for.

``single``, the thesis' simulation (section 6.1): one ripe berry among unripe ones and leaves. ``multi``, its laboratory
(section 6.2.1): several ripe berries on one plant, each a target in turn, told apart by the white box around it.
The world is the one that the harvest works in, so that what is learnt here can be tried there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, ShapeError
from punnet.robot import HOME, Panda
from punnet.robot.tool import T_FLANGE_CAMERA
from punnet.scene import Frame, Strawberries
from punnet.sim.camera_effects import CameraEffects, apply_effects
from punnet.sim.cluster import Cluster, ClusterConfig, grow_cluster
from punnet.sim.demonstrations import WORKSPACE
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.layers import ARM_VISUAL
from punnet.sim.picker import CAMERA_NAME
from punnet.sim.rendering import CameraRenderer, CameraView
from punnet.sim.ripeness import RipenessStage
from punnet.sim.simulated_robot import WRIST_CAMERA
from punnet.sim.truss import TrussStyle
from punnet.sim.truth import silhouette, true_strawberries
from punnet.sim.world import World, WorldConfig, build_world

__all__ = ["SCENES", "TARGETS_A_PLANT", "DemonstrationScene", "SceneKind", "grow_scene", "photograph_scene"]

SceneKind = Literal["single", "multi"]
SCENES: tuple[SceneKind, ...] = ("single", "multi")

TARGETS_A_PLANT = {"single": 1, "multi": 5}
"""In the laboratory of the thesis each of 5 plants had 5 targets."""

LEAST_SHOWN = 0.4
"""Share of a target's outline that must be seen from home: the thesis' targets are clearly visible."""

LEAST_PIXELS = 300
_EDGE = 4.0  # pixels that a target's box keeps from the border of the image
_ATTEMPTS = 400
_LAYOUTS = 2000
_UNRIPE = {RipenessStage.GREEN: 0.45, RipenessStage.WHITE: 0.25, RipenessStage.TURNING: 0.30}


@dataclass(frozen=True, eq=False)
class DemonstrationScene:
    """A plant, seen from home.

    Parameters
    ----------
    world_seed
        ``build_world(world_seed, WorldConfig(config))`` builds it again.
    config
        Of its plant.
    view
        The true picture.
    T_base_camera
        (4, 4).
    berries
        All that can be seen, as they are.
    targets
        (N,) which of them to reach for, as indices into ``berries``.
    """

    world_seed: int
    config: ClusterConfig
    view: CameraView
    T_base_camera: NDArray[np.float64]
    berries: Strawberries
    targets: NDArray[np.int64]

    @property
    def boxes(self) -> NDArray[np.float64]:
        """(N, 4) xyxy boxes of the targets."""
        return self.berries.boxes[self.targets]

    @property
    def grip_points(self) -> NDArray[np.float64]:
        """(N, 3) where the targets' stems are gripped, metres in the base frame."""
        assert self.berries.picking_points is not None
        return self.berries.picking_points[self.targets]


def grow_scene(
    rng: np.random.Generator, kind: SceneKind, targets: int = 1, *, gl_context: Any = None
) -> DemonstrationScene:
    """Grow plants until one has as many ripe berries as asked for, in reach and well seen from home.

    Parameters
    ----------
    rng
        Source of all randomness.
    kind
        ``single`` has one ripe berry, ``multi`` at least ``targets``.
    targets
        How many; 1 for ``single``.
    gl_context
        An OpenGL context to draw with; made if not given.

    Raises
    ------
    ConfigurationError
        If the kind or the number is not possible, or none of many plants is right.
    """
    if kind not in SCENES or not 1 <= targets <= TARGETS_A_PLANT[kind]:
        raise ConfigurationError(
            f"demonstrations: a scene is one of {', '.join(SCENES)}, with up to {TARGETS_A_PLANT} targets, "
            f"got {kind!r} with {targets}"
        )
    for _ in range(_ATTEMPTS):
        seed, config = _lay_out(rng, kind, targets)
        scene = _seen(seed, config, gl_context)
        if scene is not None and len(scene.targets) >= targets:
            chosen = np.sort(rng.permutation(scene.targets)[:targets])
            return DemonstrationScene(
                scene.world_seed, config, scene.view, scene.T_base_camera, scene.berries, chosen
            )
    raise ConfigurationError(
        f"demonstrations: no {kind} plant with {targets} targets in {_ATTEMPTS} attempts"
    )


def _lay_out(rng: np.random.Generator, kind: SceneKind, targets: int) -> tuple[int, ClusterConfig]:
    """A world's seed whose plant, before it is built, has the right number of ripe berries in the right place."""
    for _ in range(_LAYOUTS):
        config = _single(rng) if kind == "single" else _multi(rng)
        seed = int(rng.integers(2**31))
        # build_world draws the plant first, so it grows this very cluster
        cluster = grow_cluster(np.random.default_rng(seed), config)
        ripe, in_reach = _ripe(cluster)
        if in_reach >= targets and (kind == "multi" or ripe == 1):
            return seed, config
    raise ConfigurationError(f"demonstrations: no {kind} plant has ripe berries in reach; report the seed")


def _single(rng: np.random.Generator) -> ClusterConfig:
    """Two or three trusses anywhere before the arm; about one berry in six is ripe."""
    middle = rng.uniform(-0.17, 0.12)
    leaves, shortest = int(rng.integers(1, 6)), rng.uniform(0.07, 0.17)
    return ClusterConfig(
        trusses=(2, 3),
        berries=(2, 3),
        stage_shares={**{stage: 0.83 * share for stage, share in _UNRIPE.items()}, RipenessStage.RIPE: 0.17},
        across=(middle - 0.09, middle + 0.09),
        hanging_leaves=(leaves, leaves),
        style=TrussStyle(peduncle_length=(shortest, shortest + 0.04)),
    )


def _multi(rng: np.random.Generator) -> ClusterConfig:
    """Four trusses across the arm's reach; three berries in five are ripe."""
    leaves = int(rng.integers(1, 5))
    return ClusterConfig(
        trusses=(4, 4),
        berries=(2, 4),
        stage_shares={**{stage: 0.4 * share for stage, share in _UNRIPE.items()}, RipenessStage.RIPE: 0.6},
        across=(-0.25, 0.16),
        hanging_leaves=(leaves, leaves),
    )


def _ripe(cluster: Cluster) -> tuple[int, int]:
    """Number of ripe berries, and of those that hang in the workspace."""
    calyxes = [berry.T_base_berry[:3, 3] for berry in cluster.berries if berry.berry.stage.pluckable]
    inside = [((place > WORKSPACE[0]) & (place < WORKSPACE[1])).all() for place in calyxes]
    return len(inside), int(sum(inside))


def _seen(seed: int, config: ClusterConfig, gl_context: Any) -> DemonstrationScene | None:
    """Build the world and look at it from home; the targets are all ripe berries that are well seen and in reach."""
    world = build_world(seed, WorldConfig(cluster=config, arm_visuals=False))
    size = (WRIST_CAMERA.width, WRIST_CAMERA.height)
    with CameraRenderer(
        world.model, *size, hidden_groups=(ARM_VISUAL,), shared_context=gl_context
    ) as renderer:
        T = np.asarray(Panda().forward_kinematics(_joints(world)) @ T_FLANGE_CAMERA)
        view = renderer.render_all(world.data, CAMERA_NAME)
    frame = Frame(view.rgb, view.depth, WRIST_CAMERA, T)
    berries = true_strawberries(world, frame, view.segmentation)
    targets = [index for index in range(len(berries)) if _is_target(world, berries, index, T)]
    if not targets:
        return None
    return DemonstrationScene(seed, config, view, T, berries, np.array(targets, dtype=np.int64))


def _joints(world: World) -> NDArray[np.float64]:
    joints = np.array(world.data.qpos[world.arm_qpos])
    if np.abs(joints - HOME).max() > 0.05:
        raise ShapeError("demonstrations: the arm does not stand at home; report the seed")
    return joints


def _is_target(world: World, berries: Strawberries, index: int, T: NDArray[np.float64]) -> bool:
    assert berries.masks is not None
    assert berries.picking_points is not None
    box, point = berries.boxes[index], berries.picking_points[index]
    if berries.classes[index] != 0 or not ((point > WORKSPACE[0]) & (point < WORKSPACE[1])).all():
        return False
    if (box[:2] < _EDGE).any() or box[2] > WRIST_CAMERA.width - _EDGE or box[3] > WRIST_CAMERA.height - _EDGE:
        return False
    shown = int(berries.masks[index].sum())
    outline = int((silhouette(world, int(berries.ids[index]), WRIST_CAMERA, T) | berries.masks[index]).sum())
    return shown >= LEAST_PIXELS and shown >= LEAST_SHOWN * outline


def photograph_scene(scene: DemonstrationScene, rng: np.random.Generator) -> Frame:
    """Photograph it once more: the same camera in nearly the same light, with noise of its own in colour and depth."""
    rgb = apply_effects(scene.view.rgb, _draw_light(rng), rng)
    depth = StereoDepthModel().apply(scene.view.depth, rgb, rng)
    return Frame(rgb, depth, WRIST_CAMERA, scene.T_base_camera)


def _draw_light(rng: np.random.Generator) -> CameraEffects:
    gain = np.exp(rng.normal(0.0, 0.05) + rng.normal(0.0, 0.015, 3))
    colour = (float(gain[0]), float(gain[1]), float(gain[2]))
    return CameraEffects(gain=colour, shot_noise=2.0, read_noise=1.0)
