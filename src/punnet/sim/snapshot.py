"""The whole state of a simulated harvest at one instant, to go on from later as if nothing had happened."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError
from punnet.sim.simulated_robot import SimulatedRobot
from punnet.sim.world import STATE

__all__ = ["restore_snapshot", "take_snapshot"]

# What sleeps is no part of MuJoCo's state: setting that wakes everything.
_SLEEP = (
    *("tree_asleep", "tree_awake", "body_awake", "body_awake_ind", "parent_awake_ind", "dof_awake_ind"),
    *("ntree_awake", "nbody_awake", "nparent_awake", "nv_awake"),
)


def take_snapshot(robot: SimulatedRobot) -> bytes:
    """A NumPy archive of everything that decides how the world of ``robot`` goes on.

    That is MuJoCo's state with controls and warm start, what sleeps, the stems that were cut, the peaks of force so far,
    and the generator of the sensors' noise. What :func:`restore_snapshot` makes of it goes on bit for bit as the original does.
    """
    world = robot.world
    state = np.empty(mujoco.mj_stateSize(world.model, STATE))
    mujoco.mj_getState(world.model, world.data, state, STATE)
    stream = io.BytesIO()
    np.savez(
        stream,
        world=_fingerprint(world.model),
        state=state,
        asleep=np.concatenate([np.ravel(getattr(world.data, name)) for name in _SLEEP]),
        parted_stubs=world.parted_stubs(),
        peak_on_berry=world.contacts.peak_on_berry,
        tool_peak_on_berry=world.contacts.tool_peak_on_berry,
        noise=np.array(json.dumps(robot.noise.bit_generator.state)),
    )
    return stream.getvalue()


def restore_snapshot(robot: SimulatedRobot, snapshot: bytes) -> None:
    """Bring the freshly built world of ``robot`` to where :func:`take_snapshot` found it.

    Raises
    ------
    FileFormatError
        If the snapshot is damaged, or of another world: another seed, or another version of Punnet or MuJoCo.
    """
    world = robot.world
    try:
        with np.load(io.BytesIO(snapshot), allow_pickle=False) as archive:
            values = {name: archive[name] for name in archive.files}
        noise = json.loads(str(values["noise"]))
        state, asleep = values["state"], values["asleep"]
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise FileFormatError(f"snapshot: damaged ({error})") from error
    if not np.array_equal(values["world"], _fingerprint(world.model)):
        raise FileFormatError(
            "snapshot: is of another world; go on with the version of Punnet and MuJoCo that began the run"
        )
    world.part_stubs(values["parted_stubs"])
    _set(world.model, world.data, state, asleep)
    world.contacts.peak_on_berry[:] = values["peak_on_berry"]
    world.contacts.tool_peak_on_berry[:] = values["tool_peak_on_berry"]
    robot.noise.bit_generator.state = noise


def _set(
    model: mujoco.MjModel, data: mujoco.MjData, state: NDArray[np.float64], asleep: NDArray[np.int64]
) -> None:
    mujoco.mj_setState(model, data, state, STATE)
    mujoco.mj_forward(model, data)
    mujoco.mj_setState(model, data, state, STATE)  # computing the positions of all bodies has touched it
    sizes = [np.size(getattr(data, name)) for name in _SLEEP]
    for name, part in zip(_SLEEP, np.split(asleep, np.cumsum(sizes)[:-1]), strict=True):
        setattr(data, name, part if np.ndim(getattr(data, name)) else int(part[0]))


def _fingerprint(model: mujoco.MjModel) -> NDArray[np.uint8]:
    """A digest (32,) of what the world is made of."""
    digest = hashlib.sha256(mujoco.mj_versionString().encode())
    for values in (model.body_pos, model.body_mass, model.geom_pos, model.geom_size, model.qpos0):
        digest.update(np.ascontiguousarray(values).tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)
