"""A trained network as a detector: image in, berries out, without PyTorch."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.bundle import Bundle, Manifest, load_bundle
from punnet.errors import BundleError, ConfigurationError
from punnet.perception.decoding import decode_detections
from punnet.perception.network import Network
from punnet.scene import Frame, Strawberries

__all__ = ["DETECTOR_FILE", "DETECTOR_SCHEMA", "MODEL_FILE", "DetectorSettings", "LearnedDetector", "prepare"]

DETECTOR_SCHEMA = "punnet-detector/1"
DETECTOR_FILE = "detector.json"
MODEL_FILE = "model.onnx"


@dataclass(frozen=True)
class DetectorSettings:
    """``detector.json`` of a bundle of kind ``detector``.

    Parameters
    ----------
    backbone
        Name of the network's trunk.
    longest_side
        Pixels; larger images are reduced to it before the network sees them.
    stride
        The network's input is padded to multiples of it.
    mask_threshold
        Probability above which a pixel belongs to a berry.
    score_threshold
        Score from which detections are given, unless the user says otherwise.
    keypoint_sigmas
        (5,) fall-off of OKS, one a key-point, that its results were scored with.

    Raises
    ------
    BundleError
        If a value is out of its range.
    """

    backbone: str
    longest_side: int
    stride: int
    mask_threshold: float
    score_threshold: float
    keypoint_sigmas: tuple[float, ...]

    def __post_init__(self) -> None:
        whole = all(
            isinstance(value, int) and not isinstance(value, bool)
            for value in (self.longest_side, self.stride)
        )
        if not whole or not 1 <= self.stride <= self.longest_side:
            raise BundleError(
                f"longest_side and stride must be whole with 1 ≤ stride ≤ longest_side, "
                f"got {self.longest_side!r} and {self.stride!r}"
            )
        for name in ("mask_threshold", "score_threshold"):
            value = getattr(self, name)
            if not isinstance(value, int | float) or not 0 <= value < 1:
                raise BundleError(f"{name} must be a number in [0, 1), got {value!r}")
        numbers = isinstance(self.keypoint_sigmas, list | tuple) and all(
            isinstance(value, int | float) and value > 0 for value in self.keypoint_sigmas
        )
        if not numbers or len(self.keypoint_sigmas) != 5:
            raise BundleError(f"keypoint_sigmas must be five positive numbers, got {self.keypoint_sigmas!r}")
        object.__setattr__(self, "keypoint_sigmas", tuple(float(value) for value in self.keypoint_sigmas))
        if not isinstance(self.backbone, str):
            raise BundleError(f"backbone must be a text, got {self.backbone!r}")

    def to_json(self) -> dict[str, Any]:
        """Plain JSON with the schema's name."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        return {"schema": DETECTOR_SCHEMA, **values, "keypoint_sigmas": list(self.keypoint_sigmas)}

    @classmethod
    def from_json(cls, data: object, *, where: str) -> DetectorSettings:
        """Read what :meth:`to_json` wrote; further fields are left alone.

        Raises
        ------
        BundleError
            If the schema is unknown, or a field is missing or out of its range.
        """
        schema = data.get("schema") if isinstance(data, dict) else None
        if not isinstance(data, dict) or schema != DETECTOR_SCHEMA:
            raise BundleError(
                f"{where}: schema {schema!r} is unknown here; this version reads '{DETECTOR_SCHEMA}': "
                "update punnet or export the detector again"
            )
        missing = [item.name for item in fields(cls) if item.name not in data]
        if missing:
            raise BundleError(f"{where}: fields missing {missing}; export the detector again")
        try:
            return cls(**{item.name: data[item.name] for item in fields(cls)})
        except BundleError as error:
            raise BundleError(f"{where}: {error}") from error


class LearnedDetector:
    """Finds berries with a trained network: masks, five key-points with visibility, class and ripeness at once.

    Parameters
    ----------
    network
        The graph.
    settings
        How it wants its images, and what it takes for a berry.
    manifest
        Of the bundle: name, licence, results.
    score_threshold
        Score from which detections are given; the bundle's own if None.
    unsure_score
        Score from which unsure detections follow the others, for measuring average precision: of these, a berry may
        have one of either class. None for none.

    Raises
    ------
    ConfigurationError
        If a score is not in [0, 1).
    """

    def __init__(
        self,
        network: Network,
        settings: DetectorSettings,
        manifest: Manifest,
        score_threshold: float | None = None,
        unsure_score: float | None = None,
    ) -> None:
        self.settings = settings
        self.manifest = manifest
        self.name = manifest.name
        self.score_threshold = settings.score_threshold if score_threshold is None else score_threshold
        self.unsure_score = self.score_threshold if unsure_score is None else unsure_score
        for name in ("score_threshold", "unsure_score"):
            if not 0 <= getattr(self, name) < 1:
                raise ConfigurationError(f"detector: {name} must lie in [0, 1), got {getattr(self, name)}")
        self._network = network

    @classmethod
    def from_bundle(
        cls,
        bundle: Bundle | str | Path,
        *,
        threads: int | None = None,
        score_threshold: float | None = None,
        unsure_score: float | None = None,
    ) -> LearnedDetector:
        """Load a bundle of kind ``detector``.

        Parameters
        ----------
        bundle
            The bundle, its folder, or the name of one that comes with the package.
        threads
            Cores to use; None takes ``OMP_NUM_THREADS``, or all cores if that is not set.
        score_threshold, unsure_score
            See the class.

        Raises
        ------
        BundleError
            If a file is missing, damaged or not what the contract asks for.
        ConfigurationError
            If a number is out of range.
        """
        if not isinstance(bundle, Bundle):
            bundle = load_bundle(bundle, kind="detector")
        settings = DetectorSettings.from_json(
            bundle.read_json(DETECTOR_FILE), where=str(bundle.path(DETECTOR_FILE))
        )
        network = Network(bundle.path(MODEL_FILE), threads)
        return cls(network, settings, bundle.manifest, score_threshold, unsure_score)

    def detect(self, frame: Frame) -> Strawberries:
        """Berries of ``frame``, best first, in its own pixels; depth is not looked at."""
        return self._detect(frame.rgb, self.settings.longest_side)

    def detect_in(self, frame: Frame, region: NDArray[np.float64]) -> Strawberries:
        """Berries of a part of ``frame``, in its own pixels: the same network at the same scale, on fewer pixels.

        ``region`` (4,) xyxy pixels is taken a little larger, to multiples of the stride, so that the network's cells are
        those of the whole image.
        """
        size = frame.height, frame.width
        scale = min(1.0, self.settings.longest_side / max(size))
        stride = self.settings.stride / scale
        wider = stride * np.concatenate((np.floor(region[:2] / stride), np.ceil(region[2:] / stride)))
        left, top, right, bottom = np.clip(wider, 0, (*size[::-1], *size[::-1])).astype(int).tolist()
        if right <= left or bottom <= top:
            return Strawberries.empty(size)
        longest_side = max(1, round(scale * max(right - left, bottom - top)))
        return self._detect(frame.rgb[top:bottom, left:right], longest_side).placed(size, (left, top))

    def _detect(self, rgb: NDArray[np.uint8], longest_side: int) -> Strawberries:
        image, size = prepare(rgb, longest_side, self.settings.stride)
        least = min(self.score_threshold, self.unsure_score)
        return decode_detections(
            self._network.run(image, least),
            size,
            (rgb.shape[0], rgb.shape[1]),
            self.settings.mask_threshold,
            self.settings.keypoint_sigmas,
            least_score=least,
            unsure_below=self.score_threshold,
        )


def prepare(
    rgb: NDArray[np.uint8], longest_side: int, stride: int
) -> tuple[NDArray[np.uint8], tuple[int, int]]:
    """Reduce an image (H, W, 3) to the longest side and pad it, right and below, to multiples of the stride.

    Returns
    -------
    image
        (1, H', W', 3) uint8.
    size
        (H, W) of the image within, without the padding.
    """
    height, width = rgb.shape[:2]
    scale = min(1.0, longest_side / max(height, width))
    if scale < 1.0:
        height, width = max(1, round(height * scale)), max(1, round(width * scale))
        rgb = np.asarray(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
    image = np.zeros((1, -(-height // stride) * stride, -(-width // stride) * stride, 3), dtype=np.uint8)
    image[0, :height, :width] = rgb
    return image, (height, width)
