"""``punnet demos convert``: demonstrations of any format in, Punnet's folder or a LeRobot dataset out."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import busy, counted_progress, note, print_json, say
from punnet.cli.demos_options import DemoFormatName, DemoPath
from punnet.cli.options import Force, Json, OutFolder

if TYPE_CHECKING:
    from punnet.data.demos import DemonstrationSet

__all__ = ["DemoTarget", "convert"]


class DemoTarget(StrEnum):
    """Formats that are written."""

    PUNNET = "punnet"
    LEROBOT = "lerobot"


def convert(
    path: DemoPath,
    out: OutFolder,
    to: Annotated[DemoTarget, typer.Option("--to", help="What to write.")] = DemoTarget.PUNNET,
    data_format: DemoFormatName = None,
    fps: Annotated[float, typer.Option("--fps", help="Frames per second of a LeRobot dataset.")] = 30.0,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            help="How long a reach takes whose source does not tell (LeRobot).",
            show_default=False,
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Convert demonstrations to Punnet's folder, without loss, or to a LeRobotDataset v3.

    What can't be read is left out, said so, and makes the exit code 1.
    """
    from punnet.data.demos import read_readable_demos

    with busy("reading"):
        reading = read_readable_demos(path, data_format)
    left_out = [str(fault) for fault in reading.left_out]
    for message in left_out:
        note(f"left out: {message}")
    demonstrations = reading.demonstrations()
    losses = _write(demonstrations, out, to, fps, seconds, force=force)
    for loss in losses:
        note(f"not in {to}: {loss}")
    if as_json:
        summary = {"out": str(out), "to": str(to), "episodes": len(demonstrations)}
        print_json(summary | {"left_out": left_out, "lost": losses})
    else:
        say(f"wrote {out}: {len(demonstrations)} episodes of {len(demonstrations.targets)} targets")
    if left_out:
        note(f"{len({(fault.file, fault.episode) for fault in reading.left_out})} episodes left out")
        raise typer.Exit(1)


def _write(
    demonstrations: DemonstrationSet,
    out: Path,
    to: DemoTarget,
    fps: float,
    seconds: float | None,
    *,
    force: bool,
) -> list[str]:
    """Write it; say what the format has no place for."""
    from punnet.data.demos import write_lerobot, write_punnet_folder

    if to is DemoTarget.PUNNET:
        with busy("writing"):
            return write_punnet_folder(demonstrations, out, force=force)
    with counted_progress("writing episodes") as progress:
        return write_lerobot(demonstrations, out, fps=fps, seconds=seconds, force=force, progress=progress)
