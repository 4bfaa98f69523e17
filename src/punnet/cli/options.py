"""Options that several commands share."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

__all__ = [
    "ArmName",
    "CameraFile",
    "DepthFile",
    "DetectorName",
    "Force",
    "Json",
    "Oracle",
    "OutFolder",
    "PlannerBundle",
    "PlannerName",
    "RgbFile",
    "Seed",
    "SpaceName",
]


class SpaceName(StrEnum):
    """What movements are of: seven joints, or the flange's pose."""

    JOINT = "joint"
    TASK = "task"


OutFolder = Annotated[
    Path,
    typer.Option(
        "--out", "-o", help="Folder for the results; made if it does not exist.", show_default=False
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace the folder if punnet made it earlier.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of everything random.")]
Oracle = Annotated[
    bool,
    typer.Option("--oracle", help="True poses and weights in place of perception: what it could do at best."),
]
DetectorName = Annotated[
    str | None,
    typer.Option(
        "--detector",
        help="A model's name (see punnet models) or folder, or: colour. Without it the one that suits the pictures.",
        show_default=False,
    ),
]
PlannerName = Annotated[
    str | None,
    typer.Option(
        "--planner",
        help="What plans the reaches: promp-depth, deep-promp or fused (default).",
        show_default=False,
    ),
]
RgbFile = Annotated[Path, typer.Option("--rgb", help="Photograph, PNG or JPEG.", show_default=False)]
DepthFile = Annotated[
    Path,
    typer.Option(
        "--depth",
        help="16-bit PNG aligned to the photograph, millimetres unless the camera file says.",
        show_default=False,
    ),
]
CameraFile = Annotated[
    Path,
    typer.Option(
        "--camera",
        help="JSON with width height fx fy cx cy; depth_scale and T_base_camera if known.",
        show_default=False,
    ),
]
ArmName = Annotated[
    str,
    typer.Option(
        "--arm",
        help="The arm: panda, ur5 or xarm7, or a JSON file that names its model (URDF or MJCF), mount and limits.",
    ),
]
PlannerBundle = Annotated[
    str | None,
    typer.Option(
        "--planner-bundle",
        help="What the planner learnt: a bundle's name or folder (NAME:MODEL for another of its models), or a training "
        "run. Without it what comes with punnet.",
        show_default=False,
    ),
]
