"""A camera frame, and the folder it is stored in: ``rgb.png``, ``depth.png`` (16-bit millimetres), ``camera.json``."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.errors import FileFormatError, ShapeError
from punnet.geometry import CameraIntrinsics, is_transform
from punnet.outputs import OutputFolder

__all__ = ["Frame", "read_image"]

FRAME_SCHEMA = "punnet-frame/1"
MILLIMETRES_PER_METRE = 1000.0


def read_image(path: str | Path) -> NDArray[np.uint8]:
    """Read any image OpenCV knows as RGB uint8 (H, W, 3), turned as its EXIF orientation says.

    16-bit images are scaled to 8 bits; grey becomes three equal channels; alpha is dropped.

    Raises
    ------
    FileFormatError
        If the path does not exist, is a folder, or holds no readable image.
    """
    path = Path(path)
    _require_file(path, "an image")
    try:
        encoded = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    except OSError as error:
        raise FileFormatError(f"{path}: can't be read ({error.strerror})") from error
    image = _decode(encoded, cv2.IMREAD_COLOR)
    if image is None:
        raise FileFormatError(f"{path}: not an image, damaged, or far too large; give a PNG or JPEG")
    return np.ascontiguousarray(image[:, :, ::-1])


def _decode(encoded: NDArray[np.uint8], flags: int) -> NDArray[Any] | None:
    """Decoded image, None if it can't be; OpenCV's own words about it are kept off the terminal."""
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return cv2.imdecode(encoded, flags) if encoded.size else None
    except cv2.error:  # a header that promises more pixels than OpenCV handles
        return None
    finally:
        cv2.utils.logging.setLogLevel(level)


def _require_file(path: Path, what: str) -> None:
    if path.is_dir():
        raise FileFormatError(f"{path}: is a folder; {what} file is needed")
    if not path.exists():
        raise FileFormatError(f"{path}: no such file; {what} file is needed")


@dataclass(frozen=True, eq=False)
class Frame:
    """What a camera saw at one instant.

    Parameters
    ----------
    rgb
        Image, uint8 (H, W, 3), RGB.
    depth
        Depth along the optical axis, float32 (H, W) in metres, aligned to ``rgb``; 0 = no reading. None without depth.
    camera
        Intrinsics of both, None if unknown.
    T_base_camera
        Pose of the optical camera frame in the robot's base, (4, 4), None if unknown.
    timestamp
        Seconds.
    name
        Where the frame came from; used to name outputs.

    Raises
    ------
    ShapeError
        If an array has a wrong shape, type or value, or sizes disagree.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32] | None = None
    camera: CameraIntrinsics | None = None
    T_base_camera: NDArray[np.float64] | None = None
    timestamp: float = 0.0
    name: str = "frame"

    def __post_init__(self) -> None:
        rgb = np.asarray(self.rgb)
        if rgb.ndim != 3 or rgb.shape[2] != 3 or rgb.dtype != np.uint8 or rgb.size == 0:
            raise ShapeError(f"frame '{self.name}': rgb must be uint8 (H, W, 3), got {rgb.dtype} {rgb.shape}")
        height, width = rgb.shape[:2]
        object.__setattr__(self, "rgb", rgb)
        if self.depth is not None:
            depth = np.asarray(self.depth, dtype=np.float32)
            if depth.shape != (height, width):
                raise ShapeError(
                    f"frame '{self.name}': depth is {depth.shape}, rgb is {(height, width)}; align the depth to the image"
                )
            if not np.isfinite(depth).all() or (depth < 0).any():
                raise ShapeError(f"frame '{self.name}': depth must be finite metres ≥ 0 (0 = no reading)")
            object.__setattr__(self, "depth", depth)
        if self.camera is not None and (self.camera.width, self.camera.height) != (width, height):
            raise ShapeError(
                f"frame '{self.name}': camera is for {self.camera.width}×{self.camera.height}, image is {width}×{height}"
            )
        if self.T_base_camera is not None:
            T = np.asarray(self.T_base_camera, dtype=np.float64)
            if not is_transform(T):
                raise ShapeError(f"frame '{self.name}': T_base_camera is not a 4×4 rigid transform")
            object.__setattr__(self, "T_base_camera", T)

    @property
    def height(self) -> int:
        """Rows of the image."""
        return int(self.rgb.shape[0])

    @property
    def width(self) -> int:
        """Columns of the image."""
        return int(self.rgb.shape[1])

    def save(self, folder: str | Path, *, force: bool = False) -> Path:
        """Write ``rgb.png``, ``depth.png`` (uint16 millimetres) and ``camera.json``; all or nothing.

        Depth is rounded to whole millimetres; readings beyond 65.535 m are stored as 0 (no reading).

        Raises
        ------
        OutputExistsError
            If the folder exists and ``force`` is not set, or was not made by Punnet.
        """
        with OutputFolder(folder, force=force) as output:
            _write_png(output.path / "rgb.png", self.rgb[:, :, ::-1])
            if self.depth is not None:
                millimetres = np.rint(self.depth * MILLIMETRES_PER_METRE)
                counts = np.where(millimetres > 65535, 0, millimetres).astype(np.uint16)
                _write_png(output.path / "depth.png", counts)
            (output.path / "camera.json").write_text(json.dumps(self._description(), indent=2) + "\n")
        return Path(folder)

    def _description(self) -> dict[str, Any]:
        return {
            "schema": FRAME_SCHEMA,
            "name": self.name,
            "timestamp": self.timestamp,
            "depth_scale": 1.0 / MILLIMETRES_PER_METRE,
            "camera": None if self.camera is None else self.camera.to_json(),
            "T_base_camera": None if self.T_base_camera is None else self.T_base_camera.tolist(),
        }

    @classmethod
    def load(cls, folder: str | Path) -> Frame:
        """Read the folder that :meth:`save` wrote; ``depth.png`` and ``camera.json`` may be absent."""
        folder = Path(folder)
        if not folder.is_dir():
            raise FileFormatError(f"{folder}: not a frame folder (needs rgb.png, depth.png, camera.json)")
        depth = folder / "depth.png"
        camera = folder / "camera.json"
        return cls.from_files(
            folder / "rgb.png",
            depth=depth if depth.exists() else None,
            camera=camera if camera.exists() else None,
            name=folder.name,
        )

    @classmethod
    def from_files(
        cls,
        rgb: str | Path,
        *,
        depth: str | Path | None = None,
        camera: str | Path | None = None,
        name: str | None = None,
    ) -> Frame:
        """Assemble a frame from an image, a 16-bit depth PNG and a camera JSON.

        The depth's unit is ``depth_scale`` metres per count of the camera JSON, 0.001 if it has none. The camera
        JSON is either what :meth:`save` writes or a flat object with width, height, fx, fy, cx, cy.

        Raises
        ------
        FileFormatError
            If a file is missing, damaged or of the wrong kind.
        ShapeError
            If depth, camera and image disagree in size.
        """
        image = read_image(rgb)
        description: dict[str, Any] = {} if camera is None else _read_json_object(Path(camera))
        intrinsics = description.get("camera", description) or None
        pose = description.get("T_base_camera")
        counts = None if depth is None else _read_depth_counts(Path(depth))
        scale = description.get("depth_scale", 1.0 / MILLIMETRES_PER_METRE)
        if not isinstance(scale, int | float) or not 0 < scale < 1:
            raise FileFormatError(f"{camera}: depth_scale must be metres per count, in (0, 1), got {scale!r}")
        return cls(
            rgb=image,
            depth=None if counts is None else counts.astype(np.float32) * np.float32(scale),
            camera=None if intrinsics is None else CameraIntrinsics.from_json(intrinsics, where=str(camera)),
            T_base_camera=None if pose is None else np.asarray(pose, dtype=np.float64),
            timestamp=float(description.get("timestamp", 0.0)),
            name=name or str(description.get("name", Path(rgb).stem)),
        )


def _write_png(path: Path, image: NDArray[Any]) -> None:
    done, encoded = cv2.imencode(".png", image)
    if not done:
        raise FileFormatError(f"{path}: could not be encoded as PNG")
    path.write_bytes(encoded.tobytes())


def _read_depth_counts(path: Path) -> NDArray[np.uint16]:
    _require_file(path, "a 16-bit depth PNG")
    encoded = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    image = _decode(encoded, cv2.IMREAD_UNCHANGED)
    if image is None:
        raise FileFormatError(f"{path}: not an image, or damaged; a 16-bit depth PNG is needed")
    if image.dtype != np.uint16 or image.ndim != 2:
        raise FileFormatError(
            f"{path}: depth must be 16-bit and one channel, got {image.dtype} {image.shape}"
        )
    return image.astype(np.uint16, copy=False)


def _read_json_object(path: Path) -> dict[str, Any]:
    _require_file(path, "a camera JSON")
    try:
        data = json.loads(path.read_text())
    except (ValueError, OSError) as error:
        raise FileFormatError(f"{path}: not readable as JSON ({error})") from error
    if not isinstance(data, dict):
        raise FileFormatError(f"{path}: must hold a JSON object, got {type(data).__name__}")
    return data
