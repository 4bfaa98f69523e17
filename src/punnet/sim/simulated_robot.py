"""The simulated arm with its picker and camera, behind the :class:`~punnet.robot.Robot` protocol."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from punnet.errors import RobotError
from punnet.geometry import CameraIntrinsics
from punnet.movement import JointTrajectory
from punnet.robot import NOT_ALONE, NOTHING_HELD, TOO_THICK, CutResult, GripResult, MotionResult
from punnet.robot.tool import GRIP_OPENING, T_FLANGE_CAMERA
from punnet.scene import Frame
from punnet.sim.arm import SERVO_LAG
from punnet.sim.camera_effects import CameraEffects, apply_effects
from punnet.sim.cutting import CUT_ABOVE_CALYX, StemState, apply_cut, gripped_berries, stem_states
from punnet.sim.depth_sensor import StereoDepthModel
from punnet.sim.layers import ARM_VISUAL
from punnet.sim.picker import BLADE_RETRACTED, CAMERA_NAME, CLOSING_FORCE, SEPARATION_ANGLE
from punnet.sim.punnets import PUNNET_PLACES, inside_punnet
from punnet.sim.rendering import CameraRenderer
from punnet.sim.world import TIME_STEP, World

__all__ = ["WRIST_CAMERA", "SimulatedRobot"]

WRIST_CAMERA = CameraIntrinsics(640, 480, 615.0, 615.0, 319.5, 239.5)
"""Colour camera of a D435i at 640×480; depth is aligned to it."""

STRUCTURE_FORCE_LIMIT = 40.0
"""Newtons of contact with gutter, table or punnet at which a motion is stopped."""

_OVERSPEED = 1.1  # measured velocity over the limit
_TRACKING_LIMIT = 0.12  # rad between where the arm is and should be: it is held up
_FINGER_TIME = 0.45
_BLADE_TIME = 0.25
_HOLDING_GAP = 0.0008  # pads closer than this hold nothing
_THICKEST_STEMS = 0.0035  # pads that have closed gently so far may close with force
_THINNEST_FRUIT = 0.0075  # those that stand still farther apart hold a fruit; nearer, a leaf or a stem
_THICKEST_STEM = 0.0024  # and firmly: something besides one stem
_GENTLE = 0.0006  # metres that each pad's target leads it by while it closes: less than a newton
_GENTLE_TIME = 2.0
_STANDS_STILL = 0.4  # of the speed that it had: something is in its way
_FIRM_TIME = 0.2
_HOLDING_FORCE = 8.0  # newtons of each pad on the stem of what came off: no leaf may push them open
_WEIGH_NOISE = 0.1  # grams, one standard deviation of the weigh cell
_SETTLE_TIME = 0.4

Observer = Callable[[World], None]


class SimulatedRobot:
    """Drives a :class:`World` as a real arm would be driven; knows only what a real one could sense.

    Parameters
    ----------
    world
        The world to act in.
    rng
        Draws sensor noise; kept as ``noise``.
    depth_sensor
        The camera's error model; None gives the true depth.
    camera
        What the colour camera makes of the light; None gives the picture as it is rendered.
    """

    def __init__(
        self,
        world: World,
        rng: np.random.Generator,
        depth_sensor: StereoDepthModel | None = None,
        camera: CameraEffects | None = None,
    ) -> None:
        self.world = world
        self.noise = rng
        self._depth_sensor = depth_sensor
        self._camera = camera
        self._arm = world.arm
        self._renderer: CameraRenderer | None = None
        self.observers: list[Observer] = []

    def close(self) -> None:
        """Free the renderer."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    @property
    def time(self) -> float:
        """Simulated seconds since the world was built."""
        return float(self.world.data.time)

    def joints(self) -> NDArray[np.float64]:
        """Joint angles (J,), radians."""
        return np.asarray(self.world.data.qpos[self.world.arm_qpos])

    def camera_pose(self) -> NDArray[np.float64]:
        """``T_base_camera`` (4, 4) by forward kinematics."""
        return np.asarray(self._arm.forward_kinematics(self.joints()) @ T_FLANGE_CAMERA)

    def look(self) -> Frame:
        """An RGB-D frame from the wrist; the arm is still for a moment first, so that the picture is sharp."""
        self._run(_SETTLE_TIME)
        if self._renderer is None:
            self._renderer = CameraRenderer(
                self.world.model, WRIST_CAMERA.width, WRIST_CAMERA.height, hidden_groups=(ARM_VISUAL,)
            )
        rgb, depth = self._renderer.render_rgbd(self.world.data, CAMERA_NAME)
        if self._camera is not None:
            rgb = apply_effects(rgb, self._camera, self.noise)
        if self._depth_sensor is not None:
            depth = self._depth_sensor.apply(depth, rgb, self.noise)
        return Frame(
            rgb, depth, WRIST_CAMERA, self.camera_pose(), timestamp=self.time, name=f"frame-{self.time:08.3f}"
        )

    def segment(self) -> NDArray[np.int32]:
        """Ground truth: geometry id of each pixel of the wrist camera now, (480, 640), −1 for none."""
        if self._renderer is None:
            raise RobotError("segment: look first; the true segmentation is of the frame just taken")
        return self._renderer.render_segmentation(self.world.data, CAMERA_NAME)

    def follow(self, trajectory: JointTrajectory, force_limit: float | None = None) -> MotionResult:
        """Execute a joint trajectory; stops where the arm is held up, too fast, or presses too hard."""
        if np.abs(trajectory.start - self.joints()).max() > 0.05:
            raise RobotError(
                "follow: the trajectory starts more than 0.05 rad from where the arm is; plan from robot.joints()"
            )
        world = self.world
        world.contacts.reset_recent()
        times = np.arange(TIME_STEP, trajectory.duration + TIME_STEP, TIME_STEP)
        positions = trajectory.sample(np.minimum(times, trajectory.duration))
        velocities = trajectory.sample(np.minimum(times, trajectory.duration), derivative=1)
        for position, command in zip(positions, positions + SERVO_LAG * velocities, strict=True):
            world.data.ctrl[world.arm_ctrl] = command
            self._step()
            reason = self._stop_reason(position, force_limit)
            if reason is not None:
                world.data.ctrl[world.arm_ctrl] = self.joints()
                self._run(0.1)
                return self._motion_result(reason)
        self._run(0.05)
        return self._motion_result(None)

    def _stop_reason(self, commanded: NDArray[np.float64], force_limit: float | None) -> str | None:
        """Why the arm must stop at once, by what is measured, not by what is commanded; None if it need not."""
        contacts = self.world.contacts
        if contacts.recent_structure_peak > STRUCTURE_FORCE_LIMIT:
            return f"pressed on structure: with {contacts.recent_structure_peak:.0f} N"
        if force_limit is not None and contacts.recent_tool_peak > force_limit:
            return f"pushed a fruit: with {contacts.recent_tool_peak:.1f} N"
        if max(np.abs(self.joints() - commanded).tolist()) > _TRACKING_LIMIT:
            return "arm held up: it does not follow its trajectory"
        speeds = (np.abs(self.world.data.qvel[self.world.arm_dofs]) / self._arm.limits.velocity).tolist()
        fastest = max(speeds)
        if fastest > _OVERSPEED:
            return f"too fast: joint {speeds.index(fastest) + 1} at {fastest:.0%} of its limit"
        return None

    def _motion_result(self, reason: str | None) -> MotionResult:
        peaks = self.world.contacts.recent_tool_peaks
        touched = tuple(self.world.planted[i].body for i in np.flatnonzero(peaks > 0.0))
        return MotionResult(reason is None, reason, float(peaks.max(initial=0.0)), touched)

    def separate(self, opening: float) -> None:
        """Turn the separation fingers to ``opening`` in [0, 1]."""
        closed, fully_open = SEPARATION_ANGLE
        angle = closed + float(np.clip(opening, 0.0, 1.0)) * (fully_open - closed)
        self._move_fingers({"separate_left": angle, "separate_right": angle}, _FINGER_TIME)

    def grip(self) -> GripResult:
        """Close the grasping fingers, gently first: pads that stay apart have a fruit between them, and open again.

        So they do if, closed with force, they are farther apart than a stem is thick: what a leaf or a second stem keeps
        apart does not hold the berry. Holding is judged by the gap that is left.
        """
        opening = self._pad_gap() / 2.0 / GRIP_OPENING
        self._limit_force(CLOSING_FORCE)
        self._close_gently()
        gap = self._pad_gap()
        if gap > _THINNEST_FRUIT:
            self.release(opening)
            return GripResult(False, gap, TOO_THICK)
        self._move_fingers({"grasp_left": -0.004, "grasp_right": -0.004}, _FIRM_TIME)
        gap = self._pad_gap()
        if gap > _THICKEST_STEM:
            self.release(opening)
            return GripResult(False, gap, NOT_ALONE)
        return GripResult(gap > _HOLDING_GAP, gap, None if gap > _HOLDING_GAP else NOTHING_HELD)

    def _close_gently(self) -> None:
        """Pads towards each other until both are held up, or as near to each other as stems are thick."""
        model, data = self.world.model, self.world.data
        names = ("grasp_left", "grasp_right")
        ids = [model.actuator(name).id for name in names]
        at = [int(model.joint(name).qposadr[0]) for name in names]
        dofs = [int(model.joint(name).dofadr[0]) for name in names]
        fastest = 0.0
        for _ in range(round(_GENTLE_TIME / TIME_STEP)):
            data.ctrl[ids] = data.qpos[at] - _GENTLE
            self._step()
            speed = -float(data.qvel[dofs].min())
            fastest = max(fastest, speed)
            if self._pad_gap() < _THICKEST_STEMS or speed < _STANDS_STILL * fastest:
                break
        data.ctrl[ids] = data.qpos[at]

    def _limit_force(self, newtons: float) -> None:
        """Let each pad press with so much."""
        for name in ("grasp_left", "grasp_right"):
            self.world.model.actuator(name).forcerange[:] = (-newtons, newtons)

    def _pad_gap(self) -> float:
        qpos = self.world.data.qpos
        return float(
            sum(qpos[self.world.model.joint(f"grasp_{side}").qposadr[0]] for side in ("left", "right"))
        )

    def cut(self) -> CutResult:
        """Drive the blade forward and back; it parts what the rule of :mod:`punnet.sim.cutting` lets it part.

        What came off is held harder from then on, until it is released.
        """
        self._move_fingers({"blade": 0.006}, _BLADE_TIME)
        states = stem_states(self.world)
        came_off = apply_cut(self.world)
        if came_off:
            self._limit_force(_HOLDING_FORCE)
        self._move_fingers({"blade": BLADE_RETRACTED}, _BLADE_TIME)
        return CutResult(bool(came_off), None if came_off else _why_not_cut(states))

    def release(self, opening: float = 1.0) -> None:
        """Open the grasping fingers by ``opening`` in [0, 1]."""
        self._limit_force(CLOSING_FORCE)
        half = float(np.clip(opening, 0.0, 1.0)) * GRIP_OPENING
        self._move_fingers({"grasp_left": half, "grasp_right": half}, _FINGER_TIME)

    def weigh_punnet(self, punnet: int) -> float:
        """Weigh-cell reading after the content has come to rest, grams."""
        if not 0 <= punnet < len(PUNNET_PLACES):
            raise RobotError(f"weigh_punnet: there are punnets 0…{len(PUNNET_PLACES) - 1}, not {punnet}")
        self._run(_SETTLE_TIME)
        centres = self.world.berry_poses()[:, :3, 3]
        grams = sum(
            berry.berry.mass
            for berry, centre in zip(self.world.cluster.berries, centres, strict=True)
            if inside_punnet(centre) == punnet
        )
        return float(grams + self.noise.normal(0.0, _WEIGH_NOISE))

    def gripped(self) -> set[int]:
        """Ground truth: berries whose stem both pads hold."""
        return gripped_berries(self.world)

    def _move_fingers(self, targets: dict[str, float], duration: float) -> None:
        """Move actuators to targets in a straight ramp."""
        model, data = self.world.model, self.world.data
        ids = [model.actuator(name).id for name in targets]
        begin = data.ctrl[ids].copy()
        end = np.array(list(targets.values()))
        steps = round(duration / TIME_STEP)
        for step in range(1, steps + 1):
            data.ctrl[ids] = begin + (end - begin) * min(1.0, 1.25 * step / steps)
            self._step()

    def _run(self, duration: float) -> None:
        for _ in range(round(duration / TIME_STEP)):
            self._step()

    def _step(self) -> None:
        self.world.step()
        for observer in self.observers:
            observer(self.world)


def _why_not_cut(states: list[StemState]) -> str:
    """The reason for the stem nearest to the blade."""
    held = [state for state in states if state.gripped]
    if not held:
        return "no stem between the pads"
    nearest = min(held, key=lambda state: state.distance)
    low, high = (1000 * limit for limit in CUT_ABOVE_CALYX)
    if not CUT_ABOVE_CALYX[0] <= nearest.height <= CUT_ABOVE_CALYX[1]:
        return f"blade at a wrong height: {1000 * nearest.height:.0f} mm above the calyx, not {low:.0f}…{high:.0f} mm"
    return f"blade off the stem: by {1000 * nearest.distance:.0f} mm"
