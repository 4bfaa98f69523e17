"""``punnet train detector`` and ``punnet train bundle``: from labelled images to a model that needs no PyTorch."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import print_json, say, whisper
from punnet.cli.options import Force, Json
from punnet.cli.train_planner import register_planner
from punnet.cli.train_weight import register_weight
from punnet.errors import ConfigurationError

if TYPE_CHECKING:
    from punnet.train.detector.config import Source

__all__ = ["read_source", "register"]

DATA_HELP = (
    "A labelled set: a file or folder that punnet data can read, then if wanted: weight=2 (drawn twice as often), "
    "scale=0.5-1.2 (sizes it is shown in), split=LIST.json:train, ignore=overripe+rotten (stages that are neither "
    "taught nor held against it), all behind commas. May be given more than once."
)


class Accelerator(StrEnum):
    """What a training process calculates on."""

    CPU = "cpu"
    GPU = "gpu"


def register(app: typer.Typer) -> None:
    """Add the group."""
    group = typer.Typer(help="Train models (needs punnet with its extra train).", no_args_is_help=True)
    group.command(
        "detector",
        epilog="Example: punnet train detector --config sim-fast --data berries/train --validation berries/val "
        "--out runs/mine",
    )(detector)
    group.command(
        "bundle", epilog="Example: punnet train bundle runs/mine --out models/mine --licence CC-BY-4.0"
    )(bundle)
    register_weight(group)
    register_planner(group)
    app.add_typer(group, name="train")


def detector(
    data: Annotated[list[str], typer.Option("--data", help=DATA_HELP, show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the run; a stopped run goes on.")],
    config: Annotated[
        str, typer.Option("--config", help="sim-fast, field-fast, or a JSON file of your own.")
    ] = "sim-fast",
    validation: Annotated[
        str | None, typer.Option("--validation", help="A labelled set to validate on, like --data.")
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            "--start",
            help="What to start from: a model's name (see punnet models) or folder, or a run's checkpoint.",
        ),
    ] = None,
    steps: Annotated[int | None, typer.Option("--steps", min=1, help="In place of the config's.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, help="In place of the config's.")] = None,
    processes: Annotated[int, typer.Option("--processes", min=1, help="That train together.")] = 1,
    threads: Annotated[
        int | None, typer.Option("--threads", min=1, help="Of each process; all cores if not given.")
    ] = None,
    accelerator: Annotated[
        Accelerator, typer.Option("--accelerator", help="What calculates.")
    ] = Accelerator.CPU,
    as_json: Json = False,
) -> None:
    """Train a detector: masks, five key-points with visibility, ripeness. Runs that were stopped go on."""
    need_pytorch()
    from punnet.train.detector.presets import read_config
    from punnet.train.detector.training import TrainingRun, last_scores, train_detector

    network, training = read_config(config, {"steps": steps, "seed": seed})
    last = train_detector(
        network,
        training,
        TrainingRun(
            folder=out,
            sources=tuple(read_source(text) for text in data),
            validation=None if validation is None else read_source(validation),
            start=start,
            processes=processes,
            threads=threads,
            accelerator="gpu" if accelerator is Accelerator.GPU else "cpu",
        ),
        whisper,
    )
    if int(os.environ.get("LOCAL_RANK", "0")):
        return  # only the first of several processes tells
    if as_json:
        print_json({"run": str(out), "checkpoint": str(last), "validation": last_scores(out)})
    else:
        say(f"trained: {last}; make a model of it with: punnet train bundle {out} --out MODEL")


def bundle(
    run: Annotated[Path, typer.Argument(help="Folder of a training run.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the bundle.", show_default=False)],
    name: Annotated[
        str | None, typer.Option("--name", help="The model's name; the folder's if not given.")
    ] = None,
    licence: Annotated[
        str, typer.Option("--licence", help="Of the model, as its data allows.")
    ] = "not stated",
    restriction: Annotated[
        str, typer.Option("--restriction", help="What the licence forbids, in words.")
    ] = "",
    citation: Annotated[str, typer.Option("--citation", help="What is to be cited.")] = "",
    results: Annotated[
        list[str] | None,
        typer.Option("--results", help="NAME=FILE.json of punnet evaluate; may be repeated."),
    ] = None,
    command: Annotated[
        str | None,
        typer.Option("--command", help="How it was trained, for the manifest; the run's own if not given."),
    ] = None,
    force: Force = False,
) -> None:
    """Export a run's model as a bundle: ONNX and JSON, checksums, how it was made."""
    need_pytorch()
    from punnet.train.detector.bundling import Terms, bundle_run
    from punnet.train.planner.training import bundle_planner_run, is_planner_run
    from punnet.train.runs import read_object
    from punnet.train.weight.bundling import bundle_weight_run
    from punnet.train.weight.training import is_weight_run

    if is_weight_run(run):
        write, use = (
            bundle_weight_run,
            f"punnet weigh --rgb PHOTO --depth DEPTH --camera CAMERA --estimator {out}",
        )
    elif is_planner_run(run):
        write, use = bundle_planner_run, f"punnet plan --planner {out} --rgb PHOTO --target x0,y0,x1,y1"
    else:
        write, use = bundle_run, f"punnet detect PHOTO --out found --detector {out}"
    manifest = write(
        run,
        out,
        name=name or out.name,
        terms=Terms(licence, restriction, citation),
        results={key: read_object(Path(path)) for key, path in (_named(r) for r in results or [])},
        command=command,
        force=force,
    )
    size = sum(file.stat().st_size for file in out.iterdir()) / 1e6
    say(f"wrote {out} ({manifest.name}, {size:.1f} MB); use it with: {use}")


def read_source(text: str) -> Source:
    """A source from ``PATH[,weight=…][,scale=a-b][,split=FILE:part][,ignore=stage+stage]``.

    Raises
    ------
    ConfigurationError
        If an option is unknown or has an impossible value.
    FileFormatError
        If the file of a split can't be read.
    """
    from punnet.train.detector.config import Source

    path, *options = re.split(r",(?=\w+=)", text)  # a path may hold commas of its own
    values: dict[str, Any] = {}
    for option in options:
        key, _, value = option.partition("=")
        try:
            if key not in SOURCE_OPTIONS:
                raise ValueError(f"no option '{key}'")
            name, read = SOURCE_OPTIONS[key]
            values[name] = read(value)
        except ValueError as error:
            raise ConfigurationError(
                f"--data {text}: {option}: {error}; give weight=2, scale=0.5-1.2, split=LIST.json:train or "
                "ignore=overripe"
            ) from error
    return Source(Path(path), **values)


def _range(text: str) -> tuple[float, float]:
    """Two numbers from ``a-b``."""
    least, separator, most = text.partition("-")
    if not separator:
        raise ValueError("two numbers are needed")
    return float(least), float(most)


def _listed(text: str) -> tuple[str | int, ...]:
    """The images of a part of a split: ``FILE:part``, or ``strawdi:part`` for the one that comes with Punnet."""
    from punnet.data.splits import read_split
    from punnet.data.splits.part import FIXED_SPLIT

    file, _, part = text.rpartition(":")
    if not file:
        raise ValueError("a part is needed behind a colon")
    parts = read_split(str(files("punnet.data.splits").joinpath(FIXED_SPLIT)) if file == "strawdi" else file)
    if part not in parts:
        raise ValueError(f"no part '{part}'; there are {', '.join(parts)}")
    return tuple(parts[part])


def _stages(text: str) -> tuple[str, ...]:
    """Stages of ripeness from ``a+b``."""
    from punnet.data.dataset import STAGES

    stages = tuple(text.split("+"))
    if unknown := sorted(set(stages) - set(STAGES)):
        raise ValueError(f"no stage '{unknown[0]}'; there are {', '.join(STAGES)}")
    return stages


SOURCE_OPTIONS: dict[str, tuple[str, Callable[[str], Any]]] = {
    "weight": ("weight", float),
    "scale": ("scale", _range),
    "split": ("images", _listed),
    "ignore": ("ignored", _stages),
}


def _named(text: str) -> tuple[str, str]:
    name, separator, path = text.partition("=")
    if not separator:
        raise ConfigurationError(f"--results {text}: give NAME=FILE.json")
    return name, path


def need_pytorch() -> None:
    """Say how to install PyTorch if it is missing.

    Raises
    ------
    ConfigurationError
        If it is.
    """
    from importlib.util import find_spec

    missing = [
        name for name in ("torch", "torchvision", "lightning", "timm", "onnx") if find_spec(name) is None
    ]
    if missing:
        raise ConfigurationError(
            f"training needs {', '.join(missing)}: {sys.executable} -m pip install 'punnet[train]'"
        )
