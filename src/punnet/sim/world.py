"""The simulated world: arm with picker, one plant, punnets, scenery. Built from a seed, the same every time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ConfigurationError, RobotError
from punnet.robot import Arm, load_arm
from punnet.robot.tool import GRIP_OPENING
from punnet.sim.cluster import Cluster, ClusterConfig, grow_cluster
from punnet.sim.contacts import ContactMonitor
from punnet.sim.layers import SCENERY, STRUCTURE
from punnet.sim.lighting import Light, set_night
from punnet.sim.orientation import mujoco_quaternion
from punnet.sim.picker import CAMERA_NAME, add_picker
from punnet.sim.placed_arm import PlacedArm, place_arm
from punnet.sim.plant import PlantedBerry, add_cluster, add_leaves
from punnet.sim.punnets import add_punnets
from punnet.sim.scenery import add_scenery

__all__ = ["OVERVIEW_CAMERA", "STATE", "World", "WorldConfig", "build_world"]

OVERVIEW_CAMERA = "overview"
TIME_STEP = 0.002
_SETTLING_TIME = 1.0
STATE = mujoco.mjtState.mjSTATE_INTEGRATION.value
"""What decides how MuJoCo goes on, but for what sleeps."""
_RUNAWAY = 100.0  # metres or radians a second of any joint: nothing here moves so fast
_CG_ITERATIONS = 300


@dataclass(frozen=True)
class WorldConfig:
    """What to build.

    Parameters
    ----------
    cluster
        The kind of plant.
    arm
        What the picker is mounted on, as :func:`punnet.robot.load_arm` takes it: a name, or a file.
    arm_visuals
        Whether the arm is drawn; only third-person views need it.
    light
        ``day``: the sun through the tunnel's sheet; ``lamp``: night, and a lamp beside the wrist camera.

    Raises
    ------
    ConfigurationError
        If there is no such light.
    """

    cluster: ClusterConfig = field(default_factory=ClusterConfig)
    arm: str = "panda"
    arm_visuals: bool = True
    light: Light = "day"

    def __post_init__(self) -> None:
        if self.light not in get_args(Light):
            raise ConfigurationError(f"world: light must be one of {get_args(Light)}, got {self.light!r}")


class World:
    """A compiled world and its state; the simulator's ground truth is read from here.

    Attributes
    ----------
    arm
        What the picker is mounted on.
    model, data
        MuJoCo's.
    cluster
        What was grown, as laid out (before gravity).
    planted
        Names of each berry in the model.
    contacts
        Peak forces.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        arm: Arm,
        placed: PlacedArm,
        cluster: Cluster,
        planted: list[PlantedBerry],
    ) -> None:
        self.arm = arm
        self.model = model
        self.data = mujoco.MjData(model)
        self.cluster = cluster
        self.planted = planted
        self.arm_qpos = np.array([model.joint(name).qposadr[0] for name in placed.joints])
        self.arm_dofs = np.array([model.joint(name).dofadr[0] for name in placed.joints])
        self.arm_ctrl = np.array([model.actuator(name).id for name in placed.joints])
        self._fruit_bodies = np.array([model.body(berry.body).id for berry in planted], dtype=np.int64)
        self._welds = np.array([model.equality(berry.weld).id for berry in planted], dtype=np.int64)
        self._stubs = np.array(
            [model.geom(name).id for berry in planted for name in berry.stub], dtype=np.int64
        )
        self._stem_material = int(model.geom_matid[self._stubs[0]]) if len(planted) else -1
        berry_of_geom = np.full(model.ngeom, -1, dtype=np.int64)
        for berry in planted:
            berry_of_geom[model.geom(berry.fruit).id] = berry.index
        self.contacts = ContactMonitor(model, placed.first_link, berry_of_geom, len(planted))
        self._before = np.empty(mujoco.mj_stateSize(model, STATE))
        self._diverged = self.data.warning[mujoco.mjtWarning.mjWARN_BADQACC]
        self._reset()

    def _reset(self) -> None:
        self.data.qpos[self.arm_qpos] = self.arm.home
        for side in ("left", "right"):
            joint = self.model.joint(f"grasp_{side}")
            self.data.qpos[joint.qposadr[0]] = GRIP_OPENING
            self.data.ctrl[self.model.actuator(f"grasp_{side}").id] = GRIP_OPENING
        blade = self.model.joint("blade")
        self.data.qpos[blade.qposadr[0]] = blade.range[0]
        self.data.ctrl[self.model.actuator("blade").id] = blade.range[0]
        self.data.ctrl[self.arm_ctrl] = self.arm.home
        mujoco.mj_step(self.model, self.data, nstep=round(_SETTLING_TIME / TIME_STEP))
        self.data.time = 0.0

    @property
    def berries(self) -> int:
        """Number of berries that were grown."""
        return len(self.planted)

    def step(self) -> None:
        """One physics step; contact forces are taken in.

        Raises
        ------
        RobotError
            If the integration diverged; what has been simulated until then stands.
        """
        mujoco.mj_getState(self.model, self.data, self._before, STATE)
        mujoco.mj_step(self.model, self.data)
        if self._is_unsolved():
            self._step_again()
        if self._diverged.number:
            raise RobotError(f"the simulation diverged after {self.data.time:.2f} s; report the seed")
        self.contacts.update(self.data)

    def _is_unsolved(self) -> bool:
        """Whether Newton's method was broken off before it had the contact forces, or something runs away."""
        iterations = max(self.data.solver_niter[: max(1, self.data.nisland)].tolist())
        if iterations >= self.model.opt.iterations:
            return True
        qvel = self.data.qvel
        # No speed is more than all of them together, which is quicker to have.
        return not (qvel @ qvel < _RUNAWAY**2 or np.abs(qvel).max() < _RUNAWAY)

    def _step_again(self) -> None:
        """The step once more by conjugate gradients: a small fruit in a hard pinch can throw Newton's method off.

        So can a stem between the pads as it is cut: of 17 contacts of known state, Newton's method found forces that
        flung the berry away with 200 N, in 60 iterations as in 300; conjugate gradients ended after 48, and it hung still.
        """
        self._diverged.number = 0
        mujoco.mj_setState(self.model, self.data, self._before, STATE)
        option = self.model.opt
        usual = option.solver, option.iterations
        option.solver, option.iterations = mujoco.mjtSolver.mjSOL_CG, _CG_ITERATIONS
        mujoco.mj_step(self.model, self.data)
        option.solver, option.iterations = usual

    def berry_poses(self) -> NDArray[np.float64]:
        """``T_base_berry`` (N, 4, 4) now: origin at the calyx, z along the stem upwards."""
        T = np.tile(np.eye(4), (self.berries, 1, 1))
        T[:, :3, :3] = self.data.xmat[self._fruit_bodies].reshape(-1, 3, 3)
        T[:, :3, 3] = self.data.xpos[self._fruit_bodies]
        return T

    def attached(self) -> NDArray[np.bool_]:
        """(N,) whether each berry still hangs on the plant."""
        return np.asarray(self.data.eq_active[self._welds], dtype=np.bool_)

    def hide_stubs(self, geoms: NDArray[np.int64]) -> None:
        """Draw all pieces of stem above the berries but ``geoms``, ids of those that a cut has parted from them."""
        self.model.geom_rgba[self._stubs, 3] = 1.0
        self.model.geom_matid[self._stubs] = self._stem_material
        self.model.geom_rgba[geoms, 3] = 0.0
        self.model.geom_matid[geoms] = -1

    def part_stubs(self, geoms: NDArray[np.int64]) -> None:
        """Take pieces of stem, by id, off their berries: in truth they stay with the plant; nothing sees or touches them."""
        self.model.geom_contype[geoms] = 0
        self.model.geom_conaffinity[geoms] = 0
        self.model.geom_rgba[geoms, 3] = 0.0
        self.model.geom_matid[geoms] = -1

    def parted_stubs(self) -> NDArray[np.int64]:
        """Ids of the pieces of stem that :meth:`part_stubs` took off."""
        return np.asarray(self._stubs[self.model.geom_conaffinity[self._stubs] == 0])

    def detach(self, berry: int) -> None:
        """Part a berry from its truss; see ``cutting.py`` for the rule."""
        self.data.eq_active[self._welds[berry]] = 0


def build_world(seed: int, config: WorldConfig | None = None) -> World:
    """Build the world of ``seed``: the same seed and config give the same world, berry for berry."""
    # MuJoCo would write a log file wherever the user stands; divergence is noticed in World.step instead.
    mujoco.set_mju_user_warning(lambda text: None)
    config = config or WorldConfig()
    rng = np.random.default_rng(seed)
    cluster = grow_cluster(rng, config.cluster)
    arm = load_arm(config.arm)
    placed = place_arm(arm, with_visuals=config.arm_visuals)
    spec = placed.spec
    _set_physics(spec)
    add_picker(placed)
    add_scenery(spec, rng)
    _add_table(spec)
    add_punnets(spec)
    planted = add_cluster(spec, rng, cluster)
    add_leaves(spec, rng, cluster)
    if config.light == "lamp":
        set_night(spec, rng, spec.body("picker"))
    _set_camera(spec)
    return World(spec.compile(), arm, placed, cluster, planted)


def _set_physics(spec: mujoco.MjSpec) -> None:
    option = spec.option
    option.timestep = TIME_STEP
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 10.0
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # What hangs still is not integrated until something touches it.
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    option.iterations = 60
    option.ls_iterations = 40


def _add_table(spec: mujoco.MjSpec) -> None:
    spec.worldbody.add_geom(
        name="table",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=(0.32, 0.55, 0.02),
        pos=(0.15, 0.05, -0.02),
        rgba=(0.55, 0.57, 0.60, 1.0),
        contype=STRUCTURE[0],
        conaffinity=STRUCTURE[1],
        group=SCENERY,
    )


def _set_camera(spec: mujoco.MjSpec) -> None:
    """The wrist camera's intrinsics, and a fixed camera for third-person views."""
    camera = spec.camera(CAMERA_NAME)
    camera.fovy = float(np.degrees(2.0 * np.arctan(480 / 2.0 / 615.0)))
    spec.visual.global_.offwidth = 1280
    spec.visual.global_.offheight = 960
    overview = spec.worldbody.add_camera(name=OVERVIEW_CAMERA, pos=(-0.06, 1.00, 1.10), fovy=45.0)
    overview.quat = _looking_from((-0.06, 1.00, 1.10), (0.56, 0.13, 0.49))


def _looking_from(
    position: tuple[float, float, float], at: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Quaternion of a MuJoCo camera (looks along −z, y up) at ``position`` that looks at a point, upright."""
    back = np.subtract(position, at)
    back /= np.linalg.norm(back)
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    return mujoco_quaternion(np.stack((right, np.cross(back, right), back), axis=1))
