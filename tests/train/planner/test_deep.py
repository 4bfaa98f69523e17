"""Training of a deep-ProMP, stage by stage."""

from pathlib import Path

import numpy as np
import pytest

from punnet.errors import ConfigurationError
from punnet.planning.reaches import Movements, Reaches
from punnet.train.planner import PlannerConfig, fit_deep_promp
from punnet.train.planner.stages import CURVE_FILE

SHORT = {
    "reconstruction_epochs": 2,
    "epochs": 200,
    "tuning_epochs": 1,
    "learning_rate": 1e-3,
    "trunk": ((32, 16),),
}


@pytest.fixture(scope="module")
def reaches() -> Reaches:
    """Six targets whose movement depends on where the box is."""
    rng = np.random.default_rng(0)
    boxes = np.column_stack((rng.uniform(0.0, 0.7, (6, 2)), np.zeros((6, 2))))
    boxes[:, 2:] = boxes[:, :2] + 0.2
    pictures = np.full((6, 128, 128, 3), 60, dtype=np.uint8)
    for picture, box in zip(pictures, (128 * boxes).astype(int), strict=True):
        picture[box[1] : box[3], box[0] : box[2]] = 255
    mean = np.ones((6, 7, 8)) * boxes[:, :1, None]
    covariance = np.tile(1e-3 * np.eye(56), (6, 1, 1))
    movements = Movements(mean, covariance)
    return Reaches(
        pictures=pictures,
        boxes=boxes,
        targets=np.arange(6),
        ends=mean[:, :, -1],
        target_ids=tuple("abcdef"),
        groups=("p", "p", "q", "q", "r", "r"),
        joint=movements,
        pose=movements,
        points=np.full((6, 3), np.nan),
        suspects=np.zeros(6, dtype=bool),
    )


@pytest.mark.parametrize("kind", ["direct", "ae", "cvae"])
def test_each_kind_trains_and_a_finished_stage_is_only_read_again(
    kind: str, reaches: Reaches, tmp_path: Path
) -> None:
    config = PlannerConfig(kind=kind, space="joint", **SHORT)
    told: list[str] = []
    fitted = fit_deep_promp(config, reaches, seed=3, folder=tmp_path, progress=told.append)
    stages = {"movements"} if kind == "direct" else {"reconstruction", "movements", "tuning"}
    assert fitted.curves.keys() == stages
    assert told
    found = fitted.predict(reaches)
    assert len(found) == len(reaches)
    assert np.linalg.eigvalsh(found.covariance).min() > 0
    told.clear()
    again = fit_deep_promp(config, reaches, seed=3, folder=tmp_path, progress=told.append)
    assert not told
    np.testing.assert_array_equal(again.predict(reaches).mean, found.mean)
    assert fitted.latents(reaches).shape == (6, 256)


def test_movements_are_learnt(reaches: Reaches, tmp_path: Path) -> None:
    config = PlannerConfig(kind="cvae", space="joint", tuned=False, **SHORT)
    fitted = fit_deep_promp(config, reaches, seed=0, folder=tmp_path, progress=lambda line: None)
    losses = fitted.curves["movements"]
    assert losses[-1] < 0.1 * losses[0]
    assert fitted.name == "cvae-joint"


def test_latents_may_be_drawn(reaches: Reaches, tmp_path: Path) -> None:
    config = PlannerConfig(kind="cvae", space="joint", tuned=False, sampled_latents=True, **SHORT)
    fitted = fit_deep_promp(config, reaches, seed=0, folder=tmp_path / "a", progress=lambda line: None)
    again = fit_deep_promp(config, reaches, seed=0, folder=tmp_path / "b", progress=lambda line: None)
    np.testing.assert_array_equal(fitted.predict(reaches).mean, again.predict(reaches).mean)
    losses = fitted.curves["movements"]
    assert losses[-1] < 0.5 * losses[0]
    with pytest.raises(ConfigurationError, match="variational encoder"):
        PlannerConfig(kind="ae", sampled_latents=True)


def test_a_damaged_checkpoint_is_said(reaches: Reaches, tmp_path: Path) -> None:
    config = PlannerConfig(kind="ae", space="joint", **SHORT)
    folder = tmp_path / "reconstruction-plain"
    folder.mkdir()
    (folder / CURVE_FILE).write_text("[1.0]")
    (folder / "last.ckpt").write_bytes(b"no checkpoint")
    with pytest.raises(ConfigurationError, match="not a checkpoint of this network"):
        fit_deep_promp(config, reaches, seed=0, folder=tmp_path, progress=lambda line: None)


def test_settings_are_checked() -> None:
    with pytest.raises(ConfigurationError, match="kind must be one of"):
        PlannerConfig(kind="gan")  # type: ignore[arg-type]
    with pytest.raises(ConfigurationError, match="trunk must be one or seven"):
        PlannerConfig(trunk=((512, 256),) * 2)
    with pytest.raises(ConfigurationError, match="epochs must be positive"):
        PlannerConfig(epochs=0)
