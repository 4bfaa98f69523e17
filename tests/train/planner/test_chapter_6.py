"""Chapter 6 of the thesis: networks trained once, their tables and figures."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from punnet.errors import ConfigurationError, FileFormatError, OutputExistsError, ShapeError
from punnet.planning.learned import MovementModel
from punnet.planning.reaches import Movements, Reaches
from punnet.train.planner import chapter_6
from punnet.train.planner.chapter_6 import CHAPTER_MODELS, ChapterSix, train_chapter
from punnet.train.planner.charts_6 import (
    draw_figure_6_9,
    draw_figure_6_10,
    draw_figure_6_14,
)
from punnet.train.planner.latents import embedding, separability
from punnet.train.planner.tables_6 import (
    chapter_errors,
    table_6_1,
    table_6_2,
    table_6_3,
    table_6_4,
)

SHORT = {"reconstruction_epochs": 1, "epochs": 2, "tuning_epochs": 1, "trunk": [[8, 8]]}


def made(plants: str, seed: int) -> Reaches:
    """Two photographs each of a target a plant; ends and boxes belong together."""
    rng = np.random.default_rng(seed)
    M = len(plants)
    corner = rng.uniform(0.1, 0.7, (M, 2))
    boxes = np.repeat(np.column_stack((corner, corner + 0.2)), 2, axis=0)
    joint = np.zeros((M, 7, 8)) + np.array([0.0, -0.8, 0.0, -2.3, 0.0, 2.4, 0.8])[None, :, None]
    joint += 0.2 * corner[:, :1, None]
    pose = np.zeros((M, 7, 8))
    pose[:, 0], pose[:, 1:3], pose[:, 4] = 0.6, corner[:, :, None], 1.0
    covariance = np.tile(1e-4 * np.eye(56), (M, 1, 1))
    return Reaches(
        pictures=rng.integers(0, 255, (2 * M, 128, 128, 3), dtype=np.uint8),
        boxes=boxes,
        targets=np.repeat(np.arange(M), 2),
        ends=np.repeat(pose[:, :, -1], 2, axis=0),
        target_ids=tuple(f"berry-{plant}" for plant in plants),
        groups=tuple(plants),
        joint=Movements(joint, covariance),
        pose=Movements(pose, covariance),
        points=np.full((M, 3), np.nan),
        suspects=np.zeros(M, dtype=bool),
        name=plants,
    )


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("chapter") / "runs"


@pytest.fixture(scope="module")
def chapter(runs: Path) -> ChapterSix:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chapter_6, "QUICK", SHORT)
        return trained(runs)


def trained(runs: Path, seeds: tuple[int, ...] = (0,), unseen: str = "uvwxyz") -> ChapterSix:
    return train_chapter(
        made("abcdefgh", 0),
        made(unseen, 1),
        folder=runs,
        seeds=seeds,
        quick=True,
        workers=1,
        progress=lambda line: None,
    )


def test_all_fourteen_are_there_and_a_second_call_only_reads(chapter: ChapterSix, runs: Path) -> None:
    assert len(CHAPTER_MODELS) == 14
    assert set(chapter.outcomes) == set(CHAPTER_MODELS)
    assert not list(runs.glob("seed-0/work-*"))
    written = {file: file.stat().st_mtime_ns for file in runs.glob("seed-0/*")}
    again = trained(runs)
    assert written == {file: file.stat().st_mtime_ns for file in runs.glob("seed-0/*")}
    for name, (outcome,) in again.outcomes.items():
        np.testing.assert_array_equal(outcome.movements.mean, chapter.outcomes[name][0].movements.mean)
        assert outcome.latents.shape == (16, 256)
        assert outcome.unseen_latents.shape == (12, 256)


def test_tuning_goes_on_from_the_untuned_network(chapter: ChapterSix) -> None:
    before, after = chapter.outcomes["cvae-task"][0], chapter.outcomes["l-cvae-task"][0]
    assert list(before.curves["movements"]) == list(after.curves["movements"])
    assert "tuning" not in before.curves
    assert not np.array_equal(before.latents, after.latents)


def test_tables_have_the_thesis_numbers_and_our_own_errors(chapter: ChapterSix) -> None:
    errors = chapter_errors(chapter)
    last = chapter.unseen.basis.phi([1.0])[0]
    off = (chapter.outcomes["vae-task"][0].movements.mean @ last)[:, :3]
    off = off - (chapter.unseen.pose.mean @ last)[chapter.unseen.targets, :3]
    expected = np.linalg.norm(off, axis=1).mean()
    rows = {row[0]: row for row in table_6_3(errors).rows}
    assert rows["vae-task"][1] == f"{expected:.3f} / 0.03"
    assert rows["cvae-joint"][3].endswith(" / 0.18")
    assert rows["ridge-2-task"][1].endswith(" / –")
    first, second = table_6_1(errors), table_6_2(errors)
    assert first.rows[3][first.columns.index("ae-joint")].endswith(" / 37.1")
    assert second.rows[1][second.columns.index("cvae-task")].endswith(" / 0.88")
    latents = table_6_4(chapter, separability)
    assert [row[1].split(" / ")[1] for row in latents.rows] == [
        "0.616",
        "0.482",
        "0.482",
        "0.424",
        "0.352",
        "0.352",
    ]
    json.dumps([first.to_json(), latents.to_json(), errors.to_json()], allow_nan=False)


def test_figures_are_drawn(chapter: ChapterSix, tmp_path: Path) -> None:
    assert len(draw_figure_6_9(chapter, tmp_path / "9.png")["ae-joint"]) == 2
    drawn = draw_figure_6_10(chapter, tmp_path / "10.png")
    assert drawn["target"] in chapter.unseen.target_ids
    draw_figure_6_14(chapter, tmp_path / "14.png")
    assert all((tmp_path / f"{name}.png").read_bytes()[:4] == b"\x89PNG" for name in (9, 10, 14))


def test_networks_are_kept_as_graphs(chapter: ChapterSix) -> None:
    for name in ("direct-joint", "l-cvae-task"):
        outcome = chapter.outcomes[name][0]
        model = MovementModel(outcome.graph, name, outcome.space, chapter.unseen.basis)
        again = model.predict(chapter.unseen)
        np.testing.assert_allclose(again.mean, outcome.movements.mean, atol=5e-3)


def test_spread_stands_beside_the_mean_of_several_seeds(chapter: ChapterSix) -> None:
    one = chapter.outcomes["ae-task"][0]
    other = replace(one, seed=1, movements=Movements(one.movements.mean * 1.1, one.movements.covariance))
    both = replace(chapter, outcomes={**chapter.outcomes, "ae-task": (one, other)})
    errors = chapter_errors(both, ("task",))
    values = errors.values("ae-task", "position_m")
    cell = next(row[1] for row in table_6_3(errors).rows if row[0] == "ae-task")
    assert cell == f"{values.mean():.3f} ± {abs(values[0] - values[1]) / np.sqrt(2):.3f} / 0.04"


def test_the_same_plants_are_refused(runs: Path, tmp_path: Path, chapter: ChapterSix) -> None:
    with pytest.raises(ConfigurationError, match="plant a is also in"):
        trained(tmp_path / "new", unseen="axyz")
    with pytest.raises(OutputExistsError, match="unseen"):
        trained(runs, unseen="uvw")


def test_a_damaged_outcome_is_named(chapter: ChapterSix, runs: Path) -> None:
    file = runs / "seed-0" / "ae-task.npz"
    whole = file.read_bytes()
    try:
        file.write_bytes(whole[:200])
        with pytest.raises(FileFormatError, match="ae-task"):
            trained(runs)
    finally:
        file.write_bytes(whole)


def test_separability_by_hand_and_its_bad_input() -> None:
    # Two pairs at distance 10, each 1 from its centre: Davies–Bouldin (1 + 1) / 10.
    points = np.array([[-1.0, 0.0], [1.0, 0.0], [9.0, 0.0], [11.0, 0.0]])
    assert separability(points, np.array([0, 0, 1, 1]), 0)[1] == pytest.approx(0.2)
    for targets in ([0, 0, 0, 0], [0, 1, 2, 3]):
        with pytest.raises(ShapeError, match="several"):
            separability(points, np.array(targets), 0)
    with pytest.raises(ShapeError, match="four"):
        embedding(points[:3], 0)
