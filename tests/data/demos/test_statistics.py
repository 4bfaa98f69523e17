from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from punnet.data.demos import DemonstrationSet, Episode, Trajectory
from punnet.data.demos.plot import draw_demonstrations
from punnet.data.demos.statistics import demonstration_statistics
from punnet.errors import OutputError, OutputExistsError


def test_counts_and_spread(wall: DemonstrationSet) -> None:
    told = demonstration_statistics(wall)
    assert (told.episodes, told.targets, told.groups, told.photographs) == (36, 18, 3, 36)
    assert told.samples == 36 * 61
    np.testing.assert_allclose(told.durations, 2.0)
    np.testing.assert_allclose(told.rates, 30.0)
    joint, task = told.spaces
    assert joint.names == ("shoulder", "elbow", "wrist")
    # repeats end 3 mm apart; the wrist always ends alike
    assert joint.spread[0] == pytest.approx(0.003, rel=0.5)
    assert joint.spread[2] == pytest.approx(0.0, abs=1e-12)
    assert task.spread[1] == pytest.approx(0.003, rel=0.5)
    json.dumps(told.to_json(), allow_nan=False)


def test_single_reaches_have_no_spread(wall: DemonstrationSet) -> None:
    told = demonstration_statistics(wall.subset([0, 2]))
    assert np.isnan(told.spaces[0].spread).all()
    assert told.to_json()["joint_space"]["wrist"]["end_spread"] is None


def test_movements_of_unknown_duration() -> None:
    phase = Trajectory(np.linspace(0, 1, 9), np.linspace(0, 1, 9)[:, None], clock="phase")
    told = demonstration_statistics(DemonstrationSet((Episode(id="a", joints=phase),)))
    assert told.to_json()["seconds"] is None


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_figures_are_drawn(small_wall: DemonstrationSet, tmp_path: Path, suffix: str) -> None:
    path = draw_demonstrations(small_wall, tmp_path / f"a.{suffix}")
    if suffix == "png":
        image = cv2.imread(str(path))
        assert image is not None
        assert image.std() > 5
    with pytest.raises(OutputExistsError):
        draw_demonstrations(small_wall, path)


def test_figures_of_little(wall: DemonstrationSet, tmp_path: Path) -> None:
    bare = DemonstrationSet((replace(wall[0], photographs=(), target=None, poses=None),))
    draw_demonstrations(bare, tmp_path / "bare.png")
    only_poses = DemonstrationSet((replace(wall[0], joints=None),))
    draw_demonstrations(only_poses, tmp_path / "poses.png")
    with pytest.raises(OutputError, match=r"\.png"):
        draw_demonstrations(bare, tmp_path / "bare.gif")
