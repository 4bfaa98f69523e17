"""Weights to start a training from: another run's checkpoint, or a bundle, which is all that a user may have."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from punnet.bundle import Bundle, load_bundle
from punnet.errors import BundleError, ConfigurationError
from punnet.perception.learned import MODEL_FILE
from punnet.train.detector.config import config_to_json
from punnet.train.detector.export import weights_of_onnx
from punnet.train.detector.module import DetectorModule

__all__ = ["describe_start", "load_weights"]

COUNTER = "num_batches_tracked"  # of batch normalisation; counts, and changes nothing


def describe_start(start: str | Path | None) -> str | dict[str, str] | None:
    """What a run notes of where it started: a bundle's name, checksum and terms, or the path of anything else."""
    if start is None:
        return None
    try:
        manifest = load_bundle(start, kind="detector").manifest
    except BundleError:
        return str(start)
    return {
        "bundle": manifest.name,
        "sha256": manifest.files.get(MODEL_FILE, ""),
        "licence": manifest.licence,
        "restriction": manifest.restriction,
        "citation": manifest.citation,
    }


def load_weights(module: DetectorModule, start: str | Path) -> None:
    """Take over the weights of a checkpoint (the averaged ones if it has them) or of a bundle.

    A bundle holds its weights under the network's own names, rounded to half precision, and its batch normalisation
    unfolded: see :func:`~punnet.train.detector.export.export_onnx`.

    Parameters
    ----------
    module
        What is to be trained; its network is filled.
    start
        A checkpoint, a bundle's folder, or the name of a bundle that comes with the package.

    Raises
    ------
    ConfigurationError
        If it is neither, or holds another network; then it says which settings differ.
    """
    if Path(start).is_file():
        _load_checkpoint(module, Path(start))
        return
    bundle = _bundle(start)
    stored = weights_of_onnx(bundle.path(MODEL_FILE))
    wanted = {k: v for k, v in module.network.state_dict().items() if not k.endswith(COUNTER)}
    if unlike := _unlike(stored, wanted):
        raise ConfigurationError(
            f"--start {start}: holds another network ({_told(bundle, module) or unlike}); "
            "give --config a file with its settings, or another start"
        )
    module.network.load_state_dict(stored, strict=False)


def _bundle(start: str | Path) -> Bundle:
    try:
        bundle = load_bundle(start, kind="detector")
        bundle.path(MODEL_FILE)
    except BundleError as error:
        raise ConfigurationError(f"--start: neither a checkpoint nor a detector's bundle: {error}") from error
    return bundle


def _load_checkpoint(module: nn.Module, path: Path) -> None:
    try:
        stored: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        module.load_state_dict(stored["state_dict"])
    except Exception as error:  # damaged files make torch.load raise almost anything
        raise ConfigurationError(
            f"{path}: not a checkpoint of this detector ({str(error).splitlines()[0]})"
        ) from error


def _unlike(stored: Mapping[str, Tensor], wanted: Mapping[str, Tensor]) -> str:
    """The first weight that is missing, too much, or of another shape; nothing if there is none."""
    for name in sorted(stored.keys() | wanted.keys()):
        found = tuple(stored[name].shape) if name in stored else "nothing"
        needed = tuple(wanted[name].shape) if name in wanted else "nothing"
        if found != needed:
            return f"{name}: {found} where {needed} is needed"
    return ""


def _told(bundle: Bundle, module: DetectorModule) -> str:
    """By which settings the bundle's network differs, as far as its manifest tells."""
    run = bundle.manifest.data.get("run")
    made = run.get("detector") if isinstance(run, dict) else None
    if not isinstance(made, dict):
        return ""
    wanted = config_to_json(module.network.config)
    differing = [k for k in wanted if k != "pretrained" and made.get(k) != wanted[k]]
    return ", ".join(f"{k} {made.get(k, 'not there')}, not {wanted[k]}" for k in differing)
