"""``punnet train weight``: from images of weighed berries to a model that weighs by eye."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import counted_progress, note, print_json, say, whisper
from punnet.cli.options import Json, Seed
from punnet.errors import ConfigurationError, FileFormatError

if TYPE_CHECKING:
    from punnet.weight.samples import WeightSamples

__all__ = ["collect", "need_training", "register_weight"]


def register_weight(group: typer.Typer) -> None:
    """Add the command to the group ``train``."""
    group.command(
        "weight",
        epilog="Example: punnet train weight --model shape --data dataset-1 --masks sim-fast --out runs/shape",
    )(weight)


def weight(
    model: Annotated[
        str,
        typer.Option(
            "--model",
            "-m",
            help="forest, forest_pca, shape, efficientnet_b0, efficientnet_b7, pointnet, pointnet2, pointconv, "
            "gcn, hgnn or dgcnn.",
            show_default=False,
        ),
    ],
    data: Annotated[
        list[str],
        typer.Option(
            "--data",
            help="Images with depth, camera, masks and weights; a fifth of its plants is set aside for tests, a tenth "
            "for validation. May be given more than once.",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the run; a stopped run goes on.")],
    extra: Annotated[
        list[str] | None,
        typer.Option("--extra", help="Images of other plants, all learnt from. May be given more than once."),
    ] = None,
    masks: Annotated[
        list[str] | None,
        typer.Option(
            "--masks",
            help="A detector: the berries are learnt from as it sees them, besides the true masks. May be given more than "
            "once.",
        ),
    ] = None,
    seed: Seed = 0,
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", help='JSON with settings in place of the model\'s own, e.g. {"trees": 100}.'
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="The settings of a short training, to try things out.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Train a weight model and measure it on plants that it has not seen."""
    need_training()
    from punnet.train.runs import read_object, require_run_place
    from punnet.train.weight.registry import model_spec
    from punnet.train.weight.training import RUN_FILE, WHAT, read_config, train_weight_model

    spec = model_spec(model)
    require_run_place(out, RUN_FILE, what=WHAT)
    changes = (dict(spec.quick) if quick else {}) | ({} if config is None else read_object(config))
    settings = read_config(spec, changes)
    samples = collect(data)
    run = train_weight_model(
        spec,
        settings,
        samples,
        data=[Path(source).name for source in data],
        folder=out,
        seed=seed,
        progress=whisper,
        extra=collect(extra) if extra else None,
        extra_data=[Path(source).name for source in extra or []],
        detected={name: collect([*data, *(extra or [])], name) for name in masks or []},
    )
    if as_json:
        print_json({"run": str(out), **run.results})
    else:
        whole = run.results["test"]["parts"]["all"]
        say(
            f"trained {out}: on {run.settings['berries']['test']} berries of unseen plants {whole['mape']:.1f}% off, "
            f"{whole['pcw']['0.20']:.1f}% within 20%; more with: punnet evaluate weight --run {out} --data {data[0]}"
        )
    if samples.skipped:
        raise typer.Exit(1)


def collect(paths: list[str], detector: str | None = None) -> WeightSamples:
    """Berries of known weight of some data sets, through a detector's masks if one is named.

    What can't be read is said and left out.
    """
    from punnet.data.formats import read_dataset
    from punnet.perception.choosing import load_detector
    from punnet.train.weight.training import collect_all

    datasets = [read_dataset(path) for path in paths]
    eyes = None if detector is None else load_detector(detector)
    what = "looking at berries" if detector is None else f"looking at berries, masks of {detector}"
    with counted_progress(what) as progress:
        samples = collect_all(datasets, progress, eyes)
    for line in samples.skipped:
        note(f"left out: {line}")
    if not len(samples):
        raise FileFormatError(
            f"{', '.join(paths)}: no ripe berry with a weight, mask, depth and camera in it; punnet data simulate "
            "--protocol dataset-1 makes some"
        )
    for reason, count in samples.refused.items():
        whisper(f"{count} berries can't be weighed: {reason}")
    return samples


def need_training() -> None:
    """Say how to install what training takes if it is missing.

    Raises
    ------
    ConfigurationError
        If it is.
    """
    if missing := [name for name in ("torch", "sklearn", "onnx") if find_spec(name) is None]:
        raise ConfigurationError(
            f"training needs {', '.join(missing)}: {sys.executable} -m pip install 'punnet[train]'"
        )
