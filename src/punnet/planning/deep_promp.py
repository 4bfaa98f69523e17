"""Planners that learned where to reach from photographs: deep-ProMP, and deep-ProMP with the berry's place in space.

``deep-promp`` needs one colour photograph from where the demonstrations start, and the target's box in it. ``fused`` takes its
distribution as what is natural for this berry and conditions it on the straight way in to the point that depth gave.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from punnet.bundle import Bundle
from punnet.data.demos import target_picture
from punnet.errors import BundleError, KinematicsError, PlanningError, PunnetError
from punnet.movement import TrajectoryDistribution, ViaPoint
from punnet.movement.distribution import Space
from punnet.planning.berry_light import UNKNOWN, berry_light
from punnet.planning.learned import BoxCamera, MovementModel, planner_bundle
from punnet.planning.posed_joints import joints_of_poses
from punnet.planning.promp_depth import ProMPDepthPlanner
from punnet.planning.reaches import SIDE
from punnet.planning.retargeting import for_arm
from punnet.robot import Arm, Panda
from punnet.scene import Frame, Target

__all__ = ["DeepProMPPlanner", "FusedPlanner"]

Array = NDArray[np.float64]
DEFAULT_BUNDLE = "reach-sim"
SAME_PLACE, SAME_DIRECTION = 0.02, np.deg2rad(3.0)
"""Metres and radians within which a camera stands where the photographs that were learnt from were taken."""
LIMIT_MARGIN = 0.01  # radians: demonstrations by hand may begin beyond a limit
BELOW_GRIP = 0.03
"""Metres from the grip point on a usual berry's stem down to its middle."""


@dataclass(eq=False)
class DeepProMPPlanner:
    """Plans reaches from a colour photograph.

    Parameters
    ----------
    model
        What tells movements.
    demonstrated
        Distribution over the joints of all that it learnt from.
    camera
        Where its photographs were taken from; None if that is not known, and then nobody asks.
    arm
        The arm with its tool.
    name
        Name of the planner.

    Raises
    ------
    BundleError
        If the movements are of an arm with other joints.
    """

    model: MovementModel
    demonstrated: TrajectoryDistribution
    camera: BoxCamera | None = None
    arm: Arm = field(default_factory=Panda)
    name: str = "deep-promp"

    def __post_init__(self) -> None:
        if self.demonstrated.dimensions != len(self.arm.home):
            raise BundleError(
                f"{self.name}: learnt from an arm with {self.demonstrated.dimensions} joints, this one has "
                f"{len(self.arm.home)}; train one on demonstrations of this arm"
            )

    @classmethod
    def from_bundle(
        cls, bundle: Bundle | str | Path = DEFAULT_BUNDLE, *, arm: Arm | None = None
    ) -> DeepProMPPlanner:
        """Planner of a bundle of kind ``planner`` or of a training run; by default the one that comes along.

        For an arm other than the Panda its demonstrations are :func:`~punnet.planning.retargeting.retargeted`.

        Raises
        ------
        BundleError
            If it is damaged, of another kind, or a model of joints asked for another arm.
        PlanningError
            If the arm can't follow the demonstrations.
        """
        model, settings, _ = planner_bundle(bundle)
        demonstrated, arm = for_arm(settings.demonstrated, arm)
        if model.space == "joint" and not isinstance(arm, Panda):
            raise BundleError(
                f"{model.name} tells joints of the arm that it learnt from; for another arm take a model in task space"
            )
        return cls(model, demonstrated, settings.camera, arm)

    @property
    def space(self) -> Space:
        """Of :meth:`distribution`: joint or task."""
        return self.model.space

    @property
    def home(self) -> Array:
        """(J,) joints that its demonstrations start from on average, radians, within the arm's limits."""
        limits = self.arm.limits
        start = self.demonstrated.mean([0.0])[0]
        return np.asarray(np.clip(start, limits.lower + LIMIT_MARGIN, limits.upper - LIMIT_MARGIN))

    def distribution(self, frame: Frame, target: Target) -> TrajectoryDistribution:
        """What the model tells of the target: in its own space, from the demonstrations' start.

        Parameters
        ----------
        frame
            Photograph from there, of any size; depth is not looked at.
        target
            The berry; of it only the box is used, or the picking point where the photograph was taken from elsewhere and
            the model looks at no more than the box.

        Raises
        ------
        PlanningError
            If the box is empty or outside the picture, or the picture was taken from elsewhere.
        """
        if self._from_elsewhere(frame):
            box, light = self._box_from_home(target), UNKNOWN
            picture: NDArray[np.uint8] = np.zeros((SIDE, SIDE, 3), dtype=np.uint8)
        else:
            box = _box_inside(frame, target)
            light = berry_light(frame.rgb, target.box) if self.model.needs_light else UNKNOWN
            picture = (
                target_picture(frame.rgb, target.box, SIDE)
                if self.model.needs_picture
                else np.zeros((SIDE, SIDE, 3), dtype=np.uint8)
            )
        try:
            return self.model.distribution(picture, box, light)
        except PunnetError as error:
            raise PlanningError(f"{self.name}: {error}") from error

    def plan(self, frame: Frame, target: Target, start: ArrayLike) -> TrajectoryDistribution:
        """Distribution of joint-space reaches from joints ``start`` (J,) to the target.

        Raises
        ------
        PlanningError
            As :meth:`distribution`, or if the arm can't follow what was predicted.
        """
        q_start = _joints(start, self.arm.joint_count)
        predicted = self.distribution(frame, target)
        try:
            if predicted.space == "joint":
                return predicted.condition([ViaPoint(0.0, q_start)])
            return joints_of_poses(predicted, self.demonstrated, self.arm, q_start)
        except KinematicsError as error:
            raise PlanningError(
                f"out of reach: the arm can't follow what {self.name} predicts for berry {target.berry_id} ({error})"
            ) from error

    def _from_elsewhere(self, frame: Frame) -> bool:
        if self.camera is None or frame.T_base_camera is None:
            return False
        away = np.linalg.inv(self.camera.pose) @ frame.T_base_camera
        turn = np.arccos(np.clip((np.trace(away[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))
        return bool(np.linalg.norm(away[:3, 3]) > SAME_PLACE or turn > SAME_DIRECTION)

    def _box_from_home(self, target: Target) -> Array:
        """Box (4,) of no size where a berry below the picking point would be seen from the demonstrations' start."""
        if self.model.needs_picture or target.picking_point is None:
            raise PlanningError(
                f"{self.name}: the photograph was not taken from where the demonstrations start; look from there"
            )
        assert self.camera is not None
        camera = self.camera.intrinsics
        local = np.linalg.inv(self.camera.pose) @ np.append(target.picking_point, 1.0)
        if local[2] <= 0:
            raise PlanningError(
                f"{self.name}: berry {target.berry_id} is behind where the demonstrations start"
            )
        u, v = camera.fx * local[0] / local[2] + camera.cx, camera.fy * local[1] / local[2] + camera.cy
        middle = v + camera.fy * BELOW_GRIP / local[2]
        box = np.array([u, middle, u, middle])
        return np.asarray(box / [camera.width, camera.height, camera.width, camera.height])


@dataclass(eq=False)
class FusedPlanner:
    """deep-ProMP conditioned on where depth says the berry hangs.

    Where the model can't tell (the photograph is from elsewhere and it needs it), reaches are those of all
    demonstrations.

    Parameters
    ----------
    deep
        What tells movements from a photograph.
    broadening
        As :class:`~punnet.planning.ProMPDepthPlanner`'s.
    name
        Name of the planner.
    """

    deep: DeepProMPPlanner
    broadening: float = 0.05
    name: str = "fused"

    @classmethod
    def from_bundle(
        cls, bundle: Bundle | str | Path = DEFAULT_BUNDLE, *, arm: Arm | None = None
    ) -> FusedPlanner:
        """As :meth:`DeepProMPPlanner.from_bundle`."""
        return cls(DeepProMPPlanner.from_bundle(bundle, arm=arm))

    @property
    def arm(self) -> Arm:
        """The arm with its tool."""
        return self.deep.arm

    def plan(self, frame: Frame, target: Target, start: ArrayLike) -> TrajectoryDistribution:
        """Distribution of joint-space reaches from joints ``start`` (J,), straight in to the picking point.

        Raises
        ------
        PlanningError
            As :meth:`punnet.planning.ProMPDepthPlanner.plan`.
        """
        try:
            natural = self.deep.plan(frame, target, start)
        except PlanningError:
            natural = self.deep.demonstrated
        depth = ProMPDepthPlanner(natural, self.arm, self.broadening, self.name)
        return depth.plan(frame, target, start)


def _joints(start: ArrayLike, count: int) -> Array:
    joints = np.asarray(start, dtype=np.float64)
    if joints.shape != (count,) or not np.isfinite(joints).all():
        raise PlanningError(f"start: {count} joint angles are needed, got {joints.shape} {start!r}")
    return joints


def _box_inside(frame: Frame, target: Target) -> Array:
    """Box (4,) divided by width and height.

    Raises
    ------
    PlanningError
        If it is empty, or no part of it is in the picture.
    """
    size = np.array([frame.width, frame.height, frame.width, frame.height], dtype=np.float64)
    inside = np.clip(target.box, 0.0, size)
    if not (inside[2] - inside[0] >= 1.0 and inside[3] - inside[1] >= 1.0):
        raise PlanningError(
            f"target box {np.round(target.box, 1).tolist()} holds no pixel of the {frame.width}×{frame.height} picture; "
            "give x0,y0,x1,y1 inside it"
        )
    return np.asarray(target.box / size)
