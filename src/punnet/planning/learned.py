"""A learned planner's graph: photograph and target box in, movements out, on ONNX Runtime.

A bundle of kind ``planner`` holds one model or more; ``NAME:MODEL`` asks for another than the first.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from punnet.bundle import Bundle, Graph, Manifest, load_bundle
from punnet.errors import BundleError, FileFormatError, ShapeError
from punnet.geometry import CameraIntrinsics, is_transform
from punnet.movement import GaussianBasis, TrajectoryDistribution
from punnet.movement.distribution import Space
from punnet.movement.pushforward import from_quaternion_factor
from punnet.planning.berry_light import UNKNOWN
from punnet.planning.reaches import DEGREES, SIDE, Movements, Reaches

__all__ = [
    "PLANNER_FILE",
    "PLANNER_SCHEMA",
    "BoxCamera",
    "MovementModel",
    "PlannerSettings",
    "planner_bundle",
]

PLANNER_SCHEMA = "punnet-planner/1"
PLANNER_FILE = "planner.json"
PICTURE, BOX, LIGHT = "picture", "box", "light"
BATCH = 64
_MAKE_AGAIN = "train it again with `punnet train planner`"
Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BoxCamera:
    """The camera that photographs were taken with, where the arm starts.

    Parameters
    ----------
    intrinsics
        Of the camera.
    pose
        ``T_base_camera`` (4, 4).
    """

    intrinsics: CameraIntrinsics
    pose: Array

    def to_json(self) -> dict[str, Any]:
        """Plain JSON."""
        return {"intrinsics": self.intrinsics.to_json(), "T_base_camera": self.pose.tolist()}


@dataclass(frozen=True, eq=False)
class PlannerSettings:
    """What all models of a bundle share: ``planner.json``.

    Parameters
    ----------
    models
        Space and file of each model by name; the first is the default.
    basis, duration
        Of the movements; seconds.
    demonstrated
        Distribution over the joints of all that was learnt from.
    camera
        Where photographs were taken from; None if the demonstrations do not tell.

    Raises
    ------
    BundleError
        If there is no model, a space is unknown, or ``demonstrated`` is not over seven joints.
    """

    models: dict[str, tuple[Space, str]]
    basis: GaussianBasis
    duration: float
    demonstrated: TrajectoryDistribution
    camera: BoxCamera | None = None

    def __post_init__(self) -> None:
        if not self.models or any(space not in get_args(Space) for space, _ in self.models.values()):
            raise BundleError("planner: at least one model is needed, each in joint or task space")
        if self.demonstrated.space != "joint" or self.demonstrated.dimensions != DEGREES:
            raise BundleError(
                f"planner: the demonstrated distribution is over {self.demonstrated.dimensions} coordinates in "
                f"{self.demonstrated.space} space; {DEGREES} joints are needed"
            )

    def to_json(self) -> dict[str, Any]:
        """Plain JSON with the schema's name."""
        return {
            "schema": PLANNER_SCHEMA,
            "models": [{"name": n, "space": space, "file": file} for n, (space, file) in self.models.items()],
            "basis": self.basis.to_json(),
            "duration": self.duration,
            "demonstrated": self.demonstrated.to_json(),
            "camera": None if self.camera is None else self.camera.to_json(),
        }

    @classmethod
    def from_json(cls, data: object, *, where: str) -> PlannerSettings:
        """Read what :meth:`to_json` wrote.

        Raises
        ------
        BundleError
            If the schema is unknown, or a field is missing or out of its range.
        """
        schema = data.get("schema") if isinstance(data, dict) else None
        if not isinstance(data, dict) or schema != PLANNER_SCHEMA:
            raise BundleError(
                f"{where}: schema {schema!r} is unknown here; this version reads '{PLANNER_SCHEMA}': update punnet, or "
                f"{_MAKE_AGAIN}"
            )
        try:
            return cls(
                models={str(m["name"]): (m["space"], str(m["file"])) for m in data["models"]},
                basis=GaussianBasis.from_json(data["basis"]),
                duration=float(data["duration"]),
                demonstrated=TrajectoryDistribution.from_json(data["demonstrated"]),
                camera=_camera(data["camera"]),
            )
        except (BundleError, FileFormatError, ShapeError) as error:
            raise BundleError(f"{where}: {error}; {_MAKE_AGAIN}") from error
        except (KeyError, TypeError, ValueError) as error:
            raise BundleError(
                f"{where}: field missing or of the wrong kind ({error!r}); {_MAKE_AGAIN}"
            ) from error


def _camera(data: Any) -> BoxCamera | None:
    if data is None:
        return None
    pose = np.asarray(data["T_base_camera"], dtype=np.float64)
    if not is_transform(pose):
        raise BundleError("camera: T_base_camera is not a 4×4 rigid transform")
    return BoxCamera(CameraIntrinsics.from_json(data["intrinsics"]), pose)


class MovementModel:
    """One model of a planner bundle.

    Its graph takes ``picture`` uint8 (N, 128, 128, 3) with the target's box filled white, ``box`` float32 (N, 4) xyxy
    divided by width and height, ``light`` float32 (N,), NaN unknown (:mod:`punnet.planning.berry_light`), or only some of
    them; it gives ``mean`` (N, 7, B) and ``factor`` (N, 7·B, R) with covariance F Fᵀ.

    Parameters
    ----------
    path
        The ONNX file.
    name, space
        What it is called in results, and what its movements are of.
    basis, duration
        Of the movements; seconds.

    Raises
    ------
    BundleError
        If the file is no ONNX graph, or not one of a planner.
    """

    def __init__(
        self, path: Path, name: str, space: Space, basis: GaussianBasis, duration: float = 1.0
    ) -> None:
        self._path, self.name, self.space = path, name, space
        self.basis, self.duration = basis, duration
        self._graph = Graph(path, _MAKE_AGAIN, threads=1)  # on a millisecond of work others only wait
        self._inputs, outputs = set(self._graph.inputs), set(self._graph.outputs)
        if not self._inputs or not self._inputs <= {PICTURE, BOX, LIGHT} or outputs != {"mean", "factor"}:
            raise BundleError(
                f"{path}: not a planner's graph: inputs {sorted(self._inputs)}, outputs {sorted(outputs)}; {_MAKE_AGAIN}"
            )

    @property
    def needs_picture(self) -> bool:
        """Whether it looks at the picture, or at the box and how the berry is lit alone."""
        return PICTURE in self._inputs

    @property
    def needs_light(self) -> bool:
        """Whether it looks at how the berry is lit."""
        return LIGHT in self._inputs

    def predict(self, reaches: Reaches) -> Movements:
        """(P) movements, one a photograph."""
        found = [
            self.movements(
                reaches.pictures[i : i + BATCH], reaches.boxes[i : i + BATCH], reaches.lights[i : i + BATCH]
            )
            for i in range(0, len(reaches), BATCH)
        ]
        return Movements(
            np.concatenate([m.mean for m in found]), np.concatenate([m.covariance for m in found])
        )

    def movements(self, pictures: NDArray[np.uint8], boxes: Array, lights: Array) -> Movements:
        """(N) movements of pictures (N, 128, 128, 3), boxes (N, 4) and lights (N,).

        Raises
        ------
        ShapeError
            If the shapes disagree.
        BundleError
            If the graph fails or gives something else.
        """
        mean, factor = self._predicted(pictures, boxes, lights)
        return Movements(mean, factor @ factor.transpose(0, 2, 1))

    def _predicted(self, pictures: NDArray[np.uint8], boxes: Array, lights: Array) -> tuple[Array, Array]:
        """Means (N, 7, B) and factors (N, 7·B, R)."""
        N, B = len(boxes), self.basis.count
        if pictures.shape != (N, SIDE, SIDE, 3) or boxes.shape != (N, 4) or lights.shape != (N,):
            raise ShapeError(
                f"{self.name}: pictures must be (N, {SIDE}, {SIDE}, 3), boxes (N, 4) and lights (N,), got "
                f"{pictures.shape}, {boxes.shape}, {lights.shape}"
            )
        fed = {
            PICTURE: np.ascontiguousarray(pictures),
            BOX: boxes.astype(np.float32),
            LIGHT: lights.astype(np.float32),
        }
        mean, factor = self._graph.run(
            ("mean", "factor"), {name: fed[name] for name in self._inputs}, f"{N} photographs"
        )
        mean, factor = np.asarray(mean, dtype=np.float64), np.asarray(factor, dtype=np.float64)
        if mean.shape != (N, DEGREES, B) or factor.shape[:2] != (N, DEGREES * B) or factor.ndim != 3:
            raise BundleError(
                f"{self._path}: gave mean {mean.shape} and factor {factor.shape}; {_MAKE_AGAIN}"
            )
        return mean, factor

    def distribution(
        self, picture: NDArray[np.uint8], box: Array, light: float = UNKNOWN
    ) -> TrajectoryDistribution:
        """Of one picture (128, 128, 3), box (4,) and how the berry is lit.

        Raises
        ------
        ShapeError
            If a predicted quaternion has no direction, or a number is not finite.
        """
        (mean,), (factor,) = self._predicted(picture[None], box[None], np.array([light]))
        if self.space == "task":
            return from_quaternion_factor(self.basis, mean, factor, duration=self.duration)
        return TrajectoryDistribution(self.basis, mean, factor @ factor.T, self.duration)


def planner_bundle(source: Bundle | str | Path) -> tuple[MovementModel, PlannerSettings, Manifest]:
    """Model, settings and manifest of a bundle of kind ``planner``.

    Parameters
    ----------
    source
        The bundle, its folder, the folder of a training run, or the name of a bundle that comes with the package; behind
        a colon the name of one of its models.

    Raises
    ------
    BundleError
        If there is none, it is damaged, or has no such model.
    """
    wanted = None
    if not isinstance(source, Bundle):
        text = str(source)
        if not Path(text).exists() and ":" in text:
            text, wanted = text.rsplit(":", 1)
        inner = Path(text) / "bundle"
        source = load_bundle(inner if inner.is_dir() else text, kind="planner")
    settings = PlannerSettings.from_json(source.read_json(PLANNER_FILE), where=str(source.path(PLANNER_FILE)))
    name = wanted or next(iter(settings.models))
    if name not in settings.models:
        raise BundleError(f"bundle '{source.name}': no model '{name}'; it has {', '.join(settings.models)}")
    space, file = settings.models[name]
    model = MovementModel(source.path(file), name, space, settings.basis, settings.duration)
    return model, settings, source.manifest
