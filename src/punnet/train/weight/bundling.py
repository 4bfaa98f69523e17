"""A trained weight model to a bundle that needs no PyTorch and no scikit-learn."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from punnet.bundle import Manifest, write_bundle
from punnet.errors import ConfigurationError
from punnet.train.detector.bundling import Terms
from punnet.train.weight.feature_model import FeatureModel
from punnet.train.weight.training import TRUTH, load_run
from punnet.weight.learned import MODEL_FILE, WEIGHT_FILE

__all__ = ["bundle_weight_run"]


def bundle_weight_run(
    run: Path,
    folder: Path,
    *,
    name: str,
    terms: Terms,
    results: Mapping[str, Any],
    command: str | None = None,
    force: bool = False,
) -> Manifest:
    """Write the model of a finished run as a bundle of kind ``weight``.

    Parameters
    ----------
    run
        Folder that :func:`~punnet.train.weight.training.train_weight_model` wrote.
    folder
        Where the bundle goes.
    name, terms, results
        For the manifest; the run's own results stand there as ``run``.
    command
        How the model was trained; by default told from the run's settings.
    force
        Replace an existing bundle.

    Raises
    ------
    ConfigurationError
        If the model is none that weighs by features: deep ones have no bundle.
    FileFormatError
        If the folder holds no finished run.
    """
    trained = load_run(run)
    model = trained.model()
    if not isinstance(model, FeatureModel):
        raise ConfigurationError(
            f"{run}: {trained.spec.name} is a deep model, which has no bundle; evaluate it with: "
            f"punnet evaluate weight --run {run}"
        )
    settings = trained.settings
    data = "".join(f" --{kind} {source}" for kind in ("data", "extra") for source in settings[kind])
    data += "".join(f" --masks {name}" for name in settings.get("masks", ()) if name != TRUTH)
    return write_bundle(
        folder,
        name=name,
        kind="weight",
        files={MODEL_FILE: model.graph, WEIGHT_FILE: model.to_json()},
        licence=terms.licence,
        restriction=terms.restriction,
        citation=terms.citation,
        command=command or f"punnet train weight --model {trained.spec.name}{data} --seed {settings['seed']}",
        seed=settings["seed"],
        data={"run": dict(settings)},
        results={"run": dict(trained.results), **results},
        force=force,
    )
