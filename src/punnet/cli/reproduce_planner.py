"""``punnet reproduce table-6-1`` … ``fig-6-14``: chapter 6 of the thesis, all of one set of trained networks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import counted_progress, note, print_json, say, whisper
from punnet.cli.options import Json
from punnet.outputs import FIGURES, require_suffix

if TYPE_CHECKING:
    from collections.abc import Callable

    from punnet.data.thesis_tables import MarkdownTable
    from punnet.sim.demonstrations_scene import SceneKind
    from punnet.train.planner.chapter_6 import ChapterSix

__all__ = ["register_planner"]

CONFIGURATIONS, REPEATS = 25, 10
LEARNT, UNSEEN, EXECUTED, NETWORKS = "learnt", "unseen", "executed", "networks"
LEARNT_SEED, UNSEEN_SEED, EXECUTED_SEED = 0, 1, 2

Runs = Annotated[
    Path,
    typer.Option("--runs", help="Folder of the trained networks; what is there is not trained again."),
]
Learnt = Annotated[
    Path | None,
    typer.Option("--data", help="Demonstrations to learn from; without it 25 × 10 are simulated (seed 0)."),
]
Unseen = Annotated[
    Path | None,
    typer.Option("--unseen", help="Demonstrations on other plants to be judged on; without it seed 1."),
]
Quick = Annotated[bool, typer.Option("--quick", help="Short trainings: minutes, not an hour.")]
Seeds = Annotated[int, typer.Option("--seeds", min=1, help="Trainings of each network, for the spread.")]
Workers = Annotated[int, typer.Option("--workers", "-j", min=1, help="Processes that train at a time.")]
Out = Annotated[Path | None, typer.Option("--out", "-o", help="Picture; by default in the runs' folder.")]
DEFAULT_RUNS = Path("runs/chapter-6")


def register_planner(group: typer.Typer) -> None:
    """Add the commands to the group ``reproduce``."""
    for name, command in (
        ("table-6-1", table_6_1),
        ("table-6-2", table_6_2),
        ("table-6-3", table_6_3),
        ("table-6-4", table_6_4),
        ("fig-6-8", fig_6_8),
        ("fig-6-9", fig_6_9),
        ("fig-6-10", fig_6_10),
        ("fig-6-12", fig_6_12),
        ("fig-6-14", fig_6_14),
    ):
        short = "" if command is fig_6_8 else " --quick"
        group.command(name, epilog=f"Example: punnet reproduce {name}{short}")(command)


def table_6_1(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    quick: Quick = False,
    seeds: Seeds = 1,
    workers: Workers = 1,
    as_json: Json = False,
) -> None:
    """Eq. 5.13 of each joint on plants not seen, in 1e-4: ours / the thesis'."""
    from punnet.train.planner import tables_6

    chapter = _chapter(runs, data, unseen, quick, seeds, workers)
    errors = tables_6.chapter_errors(chapter, ("joint",))
    _show(tables_6.table_6_1(errors), chapter, as_json, errors.to_json())


def table_6_2(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    quick: Quick = False,
    seeds: Seeds = 1,
    workers: Workers = 1,
    as_json: Json = False,
) -> None:
    """Eq. 5.13 of each task coordinate on plants not seen, in 1e-4: ours / the thesis'."""
    from punnet.train.planner import tables_6

    chapter = _chapter(runs, data, unseen, quick, seeds, workers)
    errors = tables_6.chapter_errors(chapter, ("task",))
    _show(tables_6.table_6_2(errors), chapter, as_json, errors.to_json())


def table_6_3(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    quick: Quick = False,
    seeds: Seeds = 1,
    workers: Workers = 1,
    as_json: Json = False,
) -> None:
    """Position and orientation at the final point (Eq. 6.2), joint against task space: ours / the thesis'."""
    from punnet.train.planner import tables_6

    chapter = _chapter(runs, data, unseen, quick, seeds, workers)
    errors = tables_6.chapter_errors(chapter)
    _show(tables_6.table_6_3(errors), chapter, as_json, errors.to_json())


def table_6_4(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    quick: Quick = False,
    seeds: Seeds = 1,
    workers: Workers = 1,
    as_json: Json = False,
) -> None:
    """How well the latent vectors keep targets apart (Davies–Bouldin, lower is better): ours / the thesis'."""
    from punnet.train.planner import tables_6
    from punnet.train.planner.latents import separability

    chapter = _chapter(runs, data, unseen, quick, seeds, workers)
    _show(tables_6.table_6_4(chapter, separability), chapter, as_json)


def fig_6_8(data: Learnt = None, runs: Runs = DEFAULT_RUNS, out: Out = None, as_json: Json = False) -> None:
    """Error of the reconstructed movements by the number of weights, joint space."""
    from punnet.cli.train_weight import need_training
    from punnet.data.demos import read_demos
    from punnet.movement import choose_basis

    need_training()
    picture = _picture(runs, out, "fig-6-8")
    demonstrations = read_demos(_simulated(runs, LEARNT, LEARNT_SEED) if data is None else data)
    choice = choose_basis([episode.joints.values for episode in demonstrations if episode.joints is not None])
    choice.plot(picture)
    mean = choice.mse.mean(axis=1)
    if as_json:
        print_json(
            {
                "figure": "6.8",
                "counts": choice.counts.tolist(),
                "mse_rad2": mean.tolist(),
                "chosen": choice.basis.count,
                "picture": str(picture),
            }
        )
        return
    for count, value in zip(choice.counts, mean, strict=True):
        say(f"{count:3d} weights: {value:.3g} rad²")
    say(f"chosen: {choice.basis.count}; the thesis takes 8; see {picture}")


def fig_6_9(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    quick: Quick = False,
    workers: Workers = 1,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Training loss of the MLPs, logarithmic."""
    from punnet.train.planner.charts_6 import draw_figure_6_9

    picture = _picture(runs, out, "fig-6-9")
    _draw("6.9", draw_figure_6_9, _chapter(runs, data, unseen, quick, 1, workers), picture, as_json)


def fig_6_10(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    quick: Quick = False,
    workers: Workers = 1,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """The cVAE's prediction of joints on an unseen target, beside what was demonstrated."""
    from punnet.train.planner.charts_6 import draw_figure_6_10

    picture = _picture(runs, out, "fig-6-10")
    _draw("6.10", draw_figure_6_10, _chapter(runs, data, unseen, quick, 1, workers), picture, as_json)


def fig_6_12(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    before: Annotated[
        Path | None,
        typer.Option(
            "--before",
            help="Simulated demonstrations before whose plants the reaches are carried out; without it 5 plants of 5 targets "
            "(scene multi, seed 2).",
        ),
    ] = None,
    quick: Quick = False,
    workers: Workers = 1,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Reaches to new plants carried out in the simulator: where the arm ends before and after tuning, mean and ±2σ."""
    from punnet.data.demos import read_demos
    from punnet.planning.learned import MovementModel
    from punnet.planning.reaches import reaches_from
    from punnet.train.planner.charts_6 import draw_figure_6_12
    from punnet.train.planner.executed import execute_predictions
    from punnet.train.planner.tables_6 import TUNED, figure_6_12

    picture = _picture(runs, out, "fig-6-12")
    chapter = _chapter(runs, data, unseen, quick, 1, workers)
    demonstrations = read_demos(
        _simulated(runs, EXECUTED, EXECUTED_SEED, "multi") if before is None else before
    )
    reaches = reaches_from(demonstrations, chapter.learnt.basis)
    names = [
        f"{prefix}{kind}-{space}" for space in ("joint", "task") for kind in TUNED for prefix in ("", "l-")
    ]
    predictions = {}
    for name in names:
        outcome = chapter.outcomes[name][0]
        model = MovementModel(outcome.graph, name, outcome.space, reaches.basis, reaches.duration)
        predictions[name] = (outcome.space, model.predict(reaches))
    plants = len(set(reaches.groups))
    with counted_progress("carrying out") as show:
        executed = execute_predictions(
            predictions, demonstrations, reaches, workers=workers, progress=lambda done: show(done, plants)
        )
    drawn = draw_figure_6_12(executed, picture)
    table = figure_6_12(executed)
    if as_json:
        print_json({**table.to_json(), "picture": str(picture), **drawn, "reaches": executed.to_json()})
        return
    say(table.markdown())
    note(
        f"{len(reaches.target_ids)} targets of {plants} plants not seen, each at the mean and at ±2σ; see {picture}"
    )


def fig_6_14(
    runs: Runs = DEFAULT_RUNS,
    data: Learnt = None,
    unseen: Unseen = None,
    quick: Quick = False,
    workers: Workers = 1,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Latent vectors in the plane (t-SNE), before and after tuning."""
    from punnet.train.planner.charts_6 import draw_figure_6_14

    picture = _picture(runs, out, "fig-6-14")
    _draw("6.14", draw_figure_6_14, _chapter(runs, data, unseen, quick, 1, workers), picture, as_json)


def _chapter(
    runs: Path, data: Path | None, unseen: Path | None, quick: bool, seeds: int, workers: int
) -> ChapterSix:
    """All networks, trained now if they are not there."""
    from punnet.cli.train_weight import need_training

    need_training()
    from punnet.data.demos import read_demos
    from punnet.planning.reaches import reaches_from
    from punnet.train.planner.chapter_6 import train_chapter

    given = [None if place is None else reaches_from(read_demos(place)) for place in (data, unseen)]
    learnt, other = (
        reaches_from(read_demos(_simulated(runs, name, seed))) if reaches is None else reaches
        for reaches, name, seed in zip(given, (LEARNT, UNSEEN), (LEARNT_SEED, UNSEEN_SEED), strict=True)
    )
    return train_chapter(
        learnt,
        other,
        folder=runs / (f"{NETWORKS}-quick" if quick else NETWORKS),
        seeds=range(seeds),
        quick=quick,
        workers=workers,
        progress=whisper,
    )


def _simulated(runs: Path, name: str, seed: int, scene: SceneKind = "single") -> Path:
    """Demonstrations in the runs' folder, made now if they are not there."""
    import json

    from punnet.sim.demonstrations_factory import simulate_demonstration_set

    place = runs / name
    description = place / "demonstrations.json"
    if description.is_file() and json.loads(description.read_text()).get("complete"):
        return place
    with counted_progress("simulating") as show:
        simulate_demonstration_set(
            place,
            configurations=CONFIGURATIONS,
            repeats=REPEATS,
            seed=seed,
            scene=scene,
            progress=lambda done: show(done, CONFIGURATIONS * REPEATS),
        )
    return place


def _show(
    table: MarkdownTable, chapter: ChapterSix, as_json: bool, errors: dict[str, Any] | None = None
) -> None:
    if as_json:
        beside = {} if errors is None else {"errors": errors}
        print_json(
            {**table.to_json(), "settings": chapter.settings, "seconds": round(chapter.seconds), **beside}
        )
        return
    say(table.markdown())
    note(
        f"ours / the thesis'; {len(chapter.unseen.target_ids)} targets on plants not seen, trained on "
        f"{len(chapter.learnt.target_ids)} in {chapter.seconds:.0f} s"
    )


def _draw(
    figure: str,
    draw: Callable[[ChapterSix, Path], dict[str, Any] | None],
    chapter: ChapterSix,
    picture: Path,
    as_json: bool,
) -> None:
    drawn = draw(chapter, picture) or {}
    if as_json:
        print_json({"figure": figure, "picture": str(picture), "settings": chapter.settings, **drawn})
    else:
        say(f"wrote {picture}")


def _picture(runs: Path, out: Path | None, name: str) -> Path:
    picture = runs / f"{name}.png" if out is None else out
    require_suffix(picture, *FIGURES)
    picture.parent.mkdir(parents=True, exist_ok=True)
    return picture
