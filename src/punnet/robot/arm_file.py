"""An arm as data: a JSON file that names a model file, how the arm is mounted, and how fast it may move.

.. code-block:: json

    {
      "name": "ur5",
      "model": {"package": "example-robot-data", "file": ".../ur5_robot.urdf"},
      "flange": "tool0",
      "mount": {"xyz": [0.0, 0.0, 0.3], "rpy_deg": [0, 0, 0]},
      "picker": {"xyz": [0, 0, 0], "rpy_deg": [0, 0, 90]},
      "velocity": 3.15, "acceleration": 8.0, "jerk": 80.0
    }

``model`` is a URDF or MJCF file: a path, from the JSON file's folder, or a file of an installed package. ``flange`` is the
body that carries the picker, ``picker`` where the picker's own frame (x up at home, z ahead) sits on it, ``mount`` where the
model's world is in the base frame. Limits are one number for all joints or a list; positions are the model's, unless ``lower``
and ``upper`` are given. ``home`` is found if it is not given: a posture that looks at the plant from where the lab's arm does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, distribution
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from punnet.data.reading import read_json
from punnet.errors import ConfigurationError, FileFormatError, ShapeError
from punnet.geometry import make_transform
from punnet.movement import JointLimits
from punnet.robot.arm import Arm
from punnet.robot.arm_model import ArmModel, read_arm_model
from punnet.robot.arm_shape import PICKER_PIECES, ArmShape, arm_spheres, self_clearance, spheres_along
from punnet.robot.multistart import postures
from punnet.robot.panda import HOME, Panda
from punnet.robot.serial_arm import ModelSource, SerialArm
from punnet.robot.tool import T_FLANGE_TOOL

__all__ = ["ARMS", "load_arm"]

Array = NDArray[np.float64]

_FOLDER = Path(__file__).parent / "arms"
ARMS = ("panda", *sorted(path.stem for path in _FOLDER.glob("*.json")))
"""Arms that come along; the models of all but the Panda are in packages of their own, which the error names."""

KNOWN = {
    "name",
    "model",
    "flange",
    "mount",
    "picker",
    "velocity",
    "acceleration",
    "jerk",
    "lower",
    "upper",
    "home",
    "source",
}
COMFORT = 0.3
"""Radians that home keeps from the limits if it can."""
APART = 0.03
"""Metres that parts of the arm are apart at home if they can be."""
POSTURES = 400
ALWAYS = 0.95
"""Share of random postures in which two parts touch, from which on they are never held against each other."""


def load_arm(arm: str | Path) -> Arm:
    """One of :data:`ARMS` by name, or the arm of a JSON file.

    Raises
    ------
    ConfigurationError
        If there is no such name, or the package with its model is not installed.
    FileFormatError
        If the file or the model can't be read or says something that can't be; the message names the field.
    """
    if str(arm) == "panda":
        return Panda()
    path = _FOLDER / f"{arm}.json" if str(arm) in ARMS else Path(arm)
    if not path.is_file():
        raise ConfigurationError(
            f"arm: no file '{arm}', and no arm of that name; there are {', '.join(ARMS)}"
        )
    data = read_json(path)
    if not isinstance(data, dict):
        raise FileFormatError(f"{path}: an object is needed, got {type(data).__name__}")
    unknown = sorted(set(data) - KNOWN)
    if unknown:
        raise FileFormatError(f"{path}: unknown field {unknown[0]!r}; known are {', '.join(sorted(KNOWN))}")
    return _ArmFile(path, data).arm()


@dataclass(frozen=True)
class _ArmFile:
    path: Path
    data: dict[str, Any]

    def arm(self) -> SerialArm:
        name = str(self.data.get("name", self.path.stem))
        source = ModelSource(self._model_file(), str(self._needed("flange")), self._pose("picker"))
        model = read_arm_model(source.path, source.flange)
        frames = model.T_link_next.copy()
        frames[-1] = frames[-1] @ source.T_body_flange
        try:
            velocity, acceleration, jerk = (
                self._numbers(field, None, len(model.names)) for field in ("velocity", "acceleration", "jerk")
            )
            limits = JointLimits(
                self._numbers("lower", model.lower),
                self._numbers("upper", model.upper),
                velocity,
                acceleration,
                jerk,
                model.names,
            )
            middle = np.clip((limits.lower + limits.upper) / 2, limits.lower, limits.upper)
            room = _room(model, _neighbours(len(model.names)))
            arm = SerialArm(
                T_FLANGE_TOOL.copy(),
                limits,
                self._pose("mount"),
                frames,
                model.axes,
                middle,
                room,
                name,
                source,
            )
            home = self._numbers("home", None) if "home" in self.data else self._found_home(arm)
            arm = replace(arm, home_joints=home)
            return replace(arm, room=_room(model, _together(arm)))
        except ShapeError as error:
            raise FileFormatError(f"{self.path}: {error}") from error

    def _model_file(self) -> Path:
        model = self._needed("model")
        if isinstance(model, str):
            return self.path.parent / model
        if not isinstance(model, dict) or set(model) != {"package", "file"}:
            raise FileFormatError(
                f"{self.path}: model must be a path, or a package and a file in it, got {model!r}"
            )
        try:
            return Path(str(distribution(str(model["package"])).locate_file(str(model["file"]))))
        except PackageNotFoundError as error:
            raise ConfigurationError(
                f"{self.path.stem}: its model is in a package that is not installed: pip install {model['package']}"
            ) from error

    def _needed(self, field: str) -> Any:
        if field not in self.data:
            raise FileFormatError(f"{self.path}: field '{field}' is missing")
        return self.data[field]

    def _numbers(self, field: str, default: Array | None, count: int | None = None) -> Array:
        value = self._needed(field) if default is None else self.data.get(field, default)
        try:
            numbers = np.asarray(value, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise FileFormatError(f"{self.path}: {field} must be numbers, got {value!r}") from error
        return np.full(count, float(numbers)) if numbers.ndim == 0 and count else numbers

    def _pose(self, field: str) -> Array:
        value = self.data.get(field, {})
        if not isinstance(value, dict) or not set(value) <= {"xyz", "rpy_deg"}:
            raise FileFormatError(
                f"{self.path}: {field} must be an object with xyz and rpy_deg, got {value!r}"
            )
        parts = []
        for part in ("xyz", "rpy_deg"):
            try:
                numbers = np.asarray(value.get(part, [0.0, 0.0, 0.0]), dtype=np.float64)
            except (TypeError, ValueError):
                numbers = np.empty(0)
            if numbers.shape != (3,) or not np.isfinite(numbers).all():
                raise FileFormatError(
                    f"{self.path}: {field}.{part} must be three numbers, got {value[part]!r}"
                )
            parts.append(numbers)
        return make_transform(Rotation.from_euler("xyz", parts[1], degrees=True).as_matrix(), parts[0])

    def _found_home(self, arm: SerialArm) -> Array:
        """Of all postures that look from where the lab's arm looks, the most agile one that is comfortable."""
        pose = Panda().forward_kinematics(HOME)
        found = postures(
            arm, pose[None], np.clip(np.zeros(arm.joint_count), arm.limits.lower, arm.limits.upper), 0.0
        )[0]
        found = found[np.isfinite(found).all(axis=1)]
        if not len(found):
            raise FileFormatError(
                f"{self.path}: the arm can't hold the camera where the lab's looks at the plant from, flange at "
                f"{np.round(pose[:3, 3], 3).tolist()} m; mount it elsewhere, or give home"
            )
        apart = np.clip(self_clearance(arm, found) / APART, 0.01, 1.0)
        comfort = np.minimum(arm.limit_margin(found) / COMFORT, 1.0)
        return np.asarray(found[int(np.argmax(comfort * apart * arm.manipulability(found)))])


def _neighbours(joints: int) -> frozenset[tuple[int, int]]:
    """Foot, links and picker, each with the next."""
    return frozenset((part, part + 1) for part in range(joints + 1))


def _room(model: ArmModel, together: frozenset[tuple[int, int]]) -> ArmShape:
    picker = len(model.spheres)
    rows = [
        (link, centre, radius)
        for link, found in enumerate(model.spheres)
        for centre, radius in zip(*found, strict=True)
    ]
    rows += [(picker, centre, piece[2]) for piece in PICKER_PIECES for centre in spheres_along(piece)]
    part = np.array([row[0] for row in rows])
    return ArmShape(
        part,
        part,
        np.stack([row[1] for row in rows]),
        np.array([row[2] for row in rows], dtype=np.float64),
        together,
        1,
    )


def _together(arm: SerialArm) -> frozenset[tuple[int, int]]:
    """Neighbours, and parts whose cautious spheres meet at home or nearly always."""
    limits, part = arm.limits, arm.shape.part
    lower, upper = np.maximum(limits.lower, -np.pi), np.minimum(limits.upper, np.pi)
    random = np.random.default_rng(0).uniform(lower, upper, (POSTURES, arm.joint_count))
    centres, radius = arm_spheres(arm, np.concatenate((arm.home[None], random)))
    together = set(_neighbours(arm.joint_count))
    for a, b in combinations(np.unique(part).tolist(), 2):
        first, second = np.flatnonzero(part == a), np.flatnonzero(part == b)
        gap = np.linalg.norm(centres[:, first, None] - centres[:, None, second], axis=-1)
        touch = (gap < radius[first, None] + radius[second]).any(axis=(1, 2))
        if touch[0] or touch.mean() > ALWAYS:
            together.add((a, b))
    return frozenset(together)
