"""``punnet train planner``: from demonstrations to a planner that tells a reach from one photograph."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from punnet.cli.console import note, print_json, say, whisper
from punnet.cli.options import Json, Seed, SpaceName
from punnet.cli.train_weight import need_training
from punnet.errors import FileFormatError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from punnet.data.demos import DemonstrationSet

__all__ = ["read_all_demos", "register_planner"]

PICTURES = (".png", ".jpg", ".jpeg")


def register_planner(group: typer.Typer) -> None:
    """Add the command to the group ``train``."""
    group.command("planner", epilog="Example: punnet train planner --data demos --out runs/reach")(planner)


def planner(
    data: Annotated[
        list[str],
        typer.Option(
            "--data",
            help="Demonstrations with home photograph, target box, joints and poses (see punnet demos). May be given "
            "more than once.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            help="Folder of the run; a stopped run goes on. By default runs/KIND-SPACE.",
            show_default=False,
        ),
    ] = None,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            "--kind",
            "-k",
            help="full (the default), or of the thesis: direct, ae, vae, cvae. Several go into one bundle, the first as "
            "its default.",
            show_default=False,
        ),
    ] = None,
    space: Annotated[SpaceName, typer.Option("--space", help="What it predicts.")] = SpaceName.TASK,
    tuned: Annotated[
        bool, typer.Option("--tuned/--untuned", help="Whether encoders are tuned by the error at the end.")
    ] = True,
    seed: Seed = 0,
    config: Annotated[
        Path | None,
        typer.Option(
            "--config", help='JSON with settings in place of a network\'s own, e.g. {"epochs": 100}.'
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="The settings of a short training, to try things out.")
    ] = False,
    unlabelled: Annotated[
        Path | None,
        typer.Option("--unlabelled", help="Folder of further photographs for the autoencoders."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Train a planner on demonstrated reaches: one colour photograph and a box in, a distribution of reaches out.

    full is fitted in seconds; the networks of the thesis take minutes to hours. Measure it with punnet evaluate planner.
    """
    need_training()
    from punnet.train.planner.fitting import planner_config
    from punnet.train.planner.training import train_planners
    from punnet.train.runs import read_object

    kinds = kind or ["full"]
    changes = {} if config is None else read_object(config)
    configs = [
        planner_config(
            name,
            {"space": space.value} | ({} if name == "full" else {"tuned": tuned, **changes}),
            quick=quick,
        )
        for name in kinds
    ]
    run = train_planners(
        configs,
        read_all_demos(data),
        data=[Path(source).name for source in data],
        folder=out or Path("runs") / "+".join(config.name for config in configs),
        seed=seed,
        progress=whisper,
        unlabelled=None if unlabelled is None else _pictures(unlabelled),
    )
    if as_json:
        print_json({"run": str(run.folder), "bundle": str(run.bundle), "results": dict(run.results)})
        return
    for name, result in run.results.items():
        say(f"{name}: {_sentence(result)}")
    say(
        f"trained {run.folder}; plan with: punnet plan --planner {run.folder} --rgb PHOTO --target x0,y0,x1,y1; measure with: "
        f"punnet evaluate planner --planner {run.folder} --data OTHER"
    )


def read_all_demos(paths: list[str]) -> DemonstrationSet:
    """Demonstrations of some sources as one set."""
    from punnet.data.demos import DemonstrationSet, read_demos

    sets = [read_demos(path) for path in paths]
    if len(sets) == 1:
        return sets[0]
    return DemonstrationSet(
        tuple(episode for part in sets for episode in part), name=" + ".join(part.name for part in sets)
    )


def _pictures(folder: Path) -> NDArray[np.uint8]:
    """(U, 128, 128, 3) of a folder's pictures; what can't be read is said and left out."""
    import numpy as np

    from punnet.data.demos import target_picture
    from punnet.planning.reaches import SIDE
    from punnet.scene import read_image

    files = sorted(file for file in folder.glob("**/*") if file.suffix.lower() in PICTURES)
    found = []
    for file in files:
        try:
            found.append(target_picture(read_image(file), None, SIDE))
        except FileFormatError as error:
            note(f"left out: {error}")
    if not found:
        raise FileFormatError(f"{folder}: no PNG or JPEG pictures in it")
    return np.array(found, dtype=np.uint8)


def _sentence(result: dict[str, dict[str, float]]) -> str:
    if "loss" in result:
        return "loss " + ", ".join(f"{stage} {value:.3g}" for stage, value in result["loss"].items())
    off = result["left_out"]
    if "position_m" in off:
        return (
            f"on plants or scenes left out in turn its ends are {off['position_m'] * 1000:.1f} mm and "
            f"{off['orientation']:.3f} (Eq. 6.2) off"
        )
    return f"on plants or scenes left out in turn the joints end {off['joints_rad']:.3f} rad off"
