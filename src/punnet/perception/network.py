"""A detector's ONNX graph: opened, held against the contract, run.

Graph contract ``punnet-detector/1``, N detections, best first:

=================  =======  ============  =======================================================
input              type     shape         meaning
=================  =======  ============  =======================================================
image              uint8    (1, H, W, 3)  RGB, H and W multiples of the stride
score_threshold    float32  ()            detections below are left out
=================  =======  ============  =======================================================

=================  =======  ============  =======================================================
output             type     shape         meaning
=================  =======  ============  =======================================================
boxes              float32  (N, 4)        xyxy pixels of the input
scores             float32  (N,)          0 … 1
labels             int64    (N,)          0 pluckable, 1 unpluckable
regions            float32  (N, 4)        xyxy: what mask and heat-map cover
masks              float32  (N, M, M)     probability over the region
heatmaps           float32  (N, 5, K, K)  logits over the region, one map a key-point
visibility         float32  (N, 5, 4)     probability of each :class:`~punnet.scene.Visibility`
ripeness           float32  (N,)          0 … 1
=================  =======  ============  =======================================================
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from punnet.bundle import Graph
from punnet.errors import BundleError, ConfigurationError

__all__ = ["Network", "RawDetections"]

Declared = Mapping[str, tuple[str, tuple[int | None, ...]]]
INPUTS: Declared = {
    "image": ("uint8", (1, None, None, 3)),
    "score_threshold": ("float", ()),
}
OUTPUTS: Declared = {
    "boxes": ("float", (None, 4)),
    "scores": ("float", (None,)),
    "labels": ("int64", (None,)),
    "regions": ("float", (None, 4)),
    "masks": ("float", (None, None, None)),
    "heatmaps": ("float", (None, 5, None, None)),
    "visibility": ("float", (None, 5, 4)),
    "ripeness": ("float", (None,)),
}
FARTHEST = 4


@dataclass(frozen=True, eq=False)
class RawDetections:
    """What the graph gives, by the names of the contract (see the module)."""

    boxes: NDArray[np.float32]
    scores: NDArray[np.float32]
    labels: NDArray[np.int64]
    regions: NDArray[np.float32]
    masks: NDArray[np.float32]
    heatmaps: NDArray[np.float32]
    visibility: NDArray[np.float32]
    ripeness: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, index: NDArray[np.int64] | slice) -> RawDetections:
        return RawDetections(**{item.name: getattr(self, item.name)[index] for item in fields(self)})

    @classmethod
    def from_outputs(cls, outputs: Mapping[str, Any], image: NDArray[np.uint8], where: str) -> RawDetections:
        """Check shapes and values of one run on ``image`` (1, H, W, 3).

        Raises
        ------
        BundleError
            If a shape is not the contract's, a number is not finite, or a place is far outside the image.
        """
        arrays = {name: np.asarray(outputs[name]) for name in OUTPUTS}
        count = len(arrays["boxes"])
        for name, (_, shape) in OUTPUTS.items():
            found = arrays[name].shape
            if not _fits(found, (count, *shape[1:])):
                raise BundleError(f"{where}: gave '{name}' of shape {found}; {_words(shape)} is needed")
            if not np.isfinite(arrays[name]).all():
                raise BundleError(
                    f"{where}: gave '{name}' with numbers that are not finite; export the detector again"
                )
        for name in ("boxes", "regions"):
            if (arrays[name][:, 2:] < arrays[name][:, :2]).any():
                raise BundleError(
                    f"{where}: gave '{name}' that end before they begin; export the detector again"
                )
        # Masks are drawn as large as their regions: a graph gone wrong must not ask for all the memory.
        if count and np.abs(arrays["regions"]).max() > FARTHEST * max(image.shape):
            raise BundleError(f"{where}: gave regions far outside the image; export the detector again")
        labels = arrays["labels"]
        if not set(labels.tolist()) <= {0, 1}:
            raise BundleError(f"{where}: gave labels {sorted(set(labels.tolist()))}; only 0 and 1 are known")
        return cls(**arrays)


class Network:
    """A detector's graph on ONNX Runtime.

    Parameters
    ----------
    path
        The ONNX file; its inputs and outputs are held against the contract.
    threads
        Cores to use; None takes ``OMP_NUM_THREADS``, or all cores if that is not set.

    Raises
    ------
    BundleError
        If the file is no ONNX graph, or not one of a detector.
    ConfigurationError
        If ``threads`` is not positive.
    """

    def __init__(self, path: Path, threads: int | None = None) -> None:
        if threads is not None and threads < 1:
            raise ConfigurationError(f"detector: threads must be ≥ 1, got {threads}")
        self._path = path
        self._graph = Graph(path, "export the detector again", threads=_threads(threads))
        _check(path, "input", INPUTS, self._graph.inputs)
        _check(path, "output", OUTPUTS, self._graph.outputs)

    def run(self, image: NDArray[np.uint8], score_threshold: float) -> RawDetections:
        """Detections of an image (1, H, W, 3), best first.

        Raises
        ------
        BundleError
            If the graph fails, or gives what the contract does not allow.
        """
        feeds = {"image": image, "score_threshold": np.array(score_threshold, dtype=np.float32)}
        outputs = self._graph.run(list(OUTPUTS), feeds, f"an image of {image.shape[1]}×{image.shape[2]}")
        return RawDetections.from_outputs(dict(zip(OUTPUTS, outputs, strict=True)), image, str(self._path))


def _threads(wanted: int | None) -> int:
    """Threads to ask for; 0 leaves it to the runtime, which takes all cores."""
    if wanted is not None:
        return wanted
    setting = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    return int(setting) if setting.isdecimal() else 0


def _check(path: Path, side: str, wanted: Declared, found: Declared) -> None:
    """Compare what the file declares with the contract; sizes it leaves open are checked when it runs."""
    foreign = sorted(set(found) - set(wanted)) if side == "input" else []
    missing = sorted(set(wanted) - set(found))
    if foreign or missing:
        raise BundleError(
            f"{path}: not a detector's graph: {side}s {sorted(found)}, needed are {sorted(wanted)}; "
            "export the detector with `punnet train detector`"
        )
    for name, (kind, shape) in wanted.items():
        has_kind, has_shape = found[name]
        if has_kind != kind or (has_shape is not None and not _fits(has_shape, shape)):
            raise BundleError(
                f"{path}: {side} '{name}' is {has_kind} {_words(has_shape)}, needed is {kind} {_words(shape)}; "
                "export the detector with `punnet train detector`"
            )


def _fits(found: Sequence[int | None], wanted: Sequence[int | None]) -> bool:
    return len(found) == len(wanted) and all(
        one is None or other is None or one == other for one, other in zip(found, wanted, strict=True)
    )


def _words(shape: Sequence[int | None] | None) -> str:
    return "(?)" if shape is None else f"({', '.join('?' if size is None else str(size) for size in shape)})"
