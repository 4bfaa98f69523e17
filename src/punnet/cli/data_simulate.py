"""``punnet data simulate``: labelled RGB-D images of simulated plants."""

from __future__ import annotations

from typing import Annotated

import typer

from punnet.cli.console import counted_progress, note, print_json, say
from punnet.cli.options import Force, Json, OutFolder, Seed

__all__ = ["simulate"]


def simulate(
    out: OutFolder,
    images: Annotated[
        int | None,
        typer.Option(
            "--images",
            "-n",
            min=1,
            help="How many; three views a plant. Without it 300, of dataset-1 1596.",
            show_default=False,
        ),
    ] = None,
    seed: Seed = 0,
    protocol: Annotated[
        str,
        typer.Option(
            "--protocol",
            help="varied: plants as different as can be. night: the same under a lamp. "
            "dataset-1: as the thesis' set of weighed berries.",
        ),
    ] = "varied",
    workers: Annotated[
        int, typer.Option("--workers", "-j", min=1, help="Processes that work at a time.")
    ] = 1,
    backend: Annotated[
        str, typer.Option("--backend", help="loky: this machine's cores; ray: the machines of a Ray cluster.")
    ] = "loky",
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Make labelled RGB-D images: masks, key-points, ripeness, weight, depth. Started again, it goes on where it was."""
    import time

    from punnet.sim.dataset_factory import simulate_dataset
    from punnet.sim.protocols import protocol_of

    kind = protocol_of(protocol)
    total = images or kind.images
    started = time.monotonic()
    with counted_progress("images") as show:
        report = simulate_dataset(
            out,
            images=total,
            seed=seed,
            protocol=kind.name,
            workers=workers,
            backend=backend,  # type: ignore[arg-type]  # the factory names what it knows
            force=force,
            progress=lambda done: show(done, total),
        )
    seconds = time.monotonic() - started
    rate = report.made / seconds
    if as_json:
        print_json(
            {
                "folder": str(out),
                "images": report.images,
                "plants": report.plants,
                "annotations": report.annotations,
                "crowd": report.crowd,
                "made": report.made,
                "kept": report.kept,
                "megabytes": round(report.megabytes, 2),
                "seconds": round(seconds, 2),
                "images_per_second": round(rate, 3),
            }
        )
        return
    if report.kept:
        note(f"{report.kept} images of an earlier run were kept")
    say(
        f"wrote {out}: {report.images} images of {report.plants} plants, {report.annotations} berries "
        f"({report.crowd} hardly visible), {report.megabytes:.0f} MB; {rate:.1f} images/s"
    )
