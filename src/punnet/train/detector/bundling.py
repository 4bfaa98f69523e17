"""A checkpoint to a bundle that needs no PyTorch."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from punnet.bundle import Manifest, require_bundle_place, write_bundle
from punnet.errors import ConfigurationError, FileFormatError
from punnet.perception.evaluation import EVALUATION_SCHEMA
from punnet.perception.learned import DETECTOR_FILE, MODEL_FILE
from punnet.train.detector.config import DetectorConfig, config_from_json
from punnet.train.detector.export import export_onnx
from punnet.train.detector.network import BerryDetector
from punnet.train.detector.training import CHECKPOINTS, CONFIG_FILE, LAST
from punnet.train.detector.validation import detector_settings
from punnet.train.runs import read_object

__all__ = ["Terms", "bundle_run", "network_of_checkpoint"]

_HEADLINE = ("class", "truths", "mask_ap", "mask_ap_50_95", "keypoint_ap")


@dataclass(frozen=True)
class Terms:
    """Under what terms a model may be used: licence, and what restricts it or asks to be cited."""

    licence: str = "Apache-2.0"
    restriction: str = ""
    citation: str = ""


def network_of_checkpoint(path: Path) -> BerryDetector:
    """The network of a checkpoint, with the averaged weights if there are any.

    Raises
    ------
    ConfigurationError
        If the file is not a checkpoint of a detector.
    """
    if not path.is_file():
        raise ConfigurationError(f"{path}: no such checkpoint; has the run come to its first validation?")
    try:
        stored = torch.load(path, map_location="cpu", weights_only=True)
        config = config_from_json(DetectorConfig, stored["hyper_parameters"]["detector"])
        network = BerryDetector(replace(config, pretrained=False))
        network.load_state_dict({k.removeprefix("network."): v for k, v in stored["state_dict"].items()})
    except Exception as error:  # damaged files make torch.load raise almost anything
        raise ConfigurationError(
            f"{path}: not a checkpoint of a detector ({str(error).partition(chr(10))[0]})"
        ) from error
    return network.eval()


def bundle_run(
    run: Path,
    folder: Path,
    *,
    name: str,
    terms: Terms,
    results: Mapping[str, Any],
    command: str | None = None,
    force: bool = False,
) -> Manifest:
    """Export the last checkpoint of a training run and write it as a bundle of kind ``detector``.

    Parameters
    ----------
    run
        Folder that :func:`~punnet.train.detector.training.train_detector` wrote.
    folder
        Where the bundle goes.
    name, terms, results
        For the manifest. Where ``terms`` restricts nothing or cites nothing, the restriction and the citation of the
        bundle that the run started from are kept. Of an evaluation, average precision by class goes into the manifest; the
        rest stays in its file.
    command
        How the model was trained; by default told from the run's settings.
    force
        Replace an existing bundle.

    Raises
    ------
    ConfigurationError
        If the folder holds no run.
    OutputExistsError
        If ``folder`` exists and ``force`` is not set, or it exists and is no bundle.
    """
    settings = _settings_of(run)
    require_bundle_place(folder, force=force)
    terms = _kept_terms(terms, settings.get("start"))
    network = network_of_checkpoint(run / CHECKPOINTS / LAST)
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / MODEL_FILE
        export_onnx(network, path)
        return write_bundle(
            folder,
            name=name,
            kind="detector",
            files={MODEL_FILE: path, DETECTOR_FILE: detector_settings(network.config).to_json()},
            licence=terms.licence,
            restriction=terms.restriction,
            citation=terms.citation,
            command=command or "punnet train detector, settings under data.run of this manifest",
            seed=settings["training"]["seed"],
            data={"run": settings},
            results={of: _headline(result) for of, result in results.items()},
            force=force,
        )


def _headline(result: Any) -> Any:
    """Images and average precision by class of what ``punnet evaluate detector`` wrote; anything else as it is."""
    if not (isinstance(result, dict) and result.get("schema") == EVALUATION_SCHEMA):
        return result
    return {
        "images": result.get("images"),
        "classes": [
            {name: _rounded(scores[name]) for name in _HEADLINE if name in scores}
            for scores in result.get("classes", [])
        ],
    }


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(one) for name, one in value.items()}
    return round(value, 4) if isinstance(value, float) else value


def _kept_terms(terms: Terms, start: object) -> Terms:
    """Terms with what the bundle that a run started from restricts, and asks to be cited."""
    if not isinstance(start, dict):
        return terms
    return replace(
        terms,
        restriction=terms.restriction or str(start.get("restriction", "")),
        citation=terms.citation or str(start.get("citation", "")),
    )


def _settings_of(run: Path) -> dict[str, Any]:
    try:
        settings = read_object(run / CONFIG_FILE)
        settings["training"]["seed"] += 0
    except FileFormatError as error:
        raise ConfigurationError(f"{run}: not the folder of a training run; {error}") from error
    except (KeyError, TypeError) as error:
        raise ConfigurationError(
            f"{run}: not the folder of a training run; no seed of a training in {CONFIG_FILE}"
        ) from error
    return settings
