"""``punnet evaluate planner``: how far planners end from demonstrated reaches of plants or scenes they have not seen."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import print_json, print_table, whisper
from punnet.cli.options import Json, Seed, SpaceName
from punnet.cli.train_weight import need_training
from punnet.errors import ConfigurationError

if TYPE_CHECKING:
    from punnet.planning.reaches import Reaches
    from punnet.train.planner.comparison import Measured

__all__ = ["COLUMNS", "register_planner", "row_of"]

COLUMNS = (
    "planner",
    "end mm>",
    "sure ones>",
    "along x>",
    "y and z>",
    "orientation>",
    "±2σ mm>",
    "±2σ orient.>",
    "50% holds>",
    "90% holds>",
    "tool mm>",
)
"""``end``: distance of the flange's final position, mm, over all and over those that the source does not call suspect;
along x and
across the picture likewise over those; ``tool``: distance of the tool from the grip point."""


def register_planner(group: typer.Typer) -> None:
    """Add the command to the group ``evaluate``."""
    group.command(
        "planner",
        epilog="Example: punnet evaluate planner --planner reach-sim --data demos --baselines",
    )(planner)


def planner(
    data: Annotated[
        list[str],
        typer.Option(
            "--data",
            help="Demonstrations with home photograph, target box, joints and poses. May be given more than once.",
            show_default=False,
        ),
    ],
    planner: Annotated[
        list[str] | None,
        typer.Option(
            "--planner",
            help="A trained planner: training run, bundle, or a bundle's name (NAME:MODEL for another of its models). It "
            "must not have learnt from the data. May be given more than once.",
            show_default=False,
        ),
    ] = None,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            "-k",
            help="full, direct, ae, vae, cvae: trained now, leaving each plant or scene of the data out in turn. May be "
            "given more than once.",
            show_default=False,
        ),
    ] = None,
    baselines: Annotated[
        bool,
        typer.Option(
            "--baselines",
            help="Also constant, nearest, ridge, Gaussian process and ProMP + depth, left out alike.",
        ),
    ] = False,
    space: Annotated[SpaceName, typer.Option("--space", help="Of --kind and --baselines.")] = SpaceName.TASK,
    tuned: Annotated[
        bool, typer.Option("--tuned/--untuned", help="Whether encoders are tuned by the error at the end.")
    ] = True,
    quick: Annotated[bool, typer.Option("--quick", help="Short trainings of --kind.")] = False,
    seeds: Annotated[
        int, typer.Option("--seeds", min=1, help="Trainings of --kind, each with another seed.")
    ] = 1,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="Folder for trainings of --kind, so that a stopped command goes on."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Errors at the final point (Eq. 6.2), along each axis, at ±2σ, and whether regions hold what they promise.

    Items that the data itself calls suspect are counted, and left out beside.
    """
    need_training()
    if not (planner or kind or baselines):
        raise ConfigurationError("nothing to measure: give --planner, --kind or --baselines")
    from punnet.cli.train_planner import read_all_demos
    from punnet.planning.reaches import reaches_from

    reaches = reaches_from(read_all_demos(data))
    measured = [found for source in planner or [] for found in _trained(source, reaches)]
    seeds_used = range(seed, seed + seeds)
    if kind or baselines:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) if out is None else out
            measured += _left_out(
                reaches, kind or [], baselines, space.value, tuned, quick, seeds_used, folder
            )
    if as_json:
        print_json({"data": reaches.name, "planners": [found.to_json() for found in measured]})
        return
    suspect = int(measured[0].runs[0].suspects.sum())
    print_table(
        f"{len(reaches)} reaches to {len(reaches.target_ids)} targets of {len(set(reaches.groups))} plants or scenes"
        + (f", {suspect} of them suspect" if suspect else ""),
        COLUMNS,
        [row_of(found.to_json()) for found in measured],
    )


def _trained(source: str, reaches: Reaches) -> list[Measured]:
    """A trained planner, and with it fused where the berries' places are known."""
    import numpy as np

    from punnet.planning import DeepProMPPlanner
    from punnet.planning.learned import planner_bundle
    from punnet.train.planner.baselines import fused
    from punnet.train.planner.comparison import measure

    model, settings, _ = planner_bundle(source)
    found = [measure(model, reaches)]
    if np.isfinite(reaches.points).all():
        whisper(f"{model.name}: conditioning on depth")
        found.append(measure(fused(DeepProMPPlanner(model, settings.demonstrated, settings.camera)), reaches))
    return found


def _left_out(
    reaches: Reaches,
    kinds: list[str],
    baselines: bool,
    space: Any,
    tuned: bool,
    quick: bool,
    seeds: range,
    folder: Path,
) -> list[Measured]:
    from punnet.train.planner.comparison import leave_groups_out, usable_baselines
    from punnet.train.planner.fitting import planner_config

    chosen: list[Any] = usable_baselines(reaches) if baselines else []
    chosen += [
        planner_config(kind, {"space": space} | ({} if kind == "full" else {"tuned": tuned}), quick=quick)
        for kind in kinds
    ]
    return [
        leave_groups_out(
            one,
            reaches,
            space=space,
            seeds=seeds if not isinstance(one, str) and one.kind != "full" else seeds[:1],
            folder=folder,
            progress=whisper,
        )
        for one in chosen
    ]


def row_of(found: dict[str, Any]) -> list[str]:
    """A line of the table from what :meth:`Measured.to_json` gives."""
    spread = found.get("spread")
    beside = f" ± {spread['position_m'] * 1e3:.1f}" if spread else ""
    tip = found["tool_from_grip_point_m"]
    return [
        found["planner"],
        f"{found['position_m'] * 1e3:.1f}{beside}",
        f"{found['position_not_suspect_m'] * 1e3:.1f}",
        f"{found['along_x_not_suspect_m'] * 1e3:.1f}",
        f"{found['across_not_suspect_m'] * 1e3:.1f}",
        f"{found['orientation']:.3f}",
        f"{found['position_2_sigma_m'] * 1e3:.1f}",
        f"{found['orientation_2_sigma']:.3f}",
        *(
            ["", ""]
            if found["coverage"] is None
            else [f"{found['coverage'][share]:.0%}" for share in ("0.5", "0.9")]
        ),
        "" if tip is None else f"{tip * 1e3:.1f}",
    ]
